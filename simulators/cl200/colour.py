"""Colour of daylight and what a chroma meter computes from it.

Tristimulus values are of the CIE 1931 observer. Sun and sky have simple, sourced colours:

* the sun is a 5772 K black body (IAU 2015 nominal solar temperature) seen through molecules, optical depth
  0.008735 λ^-4.08 per air mass (λ in µm; Leckner 1978), and haze, β λ^-1.3 per air mass (Ångström), with the air
  mass of Kasten and Young 1989;
* the sky is a CIE daylight illuminant (CIE 15:2004, 3.1) whose colour temperature follows from its luminance,
  10^6 / (59.77 lg L - 132.1) K with L in cd/m² (clear sky of Chain, Dumortier and Fontoynont 1999).
"""

from functools import cache
from typing import Final

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

WAVELENGTHS_NM: Final = np.arange(380.0, 781.0, 10.0)

_X = """14 42 143 435 1344 2839 3483 3362 2908 1954 956 320 49 93 633 1655 2904 4334 5945 7621 9163 10263 10622 10026
8544 6424 4479 2835 1649 874 468 227 114 58 29 14 7 3 2 1 0"""
_Y = """0 1 4 12 40 116 230 380 600 910 1390 2080 3230 5030 7100 8620 9540 9950 9950 9520 8700 7570 6310 5030 3810 2650
1750 1070 610 320 170 82 41 21 10 5 2 1 1 0 0"""
_Z = """65 201 679 2074 6456 13856 17471 17721 16692 12876 8130 4652 2720 1582 782 422 203 87 39 21 17 11 8 3 2 0 0 0 0
0 0 0 0 0 0 0 0 0 0 0 0"""
OBSERVER: Final = np.array([[float(v) * 1e-4 for v in row.split()] for row in (_X, _Y, _Z)])
"""CIE 1931 colour-matching functions x, y, z at `WAVELENGTHS_NM`, shape (3, 41); CIE 15:2004 T.4 to 4 decimals."""

HAZE_BETA: Final = 0.08
"""Ångström turbidity of the sun's colour: moderately clear air."""


def chromaticity(xyz: Floats) -> tuple[float, float]:
    """CIE 1931 x, y of tristimulus values; the equal-energy point when there is no light."""
    total = float(np.sum(xyz))
    return (float(xyz[0]) / total, float(xyz[1]) / total) if total > 0 else (1 / 3, 1 / 3)


def tristimulus(luminous: float, xy: tuple[float, float]) -> Floats:
    """X, Y, Z (3,) of light with Y = ``luminous`` and chromaticity ``xy``."""
    x, y = xy
    return luminous * np.array([x / y, 1.0, (1.0 - x - y) / y])


def black_body(temperature_k: float | Floats) -> Floats:
    """Planck's law at `WAVELENGTHS_NM`, in arbitrary units, shape (..., 41)."""
    metres = WAVELENGTHS_NM * 1e-9
    exponent = 1.438776877e-2 / (metres * np.asarray(temperature_k, dtype=np.float64)[..., None])
    spectrum: Floats = (metres / 560e-9) ** -5 / np.expm1(exponent)
    return spectrum


def sun_chromaticity(altitude_deg: float) -> tuple[float, float]:
    """x, y of the direct sun at an altitude [deg]."""
    altitude = max(altitude_deg, 0.0)
    air_mass = 1.0 / (np.sin(np.radians(altitude)) + 0.50572 * (altitude + 6.07995) ** -1.6364)
    micrometres = WAVELENGTHS_NM * 1e-3
    depth = 0.008735 * micrometres**-4.08 + HAZE_BETA * micrometres**-1.3
    return chromaticity(OBSERVER @ (black_body(5772.0) * np.exp(-depth * air_mass)))


