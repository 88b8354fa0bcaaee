"""What happens to a ray at a lens."""

import math
from typing import Any, Final, NamedTuple

import numpy as np

from analysis.simulate.kernels.arrays import (
    CLEAR,
    COS,
    DELTA_SCALE,
    DEPTH,
    GRAIN,
    HALF,
    HAZE,
    INDEX,
    ISOTROPIC,
    KIND,
    MIRROR,
    NONE,
    REFLECT,
    SIN,
    SOIL,
    TABLE,
    TRANSMIT,
    WIDE,
    Numbers,
    Skylight,
    Table,
)
from analysis.simulate.kernels.jit import jit
from analysis.simulate.kernels.maps import arctan_unit, circle, cosine_lobe, square_of, uniform

_ONE: Final[Any] = np.int64(1)

Passed = tuple[float, float, bool, float, np.uint64]
"""Outgoing tangential cosines, whether the light passes, its weight, and the random state."""


class Place(NamedTuple):
    """Where a scatter table is read.

    Attributes
    ----------
    x, y
        Tangential direction cosines of the light in the pattern's frame.
    row
        Of the table.
    swap, sx, sy
        How the row was folded: whether x and y are exchanged, and their signs.
    c, s
        The pattern's turn.
    grain
        Unit of the table's weights.
    """

    x: float
    y: float
    row: int
    swap: bool
    sx: float
    sy: float
    c: float
    s: float
    grain: float


@jit
def slab(cosine: float, index: float, depth: float) -> tuple[float, float]:
    """Transmittance and reflectance of a clear slab for unpolarised light, inter-reflections summed.

    Fresnel's equations for each polarisation, then the geometric series; ``depth`` is absorption coefficient times
    thickness. E.g. Born & Wolf, Principles of Optics, 7th ed., 1.5.2; Duffie & Beckman, 4th ed., eq. 5.3.1 to 5.3.3.
    """
    inside = math.sqrt(1.0 - (1.0 - cosine * cosine) / (index * index))
    rs = (cosine - index * inside) / (cosine + index * inside)
    rp = (index * cosine - inside) / (index * cosine + inside)
    rs *= rs
    rp *= rp
    tau = math.exp(-depth / inside)
    gs = (1.0 - rs) * (1.0 - rs) * tau / (1.0 - rs * rs * tau * tau + 1e-300)
    gp = (1.0 - rp) * (1.0 - rp) * tau / (1.0 - rp * rp * tau * tau + 1e-300)
    return 0.5 * (gs + gp), 0.5 * (rs + rp + (rs * gs + rp * gp) * tau)


@jit
def lens_node(lx: float, ly: float, cosine: float, half: int, r1: float, r2: float) -> tuple[int, bool, float, float]:
    """Table row for a direction of incidence, one of the four around it at random (linear interpolation in the mean).

    The pattern has the symmetry of a square, so the direction is folded into an eighth of the hemisphere. Returns the
    row, whether x and y of the row are exchanged, and their signs.
    """
    u, v = square_of(lx, ly, cosine)
    sx = math.copysign(1.0, u)
    sy = math.copysign(1.0, v)
    i = min(int(abs(u) * half + r1), half)
    j = min(int(abs(v) * half + r2), half)
    swap = j > i
    if swap:
        i, j = j, i
    return i * (i + 1) // 2 + j, swap, sx, sy


@jit
def wide_node(lx: float, ly: float, cosine: float, half: int, r1: float, r2: float) -> int:
    """Table row as `lens_node` finds it, for a pattern without symmetry: the grid covers the whole square."""
    u, v = square_of(lx, ly, cosine)
    i = min(int((u + 1.0) * half + r1), 2 * half)
    j = min(int((v + 1.0) * half + r2), 2 * half)
    return i * (2 * half + 1) + j


@jit
def lens_sample(table: Table, p: float, q: float, at: Place, k: int) -> tuple[float, float, bool, float]:
    """Outgoing tangential cosines in the pattern's frame, whether the light passes, and its weight, from entry ``k``.

    The entry is a difference to the light's own direction; where that leads beyond grazing, the direction (p, q) that
    the entry was traced with is taken instead.
    """
    a = table[at.row, k, 0] * DELTA_SCALE
    b = table[at.row, k, 1] * DELTA_SCALE
    w = table[at.row, k, 2] * at.grain
    if at.swap:
        a, b = b, a
        p, q = q, p
    ox = at.x + at.sx * a
    oy = at.y + at.sy * b
    if ox * ox + oy * oy > 0.9999:
        ox = at.sx * (a + p)
        oy = at.sy * (b + q)
        far = ox * ox + oy * oy
        if far > 0.9999:
            shrink = math.sqrt(0.9999 / far)
            ox *= shrink
            oy *= shrink
    return ox, oy, w > 0.0, abs(w)


@jit
def to_pattern(lens: Numbers, x: float, y: float, c: float, s: float) -> tuple[float, float]:
    """Tangential cosines in the frame of the lens pattern, turned by (c, s)."""
    if lens[MIRROR] != 0.0:
        x = -x
    return c * x + s * y, c * y - s * x


