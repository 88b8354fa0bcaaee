"""Many samples of a lens at once: neighbours in a row of its table, aimed and counted in loops that use wide registers.

The light that reaches a prismatic sheet is sent on by dozens of samples with their share each; that costs a tenth of
tracing as many rays, and most of the noise of a direction comes from this last event.
"""

import math

from analysis.simulate.kernels.arrays import AX, AY, DELTA_SCALE, RECTANGLE, SHAPE, TURN_C, TURN_S, WEIGHT_SCALE
from analysis.simulate.kernels.counting import add_fan, slot
from analysis.simulate.kernels.jit import jit
from analysis.simulate.kernels.optics import square_of


@jit
def read_fan(counts, size, table, row, k0, swap, sx, sy):  # type: ignore[no-untyped-def]
    """Fetch differences and weights of ``size`` consecutive entries."""
    for k in range(size):
        a = table[row, k0 + k, 0] * DELTA_SCALE
        b = table[row, k0 + k, 1] * DELTA_SCALE
        counts.fan_a[k] = sx * (b if swap else a)
        counts.fan_b[k] = sy * (a if swap else b)
        counts.fan_w[k] = max(0.0, table[row, k0 + k, 2] * WEIGHT_SCALE)


@jit
def turn_fan(counts, size, px, py, sx, sy, p, q, c, s, mirrored):  # type: ignore[no-untyped-def]
    """Differences to tangential cosines of the sheet's frame: from light (px, py) traced at (p, q), turned by (c, s)."""
    flip = -1.0 if mirrored else 1.0
    for k in range(size):
        a, b = counts.fan_a[k], counts.fan_b[k]
        ox, oy = px + a, py + b
        beyond = ox * ox + oy * oy > 0.9999
        ox = sx * p + a if beyond else ox
        oy = sy * q + b if beyond else oy
        shrink = math.sqrt(0.9999 / max(ox * ox + oy * oy, 0.9999))
        ox *= shrink
        oy *= shrink
        counts.fan_a[k] = flip * (c * ox - s * oy)
        counts.fan_b[k] = s * ox + c * oy


@jit
def aim_fan(counts, size, geo, side, x, y, z, ex, ey, ez, fx, fy, fz, nx, ny, nz):  # type: ignore[no-untyped-def]
    """Cells of directions and places for samples that leave (x, y, z) downwards; weight 0 where they miss the aperture.

    The sheet's frame: e and f along it, n its outward normal.
    """
    scale = 0.5 * side
    tc, ts = geo[TURN_C], geo[TURN_S]
    d = max(counts.distance, 1.0)
    rectangle = geo[SHAPE] == RECTANGLE
    for k in range(size):
        a, b = counts.fan_a[k], counts.fan_b[k]
        h = math.sqrt(max(1e-12, 1.0 - a * a - b * b))
        dx = a * ex + b * fx - h * nx
        dy = a * ey + b * fy - h * ny
        dz = a * ez + b * fz - h * nz
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
def score_fan(counts, size, light, geo, source, m, n, value, x, y, z, ex, ey, ez, fx, fy, fz, nx, ny, nz):  # type: ignore[no-untyped-def]
    """Count a fan that was read and turned; ``value`` is what all its samples together carry at weight 1."""
    gentle, side, far, near = slot(counts, m, n)
    aim_fan(counts, size, geo, side, x, y, z, ex, ey, ez, fx, fy, fz, nx, ny, nz)
    share = value / size
    add_fan(counts, light, source, gentle, size, far, counts.fan_far, share)
    if counts.distance > 0.0:
        add_fan(counts, light, source, gentle, size, near, counts.fan_near, share)
