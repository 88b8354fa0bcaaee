"""Sun and sky over the station, and what conceals itself in them.

A `Light` says at any instant where the sun is and how bright, and how bright the sky is in any direction. Faults are
lights that look at another light through something: a late clock, a halo about the sun, cloud that drifts, a building.
"""

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from labdaq.clock import NS
from labdaq.directions import sky_vector
from simulators.hidden.perez import SOLAR_LX, clearness_brightness, relative_luminance
from simulators.hidden.symmetry import IDENTITY, sky_nodes

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Sun:
    """The sun at an instant: unit vector towards it, and illuminance facing it [lx]."""

    direction: Floats
    normal_lx: float


class Light(Protocol):
    """Sun and sky at any instant (UTC in nanoseconds)."""

    def sun(self, utc_ns: int) -> Sun:
        """Where the sun is and how bright."""
        ...

    def diffuse(self, utc_ns: int) -> float:
        """Horizontal illuminance from the sky [lx]."""
        ...

    def luminance(self, directions: Floats, utc_ns: int) -> Floats:
        """Sky luminance without the sun's disc [cd/m²] towards unit vectors (..., 3)."""
        ...


@dataclass(frozen=True)
class Site:
    """A place on Earth: latitude and longitude (east positive) [deg], elevation [m]."""

    latitude_deg: float
    longitude_deg: float
    elevation_m: float


def sun_angles(site: Site, utc_ns: NDArray[np.int64]) -> tuple[Floats, Floats]:
    """Apparent altitude and azimuth [deg] of the sun at UTC times (n,), by pvlib's NREL SPA."""
    import pandas as pd
    from pvlib import solarposition

    times = pd.DatetimeIndex(pd.to_datetime(np.asarray(utc_ns), unit="ns", utc=True))
    found = solarposition.get_solarposition(
        times, site.latitude_deg, site.longitude_deg, altitude=site.elevation_m, method="nrel_numpy"
    )
    return found["apparent_elevation"].to_numpy(), found["azimuth"].to_numpy()


class SunTable:
    """The sun over some hours, from positions every two minutes and cubic interpolation between (error below 1e-4°)."""

    def __init__(self, site: Site, first_ns: int, last_ns: int) -> None:
        from scipy.interpolate import CubicSpline

        step = 120 * NS
        grid = np.arange(first_ns - 4 * step, last_ns + 5 * step, step)
        altitude, azimuth = sun_angles(site, grid)
        self._zero = int(grid[0])
        self._spline = CubicSpline((grid - grid[0]) / NS, sky_vector(altitude, azimuth))

    def __call__(self, utc_ns: int) -> Floats:
        """Unit vector towards the sun (3,)."""
        v = self._spline((utc_ns - self._zero) / NS)
        return np.asarray(v / np.linalg.norm(v))


@dataclass(frozen=True)
class PerezLight:
    """A steady Perez sky whose sun moves; illuminances hold at ``utc_ns`` and follow the sun's height from there.

    Attributes
    ----------
    table
        The sun's path.
    utc_ns
        The instant for which the illuminances are given.
    normal_lx, diffuse_lx
        Beam facing the sun, and horizontal diffuse illuminance [lx].
    """

    table: SunTable
    utc_ns: int
    normal_lx: float
    diffuse_lx: float

    def sun(self, utc_ns: int) -> Sun:
        """Sun at an instant; the beam follows Bouguer's law with the optical depth of the given instant."""
        here, now = self.table(self.utc_ns), self.table(utc_ns)
        depth = -math.log(max(1e-3, min(0.95, self.normal_lx / SOLAR_LX))) / air_mass(here)
        return Sun(now, self.normal_lx * math.exp(-depth * (air_mass(now) - air_mass(here))))

    def diffuse(self, utc_ns: int) -> float:
        """Horizontal diffuse illuminance [lx]; it follows the sine of the sun's height to the power 0.6."""
        here, now = self.table(self.utc_ns), self.table(utc_ns)
        return float(self.diffuse_lx * (max(0.02, float(now[2])) / max(0.02, float(here[2]))) ** 0.6)

    def luminance(self, directions: Floats, utc_ns: int) -> Floats:
        """Perez luminance with its type held, scaled so that its horizontal illuminance is the diffuse."""
        sun = self.table(utc_ns)
        altitude = math.degrees(math.asin(self.table(self.utc_ns)[2]))
        clearness, brightness = clearness_brightness(self.normal_lx, self.diffuse_lx, altitude)
        scale = self.diffuse(utc_ns) / _perez_level(tuple(np.round(sun, 9)), clearness, brightness)
        return scale * relative_luminance(directions, sun, clearness, brightness)


@lru_cache(maxsize=4096)
def _perez_level(sun: tuple[float, ...], clearness: float, brightness: float) -> float:
    """Horizontal illuminance of the relative distribution, on the grid of about 2500 directions that responses use."""
    nodes = sky_nodes(57, (IDENTITY,))
    value = relative_luminance(nodes.directions, np.array(sun), clearness, brightness)
    return float(np.sum(value * nodes.directions[:, 2] * nodes.solid_angle))


def air_mass(direction: Floats) -> float:
    """Relative air mass towards a direction (Kasten and Young 1989, doi:10.1364/AO.28.004735)."""
    height = max(0.0, float(direction[2]))
    altitude = math.degrees(math.asin(height))
    return float(1.0 / (height + 0.50572 * (altitude + 6.07995) ** -1.6364))


def clear_day(altitude_deg: float, turbidity: float) -> tuple[float, float]:
    """Beam (facing the sun) and diffuse illuminance [lx] of a clear day, for a Linke turbidity.

    Beam: Bouguer's law with Kasten's (1996, doi:10.1016/0038-092X(95)00114-7) clean-air optical depth. Diffuse: a
    little less than half of what the beam lost comes down, as in the report's tests.
    """
    height = math.sin(math.radians(altitude_deg))
    m = 1.0 / (height + 0.50572 * (altitude_deg + 6.07995) ** -1.6364)
    clean = 1.0 / (6.6296 + m * (1.7513 + m * (-0.1202 + m * (0.0065 - 0.00013 * m))))
    beam = SOLAR_LX * math.exp(-0.8662 * turbidity * m * clean)
    return beam, 0.44 * (SOLAR_LX - beam) * height
