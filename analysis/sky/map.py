"""The sky as a picture: luminance on an equiangular hemisphere, and what it shines on.

Rows and columns are those of `analysis.sky.pixels`: the camera looks up, north is at the top, **east at the left**.
"""

import json
import zipfile
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import lru_cache
from pathlib import Path
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from analysis.hdr.radiance_picture import SKY_VIEW, read_picture, write_luminance
from analysis.sky.patches import Patches
from analysis.sky.pixels import directions_at, pixel_moments, places_of
from labdaq.errors import DataError
from labdaq.whole_file import write_whole

Floats = NDArray[np.float64]
Mask = NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class SkyMap:
    """Luminance of the upper hemisphere.

    Attributes
    ----------
    luminance : shape (n, n) [cd/m²]
        Mean over each pixel's part of the sky. Row 0 is north, column 0 east.
    known : shape (n, n)
        Where ``luminance`` means something: pixels with a part above the horizon that no mask took away.
    record
        How the map came about; JSON-able.
    """

    luminance: Floats
    known: Mask
    record: dict[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        n = len(self.luminance)
        if self.luminance.shape != (n, n) or self.known.shape != (n, n):
            raise DataError(f"a sky map is square; this one is {self.luminance.shape}, known {self.known.shape}")
        if not np.all(np.isfinite(self.luminance[self.known])):
            raise DataError("a sky map has a luminance that is not a finite number")

    @classmethod
    def of(cls, luminance: ArrayLike, known: ArrayLike | None = None, record: dict[str, Any] | None = None) -> Self:
        """Make a map of luminances (n, n) [cd/m²]; pixels wholly below the horizon are not known, and set to 0."""
        values = np.array(luminance, dtype=np.float64)
        area, _ = pixel_moments(len(values))
        good = area > 0.0 if known is None else np.asarray(known, dtype=np.bool_) & (area > 0.0)
        values[~good] = 0.0
        return cls(values, good, {} if record is None else record)

    @classmethod
    def from_function(
        cls, luminance: Callable[[Floats], Floats], n: int, *, record: dict[str, Any] | None = None, samples: int = 3
    ) -> Self:
        """Average ``luminance(directions (..., 3)) -> (...)`` over each pixel of an n x n map.

        ``samples`` squared points a pixel, weighted by solid angle; those below the horizon do not count.
        """
        total, weight = np.zeros((n, n)), np.zeros((n, n))
        for directions, share in _subpixels(n, samples):
            seen = np.where(share > 0.0, luminance(directions), 0.0)
            total += share * seen
            weight += share
        return cls.of(np.where(weight > 0.0, total / np.maximum(weight, 1e-30), 0.0), weight > 0.0, record)

    @property
    def n(self) -> int:
        """Pixels along a side."""
        return len(self.luminance)

    @property
    def solid_angle_sr(self) -> Floats:
        """Exact solid angle of each pixel above the horizon (n, n) [sr]."""
        return pixel_moments(self.n)[0]

    @property
    def directions(self) -> Floats:
        """Unit vectors (n, n, 3) to the pixels' middles; those outside the circle point below the horizon."""
        middle = np.arange(self.n) + 0.5
        return directions_at(middle[:, None], middle[None, :], self.n)

    def at(self, directions: ArrayLike) -> Floats:
        """Luminance [cd/m²] towards unit vectors (..., 3), bilinear between known pixels.

        0 below the horizon; NaN where no known pixel is near.
        """
        d = np.asarray(directions, dtype=np.float64)
        row, column = places_of(d, self.n)
        y, x = np.clip(row - 0.5, 0.0, self.n - 1.0), np.clip(column - 0.5, 0.0, self.n - 1.0)
        i, j = np.minimum(y.astype(np.int64), self.n - 2), np.minimum(x.astype(np.int64), self.n - 2)
        total, weight = np.zeros(row.shape), np.zeros(row.shape)
        for di, wi in ((0, 1.0 - (y - i)), (1, y - i)):
            for dj, wj in ((0, 1.0 - (x - j)), (1, x - j)):
                w = wi * wj * self.known[i + di, j + dj]
                total += w * self.luminance[i + di, j + dj]
                weight += w
        with np.errstate(invalid="ignore", divide="ignore"):
            near = np.where(weight > 1e-9, total / weight, np.nan)
        return np.where(d[..., 2] >= 0.0, near, 0.0)

    def horizontal_illuminance(self, where: Mask | None = None) -> float:
        """Illuminance [lx] on a horizontal plane from the known sky, or from its pixels in ``where`` (n, n)."""
        return float(np.sum(self._lit(where) * pixel_moments(self.n)[1][..., 2]))

    def illuminance(self, normal: ArrayLike, where: Mask | None = None) -> float:
        """Illuminance [lx] from the sky (no ground) on a plane facing the unit vector ``normal`` (3,)."""
        cosine = pixel_moments(self.n)[1] @ np.asarray(normal, dtype=np.float64)
        return float(np.sum(self._lit(where) * np.maximum(cosine, 0.0)))

    def mean_luminance(self, where: Mask) -> float:
        """Mean luminance [cd/m²] of the known pixels in ``where`` (n, n) by solid angle; NaN when there is none."""
        area = self.solid_angle_sr * (where & self.known)
        total = float(area.sum())
        return float(np.sum(area * self.luminance)) / total if total > 0.0 else float("nan")

    def patch_means(self, patches: Patches) -> Floats:
        """Mean luminance of each patch (count,) [cd/m²]; NaN for a patch without any known pixel."""
        total, weight = np.zeros(patches.count), np.zeros(patches.count)
        for index, share in _patch_shares(self.n, patches):
            w = share * self.known
            total += np.bincount(index.ravel(), (w * self.luminance).ravel(), patches.count)
            weight += np.bincount(index.ravel(), w.ravel(), patches.count)
        return np.where(weight > 0.0, total / np.where(weight > 0.0, weight, 1.0), np.nan)

    def masked(self, unknown: Mask) -> "SkyMap":
        """The map without the pixels in ``unknown`` (n, n)."""
        return SkyMap.of(self.luminance, self.known & ~unknown, self.record)

    def filled(self, filler: "SkyMap") -> "SkyMap":
        """The map with its unknown sky taken from ``filler`` of the same size."""
        return SkyMap.of(np.where(self.known, self.luminance, filler.luminance), self.known | filler.known, self.record)

    def scaled(self, factor: float | Floats) -> "SkyMap":
        """The map times a factor, or times a factor for each pixel (n, n)."""
        return SkyMap.of(self.luminance * factor, self.known, self.record)

    def noted(self, **facts: Any) -> "SkyMap":
        """The map with more in its record."""
        return replace(self, record={**self.record, **facts})

    def near(self, direction: ArrayLike, half_angle_deg: float) -> Mask:
        """Pixels (n, n) whose middle lies within an angle [deg] of a unit vector (3,), above the horizon."""
        cosine = self.directions @ np.asarray(direction, dtype=np.float64)
        return np.asarray((cosine >= np.cos(np.radians(half_angle_deg))) & (self.solid_angle_sr > 0.0))

    def save(self, path: Path) -> None:
        """Write the 32-bit master (.npz): luminance, known, record. Raises `labdaq.errors.StorageError`."""
        text = np.array(json.dumps(self.record, allow_nan=False))

        def write(beside: Path) -> None:
            with beside.open("wb") as file:  # a name without .npz would be given one
                np.savez_compressed(file, luminance=self.luminance.astype(np.float32), known=self.known, record=text)

        write_whole(path, write)

    @classmethod
    def load(cls, path: Path) -> Self:
        """Read a master written by `save`; raises `DataError` when it is not one."""
        try:
            with path.open("rb") as file, np.load(file, allow_pickle=False) as kept:
                return cls.of(kept["luminance"], kept["known"], json.loads(str(kept["record"])))
        except (OSError, ValueError, KeyError, EOFError, AttributeError, zipfile.BadZipFile) as error:
            raise DataError(f"{path}: not a sky map: {error}") from error

    def save_picture(self, path: Path) -> None:
        """Write a Radiance picture that looks up (`SKY_VIEW`); unknown pixels are black."""
        write_luminance(path, self.luminance, view=SKY_VIEW)

    @classmethod
    def from_picture(cls, path: Path) -> Self:
        """Read a square Radiance picture of an equiangular hemisphere with north at the top and east at the left.

        Raises `DataError` when it is no such picture; its VIEW must be ``-vta`` with 180° both ways.
        """
        picture = read_picture(path)
        words = picture.view.split()
        if "-vta" not in words or any(
            option not in words or float(words[words.index(option) + 1]) != 180.0 for option in ("-vh", "-vv")
        ):
            raise DataError(f"{path}: its view is '{picture.view}', not an angular hemisphere (-vta -vh 180 -vv 180)")
        return cls.of(picture.luminance, record={"source": path.name})

    def _lit(self, where: Mask | None) -> Floats:
        return self.luminance if where is None else np.where(where & self.known, self.luminance, 0.0)


def _subpixels(n: int, samples: int) -> list[tuple[Floats, Floats]]:
    """Directions (n, n, 3) and solid angles (n, n; 0 below the horizon) of each of ``samples``² points a pixel."""
    found = []
    for a in (np.arange(samples) + 0.5) / samples:
        for b in (np.arange(samples) + 0.5) / samples:
            index = np.arange(n)
            d = directions_at(index[:, None] + a, index[None, :] + b, n)
            theta = np.arccos(np.clip(d[..., 2], -1.0, 1.0))
            share = np.sinc(theta / np.pi) * (np.pi / n / samples) ** 2
            found.append((d, np.where(d[..., 2] > 0.0, share, 0.0)))
    return found


@lru_cache(maxsize=4)
def _patch_shares(n: int, patches: Patches) -> tuple[tuple[NDArray[np.int32], Floats], ...]:
    """Patch (n, n) and solid angle (n, n) of sub-pixels, whose sum over each pixel is its exact solid angle."""
    points = _subpixels(n, max(2, -(-1024 // n)))
    total = np.sum([share for _, share in points], axis=0)
    exact = pixel_moments(n)[0] / np.where(total > 0.0, total, 1.0)
    return tuple(
        (np.maximum(patches.index(d), 0).astype(np.int32), share * exact * (share > 0.0)) for d, share in points
    )
