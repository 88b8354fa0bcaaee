"""Where a mismatch is told to lie: by itself, or by a law that all readings follow together."""

from dataclasses import replace

import numpy as np
import pytest

from analysis.explain import whereabouts
from analysis.explain.conclusion import Conclusion, Unnamed
from analysis.explain.fit import MIDDLE, Fitter
from analysis.explain.hypothesis import Hypothesis
from analysis.explain.locate import Scan
from analysis.explain.mechanisms.base import predict
from analysis.explain.mechanisms.conjectures import CONJECTURES
from analysis.explain.mechanisms.states import terms_of
from analysis.explain.mismatch import LOOKING
from analysis.explain.scene import Scene
from analysis.explain.wander import Wander, Wandering
from analysis.explain.whereabouts import places
from tests.analysis.explain.campaign import Floats


@pytest.fixture(scope="module")
def fitter(arm: Scene) -> Fitter:
    return Fitter(arm)


@pytest.fixture(scope="module")
def scan(arm: Scene, fitter: Fitter) -> Scan:
    return Scan.of(arm.readings, fitter.whitener(LOOKING))


def _tilted(fitter: Fitter, gain: float) -> tuple[Conclusion, Floats]:
    """A conclusion that names nothing and finds the light tilted by a third of a degree, and what that changes."""
    nothing = Hypothesis(fitter.fit((), np.zeros(0), MIDDLE), 0.0)
    law = next(m for m in CONJECTURES if m.id == "tilted-axis")
    terms, theta = terms_of(law, fitter.scene), np.array([0.3, 0.0])
    law_holds = Hypothesis(replace(nothing.fit, terms=terms, theta=theta), gain)
    found = Conclusion(nothing, nothing, [], verdict="unexplained")
    found.unnamed = [Unnamed("tilted-axis", gain, 0.3, terms[0], weighed=law_holds)]
    r = fitter.scene.readings
    return found, r.stretched(predict(fitter.scene, terms, theta)) - r.stretched(r.simulated)


def test_a_law_tells_the_place_that_no_region_shows(scan: Scan, fitter: Fitter) -> None:
    found, change = _tilted(fitter, 40.0)
    assert scan.standing_out(0.2 * change) == []
    told = places(scan, 0.2 * change, fitter, found)
    spots = [m for m in told if not m.holds]
    assert spots
    for place in spots:
        inside = place.region.rows
        assert place.size == pytest.approx(change[inside].mean())
        assert np.mean(change[inside] ** 2) > np.mean(change**2)
        assert place.statement.endswith("as tilted-axis has it.")
        assert place.p_value == pytest.approx(np.exp(-40.0))


def test_a_change_that_goes_up_and_down_lies_where_half_of_it_does(arm: Scene, scan: Scan) -> None:
    """A wave around three rings has no mean anywhere that is whole; an even change is nowhere more than elsewhere."""
    r = arm.readings
    rings = np.isin(np.round(r.gamma_deg), (45.0, 55.0, 65.0))
    wave = 0.1 * np.cos(np.radians(2.0 * r.c_deg)) * np.where(rings, 1.0, 0.2)
    (half,) = scan.holding_half(wave, 1e-9, "a wave")
    assert "gamma" in half.region.name and "in all planes" in half.region.name
    inside = half.region.rows
    assert half.holds == pytest.approx(np.sum(wave[inside] ** 2) / np.sum(wave**2)) and half.holds > 0.5
    smaller = [x for x in scan.regions if np.sum(wave[x.rows] ** 2) >= 0.5 * np.sum(wave**2)]
    assert np.count_nonzero(inside) == min(np.count_nonzero(x.rows) for x in smaller) < 0.4 * len(r)
    assert half.size == pytest.approx(wave[inside].mean()) and half.rms == pytest.approx(np.std(wave[inside]), rel=0.01)
    assert half.statement.startswith(f"Of what a wave changes, {half.holds:.0%} (in squares) lies from gamma")
    assert scan.holding_half(np.full(len(r), 0.1), 1e-9, "a level") == []


def test_the_half_is_told_beside_the_spots_and_no_place_twice(
    scan: Scan, fitter: Fitter, monkeypatch: pytest.MonkeyPatch
) -> None:
    found, change = _tilted(fitter, 40.0)
    rings = np.where(np.abs(fitter.scene.readings.gamma_deg - 55.0) < 16.0, 1.0, 0.1)
    monkeypatch.setattr(whereabouts, "_change", lambda *_: rings * change)
    told = places(scan, 0.0 * change, fitter, found)
    (half,) = [m for m in told if m.holds]
    assert half.by == "tilted-axis" and half.p_value == pytest.approx(np.exp(-40.0))
    assert len({m.region.name for m in told}) == len(told) > 1


def test_names_that_were_withdrawn_tell_no_place(scan: Scan, fitter: Fitter) -> None:
    found, change = _tilted(fitter, 0.0)
    law = found.unnamed[0].weighed
    assert law is not None
    found.best, found.unnamed = replace(law, evidence=130.0), []
    assert any(m.by for m in places(scan, 0.0 * change, fitter, found))
    found.withdrawn = True
    assert not any(m.by for m in places(scan, 0.0 * change, fitter, found))


def test_what_tells_little_is_not_sure_of_the_place(scan: Scan, fitter: Fitter) -> None:
    """Then the region that stands out most is told, with how seldom that is less."""
    found, change = _tilted(fitter, 0.0)
    (told,) = places(scan, 0.2 * change, fitter, found)
    assert told.by == ""
    assert told.p_value > 0.01


def test_where_there_is_no_mismatch_no_law_tells_a_place(scan: Scan, fitter: Fitter) -> None:
    found, change = _tilted(fitter, 40.0)
    found.verdict = "no-mismatch"
    assert places(scan, 0.2 * change, fitter, found) == []


def test_a_random_function_lies_where_it_most_likely_is(arm: Scene, scan: Scan, fitter: Fitter) -> None:
    """A function of nobody's making that raises one ring: its mean is high there and low elsewhere."""
    r = arm.readings
    rings = (np.round(r.gamma_deg)[:, None] == np.unique(np.round(r.gamma_deg))[None, :]).astype(np.float64)
    ring = np.round(r.gamma_deg) == 45.0
    wander = Wander("rings", "gamma", (lambda scene, length: rings,), (0.1,), (1.0,))
    found, _ = _tilted(fitter, 40.0)
    base = found.nothing.fit
    seen = np.where(ring, 0.08, 0.0)
    raised = Hypothesis(replace(base, residual=seen), 50.0, (Wandering(wander, 0.1),))
    found.unnamed = [Unnamed("gamma", 50.0, 0.1, weighed=raised)]
    first, *_ = places(scan, 0.0 * seen, fitter, found)
    assert first.region.name == "at gamma 45°, in all planes"
    assert 0.02 < first.size < 0.08
    assert "some function of gamma" in first.statement
