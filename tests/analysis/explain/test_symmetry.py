"""Whether a prediction knows a pattern is seen from its two sides."""

import dataclasses

import numpy as np
import pytest

from analysis.cases.model import Floats
from analysis.explain.fields import C_DEG, GAMMA_DEG
from analysis.explain.geometry import blurred
from analysis.explain.look import Likened
from analysis.explain.mechanisms.catalogue import BY_ID
from analysis.explain.retrace import Retraced
from analysis.explain.scene import Scene
from analysis.explain.symmetry import is_even
from analysis.simulate.daylight import Daylight, daylight, sun_source
from analysis.simulate.system import SYSTEMS, System
from analysis.simulate.tracer import Settings, trace
from labdaq.directions import c_of_azimuth
from tests.analysis.explain.untraced import Untraced

AZIMUTHS_DEG = (113.0, 150.0, 201.0, 238.0)
DAYS = [daylight(40.0, azimuth, 70_000.0, 12_000.0, "perez") for azimuth in AZIMUTHS_DEG]
NO_SKY = np.zeros((len(DAYS), len(C_DEG), len(GAMMA_DEG)))


def lit(days: list[Daylight], pattern: float) -> Floats:
    """A lobe away from each sun, on a pattern of four arms."""
    gamma, c = np.radians(GAMMA_DEG)[None, :], np.radians(C_DEG)[:, None]
    away = [np.radians(float(c_of_azimuth(day.sun_azimuth_deg)) + 180.0) for day in days]
    arms = 1.0 + pattern * np.sin(gamma) * np.cos(4.0 * c)
    return np.stack([1000.0 * np.cos(gamma) * (1.0 + np.sin(gamma) * np.cos(c - a)) * arms for a in away])


def test_without_a_pattern_both_sides_are_alike() -> None:
    assert is_even(DAYS, lit(DAYS, 0.0), NO_SKY)
    assert not is_even(DAYS, lit(DAYS, 0.2), NO_SKY)


def test_suns_over_the_patterns_own_planes_tell_nothing() -> None:
    """There four arms are even, too; and so they are where the skylight is turned to such a sun."""
    straight = [daylight(40.0, azimuth, 70_000.0, 12_000.0, "perez") for azimuth in (90.0, 135.0, 178.0, 228.0)]
    assert not is_even(straight, lit(straight, 0.0), NO_SKY)
    assert is_even(straight, lit(straight, 0.0), NO_SKY, rotation_deg=20.0)


def test_two_suns_tell_only_what_is_quite_even() -> None:
    few = DAYS[:2]
    assert is_even(few, lit(few, 0.0), NO_SKY[:2])
    assert is_even(DAYS, lit(DAYS, 0.02), NO_SKY) and not is_even(few, lit(few, 0.02), NO_SKY[:2])
    assert not is_even([], NO_SKY[:0], NO_SKY[:0])


def test_a_sky_is_even_by_itself() -> None:
    light = lit(DAYS, 0.0)
    assert not is_even(DAYS, light, 0.6 * light)
    assert is_even(DAYS, light, 0.3 * light)


@pytest.mark.timeout(300)
@pytest.mark.parametrize(("isotropic", "even"), [(True, True), (False, False)])
def test_a_tube_is_even_only_below_a_lens_without_a_pattern(isotropic: bool, even: bool) -> None:
    tube: System = SYSTEMS["tube"].with_settings({"exit.isotropic": isotropic})
    source = sun_source(DAYS)
    assert source is not None
    tally = trace(tube, source, Settings(rays=200_000, samples=2_048, sun_samples=2_048))
    light = blurred(tally.intensity(GAMMA_DEG[None, :], C_DEG[:, None]).candela, 6.0)  # the rays are few
    assert is_even(DAYS, light, NO_SKY) is even


@pytest.mark.parametrize("even", [True, False])
def test_nothing_can_lie_turned_in_a_prediction_without_a_pattern(arm: Scene, even: bool) -> None:
    traced = Untraced(systems={"box": Likened(SYSTEMS["box"], even=even)})
    seen = dataclasses.replace(arm, retraced=Retraced({}, traced))
    assert ("no pattern" in BY_ID["lens-orientation"].why_not(seen)) is even
