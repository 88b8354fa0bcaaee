"""A clear, hazy, broken or covered sky: the all-weather luminance distribution of Perez.

R. Perez, R. Seals, J. Michalsky 1993, "All-weather model for sky luminance distribution", Solar Energy 50:235-245
and its erratum 51:423. The coefficients are those of Radiance's gendaylit (after the paper's Table 1).
"""

import math

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

CLEARNESS_EDGES = (1.065, 1.23, 1.5, 1.95, 2.8, 4.5, 6.2)
SOLAR_LX = 127_500.0
"""Illuminance outside the atmosphere [lx], at the mean distance of the sun."""

# rows: bins of clearness; columns: a1..a4, b1..b4, c1..c4, d1..d4, e1..e4
_ROWS = """
 1.3525  -0.2576 -0.2690 -1.4366  -0.7670  0.0007  1.2734 -0.1233   2.8000   0.6004   1.2375  1.0000
 1.8734   0.6297  0.9738  0.2809   0.0356 -0.1246 -0.5718  0.9938
-1.2219  -0.7730  1.4148  1.1016  -0.2054  0.0367 -3.9128  0.9156   6.9750   0.1774   6.4477 -0.1239
-1.5798  -0.5081 -1.7812  0.1080   0.2624  0.0672 -0.2190 -0.4285
-1.1000  -0.2515  0.8952  0.0156   0.2782 -0.1812 -4.5000  1.1766  24.7219 -13.0812 -37.7000 34.8438
-5.0000   1.5218  3.9229 -2.6204  -0.0156  0.1597  0.4199 -0.5562
-0.5484  -0.6654 -0.2672  0.7117   0.7234 -0.6219 -5.6812  2.6297  33.3389 -18.3000 -62.2500 52.0781
-3.5000   0.0016  1.1477  0.1062   0.4659 -0.3296 -0.0876 -0.0329
-0.6000  -0.3566 -2.5000  2.3250   0.2937  0.0496 -5.6812  1.8415  21.0000  -4.7656 -21.5906  7.2492
-3.5000  -0.1554  1.4062  0.3988   0.0032  0.0766 -0.0656 -0.1294
-1.0156  -0.3670  1.0078  1.4051   0.2875 -0.5328 -3.8500  3.3750  14.0000  -0.9999  -7.1406  7.5469
-3.4000  -0.1078 -1.0750  1.5702  -0.0672  0.4016  0.3017 -0.4844
-1.0000   0.0211  0.5025 -0.5119  -0.3000  0.1922  0.7023 -1.6317  19.0000  -5.0000   1.2438 -1.9094
-4.0000   0.0250  0.3844  0.2656   1.0468 -0.3788 -2.4517  1.4656
-1.0500   0.0289  0.4260  0.3590  -0.3250  0.1156  0.7781  0.0025  31.0625 -14.5000 -46.1148 55.3750
-7.2312   0.4050 13.3500  0.6234   1.5000 -0.6426  1.8564  0.5636
"""

_TABLE = np.array([float(word) for word in _ROWS.split()]).reshape(8, 5, 4)


def clearness_brightness(normal_lx: float, diffuse_lx: float, altitude_deg: float) -> tuple[float, float]:
    """Perez's clearness and brightness of a sky, from its illuminances.

    The paper has irradiances; the ratio of their luminous efficacies is taken as that of the light outside.
    """
    zenith = math.radians(90.0 - altitude_deg)
    cubed = 1.041 * zenith**3
    clearness = ((diffuse_lx + normal_lx) / max(1.0, diffuse_lx) + cubed) / (1.0 + cubed)
    air_mass = 1.0 / (math.cos(zenith) + 0.15 * (93.885 - math.degrees(zenith)) ** -1.253)
    brightness = diffuse_lx * air_mass / SOLAR_LX
    return min(12.0, max(1.0, clearness)), min(0.6, max(0.01, brightness))


def coefficients(zenith: float, clearness: float, brightness: float) -> tuple[float, float, float, float, float]:
    """The distribution's a, b, c, d, e for the sun's zenith angle [rad]."""
    row = _TABLE[int(np.searchsorted(CLEARNESS_EDGES, clearness, side="right"))]
    if 1.065 < clearness < 2.8:
        brightness = max(0.2, brightness)
    a, b, c, d, e = row[:, 0] + row[:, 1] * zenith + brightness * (row[:, 2] + row[:, 3] * zenith)
    if clearness < CLEARNESS_EDGES[0]:
        c1, c2, c3, c4 = row[2]
        d1, d2, d3, d4 = row[3]
        c = math.exp((brightness * (c1 + c2 * zenith)) ** c3) - c4
        d = -math.exp(brightness * (d1 + d2 * zenith)) + d3 + brightness * d4
    return float(a), float(b), float(c), float(d), float(e)


def relative_luminance(directions: Floats, sun: Floats, clearness: float, brightness: float) -> Floats:
    """Luminance over an unknown factor towards unit vectors (..., 3) above the horizon; 0 below it, never negative."""
    zenith = math.acos(min(1.0, max(-1.0, float(sun[2]))))
    a, b, c, d, e = coefficients(zenith, clearness, brightness)
    height = np.maximum(1e-3, directions[..., 2])
    cosine = np.clip(directions @ sun, -1.0, 1.0)
    value = (1.0 + a * np.exp(b / height)) * (1.0 + c * np.exp(d * np.arccos(cosine)) + e * cosine**2)
    return np.where(directions[..., 2] > 0.0, np.maximum(0.0, value), 0.0)
