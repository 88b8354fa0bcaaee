"""Many samples of a lens at once: neighbours in a row of its table, aimed and counted in loops that use wide registers.

The light that reaches a prismatic sheet is sent on by dozens of samples with their share each; that costs a tenth of
tracing as many rays, and most of the noise of a direction comes from this last event.
"""

import math

from analysis.simulate.kernels.arrays import (
    AX,
    AY,
    DELTA_SCALE,
    RECTANGLE,
    SHAPE,
    TURN_C,
    TURN_S,
    WEIGHT_SCALE,
    Counts,
    Frame,
    Numbers,
    Scene,
    Table,
)
from analysis.simulate.kernels.counting import add_fan, slot
from analysis.simulate.kernels.jit import jit
from analysis.simulate.kernels.optics import Place, square_of


@jit
def read_fan(counts: Counts, size: int, table: Table, at: Place, first: int) -> float:
    """Fetch ``size`` consecutive entries' differences and weights; returns the sum of the transmitted weights."""
    total = 0.0
    for k in range(size):
        a = table[at.row, first + k, 0] * DELTA_SCALE
        b = table[at.row, first + k, 1] * DELTA_SCALE
        w = max(0.0, table[at.row, first + k, 2] * WEIGHT_SCALE)
        counts.fan_a[k] = at.sx * (b if at.swap else a)
        counts.fan_b[k] = at.sy * (a if at.swap else b)
        counts.fan_w[k] = w
        total += w
    return total


@jit
def turn_fan(counts: Counts, size: int, at: Place, p: float, q: float, mirrored: bool) -> None:
    """Turn differences to light traced at (p, q) into tangential cosines of the sheet's frame; see `lens_sample`."""
    flip = -1.0 if mirrored else 1.0
    p, q = (at.sx * q, at.sy * p) if at.swap else (at.sx * p, at.sy * q)
    for k in range(size):
        a, b = counts.fan_a[k], counts.fan_b[k]
        ox, oy = at.x + a, at.y + b
        beyond = ox * ox + oy * oy > 0.9999
        ox = p + a if beyond else ox
        oy = q + b if beyond else oy
        shrink = math.sqrt(0.9999 / max(ox * ox + oy * oy, 0.9999))
        ox *= shrink
        oy *= shrink
        counts.fan_a[k] = flip * (at.c * ox - at.s * oy)
        counts.fan_b[k] = at.s * ox + at.c * oy


@jit
def aim_fan(counts: Counts, size: int, geo: Numbers, side: int, x: float, y: float, z: float, f: Frame) -> None:
    """Cells of directions and places for samples that leave (x, y, z) downwards; weight 0 if they miss the aperture."""
    scale = 0.5 * side
    tc, ts = geo[TURN_C], geo[TURN_S]
    d = max(counts.distance, 1.0)
    rectangle = geo[SHAPE] == RECTANGLE
    for k in range(size):
        a, b = counts.fan_a[k], counts.fan_b[k]
        h = math.sqrt(max(1e-12, 1.0 - a * a - b * b))
        dx = a * f.ex + b * f.fx - h * f.nx
        dy = a * f.ey + b * f.fy - h * f.ny
        dz = a * f.ez + b * f.fz - h * f.nz
        t = z / max(1e-9, -dz)
        qx, qy = x + t * dx, y + t * dy
        far = max(abs(qx) / geo[AX], abs(qy) / geo[AY]) if rectangle else (qx * qx + qy * qy) / (geo[AX] * geo[AX])
        keep = dz < 0.0 and far <= 1.000001
        counts.fan_w[k] = counts.fan_w[k] if keep else 0.0
        qx = qx if keep else 0.0
        qy = qy if keep else 0.0
        dz = min(dz, 0.0)
        qx, qy = tc * qx - ts * qy, ts * qx + tc * qy
        dx, dy = tc * dx - ts * dy, ts * dx + tc * dy
        u, v = square_of(dx, dy, -dz)
        counts.fan_far[k] = min(side - 1, int((u + 1.0) * scale)) * side + min(side - 1, int((v + 1.0) * scale))
        p = qx * dx + qy * dy
        t = math.sqrt(p * p + d * d - qx * qx - qy * qy) - p
        u, v = square_of((qx + t * dx) / d, (qy + t * dy) / d, -t * dz / d)
        counts.fan_near[k] = min(side - 1, int((u + 1.0) * scale)) * side + min(side - 1, int((v + 1.0) * scale))


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
