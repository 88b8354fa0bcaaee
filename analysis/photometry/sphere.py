"""Distributions as functions on the sphere: resampling, zonal flux, turning and mirroring.

Between its angles a distribution is bilinear in gamma and C (`Distribution.at`); everything here means that surface.
"""

from itertools import pairwise
from typing import Final, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from analysis.photometry.distribution import Distribution, interpolate
from labdaq import directions
from labdaq.errors import DataError

Floats = NDArray[np.float64]
Mirror = Literal["east-west", "north-south"]
_SAME_DEG: Final = 1e-7
"""Planes closer than this are one plane."""


def resample(
    distribution: Distribution, gamma_deg: ArrayLike, c_deg: ArrayLike, *, keep_flux: bool = False
) -> Distribution:
    """The same distribution on other angles.

    Parameters
    ----------
    gamma_deg : shape (G,) [deg], c_deg : shape (P,) [deg]
        Increasing; ``c_deg`` from 0 to 360, both included.
    keep_flux
        Scale the result to the flux of the original: a coarse grid cuts off or fills in what lies between its
        angles. Only sensible when the new gammas cover the old ones.
    """
    result = distribution.resampled(gamma_deg, c_deg)
    if not keep_flux:
        return result
    flux = result.flux()
    if flux <= 0.0:
        raise DataError("nothing of the distribution's light falls on the new angles; its flux cannot be kept")
    return result.scaled(distribution.flux() / flux)


def zonal_lumens(distribution: Distribution, edges_deg: ArrayLike) -> Floats:
    """Flux [lm] between neighbouring gammas of ``edges_deg`` (n + 1,) [deg], shape (n,); exact for the surface.

    The sum over zones that cover all gammas is `Distribution.flux`.
    """
    edges = np.asarray(edges_deg, dtype=np.float64)
    if edges.ndim != 1 or len(edges) < 2 or np.any(np.diff(edges) <= 0):
        raise DataError("zone edges must increase and be at least two")
    zones = np.zeros(len(edges) - 1)
    for k, (low, high) in enumerate(pairwise(edges)):
        low, high = max(low, distribution.gamma_deg[0]), min(high, distribution.gamma_deg[-1])
        if high > low:
            inside = distribution.gamma_deg[(distribution.gamma_deg > low) & (distribution.gamma_deg < high)]
            gamma = np.concatenate([[low], inside, [high]])
            zones[k] = distribution.resampled(gamma, distribution.c_deg).flux()
    return zones


def turned(distribution: Distribution, angle_deg: float) -> Distribution:
    """The distribution of the luminaire turned about the vertical, counter-clockwise seen from above [deg].

    No value is interpolated except the plane at the new C = 0, when none falls there.
    """
    c = (distribution.c_deg[:-1] + angle_deg) % 360.0
    c[(c < _SAME_DEG) | (360.0 - c < _SAME_DEG)] = 0.0
    order = np.argsort(c, kind="stable")
    order = order[np.diff(c[order], prepend=-1.0) > _SAME_DEG]
    planes, c = distribution.candela[:-1][order], c[order]
    if c[0] != 0.0:
        seam = distribution.at(distribution.gamma_deg, -angle_deg)
        c, planes = np.concatenate([[0.0], c]), np.concatenate([seam[None], planes])
    closed = Distribution.closed(distribution.gamma_deg, c, planes)
    return Distribution(closed.gamma_deg, closed.c_deg, closed.candela, distribution.keywords)


def mirrored(distribution: Distribution, swap: Mirror) -> Distribution:
    """The mirror image with east and west, or north and south, exchanged; nothing is interpolated.

    ``east-west`` maps C to -C, ``north-south`` C to 180 - C.
    """
    image = Distribution(
        distribution.gamma_deg, 360.0 - distribution.c_deg[::-1], distribution.candela[::-1], distribution.keywords
    )
    return image if swap == "east-west" else turned(image, 180.0)


