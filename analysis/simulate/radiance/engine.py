"""Predictions by Radiance: rays sent up from points on the aperture, sorted by the patch of sky that they end in.

The recipe of daylight coefficients with aperture rays: for each wanted direction (or sensor) rays start at points
spread over the aperture, in proportion to what they count; ``rcontrib`` follows them backwards through lenses and well
(one sample per event, Russian roulette) and adds up where in the sky they end. Any sky is then a product. A scattering
cover looks straight at the sun's disc; behind a clear one the sun is a cap of `SUN_CAP_DEG` that glows, because a
sampled path never meets a disc of half a degree.
"""

import math
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from analysis.photometry import Distribution
from analysis.simulate.daylight import Daylight
from analysis.simulate.prediction import Prediction, SunAndSky
from analysis.simulate.radiance.lenses import bsdf_file
from analysis.simulate.radiance.scene import scene_text, sees_sun_directly
from analysis.simulate.radiance.tools import radiance
from analysis.simulate.source import SUN_RADIUS_DEG, Luminance, cell_directions
from analysis.simulate.system import System
from labdaq.directions import sky_vector, vector

Floats = NDArray[np.float64]

SUN_CAP_DEG: Final = 2.5
"""Half angle of the glowing cap that stands for the sun behind a clear cover."""

SUBDIVISION: Final = 4
"""k of the MF:k sky patches (2305)."""

PARTS: Final = 8
"""The rays of each direction are sent in so many independent parts; their scatter is the uncertainty."""

_PARAMETERS: Final = (
    *("-ab", "24", "-ad", "1", "-as", "0", "-aa", "0"),
    *("-ss", "1", "-st", "0", "-lr", "-24", "-lw", "2e-3", "-u+"),
)


@dataclass(frozen=True, eq=False)
class Coefficients:
    """What directions get from the sky and from suns of radiance 1, each (parts, directions, patches or suns).

    Far: mean luminance of the aperture; near: mean luminance weighted as the sensor weighs it, times `weight`.
    """

    sky: Floats
    suns: Floats
    weight: Floats


def radiance_prediction(
    system: System,
    daylight: Daylight,
    distance_m: float,
    precision: float,
    seed: int,
    gamma_deg: Floats,
    c_deg: Floats,
) -> Prediction:
    """Predict one system under one daylight with Radiance; the same values as `predict` with the tracer.

    ``precision`` is met on average over directions for the sky part; the sun part is about three times as noisy.
    Raises `SimulationError` for what the engine cannot do (haze, soiling, isotropic lenses, spread walls).
    """
    rays = int(min(65_536, max(512, 0.35 / precision**2)))
    fields: list[SunAndSky | None] = []
    for distance in (0.0, distance_m):
        if distance == 0.0 and fields:
            fields.append(None)
            continue
        got = coefficients(system, [daylight], gamma_deg, c_deg[:-1], distance, rays, seed)
        fields.append(_combined(system, got, daylight, gamma_deg, c_deg))
    far, near = fields
    assert far is not None
    facts: dict[str, Any] = {"seed": seed, "rays_per_direction": rays, "sun_half_angle_deg": sun_half_angle_deg(system)}
    return Prediction(system, daylight, "radiance", far, near, distance_m, facts)


