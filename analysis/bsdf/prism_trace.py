"""Trace a ray through one periodic cell of a sheet with square pyramids; compiled.

Inside this module w is the depth below the flat side (so z = -w), the flat side is w = 0, valleys lie at w = base and
peaks at w = base + height. Within a cell the material is convex: the half space w >= 0 cut by four facets. A ray that
leaves a cell sideways enters the next one, which is the same cell again.

The geometry is passed as one array: [index, absorption per mm, base mm, height mm, half pitch mm, sin slope, cos slope,
sigma of the facets' slopes, cos orientation, sin orientation, isotropic].
"""

import math

import numpy as np
from numpy.typing import NDArray

from analysis.bsdf.compiled import compiled
from analysis.bsdf.optics import State, cross_surface, uniform

Floats = NDArray[np.float64]

GEOMETRY_SIZE = 11
_FAR = 1e30
_EDGE = 1e-9  # mm; rounding at facets and cell walls
_MAX_EVENTS = 20000  # surfaces met by one ray; only rays that neither leave nor are absorbed get here


@compiled
def cell_wall(x: float, dx: float, half: float) -> float:
    """Distance along a ray to the wall of its cell in one coordinate."""
    if dx > 0.0:
        return max(0.0, (half - x) / dx)
    if dx < 0.0:
        return max(0.0, (-half - x) / dx)
    return _FAR


@compiled
def wrapped(x: float, half: float) -> float:
    """The same place in the cell around 0."""
    return x - 2.0 * half * math.floor((x + half) / (2.0 * half))


@compiled
def next_inside(
    x: float, y: float, w: float, dx: float, dy: float, dw: float, geometry: Floats
) -> tuple[float, float, float, float, int]:
    """Follow a ray inside the material to its next surface: (x, y, w, path mm, surface).

    Surface 0 is the flat side, 1 to 4 are the facets facing +x, -x, +y, -y.
    """
    base, height, half = geometry[2], geometry[3], geometry[4]
    sine, cosine = geometry[5], geometry[6]
    level = (base + height) * cosine
    path = 0.0
    while True:
        best, surface = _FAR, -1
        if dw < 0.0:
            best, surface = max(0.0, -w / dw), 0
        for k in range(4):
            place, rate = (x, dx) if k < 2 else (y, dy)
            side = 1.0 if k % 2 == 0 else -1.0
            along = side * sine * rate + cosine * dw
            if along > 0.0:
                t = max(0.0, (level - side * sine * place - cosine * w) / along)
                if t < best:
                    best, surface = t, k + 1
        tx, ty = cell_wall(x, dx, half), cell_wall(y, dy, half)
        wall = min(tx, ty)
        step = min(best, wall)
        x, y, w, path = x + step * dx, y + step * dy, w + step * dw, path + step
        if best <= wall:
            return x, y, w, path, surface
        if tx <= ty:
            x = -math.copysign(half, dx)
        else:
            y = -math.copysign(half, dy)


@compiled
def next_outside(
    x: float, y: float, w: float, dx: float, dy: float, dw: float, geometry: Floats
) -> tuple[float, float, float, int]:
    """Follow a ray in the air among the prisms: (x, y, w, facet 1 to 4), or facet 0 when it leaves below the peaks."""
    base, height, half = geometry[2], geometry[3], geometry[4]
    sine, cosine = geometry[5], geometry[6]
    level = (base + height) * cosine
    for _ in range(100000):
        enter, leave, facet = -_FAR, _FAR, 0
        for k in range(4):
            place, rate = (x, dx) if k < 2 else (y, dy)
            side = 1.0 if k % 2 == 0 else -1.0
            along = side * sine * rate + cosine * dw
            gap = level - side * sine * place - cosine * w  # > 0 within this half space
            if along < 0.0:
                if gap / along > enter:
                    enter, facet = gap / along, k + 1
            elif gap < _EDGE:
                leave = -_FAR
            elif along > 0.0:
                leave = min(leave, gap / along)
        tx, ty = cell_wall(x, dx, half), cell_wall(y, dy, half)
        wall = min(tx, ty)
        if facet > 0 and enter < leave and enter > -_EDGE and enter <= wall:
            enter = max(0.0, enter)
            return x + enter * dx, y + enter * dy, w + enter * dw, facet
        if dw > 0.0 and (base + height - w) / dw <= wall:
            return x, y, w, 0
        x, y, w = x + wall * dx, y + wall * dy, w + wall * dw
        if tx <= ty:
            x = -math.copysign(half, dx)
        else:
            y = -math.copysign(half, dy)
    return x, y, w, 0