def rotation_matrix(axis: ArrayLike, angle_deg: float) -> Floats:
    """Matrix (3, 3) of a right-handed turn about ``axis`` (3,) of any length (Rodrigues' formula)."""
    k = np.asarray(axis, dtype=np.float64)
    length = np.linalg.norm(k)
    if k.shape != (3,) or not length > 0:
        raise DataError("a rotation needs an axis of three numbers that are not all zero")
    k = k / length
    cross = np.array([[0.0, -k[2], k[1]], [k[2], 0.0, -k[0]], [-k[1], k[0], 0.0]])
    angle = np.radians(angle_deg)
    matrix: Floats = np.eye(3) + np.sin(angle) * cross + (1.0 - np.cos(angle)) * (cross @ cross)
    return matrix


def rotated(
    distribution: Distribution,
    axis: ArrayLike,
    angle_deg: float,
    gamma_deg: ArrayLike | None = None,
    c_deg: ArrayLike | None = None,
) -> Distribution:
    """The distribution of the luminaire turned about any axis.

    Parameters
    ----------
    axis : shape (3,)
        In the site's frame (x east, y north, z up); right-handed.
    angle_deg
        How far [deg].
    gamma_deg, c_deg
        Angles of the result [deg]; by default 0..180 and 0..360 at the finest step of the original, between 1 and 5.

    Notes
    -----
    For a turn about the vertical use `turned`, which does not interpolate.
    """
    step = float(np.clip(min(np.diff(distribution.gamma_deg).min(), np.diff(distribution.c_deg).min()), 1.0, 5.0))
    count = round(180.0 / step)
    gamma = np.linspace(0.0, 180.0, count + 1) if gamma_deg is None else np.asarray(gamma_deg, dtype=np.float64)
    c = np.linspace(0.0, 360.0, 2 * count + 1) if c_deg is None else np.asarray(c_deg, dtype=np.float64)
    back = directions.vector(gamma[None, :], c[:, None]) @ rotation_matrix(axis, angle_deg)  # inverse = transpose
    return Distribution(gamma, c, distribution.at(*directions.gamma_c(back)), distribution.keywords)


def solid_angle_weights(gamma_deg: Floats, c_deg: Floats) -> Floats:
    """Weights (P, G) [sr] that integrate a bilinear table (planes 0..360 included) over the solid angle it covers."""
    ring = np.array([_unit(gamma_deg, i) for i in range(len(gamma_deg))])
    width = np.radians(np.diff(c_deg))
    plane = np.zeros(len(c_deg))
    plane[:-1] += width / 2
    plane[1:] += width / 2
    weights: Floats = plane[:, None] * ring
    return weights


def _unit(gamma_deg: Floats, i: int) -> float:
    """Integral of the hat function at gamma i against the sine, per radian of C."""
    hat = np.zeros((2, len(gamma_deg)))
    hat[:, i] = 1.0
    return Distribution(gamma_deg, np.array([0.0, 360.0]), hat).flux() / (2.0 * np.pi)


def rms(distribution: Distribution) -> float:
    """Root mean square intensity over the solid angle covered [cd]."""
    weights = solid_angle_weights(distribution.gamma_deg, distribution.c_deg)
    return float(np.sqrt((weights * distribution.candela**2).sum() / weights.sum()))


def common_grid(a: Distribution, b: Distribution, step_c_deg: float = 2.5) -> tuple[Floats, Floats, Floats, Floats]:
    """Both distributions on the gammas they share and even C-planes without 360: gamma (G,), C (P,), and (P, G) each.

    Raises
    ------
    DataError
        They share less than two gammas' worth of range.
    """
    low, high = max(a.gamma_deg[0], b.gamma_deg[0]), min(a.gamma_deg[-1], b.gamma_deg[-1])
    gamma = np.unique(np.concatenate([a.gamma_deg, b.gamma_deg]))
    gamma = gamma[(gamma >= low) & (gamma <= high)]
    gamma = gamma[np.diff(gamma, prepend=-1.0) > _SAME_DEG]
    if len(gamma) < 2:
        raise DataError("the two distributions share no range of gamma")
    c = np.arange(0.0, 360.0, step_c_deg)
    first, second = (interpolate(d.gamma_deg, d.c_deg, d.candela, gamma[None, :], c[:, None]) for d in (a, b))
    return gamma, c, first, second
