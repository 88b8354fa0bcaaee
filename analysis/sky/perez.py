"""The all-weather model of sky luminance of Perez, Seals and Michalsky.

Perez, Seals, Michalsky 1993, Solar Energy 50:235, with the erratum 51:423. The 160 coefficients are quoted from
Radiance's gendaylit.c; the copy in gendaymtx.c is identical. Relative luminance towards a point at zenith angle zeta
and angle gamma from the sun is

    f = (1 + a exp(b / cos zeta)) (1 + c exp(d gamma) + e cos² gamma)

What differs from gendaylit, on purpose: the level is set by integrating f over the hemisphere (gendaylit sums 145
points of equal weight, which leaves the delivered diffuse illuminance 0.2 to 4 % low), no ground is blended into the
lowest ten degrees, and a sky the coefficients make impossible is clamped and flagged instead of printed black.
"""

import math
from dataclasses import dataclass
from typing import Final, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from analysis.sky.clearness import Condition, clearness_class, from_illuminances
from analysis.sky.quadrature import KINKED, hemisphere_nodes, nodes
from labdaq.directions import angle_between, sky_vector

Floats = NDArray[np.float64]

_TABLE: Final = """
    1.3525 -0.2576 -0.269 -1.4366   -0.767 0.0007 1.2734 -0.1233   2.8 0.6004 1.2375 1
        1.8734 0.6297 0.9738 0.2809   0.0356 -0.1246 -0.5718 0.9938
    -1.2219 -0.773 1.4148 1.1016   -0.2054 0.0367 -3.9128 0.9156   6.975 0.1774 6.4477 -0.1239
        -1.5798 -0.5081 -1.7812 0.108   0.2624 0.0672 -0.219 -0.4285
    -1.1 -0.2515 0.8952 0.0156   0.2782 -0.1812 -4.5 1.1766   24.7219 -13.0812 -37.7 34.8438
        -5 1.5218 3.9229 -2.6204   -0.0156 0.1597 0.4199 -0.5562
    -0.5484 -0.6654 -0.2672 0.7117   0.7234 -0.6219 -5.6812 2.6297   33.3389 -18.3 -62.25 52.0781
        -3.5 0.0016 1.1477 0.1062   0.4659 -0.3296 -0.0876 -0.0329
    -0.6 -0.3566 -2.5 2.325   0.2937 0.0496 -5.6812 1.8415   21 -4.7656 -21.5906 7.2492
        -3.5 -0.1554 1.4062 0.3988   0.0032 0.0766 -0.0656 -0.1294
    -1.0156 -0.367 1.0078 1.4051   0.2875 -0.5328 -3.85 3.375   14 -0.9999 -7.1406 7.5469
        -3.4 -0.1078 -1.075 1.5702   -0.0672 0.4016 0.3017 -0.4844
    -1 0.0211 0.5025 -0.5119   -0.3 0.1922 0.7023 -1.6317   19 -5 1.2438 -1.9094
        -4 0.025 0.3844 0.2656   1.0468 -0.3788 -2.4517 1.4656
    -1.05 0.0289 0.426 0.359   -0.325 0.1156 0.7781 0.0025   31.0625 -14.5 -46.1148 55.375
        -7.2312 0.405 13.35 0.6234   1.5 -0.6426 1.8564 0.5636
"""
_ROWS: Final = np.array(_TABLE.split(), dtype=np.float64).reshape(8, 5, 4)
"""x1 to x4 of each of a, b, c and, on the next line, d, e; clearness classes downwards."""

_LOWEST_COSINE: Final = 0.01  # b / cos zeta is not followed further down, as in perezlum.cal


