"""BSDFs as matrices over the patches of a Klems basis."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.random import Generator

from analysis.bsdf.basis import AngleBasis, Ints
from analysis.bsdf.model import Component, Floats, Incidence, Material, component_of, travel_sign, with_z
from labdaq.errors import DataError


@dataclass(frozen=True)
class KlemsBsdf:
    """A BSDF that is constant between each pair of patches.

    Attributes
    ----------
    basis
        Patches of incident and outgoing light.
    matrices : component to array of shape (n, n)
        ``matrix[o, i]`` is the BSDF [1/sr] from patch i to patch o; patches hold directions of travel (see
        `analysis.bsdf.model`), so a clear pane has a diagonal matrix.
    material
        What the sample is.
    """

    basis: AngleBasis
    matrices: Mapping[Component, Floats]
    material: Material = field(default_factory=Material)

    def __post_init__(self) -> None:
        n = self.basis.size
        if not self.matrices:
            raise DataError("a BSDF needs at least one component")
        for component, matrix in self.matrices.items():
            if matrix.shape != (n, n):
                raise DataError(f"{component}: a matrix of shape {matrix.shape} on a basis of {n} patches")
            if not np.isfinite(matrix).all() or (matrix < 0).any():
                raise DataError(f"{component}: a value is negative or not finite")

    def components(self) -> tuple[Component, ...]:
        """The parts it describes."""
        return tuple(self.matrices)

    def evaluate(self, component: Component, incident_xy: Floats, outgoing_xy: Floats) -> Floats:
        """BSDF [1/sr] for directions of travel (..., 2), which broadcast; 0 for a part it does not describe."""
        incident, outgoing = np.broadcast_arrays(incident_xy, outgoing_xy)
        matrix = self.matrices.get(component)
        if matrix is None:
            return np.zeros(incident.shape[:-1])
        values: Floats = matrix[self.basis.patch_of(outgoing), self.basis.patch_of(incident)]
        return values

    def hemispherical_by_patch(self, component: Component) -> Floats:
        """Directional-hemispherical transmittance or reflectance of each incident patch, shape (n,)."""
        matrix = self.matrices.get(component)
        if matrix is None:
            return np.zeros(self.basis.size)
        sums: Floats = self.basis.projected @ matrix
        return sums

    def hemispherical(self, component: Component, incident_xy: Floats) -> Floats:
        """Part of the light from each direction (..., 2) that this component sends on."""
        return self.hemispherical_by_patch(component)[self.basis.patch_of(incident_xy)]

    def diffuse(self, component: Component) -> float:
        """Bi-hemispherical transmittance or reflectance: of evenly diffuse light."""
        return float(self.hemispherical_by_patch(component) @ self.basis.projected / np.pi)

    def __call__(
        self, incidence: Incidence, travel: Floats, per_direction: int, rng: Generator
    ) -> tuple[Floats, Floats]:
        """Scatter rays as a `Tracer`: directions (n, 3) to (n, m, 3) and weights (n, m)."""
        n, m = len(travel), per_direction
        patches = self.basis.patch_of(travel[:, :2])
        out = np.zeros((n, m, 3))
        weights = np.zeros((n, m))
        for patch in np.unique(patches):
            rows = np.flatnonzero(patches == patch)
            xyz, weight = self._scatter_patch(incidence, int(patch), len(rows) * m, rng)
            out[rows], weights[rows] = xyz.reshape(len(rows), m, 3), weight
        return out, weights

    def _scatter_patch(self, incidence: Incidence, patch: int, count: int, rng: Generator) -> tuple[Floats, float]:
        """Directions (count, 3) of light that arrived in one patch, and the part of it that goes on."""
        n = self.basis.size
        through, back = component_of(incidence, True), component_of(incidence, False)
        empty = np.zeros((n, n))
        share = np.concatenate(
            [self.matrices.get(part, empty)[:, patch] * self.basis.projected for part in (through, back)]
        )
        total = float(share.sum())
        sign = travel_sign(incidence)
        if total <= 0.0:
            return np.tile([0.0, 0.0, sign], (count, 1)), 0.0
        cumulative = np.cumsum(share) / total
        chosen: Ints = np.minimum(np.searchsorted(cumulative, rng.random(count), side="right"), 2 * n - 1)
        xy = self.basis.sample(chosen % n, rng.random(count), rng.random(count))
        xyz = with_z(xy, sign)
        xyz[chosen >= n, 2] *= -1.0
        return xyz, total
