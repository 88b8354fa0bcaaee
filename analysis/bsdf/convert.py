"""From any description of scattering to Klems matrices and tensor trees, without noise and with energy conserved.

The BSDF is averaged over each pair of patches or cells on even grids of directions within both; then each
incident column is scaled to the hemispherical value the source states for these directions. What is sharper than the
grid is refused rather than scaled up; trace it instead (`tally.klems_of`, `tree_tally.tensor_tree_of`).
"""

import math
from collections.abc import Callable
from functools import cached_property

import numpy as np

from analysis.bsdf.basis import KLEMS_FULL, AngleBasis
from analysis.bsdf.disk import disk_of_square, square_of_disk
from analysis.bsdf.klems import KlemsBsdf
from analysis.bsdf.model import Bsdf, Component, Floats, Material
from analysis.bsdf.tensor_tree import TensorTreeBsdf
from analysis.bsdf.tree import Tree, tree_of
from labdaq.errors import DataError


class TooSharp(DataError):
    """The BSDF has peaks that fall between the directions of a grid.

    Example scenarios: an ABg lobe with a small B, or with a specular part.
    """


_FINE = 24
"""Directions per incident patch or cell and axis for hemispherical values of matrices and trees."""

_OFF = 0.15
"""Largest relative difference between the grid's sum and the stated hemispherical value."""


def to_klems(
    bsdf: Bsdf,
    basis: AngleBasis = KLEMS_FULL,
    *,
    incident: int = 3,
    outgoing: int | None = None,
    material: Material | None = None,
) -> KlemsBsdf:
    """Average a BSDF over the patches of a basis.

    Parameters
    ----------
    bsdf
        Anything that evaluates.
    incident
        Directions per incident patch and axis.
    outgoing
        Directions per outgoing patch and axis; without a number some 37,000 altogether, at least 9 in each patch, and
        three times as many per axis where peaks are too sharp for that.

    Raises
    ------
    TooSharp
        The BSDF is sharper than the outgoing grid.
    """
    usual = max(3, round(192 / math.sqrt(basis.size)))
    grids = [_Grid(bsdf, basis, each) for each in ([outgoing] if outgoing else [usual, 3 * usual])]
    u, v = _places(incident)
    fine = _places(_FINE)
    matrices = {}
    for component in bsdf.components():
        stairs, matrix = _stairs(bsdf, component), np.zeros((basis.size, basis.size))
        for i in range(basis.size):
            in_xy = basis.sample(np.full(u.size, i), u, v)
            wanted = float(bsdf.hemispherical(component, in_xy).mean())
            for grid in grids:
                try:
                    flux = _scaled(grid.flux(component, in_xy), wanted, f"{component}, patch {i}")
                    break
                except TooSharp:
                    if grid is grids[-1]:
                        raise
            whole = stairs(basis.sample(np.full(fine[0].size, i), *fine)).mean() if stairs else wanted
            matrix[:, i] = flux / basis.projected * (whole / wanted if wanted > 0.0 else 0.0)
        matrices[component] = matrix
    return KlemsBsdf(basis, matrices, material or _material_of(bsdf))


class _Grid:
    """Each x each outgoing directions in every patch of a basis; set up when they are first asked for."""

    def __init__(self, bsdf: Bsdf, basis: AngleBasis, each: int) -> None:
        self.bsdf = bsdf
        self.basis = basis
        self.each = each

    @cached_property
    def _mean(self) -> Callable[[Component, Floats], Floats]:
        patch = np.repeat(np.arange(self.basis.size), self.each**2)
        u, v = (np.tile(x, self.basis.size) for x in _places(self.each))
        return _mean_over(self.bsdf, self.basis.sample(patch, u, v))

    def flux(self, component: Component, in_xy: Floats) -> Floats:
        """Part of the light of incident directions (k, 2) that goes to each patch."""
        means = self._mean(component, in_xy).reshape(self.basis.size, -1).mean(axis=1)
        part: Floats = means * self.basis.projected
        return part


