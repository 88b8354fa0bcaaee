"""How wrong the simulation may be: three sizes that nobody knows, and how evidence is summed over them.

Evidence is sharp in them where there are thousands of readings: a scatter that is wrong by a half costs tens of nats,
which any flexible hypothesis would then seem to gain. So each hypothesis gets its own best sizes, on a fine lattice.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Final

import numpy as np

from analysis.explain.readings import GONIOMETER, ROOF, Readings

_WIDE: Final = float(np.log(2.5))
STRIDES: Final = (4, 2, 1)
"""Steps of a search on a lattice; coarse ones alone find the neighbourhood."""
_CHEAP_FIRST: Final = 2, 1, 0
"""Axes in the order in which they are climbed: blocks need not be factored again for another error of the lens."""
Place = tuple[int, int, int]


@dataclass(frozen=True)
class Hyper:
    """How wrong the simulation may be: multiples of the usual smooth discrepancy, scatter, and error of the lens.

    Where no lens was simulated, the third is what all pictures of a camera share, or what a roof's days differ by.
    """

    shape: float
    scatter: float
    lens: float = 1.0

    @property
    def log_weight(self) -> float:
        """Log prior (unnormalised): log-normal about one, a factor 2.5 wide each."""
        logs = np.log([self.shape, self.scatter, self.lens])
        return float(-0.5 * np.sum(logs**2) / _WIDE**2)

    @property
    def base(self) -> tuple[float, float]:
        """The part that the block factors depend on."""
        return self.shape, self.scatter


@dataclass(frozen=True)
class Lattice:
    """Sizes that are tried, increasing by even factors along each axis."""

    shape: tuple[float, ...]
    scatter: tuple[float, ...]
    lens: tuple[float, ...] = (1.0,)

    @property
    def axes(self) -> tuple[tuple[float, ...], ...]:
        """Shape, scatter, lens."""
        return self.shape, self.scatter, self.lens

    def at(self, place: Place) -> Hyper:
        """Sizes at a place."""
        return Hyper(*(axis[k] for axis, k in zip(self.axes, place, strict=True)))

    def nearest(self, hyper: Hyper) -> Place:
        """The place nearest to some sizes."""
        wanted = (hyper.shape, hyper.scatter, hyper.lens)
        shape, scatter, lens = (
            int(np.argmin(np.abs(np.log(np.array(sizes) / w)))) for sizes, w in zip(self.axes, wanted, strict=True)
        )
        return shape, scatter, lens

    def beside(self, place: Place, stride: int) -> Iterator[tuple[int, Place]]:
        """Axis and place of each neighbour; at the edge of the lattice there are fewer."""
        for axis, sizes in enumerate(self.axes):
            for step in (-stride, stride):
                k = min(max(place[axis] + step, 0), len(sizes) - 1)
                if k != place[axis]:
                    shape, scatter, lens = (k if a == axis else place[a] for a in range(3))
                    yield axis, (shape, scatter, lens)

    def climb(
        self, value: Callable[[Hyper], float], start: Hyper, strides: tuple[int, ...] = STRIDES
    ) -> tuple[Hyper, float]:
        """The best place for a log density, and the log of the sum about it (Laplace's, by the axes)."""
        known: dict[Place, float] = {}

        def at(place: Place) -> float:
            if place not in known:
                known[place] = value(self.at(place))
            return known[place]

        top = self.nearest(start)
        for stride in strides:
            before = None
            while before != top:
                before = top
                for axis in _CHEAP_FIRST:
                    top = self._along(axis, top, stride, at)
        return self.at(top), at(top) + sum(self._about(axis, top, at) for axis in range(3))

    def _along(self, axis: int, top: Place, stride: int, at: Callable[[Place], float]) -> Place:
        """The best place reached from ``top`` by strides along one axis, each to a better place."""
        while True:
            best = max((place for k, place in self.beside(top, stride) if k == axis), key=at, default=top)
            if at(best) <= at(top):
                return top
            top = best

    def _about(self, axis: int, top: Place, at: Callable[[Place], float]) -> float:
        """Log of the sum along one axis over the value at the top, as of a parabola through the neighbours."""
        sides = [at(place) for k, place in self.beside(top, 1) if k == axis]
        if not sides:
            return 0.0
        prior = float(np.log(self.axes[axis][1] / self.axes[axis][0])) / _WIDE
        if len(sides) == 1:
            return float(np.log1p(np.exp(sides[0] - at(top))))
        curvature = max(2.0 * at(top) - sides[0] - sides[1], prior**2)
        return 0.5 * float(np.log(2.0 * np.pi / curvature)) + (sides[1] - sides[0]) ** 2 / (8.0 * curvature)


def _even(low: float, high: float, factor: float) -> tuple[float, ...]:
    count = int(np.ceil(np.log(high / low) / np.log(factor))) + 1
    return tuple(float(round(low * factor**k, 4)) for k in range(count))


BELOW: Final = Lattice(_even(0.3, 6.0, 1.3), _even(0.2, 6.0, 1.25), _even(0.15, 2.5, 1.6))
ON_THE_ROOF: Final = Lattice(_even(0.3, 6.0, 1.3), _even(0.2, 6.0, 1.3), _even(0.25, 10.0, 1.6))
"""``lens`` is what a prediction has wrong from day to day: a second meter little, a clear-sky model per cents."""
OF_THE_SKY: Final = Lattice(_even(0.2, 6.0, 1.35), _even(0.2, 30.0, 1.35), _even(0.3, 4.0, 1.5))
"""A prediction of the sky is a second instrument (right to a per cent) or a sky model (to ten); ``lens`` is what all
pictures of one camera have in common."""


def lattice_of(readings: Readings) -> Lattice:
    """The lattice for the kinds of channel that a case has."""
    kinds = set(readings.kind.tolist())
    return BELOW if GONIOMETER in kinds else ON_THE_ROOF if ROOF in kinds else OF_THE_SKY
