"""Which turns and mirrors leave a skylight as it is, and what they do to maps of the sky and of the room below.

A symmetry is a matrix of 0, 1 and -1 on (east, north). If light from s gives the distribution M(s, o), light from g s
gives M(g s, g o) = M(s, o), so only one sun of each family needs to be traced.
"""

import math
from functools import cache

import numpy as np
from numpy.typing import NDArray

from simulators.hidden.skylight import Skylight

Floats = NDArray[np.float64]
Symmetry = tuple[int, int, int, int]
"""Row by row: (x', y') = (a x + b y, c x + d y)."""

IDENTITY: Symmetry = (1, 0, 0, 1)
FLIP_X: Symmetry = (-1, 0, 0, 1)
FLIP_Y: Symmetry = (1, 0, 0, -1)
HALF_TURN: Symmetry = (-1, 0, 0, -1)
QUARTER: Symmetry = (0, -1, 1, 0)
THREE_QUARTERS: Symmetry = (0, 1, -1, 0)
DIAGONAL: Symmetry = (0, 1, 1, 0)
ANTIDIAGONAL: Symmetry = (0, -1, -1, 0)

ALL = (IDENTITY, FLIP_X, FLIP_Y, HALF_TURN, QUARTER, THREE_QUARTERS, DIAGONAL, ANTIDIAGONAL)
TURNS = (IDENTITY, HALF_TURN, QUARTER, THREE_QUARTERS)


def symmetries(skylight: Skylight) -> tuple[Symmetry, ...]:
    """Return the symmetries that a skylight surely has."""
    found = set(ALL)
    if skylight.defect.sector_deg != (0.0, 0.0) or skylight.defect.gap_m != (0.0, 0.0):
        return (IDENTITY,)
    if not skylight.round and skylight.width_m != skylight.length_m:
        found &= {IDENTITY, FLIP_X, FLIP_Y, HALF_TURN}
    for lens in (skylight.entry, skylight.exit):
        if lens.kind != "prismatic" or lens.isotropic >= 1.0:
            continue
        east, west, north, south = lens.slopes_deg
        orientation = lens.orientation_deg % 360.0
        if east == west == north == south:
            found &= set(ALL) if orientation % 45.0 == 0.0 else set(TURNS)
            continue
        keeps = {IDENTITY}
        if orientation % 90.0 == 0.0:
            turned = orientation % 180.0 == 90.0
            if east == west:
                keeps |= {FLIP_Y if turned else FLIP_X}
            if north == south:
                keeps |= {FLIP_X if turned else FLIP_Y}
        if east == west and north == south:
            keeps |= {HALF_TURN}
        found &= keeps
    return tuple(g for g in ALL if g in found)


def apply(g: Symmetry, maps: Floats) -> Floats:
    """Turn maps (..., N, N), whose last axes run east and north, by a symmetry."""
    a, b, c, d = g
    if a:
        first, second = a, d
    else:
        maps, first, second = np.swapaxes(maps, -1, -2), b, c
    if first < 0:
        maps = np.flip(maps, -2)
    return np.flip(maps, -1) if second < 0 else maps


