"""A plain world: the sun where it is, a sky of two terms, and a skylight in closed form.

It knows no clouds, no Perez sky and no ray tracing; it is there so that emulated instruments have something sensible
to look at. Sources: NREL SPA through pvlib for the sun's place; the IES clear sky for the levels (IES Lighting
Handbook, 9th ed., chapter 8: beam 127.5 klx exp(-0.21 m), diffuse 0.8 + 15.5 sin^0.5 a klx); Kasten and Young 1989
for the air mass.
"""

import math
import threading
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from functools import cache
from typing import Final

import numpy as np
from numpy.typing import NDArray

from labdaq import directions
from labdaq.clock import NS
from simulators.world.observed import SunSeen

Floats = NDArray[np.float64]

NODE_S: Final = 30
"""The sun's place is computed every this many seconds and interpolated; the path's curvature leaves less than 1e-4
degrees."""

SUN_HALF_ANGLE_DEG: Final = 0.2665


@dataclass(frozen=True, slots=True)
class PlainOptions:
    """Where the world is and what is in it.

    Attributes
    ----------
    latitude_deg, longitude_deg, elevation_m
        The site; longitude east positive.
    extinction
        Luminous extinction per air mass; 0.21 is the IES clear sky, large values hide the sun.
    circumsolar_share
        Share of the sky's light that comes from the bright region round the sun.
    circumsolar_width_deg
        Standard deviation of that region [deg].
    transmittance, aperture_m2
        Of the skylight: flux into the room over flux on the aperture, and its area.
    lobe_share, lobe_width_deg
        Share of the transmitted beam that goes on in the sun's direction, and its spread [deg]; the rest, and all light
        of the sky, leaves like a Lambertian surface's.
    distance_m
        From the aperture to the goniophotometer's sensors.
    """

    latitude_deg: float = 34.2176
    longitude_deg: float = -82.1084
    elevation_m: float = 180.0
    extinction: float = 0.21
    circumsolar_share: float = 0.12
    circumsolar_width_deg: float = 12.0
    transmittance: float = 0.5
    aperture_m2: float = 0.6096**2
    lobe_share: float = 0.5
    lobe_width_deg: float = 15.0
    distance_m: float = 2.6


