"""The disc on an arm that keeps the sun off the lens, as the camera sees it."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from labdaq import directions
from simulators.camera.lens import along
from simulators.world.observed import SunSeen

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class ShadingDisc:
    """A disc that follows the sun, on an arm that reaches up from the horizon below it.

    Attributes
    ----------
    half_angle_deg
        What it hides around the sun [deg].
    arm_width_deg
        Width of its arm [deg].
    reflectance
        Of its underside, lit by the sky: it looks dark, not black.
    altitude_error_deg, azimuth_error_deg
        Where its centre is set, beyond the sun's place [deg].
    """

    half_angle_deg: float = 5.0
    arm_width_deg: float = 1.5
    reflectance: float = 0.04
    altitude_error_deg: float = 0.0
    azimuth_error_deg: float = 0.0

    def hides(self, towards: Floats, sun: SunSeen) -> NDArray[np.bool_]:
        """Which directions (n, 3) end on the disc or its arm."""
        altitude = sun.altitude_deg + self.altitude_error_deg
        azimuth = sun.azimuth_deg + self.azimuth_error_deg
        centre = directions.sky_vector(altitude, azimuth)
        ahead = directions.sky_vector(0.0, azimuth)
        aside = directions.sky_vector(0.0, azimuth + 90.0)
        hidden: NDArray[np.bool_] = along(towards, centre) > np.cos(np.radians(self.half_angle_deg))
        in_plane = np.flatnonzero(np.abs(along(towards, aside)) < np.sin(np.radians(self.arm_width_deg / 2.0)))
        strip = towards[in_plane]
        hidden[in_plane] |= (strip[:, 2] < np.sin(np.radians(altitude))) & (along(strip, ahead) > 0)
        return hidden
