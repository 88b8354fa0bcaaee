"""The sky cut into patches: Tregenza's 145, and Reinhart's finer ones.

Rows of equal height go up from the horizon; each holds equal patches, the first centred on north and the rest
following to the east; a round cap closes the zenith. With MF:k every Tregenza patch becomes k x k, and the rows are
90 / (7 k + 0.5) degrees high, so that MF:1 is Tregenza (1987, Lighting Research & Technology 19:13). Numbers agree with
Radiance's ``reinhart.cal`` and gendaymtx, less one: patch 0 here is their bin 1 (bin 0 is the ground).
"""

from dataclasses import dataclass
from functools import lru_cache
from typing import Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from labdaq.directions import sky_vector

Floats = NDArray[np.float64]
Index = NDArray[np.int64]

TREGENZA_ROWS: Final = (30, 30, 24, 24, 18, 12, 6)
"""Patches in each of Tregenza's seven rows, horizon first; the zenith cap is the 145th patch."""


@dataclass(frozen=True, eq=False)
class Patches:
    """A subdivision of the upper hemisphere into ``count`` patches.

    Attributes
    ----------
    subdivision
        k of MF:k; 1 is Tregenza's 145, 2 gives 577, 4 gives 2305.
    row_size : shape (7 k + 1,)
        Patches in each row, the cap last.
    altitude_deg, azimuth_deg : shape (count,) [deg]
        Middles of the patches.
    solid_angle_sr : shape (count,) [sr]
    projected_sr : shape (count,) [sr]
        Integral of the cosine to the zenith over the patch; sums to pi.
    """

    subdivision: int
    row_size: Index
    altitude_deg: Floats
    azimuth_deg: Floats
    solid_angle_sr: Floats
    projected_sr: Floats

    @property
    def count(self) -> int:
        """Number of patches."""
        return len(self.altitude_deg)

    @property
    def row_height_deg(self) -> float:
        """Height of a row [deg]; the cap's radius is half of it."""
        return 90.0 / (7 * self.subdivision + 0.5)

    @property
    def vectors(self) -> Floats:
        """Unit vectors to the middles (count, 3)."""
        return sky_vector(self.altitude_deg, self.azimuth_deg)

    def index(self, directions: ArrayLike) -> Index:
        """Patch each unit vector (..., 3) points into; -1 below the horizon."""
        d = np.asarray(directions, dtype=np.float64)
        altitude = np.degrees(np.arctan2(d[..., 2], np.hypot(d[..., 0], d[..., 1])))
        azimuth = np.degrees(np.arctan2(d[..., 0], d[..., 1])) % 360.0
        row = np.clip((altitude / self.row_height_deg).astype(np.int64), 0, len(self.row_size) - 1)
        size = self.row_size[row]
        column = np.floor(azimuth * size / 360.0 + 0.5).astype(np.int64) % size
        first = np.concatenate([[0], np.cumsum(self.row_size)[:-1]])
        return np.where(altitude >= -1e-9, first[row] + column, -1)  # the horizon itself is sky, rounding or not


@lru_cache(maxsize=8)
def reinhart(subdivision: int = 1) -> Patches:
    """Make the MF:``subdivision`` patches; 1 is Tregenza's sky.

    Raises `ValueError` for a subdivision below one.
    """
    if subdivision < 1:
        raise ValueError(f"a Reinhart sky needs a subdivision of at least 1, not {subdivision}")
    k = subdivision
    size = np.array([n * k for n in TREGENZA_ROWS for _ in range(k)] + [1], dtype=np.int64)
    height = 90.0 / (7 * k + 0.5)
    low = np.radians(height * np.arange(len(size)))
    high = np.radians(np.minimum(height * np.arange(1, len(size) + 1), 90.0))
    middle = np.degrees((low + high) / 2)
    middle[-1] = 90.0
    solid = 2 * np.pi * (np.sin(high) - np.sin(low)) / size
    projected = np.pi * (np.sin(high) ** 2 - np.sin(low) ** 2) / size
    return Patches(
        subdivision=k,
        row_size=size,
        altitude_deg=np.repeat(middle, size),
        azimuth_deg=np.concatenate([360.0 * np.arange(n) / n for n in size]),
        solid_angle_sr=np.repeat(solid, size),
        projected_sr=np.repeat(projected, size),
    )
