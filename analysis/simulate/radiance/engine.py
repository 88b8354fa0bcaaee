"""Predictions by Radiance: rays sent up from points on the aperture, which return what they meet in the sky.

For each wanted direction (or sensor) rays start at points spread over the aperture, in proportion to what they count,
and are followed backwards through lenses and well. A scattering cover looks straight at the sun's disc; behind a clear
one the sun is a cap of `SUN_CAP_DEG` that glows, because a sampled path never meets a disc of half a degree.
"""

import math
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter

from analysis.photometry import Distribution
from analysis.simulate.daylight import Daylight
from analysis.simulate.prediction import Prediction, SunAndSky
from analysis.simulate.radiance.aperture import aperture_rays
from analysis.simulate.radiance.contributions import contributions, sun_contributions
from analysis.simulate.radiance.lenses import DEPTH
from analysis.simulate.radiance.scene import sees_sun_directly
from analysis.simulate.source import SUN_RADIUS_DEG, Luminance, cell_directions
from analysis.simulate.system import System
from labdaq.directions import sky_vector

Floats = NDArray[np.float64]

SUN_CAP_DEG: Final = 2.5
"""Half angle of the glowing cap that stands for the sun behind a clear cover."""

SUBDIVISION: Final = 4
"""k of the MF:k sky patches (2305)."""

PILOT: Final = 512
MOST_RAYS: Final = 65_536