@jit
def from_pattern(lens: Numbers, x: float, y: float, c: float, s: float) -> tuple[float, float]:
    """Back from the frame of the pattern."""
    a, b = c * x - s * y, s * x + c * y
    if lens[MIRROR] != 0.0:
        a = -a
    return a, b


@jit
def lens_turn(lens: Numbers, state: np.uint64) -> tuple[float, float, np.uint64]:
    """Cosine and sine of the pattern's turn for this hit (at random for an isotropic lens)."""
    c = lens[COS]
    s = lens[SIN]
    if lens[ISOTROPIC] != 0.0:
        a, state = uniform(state)
        c, s = circle(a)
    return c, s, state


@jit
def lens_plain(lens: Numbers, lx: float, ly: float, cosine: float, state: np.uint64) -> Passed:
    """What a lens without a table does: nothing, a clear slab, or a diffuser."""
    kind = lens[KIND]
    if kind == NONE:
        return lx, ly, True, 1.0, state
    a, state = uniform(state)
    if kind == CLEAR:
        t, r = slab(cosine, lens[INDEX], lens[DEPTH])
        return lx, ly, a * (t + r) < t, t + r, state
    t = lens[TRANSMIT]
    r = lens[REFLECT]
    ox, oy, state = cosine_lobe(state)
    return ox, oy, a * (t + r) < t, t + r, state


@jit
def dirt(lens: Numbers, cosine: float) -> float:
    """Transmittance of the dirt on a lens's upper face for light at this cosine to its normal (Beer and Lambert)."""
    if lens[SOIL] == 0.0:
        return 1.0
    return math.exp(-lens[SOIL] / max(cosine, 1e-3))


@jit
def lens_finish(
    lens: Numbers, from_above: bool, cosine: float, ox: float, oy: float, through: bool, w: float, state: np.uint64
) -> tuple[float, float, float, np.uint64]:
    """Haze (transmitted light becomes a cosine lobe) and dirt on the upper face (weighs, never turns)."""
    if through and lens[HAZE] > 0.0:
        a, state = uniform(state)
        hx, hy, state = cosine_lobe(state)
        if a < lens[HAZE]:
            ox, oy = hx, hy
    if through:
        w *= dirt(lens, cosine if from_above else math.sqrt(max(1e-6, 1.0 - ox * ox - oy * oy)))
    return ox, oy, w, state


@jit
def lens_place(lens: Numbers, lx: float, ly: float, cosine: float, state: np.uint64) -> tuple[Place, np.uint64]:
    """Where a table is read for light of these direction cosines."""
    c, s, state = lens_turn(lens, state)
    px, py = to_pattern(lens, lx, ly, c, s)
    r1, state = uniform(state)
    r2, state = uniform(state)
    if lens[WIDE] != 0.0:
        row = wide_node(px, py, cosine, int(lens[HALF]), r1, r2)
        return Place(px, py, row, False, 1.0, 1.0, c, s, lens[GRAIN]), state
    row, swap, sx, sy = lens_node(px, py, cosine, int(lens[HALF]), r1, r2)
    return Place(px, py, row, swap, sx, sy, c, s, lens[GRAIN]), state


@jit
def ring_place(at: Place, rows: int, r: float) -> Place:
    """The same place in a table of one angle of incidence: one of the two rows beside its azimuth, at random."""
    ax, ay = abs(at.x), abs(at.y)
    swap = ay > ax
    share = (4.0 / math.pi) * arctan_unit(min(ax, ay) / max(ax, ay, 1e-300))
    row = min(int(share * (rows - 1) + r), rows - 1)
    return Place(at.x, at.y, row, swap, math.copysign(1.0, at.x), math.copysign(1.0, at.y), at.c, at.s, at.grain)


@jit
def entry_of(table: Table, count: int, pick: float) -> int:
    """First of ``count`` consecutive entries of a row, chosen by a number in [0, 1)."""
    return int(pick * (table.shape[1] - count + 1))


@jit
def lens_hit(
    sky: Skylight,
    lens: Numbers,
    table: Table,
    from_above: bool,
    lx: float,
    ly: float,
    cosine: float,
    pick: float,
    state: np.uint64,
) -> Passed:
    """One pass of a lens.

    ``lx, ly, cosine``: tangential and normal direction cosines of the light (cosine > 0, towards the sheet);
    ``pick`` in [0, 1) chooses the entry of the table. Returns outgoing tangential cosines, whether the light passes,
    its weight (what is missing to 1 is absorbed), and the random state.
    """
    if lens[KIND] != TABLE:
        ox, oy, through, w, state = lens_plain(lens, lx, ly, cosine, state)
    else:
        at, state = lens_place(lens, lx, ly, cosine, state)
        k = entry_of(table, _ONE, pick)
        nodes = sky.wide if lens[WIDE] != 0.0 else sky.nodes
        qx, qy, through, w = lens_sample(table, nodes[at.row, 0], nodes[at.row, 1], at, k)
        ox, oy = from_pattern(lens, qx, qy, at.c, at.s)
    ox, oy, w, state = lens_finish(lens, from_above, cosine, ox, oy, through, w, state)
    return ox, oy, through, w, state
