"""Instruments on the roof that stand under each other's name."""

from dataclasses import replace
from datetime import timedelta
from pathlib import Path

import numpy as np
import pytest

from analysis.cases import Case, write_case
from analysis.cases.model import Records
from analysis.explain.answer import answer
from analysis.explain.fit import MIDDLE, Fitter
from analysis.explain.mechanisms.base import predict
from analysis.explain.mechanisms.catalogue import BY_ID
from analysis.explain.mechanisms.states import in_its_state, terms_of
from analysis.explain.mismatch import explain
from analysis.explain.readings import Readings
from analysis.explain.scene import Scene
from analysis.explain.search import Search
from tests.analysis.explain.campaign import Floats
from tests.analysis.explain.roof import ROOF_TESTS, SKY_TESTS, luminance, roof_case, sky_case, sky_setup, sun_of

ZENITH = np.array([0.0, 45.0, 45.0, 45.0, 45.0])
AZIMUTH = np.array([0.0, 10.0, 100.0, 190.0, 280.0])
TUBES = tuple(f"tube{k}" for k in range(5))
READINGS = 12


def predicted() -> Floats:
    """Luminance of each test, moment and tube (4, 12, 5) [cd/m²]: the sun's glow moves on."""
    found = np.empty((len(SKY_TESTS), READINGS, len(TUBES)))
    for i, test in enumerate(SKY_TESTS):
        for k in range(READINGS):
            azimuth = AZIMUTH - (sun_of(SKY_TESTS, 300.0 * k)[1][i] - test.sun[1])
            found[i, k] = luminance(test, ZENITH, azimuth)
    return found


def tubes(folder: Path, measured: Floats, alike: bool = False) -> Case:
    """Five luminance meters that look one way each, read every five minutes of an hour."""
    sky = predicted()
    sky = np.broadcast_to(sky[:, :, :1], sky.shape) if alike else sky
    start = np.array([int(t.start.timestamp()) for t in SKY_TESTS])
    times = (start[:, None] + 300 * np.arange(READINGS)[None, :]) * 10**9
    test, _, tube = np.indices(sky.shape)
    unknown = np.full(sky.size, np.nan)
    records = Records(
        test=test.ravel(),
        channel=tube.ravel(),
        utc_ns=np.repeat(times.ravel(), len(TUBES)),
        gamma_deg=(180.0 - ZENITH)[tube.ravel()],
        c_deg=((360.0 - AZIMUTH) % 360.0)[tube.ravel()],
        measured=measured.ravel(),
        uncertainty=0.004 * sky.ravel(),
        simulated=sky.ravel(),
        sun=unknown,
        sky=unknown,
    )
    setup = sky_setup(TUBES, "luminance-meter", timedelta(hours=1))
    return write_case(folder, setup, records, replace=True)


def read(order: list[int], seed: int = 5) -> Floats:
    """What the tubes read in this order: noise, and a gain of each test and tube of half a per cent."""
    rng = np.random.default_rng(seed)
    gain = 1.0 + 0.005 * rng.normal(size=(len(SKY_TESTS), 1, len(TUBES)))
    return np.asarray(predicted()[:, :, order] * gain * (1.0 + 0.004 * rng.normal(size=predicted().shape)))


def test_two_tubes_under_each_others_name_are_named(tmp_path: Path) -> None:
    content = answer(explain(tubes(tmp_path / "case", read([0, 1, 4, 3, 2]))))
    (first,) = content["mechanisms"]
    assert first["id"] == "channel-swap"
    assert "tube2 and tube4" in first["statement"]


def test_tubes_under_their_own_name_are_not(tmp_path: Path) -> None:
    assert answer(explain(tubes(tmp_path / "case", read([0, 1, 2, 3, 4]))))["verdict"] == "no-mismatch"


