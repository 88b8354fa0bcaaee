"""From counted light to smooth distributions, and from those to what a sensor anywhere below would see.

A distribution is kept as intensity over cos γ (as a luminance times the aperture's area), which stays gentle down to the
horizon, on a grid of the equal-area map of `collect`, for the three radii of `collect.RADII_M`.
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


def node_centres() -> Floats:
    """Map coordinates of the nodes along one axis, shape (COARSE,)."""
    return (np.arange(COARSE) + 0.5) * (2.0 * REACH / COARSE) - REACH


@cache
def _smoother() -> tuple[Floats, Floats]:
    """Smoothing matrix (COARSE, FINE), and the projected solid angle that each node's kernel covers."""
    width = math.radians(SMOOTHING_DEG)
    kernel = np.exp(-((node_centres()[:, None] - fine_centres()[None, :]) ** 2) / (2.0 * width**2))
    kernel /= kernel.sum(axis=1, keepdims=True)
    offsets = (np.arange(8) + 0.5) / 8 - 0.5
    fine = (fine_centres()[:, None] + offsets[None, :] * (2.0 * REACH / FINE)).ravel()
    points = np.stack(np.meshgrid(fine, fine, indexing="ij"), axis=-1)
    r2 = np.sum(points**2, axis=-1)
    cosine = np.where(r2 < 2.0, 1.0 - r2 / 2.0, 0.0)
    projected = cosine.reshape(FINE, 8, FINE, 8).mean(axis=(1, 3)) * CELL_SR
    return kernel, kernel @ projected @ kernel.T


def smooth(flux: Floats) -> Floats:
    """Turn counted flux (..., FINE, FINE) [lm] into intensity over cos γ (..., COARSE, COARSE) [cd].

    Dividing two equally smoothed counts, of flux and of projected solid angle, leaves a Lambertian aperture exact up
    to the horizon.
    """
    kernel, projected = _smoother()
    smoothed = kernel @ flux @ kernel.T
    return np.where(projected > 1e-3 * CELL_SR, smoothed / np.maximum(projected, 1e-3 * CELL_SR), 0.0)


@dataclass(frozen=True)
class Field:
    """Light below a skylight, at any distance.

    Attributes
    ----------
    values : shape (R, COARSE, COARSE) [cd]
        Intensity over cos γ for each radius of `RADII_M`: what illuminance times radius² would be.
    """

    values: Floats

    def intensity(self, directions: Floats, distance_m: float = math.inf) -> Floats:
        """Illuminance times distance² [cd] of sensors that face the centre, towards unit vectors (..., 3).

        Cubic spline over the map; a parabola in 1 / distance through the three radii. 0 above the horizon.
        """
        from scipy.ndimage import map_coordinates

        at = (to_map(directions) + REACH) * (COARSE / (2.0 * REACH)) - 0.5
        coordinates = np.moveaxis(at, -1, 0).reshape(2, -1)
        level = sum(
            w * map_coordinates(self.values[r], coordinates, order=3, mode="nearest")
            for r, w in enumerate(distance_weights(distance_m))
            if w != 0.0
        )
        cosine = np.maximum(0.0, -directions[..., 2])
        return np.maximum(0.0, np.asarray(level).reshape(directions.shape[:-1])) * cosine

    def flux(self) -> float:
        """Flux of the far field [lm]."""
        return float(np.sum(self.values[0] * _projected()))

    def scaled(self, factor: float) -> "Field":
        """The same light, ``factor`` times as bright."""
        return Field(self.values * factor)

    def __add__(self, other: "Field") -> "Field":
        return Field(self.values + other.values)


@cache
def _projected() -> Floats:
    """Projected solid angle of each node's own cell [sr], shape (COARSE, COARSE)."""
    parts = 16
    offsets = (np.arange(parts) + 0.5) / parts - 0.5
    fine = (node_centres()[:, None] + offsets[None, :] * (2.0 * REACH / COARSE)).ravel()
    x, y = np.meshgrid(fine, fine, indexing="ij")
    r2 = x * x + y * y
    cosine = np.where(r2 < 2.0, 1.0 - r2 / 2.0, 0.0)
    return cosine.reshape(COARSE, parts, COARSE, parts).mean(axis=(1, 3)) * (2.0 * REACH / COARSE) ** 2


def distance_weights(distance_m: float) -> tuple[float, float, float]:
    """Weights of the three radii for another one: the parabola in 1 / radius through them."""
    t = 0.0 if math.isinf(distance_m) else 1.0 / distance_m
    knots = [0.0 if math.isinf(r) else 1.0 / r for r in RADII_M]
    weights = []
    for i, a in enumerate(knots):
        others = [b for k, b in enumerate(knots) if k != i]
        weights.append((t - others[0]) * (t - others[1]) / ((a - others[0]) * (a - others[1])))
    return weights[0], weights[1], weights[2]


def node_directions() -> Floats:
    """Unit vectors of the map's nodes (COARSE, COARSE, 3); beyond the horizon they point a little upwards."""
    points = np.stack(np.meshgrid(node_centres(), node_centres(), indexing="ij"), axis=-1)
    radius = np.linalg.norm(points, axis=-1, keepdims=True)
    return from_map(points * np.minimum(1.0, 1.99 / np.maximum(radius, 1e-9)))