class SkyNodes:
    """The places in the sky from which light is traced: a square grid on the equal-area map of the sky.

    Attributes
    ----------
    step
        Spacing of the grid on the map.
    seeds : shape (n, 3)
        Unit vectors of the suns to trace, one of each family.
    members : shape (n_all, 3) of int
        For every node of the grid: index of its seed, index of the symmetry that moves the seed to it, both; and
        place in the grid is `where` (n_all, 2).
    solid_angle : shape (n_all,) [sr]
        Part of the sky each node stands for; they sum to the sky down to the lowest nodes' cells.
    """

    def __init__(self, across: int, group: tuple[Symmetry, ...], lowest_deg: float = 1.5) -> None:
        half = across // 2
        self.group = group
        self.step = math.sqrt(2.0) / (half + 0.5)
        limit = math.sqrt(2.0 * (1.0 - math.sin(math.radians(lowest_deg)))) / self.step
        grid = [(i, j) for i in range(-half, half + 1) for j in range(-half, half + 1) if math.hypot(i, j) <= limit]
        seed_of: dict[tuple[int, int], tuple[int, int]] = {}
        seeds: list[tuple[int, int]] = []
        for i, j in sorted(grid, key=lambda p: (-p[0], p[1])):
            if (i, j) in seed_of:
                continue
            for k, (a, b, c, d) in enumerate(group):
                seed_of.setdefault((a * i + b * j, c * i + d * j), (len(seeds), k))
            seeds.append((i, j))
        self.where = np.array(grid)
        self.half = half
        self.seed = np.array([seed_of[p][0] for p in grid])
        self.turn = np.array([seed_of[p][1] for p in grid])
        self.index = np.full((across, across), -1)
        self.index[self.where[:, 0] + half, self.where[:, 1] + half] = np.arange(len(grid))
        self.seeds = sky_from_map(np.array(seeds) * self.step)
        self.directions = sky_from_map(self.where * self.step)
        self.solid_angle = _areas(self.where, self.step)

    def spline(self, sun: Floats) -> tuple[NDArray[np.int64], Floats]:
        """Nodes and weights of a cubic B-spline about a direction: positive, smooth, of sum 1.

        The spline blurs the sun by step / sqrt 3 in each direction; nodes below the horizon fall away.
        """
        place = sun[:2] * math.sqrt(2.0 / (1.0 + sun[2])) / self.step + self.half
        base = np.floor(place).astype(int)
        u = place - base
        weights = np.stack([(1 - u) ** 3, 3 * u**3 - 6 * u**2 + 4, -3 * u**3 + 3 * u**2 + 3 * u + 1, u**3]) / 6.0
        rows = np.clip(base[0] + np.arange(-1, 3), 0, len(self.index) - 1)
        columns = np.clip(base[1] + np.arange(-1, 3), 0, len(self.index) - 1)
        nodes = self.index[rows[:, None], columns[None, :]].ravel()
        both = (weights[:, 0][:, None] * weights[:, 1][None, :]).ravel()
        kept = nodes >= 0
        return nodes[kept], both[kept] / both[kept].sum()


def sky_from_map(points: Floats) -> Floats:
    """Unit vectors towards the sky of points on the equal-area map, zenith in the middle, x east, y north."""
    points = np.asarray(points, dtype=np.float64)
    r2 = np.sum(points**2, axis=-1, keepdims=True)
    return np.concatenate([points * np.sqrt(1.0 - r2 / 4.0), 1.0 - r2 / 2.0], axis=-1)


def _areas(where: NDArray[np.int64], step: float, parts: int = 8) -> Floats:
    """Area of each node's cell above the horizon, counted on a finer grid; the rim goes to the nearest node."""
    offsets = (np.arange(parts) + 0.5) / parts - 0.5
    reach = int(where.max()) + 2
    fine = (np.arange(-reach, reach + 1)[:, None] + offsets[None, :]).ravel()
    x, y = np.meshgrid(fine, fine, indexing="ij")
    inside = np.hypot(x, y) * step <= math.sqrt(2.0)
    nearest = _nearest(where, np.stack([x[inside], y[inside]]), reach + 3)
    return np.asarray(np.bincount(nearest, minlength=len(where)) * (step / parts) ** 2)


def _nearest(where: NDArray[np.int64], points: Floats, half: int) -> NDArray[np.int64]:
    """Nearest of the nodes (n, 2) on whole numbers to points (2, m) no further than two steps from one."""
    number = np.full((2 * half + 1, 2 * half + 1), -1)
    number[where[:, 0] + half, where[:, 1] + half] = np.arange(len(where))
    base = np.rint(points).astype(np.int64)
    best, nearest = np.full(points.shape[1], np.inf), np.zeros(points.shape[1], dtype=np.int64)
    around = sorted(((i, j) for i in range(-2, 3) for j in range(-2, 3)), key=lambda ij: ij[0] ** 2 + ij[1] ** 2)
    left = np.arange(points.shape[1])
    for i, j in around:
        node = number[base[0, left] + i + half, base[1, left] + j + half]
        distance = (base[0, left] + i - points[0, left]) ** 2 + (base[1, left] + j - points[1, left]) ** 2
        better = (node >= 0) & (distance < best[left])
        best[left[better]], nearest[left[better]] = distance[better], node[better]
        if (i, j) == (0, 0):
            left = left[node < 0]  # nothing is nearer than the node a point rounds to
    return nearest


@cache
def sky_nodes(across: int, group: tuple[Symmetry, ...]) -> SkyNodes:
    """The same as `SkyNodes`, made once."""
    return SkyNodes(across, group)