def test_each_reads_what_the_other_would_have_read(tmp_path: Path) -> None:
    scene = Scene(Readings.of(tubes(tmp_path / "case", predicted())))
    way = next(w for w in terms_of(BY_ID["channel-swap"], scene) if w.branch.label == "tube0 and tube3")
    made = predict(scene, (way,), np.zeros(0)).reshape(predicted().shape)
    assert made == pytest.approx(predicted()[:, :, [3, 1, 2, 0, 4]], rel=1e-12)


def test_what_cannot_show_is_not_tried(tmp_path: Path) -> None:
    """A camera looks many ways; tubes that read the same light cannot tell."""
    camera = Scene(Readings.of(sky_case(tmp_path / "camera")))
    alike = Scene(Readings.of(tubes(tmp_path / "alike", predicted()[:, :, [0, 0, 0, 0, 0]], alike=True)))
    assert all(BY_ID["channel-swap"].why_not(scene) for scene in (camera, alike))


def exchanged(folder: Path, test: int) -> Scene:
    """A global and a shaded meter, exchanged in one of 22 tests."""
    case = roof_case(folder, {})
    r = case.records
    shaded, here = r.channel == 1, r.test == test
    simulated = np.where(shaded, r.sky, r.simulated)
    noisy = simulated * (1.0 + 0.003 * np.random.default_rng(6).normal(size=len(r)))
    measured = noisy.copy()
    measured[here & shaded], measured[here & ~shaded] = noisy[here & ~shaded], noisy[here & shaded]
    sun = np.where(shaded, 0.0, r.sun)
    records = replace(r, simulated=simulated, measured=measured, sun=sun, uncertainty=0.003 * simulated)
    return Scene(Readings.of(replace(case, records=records)))


def test_meters_that_were_exchanged_in_one_test_are_named(tmp_path: Path) -> None:
    scene = exchanged(tmp_path / "case", 7)
    names = ("channel-swap", "meter-gain", "dark-offset")
    best, *_ = Search(Fitter(scene), mechanisms=[BY_ID[name] for name in names], conjectures=()).singles()
    (way,) = best.fit.terms
    assert best.ids == ("channel-swap",) and way.tests == {7}
    assert way.branch.label == f"velux and konica, in {ROOF_TESTS[7].id}"


def test_an_exchange_of_one_test_is_none_at_other_times(tmp_path: Path) -> None:
    """What is told of it is when it began and ended: in another case of the station it acts between the two."""
    scene = exchanged(tmp_path / "case", 7)
    ways = terms_of(BY_ID["channel-swap"], scene)
    way = next(w for w in ways if w.tests == {7})
    whole = next(w for w in ways if w.tests is None)
    again = in_its_state(whole, scene, way.branch.label, way.branch.facts)
    assert again.tests == {7}
    late = {key: value + 30 * 86400.0 for key, value in way.branch.facts.items()}
    assert in_its_state(whole, scene, way.branch.label, late).tests == frozenset()


def test_an_exchange_promises_nothing_beside_others_where_none_was(tmp_path: Path) -> None:
    """What it changes is there or is not: a hundredth of it, which may fit what is left, is no exchange."""
    fitter = Fitter(Scene(Readings.of(tubes(tmp_path / "case", read([0, 1, 2, 3, 4])))))
    nothing = fitter.fit((), np.zeros(0), MIDDLE)
    ways = terms_of(BY_ID["channel-swap"], fitter.scene)
    assert max(drop for drop, _ in fitter.promises(ways, MIDDLE, nothing)) < -100.0


def test_what_fits_far_worse_than_nothing_is_told_by_how_far(tmp_path: Path) -> None:
    """Its sizes are not looked for; what does not fit by thousands was once the best, at sizes it was not fitted at."""
    search = Search(Fitter(Scene(Readings.of(tubes(tmp_path / "case", read([0, 1, 2, 3, 4]))))), conjectures=())
    found = {h.ids[0]: h.evidence for h in search.singles()}
    assert found["channel-swap"] < search.nothing().evidence - 50.0
    assert max(found.values()) < search.nothing().evidence + 10.0
