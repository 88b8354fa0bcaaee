"""Directions about the sun, to take away what a shading disc hides."""

import math
from functools import cache

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

RINGS = 8
SECTORS = 20


def cap(axis: Floats, half_angle_deg: float) -> tuple[Floats, Floats]:
    """Directions (n, 3) above the horizon within an angle of ``axis`` (3,), and their solid angles (n,) [sr]."""
    polar, solid_angle = _rings(half_angle_deg)
    side = np.cross(axis, [0.0, 1.0, 0.0] if abs(axis[1]) < 0.9 else [1.0, 0.0, 0.0])
    side /= np.linalg.norm(side)
    around = polar @ np.stack([side, np.cross(axis, side), axis])
    return around, solid_angle * (around[:, 2] > 0.0)


@cache
def _rings(half_angle_deg: float) -> tuple[Floats, Floats]:
    """Directions about the z axis and their solid angles: Gauss-Legendre in the polar angle, even in azimuth."""
    nodes, weights = np.polynomial.legendre.leggauss(RINGS)
    half = math.radians(half_angle_deg) / 2.0
    polar = half * (nodes + 1.0)
    turn = 2.0 * np.pi * np.arange(SECTORS) / SECTORS
    theta, phi = (a.ravel() for a in np.meshgrid(polar, turn, indexing="ij"))
    solid_angle = np.repeat(weights * half * np.sin(polar) * 2.0 * np.pi / SECTORS, SECTORS)
    return np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)], axis=-1), solid_angle
