"""A tensor tree: values on the unit hypercube, fine where they vary and coarse where they do not.

The order of things is that of Radiance's ``bsdf_t.c``: branch n of a node lies in the upper half of dimension i when
bit i of n is set; a grid of leaves is written with its last dimension running fastest.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from analysis.bsdf.compiled import compiled

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


@dataclass(frozen=True)
class Tree:
    """Nodes in arrays.

    Attributes
    ----------
    rank
        Number of dimensions, 3 or 4.
    branches : shape (b, 2**rank)
        Children of each branching node: k >= 0 is branching node k, k < 0 is leaf -k - 1.
    leaves : shape (n,)
        Values.
    root
        The top node, coded like a child.
    """

    rank: int
    branches: Ints
    leaves: Floats
    root: int

    def values(self, points: Floats) -> Floats:
        """Value at points (..., rank) within [0, 1)."""
        shape = points.shape[:-1]
        place = np.clip(points.reshape(-1, self.rank), 0.0, np.nextafter(1.0, 0.0)).copy()
        node = np.full(len(place), self.root, dtype=np.int64)
        powers = 1 << np.arange(self.rank)
        while (rows := np.flatnonzero(node >= 0)).size:
            part = 2.0 * place[rows]
            upper = part >= 1.0
            place[rows] = part - upper
            node[rows] = self.branches[node[rows], upper @ powers]
        return self.leaves[-node - 1].reshape(shape)

    def slice(self, fixed: Floats) -> tuple[Floats, Floats, Floats]:
        """Leaves under a point in the first dimensions.

        Parameters
        ----------
        fixed : shape (k,)
            Coordinates in the first k dimensions.

        Returns
        -------
        corner : shape (n, rank - k), size : shape (n,), value : shape (n,)
            Lower corners and edge lengths of the squares that the leaves cut out of the other dimensions; they
            cover the unit square.
        """
        place = np.clip(np.asarray(fixed, dtype=np.float64), 0.0, np.nextafter(1.0, 0.0))
        found = _leaves_under(self.branches, self.leaves, self.root, self.rank, place)
        return found[:, 2:], found[:, 0], found[:, 1]

    def values_under(self, fixed: Floats, points: Floats) -> Floats:
        """Values (n,) at points (n, 2) of the last two dimensions, under one point of the others: as `values`, faster
        for many points."""
        corner, size, value = self.slice(fixed)
        found = np.zeros(len(points))
        for step in np.unique(size):
            n, rows = round(1.0 / step), size == step
            grid = np.zeros((n, n))
            where = np.rint(corner[rows] * n).astype(np.intp)
            grid[where[:, 0], where[:, 1]] = value[rows]
            at = np.minimum((points * n).astype(np.intp), n - 1)
            found += grid[at[:, 0], at[:, 1]]  # 0 where leaves of another size lie
        return found

    @cached_property
    def depth(self) -> int:
        """Levels below the root; the finest leaves have edges of 2**-depth."""
        level, nodes = 0, np.array([self.root], dtype=np.int64)
        while (nodes := nodes[nodes >= 0]).size:
            nodes, level = self.branches[nodes].ravel(), level + 1
        return level

    def dense(self, depth: int | None = None) -> Floats:
        """All values on a grid of 2**depth per dimension (the tree's own depth by default); coarser grids sample."""
        n = 1 << (self.depth if depth is None else depth)
        axis = (np.arange(n) + 0.5) / n
        grid = np.stack(np.meshgrid(*[axis] * self.rank, indexing="ij"), axis=-1)
        return self.values(grid)

    def walk(self) -> Iterator[tuple[int, int]]:
        """Pairs of (level, node) from the root down, children in order."""
        stack = [(0, self.root)]
        while stack:
            level, node = stack.pop()
            yield level, node
            if node >= 0:
                stack += [(level + 1, int(child)) for child in self.branches[node][::-1]]


class TreeBuilder:
    """Collects nodes from the leaves up; each method returns the new node, coded like a child of a `Tree`."""

    def __init__(self, rank: int) -> None:
        self.rank = rank
        self._branches: list[list[int]] = []
        self._leaves: list[float] = []

    def leaf(self, value: float) -> int:
        """A leaf."""
        self._leaves.append(value)
        return -len(self._leaves)

    def branch(self, children: list[int]) -> int:
        """A node above these."""
        self._branches.append(children)
        return len(self._branches) - 1

    def grid(self, values: Floats) -> int:
        """Nodes for a grid of leaves of 2**k cells in each dimension."""
        n = values.shape[0]
        if n == 1:
            return self.leaf(float(values.ravel()[0]))
        half = n // 2
        children = []
        for number in range(1 << self.rank):
            part = tuple(slice(half * (number >> i & 1), half * (number >> i & 1) + half) for i in range(self.rank))
            children.append(self.grid(values[part]))
        return self.branch(children)

    def tree(self, root: int) -> Tree:
        """The tree below one of the nodes, which also keeps what is not below it."""
        branches = np.array(self._branches, dtype=np.int64).reshape(-1, 1 << self.rank)
        return Tree(self.rank, branches, np.array(self._leaves), root)


@compiled
def _leaves_under(branches: Ints, leaves: Floats, root: int, rank: int, place: Floats) -> Floats:
    """Rows of (edge length, value, lower corner ..), depth first; see `Tree.slice`."""
    fixed, free = len(place), rank - len(place)
    found, count = np.empty((256, 2 + free)), 0
    todo = [(root, 1.0, np.zeros(free))]
    while todo:
        node, size, corner = todo.pop()
        if node < 0:
            if count == len(found):
                found = np.concatenate((found, np.empty_like(found)))
            found[count, 0], found[count, 1], found[count, 2:] = size, leaves[-node - 1], corner
            count += 1
            continue
        half, under = 0.5 * size, 0
        for i in range(fixed):
            under |= (int(place[i] / half) & 1) << i
        for part in range(1 << free):
            below = corner.copy()
            for j in range(free):
                below[j] += half * ((part >> j) & 1)
            todo.append((branches[node, under | part << fixed], half, below))
    return found[:count]


def variance_measure(low: Floats, high: Floats, mean: Floats) -> Floats:
    """How much a block varies: sqrt((max - min) / (sqrt(mean) + 0.03)), as Radiance's ``rttree_reduce`` weighs it."""
    measure: Floats = np.sqrt((high - low) / (np.sqrt(mean) + 0.03))
    return measure


def tree_of(dense: Floats, cull_percent: float = 90.0) -> Tree:
    """Make a tree of a full grid.

    Parameters
    ----------
    dense : shape (2**d,) * rank
        Values, not negative.
    cull_percent
        Part of the finest blocks that is merged into one value; the threshold found so holds for the coarser blocks
        as well. 0 keeps everything that varies at all. Merging takes means, so sums over the grid are kept.
    """
    rank, n = dense.ndim, dense.shape[0]
    depth = n.bit_length() - 1
    if dense.shape != (n,) * rank or n != 1 << depth:
        raise ValueError(f"a tree needs a grid with a power of two of cells in every dimension, not {dense.shape}")
    mean, low, high = [dense.astype(np.float64)], [dense], [dense]
    for _ in range(depth):
        mean.append(_blocks(mean[-1]).mean(axis=0))
        low.append(_blocks(low[-1]).min(axis=0))
        high.append(_blocks(high[-1]).max(axis=0))
    varies = [np.zeros(0)] + [variance_measure(low[k], high[k], mean[k]) for k in range(1, depth + 1)]
    threshold = float(np.quantile(varies[1], cull_percent / 100.0)) if depth and cull_percent > 0 else 0.0
    branches: list[Ints] = []
    leaves: list[float] = []
    cells = np.zeros((1, rank), dtype=np.int64)
    width = 1 << rank
    offsets = (np.arange(width)[:, None] >> np.arange(rank)) & 1
    splits = depth > 0 and bool(varies[depth][(0,) * rank] > threshold)
    if not splits:
        return Tree(rank, np.zeros((0, width), dtype=np.int64), np.array([mean[depth][(0,) * rank]]), -1)
    first_free = 1
    for level in range(depth, 0, -1):
        kids = (2 * cells[:, None, :] + offsets).reshape(-1, rank)
        where = tuple(kids.T)
        deeper = varies[level - 1][where] > threshold if level > 1 else np.zeros(len(kids), dtype=bool)
        code = np.empty(len(kids), dtype=np.int64)
        code[deeper] = first_free + np.arange(int(deeper.sum()))
        code[~deeper] = -(len(leaves) + np.arange(int((~deeper).sum()))) - 1
        first_free += int(deeper.sum())
        leaves.extend(mean[level - 1][where][~deeper].tolist())
        branches.append(code.reshape(-1, width))
        cells = kids[deeper]
        if not cells.size:
            break
    return Tree(rank, np.concatenate(branches), np.array(leaves), 0)


def _blocks(grid: Floats) -> Floats:
    """Children of the next coarser grid along a new first axis: shape (2**rank, n/2, ..)."""
    rank, half = grid.ndim, grid.shape[0] // 2
    split = grid.reshape([x for _ in range(rank) for x in (half, 2)])
    order = [2 * i + 1 for i in range(rank)] + [2 * i for i in range(rank)]
    return split.transpose(order).reshape((1 << rank,) + (half,) * rank)
