"""From any description of scattering to Klems matrices and tensor trees, without noise and with energy conserved.

The BSDF is averaged over each pair of patches or cells on even grids of incident and outgoing directions; then each
incident column is scaled to the hemispherical value the source states for these directions. What is sharper than the
grid is refused rather than scaled up; trace it instead (`tally.klems_of`, `tree_tally.tensor_tree_of`).
"""

import numpy as np

from analysis.bsdf.basis import KLEMS_FULL, AngleBasis
from analysis.bsdf.disk import disk_of_square
from analysis.bsdf.gridded import outgoing_grid
from analysis.bsdf.klems import KlemsBsdf
from analysis.bsdf.model import Bsdf, Component, Floats, Material
from analysis.bsdf.tensor_tree import TensorTreeBsdf
from analysis.bsdf.tree import Tree, tree_of
from labdaq.errors import DataError

_OFF = 0.15
"""Largest relative difference between the grid's sum and the stated hemispherical value."""


def to_klems(
    bsdf: Bsdf,
    basis: AngleBasis = KLEMS_FULL,
    *,
    incident: int = 3,
    outgoing: int = 192,
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
        Outgoing directions per axis of the square; at least a few per patch.

    Raises
    ------
    DataError
        The BSDF is sharper than the outgoing grid.
    """
    out_xy = outgoing_grid(outgoing)
    patch = basis.patch_of(out_xy)
    count = np.bincount(patch, minlength=basis.size)
    if count.min() == 0:
        raise DataError(f"{outgoing} x {outgoing} outgoing directions leave patches of {basis.name} empty; take more")
    axis = (np.arange(incident) + 0.5) / incident
    u, v = (x.ravel() for x in np.meshgrid(axis, axis, indexing="ij"))
    matrices = {}
    for component in bsdf.components():
        matrix = np.zeros((basis.size, basis.size))
        for i in range(basis.size):
            in_xy = basis.sample(np.full(u.size, i), u, v)
            values = bsdf.evaluate(component, in_xy[:, None], out_xy).mean(axis=0)
            # the mean over a patch, not the sum: the grid gives patches a few directions more or less than their share
            flux = np.bincount(patch, weights=values, minlength=basis.size) / count * basis.projected
            wanted = float(bsdf.hemispherical(component, in_xy).mean())
            matrix[:, i] = _scaled(flux, wanted, f"{component}, patch {i}") / basis.projected
        matrices[component] = matrix
    return KlemsBsdf(basis, matrices, material or _material_of(bsdf))


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
    DataError
        The BSDF is sharper than the grid.
    """
    n = 1 << depth
    fine = outgoing * n
    axis = (np.arange(fine) + 0.5) / fine
    out_xy = disk_of_square(np.stack(np.meshgrid(axis, axis, indexing="ij"), axis=-1)).reshape(-1, 2)
    trees: dict[Component, Tree] = {}
    for component in bsdf.components():
        columns = []
        for in_xy in _incident_cells(rank, n, incident):
            values = bsdf.evaluate(component, in_xy[:, None], out_xy).mean(axis=0)
            flux = values.reshape(n, outgoing, n, outgoing).mean(axis=(1, 3)) * np.pi / n**2
            wanted = float(bsdf.hemispherical(component, in_xy).mean())
            columns.append(_scaled(flux, wanted, f"{component}, incident {in_xy[0]}") * n**2 / np.pi)
        dense = np.array(columns)
        if rank == 3:
            dense = np.concatenate([dense, np.zeros_like(dense)])  # the upper half of sines is not used
        trees[component] = tree_of(dense.reshape((n,) * rank), cull_percent)
    return TensorTreeBsdf(trees, material or _material_of(bsdf))


def _incident_cells(rank: int, n: int, samples: int) -> list[Floats]:
    """Incident directions (k, 2) of each incident cell, in the order of the grid."""
    sub = (np.arange(samples) + 0.5) / samples
    if rank == 3:
        cells = []
        for k in range(n // 2):
            sine = 1.0 - 2.0 * (k + sub) / n
            cells.append(np.stack([sine, np.zeros(samples)], axis=-1))
        return cells
    u, v = (x.ravel() for x in np.meshgrid(sub, sub, indexing="ij"))
    return [disk_of_square(np.stack([(i + u) / n, (j + v) / n], axis=-1)) for i in range(n) for j in range(n)]


def _scaled(flux: Floats, wanted: float, where: str) -> Floats:
    """Fluxes scaled to the wanted sum; refuses when the grid has missed the shape."""
    total = float(flux.sum())
    if wanted == 0.0 or (total == 0.0 and wanted < 1e-6):
        return np.zeros_like(flux)
    if abs(total - wanted) > _OFF * wanted:
        raise DataError(
            f"{where}: the grid sums to {total:.4g} where {wanted:.4g} of the light goes on; its peaks are too sharp",
            "take more directions, or trace it (klems_of, tensor_tree_of)",
        )
    return flux * (wanted / total)


def _material_of(bsdf: Bsdf) -> Material:
    material = getattr(bsdf, "material", None)
    return material if isinstance(material, Material) else Material()
