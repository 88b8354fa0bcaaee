"""Analytic gates of the tracer.

Tolerances are multiples of the run's own statistical uncertainty unless said otherwise.
"""

import math

import numpy as np
import pytest
from numpy.typing import NDArray

from analysis.simulate.components import Aperture, Lens, Wall
from analysis.simulate.source import skies, suns
from analysis.simulate.system import System, named
from analysis.simulate.tracer import Settings, trace

Floats = NDArray[np.float64]
NONE = Lens(kind="none")
OPEN = System(name="open", rise_m=0.0, well_depth_m=1e-6, entry=NONE, exit=NONE, wall=Wall(reflectance=0.0))


def even(directions: Floats) -> Floats:
    """A sky of even luminance 1 cd/m²."""
    return np.ones(directions.shape[:-1])


def slab_transmittance(theta: float, n: float, depth: float) -> float:
    """A slab by adding up its internal reflections one by one (not by the closed series of the kernel)."""
    inner = math.asin(math.sin(theta) / n)
    if theta == 0.0:
        r = [((n - 1) / (n + 1)) ** 2] * 2
    else:
        r = [
            (math.sin(theta - inner) / math.sin(theta + inner)) ** 2,
            (math.tan(theta - inner) / math.tan(theta + inner)) ** 2,
        ]
    tau = math.exp(-depth / math.cos(inner))
    return sum(0.5 * sum((1 - p) ** 2 * tau * (p * tau) ** (2 * k) for k in range(200)) for p in r)


@pytest.mark.parametrize("altitude", [90.0, 60.0, 30.0, 10.0])
def test_clear_slab_follows_fresnel(altitude: float) -> None:
    pane = OPEN.replace(entry=Lens(kind="clear", absorption_per_mm=0.02, thickness_mm=4.0))
    tally = trace(pane, suns(altitude, 40.0, radius_deg=0.0), Settings(rays=200_000))
    expected = slab_transmittance(math.radians(90.0 - altitude), 1.491, 0.08)
    flux, error = tally.flux()
    incident = OPEN.aperture_area_m2 * math.sin(math.radians(altitude))
    assert flux[0] / incident == pytest.approx(expected, abs=4 * error[0] / incident + 1e-6)


def near_field_of_lambertian(side: float, distance: float, gamma: float, c: float) -> float:
    """E D² of a square Lambertian aperture of luminance 1 for a sensor that faces its centre; midpoint rule, 200²."""
    t = (np.arange(200) + 0.5) / 200 * side - side / 2
    x, y = np.meshgrid(t, t)
    g, a = math.radians(gamma), math.radians(c)
    sensor = distance * np.array([-math.sin(g) * math.sin(a), math.sin(g) * math.cos(a), -math.cos(g)])
    to = np.stack([sensor[0] - x, sensor[1] - y, np.full_like(x, sensor[2])], axis=-1)
    r2 = np.sum(to**2, axis=-1)
    cos_aperture = -to[..., 2] / np.sqrt(r2)
    cos_sensor = to @ (sensor / distance) / np.sqrt(r2)
    return float(np.mean(cos_aperture * cos_sensor / r2) * side**2 * distance**2)


def test_lambertian_aperture_in_far_and_near_field() -> None:
    gammas = np.array([0.0, 15.0, 35.0, 55.0, 75.0, 85.0])
    tally = trace(OPEN, skies([even]), Settings(rays=4_000_000, distance_m=2.6))
    area = OPEN.aperture_area_m2
    far = tally.intensity(gammas, 22.5)
    assert np.allclose(far.candela[0], area * np.cos(np.radians(gammas)), atol=4 * far.uncertainty[0] + 2e-4 * area)
    near = tally.intensity(gammas, 22.5, "near")
    expected = np.array([near_field_of_lambertian(0.6096, 2.6, g, 22.5) for g in gammas])
    # reference figures of a Radiance run of the same geometry: .982 of the far field at nadir, 1.018 at 85 degrees
    assert expected[0] / area == pytest.approx(0.982, abs=5e-4)
    assert np.allclose(near.candela[0], expected, atol=4 * near.uncertainty[0] + 2e-4 * area)
    assert np.all(far.uncertainty[0][:-1] < 0.02 * far.candela[0][:-1])