def coefficients(
    system: System,
    days: list[Daylight],
    gamma_deg: Floats,
    c_deg: Floats,
    distance_m: float,
    rays: int,
    seed: int = 1,
    processes: int = 2,
) -> Coefficients:
    """Coefficients for all (C, gamma) of a grid: far field (``distance_m`` = 0) or sensors at a distance."""
    gamma, c = (grid.ravel() for grid in np.meshgrid(gamma_deg, c_deg))
    per_part = max(1, rays // PARTS)
    start, weight = aperture_rays(system, gamma, c, distance_m, per_part * PARTS, np.random.default_rng(seed))
    suns = [_unit(day) for day in days if day.beam_lx > 0.0]
    bins = _patch_count() + 1
    with tempfile.TemporaryDirectory(prefix="labdaq-radiance-") as name:
        folder = Path(name)
        lenses = {p: bsdf_file(getattr(system, p), folder) for p in ("entry", "exit") if _prismatic(system, p)}
        (folder / "scene.rad").write_text(scene_text(system, lenses, suns, sun_half_angle_deg(system)))
        (folder / "scene.oct").write_bytes(radiance(["oconv", "scene.rad"], b"", folder))
        command = ["rcontrib", "-w", "-h", "-V-", "-fff", "-n", str(processes), "-c", str(per_part), *_PARAMETERS]
        command += ["-e", f"MF:{SUBDIVISION}", "-f", "reinhart.cal", "-bn", str(bins), "-b", "rbin", "-m", "skyglow"]
        for k in range(len(suns)):
            command += ["-bn", "1", "-b", "0", "-m", f"sun{k}"]
        out = radiance([*command, "scene.oct"], start.astype(np.float32).tobytes(), folder)
    found = np.frombuffer(out, dtype=np.float32).reshape(len(gamma), PARTS, -1, 3)[..., 0].astype(np.float64)
    found = found.transpose(1, 0, 2)
    return Coefficients(found[..., 1:bins], found[..., bins:], weight)


def aperture_rays(
    system: System, gamma_deg: Floats, c_deg: Floats, distance_m: float, rays: int, rng: np.random.Generator
) -> tuple[Floats, Floats]:
    """Rays (directions * rays, 6) up through the aperture, and what mean luminance is worth [m²], (directions,).

    Far: parallel rays from points spread evenly; weight = area · cos γ. Near: rays from the sensor's place through
    points drawn in proportion to cos · cos / r²; weight = its integral over the aperture, times distance squared.
    """
    toward = vector(gamma_deg, c_deg)
    points = _aperture_points(system, 4 * rays if distance_m > 0.0 else rays, rng)
    weight = system.aperture_area_m2 * np.cos(np.radians(gamma_deg))
    rows = []
    for k, out in enumerate(toward):
        if distance_m <= 0.0:
            chosen, travel = points, np.broadcast_to(-out, points.shape)
        else:
            to = distance_m * out - points
            r2 = np.sum(to**2, axis=1)
            worth = np.maximum(0.0, -to[:, 2]) * np.maximum(0.0, to @ out) / r2**2
            weight[k] = worth.mean() * system.aperture_area_m2 * distance_m**2
            pick = _systematic(worth, rays, rng)
            chosen, travel = points[pick], -to[pick] / np.sqrt(r2[pick])[:, None]
        # the order must not sort points into parts
        order = rng.permutation(len(chosen))
        rows.append(np.concatenate([chosen - 1e-4 * travel, travel], axis=1)[order])
    return np.concatenate(rows), weight


def _systematic(worth: Floats, count: int, rng: np.random.Generator) -> NDArray[np.int64]:
    """Draw with probability proportional to worth, as evenly as can be."""
    steps = np.cumsum(worth)
    if steps[-1] <= 0.0:
        return np.zeros(count, dtype=np.int64)
    return np.searchsorted(steps / steps[-1], (np.arange(count) + rng.random()) / count).clip(0, len(worth) - 1)


def _aperture_points(system: System, count: int, rng: np.random.Generator) -> Floats:
    """Points spread evenly over the aperture (additive recurrence), in the site's frame, shape (count, 3)."""
    plastic = 1.32471795724474602596
    k = np.arange(count)
    a, b = (rng.random() + k / plastic) % 1.0, (rng.random() + k / plastic**2) % 1.0
    if system.aperture.shape == "disc":
        r = 0.5 * system.aperture.diameter_m * np.sqrt(a)
        return np.stack([r * np.cos(2 * math.pi * b), r * np.sin(2 * math.pi * b), np.zeros(count)], axis=1)
    x, y = (a - 0.5) * system.aperture.size_m[0], (b - 0.5) * system.aperture.size_m[1]
    turn = math.radians(system.rotation_deg)
    return np.stack(
        [math.cos(turn) * x - math.sin(turn) * y, math.sin(turn) * x + math.cos(turn) * y, np.zeros(count)], axis=1
    )


def _combined(system: System, got: Coefficients, day: Daylight, gamma_deg: Floats, c_deg: Floats) -> SunAndSky:
    shape = (len(c_deg) - 1, len(gamma_deg))
    sky = got.sky @ patch_means(day.sky)
    sun = np.zeros_like(sky)
    if got.suns.shape[-1]:
        sun = got.suns[..., 0] * day.normal_lx / sun_solid_angle(system)
        if not sees_sun_directly(system):  # the sky that the cap hides
            sky = sky + got.suns[..., 0] * float(day.sky(np.array([_unit(day)]))[0])
    sky, sun = sky * got.weight, sun * got.weight
    parts: list[Any] = []
    for values in (sun, sky):
        mean = values.mean(axis=0).reshape(shape)
        error = (values.std(axis=0, ddof=1) / math.sqrt(PARTS)).reshape(shape)
        parts += [Distribution.closed(gamma_deg, c_deg[:-1], mean), np.concatenate([error, error[:1]])]
    return SunAndSky(parts[0], parts[2], parts[1], parts[3])


def sun_half_angle_deg(system: System) -> float:
    """Of the sun as the scene has it."""
    return SUN_RADIUS_DEG if sees_sun_directly(system) else SUN_CAP_DEG


def sun_solid_angle(system: System) -> float:
    """Projected solid angle of the scene's sun as seen face on [sr]: illuminance facing it for radiance 1."""
    return math.pi * math.sin(math.radians(sun_half_angle_deg(system))) ** 2


def patch_means(sky: Luminance) -> Floats:
    """Mean luminance [cd/m²] of the MF:k patches, by solid angle."""
    from analysis.sky.patches import reinhart

    made = reinhart(SUBDIVISION)
    x, y, z = cell_directions(384, 1)
    cells = np.concatenate([x, y, z], axis=1)
    group = made.index(cells)
    values = np.asarray(sky(cells), dtype=np.float64)
    sums = np.bincount(group, weights=values, minlength=made.count)
    means: Floats = sums / np.maximum(np.bincount(group, minlength=made.count), 1)
    return means


def _patch_count() -> int:
    from analysis.sky.patches import reinhart

    return reinhart(SUBDIVISION).count


def _prismatic(system: System, place: str) -> bool:
    return bool(getattr(system, place).kind == "prismatic")


def _unit(day: Daylight) -> tuple[float, float, float]:
    x, y, z = sky_vector(day.sun_altitude_deg, day.sun_azimuth_deg)
    return float(x), float(y), float(z)
