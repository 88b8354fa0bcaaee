"""BSDFs as tensor trees: rank 3 for isotropic, rank 4 for anisotropic scattering (G. Ward's variable resolution BSDFs).

Incident and outgoing directions of travel are mapped from the disc to the unit square; see `analysis.bsdf.disk`. Rank 4
takes the square of the incident and of the outgoing direction. Rank 3 takes (1 - sine of incidence) / 2, which fills
the lower half of its first dimension only, and the outgoing direction turned so that the light travels along +x.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.random import Generator

from analysis.bsdf.disk import disk_of_square, square_of_disk
from analysis.bsdf.model import Component, Floats, Incidence, Material, component_of, travel_sign, with_z
from analysis.bsdf.tree import Tree
from labdaq.errors import DataError


@dataclass(frozen=True)
class TensorTreeBsdf:
    """A BSDF of variable resolution.

    Attributes
    ----------
    trees
        One tree [1/sr] for each component, all of the same rank.
    material
        What the sample is.
    """

    trees: Mapping[Component, Tree]
    material: Material = field(default_factory=Material)

    def __post_init__(self) -> None:
        if not self.trees:
            raise DataError("a BSDF needs at least one component")
        if {tree.rank for tree in self.trees.values()} not in ({3}, {4}):
            raise DataError("the trees of a BSDF must all have rank 3 or all have rank 4")
        for component, tree in self.trees.items():
            if not np.isfinite(tree.leaves).all() or (tree.leaves < 0).any():
                raise DataError(f"{component}: a value is negative or not finite")

    @property
    def rank(self) -> int:
        """3 (isotropic) or 4."""
        return next(iter(self.trees.values())).rank

    def components(self) -> tuple[Component, ...]:
        """The parts it describes."""
        return tuple(self.trees)

    def evaluate(self, component: Component, incident_xy: Floats, outgoing_xy: Floats) -> Floats:
        """BSDF [1/sr] for directions of travel (..., 2), which broadcast; 0 for a part it does not describe."""
        incident, outgoing = np.broadcast_arrays(incident_xy, outgoing_xy)
        tree = self.trees.get(component)
        if tree is None:
            return np.zeros(incident.shape[:-1])
        turned = outgoing if self.rank == 4 else turn(outgoing, -azimuth(incident))
        return tree.values(np.concatenate([self._incident(incident), square_of_disk(turned)], axis=-1))

    def _incident(self, incident: Floats) -> Floats:
        """Coordinates (..., 1 or 2) of incident directions."""
        if self.rank == 4:
            return square_of_disk(incident)
        sine = np.minimum(1.0, np.hypot(incident[..., 0], incident[..., 1]))
        return np.minimum(0.5 - 0.5 * sine, np.nextafter(0.5, 0.0))[..., None]

    def hemispherical(self, component: Component, incident_xy: Floats) -> Floats:
        """Part of the light from each direction (..., 2) that this component sends on."""
        tree = self.trees.get(component)
        flat = incident_xy.reshape(-1, 2)
        result = np.zeros(len(flat))
        if tree is not None:
            for i, fixed in enumerate(self._incident(flat)):
                _, size, value = tree.slice(fixed)
                result[i] = np.pi * float((value * size**2).sum())
        return result.reshape(incident_xy.shape[:-1])

    def __call__(
        self, incidence: Incidence, travel: Floats, per_direction: int, rng: Generator
    ) -> tuple[Floats, Floats]:
        """Scatter rays as a `Tracer`: directions (n, 3) to (n, m, 3) and weights (n, m)."""
        sign = travel_sign(incidence)
        parts = [
            (self.trees.get(component_of(incidence, through)), sign if through else -sign) for through in (True, False)
        ]
        trees = [(tree, way) for tree, way in parts if tree is not None]
        shape = len(travel), per_direction
        place, ways, weights = rng.random((*shape, 2)), np.full(shape, sign), np.zeros(shape)
        for i, fixed in enumerate(self._incident(travel[:, :2])):
            cells = [(*tree.slice(fixed), way) for tree, way in trees]
            shares = np.concatenate([np.pi * value * size**2 for _, size, value, _ in cells] or [np.zeros(0)])
            if (total := float(shares.sum())) <= 0.0:
                continue
            cumulative = np.cumsum(shares) / total
            chosen = np.searchsorted(cumulative, rng.random(per_direction), side="right")
            chosen = np.minimum(chosen, len(cumulative) - 1)
            corner, size = (np.concatenate([cell[k] for cell in cells])[chosen] for k in (0, 1))
            place[i] = corner + size[:, None] * place[i]
            ways[i] = np.concatenate([np.full(len(size), way) for _, size, _, way in cells])[chosen]
            weights[i] = total
        out = disk_of_square(place)
        if self.rank == 3:
            out = turn(out, azimuth(travel[:, None, :2]))
        out = with_z(out, 1.0)
        out[..., 2] *= ways
        return out, weights


def azimuth(xy: Floats) -> Floats:
    """Angle [rad] of directions (..., 2) from +x towards +y."""
    return np.arctan2(xy[..., 1], xy[..., 0])


def turn(xy: Floats, angle: Floats) -> Floats:
    """Directions (..., 2) turned by angles (...) [rad]."""
    c, s = np.cos(angle), np.sin(angle)
    return np.stack([c * xy[..., 0] - s * xy[..., 1], s * xy[..., 0] + c * xy[..., 1]], axis=-1)
