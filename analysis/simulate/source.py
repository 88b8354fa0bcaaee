"""Where the light comes from: suns, skies, or a given set of rays.

A source holds T members at once (several suns, several skies): skies share their rays and differ in what a ray is
worth, suns have rays of their own. One run then serves all tests of a system.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from analysis.simulate.kernels.arrays import GIVEN, SKY, SUN
from labdaq.directions import sky_vector
from labdaq.errors import DataError

Floats = NDArray[np.float64]
Luminance = Callable[[Floats], Floats]
"""Luminance [cd/m²] towards unit vectors (..., 3), x east, y north, z up; without the sun's disc."""

SUN_RADIUS_DEG: Final = 0.2665
SKY_SIDE: Final = 96
"""Cells along the side of the sky's square (equal solid angles, about 1.5 degrees)."""


@dataclass(frozen=True)
class Source:
    """Arrays for the kernel.

    Attributes
    ----------
    mode
        ``SKY``, ``SUN`` or ``GIVEN``.
    probability : shape (cells,)
        Share of the rays that starts in each cell (a patch of sky, or a sun).
    flux : shape (cells, T) [lx or lm]
        Illuminance that each member's cell throws on a plane facing it [lx]; for given rays 1.
    span : shape (cells, 2)
        First and last + 1 member that a cell belongs to.
    suns : shape (cells, 5)
        Unit vector, sine of the disc's radius, Gaussian widening [rad]; for suns only.
    side
        Cells along the sky's square; for skies only.
    rays : shape (n, 10)
        Point on the cover, outward normal, direction, flux [lm]; for given rays only.
    """

    mode: int
    probability: Floats
    flux: Floats
    span: NDArray[np.int64]
    suns: Floats
    side: int
    rays: Floats

    @property
    def members(self) -> int:
        """Number of suns or skies, T."""
        return int(self.flux.shape[1])


_NO_SUNS: Final = np.zeros((1, 5))
_NO_RAYS: Final = np.zeros((1, 10))


def suns(
    altitude_deg: ArrayLike,
    azimuth_deg: ArrayLike,
    normal_illuminance_lx: ArrayLike = 1.0,
    *,
    radius_deg: float = SUN_RADIUS_DEG,
    aureole_deg: float = 0.0,
) -> Source:
    """Suns as discs of even luminance, optionally widened by a Gaussian of rms ``aureole_deg`` per axis.

    ``normal_illuminance_lx`` [lx] counts each ray on a plane that faces the ray. On one plane that faces the middle it
    is less by the mean cosine: 5e-6 of the sun's disc, .8 % of one of 10 degrees.

    Raises `DataError` for a sun at or below the horizon.
    """
    altitude, azimuth, normal = np.broadcast_arrays(
        *(np.atleast_1d(np.asarray(a, dtype=np.float64)) for a in (altitude_deg, azimuth_deg, normal_illuminance_lx))
    )
    if np.any(altitude <= 0.0):
        raise DataError(f"the sun is at {altitude.min():.2f} degrees, below the horizon", "leave the sun part out")
    count = len(altitude)
    rows = np.empty((count, 5))
    rows[:, :3] = sky_vector(altitude, azimuth)
    rows[:, 3] = math.sin(math.radians(radius_deg))
    rows[:, 4] = math.radians(aureole_deg)
    member = np.arange(count)
    return Source(
        SUN, np.full(count, 1.0 / count), np.diag(normal), np.stack([member, member + 1], axis=1), rows, 1, _NO_RAYS
    )


