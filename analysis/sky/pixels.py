"""The pixels of an equiangular picture of the upper hemisphere, with exact solid angles.

The picture is what a camera that looks straight up sees with north at the top of its picture: row 0 is at the
northern horizon, and **column 0 at the eastern one** (looking up, east is to the left of north; a map of the ground
has it to the right). Radiance calls this view ``-vta -vd 0 0 1 -vu 0 1 0 -vh 180 -vv 180``. Zenith angle grows linearly
from 0 in the middle to 90° on the circle that touches the picture's edges.

Integrals over a pixel are turned into line integrals along its edges (Green's theorem in zenith angle and azimuth):
the integral of F'(theta) g(phi) over the pixel is the contour integral of F(theta) g(phi) dphi. With theta held at 90°
outside the circle the same sum gives pixels cut by the horizon their exact share.
"""

from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike, NDArray

Floats = NDArray[np.float64]

_GAUSS_T, _GAUSS_W = np.polynomial.legendre.leggauss(6)


@lru_cache(maxsize=4)
def pixel_moments(n: int) -> tuple[Floats, Floats]:
    """Solid angle (n, n) [sr] and vector (n, n, 3) [sr] of each pixel of an n x n picture.

    The vector is the integral of the direction over the pixel's part of the sky: luminance times its upward component
    is the pixel's horizontal illuminance, and its length is a little less than the solid angle. Read-only.
    """
    if n < 2:
        raise ValueError(f"a sky picture needs at least 2 x 2 pixels, not {n}")
    edges = 2.0 * np.arange(n + 1) / n - 1.0
    # along lines v = edges[i] (v up) from u = edges[j] to edges[j + 1], three potentials; see _along
    solid, upward, u_part, v_part = _along(edges)
    # counterclockwise round pixel (i from the bottom, j): bottom +, right +, top -, left -; lines u = const follow
    # from lines v = const by swapping u and v, which reverses dphi
    solid_sum = solid[:-1] - solid[1:] + (solid[:-1] - solid[1:]).T
    upward_sum = upward[:-1] - upward[1:] + (upward[:-1] - upward[1:]).T
    u_sum = u_part[:-1] - u_part[1:] + (v_part[:-1] - v_part[1:]).T
    v_sum = v_part[:-1] - v_part[1:] + (u_part[:-1] - u_part[1:]).T
    # bottom-up to top-down; u grows to the right, which is west
    flipped = [np.ascontiguousarray(part[::-1]) for part in (solid_sum, upward_sum, u_sum, v_sum)]
    area = np.maximum(flipped[0], 0.0)
    area[area < 1e-13] = 0.0
    vector = np.stack([-flipped[2], flipped[3], flipped[1]], axis=-1)
    vector[area == 0.0] = 0.0
    area.flags.writeable = False
    vector.flags.writeable = False
    return area, vector


def _along(edges: Floats) -> tuple[Floats, Floats, Floats, Floats]:
    """Contour integrals along the picture's horizontal grid lines; each (n + 1, n), first axis the line.

    Potentials: 1 - cos theta for the solid angle, sin² theta / 2 for its upward component, and
    theta / 2 - sin(2 theta) / 4 times cos phi or sin phi for the others. Along v = const, dphi = -v du / r².
    """
    v = edges[:, None]
    cut = np.sqrt(np.maximum(0.0, 1.0 - v * v))  # where the line crosses the circle: a kink, so integrate up to it
    sums = np.zeros((4, len(edges), len(edges) - 1))
    bounds = [np.clip(edges[None, :], lo, hi) for lo, hi in ((-np.inf, -cut), (-cut, cut), (cut, np.inf))]
    for bound in bounds:
        start, end = bound[:, :-1], bound[:, 1:]
        half = (end - start) / 2.0
        for t, w in zip(_GAUSS_T, _GAUSS_W, strict=True):
            u = start + half * (1.0 + t)
            r2 = np.maximum(u * u + v * v, 1e-30)
            r = np.sqrt(r2)
            theta = np.minimum(r, 1.0) * (np.pi / 2)
            dphi = -v / r2 * half * w
            bow = theta / 2.0 - np.sin(2.0 * theta) / 4.0
            sums[0] += (1.0 - np.cos(theta)) * dphi
            sums[1] += np.sin(theta) ** 2 / 2.0 * dphi
            sums[2] += bow * (u / r) * dphi
            sums[3] += bow * (v / r) * dphi
    return sums[0], sums[1], sums[2], sums[3]


def directions_at(rows: ArrayLike, columns: ArrayLike, n: int) -> Floats:
    """Unit vectors (..., 3) of places in an n x n picture; pixel (i, j) spans i..i+1 and j..j+1.

    Places outside the circle give directions below the horizon, where the mapping simply goes on.
    """
    v = 1.0 - 2.0 * np.asarray(rows, dtype=np.float64) / n
    u = 2.0 * np.asarray(columns, dtype=np.float64) / n - 1.0
    theta = np.hypot(u, v) * (np.pi / 2)
    sinc = np.sinc(theta / np.pi) * (np.pi / 2)  # sin(theta) / r, finite in the middle
    return np.stack(np.broadcast_arrays(-u * sinc, v * sinc, np.cos(theta)), axis=-1)


def places_of(directions: ArrayLike, n: int) -> tuple[Floats, Floats]:
    """Row and column (fractional, pixel edges at integers) of unit vectors (..., 3): inverse of `directions_at`."""
    d = np.asarray(directions, dtype=np.float64)
    across = np.hypot(d[..., 0], d[..., 1])
    r = np.arctan2(across, d[..., 2]) / (np.pi / 2)
    per = np.where(across > 0.0, r / np.maximum(across, 1e-300), 0.0)
    return (1.0 - d[..., 1] * per) * n / 2.0, (1.0 - d[..., 0] * per) * n / 2.0
