"""What an emulated instrument can see of the world. All instruments observe the same world at the same instant."""

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class SunSeen:
    """The sun at an instant.

    Attributes
    ----------
    altitude_deg, azimuth_deg
        Apparent position [deg]; azimuth from north through east.
    normal_illuminance_lx
        Beam illuminance on a plane facing the sun [lx]; cloud in front of it is already taken off.
    """

    altitude_deg: float
    azimuth_deg: float
    normal_illuminance_lx: float


class World(Protocol):
    """Sun, sky, skylight and dark room at any instant (UTC in nanoseconds)."""

    def sun(self, utc_ns: int) -> SunSeen:
        """Where the sun is and how bright."""
        ...

    def sky_luminance(self, directions: Floats, utc_ns: int) -> Floats:
        """Sky luminance without the sun's disc [cd/m²] towards unit vectors (..., 3); 0 below the horizon."""
        ...

    def roof_illuminance(self, normal: Floats, utc_ns: int, shaded_half_angle_deg: float = 0.0) -> float:
        """Illuminance [lx] on the roof for a sensor facing ``normal`` (3,), cosine-weighted.

        With ``shaded_half_angle_deg`` > 0 a disc hides the sun and the sky within that angle of it.
        """
        ...

    def room_illuminance(self, gamma_deg: Floats, c_deg: float, utc_ns: int) -> Floats:
        """Illuminance [lx] at the goniophotometer's sensors (n,), each facing the aperture's centre."""
        ...
