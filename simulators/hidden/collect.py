"""Where light that leaves a skylight is counted: the sphere of directions as a flat disc of equal areas.

Lambert's azimuthal equal-area map puts the direction (x, y, z < 0) at (x, y) sqrt(2 / (1 - z)): nadir in the
middle, the horizon on a circle of radius sqrt 2, and every square cell of the map has the same solid angle.
Symmetries of a square skylight are symmetries of the square map.

Light is counted in fine cells, in the far field and on spheres of finite radius about the aperture's centre: a ray is
counted where it pierces the sphere, so that the flux through a patch of it is the illuminance of a sensor that
faces the centre, cosine included, for any size of aperture.
"""

import math

import numpy as np
from numpy.typing import NDArray

from simulators.hidden.compiled import compiled

Floats = NDArray[np.float64]

FINE = 120
"""Cells across the square that holds the map, where no other number is asked for."""
REACH = math.sqrt(2.0) * 1.06
"""Half width of that square: a little beyond the horizon."""
CELL_SR = (2.0 * REACH / FINE) ** 2
"""Solid angle of a fine cell [sr]: 1.43 degrees square."""
RADII_M = (math.inf, 2.6, 2.0)
"""Spheres on which light is counted by default; between them intensity is a parabola in 1 / radius."""


@compiled
def cell_of(x: float, y: float, z: float, across: int) -> int:
    """Index of the cell of a downward unit vector on a map of ``across`` cells squared."""
    f = math.sqrt(2.0 / max(1e-12, 1.0 - z))
    i = int((x * f + REACH) * (across / (2.0 * REACH)))
    j = int((y * f + REACH) * (across / (2.0 * REACH)))
    return min(across - 1, max(0, i)) * across + min(across - 1, max(0, j))


@compiled
def pierce(x: float, y: float, dx: float, dy: float, dz: float, radius: float) -> tuple[float, float, float]:
    """Unit vector to where a ray from (x, y, 0) pierces the sphere of that radius about the origin."""
    b = x * dx + y * dy
    way = -b + math.sqrt(b * b + radius * radius - x * x - y * y)
    return (x + way * dx) / radius, (y + way * dy) / radius, way * dz / radius


def to_map(directions: Floats) -> Floats:
    """Map unit vectors (..., 3) of the lower hemisphere to the disc (..., 2)."""
    return np.asarray(directions[..., :2] * np.sqrt(2.0 / np.maximum(1e-12, 1.0 - directions[..., 2:])))


def from_map(points: Floats) -> Floats:
    """Unit vectors (..., 3) of map points (..., 2); points beyond radius 2 have none and give NaN."""
    r2 = np.sum(points**2, axis=-1, keepdims=True)
    with np.errstate(invalid="ignore"):
        return np.concatenate([points * np.sqrt(1.0 - r2 / 4.0), r2 / 2.0 - 1.0], axis=-1)


def fine_centres() -> Floats:
    """Map coordinates of the centres of the fine cells along one axis, shape (FINE,)."""
    return np.asarray((np.arange(FINE) + 0.5) * (2.0 * REACH / FINE) - REACH)
