"""From counted light to smooth distributions, and from those to what a sensor anywhere below would see.

A distribution is kept as intensity over cos γ (as a luminance times the aperture's area), which stays gentle down
to the horizon, on a grid of the equal-area map of `collect`, for the three radii of `collect.RADII_M`.
"""

import math
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray

from simulators.hidden.collect import CELL_SR, FINE, RADII_M, REACH, fine_centres, from_map, to_map

Floats = NDArray[np.float64]

COARSE = 60
"""Nodes across the square that holds the map: one every 2.9 degrees."""
SMOOTHING_DEG = 2.0
"""Rms width, in each direction, of the smoothing of counted light [deg]."""


def node_centres(nodes: int = COARSE) -> Floats:
    """Map coordinates of the nodes along one axis, shape (nodes,)."""
    return np.asarray((np.arange(nodes) + 0.5) * (2.0 * REACH / nodes) - REACH)


@cache
def _smoother(width_deg: float = SMOOTHING_DEG, nodes: int = COARSE) -> tuple[Floats, Floats]:
    """Smoothing matrix (nodes, FINE), and the projected solid angle that each node's kernel covers."""
    width = math.radians(width_deg)
    kernel = np.exp(-((node_centres(nodes)[:, None] - fine_centres()[None, :]) ** 2) / (2.0 * width**2))
    kernel /= kernel.sum(axis=1, keepdims=True)
    offsets = (np.arange(8) + 0.5) / 8 - 0.5
    fine = (fine_centres()[:, None] + offsets[None, :] * (2.0 * REACH / FINE)).ravel()
    points = np.stack(np.meshgrid(fine, fine, indexing="ij"), axis=-1)
    r2 = np.sum(points**2, axis=-1)
    cosine = np.where(r2 < 2.0, 1.0 - r2 / 2.0, 0.0)
    projected = cosine.reshape(FINE, 8, FINE, 8).mean(axis=(1, 3)) * CELL_SR
    return kernel, kernel @ projected @ kernel.T


def smooth(flux: Floats, width_deg: float = SMOOTHING_DEG, nodes: int = COARSE) -> Floats:
    """Turn counted flux (..., FINE, FINE) [lm] into intensity over cos γ (..., nodes, nodes) [cd].

    Dividing two equally smoothed counts, of flux and of projected solid angle, leaves a Lambertian aperture exact up
    to the horizon.
    """
    kernel, projected = _smoother(width_deg, nodes)
    smoothed = kernel @ flux @ kernel.T
    return np.where(projected > 1e-3 * CELL_SR, smoothed / np.maximum(projected, 1e-3 * CELL_SR), 0.0)


@dataclass(frozen=True)
class Field:
    """Light below a skylight, at any distance.

    Attributes
    ----------
    values : shape (R, nodes, nodes) [cd]
        Intensity over cos γ for each radius of `RADII_M`: what illuminance times radius² would be.
    turn_deg
        The whole distribution is turned by this, counter-clockwise seen from above [deg].
    """

    values: Floats
    turn_deg: float = 0.0

    def intensity(self, directions: Floats, distance_m: float | Floats = math.inf) -> Floats:
        """Illuminance times distance² [cd] of sensors that face the centre, towards unit vectors (..., 3).

        Cubic spline over the map; a parabola in 1 / distance through the three radii; ``distance_m`` is one number or
        one for each direction (...). 0 above the horizon.
        """
        from scipy.ndimage import map_coordinates

        directions = turned(directions, -self.turn_deg)
        at = (to_map(directions) + REACH) * (self.values.shape[-1] / (2.0 * REACH)) - 0.5
        coordinates = np.moveaxis(at, -1, 0).reshape(2, -1)
        shape = directions.shape[:-1]
        level = np.zeros(shape)
        for values, weight in zip(self.values, distance_weights(distance_m), strict=True):
            if np.any(weight):
                level += weight * map_coordinates(values, coordinates, order=3, mode="nearest").reshape(shape)
        return np.maximum(0.0, level) * np.maximum(0.0, -directions[..., 2])

    def flux(self) -> float:
        """Flux of the far field [lm]."""
        return float(np.sum(self.values[0] * _projected()))

    def scaled(self, factor: float) -> "Field":
        """The same light, ``factor`` times as bright."""
        return Field(self.values * factor, self.turn_deg)

    def __add__(self, other: "Field") -> "Field":
        if self.turn_deg != other.turn_deg:
            raise ValueError("distributions that are turned differently cannot be added")
        return Field(self.values + other.values, self.turn_deg)


def turned(directions: Floats, degrees: float) -> Floats:
    """Turn vectors (..., 3) about the vertical, counter-clockwise seen from above."""
    if degrees == 0.0:
        return directions
    c, s = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
    matrix = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    return np.asarray(directions @ matrix.T)


@cache
def _projected() -> Floats:
    """Projected solid angle of each node's own cell [sr], shape (COARSE, COARSE)."""
    parts = 16
    offsets = (np.arange(parts) + 0.5) / parts - 0.5
    fine = (node_centres()[:, None] + offsets[None, :] * (2.0 * REACH / COARSE)).ravel()
    x, y = np.meshgrid(fine, fine, indexing="ij")
    r2 = x * x + y * y
    cosine = np.where(r2 < 2.0, 1.0 - r2 / 2.0, 0.0)
    return np.asarray(cosine.reshape(COARSE, parts, COARSE, parts).mean(axis=(1, 3)) * (2.0 * REACH / COARSE) ** 2)


def distance_weights(distance_m: float | Floats) -> tuple[Floats, Floats, Floats]:
    """Weights of the three radii for other ones: the parabola in 1 / radius through them."""
    t = 1.0 / np.asarray(distance_m, dtype=np.float64)
    a, b, c = (0.0 if math.isinf(r) else 1.0 / r for r in RADII_M)
    return (
        (t - b) * (t - c) / ((a - b) * (a - c)),
        (t - a) * (t - c) / ((b - a) * (b - c)),
        (t - a) * (t - b) / ((c - a) * (c - b)),
    )


def node_directions() -> Floats:
    """Unit vectors of the map's nodes (COARSE, COARSE, 3); beyond the horizon they point a little upwards."""
    points = np.stack(np.meshgrid(node_centres(), node_centres(), indexing="ij"), axis=-1)
    radius = np.linalg.norm(points, axis=-1, keepdims=True)
    return from_map(points * np.minimum(1.0, 1.99 / np.maximum(radius, 1e-9)))
