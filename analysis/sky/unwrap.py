"""From a merged fisheye picture to a sky map."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from analysis.hdr.fisheye import Lens
from analysis.hdr.flags import SATURATED
from analysis.hdr.merged import Merged
from analysis.sky.map import SkyMap
from analysis.sky.pixels import directions_at, pixel_moments

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Unwrapped:
    """A sky map, and what belongs to each of its pixels.

    Attributes
    ----------
    sky
        In the merged picture's unit.
    relative_sd : shape (n, n)
        Standard uncertainty of a pixel from noise, over its value; 0 where unknown.
    mean_time : shape (n, n) [s]
        Middle of the exposures the pixel came from, since that of the earliest one.
    saturated : shape (n, n)
        Pixels with a part that is only a lower bound.
    """

    sky: SkyMap
    relative_sd: Floats
    mean_time: Floats
    saturated: NDArray[np.bool_]


def unwrap(picture: Merged, lens: Lens, n: int) -> Unwrapped:
    """Turn a merged picture of the zenith into an n x n sky map, vignetting taken out.

    Each map pixel is the mean of places in it, as many as keep all picture pixels in play, each interpolated between
    picture pixels. Sky that the picture does not show stays unknown.
    """
    seen = lens.in_merged_pixels(picture.pixel_step)
    samples = int(np.clip(np.ceil(2.0 * seen.radius_px / n * 90.0 / seen.edge_deg), 2, 8))
    total, weight = np.zeros((n, n)), np.zeros((n, n))
    variance, when = np.zeros((n, n)), np.zeros((n, n))
    shut = np.zeros((n, n), dtype=np.bool_)
    index = np.arange(n)
    saturated = picture.flags & SATURATED > 0
    noise = np.where(np.isfinite(picture.variance), picture.variance, 0.0)
    for a in (np.arange(samples) + 0.5) / samples:
        for b in (np.arange(samples) + 0.5) / samples:
            d = directions_at(index[:, None] + a, index[None, :] + b, n)
            row, column = seen.place(d)
            theta = np.arccos(np.clip(d[..., 2], -1.0, 1.0))
            gain = 1.0 / seen.falloff(np.degrees(theta))
            inside = (d[..., 2] > 0.0) & (theta <= np.radians(seen.edge_deg))
            value, covered = _between(picture.signal, row, column)
            share = np.sinc(theta / np.pi) * (inside & covered)
            i, j = _nearest(picture.signal.shape, row, column)
            total += share * gain * value
            weight += share
            variance += (share * gain) ** 2 * noise[i, j]
            when += share * picture.mean_time[i, j]
            shut |= (share > 0.0) & saturated[i, j]
    known = (weight > 0.0) & (pixel_moments(n)[0] > 0.0)
    safe = np.where(known, weight, 1.0)
    mean = np.where(known, total / safe, 0.0)
    # places closer than a picture pixel share its noise: as many are independent as there are picture pixels
    pixels = (2.0 * seen.radius_px / n * 90.0 / seen.edge_deg) ** 2
    sd = np.sqrt(variance / safe**2 * max(1.0, samples**2 / max(pixels, 1.0)))
    relative = np.where(known & (mean > 0.0), sd / np.where(mean > 0.0, mean, 1.0), 0.0)
    return Unwrapped(SkyMap.of(mean, known), relative, np.where(known, when / safe, 0.0), shut & known)


def _nearest(shape: tuple[int, ...], row: Floats, column: Floats) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    return (
        np.clip(row.astype(np.int64), 0, shape[0] - 1),
        np.clip(column.astype(np.int64), 0, shape[1] - 1),
    )


def _between(picture: NDArray[np.float32], row: Floats, column: Floats) -> tuple[Floats, NDArray[np.bool_]]:
    """Picture interpolated bilinearly at places (pixel middles at 0.5), and whether they lie in it."""
    height, width = picture.shape
    inside = (row >= 0.0) & (row <= height) & (column >= 0.0) & (column <= width)
    y, x = np.clip(row - 0.5, 0.0, height - 1.0), np.clip(column - 0.5, 0.0, width - 1.0)
    i, j = np.minimum(y.astype(np.int64), height - 2), np.minimum(x.astype(np.int64), width - 2)
    v, u = y - i, x - j
    low = (1.0 - u) * picture[i, j] + u * picture[i, j + 1]
    high = (1.0 - u) * picture[i + 1, j] + u * picture[i + 1, j + 1]
    return (1.0 - v) * low + v * high, inside
