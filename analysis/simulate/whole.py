"""The BSDF of a whole skylight, from its opening in the roof to its aperture, as Klems matrix or tensor tree.

Light is sent at the cover from each patch of incident directions, all of a patch equally bright, and the lumens that
leave the aperture are counted by direction. Transmission from below follows by reciprocity: reversible paths carry
the same share either way (Helmholtz). Reflection is left out.

Both openings have the aperture's area, and incident light is counted by what falls on the open hole of that area. A
cover that rises above the roof catches more than that at low suns: transmittances near grazing may exceed 1.
"""

from collections.abc import Callable
from typing import Final

import numpy as np
from numpy.typing import NDArray

from analysis.bsdf.basis import KLEMS_FULL, AngleBasis
from analysis.bsdf.disk import square_of_disk
from analysis.bsdf.klems import KlemsBsdf
from analysis.bsdf.model import Component, Material
from analysis.bsdf.tensor_tree import TensorTreeBsdf
from analysis.bsdf.tree import tree_of
from analysis.simulate.source import cell_directions, patches
from analysis.simulate.system import System
from analysis.simulate.tracer import Settings, trace

Floats = NDArray[np.float64]
Whole = NDArray[np.int64]
PatchOf = Callable[[Floats], NDArray[np.intp]]

_SKY_SIDE: Final = 192
_OUT_SIDE: Final = 128
_GROUP: Final = 64
"""Patches traced together: their tallies are held at once."""


def klems_of_system(
    system: System, basis: AngleBasis = KLEMS_FULL, *, rays: int = 20_000, seed: int = 1, threads: int = 0
) -> KlemsBsdf:
    """The skylight as a matrix over a Klems basis, ``rays`` for each patch; see `passed` for the frame."""
    through = passed(system, basis.patch_of, basis.size, rays, seed, threads) / basis.projected[:, None]
    turned = basis.opposite
    matrices = {Component.TF: through, Component.TB: through[np.ix_(turned, turned)].T.copy()}
    return KlemsBsdf(basis, matrices, _material(system))


def tree_of_system(
    system: System, depth: int = 4, *, rays: int = 20_000, seed: int = 1, threads: int = 0, cull_percent: float = 90.0
) -> TensorTreeBsdf:
    """The skylight as a tensor tree of rank 4 whose finest cells are 2**-depth of the square, incident and outgoing."""
    n = 1 << depth

    def cell_of(xy: Floats) -> NDArray[np.intp]:
        where = np.minimum((square_of_disk(xy) * n).astype(np.intp), n - 1)
        found: NDArray[np.intp] = where[..., 0] * n + where[..., 1]
        return found

    through = passed(system, cell_of, n * n, rays, seed, threads) / (np.pi / n**2)
    dense = through.T.reshape(n, n, n, n)
    back = dense[::-1, ::-1, ::-1, ::-1].transpose(2, 3, 0, 1)
    trees = {Component.TF: tree_of(dense, cull_percent), Component.TB: tree_of(back, cull_percent)}
    return TensorTreeBsdf(trees, _material(system))


def passed(system: System, patch_of: PatchOf, count: int, rays: int, seed: int = 1, threads: int = 0) -> Floats:
    """Share of each incident patch's light that leaves in each patch, shape (outgoing, incident).

    ``patch_of`` tells the patch of directions of travel (..., 2) in the BSDF's frame: x east, y south, z down, so that
    the front is outside.
    """
    x, y, z = (a[:, 0] for a in cell_directions(_SKY_SIDE, 1))
    group = patch_of(np.stack([-x, y], axis=-1)).astype(np.int64)  # light from the east travels west
    falls = np.bincount(group, weights=z, minlength=count) * 2.0 * np.pi / _SKY_SIDE**2
    found = np.zeros((count, count))
    for first in range(0, count, _GROUP):
        size = min(_GROUP, count - first)
        member = np.where((group >= first) & (group < first + size), group - first, -1)
        settings = Settings(rays=rays * size, seed=seed + first, bounces=1, sharp_side=_OUT_SIDE, threads=threads)
        for lumens in trace(system, patches(_SKY_SIDE, member, size), settings).collapsed():
            by_cell = lumens[:, 0].mean(axis=0)
            if by_cell.any():
                found[:, first : first + size] += _shared(patch_of, count, round(len(by_cell) ** 0.5), by_cell)
    return found / (falls * system.aperture_area_m2)


def _shared(patch_of: PatchOf, count: int, side: int, by_cell: Floats) -> Floats:
    """Lumens by patch (count, T) of lumens by cell of travel (cells, T), each cell shared out evenly over its area."""
    x, y, _ = cell_directions(side, 4)
    patch = patch_of(np.stack([x, -y], axis=-1))
    total = np.zeros((count, by_cell.shape[1]))
    for k in range(patch.shape[1]):
        np.add.at(total, patch[:, k], by_cell / patch.shape[1])
    return total


def _material(system: System) -> Material:
    return Material(name=f"skylight {system.name}", manufacturer="labdaq", thickness_m=system.well_depth_m)
