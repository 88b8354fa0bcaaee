"""The luminance meter at the zenith against the map: the check that does not share the map's calibration."""

from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from analysis.sky.calibrate import Reading
from analysis.sky.map import SkyMap
from labdaq.directions import sky_vector

Floats = NDArray[np.float64]

FIELD_DEG: Final = 1.0 / 3.0
"""Acceptance angle of an LS-110 [deg]."""

POINTING_DEG: Final = 1.0
"""How well a meter on a tripod is set to the zenith by eye (standard deviation, assumed) [deg]."""


@dataclass(frozen=True, slots=True)
class ZenithCheck:
    """Meter over map at the zenith.

    Attributes
    ----------
    meter, map
        Luminances with their standard uncertainties [cd/m²]. The map's holds calibration, noise, and how much the sky
        changes within the meter's pointing error.
    ratio, ratio_uncertainty
        Meter over map.
    deviation
        (ratio - 1) in standard uncertainties.
    flags
        ``zenith-hidden`` (the disc or its arm covers it in the picture; the map's value is filled in),
        ``zenith-disagrees`` (beyond three standard uncertainties).
    """

    meter: Reading
    map: Reading
    ratio: float
    ratio_uncertainty: float
    deviation: float
    flags: tuple[str, ...]

    def record(self) -> dict[str, Any]:
        """JSON-able form."""
        return {
            "meter_cd_m2": self.meter.value,
            "meter_sd": self.meter.uncertainty,
            "map_cd_m2": self.map.value,
            "map_sd": self.map.uncertainty,
            "ratio_meter_to_map": self.ratio,
            "ratio_sd": self.ratio_uncertainty,
            "deviation_in_sd": self.deviation,
            "flags": list(self.flags),
        }


def check_zenith(
    sky: SkyMap, meter: Reading, hidden: NDArray[np.bool_], calibration_sd: float, noise_sd: float = 0.0
) -> ZenithCheck:
    """Compare a zenith reading [cd/m²] with a calibrated map.

    Parameters
    ----------
    hidden : shape (n, n)
        Where the map was filled in.
    calibration_sd, noise_sd
        Relative standard uncertainties of the map's scale, and of a pixel from noise.
    """
    rings = np.array([0.0, 0.5, 1.0]) * FIELD_DEG / 2.0
    azimuth = np.arange(0.0, 360.0, 30.0)
    field = sky_vector(90.0 - rings[:, None], azimuth[None, :])
    value = float(np.mean(sky.at(field)))
    # the mean square change over a pointing error of both axes, from two rings that stand for it
    away = sky.at(sky_vector(90.0 - np.array([[1.0], [1.5]]) * POINTING_DEG, azimuth[None, :]))
    gradient = float(np.sqrt(np.mean((away - value) ** 2)))
    sd = float(np.sqrt((value * calibration_sd) ** 2 + (value * noise_sd) ** 2 + gradient**2))
    ratio = meter.value / value if value > 0.0 else float("inf")
    relative = np.hypot(meter.uncertainty / max(meter.value, 1e-30), sd / max(value, 1e-30))
    uncertainty = float(ratio * relative)
    deviation = (ratio - 1.0) / uncertainty if uncertainty > 0.0 else 0.0
    flags = []
    if np.any(hidden & sky.near([0.0, 0.0, 1.0], max(POINTING_DEG, 180.0 / sky.n))):
        flags.append("zenith-hidden")
    if abs(deviation) > 3.0:
        flags.append("zenith-disagrees")
    return ZenithCheck(meter, Reading(value, sd), ratio, uncertainty, float(deviation), tuple(flags))
