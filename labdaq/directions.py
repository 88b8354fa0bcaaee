"""Directions, as the laboratory names them.

Type C photometry of a luminaire hanging in the roof: gamma = 0 at nadir, 90 at the horizon, 180 at the zenith; C = 0
towards north, 90 west, 180 south, 270 east, which is right-handed about the upward axis. A place in the sky is
given the same way: C = 360° minus its azimuth (azimuth runs from north through east).

Vectors are in the site's frame: x east, y north, z up; shape (..., 3).
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray

Floats = NDArray[np.float64]


def vector(gamma_deg: ArrayLike, c_deg: ArrayLike) -> Floats:
    """Unit vector of a type C direction; gamma and C [deg] broadcast, result (..., 3)."""
    gamma, c = np.broadcast_arrays(np.radians(gamma_deg), np.radians(c_deg))
    sine = np.sin(gamma)
    return np.stack([-sine * np.sin(c), sine * np.cos(c), -np.cos(gamma)], axis=-1)


def evenly(count: int) -> Floats:
    """Unit vectors (count, 3) evenly over the sphere, zenith first: a Fibonacci spiral, its first half the sky."""
    turn = np.arange(count) * np.pi * (3.0 - np.sqrt(5.0))
    z = 1.0 - (2.0 * np.arange(count) + 1.0) / count
    return np.stack([np.sqrt(1 - z**2) * np.cos(turn), np.sqrt(1 - z**2) * np.sin(turn), z], axis=1)


def gamma_c(vectors: ArrayLike) -> tuple[Floats, Floats]:
    """Gamma in [0, 180] and C in [0, 360) [deg] of vectors (..., 3) of any length; C is 0 on the axis."""
    v = np.asarray(vectors, dtype=np.float64)
    gamma = np.degrees(np.arctan2(np.hypot(v[..., 0], v[..., 1]), -v[..., 2]))
    c = np.degrees(np.arctan2(-v[..., 0], v[..., 1])) % 360.0
    return gamma, np.where(c >= 360.0, 0.0, c)


def c_of_azimuth(azimuth_deg: ArrayLike) -> Floats:
    """C angle [deg, in [0, 360)] of a compass azimuth [deg, from north through east]."""
    return (360.0 - np.asarray(azimuth_deg, dtype=np.float64)) % 360.0


def sky_vector(altitude_deg: ArrayLike, azimuth_deg: ArrayLike) -> Floats:
    """Unit vector towards a place in the sky given by altitude and azimuth [deg]."""
    return vector(90.0 + np.asarray(altitude_deg, dtype=np.float64), c_of_azimuth(azimuth_deg))


def angle_between(a: ArrayLike, b: ArrayLike) -> Floats:
    """Angle between unit vectors [deg], accurate for small angles (chord formula)."""
    chord = np.linalg.norm(np.asarray(a, dtype=np.float64) - np.asarray(b, dtype=np.float64), axis=-1)
    angle: Floats = np.degrees(2.0 * np.arcsin(np.clip(chord / 2.0, 0.0, 1.0)))
    return angle


def rotated(vectors: ArrayLike, axis: ArrayLike, degrees: ArrayLike) -> Floats:
    """Vectors (..., 3) turned about unit axes (..., 3), right-handed, by an angle [deg] (Rodrigues' formula)."""
    v, a = np.asarray(vectors, dtype=np.float64), np.asarray(axis, dtype=np.float64)
    angle = np.radians(np.asarray(degrees, dtype=np.float64))[..., None]
    along = np.sum(v * a, axis=-1, keepdims=True) * a
    made: Floats = np.cos(angle) * v + np.sin(angle) * np.cross(a, v) + (1.0 - np.cos(angle)) * along
    return made
