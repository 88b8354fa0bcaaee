"""Clearness and brightness of a sky from its illuminances, by way of irradiances.

R. Perez, P. Ineichen, R. Seals, J. Michalsky, R. Stewart 1990, "Modeling daylight availability and irradiance
components from direct and global irradiance", Solar Energy 44:271-289, doi:10.1016/0038-092X(90)90055-H: both are
defined on irradiances (equations 1 and 2), luminous efficacies depend on them in turn (equations 7 and 8, table 4).
"""

import math
from functools import lru_cache
from typing import Final

import numpy as np

from simulators.hidden.perez import CLEARNESS_EDGES

SOLAR_W_M2: Final = 1367.0
WATER_CM: Final = 2.0
"""Precipitable water; table 4 weighs it little."""

# table 4: a, b, c, d of the diffuse and of the beam's efficacy [lm/W], one row per class of clearness
_EFFICACY: Final = np.array(
    [
        [97.24, -0.46, 12.00, -8.91, 57.20, -4.55, -2.98, 117.12],
        [107.22, 1.15, 0.59, -3.95, 98.99, -3.46, -1.21, 12.38],
        [104.97, 2.96, -5.53, -8.77, 109.83, -4.90, -1.71, -8.81],
        [102.39, 5.59, -13.95, -13.90, 110.34, -5.84, -1.99, -4.56],
        [100.71, 5.94, -22.75, -23.74, 106.36, -3.97, -1.75, -6.16],
        [106.42, 3.83, -36.15, -28.83, 107.19, -1.25, -1.51, -26.73],
        [141.88, 1.90, -53.24, -14.03, 105.75, 0.77, -1.26, -34.44],
        [152.23, 0.35, -45.27, -7.98, 101.18, 1.58, -1.10, -8.29],
    ]
)


@lru_cache(maxsize=8192)
def clearness_and_brightness(normal_lx: float, diffuse_lx: float, altitude_deg: float) -> tuple[float, float]:
    """Perez's clearness and brightness for illuminance facing the sun and diffuse illuminance [lx].

    Damped iteration from 110 lm/W for both.
    """
    zenith = math.radians(90.0 - altitude_deg)
    air_mass = 1.0 / (math.cos(zenith) + 0.15 * (93.885 - math.degrees(zenith)) ** -1.253)  # Kasten 1966
    cubed = 1.041 * zenith**3
    normal, diffuse = normal_lx / 110.0, diffuse_lx / 110.0
    clearness, brightness = 1.0, 0.01
    for _ in range(200):
        clearness = min(12.0, max(1.0, (1.0 + normal / max(1e-9, diffuse) + cubed) / (1.0 + cubed)))
        brightness = min(0.6, max(0.01, diffuse * air_mass / SOLAR_W_M2))
        row = _EFFICACY[int(np.searchsorted(CLEARNESS_EDGES, clearness, side="right"))]
        of_sky = row[0] + row[1] * WATER_CM + row[2] * math.cos(zenith) + row[3] * math.log(brightness)
        of_beam = row[4] + row[5] * WATER_CM + row[6] * math.exp(5.73 * zenith - 5.0) + row[7] * brightness
        new_normal = normal_lx / of_beam if of_beam > 1.0 else 0.0
        new_diffuse = diffuse_lx / max(10.0, of_sky)
        change = abs(new_normal - normal) + abs(new_diffuse - diffuse)
        normal += 0.6 * (new_normal - normal)
        diffuse += 0.6 * (new_diffuse - diffuse)
        if change < 1e-7 * (normal + diffuse):
            break
    return clearness, brightness
