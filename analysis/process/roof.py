"""The roof's readings of a session, as the processing of its sky and of its scan need them."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from analysis.compare.session_facts import certified, roof_channels, scan_window
from analysis.sky.process import Readings
from analysis.sky.sun import Site
from labdaq.session import Session
from labdaq.station import Station

Ints = NDArray[np.int64]


@dataclass(frozen=True)
class Window:
    """The time of a test, UTC [ns]: that of the arm's scan, or of all readings where there is none."""

    start_ns: int
    end_ns: int

    @property
    def middle_ns(self) -> int:
        """Where the sun is placed."""
        return (self.start_ns + self.end_ns) // 2

    def holds(self, utc_ns: Ints) -> NDArray[np.bool_]:
        """Which times lie in it."""
        return (utc_ns >= self.start_ns) & (utc_ns <= self.end_ns)


def window_of(session: Session, station: Station) -> Window | None:
    """The time of a session's test; ``None`` for a session without readings."""
    scanned = scan_window(session, station)
    if scanned is not None:
        return Window(*scanned)
    times = session.readings().utc_ns
    return Window(int(times.min()), int(times.max())) if len(times) else None


def site_of(station: Station) -> Site:
    """Where the station stands."""
    return Site(station.site.latitude_deg, station.site.longitude_deg, station.site.elevation_m)


def global_channels(station: Station) -> Sequence[str]:
    """Channels of the illuminance meters' heads that stand free."""
    return roof_channels(station)["global_illuminance_lx"]


def diffuse_channels(station: Station) -> Sequence[str]:
    """Channels of the heads behind a shading disc."""
    return roof_channels(station)["diffuse_illuminance_lx"]


def zenith_channels(station: Station) -> Sequence[str]:
    """Channels of the luminance meters."""
    return [meter.channel for meter in station.of_kind("ls110") if meter.kind == "ls110"]


def meter(session: Session, channels: Sequence[str], window: Window | None = None) -> Readings | None:
    """The usable readings of the first channel that has any within the window, times its certificate's factor."""
    for channel in channels:
        readings = session.readings(channel)
        good = np.isfinite(readings.value)
        if window is not None:
            good &= window.holds(readings.utc_ns)
        if np.any(good):
            factor = certified(session, readings[0].instrument)
            spread = np.nan_to_num(readings.uncertainty[good]) * factor
            return Readings.of(readings.utc_ns[good], readings.value[good] * factor, spread)
    return None
