"""Where the sun is, and how far away.

Positions come from the NREL solar position algorithm (Reda and Andreas 2004, Solar Energy 76:577, in pvlib's numpy
form), good to 0.0003° in the years 2000 to 6000. Refraction matters for the disc one sees (+0.03° at 31° altitude),
while air mass formulas want the geometric altitude, so both are given.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from labdaq.directions import sky_vector

Floats = NDArray[np.float64]

SUN_HALF_ANGLE_DEG: Final = 0.2665
"""Half the angle the sun's disc subtends at the mean distance [deg]."""

_NS_PER_DAY: Final = 86_400 * 1_000_000_000


@dataclass(frozen=True, slots=True)
class Site:
    """A place on the ground.

    Attributes
    ----------
    latitude_deg, longitude_deg
        North and east positive [deg].
    elevation_m
        Above sea level [m]; sets the pressure that refracts.
    temperature_c
        Air temperature [°C]; has a small effect on refraction only.
    """

    latitude_deg: float
    longitude_deg: float
    elevation_m: float = 0.0
    temperature_c: float = 20.0

    @property
    def pressure_pa(self) -> float:
        """Mean air pressure [Pa] at the elevation: U.S. Standard Atmosphere 1976, below 11 km."""
        return float(101_325.0 * (1.0 - 2.25577e-5 * self.elevation_m) ** 5.25588)


GREENWOOD: Final = Site(34.2176, -82.1084, 180.0)
"""The Velux laboratory in Greenwood, South Carolina, where the 32 tests of July 2010 were made."""


@dataclass(frozen=True, slots=True)
class SunPosition:
    """Sun at one or many instants; all arrays have the shape of the times asked for.

    Attributes
    ----------
    altitude_deg
        As seen, refraction included [deg].
    geometric_altitude_deg
        Without refraction [deg]; for air mass and for sky models.
    azimuth_deg
        From north through east [deg, 0 to 360).
    """

    altitude_deg: Floats
    geometric_altitude_deg: Floats
    azimuth_deg: Floats

    @property
    def vector(self) -> Floats:
        """Unit vector towards the disc (..., 3), x east, y north, z up."""
        return sky_vector(self.altitude_deg, self.azimuth_deg)


def sun_position(utc_ns: ArrayLike, site: Site) -> SunPosition:
    """Sun seen from ``site`` at UTC ``utc_ns`` [ns since 1970], any shape.

    The difference of terrestrial time to UTC is taken for the middle of the times given; a second of it moves the sun
    by 1e-5 degrees only.
    """
    from pvlib import spa  # over a second to import, so not before it is needed

    times = np.asarray(utc_ns, dtype=np.int64)
    seconds = times.ravel() / 1e9
    year = 1970.0 + (float(seconds.mean()) / 86_400.0 / 365.2425 if seconds.size else 0.0)
    delta_t = float(spa.calculate_deltat(int(year), int(year % 1.0 * 12.0) + 1))
    apparent_zenith, zenith, _, _, azimuth, _ = spa.solar_position(
        seconds,
        site.latitude_deg,
        site.longitude_deg,
        site.elevation_m,
        site.pressure_pa / 100.0,
        site.temperature_c,
        delta_t,
        0.5667,
    )
    return SunPosition(
        altitude_deg=(90.0 - np.asarray(apparent_zenith)).reshape(times.shape),
        geometric_altitude_deg=(90.0 - np.asarray(zenith)).reshape(times.shape),
        azimuth_deg=(np.asarray(azimuth) % 360.0).reshape(times.shape),
    )


def distance_factor(utc_ns: ArrayLike) -> Floats:
    """Mean squared distance of the sun over the present one, (r0/r)², at UTC [ns].

    Fourier series of Spencer (1971, Search 2:172), good to 0.01 %.
    """
    days = np.asarray(utc_ns, dtype=np.int64) // _NS_PER_DAY
    year = days.astype("datetime64[D]").astype("datetime64[Y]").astype("datetime64[D]").astype(np.int64)
    x = 2.0 * np.pi * (days - year) / 365.0
    factor: Floats = (
        1.00011 + 0.034221 * np.cos(x) + 0.00128 * np.sin(x) + 0.000719 * np.cos(2 * x) + 0.000077 * np.sin(2 * x)
    )
    return factor
