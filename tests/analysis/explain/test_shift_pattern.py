"""A lens's pattern that nobody knows beforehand, read off recordings under several suns."""

import json
from pathlib import Path

import numpy as np
import pytest

from analysis.explain import asked, retrace, shift_pattern
from analysis.explain.apply import Model, apply_model
from analysis.explain.conclusion import Conclusion
from analysis.explain.families import PATTERN, named_wanders
from analysis.explain.fit import Fitter
from analysis.explain.heldout import rms
from analysis.explain.mechanisms.lens import LensAnisotropy
from analysis.explain.parameter import Parameter
from analysis.explain.readings import Readings
from analysis.explain.retrace import Retraced
from analysis.explain.scene import Scene
from analysis.explain.search import Search
from analysis.explain.told_pattern import with_its_pattern
from labdaq import directions
from tests.analysis.explain import campaign
from tests.analysis.explain.campaign import Floats, Rows, Sky, columns, light, make_case
from tests.analysis.explain.untraced import Untraced


def _shift(test: Sky, gamma_deg: Floats, c_deg: Floats) -> tuple[Floats, Floats]:
    """How far, and to which side, a lens sends the sun's light: worked out here from angles, not from vectors."""
    altitude, azimuth = np.radians(test.sun)
    east = -np.sin(np.radians(gamma_deg)) * np.sin(np.radians(c_deg)) + np.cos(altitude) * np.sin(azimuth)
    north = np.sin(np.radians(gamma_deg)) * np.cos(np.radians(c_deg)) + np.cos(altitude) * np.cos(azimuth)
    return np.hypot(east, north), np.arctan2(north, east)


def round_lens(test: Sky, gamma_deg: Floats, c_deg: Floats) -> Floats:
    """The beam's light [cd] through a lens that knows no directions."""
    far, _ = _shift(test, gamma_deg, c_deg)
    gamma, _ = np.broadcast_arrays(np.radians(gamma_deg), c_deg)
    return np.asarray(
        0.2 * (test.global_lx - test.diffuse_lx) * np.exp(-0.5 * (far / 0.45) ** 2) * np.cos(gamma) ** 0.5
    )


def patterned(size: float) -> campaign.Truth:
    """The light through a lens with more to two sides than to the others, and sharper edges of a square."""

    def truth(rows: Rows) -> Floats:
        made = light(rows)
        sun = campaign.part(rows, campaign.sun_part, rows.gamma_deg, rows.c_deg)
        for k, test in enumerate(rows.tests):
            here = (rows.test == k) & (test.system == "box")
            far, side = _shift(test, rows.gamma_deg[here], rows.c_deg[here])
            made[here] += (
                size * sun[here] * np.minimum(far / 0.4, 1.0) * (np.cos(2.0 * side - 0.7) + 0.5 * np.sin(4.0 * side))
            )
        return made

    return truth


@pytest.fixture
def without_pattern(monkeypatch: pytest.MonkeyPatch) -> None:
    """The campaign's prediction is of a round lens."""
    monkeypatch.setattr(campaign, "sun_part", round_lens)


def scene_of(folder: Path, size: float) -> Scene:
    return Scene(Readings.of(make_case(folder, patterned(size))), Retraced({}, Untraced()))


def test_unit_effects_turn_with_the_lens() -> None:
    """Turned by a quarter together with the sun, what repeats itself four times is as before, twice the other way."""
    rng = np.random.default_rng(3)
    out, sun = (directions.vector(rng.uniform(20.0, 70.0, 40), rng.uniform(0.0, 360.0, 40)) for _ in range(2))
    sun = -sun
    before = shift_pattern.basis(out, sun)
    axis = np.array([0.0, 0.0, 1.0])
    after = shift_pattern.basis(directions.rotated(out, axis, 90.0), directions.rotated(sun, axis, 90.0))
    for k, way in enumerate(shift_pattern.WAYS):
        if way[0] in "24":
            assert after[k] == pytest.approx((-1.0) ** (way[0] == "2") * before[k], abs=1e-12)
    still = shift_pattern.basis(-sun, sun)  # light that is not shifted has no side
    assert np.abs(still).max() < 1e-12
    assert np.sum(before**2, axis=0).max() < 1.0 + 1e-9