class PlainWorld:
    """Sun, sky, skylight and dark room by formula; see `PlainOptions`. May be asked from several threads."""

    def __init__(self, options: PlainOptions | None = None) -> None:
        self.options = options or PlainOptions()
        self._nodes: dict[int, tuple[float, float]] = {}
        self._lock = threading.Lock()

    # --- sun ---

    def sun(self, utc_ns: int) -> SunSeen:
        """Where the sun is and how bright."""
        node, rest_ns = divmod(utc_ns, NODE_S * NS)
        (alt0, az0), (alt1, az1) = self._node(node), self._node(node + 1)
        share = rest_ns / (NODE_S * NS)
        altitude = alt0 + share * (alt1 - alt0)
        azimuth = (az0 + share * ((az1 - az0 + 180.0) % 360.0 - 180.0)) % 360.0
        return SunSeen(altitude, azimuth, self._beam(altitude, utc_ns))

    def _node(self, node: int) -> tuple[float, float]:
        """Apparent altitude and azimuth [deg] at a multiple of `NODE_S`."""
        with self._lock:
            if node not in self._nodes:
                first = node // 20 * 20  # ten minutes at a time: pvlib's cost is in the call
                if len(self._nodes) > 100_000:
                    self._nodes.clear()
                self._nodes |= dict(zip(range(first, first + 20), self._places(first, 20), strict=True))
            return self._nodes[node]

    def _places(self, first: int, count: int) -> list[tuple[float, float]]:
        import pandas as pd
        import pvlib

        o = self.options
        begin = datetime(1970, 1, 1, tzinfo=UTC) + timedelta(seconds=first * NODE_S)
        times = pd.date_range(begin, periods=count, freq=f"{NODE_S}s")
        places = pvlib.solarposition.get_solarposition(
            times, o.latitude_deg, o.longitude_deg, altitude=o.elevation_m, method="nrel_numpy"
        )
        return list(zip(places["apparent_elevation"].tolist(), places["azimuth"].tolist(), strict=True))

    def _beam(self, altitude_deg: float, utc_ns: int) -> float:
        if altitude_deg <= 0:
            return 0.0
        air_mass = 1.0 / (math.sin(math.radians(altitude_deg)) + 0.50572 * (altitude_deg + 6.07995) ** -1.6364)
        day = (datetime(1970, 1, 1, tzinfo=UTC) + timedelta(seconds=utc_ns // NS)).timetuple().tm_yday
        return (
            127_500.0
            * (1 + 0.034 * math.cos(math.radians(360 / 365 * (day - 2))))
            * math.exp(-self.options.extinction * air_mass)
        )

    # --- sky ---

    def _levels(self, utc_ns: int) -> tuple[float, float, Floats]:
        """Luminance of the even part, of the circumsolar part at the sun [cd/m²], and the direction of the sun."""
        sun = self.sun(utc_ns)
        towards_sun = directions.sky_vector(max(sun.altitude_deg, 0.0), sun.azimuth_deg)
        diffuse = 15_500.0 * math.sqrt(max(0.0, math.sin(math.radians(sun.altitude_deg)))) + 800.0
        diffuse *= 1.0 / (1.0 + math.exp(-(sun.altitude_deg + 3.0)))  # fades through twilight
        share = self.options.circumsolar_share
        around, weight = self._cap(towards_sun, 0.0)
        unit = float(np.sum(self._glow(around, towards_sun) * weight * np.clip(around[:, 2], 0.0, None)))
        return (1.0 - share) * diffuse / math.pi, share * diffuse / unit, towards_sun

    def _glow(self, towards: Floats, towards_sun: Floats) -> Floats:
        """Circumsolar luminance relative to that at the sun: Gaussian in the chord."""
        chord2 = 2.0 - 2.0 * (towards @ towards_sun)
        glow: Floats = np.exp(-chord2 / (2.0 * math.radians(self.options.circumsolar_width_deg) ** 2))
        return glow

    def _cap(self, axis: Floats, inner_deg: float) -> tuple[Floats, Floats]:
        """Directions (n, 3) and solid angles (n,) [sr] round an axis, from ``inner_deg`` to five widths."""
        outer_deg = min(180.0, 5.0 * self.options.circumsolar_width_deg)
        polar, solid_angle = _rings(inner_deg, outer_deg)
        side = np.cross(axis, [0.0, 1.0, 0.0] if abs(axis[1]) < 0.9 else [1.0, 0.0, 0.0])
        side /= np.linalg.norm(side)
        frame = np.stack([side, np.cross(axis, side), axis])
        return polar @ frame, solid_angle

    def sky_luminance(self, directions: Floats, utc_ns: int) -> Floats:
        """Sky luminance without the sun's disc [cd/m²] towards unit vectors (..., 3); 0 below the horizon."""
        even, peak, towards_sun = self._levels(utc_ns)
        towards = np.asarray(directions, dtype=np.float64)
        return np.where(towards[..., 2] > 0, even + peak * self._glow(towards, towards_sun), 0.0)

    def roof_illuminance(self, normal: Floats, utc_ns: int, shaded_half_angle_deg: float = 0.0) -> float:
        """Illuminance [lx] on the roof for a sensor facing ``normal`` (3,), without what a disc hides."""
        even, peak, towards_sun = self._levels(utc_ns)
        n = np.asarray(normal, dtype=np.float64)
        total = math.pi * even * (1.0 + float(n[2])) / 2.0
        around, weight = self._cap(towards_sun, shaded_half_angle_deg)
        seen = np.clip(around @ n, 0.0, None) * (around[:, 2] > 0)
        total += peak * float(np.sum(self._glow(around, towards_sun) * weight * seen))
        facing = max(0.0, float(n @ towards_sun))
        if shaded_half_angle_deg > 0:
            return max(0.0, total - math.pi * even * math.sin(math.radians(shaded_half_angle_deg)) ** 2 * facing)
        return total + self.sun(utc_ns).normal_illuminance_lx * facing

    # --- skylight and room ---

    def room_illuminance(self, gamma_deg: Floats, c_deg: float, utc_ns: int) -> Floats:
        """Illuminance [lx] at the sensors (n,): candela over distance², far field."""
        return self.candela(gamma_deg, c_deg, utc_ns) / self.options.distance_m**2

    def candela(self, gamma_deg: Floats, c_deg: float, utc_ns: int) -> Floats:
        """Luminous intensity [cd] of the skylight in directions gamma (n,) and C [deg]."""
        o = self.options
        sun = self.sun(utc_ns)
        towards_sun = directions.sky_vector(max(sun.altitude_deg, 0.0), sun.azimuth_deg)
        beam = sun.normal_illuminance_lx * max(0.0, math.sin(math.radians(sun.altitude_deg)))
        flux = o.transmittance * o.aperture_m2
        total = self.roof_illuminance(np.array([0.0, 0.0, 1.0]), utc_ns)
        towards = directions.vector(gamma_deg, c_deg)
        cosine = np.clip(-towards[..., 2], 0.0, None)
        spread = flux * (total - o.lobe_share * beam) * cosine / math.pi
        width2 = 2.0 * math.radians(o.lobe_width_deg) ** 2
        chord2 = 2.0 - 2.0 * (towards @ -towards_sun)
        lobe = np.exp(-chord2 / width2) / (math.pi * width2) * (cosine > 0)
        candela: Floats = spread + flux * o.lobe_share * beam * lobe
        return candela


@cache
def _rings(inner_deg: float, outer_deg: float) -> tuple[Floats, Floats]:
    """Directions about the z axis and their solid angles: Gauss-Legendre in the polar angle, even in azimuth."""
    nodes, weights = np.polynomial.legendre.leggauss(40)
    half = math.radians(outer_deg - inner_deg) / 2.0
    polar = math.radians(inner_deg) + half * (nodes + 1.0)
    turn = 2.0 * np.pi * np.arange(48) / 48
    theta, phi = (a.ravel() for a in np.meshgrid(polar, turn, indexing="ij"))
    solid_angle = np.repeat(weights * half * np.sin(polar) * 2.0 * np.pi / 48, 48)
    return np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)], axis=-1), solid_angle


def build_world(options: PlainOptions | None = None) -> PlainWorld:
    """The world that `labdaq emulate` shows to its instruments."""
    return PlainWorld(options)
