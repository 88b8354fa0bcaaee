"""The unit disc of directions and the unit square, mapped so that equal areas stay equal (Shirley and Chiu 1997,
doi:10.1080/10867651.1997.10487479). Equal areas of the disc are equal projected solid angles: the square holds pi."""

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


def square_of_disk(xy: Floats) -> Floats:
    """Point in the unit square, (..., 2), of directions (..., 2) in the unit disc."""
    radius = np.minimum(1.0, np.hypot(xy[..., 0], xy[..., 1]))
    phi = np.arctan2(xy[..., 1], xy[..., 0])
    phi = np.where(phi < -np.pi / 4, phi + 2 * np.pi, phi)  # [-pi/4, 7pi/4)
    quarter = np.minimum(3, ((phi + np.pi / 4) // (np.pi / 2)).astype(np.intp))
    along = (phi - quarter * (np.pi / 2)) * radius / (np.pi / 4)
    a = np.select([quarter == 0, quarter == 1, quarter == 2], [radius, -along, -radius], along)
    b = np.select([quarter == 0, quarter == 1, quarter == 2], [along, radius, -along], -radius)
    return np.stack([0.5 * (a + 1.0), 0.5 * (b + 1.0)], axis=-1)


def disk_of_square(point: Floats) -> Floats:
    """Direction (..., 2) of points (..., 2) in the unit square."""
    a, b = 2.0 * point[..., 0] - 1.0, 2.0 * point[..., 1] - 1.0
    sideways = np.abs(a) > np.abs(b)
    radius = np.where(sideways, a, b)
    safe = np.where(radius == 0.0, 1.0, radius)
    ratio = np.where(sideways, b, a) / safe
    phi = np.where(sideways, np.pi / 4 * ratio, np.pi / 2 - np.pi / 4 * ratio)
    return np.stack([radius * np.cos(phi), radius * np.sin(phi)], axis=-1)
