"""The level of a sky map, from a diffuse illuminance; the sun, from global less diffuse.

After chapter 5 of the Greenwood report: the map without what the disc hid must give the diffuse illuminance, which was
read with a like disc over the meter; then the hidden part is filled, and the sun is what is missing to the global
illuminance. Differences that matter:

* What the meter's disc hides is a cone round the sun; the camera's arm is none of the meter's. So the map is
  filled first, and compared with the diffuse reading outside the meter's cone only.
* The report raises the filled map until it gives 10 % more than the diffuse reading, for what the cone hides. A Perez
  sky fitted to the same tests puts 2.5 to 3.2 % there (mean 2.9 %). Here the filler says how much it is, unless
  ``circumsolar`` is given; the record holds both, because the choice moves some 7 % of the diffuse light between beam
  and sky.
"""

from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from analysis.sky.clearness import SOLAR_ILLUMINANCE_LX
from analysis.sky.map import SkyMap
from labdaq.directions import sky_vector
from labdaq.errors import DataError

Floats = NDArray[np.float64]

REPORT_CIRCUMSOLAR: Final = 0.10
"""What the report adds for the light behind the meter's disc, as a share of the diffuse reading."""

PEREZ_CIRCUMSOLAR: Final = (0.025, 0.029, 0.032)
"""Least, mean and largest share that a Perez sky puts there, over the report's 31 tests with sun (computed)."""

METER_DISC_HALF_ANGLE_DEG: Final = 5.0


@dataclass(frozen=True, slots=True)
class Reading:
    """A mean reading with its standard uncertainty, both in lx or cd/m²."""

    value: float
    uncertainty: float = 0.0


@dataclass(frozen=True, slots=True)
class Sun:
    """The sun of a test.

    Attributes
    ----------
    altitude_deg, azimuth_deg
        Apparent position [deg].
    normal_illuminance_lx, uncertainty_lx
        Beam on a plane facing it [lx], and its standard uncertainty.
    flags
        ``global-below-diffuse`` (no beam is left; 0 was taken), ``beam-within-noise`` (less than two standard
        uncertainties), ``beam-above-extraterrestrial``, ``sun-low`` (below 5°: the cosine magnifies every error).
    """

    altitude_deg: float
    azimuth_deg: float
    normal_illuminance_lx: float
    uncertainty_lx: float
    flags: tuple[str, ...] = ()

    @property
    def vector(self) -> Floats:
        """Unit vector towards the sun (3,)."""
        return sky_vector(self.altitude_deg, self.azimuth_deg)


def calibrate(
    filled: SkyMap,
    sun_direction: Floats,
    diffuse: Reading,
    *,
    meter_half_angle_deg: float = METER_DISC_HALF_ANGLE_DEG,
    circumsolar: float | None = None,
    spread: str = "cone",
) -> tuple[SkyMap, dict[str, Any]]:
    """Scale a filled map to a diffuse reading taken with a shading disc.

    Parameters
    ----------
    filled
        Relative luminance of the whole visible sky.
    diffuse
        Horizontal illuminance with the disc over the meter [lx].
    meter_half_angle_deg
        Half angle of the cone the meter's disc hides [deg].
    circumsolar
        Illuminance of that cone over the diffuse reading; ``None`` leaves it as filled, 0.10 is the report's.
    spread
        Where light for a given ``circumsolar`` goes: ``cone`` scales the cone alone, ``sky`` the whole map, as the
        report does.

    Returns the map in cd/m² and a JSON-able account. Raises `DataError` when the reading or the map is not positive.
    """
    if not (np.isfinite(diffuse.value) and diffuse.value > 0.0):
        raise DataError(f"a diffuse illuminance of {diffuse.value:g} lx cannot scale a sky map")
    if spread not in ("cone", "sky"):
        raise ValueError(f"spread is 'cone' or 'sky', not {spread!r}")
    cone = filled.near(sun_direction, meter_half_angle_deg)
    outside, inside = filled.horizontal_illuminance(~cone), filled.horizontal_illuminance(cone)
    if outside <= 0.0:
        raise DataError("the sky map is black outside the shading disc; it cannot be scaled to the diffuse illuminance")
    factor = diffuse.value / outside
    found = inside / outside
    sky = filled.scaled(factor)
    if circumsolar is not None and spread == "cone" and inside > 0.0:
        sky = sky.scaled(np.where(cone, circumsolar / found, 1.0))
    elif circumsolar is not None:
        sky = filled.scaled(diffuse.value * (1.0 + circumsolar) / (outside + inside))
    total = sky.horizontal_illuminance()
    account = {
        "factor": factor,
        "relative_sd": diffuse.uncertainty / diffuse.value,
        "diffuse_reading_lx": diffuse.value,
        "meter_half_angle_deg": meter_half_angle_deg,
        "circumsolar_filled": found,
        "circumsolar_used": found if circumsolar is None else circumsolar,
        "circumsolar_report": REPORT_CIRCUMSOLAR,
        "circumsolar_perez": list(PEREZ_CIRCUMSOLAR),
        "spread": "as filled" if circumsolar is None else spread,
        "diffuse_lx": total,
        "unknown_sr": float(2.0 * np.pi - np.sum(sky.solid_angle_sr[sky.known])),
    }
    return sky, account


def sun_of(
    sky: SkyMap,
    altitude_deg: float,
    azimuth_deg: float,
    global_: Reading,
    diffuse: Reading,
    distance_factor: float = 1.0,
    circumsolar_sd: float = 0.02,
) -> Sun:
    """The sun that gives, with the calibrated sky, the global horizontal illuminance.

    ``circumsolar_sd`` is the standard uncertainty of the light behind the disc, as a share of the diffuse reading.

    Raises `DataError` for a global reading that is no number above 0, or a sun below the horizon.
    """
    if not (np.isfinite(global_.value) and global_.value > 0.0):
        raise DataError(f"a global illuminance of {global_.value:g} lx says nothing about the sun")
    sine = float(np.sin(np.radians(altitude_deg)))
    if sine <= 0.0:
        raise DataError(f"the sun is {-altitude_deg:.1f}° below the horizon: check time, time zone and site")
    total = sky.horizontal_illuminance()
    left = global_.value - total
    parts = (global_.uncertainty, diffuse.uncertainty * total / diffuse.value, circumsolar_sd * diffuse.value)
    uncertainty = float(np.sqrt(np.sum(np.square(parts)))) / sine
    normal = left / sine
    flags = []
    if left < 0.0:
        flags.append("global-below-diffuse")
    elif normal < 2.0 * uncertainty:
        flags.append("beam-within-noise")
    if normal > SOLAR_ILLUMINANCE_LX * distance_factor:
        flags.append("beam-above-extraterrestrial")
    if altitude_deg < 5.0:
        flags.append("sun-low")
    return Sun(altitude_deg, azimuth_deg, max(0.0, float(normal)), uncertainty, tuple(flags))
