"""Many samples of a lens at once: neighbours in a row of its table, aimed and counted in loops that use wide registers.

The light that reaches a prismatic sheet is sent on by dozens of samples with their share each; that costs a tenth of
tracing as many rays, and most of the noise of a direction comes from this last event.
"""

import math
from typing import Any, Final

import numpy as np

from analysis.simulate.kernels.arrays import (
    AX,
    AY,
    DELTA_SCALE,
    RECTANGLE,
    SHAPE,
    TURN_C,
    TURN_S,
    Counts,
    Frame,
    Numbers,
    Scene,
    Table,
)
from analysis.simulate.kernels.counting import ONE, ZERO, add_fan, slot
from analysis.simulate.kernels.jit import jit
from analysis.simulate.kernels.optics import Place

# in single precision throughout: one number of the double kind would widen all that it meets
_ZERO: Final[Any] = np.float32(0.0)
_UNIT: Final[Any] = np.float32(1.0)
_EDGE: Final[Any] = np.float32(0.9999)
_LEAST: Final[Any] = np.float32(1e-12)
_SMALL: Final[Any] = np.float32(1e-9)
_TINY: Final[Any] = np.float32(1e-30)
_STEP: Final[Any] = np.int32(1)
# the polynomial of `arctan_unit` times 4 / pi
_T0, _T1, _T2, _T3, _T4, _T5 = (
    np.float32(t * 4.0 / math.pi)
    for t in (0.999977219, -0.332622827, 0.193540371, -0.11642647, 0.0526473392, -0.0117191312)
)


@jit
def read_fan(counts: Counts, size: int, table: Table, at: Place, first: int) -> float:
    """Fetch ``size`` consecutive entries' differences and weights; returns the sum of the transmitted weights."""
    entries = table[at.row, first : first + size]
    sx, sy = np.float32(at.sx * DELTA_SCALE), np.float32(at.sy * DELTA_SCALE)
    grain = np.float32(at.grain)
    i, j = (ONE, ZERO) if at.swap else (ZERO, ONE)
    total = _ZERO
    for k in range(size):
        w = max(_ZERO, np.float32(entries[k, 2]) * grain)
        counts.fan_a[k] = sx * np.float32(entries[k, i])
        counts.fan_b[k] = sy * np.float32(entries[k, j])
        counts.fan_w[k] = w
        total += w
    return float(total)


@jit
def turn_fan(counts: Counts, size: int, at: Place, p: float, q: float, mirrored: bool) -> None:
    """Turn differences to light traced at (p, q) into tangential cosines of the sheet's frame; see `lens_sample`."""
    flip = np.float32(-1.0 if mirrored else 1.0)
    p, q = (at.sx * q, at.sy * p) if at.swap else (at.sx * p, at.sy * q)
    p1, q1, x1, y1 = np.float32(p), np.float32(q), np.float32(at.x), np.float32(at.y)
    c, s = np.float32(at.c), np.float32(at.s)
    for k in range(size):
        a, b = counts.fan_a[k], counts.fan_b[k]
        ox, oy = x1 + a, y1 + b
        beyond = ox * ox + oy * oy > _EDGE
        ox = p1 + a if beyond else ox
        oy = q1 + b if beyond else oy
        shrink = np.sqrt(_EDGE / max(ox * ox + oy * oy, _EDGE))
        ox *= shrink
        oy *= shrink
        counts.fan_a[k] = flip * (c * ox - s * oy)
        counts.fan_b[k] = s * ox + c * oy


@jit
def cell_of_single(x: Any, y: Any, z: Any, scale: Any, most: Any) -> Any:
    """`cell_of` in single precision; ``scale`` is half the cells along the side, ``most`` the last of them."""
    rho = np.sqrt(max(_ZERO, _UNIT - z))
    ax, ay = abs(x), abs(y)
    first = ax >= ay
    t = min(ax, ay) / max(ax, ay, _TINY)
    s = t * t
    q = s * s
    arc = (_T0 + _T1 * s) + q * ((_T2 + _T3 * s) + q * (_T4 + _T5 * s))
    small = rho * t * arc
    u = np.copysign(rho if first else small, x)
    v = np.copysign(small if first else rho, y)
    return min(most, np.int32((u + _UNIT) * scale)) * (most + _STEP) + min(most, np.int32((v + _UNIT) * scale))


@jit
def aim_fan(counts: Counts, size: int, geo: Numbers, side: int, x: float, y: float, z: float, f: Frame) -> None:
    """Cells of directions and places for samples that leave (x, y, z) downwards; weight 0 if they miss the aperture."""
    scale, most = np.float32(0.5 * side), np.int32(side - 1)
    tc, ts = np.float32(geo[TURN_C]), np.float32(geo[TURN_S])
    ex, ey, ez = np.float32(f.ex), np.float32(f.ey), np.float32(f.ez)
    fx, fy, fz = np.float32(f.fx), np.float32(f.fy), np.float32(f.fz)
    nx, ny, nz = np.float32(f.nx), np.float32(f.ny), np.float32(f.nz)
    x1, y1, z1 = np.float32(x), np.float32(y), np.float32(z)
    d, per_d = np.float32(max(counts.distance, 1.0)), np.float32(1.0 / max(counts.distance, 1.0))
    width, depth = np.float32(geo[AX] * 1.0000005), np.float32(geo[AY] * 1.0000005)
    rectangle, flat = geo[SHAPE] == RECTANGLE, counts.flat
    for k in range(size):
        a, b = counts.fan_a[k], counts.fan_b[k]
        h = np.sqrt(max(_LEAST, _UNIT - a * a - b * b))
        dx = a * ex + b * fx - h * nx
        dy = a * ey + b * fy - h * ny
        dz = a * ez + b * fz - h * nz
        t = z1 / max(_SMALL, -dz)
        qx, qy = x1 + t * dx, y1 + t * dy
        hit = (abs(qx) <= width) & (abs(qy) <= depth) if rectangle else qx * qx + qy * qy <= width * width
        keep = (dz < _ZERO) & hit
        counts.fan_w[k] = counts.fan_w[k] if keep else _ZERO
        qx = qx if keep else _ZERO
        qy = qy if keep else _ZERO
        dz = min(dz, _ZERO)
        qx, qy = tc * qx - ts * qy, ts * qx + tc * qy
        dx, dy = tc * dx - ts * dy, ts * dx + tc * dy
        counts.fan_far[k] = cell_of_single(dx, dy, -dz, scale, most)
        p = qx * dx + qy * dy
        t = d / max(_SMALL, -dz) if flat else np.sqrt(p * p + d * d - qx * qx - qy * qy) - p
        qx, qy, qz = qx + t * dx, qy + t * dy, -t * dz
        r = _UNIT / np.sqrt(qx * qx + qy * qy + qz * qz) if flat else per_d
        counts.fan_near[k] = cell_of_single(qx * r, qy * r, qz * r, scale, most)


@jit
def score_fan(
    scene: Scene, size: int, source: int, boot: int, wall: int, value: float, x: float, y: float, z: float, frame: Frame
) -> None:
    """Count a fan that was read and turned; ``value`` is what all its samples together carry at weight 1 [m²]."""
    counts = scene.counts
    gentle, side, far, near = slot(counts, boot, wall)
    aim_fan(counts, size, scene.sky.geometry, side, x, y, z, frame)
    share = value / size
    add_fan(counts, scene.light, source, gentle, size, far, counts.fan_far, share)
    if counts.distance > 0.0:
        add_fan(counts, scene.light, source, gentle, size, near, counts.fan_near, share)