def to_tensor_tree(
    bsdf: Bsdf,
    *,
    rank: int = 4,
    depth: int = 5,
    incident: int = 2,
    outgoing: int = 4,
    cull_percent: float = 90.0,
    material: Material | None = None,
) -> TensorTreeBsdf:
    """Average a BSDF over the cells of a tensor tree.

    Parameters
    ----------
    rank, depth, cull_percent
        See `tree_tally.tensor_tree_of`.
    incident, outgoing
        Directions per cell and axis. Rank 3 takes incident light along +x only: the BSDF must be isotropic.

    Raises
    ------
    TooSharp
        The BSDF is sharper than the grid.
    """
    n = 1 << depth
    axis = (np.arange(outgoing * n) + 0.5) / (outgoing * n)
    out_xy = disk_of_square(np.stack(np.meshgrid(axis, axis, indexing="ij"), axis=-1)).reshape(-1, 2)
    mean = _mean_over(bsdf, out_xy)
    trees: dict[Component, Tree] = {}
    for component in bsdf.components():
        stairs, columns = _stairs(bsdf, component), []
        for in_xy, fine_xy in zip(_incident_cells(rank, n, incident), _incident_cells(rank, n, _FINE), strict=True):
            values = mean(component, in_xy)
            flux = values.reshape(n, outgoing, n, outgoing).mean(axis=(1, 3)) * np.pi / n**2
            wanted = float(bsdf.hemispherical(component, in_xy).mean())
            whole = stairs(fine_xy).mean() if stairs else wanted
            scale = whole / wanted if wanted > 0.0 else 0.0
            columns.append(_scaled(flux, wanted, f"{component}, incident {in_xy[0]}") * scale * n**2 / np.pi)
        dense = np.array(columns)
        if rank == 3:
            dense = np.concatenate([dense, np.zeros_like(dense)])  # the upper half of sines is not used
        trees[component] = tree_of(dense.reshape((n,) * rank), cull_percent)
    return TensorTreeBsdf(trees, material or _material_of(bsdf))


def _stairs(bsdf: Bsdf, component: Component) -> Callable[[Floats], Floats] | None:
    """Hemispherical values of a matrix or tree at many directions (k, 2), quickly; None for other descriptions.

    Matrices and trees are stairs, and few directions do not find how much of a patch each step fills.
    """
    if isinstance(bsdf, TensorTreeBsdf) and bsdf.rank == 4 and component in bsdf.trees:
        n = 1 << bsdf.trees[component].depth
        axis = (np.arange(n) + 0.5) / n
        cells = disk_of_square(np.stack(np.meshgrid(axis, axis, indexing="ij"), axis=-1))
        table = bsdf.hemispherical(component, cells)

        def of_cell(in_xy: Floats) -> Floats:
            at = np.minimum((square_of_disk(in_xy) * n).astype(np.intp), n - 1)
            found: Floats = table[at[..., 0], at[..., 1]]
            return found

        return of_cell
    if isinstance(bsdf, KlemsBsdf | TensorTreeBsdf):
        return lambda in_xy: bsdf.hemispherical(component, in_xy)
    return None


def _places(n: int) -> tuple[Floats, Floats]:
    """Middles of n x n equal parts of the unit square, two arrays of shape (n * n,)."""
    axis = (np.arange(n) + 0.5) / n
    u, v = np.meshgrid(axis, axis, indexing="ij")
    return u.ravel(), v.ravel()


def _mean_over(bsdf: Bsdf, out_xy: Floats) -> Callable[[Component, Floats], Floats]:
    """A function of component and incident directions (k, 2): mean BSDF towards each of the outgoing directions."""
    if isinstance(bsdf, KlemsBsdf):  # the same patches again and again
        patch = bsdf.basis.patch_of(out_xy)
        klems = bsdf

        def of_patches(component: Component, in_xy: Floats) -> Floats:
            mean: Floats = klems.matrices[component][:, klems.basis.patch_of(in_xy)].mean(axis=1)
            return mean[patch]

        return of_patches

    if isinstance(bsdf, TensorTreeBsdf) and bsdf.rank == 4:
        points, trees = square_of_disk(out_xy), bsdf.trees

        def of_cells(component: Component, in_xy: Floats) -> Floats:
            mean: Floats = np.mean([trees[component].values_under(xy, points) for xy in square_of_disk(in_xy)], axis=0)
            return mean

        return of_cells

    def evaluated(component: Component, in_xy: Floats) -> Floats:
        mean: Floats = bsdf.evaluate(component, in_xy[:, None], out_xy).mean(axis=0)
        return mean

    return evaluated


def _incident_cells(rank: int, n: int, samples: int) -> list[Floats]:
    """Incident directions (k, 2) of each incident cell, in the order of the grid."""
    sub = (np.arange(samples) + 0.5) / samples
    if rank == 3:
        cells = []
        for k in range(n // 2):
            sine = 1.0 - 2.0 * (k + sub) / n
            cells.append(np.stack([sine, np.zeros(samples)], axis=-1))
        return cells
    u, v = _places(samples)
    return [disk_of_square(np.stack([(i + u) / n, (j + v) / n], axis=-1)) for i in range(n) for j in range(n)]


def _scaled(flux: Floats, wanted: float, where: str) -> Floats:
    """Fluxes scaled to the wanted sum; refuses when the grid has missed the shape."""
    total = float(flux.sum())
    if wanted == 0.0 or (total == 0.0 and wanted < 1e-6):
        return np.zeros_like(flux)
    if abs(total - wanted) > _OFF * wanted:
        raise TooSharp(
            f"{where}: the grid sums to {total:.4g} where {wanted:.4g} of the light goes on; its peaks are too sharp",
            "take more directions, or trace it (klems_of, tensor_tree_of)",
        )
    return flux * (wanted / total)


def _material_of(bsdf: Bsdf) -> Material:
    material = getattr(bsdf, "material", None)
    return material if isinstance(material, Material) else Material()
