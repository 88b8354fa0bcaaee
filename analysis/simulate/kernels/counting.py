"""Counting rays that leave the aperture, by direction and by where they meet the sensors' sphere."""

import math
from typing import Any, Final

import numpy as np

from analysis.simulate.kernels.arrays import TURN_C, TURN_S, Cells, Counts, Light, Ray, Scene
from analysis.simulate.kernels.jit import jit
from analysis.simulate.kernels.maps import square_of

# typed, because numba compiles a function again for every literal it is called with
ZERO: Final[Any] = np.int64(0)
ONE: Final[Any] = np.int64(1)
TWO: Final[Any] = np.int64(2)
YES: Final[Any] = np.bool_(True)
NO: Final[Any] = np.bool_(False)


@jit
def cell_of(x: float, y: float, z: float, side: int) -> int:
    """Cell of the direction square (side by side cells) for a direction with z >= 0."""
    u, v = square_of(x, y, z)
    i = min(side - 1, int((u + 1.0) * 0.5 * side))
    j = min(side - 1, int((v + 1.0) * 0.5 * side))
    return i * side + j


@jit
def slot(counts: Counts, m: int, n: int) -> tuple[bool, int, int, int]:
    """Where light is counted after m bounces on the boot and n on the wall.

    Returns whether that is the soft tally, cells along its side, and the first cell of the far and of the near field.
    """
    gentle = (counts.diffuse_well and n > 0) or (counts.diffuse_boot and m > 0)
    side = counts.soft_side if gentle else counts.sharp_side
    n = min(n, counts.bounces - 1)
    n += min(m, (counts.classes if gentle else counts.sharp_classes) - 1) * counts.bounces
    fields = 2 if counts.distance > 0.0 else 1
    first = n * fields * side * side
    return gentle, side, first, first + side * side


@jit
def add(counts: Counts, light: Light, source: int, gentle: bool, cell: int, value: float) -> None:
    """Add to each member that the source's cell belongs to."""
    first = cell * counts.members
    for t in range(light.span[source, 0], light.span[source, 1]):
        if gentle:
            counts.soft[first + t] += np.float32(value * light.flux[source, t])
        else:
            counts.sharp[first + t] += np.float32(value * light.flux[source, t])


@jit
def add_fan(
    counts: Counts, light: Light, source: int, gentle: bool, size: int, first: int, cells: Cells, share: float
) -> None:
    """Add a fan of samples, each with its weight, to each member that the source's cell belongs to."""
    for t in range(light.span[source, 0], light.span[source, 1]):
        value = np.float32(share * light.flux[source, t])
        if gentle:
            for k in range(size):
                counts.soft[(first + cells[k]) * counts.members + t] += value * counts.fan_w[k]
        else:
            for k in range(size):
                counts.sharp[(first + cells[k]) * counts.members + t] += value * counts.fan_w[k]


@jit
def score(scene: Scene, source: int, boot: int, wall: int, value: float, ray: Ray) -> None:
    """Count a ray that leaves the aperture after so many bounces on boot and wall; ``value``: m² of the source's light.

    A sensor that faces the aperture's centre from distance D sees E = dΦ/dA of its sphere, so candela "as measured"
    = E D² = dΦ/dΩ with dΩ the solid angle of the *place*: the near field is counted like the far field. So is a plane:
    there E = dΦ/dΩ cos³ γ / D².
    """
    if value == 0.0:
        return
    counts, light, geo = scene.counts, scene.light, scene.sky.geometry
    gentle, side, far, near = slot(counts, boot, wall)
    c, s = geo[TURN_C], geo[TURN_S]
    x, y = c * ray.x - s * ray.y, s * ray.x + c * ray.y
    dx, dy = c * ray.dx - s * ray.dy, s * ray.dx + c * ray.dy
    add(counts, light, source, gentle, far + cell_of(dx, dy, -ray.dz, side), value)
    d = counts.distance
    if d > 0.0:
        if counts.flat:
            t = d / max(-ray.dz, 1e-9)
        else:
            p = x * dx + y * dy
            t = math.sqrt(p * p + d * d - x * x - y * y) - p
        x, y, z = x + t * dx, y + t * dy, -t * ray.dz
        r = math.sqrt(x * x + y * y + z * z)
        cell = cell_of(x / r, y / r, z / r, side)
        add(counts, light, source, gentle, near + cell, value)
