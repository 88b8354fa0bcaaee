"""Goniometer coordinates of types A, B and C, and the way between them.

All three look from the photometric centre. LM-63-2002 (section 3, definitions): in types A and C the planes are
vertical and share a vertical axis, in type B they share a horizontal one; nadir is (V 0, H 0) in types B and C and
(V -90, H 0) in type A; the photometric horizontal is (V 90, H 0) in B and C and (V 0, H 0) in A; horizontal angles
run counter-clockwise seen from above in type C and clockwise in types A and B.
Hence with c towards the photometric horizontal (C = 0, our north), w the horizontal direction at C = 90 (our west) and
u up: ::

    C: sin V (c cos H + w sin H) - u cos V
    A: cos V (c cos H - w sin H) + u sin V
    B: cos H (c sin V - u cos V) - w sin H
"""

from enum import IntEnum

import numpy as np
from numpy.typing import ArrayLike, NDArray

from analysis.photometry.distribution import Distribution, interpolate
from labdaq import directions

Floats = NDArray[np.float64]


class PhotometricType(IntEnum):
    """The code of a goniometer type in an LM-63 file."""

    C = 1
    B = 2
    A = 3


def type_vector(kind: PhotometricType, vertical_deg: ArrayLike, horizontal_deg: ArrayLike) -> Floats:
    """Unit vectors (..., 3) in the site's frame (x east, y north, z up) of goniometer angles [deg]."""
    v, h = np.broadcast_arrays(np.radians(vertical_deg), np.radians(horizontal_deg))
    if kind is PhotometricType.C:
        north, west, up = np.sin(v) * np.cos(h), np.sin(v) * np.sin(h), -np.cos(v)
    elif kind is PhotometricType.A:
        north, west, up = np.cos(v) * np.cos(h), -np.cos(v) * np.sin(h), np.sin(v)
    else:
        north, west, up = np.cos(h) * np.sin(v), -np.sin(h), -np.cos(h) * np.cos(v)
    return np.stack([-west, north, up], axis=-1)


def type_angles(kind: PhotometricType, vectors: ArrayLike) -> tuple[Floats, Floats]:
    """Vertical and horizontal goniometer angles [deg] of unit vectors (..., 3).

    C: V in [0, 180], H in [0, 360). A: V in [-90, 90], H in (-180, 180]. B: V in (-180, 180], H in [-90, 90].
    """
    if kind is PhotometricType.C:
        return directions.gamma_c(vectors)
    d = np.asarray(vectors, dtype=np.float64)
    west, north, up = -d[..., 0], d[..., 1], d[..., 2]
    if kind is PhotometricType.A:
        return np.degrees(np.arctan2(up, np.hypot(north, west))), np.degrees(np.arctan2(-west, north))
    return np.degrees(np.arctan2(north, -up)), np.degrees(np.arctan2(-west, np.hypot(north, up)))


def from_type(
    kind: PhotometricType,
    vertical_deg: Floats,
    horizontal_deg: Floats,
    candela: Floats,
    step_deg: float | None = None,
) -> Distribution:
    """Turn a type A or B table into a type C distribution.

    Parameters
    ----------
    vertical_deg : shape (V,), horizontal_deg : shape (H,) [deg]
        Increasing angles of the table (a half table is unfolded before).
    candela : shape (H, V) [cd]
    step_deg
        Grid of the result over the whole sphere [deg]; by default the finest step of the table, at least 1 degree.

    Notes
    -----
    The table is interpolated bilinearly in its own angles; directions it does not cover get 0 cd. Light is not
    conserved exactly: compare `Distribution.flux` with the table's own when that matters.
    """
    if step_deg is None:
        steps = np.concatenate([np.diff(vertical_deg), np.diff(horizontal_deg)])
        step_deg = float(max(1.0, steps.min()))
    n = max(2, round(180.0 / step_deg))
    gamma = np.linspace(0.0, 180.0, n + 1)
    c = np.linspace(0.0, 360.0, 2 * n + 1)
    v, h = type_angles(kind, directions.vector(gamma[None, :], c[:, None]))
    return Distribution(gamma, c, interpolate(vertical_deg, horizontal_deg, candela, v, h))


def to_type(kind: PhotometricType, distribution: Distribution, vertical_deg: Floats, horizontal_deg: Floats) -> Floats:
    """Candelas (H, V) of a type C distribution at the goniometer angles of another type [deg]."""
    gamma, c = directions.gamma_c(type_vector(kind, vertical_deg[None, :], horizontal_deg[:, None]))
    return distribution.at(gamma, c)