PARTS: Final = 8
"""The rays of each direction are sent in so many independent parts; their scatter is the uncertainty."""


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

    ``precision`` is the root mean square relative uncertainty of the sky part where it is above 5 % of its largest
    value; a pilot run says how many rays that takes (at most `MOST_RAYS` a direction). The sun part comes with the same
    rays and says its own uncertainty, often several times as large. ``seed`` chooses the rays' starts; what Radiance
    draws on their way differs from run to run. With prismatic lenses everything is run once more with trees of cells
    twice as wide: what that changes beyond the statistics is in the uncertainties too.
    Raises `SimulationError` for what the engine cannot do (haze, soiling, isotropic lenses, spread walls).
    """
    wanted = distance_m if distance_m > 0.0 else 0.0
    have = _sky_error(_field(system, daylight, gamma_deg, c_deg, wanted, PILOT, seed, sun=False))
    rays = PILOT if have <= precision else int(min(MOST_RAYS, PILOT * 1.2 * (have / precision) ** 2))
    found = _field(system, daylight, gamma_deg, c_deg, wanted, rays, seed)
    far = found if wanted == 0.0 else _field(system, daylight, gamma_deg, c_deg, 0.0, rays, seed)
    fields = {wanted: found, 0.0: far}
    if "prismatic" in (system.entry.kind, system.exit.kind):
        for at_m, fine in fields.items():
            coarse = _field(system, daylight, gamma_deg, c_deg, at_m, rays, seed + 1, DEPTH - 1)
            fields[at_m] = _with_cells(fine, coarse)
    near = fields[wanted] if wanted > 0.0 else None
    facts: dict[str, Any] = {"seed": seed, "rays_per_direction": rays, "sun_half_angle_deg": sun_half_angle_deg(system)}
    return Prediction(system, daylight, "radiance", fields[0.0], near, distance_m, facts)


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
    """Coefficients for all (C, gamma) of a grid: far field (``distance_m`` = 0) or sensors at a distance.

    A sky as `SUBDIVISION` patches is a stair: where nothing blurs (mirror wells without lenses) it costs up to 2 % in a
    direction; `radiance_prediction` has its one sky whole.
    """
    gamma, c = (grid.ravel() for grid in np.meshgrid(gamma_deg, c_deg))
    per_part = max(1, rays // PARTS)
    start, weight = aperture_rays(system, gamma, c, distance_m, per_part * PARTS, np.random.default_rng(seed))
    found = contributions(system, _suns(days), sun_half_angle_deg(system), start, per_part, SUBDIVISION, processes)
    found = found.reshape(len(gamma), PARTS, -1).transpose(1, 0, 2)
    bins = _patch_count() + 1
    return Coefficients(found[..., 1:bins], found[..., bins:], weight)


def _sky_error(part: SunAndSky) -> float:
    candela = part.sky.candela
    bright = candela > 0.05 * candela.max()
    return float(np.sqrt(np.mean((part.sky_uncertainty[bright] / candela[bright]) ** 2))) if bright.any() else 0.0


def _field(
    system: System,
    day: Daylight,
    gamma_deg: Floats,
    c_deg: Floats,
    distance_m: float,
    rays: int,
    seed: int,
    depth: int = DEPTH,
    *,
    sun: bool = True,
) -> SunAndSky:
    """One field of a prediction: the sky as it is, and the sun that the scene has; statistical uncertainties."""
    gamma, c = (grid.ravel() for grid in np.meshgrid(gamma_deg, c_deg[:-1]))
    per_part = max(1, rays // PARTS)
    start, weight = aperture_rays(system, gamma, c, distance_m, per_part * PARTS, np.random.default_rng(seed))
    half_angle = sun_half_angle_deg(system)
    suns = _suns([day]) if sun else []
    apart = suns if system.entry.kind == "prismatic" else []
    found = contributions(system, [] if apart else suns, half_angle, start, per_part, day.sky, depth=depth)
    for one in apart:
        column = sun_contributions(system, one, half_angle, start, per_part, depth=depth)
        found = np.concatenate([found, column[:, None]], axis=1)
    found = found.reshape(len(gamma), PARTS, -1).transpose(1, 0, 2) * weight[:, None]
    of_sky, of_sun = found[..., 0], np.zeros_like(found[..., 0])
    if suns:
        of_sun = found[..., 1] * day.normal_lx / sun_solid_angle(system)
        if not sees_sun_directly(system):  # the sky that the cap hides
            of_sky = of_sky + found[..., 1] * float(day.sky(np.array([_unit(day)]))[0])
    parts: list[Any] = []
    for values in (of_sun, of_sky):
        mean = values.mean(axis=0).reshape(len(c_deg) - 1, len(gamma_deg))
        error = (values.std(axis=0, ddof=1) / math.sqrt(PARTS)).reshape(mean.shape)
        if values is of_sun and not sees_sun_directly(system):
            error = _of_few_hits(mean, error)
        parts += [Distribution.closed(gamma_deg, c_deg[:-1], mean), np.concatenate([error, error[:1]])]
    return SunAndSky(parts[0], parts[2], parts[1], parts[3])


def _of_few_hits(mean: Floats, error: Floats) -> Floats:
    """Standard uncertainties of directions from which a ray seldom meets the cap.

    Where by chance none did, or each part had one, the parts do not scatter. Variances of counts are as their means:
    the ratio is taken from all directions, the mean from the neighbours.
    """
    each = np.sum(error**2) / max(float(mean.sum()), 1e-300)
    found: Floats = np.sqrt(np.maximum(error**2, each * uniform_filter(mean, 3, mode=("wrap", "nearest"))))
    return found


def _with_cells(fine: SunAndSky, coarse: SunAndSky) -> SunAndSky:
    """The fine field, with what its trees' cells may cost in its uncertainties.

    A tree has one value for all directions of a cell. What cells of twice the width change, beyond what both fields'
    statistics say, stands for what these cells cost; squares are averaged over neighbouring directions.
    """
    errors = []
    for part in ("sun", "sky"):
        here, there = (getattr(field, part).candela[:-1] for field in (fine, coarse))
        noise, more = (getattr(field, f"{part}_uncertainty")[:-1] for field in (fine, coarse))
        beyond = uniform_filter((here - there) ** 2 - noise**2 - more**2, 3, mode=("wrap", "nearest"))
        error = np.sqrt(noise**2 + np.maximum(beyond, 0.0))
        errors.append(np.concatenate([error, error[:1]]))
    return SunAndSky(fine.sun, fine.sky, *errors)


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


def _suns(days: list[Daylight]) -> list[tuple[float, float, float]]:
    return [_unit(day) for day in days if day.beam_lx > 0.0]


def _unit(day: Daylight) -> tuple[float, float, float]:
    x, y, z = sky_vector(day.sun_altitude_deg, day.sun_azimuth_deg)
    return float(x), float(y), float(z)
