"""Standard skies: CIE's fifteen, its traditional overcast sky, and the three of the IES.

* CIE general sky (CIE S 011 / ISO 15469:2004): gradation 1 + a exp(b / cos zeta) times indicatrix
  1 + c (exp(d chi) - exp(d pi / 2)) + e cos² chi. The standard itself was not at hand; the fifteen sets are those on
  which three public listings agree: 15_CIE_standard_skies.csv of the R package rcaiman (after Li, Energy 2016,
  doi 10.1016/j.energy.2016.02.054), ciesky.m of the Lighting Toolbox (after ISO 15469:2004) and DigitalRune's
  CieSkyParameters. Types 5 and 12 and the traditional overcast sky were also checked against Radiance's gensky.
* IES skies (Recommended Practice for the Calculation of Daylight Availability, J. IES 13:381, 1984; RP-21): clear is
  Kittler's formula as in gensky.c; partly cloudy agrees in three public programs; overcast was found in one only, and
  meets the expected horizon of a third of the zenith.

zeta is the angle from the zenith and chi the angle from the sun. Only the shape is standard: the level comes from a
zenith luminance or a diffuse illuminance, integrated over the hemisphere.
"""

import math
from dataclasses import dataclass
from typing import Final, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from analysis.sky.quadrature import hemisphere_nodes
from labdaq.directions import angle_between, sky_vector

Floats = NDArray[np.float64]

_STEEP, _MODERATE, _EVEN = (4.0, -0.70), (1.1, -0.80), (0.0, -1.0)
_HIDDEN, _CLEAR, _TURBID = (-1.0, -0.55), (-1.0, -0.32), (-1.0, -0.15)
_NONE, _SLIGHT, _BRIGHTER = (0.0, -1.0, 0.0), (2.0, -1.5, 0.15), (5.0, -2.5, 0.30)
_CORONA, _POLLUTED, _WIDE = (10.0, -3.0, 0.45), (16.0, -3.0, 0.30), (24.0, -2.8, 0.15)

CIE_TYPES: Final[dict[int, tuple[float, float, float, float, float]]] = {
    1: (*_STEEP, *_NONE),  # overcast, steep gradation, azimuthally even
    2: (*_STEEP, *_SLIGHT),  # overcast, steep, slightly brighter towards the sun
    3: (*_MODERATE, *_NONE),
    4: (*_MODERATE, *_SLIGHT),
    5: (*_EVEN, *_NONE),  # uniform
    6: (*_EVEN, *_SLIGHT),  # partly cloudy, no gradation
    7: (*_EVEN, *_BRIGHTER),
    8: (*_EVEN, *_CORONA),
    9: (*_HIDDEN, *_SLIGHT),  # partly cloudy, sun hidden
    10: (*_HIDDEN, *_BRIGHTER),
    11: (*_HIDDEN, *_CORONA),  # white-blue
    12: (*_CLEAR, *_CORONA),  # clear, low turbidity
    13: (*_CLEAR, *_POLLUTED),  # clear, polluted air
    14: (*_TURBID, *_POLLUTED),  # cloudless, turbid
    15: (*_TURBID, *_WIDE),  # white-blue turbid, wide corona
}
"""a, b, c, d, e of the types 1 to 15."""

NAMES: Final = ("cie-overcast", "ies-clear", "ies-partly-cloudy", "ies-overcast")


@dataclass(frozen=True, slots=True)
class StandardSky:
    """One standard sky, without the sun's disc.

    Attributes
    ----------
    kind
        1 to 15 for a CIE type, or one of `NAMES`.
    sun_altitude_deg, sun_azimuth_deg
        Where the sun is [deg]; azimuth from north through east.
    zenith_luminance
        [cd/m²].
    """

    kind: int | str
    sun_altitude_deg: float
    sun_azimuth_deg: float
    zenith_luminance: float

    @classmethod
    def of_diffuse(cls, kind: int | str, diffuse_lx: float, sun_altitude_deg: float, sun_azimuth_deg: float) -> Self:
        """Make the sky that gives ``diffuse_lx`` [lx] on the horizontal; raises `ValueError` for an unknown kind."""
        zenith = math.radians(min(max(90.0 - sun_altitude_deg, 0.0), 90.0))
        cosine, chi, weight = hemisphere_nodes(round(zenith, 9))
        total = float(np.sum(_relative(kind, cosine, chi, zenith) * cosine * weight))
        return cls(kind, sun_altitude_deg, sun_azimuth_deg, diffuse_lx / total)

    def luminance(self, directions: ArrayLike) -> Floats:
        """Luminance [cd/m²] towards unit vectors (..., 3); 0 below the horizon."""
        d = np.asarray(directions, dtype=np.float64)
        chi = np.radians(angle_between(d, sky_vector(self.sun_altitude_deg, self.sun_azimuth_deg)))
        zenith = math.radians(90.0 - self.sun_altitude_deg)
        relative = _relative(self.kind, np.maximum(d[..., 2], 0.0), chi, zenith)
        return np.where(d[..., 2] >= 0.0, self.zenith_luminance * relative, 0.0)


def _relative(kind: int | str, cosine: Floats, chi: Floats, sun_zenith: float) -> Floats:
    """Luminance over that of the zenith."""
    air = 1.0 / np.maximum(cosine, 1e-6)
    if isinstance(kind, int) and kind in CIE_TYPES:
        a, b, c, d, e = CIE_TYPES[kind]
        end = math.exp(d * math.pi / 2)

        def indicatrix(angle: Floats | float) -> Floats:
            return np.asarray(1.0 + c * (np.exp(d * np.asarray(angle)) - end) + e * np.cos(angle) ** 2)

        gradation = (1.0 + a * np.exp(b * air)) / (1.0 + a * math.exp(b))
        return np.asarray(gradation * indicatrix(chi) / indicatrix(sun_zenith))
    if kind == "cie-overcast":
        return (1.0 + 2.0 * cosine) / 3.0
    if kind == "ies-clear":
        top = (0.91 + 10.0 * np.exp(-3.0 * chi) + 0.45 * np.cos(chi) ** 2) * (1.0 - np.exp(-0.32 * air))
        bottom = 0.91 + 10.0 * math.exp(-3.0 * sun_zenith) + 0.45 * math.cos(sun_zenith) ** 2
        return np.asarray(top / (bottom * (1.0 - math.exp(-0.32))))
    if kind == "ies-partly-cloudy":
        top = (0.526 + 5.0 * np.exp(-1.5 * chi)) * (1.0 - np.exp(-0.80 * air))
        return np.asarray(top / ((0.526 + 5.0 * math.exp(-1.5 * sun_zenith)) * (1.0 - math.exp(-0.80))))
    if kind == "ies-overcast":
        through = np.exp(-0.52 * air)
        return np.asarray(0.864 * through / math.exp(-0.52) + 0.136 * (1.0 - through) / (1.0 - math.exp(-0.52)))
    raise ValueError(f"there is no standard sky {kind!r}: take 1 to 15, or one of {', '.join(NAMES)}")
