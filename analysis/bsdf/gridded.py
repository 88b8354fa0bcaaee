"""Integrals and samples of a BSDF from its values on an even grid of outgoing directions."""

from abc import ABC, abstractmethod
from functools import lru_cache

import numpy as np
from numpy.random import Generator

from analysis.bsdf.disk import disk_of_square
from analysis.bsdf.model import Component, Floats, Incidence, component_of, travel_sign, with_z


@lru_cache(maxsize=8)
def outgoing_grid(n: int) -> Floats:
    """Directions (n * n, 2) in the middle of equal cells; each holds a projected solid angle of pi / n**2."""
    axis = (np.arange(n) + 0.5) / n
    grid: Floats = disk_of_square(np.stack(np.meshgrid(axis, axis, indexing="ij"), axis=-1).reshape(-1, 2))
    grid.flags.writeable = False
    return grid


class GriddedBsdf(ABC):
    """A BSDF given by a formula or a table; integrated and sampled on a grid of n x n outgoing directions.

    A cell is 2 / sqrt(pi) / n of the disc's radius wide, about 0.5 degrees near the normal for n = 128: narrower peaks
    need more.
    """

    grid: int = 128

    @abstractmethod
    def components(self) -> tuple[Component, ...]:
        """The parts it describes."""

    @abstractmethod
    def evaluate(self, component: Component, incident_xy: Floats, outgoing_xy: Floats) -> Floats:
        """BSDF [1/sr] for directions of travel (..., 2), which broadcast; 0 for a part it does not describe."""

    def hemispherical(self, component: Component, incident_xy: Floats) -> Floats:
        """Part of the light from each direction (..., 2) that this component sends on."""
        flat = incident_xy.reshape(-1, 2)
        outgoing = outgoing_grid(self.grid)
        totals = np.array([self.evaluate(component, xy, outgoing).mean() * np.pi for xy in flat])
        return totals.reshape(incident_xy.shape[:-1])

    def __call__(
        self, incidence: Incidence, travel: Floats, per_direction: int, rng: Generator
    ) -> tuple[Floats, Floats]:
        """Scatter rays as a `Tracer`: directions (n, 3) to (n, m, 3) and weights (n, m)."""
        n, sign = self.grid, travel_sign(incidence)
        out = np.zeros((len(travel), per_direction, 3))
        weights = np.zeros((len(travel), per_direction))
        parts = [component_of(incidence, True), component_of(incidence, False)]
        for i, direction in enumerate(travel):
            values = np.concatenate([self.evaluate(p, direction[:2], outgoing_grid(n)) for p in parts])
            total = float(values.sum()) * np.pi / n**2
            out[i] = [0.0, 0.0, sign]
            if total <= 0.0:
                continue
            cumulative = np.cumsum(values) / values.sum()
            chosen = np.minimum(np.searchsorted(cumulative, rng.random(per_direction), side="right"), 2 * n * n - 1)
            cell = chosen % (n * n)
            square = (np.stack([cell // n, cell % n], axis=1) + rng.random((per_direction, 2))) / n
            out[i] = with_z(disk_of_square(square), sign)
            out[i, chosen >= n * n, 2] *= -1.0
            weights[i] = total
        return out, weights
