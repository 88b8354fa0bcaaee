"""Where rays start: points of the aperture, in proportion to what a direction or a sensor gets from them."""

import math

import numpy as np
from numpy.typing import NDArray

from analysis.simulate.system import System
from labdaq.directions import vector

Floats = NDArray[np.float64]


def aperture_rays(
    system: System, gamma_deg: Floats, c_deg: Floats, distance_m: float, rays: int, rng: np.random.Generator
) -> tuple[Floats, Floats]:
    """Rays (directions * rays, 6) up through the aperture, and what mean luminance is worth [m²], (directions,).

    Far: parallel rays from points spread evenly; weight = area · cos γ. Near: rays from the sensor's place through
    points drawn in proportion to cos · cos / r²; weight = its integral over the aperture, times distance squared.
    """
    toward = vector(gamma_deg, c_deg)
    points = _on_rows(system, rays, rng) if distance_m > 0.0 else _aperture_points(system, rays, rng)
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
            pick = _stratified(worth, rays, rng)
            chosen, travel = points[pick], -to[pick] / np.sqrt(r2[pick])[:, None]
        # the order must not sort points into parts
        order = rng.permutation(len(chosen))
        rows.append(np.concatenate([chosen - 1e-4 * travel, travel], axis=1)[order])
    return np.concatenate(rows), weight


def _stratified(worth: Floats, count: int, rng: np.random.Generator) -> NDArray[np.int64]:
    """Draw with probability proportional to worth, once from each of ``count`` equal steps of its sum."""
    steps = np.cumsum(worth)
    if steps[-1] <= 0.0:
        return np.zeros(count, dtype=np.int64)
    return np.searchsorted(steps / steps[-1], (np.arange(count) + rng.random(count)) / count).clip(0, len(worth) - 1)


def _aperture_points(system: System, count: int, rng: np.random.Generator) -> Floats:
    """Points spread evenly over the aperture (additive recurrence), in the site's frame, shape (count, 3)."""
    plastic = 1.32471795724474602596
    k = np.arange(count)
    return _on_aperture(system, (rng.random() + k / plastic) % 1.0, (rng.random() + k / plastic**2) % 1.0)


def _on_rows(system: System, count: int, rng: np.random.Generator) -> Floats:
    """At least 4 x ``count`` points spread evenly, to and fro along rows, so that neighbours in order are neighbours.

    Steps of weight through them leave no part of the aperture out. Through an additive recurrence they fall in with
    its rhythm: a part of the aperture then gets up to 3 % too many of 4096 rays, four times what chance would do.
    """
    rows = math.ceil(2.0 * math.sqrt(count))
    i, j = np.divmod(np.arange(rows * rows), rows)
    j = np.where(i % 2, rows - 1 - j, j)
    return _on_aperture(system, (i + rng.random(len(i))) / rows, (j + rng.random(len(j))) / rows)


def _on_aperture(system: System, a: Floats, b: Floats) -> Floats:
    """Points of the unit square on the aperture, areas in proportion, in the site's frame, shape (n, 3)."""
    nought = np.zeros(len(a))
    if system.aperture.shape == "disc":
        r = 0.5 * system.aperture.diameter_m * np.sqrt(a)
        return np.stack([r * np.cos(2 * math.pi * b), r * np.sin(2 * math.pi * b), nought], axis=1)
    x, y = (a - 0.5) * system.aperture.size_m[0], (b - 0.5) * system.aperture.size_m[1]
    turn = math.radians(system.rotation_deg)
    return np.stack([math.cos(turn) * x - math.sin(turn) * y, math.sin(turn) * x + math.cos(turn) * y, nought], axis=1)