def swift_smith(p: float, theta: float, reflectance: float) -> float:
    """Transmittance of a mirror tube of aspect p = L/d for parallel light.

    Swift & Smith 1995, Solar Energy Materials 36:159: (4/π) ∫ s²/√(1-s²) R^N (1-(1-R)(q-N)) ds,
    q = p tan θ / s, N = ⌊q⌋.
    """
    a = (np.arange(400_000) + 0.5) / 400_000 * math.pi / 2  # s = sin a removes the singularity at s = 1
    s = np.sin(a)
    q = p * math.tan(theta) / s
    n = np.floor(q)
    return float(4 / math.pi * np.mean(s**2 * reflectance**n * (1 - (1 - reflectance) * (q - n))) * math.pi / 2)


TUBE = System(
    name="bare tube",
    kind="tube",
    aperture=Aperture(shape="disc", diameter_m=0.3556),
    well_depth_m=0.9144,
    rise_m=0.0,
    entry=NONE,
    exit=NONE,
    wall=Wall(reflectance=0.9),
)


@pytest.mark.parametrize("altitude", [80.0, 55.0, 35.0, 15.0])
def test_mirror_tube_follows_swift_and_smith(altitude: float) -> None:
    tally = trace(TUBE, suns(altitude, 200.0, radius_deg=0.0), Settings(rays=400_000, bounces=160))
    incident = TUBE.aperture_area_m2 * math.sin(math.radians(altitude))
    for reflectance in (0.9, 0.98):  # the second from the first run's tallies
        flux, error = tally.flux(wall_reflectance=reflectance)
        expected = swift_smith(0.9144 / 0.3556, math.radians(90.0 - altitude), reflectance)
        assert flux[0] / incident == pytest.approx(expected, abs=4 * error[0] / incident + 1e-4)


def test_wall_by_wall_agrees_with_the_closed_form() -> None:
    """A trace of scatter (0.001 degrees) takes the step-by-step code through the same well."""
    stepped = TUBE.with_settings({"wall.scatter_deg": 0.001})
    box = named("box").replace(rise_m=0.0, entry=NONE, exit=NONE)
    for closed, slow in ((TUBE, stepped), (box, box.with_settings({"wall.scatter_deg": 0.001}))):
        source = suns(25.0, 130.0, radius_deg=0.0)
        a, b = (trace(s, source, Settings(rays=100_000)) for s in (closed, slow))
        assert a.flux()[0] == pytest.approx(b.flux()[0], rel=1e-3)
        by_bounce = [t.sharp[..., 0, :, :].sum(axis=(0, 1, 3, 4)) for t in (a, b)]
        assert np.allclose(*by_bounce, atol=2e-3 * by_bounce[0].sum())


def independent_diffuse_well(depth: float, half: float, rho: float, rays: int, rng: np.random.Generator) -> float:
    """Transmittance of a square Lambertian well under an even sky, by a plain array Monte Carlo in numpy."""
    p = rng.uniform(-half, half, (rays, 3))
    p[:, 2] = depth
    r, phi = np.sqrt(rng.random(rays)), 2 * math.pi * rng.random(rays)
    d = np.stack([r * np.cos(phi), r * np.sin(phi), -np.sqrt(1 - r**2)], axis=1)
    w, out = np.ones(rays), 0.0
    for _ in range(200):
        with np.errstate(divide="ignore"):
            t = np.stack([(np.copysign(half, d[:, i]) - p[:, i]) / d[:, i] for i in (0, 1)], axis=1)
            t = np.column_stack([t, np.where(d[:, 2] < 0, -p[:, 2], depth - p[:, 2]) / d[:, 2]])
        first = np.argmin(t, axis=1)
        p = p + d * t[np.arange(len(t)), first][:, None]
        out += w[(first == 2) & (d[:, 2] < 0)].sum()
        wall = first < 2
        p, d, w, first = p[wall], d[wall], w[wall] * rho, first[wall]
        if not len(p):
            break
        normal = np.zeros_like(d)
        normal[np.arange(len(d)), first] = -np.sign(d[np.arange(len(d)), first])
        spin = rng.normal(size=d.shape)
        d = normal + spin / np.linalg.norm(spin, axis=1, keepdims=True)
        d /= np.linalg.norm(d, axis=1, keepdims=True)
    return out / rays


def test_diffuse_well_agrees_with_a_plain_monte_carlo() -> None:
    well = named("top").replace(rise_m=0.0, entry=NONE)
    tally = trace(well, skies([even]), Settings(rays=1_000_000))
    flux, error = tally.flux()
    measured = flux[0] / (math.pi * well.aperture_area_m2)
    rays = 400_000
    expected = independent_diffuse_well(0.6096, 0.3048, 0.85, rays, np.random.default_rng(5))
    # 0.5 / sqrt(n) bounds the standard deviation of a mean of values between 0 and 1
    assert measured == pytest.approx(expected, abs=4 * (error[0] / math.pi / well.aperture_area_m2 + 0.5 / rays**0.5))
    balance = tally.balance
    assert balance.out / balance.entering == pytest.approx(measured, abs=3e-3)  # analog count against scored light