@dataclass(frozen=True, slots=True)
class PerezSky:
    """One Perez sky, without the sun's disc.

    Attributes
    ----------
    sun_altitude_deg, sun_azimuth_deg
        Where the sun is [deg]; azimuth from north through east.
    condition
        Clearness and brightness the coefficients were taken at.
    coefficients
        a, b, c, d, e.
    scale
        Luminance of f = 1 [cd/m²].
    flags
        Those of the condition, and ``delta-raised`` (the erratum's floor of 0.2 in classes 2 to 5), ``b-clamped``
        (b > 0 would diverge at the horizon; 0 was taken), ``negative-clipped`` (f below 0 somewhere; 0 was taken),
        ``impossible-uniform`` (f below 0 everywhere, or all but; a uniform sky was taken).
    """

    sun_altitude_deg: float
    sun_azimuth_deg: float
    condition: Condition
    coefficients: tuple[float, float, float, float, float]
    scale: float
    flags: tuple[str, ...]

    @classmethod
    def from_condition(
        cls, condition: Condition, diffuse_lx: float, sun_altitude_deg: float, sun_azimuth_deg: float
    ) -> Self:
        """Make the sky of a condition that gives ``diffuse_lx`` [lx] on the horizontal, integrated exactly."""
        zenith = math.radians(min(max(90.0 - sun_altitude_deg, 0.0), 90.0))
        coefficients, flags = perez_coefficients(condition, zenith)
        cosine, gamma, weight = hemisphere_nodes(round(zenith, 9))
        relative, clipped = _relative(coefficients, cosine, gamma)
        if clipped:
            flags.append("negative-clipped")
            cosine, gamma, weight = nodes(zenith, KINKED)
            relative, _ = _relative(coefficients, cosine, gamma)
        total = float(np.sum(relative * cosine * weight))
        if total < _BLACK:  # nothing is left of the sky: better an even one that says so than a black one
            coefficients, total = (0.0, -1.0, 0.0, -1.0, 0.0), math.pi
            flags.append("impossible-uniform")
        scale = diffuse_lx / total
        all_flags = (*condition.flags, *flags)
        return cls(sun_altitude_deg, sun_azimuth_deg, condition, coefficients, scale, all_flags)

    @classmethod
    def from_illuminances(
        cls,
        normal_lx: float,
        diffuse_lx: float,
        sun_altitude_deg: float,
        sun_azimuth_deg: float,
        distance_factor: float = 1.0,
        *,
        method: str = "efficacy",
    ) -> Self:
        """Make the sky of a beam normal and a diffuse horizontal illuminance [lx].

        ``method`` is that of `analysis.sky.clearness.from_illuminances`, which also says what is raised.
        """
        condition = from_illuminances(normal_lx, diffuse_lx, sun_altitude_deg, distance_factor, method=method)
        return cls.from_condition(condition, diffuse_lx, sun_altitude_deg, sun_azimuth_deg)

    def luminance(self, directions: ArrayLike) -> Floats:
        """Luminance [cd/m²] towards unit vectors (..., 3); 0 below the horizon."""
        d = np.asarray(directions, dtype=np.float64)
        gamma = np.radians(angle_between(d, sky_vector(self.sun_altitude_deg, self.sun_azimuth_deg)))
        relative, _ = _relative(self.coefficients, d[..., 2], gamma)
        return np.where(d[..., 2] >= 0.0, self.scale * relative, 0.0)

    @property
    def zenith_luminance(self) -> float:
        """Luminance straight up [cd/m²]."""
        return float(self.luminance([0.0, 0.0, 1.0]))


def perez_coefficients(
    condition: Condition, zenith_rad: float
) -> tuple[tuple[float, float, float, float, float], list[str]]:
    """Coefficients a to e for the sun at a zenith angle [rad], and flags for what had to be clamped."""
    flags = []
    delta = condition.delta
    if EPSILON_ERRATUM[0] < condition.epsilon < EPSILON_ERRATUM[1] and delta < DELTA_ERRATUM:
        delta = DELTA_ERRATUM
        flags.append("delta-raised")
    row = _ROWS[clearness_class(condition.epsilon)]
    a, b, c, d, e = (
        float(v) for v in row[:, 0] + row[:, 1] * zenith_rad + delta * (row[:, 2] + row[:, 3] * zenith_rad)
    )
    if clearness_class(condition.epsilon) == 0:
        (c1, c2, c3, c4), (d1, d2, d3, d4) = row[2].tolist(), row[3].tolist()
        c = math.exp((delta * (c1 + c2 * zenith_rad)) ** c3) - c4
        d = -math.exp(delta * (d1 + d2 * zenith_rad)) + d3 + delta * d4
    if b > 0.0:
        b = 0.0
        flags.append("b-clamped")
    return (a, b, c, d, e), flags


EPSILON_ERRATUM: Final = (1.065, 2.8)
DELTA_ERRATUM: Final = 0.2
"""The erratum (Solar Energy 51:423) keeps delta at 0.2 or more between these clearnesses."""
_BLACK: Final = 3e-3
"""Integral of f over the hemisphere, weighed by the cosine, of a sky that is all but black (π where f is 1)."""


def _relative(
    coefficients: tuple[float, float, float, float, float], cosine: Floats, gamma: Floats
) -> tuple[Floats, bool]:
    """f of the model docstring, each factor kept from going negative, and whether that was needed."""
    a, b, c, d, e = coefficients
    gradation = 1.0 + a * np.exp(b / np.maximum(cosine, _LOWEST_COSINE))
    indicatrix = 1.0 + c * np.exp(d * gamma) + e * np.cos(gamma) ** 2
    up = cosine >= 0.0
    clipped = bool(np.any(up & ((gradation < 0.0) | (indicatrix < 0.0))))
    return np.maximum(gradation, 0.0) * np.maximum(indicatrix, 0.0), clipped