def daylight_chromaticity(temperature_k: float) -> tuple[float, float]:
    """x, y of the CIE daylight illuminant of a colour temperature, 4000 to 25 000 K."""
    t = min(max(temperature_k, 4000.0), 25_000.0)
    if t <= 7000.0:
        x = 0.244063 + 0.09911e3 / t + 2.9678e6 / t**2 - 4.6070e9 / t**3
    else:
        x = 0.237040 + 0.24748e3 / t + 1.9018e6 / t**2 - 2.0064e9 / t**3
    return x, -3.000 * x * x + 2.870 * x - 0.275


def sky_chromaticity(luminance_cd_m2: float) -> tuple[float, float]:
    """x, y of a sky of a mean luminance [cd/m²]: the darker, the bluer."""
    mired = 59.77 * np.log10(max(luminance_cd_m2, 1.0)) - 132.1
    return daylight_chromaticity(1e6 / max(float(mired), 40.0))


def uv_1960(xy: tuple[float, float]) -> tuple[float, float]:
    """CIE 1960 u, v."""
    x, y = xy
    below = -2.0 * x + 12.0 * y + 3.0
    return 4.0 * x / below, 6.0 * y / below


def uv_1976(xy: tuple[float, float]) -> tuple[float, float]:
    """CIE 1976 u', v'."""
    u, v = uv_1960(xy)
    return u, 1.5 * v


@cache
def _planckian_locus() -> tuple[Floats, Floats]:
    """Reciprocal temperatures [1/K] (n,), rising, and their CIE 1960 u, v (n, 2)."""
    reciprocal = np.linspace(1 / 100_000.0, 1 / 1500.0, 6000)
    xyz = black_body(1.0 / reciprocal) @ OBSERVER.T
    below = xyz @ np.array([1.0, 15.0, 3.0])
    return reciprocal, np.stack([4.0 * xyz[:, 0] / below, 6.0 * xyz[:, 1] / below], axis=-1)


def colour_temperature(xy: tuple[float, float]) -> tuple[float, float] | None:
    """Correlated colour temperature [K] and distance from the black body (Δuv, positive above it).

    The nearest point of the locus in CIE 1960 u, v (CIE 15:2004, 9.5). ``None`` where that is not defined: beyond
    1667-40 000 K, or further than 0.05 from the locus.
    """
    reciprocal, locus = _planckian_locus()
    away = np.array(uv_1960(xy)) - locus
    nearest = int(np.argmin(np.sum(away * away, axis=1)))
    distance = float(np.hypot(*away[nearest]))
    temperature = 1.0 / float(reciprocal[nearest])
    if not 1667.0 <= temperature <= 40_000.0 or distance > 0.05:
        return None
    return temperature, float(np.copysign(distance, away[nearest, 1]))


def dominant_wavelength(xy: tuple[float, float]) -> tuple[float, float]:
    """Dominant wavelength [nm] and excitation purity [%] against the equal-energy point (CIE 15:2004, 9.4).

    Complementary wavelengths, for purples, come with a minus sign.
    """
    white = np.array([1 / 3, 1 / 3])
    away = np.array(xy) - white
    span = float(np.hypot(*away))
    if span < 1e-6:
        return 0.0, 0.0
    fine = np.linspace(400.0, 700.0, 3001)
    xyz = np.stack([np.interp(fine, WAVELENGTHS_NM, row) for row in OBSERVER], axis=-1)
    spectral = xyz[:, :2] / xyz.sum(axis=1, keepdims=True) - white
    angle = np.arctan2(spectral[:, 1], spectral[:, 0])

    def hit(direction: Floats) -> tuple[float, float, float]:
        turn = np.angle(np.exp(1j * (angle - np.arctan2(direction[1], direction[0]))))
        best = int(np.argmin(np.abs(turn)))
        return float(fine[best]), float(np.hypot(*spectral[best])), float(abs(turn[best]))

    wavelength, reach, miss = hit(away)
    if miss < 0.02:
        return wavelength, 100.0 * span / reach
    wavelength = hit(-away)[0]
    red, violet = spectral[-1], spectral[0]  # the purple line joins the ends of the locus
    along = np.linalg.solve(np.stack([away, red - violet], axis=-1), red)
    return -wavelength, 100.0 / float(along[0])