def skies(luminances: Sequence[Luminance], side: int = SKY_SIDE) -> Source:
    """Skies by their luminance; rays are shared and drawn in proportion to the mean sky's light on the cover."""
    per_cell = np.stack([cell_luminance(luminance, side) for luminance in luminances], axis=1)
    if not np.all(np.isfinite(per_cell)) or np.any(per_cell < 0.0):
        raise DataError("a sky has negative or undefined luminance", "check the map or the model's parameters")
    solid = 2.0 * math.pi / side**2
    _, _, up = cell_directions(side, 1)
    total = per_cell.sum(axis=0)
    shape = (per_cell / np.where(total > 0.0, total, 1.0)).sum(axis=1)
    shape = shape / max(shape.sum(), 1e-300) + 0.05 / len(shape)
    shape = shape * (up[:, 0] + 0.2)
    span = np.tile(np.array([[0, len(luminances)]]), (side**2, 1))
    return Source(SKY, shape / shape.sum(), per_cell * solid, span, _NO_SUNS, side, _NO_RAYS)


def patches(side: int, group: NDArray[np.int64], count: int, luminance: float = 1.0) -> Source:
    """``count`` patches of even luminance [cd/m²], each a group of cells of the sky's square (-1: in no patch)."""
    cells = side**2
    flux = np.zeros((cells, count))
    used = group >= 0
    flux[np.arange(cells)[used], group[used]] = luminance * 2.0 * math.pi / cells
    size = np.bincount(group[used], minlength=count)
    probability = np.where(used, 1.0 / (count * size[np.maximum(group, 0)]), 0.0)
    first = np.maximum(group, 0)
    span = np.stack([first, np.where(used, first + 1, first)], axis=1)
    return Source(SKY, probability, flux, span, _NO_SUNS, side, _NO_RAYS)


def given(points: Floats, normals: Floats, directions: Floats, flux_lm: Floats) -> Source:
    """Rays that are known one by one, at the points where they meet the cover (see `raysets.on_cover`)."""
    rays = np.concatenate([points, normals, directions, flux_lm[:, None]], axis=1)
    return Source(GIVEN, np.ones(1), np.ones((1, 1)), np.array([[0, 1]]), _NO_SUNS, 1, rays)


def cell_directions(side: int, parts: int) -> tuple[Floats, Floats, Floats]:
    """Directions x, y, z, each (side², parts²), of points spread evenly in the cells of the sky's square."""
    step = (np.arange(side * parts) + 0.5) / (side * parts) * 2.0 - 1.0
    u, v = np.meshgrid(step, step, indexing="ij")
    x, y, z = _hemisphere(u, v)

    def by_cell(a: Floats) -> Floats:
        return a.reshape(side, parts, side, parts).swapaxes(1, 2).reshape(side**2, parts**2)

    return by_cell(x), by_cell(y), by_cell(z)


def cell_luminance(luminance: Luminance, side: int, parts: int = 3) -> Floats:
    """Mean luminance [cd/m²] of each cell of the sky's square, shape (side²,)."""
    vectors = np.stack(cell_directions(side, parts), axis=-1)
    values = np.asarray(luminance(vectors.reshape(-1, 3)), dtype=np.float64)
    mean: Floats = values.reshape(side**2, -1).mean(axis=1)
    return mean


def horizontal_illuminance(luminance: Luminance, side: int = SKY_SIDE) -> float:
    """Illuminance [lx] of a sky on a horizontal plane, with the cells that the tracer uses."""
    _, _, up = cell_directions(side, 3)
    return float((cell_luminance(luminance, side) * up.mean(axis=1)).sum() * 2.0 * math.pi / side**2)


def _hemisphere(u: Floats, v: Floats) -> tuple[Floats, Floats, Floats]:
    first = np.abs(u) >= np.abs(v)
    rho = np.where(first, np.abs(u), np.abs(v))
    phi = 0.25 * math.pi * np.where(first, v, u) / np.where(rho > 0.0, rho, 1.0)
    sine = rho * np.sqrt(np.maximum(0.0, 2.0 - rho**2))
    a, b = np.cos(phi), np.sin(phi)
    x = np.where(first, np.copysign(a, u), b) * sine
    y = np.where(first, b, np.copysign(a, v)) * sine
    return x, y, 1.0 - rho**2
