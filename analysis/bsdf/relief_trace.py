"""Trace a ray through one cell of a sheet given by height maps; compiled.

w is the depth below the plane of the flat side. The material fills flat(x, y) < w < prism(x, y). Heights between
samples are quadratic B-splines: smooth, within the range of the samples around, and never steeper than them. So the
distance to the surface along a ray is at least the gap divided by how fast the gap can close, and the ray advances by
that much at a time (J. Hart, Sphere tracing, Visual Computer 12, 1996, doi:10.1007/s003710050084); within a quarter
of a sample it goes on by Newton's method.

The numbers come as one array: [index, absorption per mm, pitch mm, deepest mm, steepest prism side, steepest flat side,
sigma of slopes, cos orientation, sin orientation, isotropic].
"""

import math

import numpy as np
from numpy.typing import NDArray

from analysis.bsdf.compiled import compiled
from analysis.bsdf.optics import State, cross_surface, uniform

Floats = NDArray[np.float64]

_NEAR = 1e-7  # mm; a gap this small is a hit
_START = 2e-6  # mm; how far outside the sheet a ray begins
_MAX_STEPS = 20000
_MAX_EVENTS = 20000
_LOST = -1


@compiled
def spline(x: float, y: float, heights: Floats, pitch: float) -> tuple[float, float, float]:
    """Height [mm] and its slopes along x and y at a place [mm]; the map repeats."""
    n = len(heights)
    u, v = (x / pitch) * n - 0.5, (y / pitch) * n - 0.5
    i, j = math.floor(u + 0.5), math.floor(v + 0.5)
    s, t = u - i, v - j
    a0, a1, a2 = 0.5 * (0.5 - s) ** 2, 0.75 - s * s, 0.5 * (0.5 + s) ** 2
    b0, b1, b2 = 0.5 * (0.5 - t) ** 2, 0.75 - t * t, 0.5 * (0.5 + t) ** 2
    i0, i1, i2 = int(i - 1) % n, int(i) % n, int(i + 1) % n
    j0, j1, j2 = int(j - 1) % n, int(j) % n, int(j + 1) % n
    r0 = b0 * heights[i0, j0] + b1 * heights[i0, j1] + b2 * heights[i0, j2]
    r1 = b0 * heights[i1, j0] + b1 * heights[i1, j1] + b2 * heights[i1, j2]
    r2 = b0 * heights[i2, j0] + b1 * heights[i2, j1] + b2 * heights[i2, j2]
    q0 = (t - 0.5) * heights[i0, j0] - 2.0 * t * heights[i0, j1] + (t + 0.5) * heights[i0, j2]
    q1 = (t - 0.5) * heights[i1, j0] - 2.0 * t * heights[i1, j1] + (t + 0.5) * heights[i1, j2]
    q2 = (t - 0.5) * heights[i2, j0] - 2.0 * t * heights[i2, j1] + (t + 0.5) * heights[i2, j2]
    per_mm = n / pitch
    return (
        a0 * r0 + a1 * r1 + a2 * r2,
        ((s - 0.5) * r0 - 2.0 * s * r1 + (s + 0.5) * r2) * per_mm,
        (a0 * q0 + a1 * q1 + a2 * q2) * per_mm,
    )


@compiled
def advance(
    x: float,
    y: float,
    w: float,
    dx: float,
    dy: float,
    dw: float,
    inside: bool,
    above: bool,
    prism: Floats,
    flat: Floats,
    g: Floats,
) -> tuple[float, float, float, float, int]:
    """Follow a ray to its next surface: (x, y, w, path, surface).

    Surface 0 is the flat side, 1 the prism side, 2 the open air, -1 a ray that was given up. ``inside`` tells the
    material from the air; ``above`` which air, on the flat side or among the prisms.
    """
    pitch, deepest = g[2], g[3]
    close = 0.25 * pitch / len(prism)  # below this the surface is as good as plane
    across = math.sqrt(dx * dx + dy * dy)
    to_prism, to_flat = g[4] * across + abs(dw) + 1e-12, g[5] * across + abs(dw) + 1e-12
    path = 0.0
    for _ in range(_MAX_STEPS):
        gap, surface, forward, closing = 0.0, -1, 1e30, 0.0
        if inside or above:
            height, sx, sy = spline(x, y, flat, pitch)
            sign = 1.0 if inside else -1.0
            gap, surface = sign * (w - height), 0
            forward, closing = gap / to_flat, -sign * (dw - sx * dx - sy * dy)
        if inside or not above:
            height, sx, sy = spline(x, y, prism, pitch)
            sign = 1.0 if inside else -1.0
            other = sign * (height - w)
            if other / to_prism < forward:
                gap, surface = other, 1
                forward, closing = gap / to_prism, sign * (dw - sx * dx - sy * dy)
        if gap < close:
            if closing <= 0.0:
                forward = close  # on its way off
            elif abs(gap) < _NEAR:
                return x, y, w, path, surface
            else:
                forward = max(-close, min(gap / closing, 4.0 * close))
        x, y, w, path = x + forward * dx, y + forward * dy, w + forward * dw, path + forward
        if not inside:
            if above and w < 0.0 and dw < 0.0:
                return x, y, w, path, 2
            if not above and w > deepest and dw > 0.0:
                return x, y, w, path, 2
    return x, y, w, path, _LOST