def test_half_diffuse_wall_lies_between_by_its_share_of_first_bounces() -> None:
    """Of light with exactly one wall bounce, the Lambertian part is the diffuse share: the law is linear there."""
    base = named("box").replace(rise_m=0.0, entry=NONE, exit=NONE)
    source = suns(50.0, 20.0, radius_deg=0.0)
    once = []
    for fraction in (0.0, 0.4, 1.0):
        tally = trace(base.with_settings({"wall.diffuse_fraction": fraction}), source, Settings(rays=400_000))
        once.append(float(sum(part[:, :, 1:2, 0].sum() for part in (tally.sharp, tally.soft))) / 8)
    assert once[1] == pytest.approx(0.6 * once[0] + 0.4 * once[2], rel=0.01)


LOSSLESS = {"absorption_per_mm": 0.0}


@pytest.mark.parametrize("name", ["top", "box", "tube"])
def test_white_furnace(name: str) -> None:
    """With nothing that absorbs, what comes in goes out, below or above; the counted parts add up to rounding."""
    system = named(name).with_settings(
        {
            "wall.reflectance": 1.0,
            "boot.reflectance": 1.0,
            "entry.absorption_per_mm": 0.0,
            "exit.absorption_per_mm": 0.0,
        }
    )
    for source in (skies([even]), suns(35.0, 100.0)):
        balance = trace(system, source, Settings(rays=40_000)).balance
        # tables keep weights to 1/32000, and a few samples of the sheet end in its event limit
        assert balance.absorbed_lenses + balance.absorbed_walls < 5e-4 * balance.entering
        out = balance.out + balance.back_to_sky + balance.reflected_outside
        assert out == pytest.approx(balance.entering, rel=5e-4)
        assert abs(balance.residual) < 1e-10


@pytest.mark.parametrize("name", ["top", "box", "tube"])
def test_balance_closes_with_losses_and_limits(name: str) -> None:
    for limit in (None, 0, 3):
        tally = trace(named(name), suns(20.0, 250.0), Settings(rays=40_000, max_bounces=limit))
        assert abs(tally.balance.residual) < 1e-10
        assert (tally.balance.cut > 0.0) == (limit is not None)


def test_limit_and_reflectance_from_tallies_equal_runs_made_so() -> None:
    """Cutting or re-weighting a finished run is exact: the same rays, traced again with the limit, give the same."""
    for name in ("box", "tube"):
        system = named(name)
        source = suns(25.0, 80.0)
        full = trace(system, source, Settings(rays=60_000))
        cut = trace(system, source, Settings(rays=60_000, max_bounces=4))
        assert full.flux(max_bounces=4)[0] == pytest.approx(cut.flux()[0], rel=2e-3)
        dull = system.with_settings({"wall.reflectance": 0.8})
        assert full.flux(wall_reflectance=0.8)[0] == pytest.approx(
            trace(dull, source, Settings(rays=60_000)).flux()[0], rel=1e-2
        )
        assert full.overflow() < 1e-3


def test_same_seed_same_result_whatever_the_threads() -> None:
    source = suns([30.0, 60.0], [90.0, 180.0])
    one = trace(named("tube"), source, Settings(rays=40_000, threads=1))
    two = trace(named("tube"), source, Settings(rays=40_000, threads=3))
    other = trace(named("tube"), source, Settings(rays=40_000, threads=1, seed=2))
    assert np.array_equal(one.sharp, two.sharp) and np.array_equal(one.soft, two.soft)
    assert not np.array_equal(one.sharp, other.sharp)


def test_long_runs_are_added_up_in_rounds(monkeypatch: pytest.MonkeyPatch) -> None:
    import analysis.simulate.tracer as tracer

    system = named("box").replace(exit=NONE)
    whole = trace(system, suns(45.0, 10.0), Settings(rays=80_000)).flux()
    monkeypatch.setattr(tracer, "ROUND", 3_000)
    split = trace(system, suns(45.0, 10.0), Settings(rays=80_000)).flux()
    assert split[0] == pytest.approx(whole[0], abs=5 * (whole[1][0] + split[1][0]))