@compiled
def facet_normal(surface: int, geometry: Floats) -> tuple[float, float, float]:
    """Normal out of the material of surface 0 (flat) to 4, in (x, y, w)."""
    sine, cosine = geometry[5], geometry[6]
    if surface == 0:
        return 0.0, 0.0, -1.0
    if surface == 1:
        return sine, 0.0, cosine
    if surface == 2:
        return -sine, 0.0, cosine
    if surface == 3:
        return 0.0, sine, cosine
    return 0.0, -sine, cosine


@compiled
def scatter_one(dx: float, dy: float, dz: float, geometry: Floats, state: State) -> tuple[float, float, float, float]:
    """Send one ray through the sheet: (dx, dy, dz, weight) of what comes out.

    d is the direction of travel in the sheet's frame (flat side up); dz < 0 meets the flat side, dz > 0 the prisms. The
    place on the sheet is random. The weight is the part that was not absorbed, in [0, 1].
    """
    cos_o, sin_o = geometry[8], geometry[9]
    if geometry[10] > 0.0:
        turn = 2.0 * math.pi * uniform(state)
        cos_o, sin_o = math.cos(turn), math.sin(turn)
    dx, dy = cos_o * dx + sin_o * dy, -sin_o * dx + cos_o * dy
    dw = -dz
    index, absorption, half, sigma = geometry[0], geometry[1], geometry[4], geometry[7]
    x, y = half * (2.0 * uniform(state) - 1.0), half * (2.0 * uniform(state) - 1.0)
    weight = 1.0
    if dw > 0.0:
        w, surface = 0.0, 0
    else:
        w = geometry[2] + geometry[3]
        x, y, w, surface = next_outside(x, y, w, dx, dy, dw, geometry)
    inside = False
    for _ in range(_MAX_EVENTS):
        nx, ny, nw = facet_normal(surface, geometry)
        rough = sigma if surface > 0 else 0.0
        inside, dx, dy, dw = cross_surface(inside, nx, ny, nw, dx, dy, dw, index, rough, state)
        if inside:
            x, y, w, path, surface = next_inside(x, y, w, dx, dy, dw, geometry)
            weight *= math.exp(-absorption * path)
            if weight < 1e-3:  # Russian roulette keeps the mean
                if uniform(state) > 0.1:
                    weight = 0.0
                    break
                weight *= 10.0
        elif surface == 0:
            break
        else:
            x, y, w, surface = next_outside(x, y, w, dx, dy, dw, geometry)
            if surface == 0:
                break
    else:
        weight = 0.0
    return cos_o * dx - sin_o * dy, sin_o * dx + cos_o * dy, -dw, weight


@compiled
def scatter_many(
    directions: Floats, per_direction: int, seeds: State, geometry: Floats, out: Floats, weights: Floats
) -> None:
    """Fill ``out`` (n, m, 3) and ``weights`` (n, m) with m samples of each direction (n, 3), seeded per direction."""
    state = np.zeros(1, dtype=np.uint64)
    for i in range(len(directions)):
        state[0] = seeds[i]
        for j in range(per_direction):
            x, y, z, weight = scatter_one(directions[i, 0], directions[i, 1], directions[i, 2], geometry, state)
            out[i, j, 0] = x
            out[i, j, 1] = y
            out[i, j, 2] = z
            weights[i, j] = weight
