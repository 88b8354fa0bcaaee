"""Which symmetry a distribution has, and whether two distributions are mirror images of each other.

Only what varies with C carries orientation, so the mean over C is taken off each gamma ring first. Correlations over
all turns about the vertical are computed at once with the Fourier transform over C.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from analysis.photometry.distribution import Distribution
from analysis.photometry.sphere import common_grid, mirrored, rms, solid_angle_weights, turned
from labdaq.errors import DataError

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Symmetry:
    """How far a distribution is from each symmetry: rms deviation over rms intensity, 0 when exact.

    Attributes
    ----------
    rotational
        The same in all planes.
    north_south
        Mirrored in the plane C 0-180 (C and -C alike).
    east_west
        Mirrored in the plane C 90-270 (C and 180 - C alike).
    quadrant
        Mirrored in both.
    half_turn
        Unchanged by a turn of 180 degrees.
    best_plane_deg, best_plane
        The vertical plane that comes nearest to a mirror plane [deg, 0 to 180], and the deviation from it.
    """

    rotational: float
    north_south: float
    east_west: float
    quadrant: float
    half_turn: float
    best_plane_deg: float
    best_plane: float

    def name(self, tolerance: float = 0.01) -> str:
        """The highest symmetry within ``tolerance``: rotational, quadrant, bilateral (with its plane) or none."""
        if self.rotational <= tolerance:
            return "rotational"
        if self.quadrant <= tolerance:
            return "quadrant"
        if self.best_plane <= tolerance:
            return f"bilateral about C {self.best_plane_deg:g}-{self.best_plane_deg + 180:g}"
        return "none"


def symmetry(distribution: Distribution, step_c_deg: float = 2.5) -> Symmetry:
    """Measure the symmetries of a distribution; raises `DataError` for one without light."""
    scale = rms(distribution)
    if scale <= 0:
        raise DataError("a distribution without light has every symmetry")

    def deviation(other: Distribution) -> float:
        # a symmetric distribution halves its difference to its image: the nearest symmetric one lies in the middle
        return _rms_difference(distribution, other, step_c_deg) / (2.0 * scale)

    east_west = mirrored(distribution, "east-west")
    north_south = mirrored(distribution, "north-south")
    gamma, c, table, _ = common_grid(distribution, distribution, step_c_deg)
    weights = _ring_weights(gamma)
    spread = ((table - table.mean(axis=0)) ** 2).mean(axis=0)
    rotational = float(np.sqrt((weights * spread).sum() / (weights * (table**2).mean(axis=0)).sum()))
    correlation = _correlate(table, table[(-np.arange(len(c))) % len(c)], weights)
    best = int(np.argmax(correlation))
    plane = (c[best] / 2.0) % 180.0
    a, b = deviation(east_west), deviation(north_south)
    return Symmetry(
        rotational=rotational,
        north_south=a,
        east_west=b,
        quadrant=float(np.hypot(a, b)),
        half_turn=deviation(turned(distribution, 180.0)),
        best_plane_deg=float(plane),
        best_plane=deviation(turned(east_west, 2.0 * float(plane))),
    )


@dataclass(frozen=True, slots=True)
class Handedness:
    """Whether one distribution looks like another, or like its mirror image.

    Attributes
    ----------
    same, mirrored_east_west, mirrored_north_south, half_turn
        Correlation of what varies with C (1 identical, 0 unrelated, -1 opposite) with the other distribution as it is,
        mirrored, and turned by 180 degrees.
    turn_same_deg, best_same
        The turn of the second distribution about the vertical that correlates best, and that correlation.
    turn_mirrored_deg, best_mirrored
        The same for its east-west mirror image.
    step_deg
        Resolution of the turns [deg].
    """

    same: float
    mirrored_east_west: float
    mirrored_north_south: float
    half_turn: float
    turn_same_deg: float
    best_same: float
    turn_mirrored_deg: float
    best_mirrored: float
    step_deg: float

    def verdict(self, margin: float = 0.1) -> str:
        """``same``, ``mirrored east-west``, ``mirrored north-south``, ``turned by 180`` or ``undecided``.

        The orientation is taken as known (no free turn); the best correlation must lead by ``margin``.
        """
        scores = {
            "same": self.same,
            "mirrored east-west": self.mirrored_east_west,
            "mirrored north-south": self.mirrored_north_south,
            "turned by 180": self.half_turn,
        }
        first, second = sorted(scores, key=scores.__getitem__, reverse=True)[:2]
        return first if scores[first] - scores[second] >= margin else "undecided"

    def verdict_with_any_turn(self, margin: float = 0.02) -> str:
        """``same``, ``mirrored`` or ``undecided`` when the C = 0 directions may differ by any angle.

        Distributions that have a mirror plane are always undecided: their image is a turn of themselves.
        """
        if abs(self.best_same - self.best_mirrored) < margin:
            return "undecided"
        return "same" if self.best_same > self.best_mirrored else "mirrored"


def handedness(a: Distribution, b: Distribution, step_c_deg: float = 2.5) -> Handedness:
    """Compare the orientation of two distributions, whatever their fluxes.

    Run it first when a simulation and a measurement look mirrored (the report's test 15): a left-handed writer or a
    swapped C-direction shows as ``mirrored east-west`` in every test, a physical cause does not.

    Parameters
    ----------
    step_c_deg
        Resolution of the turns; must divide 180.

    Raises
    ------
    DataError
        One of them is the same in all planes, so that there is nothing to compare.
    """
    gamma, c, first, second = common_grid(a, b, step_c_deg)
    n = len(c)
    if n % 2 or abs(n * step_c_deg - 360.0) > 1e-9:
        raise DataError(f"a step of {step_c_deg:g} degrees does not divide 180")
    weights = _ring_weights(gamma)
    for name, table in (("first", first), ("second", second)):
        spread = (weights * ((table - table.mean(axis=0)) ** 2).sum(axis=0)).sum()
        if spread <= 1e-12 * (weights * (table**2).sum(axis=0)).sum():
            raise DataError(f"the {name} distribution is the same in all planes; it has no handedness")
    image = second[(-np.arange(n)) % n]
    same, flipped = _correlate(first, second, weights), _correlate(first, image, weights)
    k, m = int(np.argmax(same)), int(np.argmax(flipped))
    return Handedness(
        same=float(same[0]),
        mirrored_east_west=float(flipped[0]),
        mirrored_north_south=float(flipped[n // 2]),
        half_turn=float(same[n // 2]),
        turn_same_deg=float(c[k]),
        best_same=float(same[k]),
        turn_mirrored_deg=float(c[m]),
        best_mirrored=float(flipped[m]),
        step_deg=step_c_deg,
    )


def _ring_weights(gamma: Floats) -> Floats:
    ring: Floats = solid_angle_weights(gamma, np.array([0.0, 360.0])).sum(axis=0)
    return ring


def _correlate(first: Floats, second: Floats, weights: Floats) -> Floats:
    """Normalised correlation of ``first`` with ``second`` turned by each step of C, shape (P,)."""
    a, b = first - first.mean(axis=0), second - second.mean(axis=0)
    scale = np.sqrt((weights * (a**2).sum(axis=0)).sum() * (weights * (b**2).sum(axis=0)).sum())
    if scale <= 0.0:
        return np.zeros(len(a))
    product = np.fft.rfft(a, axis=0) * np.conj(np.fft.rfft(b, axis=0)) * weights
    correlation: Floats = np.fft.irfft(product.sum(axis=1), n=len(a)) / scale
    return correlation


def _rms_difference(a: Distribution, b: Distribution, step_c_deg: float) -> float:
    gamma, _, first, second = common_grid(a, b, step_c_deg)
    weights = _ring_weights(gamma)
    mean = (weights * ((first - second) ** 2).mean(axis=0)).sum() / weights.sum()
    return float(np.sqrt(mean))
