"""Two engines, one physics: Radiance backwards against our tracer forwards."""

import math

import numpy as np
import pytest
from numpy.typing import NDArray

from analysis.simulate.daylight import Daylight, daylight
from analysis.simulate.predict import Prediction, predict
from analysis.simulate.radiance.engine import SUN_CAP_DEG, aperture_rays, coefficients, patch_means
from analysis.simulate.radiance.scene import scene_text
from analysis.simulate.source import suns
from analysis.simulate.system import Lens, System, Wall, named
from analysis.simulate.tracer import Settings, trace
from labdaq.errors import SimulationError

Floats = NDArray[np.float64]
NONE = Lens(kind="none")
GAMMA = np.array([0.0, 15.0, 35.0, 55.0, 75.0, 90.0])
C = np.array([0.0, 45.0, 90.0, 180.0, 270.0, 360.0])

DOME_TUBE = named("tube").replace(exit=NONE, boot_height_m=0.0)
WHITE_WELL = named("top").replace(rise_m=0.0, entry=NONE)


def overcast() -> Daylight:
    return daylight(45.0, 100.0, 20_000.0, 20_000.0, "overcast")


def both(
    system: System, distance_m: float, day: Daylight, rays: int, precision: float
) -> tuple[Prediction, Prediction]:
    grid = {"gamma_deg": GAMMA, "c_deg": C}
    ours = predict(system, day, distance_m=distance_m, rays=rays, threads=1, **grid)
    theirs = predict(system, day, distance_m=distance_m, engine="radiance", precision=precision, **grid)
    return ours, theirs


@pytest.mark.parametrize("system", [DOME_TUBE, WHITE_WELL, named("tube").replace(exit=NONE)], ids=lambda s: s.name)
@pytest.mark.parametrize("field", ["far", "near"])
def test_open_systems_agree_within_their_uncertainties(system: System, field: str) -> None:
    ours, theirs = both(system, 2.6 if field == "near" else 0.0, overcast(), 400_000, 0.02)
    a, b = (made.field("near" if field == "near" else "far") for made in (ours, theirs))
    bright = a.sky.candela > 0.05 * a.sky.candela.max()
    difference = a.sky.candela - b.sky.candela
    # smoothing and 2305 sky patches leave 2 % of bias besides the statistics of both
    allowed = 4.0 * np.hypot(a.sky_uncertainty, b.sky_uncertainty) + 0.02 * a.sky.candela.max()
    assert np.all(np.abs(difference)[bright] < allowed[bright])
    assert np.mean(b.sky.candela[bright] / a.sky.candela[bright]) == pytest.approx(1.0, abs=0.02)


def test_a_sun_cap_shines_down_a_dome_tube() -> None:
    """Flux of the same widened sun: Radiance over all directions (far field) against the tracer's count."""
    gamma, c = np.arange(0.5, 90.0, 1.0), np.arange(0.0, 360.0, 10.0)
    day = daylight(60.0, 100.0, 80_000.0, 20_000.0, "uniform")
    got = coefficients(DOME_TUBE, [day], gamma, c, 0.0, 64, processes=1)
    candela = (got.suns[..., 0].mean(axis=0) * got.weight).reshape(len(c), len(gamma))
    flux = float((candela * np.sin(np.radians(gamma))).sum() * math.radians(1.0) * math.radians(10.0))
    flux *= day.normal_lx / (math.pi * math.sin(math.radians(SUN_CAP_DEG)) ** 2)
    tally = trace(
        DOME_TUBE, suns(60.0, 100.0, day.normal_lx, radius_deg=SUN_CAP_DEG), Settings(rays=200_000, distance_m=0.0)
    )
    assert flux == pytest.approx(tally.flux()[0][0], rel=0.03)


def test_rays_weigh_the_aperture_as_sensors_do() -> None:
    """The near-field weights are the integral of cos cos / r² (times distance²), and rays leave from the aperture."""
    rng = np.random.default_rng(2)
    gamma = np.array([0.0, 60.0, 85.0])
    rays, weight = aperture_rays(named("box"), gamma, np.zeros(3), 2.6, 512, rng)
    area = 0.6096**2
    # figures of a numerical integration: .982 at nadir, 1.018 at 85 degrees, over area times cosine
    assert weight / (area * np.cos(np.radians(gamma))) == pytest.approx([0.982, 1.0, 1.018], abs=0.004)
    place = rays[:, :3] + 1e-4 * rays[:, 3:]
    assert np.all(np.abs(place[:, :2]) <= 0.3048 + 1e-6) and np.allclose(place[:, 2], 0.0)
    back = place - rays[:, 3:] * (place[:, 2] + 2.6)[:, None]
    assert np.all(rays[:, 5] > 0.0) and np.allclose(back[:512, :2], 0.0, atol=0.35)


def test_patch_means_keep_the_illuminance() -> None:
    from analysis.sky.patches import reinhart

    day = overcast()
    projected = reinhart(4).projected_sr
    assert patch_means(day.sky) @ projected == pytest.approx(20_000.0, rel=2e-3)


def test_what_it_cannot_do_is_said() -> None:
    hazy = named("box").with_settings({"exit.haze": 0.1})
    spread = named("box").replace(entry=NONE, exit=NONE, wall=Wall(scatter_deg=2.0))
    for system in (hazy, spread):
        with pytest.raises(SimulationError, match="tracer"):
            scene_text(system, {}, [], 0.2665)


@pytest.mark.slow
@pytest.mark.timeout(1800)
@pytest.mark.parametrize("name", ["top", "box", "tube"])
def test_whole_systems_agree(name: str) -> None:
    """All three systems with their prismatic lenses (tensor trees of 3.6 degrees) under the Greenwood tests' skies.

    Sky part: flux within 1 %, and 5 % rms of the directions (the trees' cells broaden what is near grazing). Sun part:
    flux within 5 %; direction by direction only where a lens blurs more than the tree's cells.
    """
    gamma, c = np.arange(2.5, 90.0, 5.0), np.arange(0.0, 360.0, 22.5)
    closed_c = np.append(c, 360.0)
    system = named(name)
    for altitude, azimuth, total, diffuse in ((31.2, 85.6, 45_717.0, 17_343.0), (62.0, 130.0, 98_000.0, 22_000.0)):
        day = daylight(altitude, azimuth, total, diffuse, "perez")
        grid = {"gamma_deg": gamma, "c_deg": closed_c}
        ours = predict(system, day, distance_m=2.6, rays=4_000_000, **grid).field("near")
        theirs = predict(system, day, distance_m=2.6, engine="radiance", precision=0.018, **grid).field("near")
        for part, limit in (("sky", 0.01), ("sun", 0.05)):
            a, b = getattr(ours, part).candela[:-1], getattr(theirs, part).candela[:-1]
            weight = np.sin(np.radians(gamma))
            assert (b * weight).sum() == pytest.approx((a * weight).sum(), rel=limit), part
        a, b = ours.sky.candela, theirs.sky.candela
        bright = a > 0.1 * a.max()
        assert np.sqrt(np.mean((b[bright] / a[bright] - 1.0) ** 2)) < 0.05
