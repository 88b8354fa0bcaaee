"""From red, green and blue of a camera to luminance."""

from typing import Final

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Plane = NDArray[np.float32]

SRGB_ROW: Final = (0.2126, 0.7152, 0.0722)
"""Luminance weights of linear sRGB (IEC 61966-2-1), for pictures the camera developed."""

_D65: Final = np.array([0.95047, 1.0, 1.08883])


def camera_row(xyz_to_camera: Floats) -> tuple[float, float, float] | None:
    """Luminance weights of a camera's own red, green and blue; ``None`` when its matrix is not known.

    The second row of the inverse of the matrix from XYZ to the camera, scaled so that D65 gives its green signal. Over
    skies from 5500 K to pure Rayleigh light such a row is within 2.5 % for 11 cameras, while Rec. 709 weights on native
    raw are up to 16 % off.
    """
    if not np.any(xyz_to_camera) or abs(np.linalg.det(xyz_to_camera)) < 1e-9:
        return None
    row = np.linalg.inv(xyz_to_camera)[1] * float((xyz_to_camera @ _D65)[1])
    return float(row[0]), float(row[1]), float(row[2])


def superpixels(
    planes: Plane, flags: NDArray[np.uint8], colours: NDArray[np.int64], row: tuple[float, float, float]
) -> tuple[Plane, NDArray[np.uint8]]:
    """Merge each 2 x 2 cell of a mosaic into one pixel of luminance, without inventing neighbours.

    Parameters
    ----------
    planes : shape (4, 2 h, 2 w)
        Signal, variance, worth and mean time of each place.
    flags : shape (2 h, 2 w)
    colours : shape (2, 2)
        0 red, 1 green, 2 blue.
    row
        Weights of the colours; two green places share theirs.

    Returns the same planes (4, h, w), worth and time being those of green, and flags (h, w) of any of the four places.
    """
    h, w = planes.shape[1] // 2, planes.shape[2] // 2
    out = np.zeros((4, h, w), np.float32)
    flag = np.zeros((h, w), np.uint8)
    main = int(np.argmax(row))
    for i in range(2):
        for j in range(2):
            colour = int(colours[i, j])
            share = 1.0 / np.count_nonzero(colours == colour)
            weight = np.float32(row[colour] * share)
            cell = planes[:, i : 2 * h : 2, j : 2 * w : 2]
            out[0] += weight * cell[0]
            out[1] += weight * weight * cell[1]
            if colour == main:
                out[2:] += np.float32(share) * cell[2:]
            flag |= flags[i : 2 * h : 2, j : 2 * w : 2]
    return out, flag
