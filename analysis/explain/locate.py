"""Where the recording departs from the prediction, beyond what nuisances make: before asking why.

Every region of the coordinates (rings of gamma, sectors of C, tests, systems, sun heights, stretches of the scan,
levels) is a matched filter on the whitened residual. Its significance counts that we looked at all of them: the
p-value is the share of pure-noise worlds whose largest filter output anywhere exceeds it.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from analysis.cases.model import Floats
from analysis.explain.readings import Readings
from analysis.explain.regions import Region, regions_of
from analysis.explain.whitening import Whitener

_WORLDS = 2000
_PLACES = 2  # so many are told of a change that no place shows by itself
_HALF, _DENSER = 0.5, 1.25
"""Half of a change is told to lie in half of the readings at most, which hold so many times their share of it."""


@dataclass(frozen=True)
class Mismatch:
    """A region that stands out: by how much (the mean of the stretched, logarithmic, deviation), and how surely.

    Where ``by`` is given, that says so, and the region alone does not. Where ``holds`` is, such a share of all that it
    changes (in squares) lies here, upwards or downwards: by ``rms``, which may be far more than the mean.
    """

    region: Region
    size: float
    z: float
    p_value: float
    by: str = ""
    holds: float = 0.0
    rms: float = 0.0

    @property
    def share(self) -> float:
        """What the recording has more or less than the simulation, over the simulation."""
        return float(np.expm1(self.size))

    @property
    def statement(self) -> str:
        """One sentence."""
        if self.holds:
            lies = f"Of what {self.by} changes, {self.holds:.0%} (in squares) lies {self.region.name}"
            return f"{lies}; there it changes the simulation by {self.rms:.1%} (rms)."
        way = "above" if self.size > 0 else "below"
        told = f", as {self.by} has it" if self.by else ""
        return f"The recording is {abs(self.share):.1%} {way} the simulation {self.region.name}{told}."


@dataclass(frozen=True)
class Scan:
    """All regions as filters, under one covariance.

    Attributes
    ----------
    unit : shape (N, R)
        Whitened filters of unit length.
    highest : shape (W,)
        The largest filter output anywhere in worlds of pure noise.
    """

    regions: list[Region]
    whitener: Whitener
    unit: Floats
    highest: Floats

    @classmethod
    def of(cls, readings: Readings, whitener: Whitener, seed: int = 1) -> "Scan":
        """The scan of these readings under a nuisance covariance."""
        regions = regions_of(readings)
        if not regions:
            return cls([], whitener, np.zeros((len(readings), 0)), np.zeros(0))
        filters = whitener.whitened(np.stack([r.rows.astype(np.float64) for r in regions], axis=1))
        unit = filters / np.linalg.norm(filters, axis=0)
        rng = np.random.default_rng(seed)
        worlds = (np.abs(unit.T @ rng.standard_normal((len(unit), 250))) for _ in range(_WORLDS // 250))
        return cls(regions, whitener, unit, np.concatenate([np.max(world, axis=0) for world in worlds]))

    def standing_out(self, residual: Floats, at_most: int = 5, level: float = 0.01) -> list[Mismatch]:
        """The regions that stand out at ``level``, strongest first; what one explains is taken off before the next.

        ``residual`` (N,) is reading minus model on the stretched scale. Sizes are means over the region; one whose
        filter says the opposite of its mean is a shadow of another and is not told.
        """
        means = self._means(residual)
        found: list[Mismatch] = []
        for k, z in self._strongest_first(residual, np.ones(len(self.regions), dtype=bool)):
            p = _p_value(abs(z), self.highest)
            if p > level or len(found) == at_most:
                break
            if z * means[k] > 0.0:
                found.append(Mismatch(self.regions[k], float(means[k]), z, p))
        return found

    def changed(self, change: Floats, p_value: float, by: str) -> list[Mismatch]:
        """The regions in which a ``change`` (N,) shows most, as sure as it is.

        For a mismatch that no region shows by itself: what a law gains over all readings may be spread thinly.
        """
        means = self._means(change)
        found: list[Mismatch] = []
        for k, z in self._strongest_first(change, means != 0.0):
            if len(found) == _PLACES:
                break
            if z * means[k] > 0.0:
                found.append(Mismatch(self.regions[k], float(means[k]), z, p_value, by))
        return found

    def _strongest_first(self, values: Floats, among: NDArray[np.bool_]) -> Iterator[tuple[int, float]]:
        """Regions and their filters' output; what one explains is taken off before the next, until nothing is left."""
        white, open_to = self.whitener.whitened(values[:, None])[:, 0], among.copy()
        while np.any(open_to):
            z = np.where(open_to, self.unit.T @ white, 0.0)
            k = int(np.argmax(np.abs(z)))
            if z[k] == 0.0:
                return
            yield k, float(z[k])
            white = white - self.unit[:, k] * z[k]
            open_to[k] = False

    def holding_half(self, change: Floats, p_value: float, by: str) -> list[Mismatch]:
        """The smallest region that holds half of a ``change`` (N,), if one of half of the readings does."""
        squares = np.square(change) / max(float(np.sum(np.square(change))), 1e-30)
        held = np.array([float(np.sum(squares[r.rows])) for r in self.regions])
        shares = np.array([float(np.mean(r.rows)) for r in self.regions])
        fit = np.flatnonzero((held >= _HALF) & (held > _DENSER * shares) & (shares <= _HALF))
        if not len(fit):
            return []
        k = fit[np.argmin(shares[fit])]
        here = change[self.regions[k].rows]
        rms = float(np.sqrt(np.mean(np.square(here))))
        return [Mismatch(self.regions[k], float(np.mean(here)), 0.0, p_value, by, float(held[k]), rms)]

    def _means(self, values: Floats) -> Floats:
        return np.array([float(values[r.rows].mean()) for r in self.regions])


def _p_value(z: float, highest: Floats) -> float:
    """Share of noise worlds whose maximum exceeds ``z``; beyond the sample, by the Gumbel law fitted to it."""
    share = float(np.mean(highest >= z))
    if share >= 10 / len(highest):
        return share
    scale = float(np.std(highest)) * np.sqrt(6.0) / np.pi
    mode = float(np.mean(highest)) - 0.5772 * scale
    return float(max(-np.expm1(-np.exp(-(z - mode) / scale)), 1e-300))
