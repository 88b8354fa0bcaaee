"""Luminance meters on the roof that stand under each other's name."""

from datetime import timedelta
from pathlib import Path

import numpy as np
import pytest

from analysis.cases import Case, write_case
from analysis.cases.model import Records
from analysis.explain.answer import answer
from analysis.explain.mechanisms.base import predict, terms_of
from analysis.explain.mechanisms.catalogue import BY_ID
from analysis.explain.mismatch import explain
from analysis.explain.readings import Readings
from analysis.explain.scene import Scene
from tests.analysis.explain.campaign import Floats
from tests.analysis.explain.roof import SKY_TESTS, luminance, sky_case, sky_setup, sun_of

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
