"""From traced light to a BSDF: send rays at something, count where they go.

Works for anything that is a `Tracer`: the prismatic sheet, a whole skylight, or another BSDF. No energy is lost or
made: each incident patch gets exactly the weight its rays came out with.
"""

import numpy as np
from numpy.random import Generator

from analysis.bsdf.basis import KLEMS_FULL, AngleBasis
from analysis.bsdf.klems import KlemsBsdf
from analysis.bsdf.model import Component, Floats, Incidence, Material, Tracer, component_of, travel_sign, with_z

BATCH = 200_000
"""Rays in memory at a time."""


def klems_of(
    tracer: Tracer,
    rng: Generator,
    *,
    basis: AngleBasis = KLEMS_FULL,
    rays: int = 10_000,
    samples: int = 1,
    incidences: tuple[Incidence, ...] = ("front", "back"),
    material: Material | None = None,
) -> KlemsBsdf:
    """Trace a Klems matrix.

    Parameters
    ----------
    tracer
        What scatters.
    rng
        Source of random numbers.
    basis
        Patches.
    rays
        Rays per incident patch, spread evenly over it in projected solid angle. The relative standard error of a matrix
        element that holds a part p of the light is sqrt((1 - p) / (p * rays)).
    samples
        Rays of the same direction; more than one saves time with tracers that look every direction up first.
    incidences
        Sides to send light at.

    Returns
    -------
    KlemsBsdf
        With transmission and reflection for each side.
    """
    matrices: dict[Component, Floats] = {}
    for incidence in incidences:
        through, back = _trace_side(tracer, incidence, basis, rays, samples, rng)
        matrices[component_of(incidence, True)] = through
        matrices[component_of(incidence, False)] = back
    return KlemsBsdf(basis, matrices, material or Material())


def _trace_side(
    tracer: Tracer, incidence: Incidence, basis: AngleBasis, rays: int, samples: int, rng: Generator
) -> tuple[Floats, Floats]:
    """Transmission and reflection matrices (n, n) for light that arrives at one side."""
    n = basis.size
    sums = np.zeros((2, n, n))
    sign = travel_sign(incidence)
    bundles = max(1, rays // samples)
    rays = bundles * samples
    per_batch = max(1, BATCH // rays)
    side = max(1, int(np.sqrt(bundles)))
    for start in range(0, n, per_batch):
        patches = np.arange(start, min(n, start + per_batch))
        # one ray per direction on a jittered grid of side x side over the patch, the rest at random
        u, v = jittered(len(patches), bundles, side, rng)
        travel = with_z(basis.sample(patches[:, None], u, v), sign).reshape(-1, 3)
        out, weights = tracer(incidence, travel, samples, rng)
        out, weights = out.reshape(-1, 3), weights.reshape(-1)
        went_back = (out[:, 2] * sign < 0).astype(np.intp)
        outgoing = basis.patch_of(out[:, :2])
        incoming = np.repeat(patches, rays)
        flat = (went_back * n + outgoing) * n + incoming
        sums += np.bincount(flat, weights=weights, minlength=2 * n * n).reshape(2, n, n)
    density = sums / (rays * basis.projected[:, None])
    return density[0], density[1]


def jittered(count: int, rays: int, side: int, rng: Generator) -> tuple[Floats, Floats]:
    """Two arrays (count, rays) in [0, 1): a jittered side x side grid, filled up with random points."""
    u, v = rng.random((2, count, rays))
    k = np.arange(side * side)
    u[:, : side * side] = (k // side + u[:, : side * side]) / side
    v[:, : side * side] = (k % side + v[:, : side * side]) / side
    return u, v
