"""Whether a prediction knows its lenses' patterns, as its own symmetry tells.

A lens that has no directions in its plane sends the sun's light out alike on both sides of the upright plane through
the sun, if the well below it is round or matt. Prisms do so only where the sun stands along their axes or diagonals.
"""

from collections.abc import Sequence
from typing import Final

import numpy as np

from analysis.cases.model import Floats
from analysis.explain.fields import C_DEG, GAMMA_DEG, solid_angle
from analysis.simulate.daylight import Daylight
from labdaq.directions import c_of_azimuth

EVEN: Final = 0.03
"""Both sides of an even prediction differ by no more (rms of the logarithm). (Of four other authors' those with a
pattern have .04 and more, in 380 systems; of those without two have .015 and .025, others square wells or noise.)"""
LEAST_TESTS: Final = 3
EVEN_IN_FEW: Final = 0.012
"""The same where fewer tests tell. (Of a further author's those without a pattern, below a round well, have .0018 to
.0088, those with one .018 and more.)"""
_OFF_AXIS_DEG: Final = 8.0
"""Suns nearer to an axis or a diagonal of the pattern tell nothing,"""
_HIGHEST_DEG: Final = 70.0
"""nor do suns near the zenith,"""
_OF_SUN: Final = 0.5
"""nor light that is less than so much the sun's."""
_DARK: Final = 0.02
"""Share of the brightest direction that is added before directions are compared by their logarithms."""
_RINGS: Final = (GAMMA_DEG >= 10.0) & (GAMMA_DEG <= 75.0)


def is_even(days: Sequence[Daylight], seen: Floats, sky: Floats, rotation_deg: float = 0.0) -> bool:
    """Whether light ``seen`` (T, P, G) [cd], of which ``sky`` is the sky's, is even about the sun's plane.

    ``rotation_deg``: of the skylight, counter-clockwise seen from above. Never where no sun would show it.
    """
    told = [k for k, day in enumerate(days) if _tells(day, seen[k], sky[k], rotation_deg)]
    if not told:
        return False
    differs = float(np.median([_unevenness(seen[k], days[k].sun_azimuth_deg) for k in told]))
    return differs < (EVEN if len(told) >= LEAST_TESTS else EVEN_IN_FEW)


def _tells(day: Daylight, seen: Floats, sky: Floats, rotation_deg: float) -> bool:
    beside = (float(c_of_azimuth(day.sun_azimuth_deg)) - rotation_deg + 22.5) % 45.0 - 22.5
    flux = float(np.sum(seen * solid_angle()))
    of_sun = flux > 0.0 and float(np.sum((seen - sky) * solid_angle())) > _OF_SUN * flux
    return bool(of_sun and abs(beside) > _OFF_AXIS_DEG and day.sun_altitude_deg < _HIGHEST_DEG)


def _unevenness(light: Floats, azimuth_deg: float) -> float:
    """Rms difference of the logarithms of a light (P, G) and its mirror image in the sun's plane."""
    place = (2.0 * c_of_azimuth(azimuth_deg) - C_DEG) % 360.0 / C_DEG[1]
    low = np.floor(place).astype(np.intp)
    part = (place - low)[:, None]
    mirrored = light[low % len(C_DEG)] * (1.0 - part) + light[(low + 1) % len(C_DEG)] * part
    floor = _DARK * float(light.max())
    differs = np.log((light + floor) / (mirrored + floor))[:, _RINGS]
    return float(np.sqrt(np.mean(differs**2)))
