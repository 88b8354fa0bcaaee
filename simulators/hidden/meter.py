"""An illuminance meter on the roof as it really is: crooked, with a response of its own, late, near its range's end."""

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from labdaq.clock import NS
from labdaq.directions import sky_vector
from simulators.hidden.heads import HeadFaults, angular_response, bent, ended, lagging
from simulators.hidden.light_faults import FaultedLight
from simulators.hidden.symmetry import IDENTITY, sky_nodes

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class MeterFaults:
    """How a roof meter differs from a perfect one.

    Attributes
    ----------
    tilt_deg, tilt_azimuth_deg
        How far its normal leans from the zenith, and towards which compass direction [deg].
    gain
        Calibration factor error: reading over truth.
    heads
        Angular response, curve, dark reading, lag and end of range, as for other heads (levels in lx).
    clock_s
        Its clock shows this much less than the true time [s].
    shadow
        Compass from, to, and altitude [deg] of a mast or chimney; 0, 0, 0 for none.
    facade
        Extra light from a bright wall: share of the beam it throws back, and the compass direction it stands in [deg].
    dew
        Share of the beam that dew on the dome scatters away until `dew_until_s` seconds after the first record of
        the day.
    kelvin_amplitude, per_k
        Daily course of the head's temperature (warmest at 15 h solar time), and its coefficient [1/K].
    """

    tilt_deg: float = 0.0
    tilt_azimuth_deg: float = 0.0
    gain: float = 1.0
    heads: HeadFaults = field(default_factory=HeadFaults)
    clock_s: float = 0.0
    shadow: tuple[float, float, float] = (0.0, 0.0, 0.0)
    facade: tuple[float, float] = (0.0, 0.0)
    dew: float = 0.0
    dew_until_s: float = 0.0
    kelvin_amplitude: float = 0.0
    per_k: float = 0.0


class SkySeries:
    """Sun and sky at a series of instants, kept so that many meters can look at them.

    Parameters
    ----------
    light
        The light.
    utc_ns
        Instants (n,) [ns].
    """

    def __init__(self, light: FaultedLight, utc_ns: NDArray[np.int64]) -> None:
        self.nodes = sky_nodes(39, (IDENTITY,))
        self.utc_ns = utc_ns
        suns = [light.sun(int(t)) for t in utc_ns]
        self.sun = np.array([s.direction for s in suns])
        self.normal_lx = np.array([s.normal_lx for s in suns])
        self.luminance = np.stack([light.luminance(self.nodes.directions, int(t)) for t in utc_ns])

    def parts(self) -> tuple[Floats, Floats]:
        """Horizontal illuminance from sun and from sky [lx], (n,) each: what a perfect meter reads."""
        weight = self.nodes.directions[:, 2] * self.nodes.solid_angle
        return self.normal_lx * self.sun[:, 2], self.luminance @ weight


def seconds_of_day(utc_ns: NDArray[np.int64], longitude_deg: float) -> Floats:
    """Mean solar time since midnight [s]."""
    return np.asarray((utc_ns / NS + longitude_deg * 240.0) % 86_400.0)


def read_meter(series: SkySeries, faults: MeterFaults, longitude_deg: float, albedo: float) -> Floats:
    """Readings [lx] without noise of a meter with faults, at the series' instants (taken as true time)."""
    normal = sky_vector(90.0 - faults.tilt_deg, faults.tilt_azimuth_deg)
    heads = faults.heads
    to_sky = np.maximum(0.0, series.nodes.directions @ normal)
    response = angular_response(to_sky, heads.response, heads.response_form) if heads.response else 1.0
    sky = series.luminance @ (to_sky * response * series.nodes.solid_angle)
    to_sun = np.maximum(0.0, series.sun @ normal)
    beam = series.normal_lx * to_sun
    if heads.response:
        beam = beam * angular_response(to_sun, heads.response, heads.response_form)
    beam = beam * _unhidden(series.sun, faults) * (1.0 - faults.dew * _dewy(series.utc_ns, faults, longitude_deg))
    horizontal = sum(series.parts())
    ground = albedo * horizontal * 0.5 * (1.0 - math.cos(math.radians(faults.tilt_deg)))
    level = sky + beam + ground + _thrown_back(series, faults)
    value = ended(bent(np.asarray(level), heads), heads.end_lx, heads.end_form) * faults.gain
    if faults.per_k:
        hours = seconds_of_day(series.utc_ns, longitude_deg) / 3600.0
        kelvin = faults.kelvin_amplitude * np.cos(2.0 * math.pi * (hours - 15.0) / 24.0)
        value = value * (1.0 + faults.per_k * kelvin)
    value = value + heads.dark_lx
    if heads.lag_s:
        value = lagging(value, (series.utc_ns - series.utc_ns[0]) / NS, heads.lag_s)
    return value


def _unhidden(sun: Floats, faults: MeterFaults) -> Floats:
    first, last, altitude = faults.shadow
    azimuth = np.degrees(np.arctan2(sun[:, 0], sun[:, 1]))
    behind = (azimuth - first) % 360.0 < (last - first) % 360.0
    low = sun[:, 2] < math.sin(math.radians(altitude))
    return np.where(behind & low, 0.0, 1.0)


def _dewy(utc_ns: NDArray[np.int64], faults: MeterFaults, longitude_deg: float) -> Floats:
    if not faults.dew:
        return np.zeros(len(utc_ns))
    seconds = seconds_of_day(utc_ns, longitude_deg)
    day = np.floor((utc_ns / NS + longitude_deg * 240.0) / 86_400.0)
    result = np.zeros(len(utc_ns))
    for d in np.unique(day):
        mine = day == d
        since = seconds[mine] - seconds[mine].min()
        result[mine] = np.clip(1.0 - since / max(1.0, faults.dew_until_s), 0.0, 1.0)
    return result


def _thrown_back(series: SkySeries, faults: MeterFaults) -> Floats:
    """A vertical wall throws light at the meter while the sun shines on it (mirror-like about its normal)."""
    share, stands = faults.facade
    if not share:
        return np.zeros(len(series.utc_ns))
    towards = sky_vector(0.0, stands)  # from the meter to the wall
    lit = np.maximum(0.0, -(series.sun @ towards))
    return np.asarray(share * series.normal_lx * lit**4 * series.sun[:, 2])
