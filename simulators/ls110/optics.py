"""What falls into a luminance meter's small round field."""

from typing import Final, Protocol

import numpy as np
from numpy.typing import NDArray

from labdaq import directions
from simulators.world.observed import SunSeen, World

Floats = NDArray[np.float64]

SUN_HALF_ANGLE_DEG: Final = 0.2665
SUN_SOLID_ANGLE_SR: Final = 2.0 * np.pi * (1.0 - np.cos(np.radians(SUN_HALF_ANGLE_DEG)))


class LuminanceResponse(Protocol):
    """What the meter's optics and detector make of the true luminance; the hook for concealed physics."""

    def __call__(self, luminance_cd_m2: float, sun: SunSeen, sun_angle_deg: float) -> float:
        """Luminance [cd/m²] as detected, given the field's mean, the sun, and its angle from the line of sight."""
        ...


def faithful(luminance_cd_m2: float, sun: SunSeen, sun_angle_deg: float) -> float:
    """A perfect meter."""
    return luminance_cd_m2


class MeterOptics:
    """A meter on its tripod, looking one way.

    Parameters
    ----------
    world
        What it looks at.
    altitude_deg, azimuth_deg
        Line of sight [deg].
    field_deg
        Full acceptance angle [deg].
    response
        What the meter makes of the field's mean.
    """

    def __init__(
        self,
        world: World,
        *,
        altitude_deg: float = 90.0,
        azimuth_deg: float = 0.0,
        field_deg: float = 1.0 / 3.0,
        response: LuminanceResponse = faithful,
    ) -> None:
        self._world = world
        self._axis = directions.sky_vector(altitude_deg, azimuth_deg)
        self._field = _disc_of_directions(self._axis, field_deg / 2.0)
        self._response = response

    def luminance(self, utc_ns: int) -> float:
        """Mean luminance of the field [cd/m²], the sun's disc included where it is in the field."""
        sun = self._world.sun(utc_ns)
        towards_sun = directions.sky_vector(sun.altitude_deg, sun.azimuth_deg)
        sky = self._world.sky_luminance(self._field, utc_ns)
        in_disc = directions.angle_between(self._field, towards_sun) < SUN_HALF_ANGLE_DEG
        disc = sun.normal_illuminance_lx / SUN_SOLID_ANGLE_SR if sun.altitude_deg > 0 else 0.0
        mean = float(np.mean(sky + np.where(in_disc, disc, 0.0)))
        return max(0.0, self._response(mean, sun, float(directions.angle_between(self._axis, towards_sun))))


def _disc_of_directions(axis: Floats, half_angle_deg: float, rings: int = 5) -> Floats:
    """Unit vectors (n, 3) that fill a small round field evenly: rings of equal width with 6k points in the k-th."""
    side = np.cross(axis, [0.0, 1.0, 0.0] if abs(axis[1]) < 0.9 else [1.0, 0.0, 0.0])
    side /= np.linalg.norm(side)
    other = np.cross(axis, side)
    points = [axis]
    for ring in range(1, rings):
        angle = np.radians(half_angle_deg) * ring / (rings - 0.5)
        turn = 2.0 * np.pi * np.arange(6 * ring) / (6 * ring)
        across = np.outer(np.cos(turn), side) + np.outer(np.sin(turn), other)
        points.extend(np.cos(angle) * axis + np.sin(angle) * across)
    return np.array(points)