@pytest.mark.usefixtures("without_pattern")
def test_a_prediction_without_a_pattern_is_known_by_itself(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    scene = scene_of(tmp_path / "round", 0.0)
    assert list(shift_pattern.without_pattern(scene)) == ["box"]  # of tubes nobody can tell
    assert not shift_pattern.has_pattern(scene)
    assert named_wanders(scene, {PATTERN.name}) == (PATTERN,)
    one_sided = patterned(0.4)

    def square(test: Sky, gamma_deg: Floats, c_deg: Floats) -> Floats:
        far, side = _shift(test, gamma_deg, c_deg)
        return np.asarray(
            round_lens(test, gamma_deg, c_deg) * (1.0 + 0.6 * np.minimum(far / 0.4, 1.0) * np.cos(4 * side))
        )

    monkeypatch.setattr(campaign, "sun_part", square)
    known = Scene(Readings.of(make_case(tmp_path / "square", one_sided)), Retraced({}, Untraced()))
    assert shift_pattern.without_pattern(known) == {}
    assert shift_pattern.has_pattern(known)
    assert named_wanders(known, {PATTERN.name}) == ()


@pytest.mark.usefixtures("without_pattern")
def test_a_pattern_is_told_and_predicts_other_suns(tmp_path: Path) -> None:
    scene = scene_of(tmp_path / "case", 0.12)
    search = Search(Fitter(scene), [], [])
    nothing = search.nothing()
    weighed = search.wandering(nothing, PATTERN, ())
    found = Conclusion(weighed, nothing, [weighed])
    assert weighed.evidence - nothing.evidence > asked.first(weighed, found, 1.0)
    told = with_its_pattern(search, weighed)
    assert told.ids == weighed.ids == ("lens-anisotropy",) and not told.wanders
    assert told.evidence == weighed.evidence
    assert rms(told.fit.residual) < 0.75 * rms(nothing.fit.residual)
    report = LensAnisotropy().report(told.fit.theta, np.sqrt(np.diag(told.fit.covariance)), told.fit.terms[0])
    true = 0.12 * np.sqrt(0.5 * (1.0 + 0.5**2)) * 0.96  # its rms over shifts up to one; within .4 it grows with them
    assert float(report["contrast"]["value"]) == pytest.approx(true, rel=0.4)
    (term,) = told.fit.terms
    entry = {
        "id": "lens-anisotropy",
        "way": term.branch.label,
        "facts": term.branch.facts,
        "theta": told.fit.theta.tolist(),
        "sd": np.sqrt(np.diag(told.fit.covariance)).tolist(),
        "names": [p.name for p in term.parameters],
        "only": ["box"],
    }
    other = make_case(tmp_path / "other", patterned(0.12), tests=campaign.WITHHELD, flaws=campaign.NONE)
    model = Model((json.loads(json.dumps(entry)),))
    corrected, before, truth = columns(apply_model(model, other, Traced()), "corrected", "simulated", "measured")
    box = np.arange(len(truth)) < len(truth) // 2
    assert rms(np.log(corrected / truth)[box]) < 0.75 * rms(np.log(before / truth)[box])
    assert corrected[~box] == pytest.approx(before[~box])


@pytest.mark.usefixtures("without_pattern")
def test_where_there_is_none_none_is_told(tmp_path: Path) -> None:
    search = Search(Fitter(scene_of(tmp_path, 0.0)), [], [])
    nothing = search.nothing()
    assert search.wandering(nothing, PATTERN, ()).evidence < nothing.evidence
    assert with_its_pattern(search, nothing) is nothing


class Traced(Untraced):
    """A simulator that has a pattern of its own."""

    def paths(self, mechanism: str) -> tuple[retrace.Path, ...]:
        if mechanism != "lens-anisotropy":
            return ()
        one = np.ones((2, 2, 72, 37))
        weight = Parameter("weight", "1", "a pattern", 0.0, 4.0, 1.0, (1.0,))
        return (retrace.Path("a pattern", weight, np.array([0.0, 1.0]), one, one),)