@compiled
def outward(x: float, y: float, surface: int, prism: Floats, flat: Floats, pitch: float) -> tuple[float, float, float]:
    """Normal out of the material at a place of a surface, in (x, y, w)."""
    if surface == 1:
        _, sx, sy = spline(x, y, prism, pitch)
        length = math.sqrt(sx * sx + sy * sy + 1.0)
        return -sx / length, -sy / length, 1.0 / length
    _, sx, sy = spline(x, y, flat, pitch)
    length = math.sqrt(sx * sx + sy * sy + 1.0)
    return sx / length, sy / length, -1.0 / length


@compiled
def scatter_relief(
    dx: float, dy: float, dz: float, prism: Floats, flat: Floats, g: Floats, state: State
) -> tuple[float, float, float, float]:
    """Send one ray through the sheet: (dx, dy, dz, weight) of what comes out; as `prism_trace.scatter_one`."""
    cos_o, sin_o = g[7], g[8]
    if g[9] > 0.0:
        turn = 2.0 * math.pi * uniform(state)
        cos_o, sin_o = math.cos(turn), math.sin(turn)
    dx, dy, dw = cos_o * dx + sin_o * dy, -sin_o * dx + cos_o * dy, -dz
    pitch = g[2]
    x, y = pitch * uniform(state), pitch * uniform(state)
    above = dw > 0.0
    inside = False
    w = -_START if above else g[3] + _START
    weight = 1.0
    for _ in range(_MAX_EVENTS):
        x, y, w, path, surface = advance(x, y, w, dx, dy, dw, inside, above, prism, flat, g)
        if inside:
            weight *= math.exp(-g[1] * path)
            if weight < 1e-3:  # Russian roulette keeps the mean
                if uniform(state) > 0.1:
                    weight = 0.0
                    break
                weight *= 10.0
        if surface == 2:
            break
        if surface < 0:
            weight = 0.0
            break
        nx, ny, nw = outward(x, y, surface, prism, flat, pitch)
        if (nx * dx + ny * dy + nw * dw > 0.0) != inside:
            continue  # a ray that grazes a bend and does not meet it from its side: let it go on
        rough = g[6] if surface == 1 else 0.0
        inside, dx, dy, dw = cross_surface(inside, nx, ny, nw, dx, dy, dw, g[0], rough, state)
        above = surface == 0
    else:
        weight = 0.0
    return cos_o * dx - sin_o * dy, sin_o * dx + cos_o * dy, -dw, weight


@compiled
def scatter_relief_many(
    directions: Floats,
    per_direction: int,
    seeds: State,
    prism: Floats,
    flat: Floats,
    g: Floats,
    out: Floats,
    weights: Floats,
) -> None:
    """Fill ``out`` (n, m, 3) and ``weights`` (n, m) with m samples of each direction (n, 3), seeded per direction."""
    state = np.zeros(1, dtype=np.uint64)
    for i in range(len(directions)):
        state[0] = seeds[i]
        for j in range(per_direction):
            x, y, z, weight = scatter_relief(
                directions[i, 0], directions[i, 1], directions[i, 2], prism, flat, g, state
            )
            out[i, j, 0] = x
            out[i, j, 1] = y
            out[i, j, 2] = z
            weights[i, j] = weight
