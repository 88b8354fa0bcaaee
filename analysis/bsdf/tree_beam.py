"""Tensor trees for the light of a few beams, such as the sun on the panes of a cover: all else in them is zero.

A tree divides its four dimensions together: cells of outgoing directions can be fine for one incident direction alone,
but a whole tree of such cells is beyond any memory.
"""

import math

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from analysis.bsdf.disk import square_of_disk
from analysis.bsdf.model import Component, Floats, Incidence, Tracer, component_of, travel_sign
from analysis.bsdf.tally import BATCH
from analysis.bsdf.tree import Tree, TreeBuilder

FINE = 0.1
"""Part of the directions in which a tree keeps its finest cells: the images of a prismatic sheet's facets.

Radiance makes a table for each cell of rays' directions and looks for it in a list: all cells fine, it takes twice as
long. It passes over directions whose cell is less than an eighth of the ray's own; of half the width it is a quarter.
"""


def beam_trees(
    tracer: Tracer,
    incidence: Incidence,
    travel: Floats,
    half_angle_deg: float,
    rng: Generator,
    *,
    depth: int,
    rays: int,
) -> dict[Component, Tree]:
    """Transmission of some beams, and of the same paths walked backwards.

    Parameters
    ----------
    tracer
        What they meet.
    incidence
        The side they arrive at.
    travel : shape (k, 3)
        Unit vectors of travel of their middles.
    half_angle_deg
        A beam is the light of an even disc of this half angle.
    depth
        The finest cells have edges of 2**-depth of the square. Where a beam's light varies little from one outgoing
        cell to the next, cells are twice as wide; see `with_beam`.
    rays
        To trace for each beam.

    Returns
    -------
    dict
        Two trees [1/sr] of rank 4. The finest cell that holds the middle of a beam has the values of that beam,
        whatever else lies in it.
    """
    there = component_of(incidence, True)
    nothing = Tree(4, np.zeros((0, 16), dtype=np.int64), np.zeros(1), -1)
    trees = {there: nothing, there.reciprocal: nothing}
    for middle in travel:
        values = beam_values(tracer, incidence, middle, half_angle_deg, rng, depth, rays)
        cell = _cell(middle[None, :2], depth)[0]
        trees[there] = with_beam(trees[there], cell, values)
        # walked backwards, directions lie mirrored through the square's centre
        opposite = (1 << depth) - 1 - cell
        trees[there.reciprocal] = with_beam(trees[there.reciprocal], opposite, values[::-1, ::-1], outgoing=True)
    return trees


def beam_values(
    tracer: Tracer, incidence: Incidence, middle: Floats, half_angle_deg: float, rng: Generator, depth: int, rays: int
) -> Floats:
    """Transmission [1/sr] of one beam to all outgoing cells, shape (2**depth, 2**depth)."""
    n, sums = 1 << depth, np.zeros(1 << 2 * depth)
    for start in range(0, rays, BATCH):
        travel = _disc(middle, half_angle_deg, min(BATCH, rays - start), rng)
        out, weights = tracer(incidence, travel, 1, rng)
        through = out[:, 0, 2] * travel_sign(incidence) > 0.0
        where = _cell(out[through, 0, :2], depth)
        sums += np.bincount(where[:, 0] * n + where[:, 1], weights=weights[through, 0], minlength=n * n)
    density: Floats = (sums / (rays * np.pi / n**2)).reshape(n, n)
    return density


def with_beam(tree: Tree, cell: NDArray[np.intp], values: Floats, *, outgoing: bool = False) -> Tree:
    """A tree of rank 4 with new values where one side's direction lies in one finest cell, or in a cell about it.

    Parameters
    ----------
    cell : shape (2,)
        Place of this cell of incident directions, or of ``outgoing`` ones.
    values : shape (2**depth, 2**depth)
        For all cells of the other side. Of blocks of 2 x 2, `FINE` of all, those that vary most, stay apart; the others
        get their mean, in the cell of twice the width.
    """
    builder, depth = TreeBuilder(4), len(values).bit_length() - 1
    blocks = values.reshape(len(values) // 2, 2, len(values) // 2, 2)
    mean, span = blocks.mean(axis=(1, 3)), np.ptp(blocks, axis=(1, 3))
    apart = span > np.quantile(span, 1.0 - FINE)
    here, there = (2, 0) if outgoing else (0, 2)  # dimensions, which are bits of a branch's number
    wanted = [int(cell[0]) >> k & 1 | (int(cell[1]) >> k & 1) << 1 for k in range(depth)]

    def copied(node: int) -> int:
        if node < 0:
            return builder.leaf(float(tree.leaves[-node - 1]))
        return builder.branch([copied(child) for child in tree.branches[node].tolist()])

    def visited(node: int, below: int, i: int, j: int) -> int:
        if below == 0:
            return builder.leaf(float(values[i, j]))
        if below == 1 and not apart[i, j]:
            return builder.leaf(float(mean[i, j]))
        children = []
        for number, child in enumerate(tree.branches[node].tolist() if node >= 0 else [node] * 16):
            if number >> here & 3 == wanted[below - 1]:
                a, b = number >> there & 1, number >> there + 1 & 1
                children.append(visited(child, below - 1, 2 * i + a, 2 * j + b))
            else:
                children.append(copied(child))
        return builder.branch(children)

    return builder.tree(visited(tree.root, depth, 0, 0))


def _disc(middle: Floats, half_angle_deg: float, count: int, rng: Generator) -> Floats:
    """Directions (count, 3) spread evenly over a disc; ones beyond the horizon of the middle's side are taken back."""
    z = middle / np.linalg.norm(middle)
    x = np.cross(z, [1.0, 0.0, 0.0] if abs(z[0]) < 0.7 else [0.0, 1.0, 0.0])
    x /= np.linalg.norm(x)
    cosine = 1.0 - rng.random(count) * (1.0 - math.cos(math.radians(half_angle_deg)))
    turn, sine = 2.0 * np.pi * rng.random(count), np.sqrt(1.0 - cosine**2)
    found = (sine * np.cos(turn))[:, None] * x + (sine * np.sin(turn))[:, None] * np.cross(z, x) + cosine[:, None] * z
    beyond = found[:, 2] * z[2] <= 0.0
    found[beyond] = z
    return np.asarray(found, dtype=np.float64)


def _cell(xy: Floats, depth: int) -> NDArray[np.intp]:
    """Places (n, 2) of the cells that hold directions (n, 2)."""
    n = 1 << depth
    return np.minimum((square_of_disk(xy) * n).astype(np.intp), n - 1)
