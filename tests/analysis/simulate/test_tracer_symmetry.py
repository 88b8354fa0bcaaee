"""Laws of symmetry and reciprocity."""

import math

import numpy as np
import pytest

from analysis.simulate.components import Lens
from analysis.simulate.source import skies, suns
from analysis.simulate.system import System, named
from analysis.simulate.tally import Intensity
from analysis.simulate.tracer import Settings, trace

GAMMA = np.array([5.0, 25.0, 45.0, 65.0])[None, :]
C = np.arange(0.0, 360.0, 30.0)[:, None]


def look(system: System, azimuth: float, gamma: np.ndarray = GAMMA, c: np.ndarray = C) -> Intensity:
    return trace(system, suns(40.0, azimuth), Settings(rays=200_000)).intensity(gamma, c)


def same(a: Intensity, b: Intensity) -> bool:
    """Whether two predictions agree within 5 standard uncertainties and 2 % of the largest value (smoothing)."""
    spread = 5 * np.hypot(a.uncertainty, b.uncertainty) + 0.02 * a.candela.max()
    return bool(np.all(np.abs(a.candela - b.candela) < spread))


@pytest.mark.parametrize("name", ["top", "box", "tube"])
def test_a_quarter_turn_of_the_sun_turns_the_light(name: str) -> None:
    """The systems look the same after a quarter turn. Azimuth runs the other way than C."""
    a = look(named(name), 70.0)
    b = look(named(name), 160.0, c=C - 90.0)
    assert same(a, b)
    assert not same(a, look(named(name), 160.0))


@pytest.mark.parametrize("name", ["top", "box", "tube"])
def test_a_mirrored_sun_mirrors_the_light(name: str) -> None:
    a = look(named(name), 70.0)
    b = look(named(name), -70.0, c=-C)
    assert same(a, b)


@pytest.mark.parametrize("name", ["box", "tube"])
def test_turning_the_whole_skylight_with_the_sun_turns_the_light(name: str) -> None:
    a = look(named(name), 70.0)
    b = look(named(name).replace(rotation_deg=33.0), 70.0 - 33.0, c=C + 33.0)
    assert same(a, b)


def test_turned_and_mirrored_lens() -> None:
    """A lens mirrored after being turned by +20 degrees is the lens turned by -20; a quarter turn changes nothing."""
    box = named("box")

    def lens(angle: float, mirrored: bool) -> System:
        return box.with_settings(
            {f"{p}.{k}": v for p in ("entry", "exit") for k, v in (("orientation_deg", angle), ("mirrored", mirrored))}
        )

    assert same(look(lens(20.0, True), 70.0), look(lens(-20.0, False), 70.0))
    assert same(look(lens(20.0, False), 70.0), look(lens(110.0, False), 70.0))
    assert not same(look(lens(20.0, False), 70.0), look(lens(-20.0, False), 70.0))
    mirrored_sun = look(lens(20.0, False), -70.0, c=-C)
    assert same(mirrored_sun, look(lens(20.0, True), 70.0))


def test_isotropic_lens_is_the_mean_over_all_orientations() -> None:
    flat = named("box").replace(rise_m=0.0, exit=Lens(kind="none"), well_depth_m=1e-6)
    isotropic = look(flat.with_settings({"entry.isotropic": True}), 70.0)
    turned = [look(flat.with_settings({"entry.orientation_deg": a}), 70.0) for a in np.arange(0.0, 90.0, 6.0)]
    mean = np.mean([one.candela for one in turned], axis=0)
    error = np.sqrt(np.sum([one.uncertainty**2 for one in turned], axis=0)) / len(turned)
    assert same(isotropic, Intensity(mean, error))
    assert not same(isotropic, turned[0])


def test_diffuse_light_passes_as_well_down_as_up() -> None:
    """Reciprocity: a flat sheet on an open aperture passes as much of an even sky with prisms up as down."""
    flat = named("box").replace(rise_m=0.0, exit=Lens(kind="none"), well_depth_m=1e-6)
    sky = skies([lambda d: np.ones(d.shape[:-1])])
    down, up = (
        trace(flat.with_settings({"entry.prisms": side}), sky, Settings(rays=400_000)).flux() for side in ("down", "up")
    )
    # tables of 4096 samples per direction: 1e-3 of noise that more rays do not remove
    assert down[0] == pytest.approx(up[0], rel=4e-3)


def test_bidirectional_reciprocity_of_a_sheet() -> None:
    """Light passes from A to B like from B to A: intensity over (area, cosines, illuminance), both ways."""
    flat = named("box").replace(rise_m=0.0, exit=Lens(kind="none"), well_depth_m=1e-6)

    def btdf(prisms: str, altitude: float, azimuth: float, gamma: float, c: float) -> tuple[float, float]:
        system = flat.with_settings({"entry.prisms": prisms, "entry.blur_deg": 12.0})
        tally = trace(system, suns(altitude, azimuth), Settings(rays=500_000))
        result = tally.intensity(gamma, c)
        scale = flat.aperture_area_m2 * math.sin(math.radians(altitude)) * math.cos(math.radians(gamma))
        return float(result.candela[0] / scale), float(result.uncertainty[0] / scale)

    # sun at altitude 60, azimuth 40, seen at gamma 20, C 100; backwards the room side is up, so C and azimuth exchange
    one, e1 = btdf("down", 60.0, 40.0, 20.0, 100.0)
    two, e2 = btdf("up", 70.0, 360.0 - 100.0, 30.0, 360.0 - 40.0)
    assert one == pytest.approx(two, abs=4 * math.hypot(e1, e2) + 0.03 * one)
