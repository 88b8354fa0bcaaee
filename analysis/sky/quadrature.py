"""Integration over a sky that has one bright point: the sun's aureole."""

import math
from functools import lru_cache
from typing import Final

import numpy as np
from numpy.typing import NDArray

from labdaq.directions import angle_between

Floats = NDArray[np.float64]

_SMOOTH: Final = 48
KINKED: Final = 256
"""Order for a sky that ends at nought on some line: of 120 such the other was off by up to 2.1 %, this by .05 %."""


@lru_cache(maxsize=64)
def hemisphere_nodes(zenith_rad: float) -> tuple[Floats, Floats, Floats]:
    """`nodes` of as many as smooth skies need, kept."""
    return nodes(zenith_rad, _SMOOTH)


def nodes(zenith_rad: float, order: int) -> tuple[Floats, Floats, Floats]:
    """Nodes over the hemisphere for a sun at ``zenith_rad``: cosine to the zenith, angle to the sun, solid angle.

    Gauss-Legendre rules of some order in zenith angle, above and below the sun, and in azimuth from the sun; both crowd
    towards the sun, where exp(d gamma) has its cusp. Shapes (2 order, order).
    """
    t, w = np.polynomial.legendre.leggauss(order)
    t, w = (t + 1.0) / 2.0, w / 2.0
    square, dsquare = t * t, 2.0 * t * w
    zeta = np.concatenate([zenith_rad * (1.0 - square), zenith_rad + (np.pi / 2 - zenith_rad) * square])
    w_zeta = np.concatenate([zenith_rad * dsquare, (np.pi / 2 - zenith_rad) * dsquare])
    phi, w_phi = np.pi * t**3, 3.0 * np.pi * t * t * w
    sun = np.array([math.sin(zenith_rad), 0.0, math.cos(zenith_rad)])
    s = np.sin(zeta)[:, None]
    c = np.broadcast_to(np.cos(zeta)[:, None], (len(zeta), len(phi)))
    vectors = np.stack([s * np.cos(phi), s * np.sin(phi), c], axis=-1)
    gamma = np.radians(angle_between(vectors, sun))
    weight = 2.0 * w_zeta[:, None] * w_phi * s  # twice: azimuths on both sides of the sun
    return c, gamma, weight
