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
        out = np.zeros((len(travel), per_direction, 3))
        weights = np.zeros((len(travel), per_direction))
        for i, direction in enumerate(travel):
            out[i], weights[i] = self._scatter(incidence, direction[:2], per_direction, rng)
        return out, weights

    def _scatter(self, incidence: Incidence, xy: Floats, count: int, rng: Generator) -> tuple[Floats, float]:
        """Directions (count, 3) of light from one direction, and the part of it that goes on."""
        sign = travel_sign(incidence)
        corners, sizes, shares, signs = [], [], [], []
        for transmitted in (True, False):
            tree = self.trees.get(component_of(incidence, transmitted))
            if tree is not None:
                corner, size, value = tree.slice(self._incident(xy))
                corners.append(corner)
                sizes.append(size)
                shares.append(np.pi * value * size**2)
                signs.append(np.full(len(size), sign if transmitted else -sign))
        if not shares or (total := float(np.concatenate(shares).sum())) <= 0.0:
            return np.tile([0.0, 0.0, sign], (count, 1)), 0.0
        cumulative = np.cumsum(np.concatenate(shares)) / total
        chosen = np.minimum(np.searchsorted(cumulative, rng.random(count), side="right"), len(cumulative) - 1)
        size = np.concatenate(sizes)[chosen, None]
        out = disk_of_square(np.concatenate(corners)[chosen] + size * rng.random((count, 2)))
        if self.rank == 3:
            out = turn(out, np.full(count, float(azimuth(xy))))
        return with_z(out, 1.0) * np.stack(
            [np.ones(count), np.ones(count), np.concatenate(signs)[chosen]], axis=1
        ), total


def azimuth(xy: Floats) -> Floats:
    """Angle [rad] of directions (..., 2) from +x towards +y."""
    return np.arctan2(xy[..., 1], xy[..., 0])


def turn(xy: Floats, angle: Floats) -> Floats:
    """Directions (..., 2) turned by angles (...) [rad]."""
    c, s = np.cos(angle), np.sin(angle)
    return np.stack([c * xy[..., 0] - s * xy[..., 1], s * xy[..., 0] + c * xy[..., 1]], axis=-1)
