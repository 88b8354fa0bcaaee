"""Fair-weather clouds that the wind carries over the site, the same for everybody who looks up at the same time.

The clouds lie in a plane far above. Where a random field (a sum of plane waves, nearly Gaussian) exceeds the level
that leaves the wanted share of the plane uncovered, there is cloud, thin at its edge and thicker further in. The field
repeats itself after `TILE` heights, so that one table of it serves for every place and time.
"""

import math
from dataclasses import dataclass
from statistics import NormalDist

import numpy as np
from numpy.typing import NDArray

from labdaq.clock import NS

Floats = NDArray[np.float64]

WAVES = 48
TILE = 16
CELLS = 768
LOWEST = 0.12
"""Below this sine of the altitude clouds are drawn as they are there: a plane's clouds would shrink to nothing."""


@dataclass(frozen=True)
class CloudOptions:
    """Which clouds.

    Attributes
    ----------
    cover
        Share of the plane that is covered [1].
    depth
        Optical depth in the middle of a cloud for light that goes straight through [1].
    edge
        How far, in standard deviations of the field, a cloud thins out towards its edge.
    wind_heights_per_s, wind_from_deg
        Speed in units of the clouds' height per second, and where it blows from [deg].
    seed
        Of the field.
    """

    cover: float
    depth: float = 2.0
    edge: float = 0.6
    wind_heights_per_s: float = 0.004
    wind_from_deg: float = 250.0
    seed: int = 1


class Clouds:
    """Clouds at any instant."""

    def __init__(self, options: CloudOptions) -> None:
        self.options = options
        blow = math.radians(options.wind_from_deg + 180.0)
        self._wind = options.wind_heights_per_s * np.array([math.sin(blow), math.cos(blow)])
        covered = min(max(options.cover, 1e-6), 1.0 - 1e-6)
        if options.cover > 0.0:
            field = _field(options.seed)
            inside = np.clip((field - NormalDist().inv_cdf(1.0 - covered)) / options.edge, 0.0, 1.0)
            self._table = options.depth * inside * inside * (3.0 - 2.0 * inside)

    def thickness(self, directions: Floats, utc_ns: int) -> Floats:
        """Optical depth of the cloud towards unit vectors (..., 3), 0 where there is none."""
        if self.options.cover <= 0.0:
            return np.zeros(directions.shape[:-1])
        place = directions[..., :2] / np.maximum(LOWEST, directions[..., 2:])
        place = (place - self._wind * ((utc_ns / NS) % 86_400.0)) * (CELLS / TILE)
        low = np.floor(place)
        u, v = np.moveaxis(place - low, -1, 0)
        i, j = np.moveaxis(low.astype(np.int64) % CELLS, -1, 0)
        k, n = (i + 1) % CELLS, (j + 1) % CELLS
        table = self._table
        first = (1.0 - v) * table[i, j] + v * table[i, n]
        second = (1.0 - v) * table[k, j] + v * table[k, n]
        return np.asarray((1.0 - u) * first + u * second)


def _field(seed: int) -> Floats:
    """One tile of the random field, (CELLS, CELLS), of mean 0 and variance 1; first axis east, second north."""
    rng = np.random.default_rng([seed, 9001])
    length = np.exp(rng.uniform(math.log(0.3), math.log(1.6), WAVES))  # in units of the clouds' height
    heading = rng.uniform(0.0, 2.0 * math.pi, WAVES)
    phase = rng.uniform(0.0, 2.0 * math.pi, WAVES)
    steps = 2.0 * math.pi * np.arange(CELLS) / CELLS
    east = np.exp(1j * (np.outer(steps, np.round(TILE / length * np.sin(heading))) + phase))
    north = np.exp(1j * np.outer(steps, np.round(TILE / length * np.cos(heading))))
    return np.asarray(math.sqrt(2.0 / WAVES) * (east @ north.T).real)
