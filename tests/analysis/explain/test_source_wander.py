"""Daylight wanders by half a per cent while an arm reads, under any sky: that is no cloud."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from analysis.explain import noise
from analysis.explain.conclusion import Conclusion
from analysis.explain.families import CLOUD
from analysis.explain.fit import Fitter
from analysis.explain.hypers import Hyper
from analysis.explain.hypothesis import Hypothesis
from analysis.explain.noise import SOURCE, Nuisance, source_wander
from analysis.explain.readings import Readings
from analysis.explain.repeats import repeats
from analysis.explain.scene import Scene
from analysis.explain.thresholds import SHOWN
from analysis.explain.wander import Wandering
from tests.analysis.explain import effects
from tests.analysis.explain.campaign import TESTS, make_case

BROKEN = tuple(replace(test, sky="partly-cloudy") for test in TESTS[::2])


def test_readings_soon_after_each_other_err_together(arm: Scene) -> None:
    r = arm.readings
    rows = np.flatnonzero(r.test == 0)
    made = source_wander(r, rows)
    assert np.diag(made) == pytest.approx(SOURCE**2)
    t = (r.utc_ns[rows] - r.utc_ns[rows[0]]) / 1e9
    soon, late = t < 15.0, t > 90.0
    assert np.any(soon) and np.any(late)
    assert made[0, soon].min() > 0.9 * SOURCE**2 > 0.6 * SOURCE**2 > made[0, late].max()
    assert np.linalg.eigvalsh(made).min() > -1e-12
    assert not np.any(source_wander(replace(r, utc_ns=np.full_like(r.utc_ns, -1)), rows))


def test_it_adds_to_the_errors_of_a_system_and_is_forgotten_from_day_to_day(
    arm: Scene, monkeypatch: pytest.MonkeyPatch
) -> None:
    r = arm.readings
    nuisance, hyper = Nuisance(r, np.zeros((len(r), 0)), np.zeros(len(r))), Hyper(1.0, 1.0)
    block = nuisance.blocks[0]
    with_it = nuisance.matrix(block, hyper)
    monkeypatch.setattr(noise, "SOURCE", 0.0)
    steady = Nuisance(r, np.zeros((len(r), 0)), np.zeros(len(r)))
    added = with_it - steady.matrix(steady.blocks[0], hyper)
    t = r.utc_ns[block.rows] / 1e9
    later = np.abs(t[:, None] - t[None, :]) > 3600.0
    assert np.any(later) and np.abs(added[later]).max() < 1e-3 * SOURCE**2
    bright = np.abs(r.measured[block.rows]) > 0.99 * r.scale[block.rows]
    assert np.diag(added)[bright] == pytest.approx(SOURCE**2, rel=0.03)


def test_readings_of_nadir_that_wander_as_daylight_does_show_no_cloud(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of a sky that wanders by 1.2 % they say nothing, and did while a steady one was supposed; of 5 % what is so."""

    def gain(folder: Path, sd: float) -> float:
        scene = Scene(Readings.of(make_case(folder, effects.clouds(sd, 45.0), tests=BROKEN)))
        fitter = Fitter(scene)
        fit = fitter.fit((), np.zeros(0), Hyper(1.0, 0.3, 0.4))
        return repeats(scene, fit, Wandering(CLOUD, sd, 45.0)).gain

    calm = gain(tmp_path / "calm", 0.012)
    assert calm < SHOWN < gain(tmp_path / "cloud", 0.05)
    monkeypatch.setattr(noise, "SOURCE", 1e-6)
    assert gain(tmp_path / "steady", 0.012) > SHOWN > calm


def test_a_gain_of_a_test_is_no_cloud(tmp_path: Path) -> None:
    """Another level of all readings of nadir says nothing of what changed in between; a slow cloud could be one."""
    scene = Scene(Readings.of(make_case(tmp_path, tests=BROKEN)))
    fit = Fitter(scene).fit((), np.zeros(0), Hyper(1.0, 0.3, 0.4))
    found = []
    for level in (0.0, 0.2):
        moved = replace(fit, residual=fit.residual + level)
        found.append(repeats(scene, moved, Wandering(CLOUD, 0.25, 140.0)))
    assert found[0].contradict and found[1].contradict
    assert found[1].gain == pytest.approx(found[0].gain, abs=1.0)


def test_what_is_named_is_not_said_to_be_ruled_out(arm: Scene) -> None:
    """Readings of nadir that show a cloud beside nothing, and would not beside another name, do not rule it out."""
    nothing = Hypothesis(Fitter(arm).fit((), np.zeros(0), Hyper(1.0, 1.0)), 0.0)
    cloud = replace(nothing, wanders=(Wandering(CLOUD, 0.05, 25.0),))
    for best, told in ((nothing, {CLOUD.name}), (cloud, set())):
        assert set(Conclusion(best, nothing, [], contradicted={CLOUD.name: "why"}).ruled_out) == told
