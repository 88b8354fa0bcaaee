"""Trace tensor trees: send rays at something from every incident cell, count the outgoing cells, merge."""

import numpy as np
from numpy.random import Generator

from analysis.bsdf.disk import disk_of_square, square_of_disk
from analysis.bsdf.model import Component, Floats, Incidence, Material, Tracer, component_of, travel_sign, with_z
from analysis.bsdf.tally import BATCH, jittered
from analysis.bsdf.tensor_tree import TensorTreeBsdf, turn
from analysis.bsdf.tree import Tree, tree_of


def trace_dense(
    tracer: Tracer, incidence: Incidence, rank: int, depth: int, rays: int, rng: Generator, samples: int = 1
) -> tuple[Floats, Floats]:
    """Full grids (2**depth,) * rank of transmission and reflection [1/sr] for light that arrives at one side.

    ``rays`` are sent for each incident cell, spread evenly over it in bundles of ``samples``. For rank 3 the incident
    azimuth is drawn at random and taken off the outgoing direction: the isotropic mean.
    """
    n = 1 << depth
    sign = travel_sign(incidence)
    sums = np.zeros((2, n ** (rank - 2), n * n))
    cells = np.arange(n * n if rank == 4 else n // 2)
    bundles = max(1, rays // samples)
    side = max(1, int(np.sqrt(bundles)))
    per_batch = max(1, BATCH // (bundles * samples))
    for start in range(0, len(cells), per_batch):
        part = cells[start : start + per_batch]
        u, v = jittered(len(part), bundles, side, rng)
        if rank == 4:
            square = np.stack([part[:, None] // n + u, part[:, None] % n + v], axis=-1) / n
            xy = disk_of_square(square).reshape(-1, 2)
            spin = np.zeros(len(xy))
        else:
            sine = 1.0 - 2.0 * (part[:, None] + u) / n
            spin = (2.0 * np.pi * v).ravel()
            xy = np.stack([sine.ravel() * np.cos(spin), sine.ravel() * np.sin(spin)], axis=-1)
        out, weights = tracer(incidence, with_z(xy, sign), samples, rng)
        out, weights = out.reshape(-1, 3), weights.reshape(-1)
        spin = np.repeat(spin, samples)
        where = np.minimum((square_of_disk(turn(out[:, :2], -spin)) * n).astype(np.intp), n - 1)
        flat = (
            ((out[:, 2] * sign < 0) * sums.shape[1] + np.repeat(part, bundles * samples)) * n * n
            + where[:, 0] * n
            + where[:, 1]
        )
        sums += np.bincount(flat, weights=weights, minlength=sums.size).reshape(sums.shape)
    density = sums / (bundles * samples * np.pi / n**2)
    shape = (n,) * rank
    return density[0].reshape(shape), density[1].reshape(shape)


def tensor_tree_of(
    tracer: Tracer,
    rng: Generator,
    *,
    rank: int = 4,
    depth: int = 5,
    rays: int = 4000,
    samples: int = 1,
    cull_percent: float = 90.0,
    incidences: tuple[Incidence, ...] = ("front", "back"),
    material: Material | None = None,
) -> TensorTreeBsdf:
    """Trace a tensor tree.

    Parameters
    ----------
    tracer
        What scatters.
    rank
        3 or 4.
    depth
        Finest cells are 2**-depth of the square; 5 and 6 are usual. Depth 6 of rank 4 takes 0.3 GB while it is made.
    rays, samples
        Rays for each incident cell, in bundles of ``samples`` of the same direction.
    cull_percent
        See `analysis.bsdf.tree.tree_of`.
    incidences
        Sides to send light at.

    Notes
    -----
    Reflections are made reciprocal (the mean of each path and its reverse), because Radiance looks them up either way
    round; so does Radiance's own genBSDF. Merging keeps the light of the merged cells together, not of each direction.
    """
    trees: dict[Component, Tree] = {}
    for incidence in incidences:
        through, back = trace_dense(tracer, incidence, rank, depth, rays, rng, samples)
        trees[component_of(incidence, True)] = tree_of(through, cull_percent)
        trees[component_of(incidence, False)] = tree_of(reciprocal_mean(back), cull_percent)
    return TensorTreeBsdf(trees, material or Material())


def reciprocal_mean(dense: Floats) -> Floats:
    """Mean of a reflection's full grid and the same with paths walked backwards.

    A direction walked backwards lies opposite on the disc, which is the point mirrored through the square's centre.
    In rank 3 the reverse of a path leaves the grid of incident sines; there only left and right are exchanged.
    """
    if dense.ndim == 3:
        return 0.5 * (dense + dense[:, :, ::-1])
    flipped = dense[::-1, ::-1, ::-1, ::-1]
    return 0.5 * (dense + flipped.transpose(2, 3, 0, 1))
