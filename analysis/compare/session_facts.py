"""What a session tells about its test: times, sun, illuminances, calibration."""

from collections.abc import Sequence
from datetime import UTC, datetime, timedelta
from typing import Any

import numpy as np

from analysis.cases.model import Floats, Ints
from analysis.sky.sun import Site, sun_position
from labdaq.clock import NS
from labdaq.errors import DataError
from labdaq.reading import Instrument
from labdaq.session import Session
from labdaq.station import Station

_SKIES = ("clear", "partly-cloudy", "overcast")


def test_names(wanted: Sequence[str]) -> list[str]:
    """Ids for tests; the second of the same name gets ``-2``, and so on."""
    names: list[str] = []
    for name in wanted:
        made, k = name, 2
        while made in names:
            made, k = f"{name}-{k}", k + 1
        names.append(made)
    return names


test_names.__test__ = False  # type: ignore[attr-defined]  # not a test for pytest


def test_facts(session: Session, station: Station) -> dict[str, Any]:
    """System, start, end, sky, sun and mean illuminances of a session's scan, by the names of a case.

    Start and end are those of the arm's readings. Raises `DataError` when there are none.
    """
    window = scan_window(session, station)
    if window is None:
        raise DataError(f"{session.path}: holds no reading of the goniophotometer")
    start, end = window
    place = Site(station.site.latitude_deg, station.site.longitude_deg, station.site.elevation_m)
    sun = sun_position(np.array([(start + end) // 2]), place)
    facts: dict[str, Any] = {
        "system": session.header.system,
        "start": _moment(start),
        "end": _moment(end),
        "sun_altitude_deg": float(sun.altitude_deg[0]),
        "sun_azimuth_deg": float(sun.azimuth_deg[0]),
    }
    if session.header.sky in _SKIES:
        facts["sky"] = session.header.sky
    for name, channels in roof_channels(station).items():
        value = _mean(session, channels, start, end)
        if value is not None:
            facts[name] = value
    return facts


test_facts.__test__ = False  # type: ignore[attr-defined]  # not a test for pytest


def scan_window(session: Session, station: Station) -> tuple[int, int] | None:
    """From the start of the arm's first reading to the end of its last, UTC [ns]; ``None`` when there is none."""
    arm = [session.readings(c) for c in session.channels if c in station.goniometer.channels]
    if not arm:
        return None
    times = np.concatenate([r.utc_ns for r in arm])
    halves = np.concatenate([[round(one.duration_s * NS / 2) for one in r] for r in arm])
    return int((times - halves).min()), int((times + halves).max())


def certified(session: Session, instrument: Instrument) -> float:
    """What an instrument's readings are to be multiplied by: the factor of its certificate in force, else 1."""
    for certificate in session.header.certificates:
        if instrument.calibration and certificate.id == instrument.calibration:
            return certificate.factor
    return 1.0


def roof_channels(station: Station) -> dict[str, list[str]]:
    """Channels of the illuminance meters' heads, those behind a shading disc apart."""
    meters = [e for e in station.instrument if e.kind == "cl200"]
    shaded = [channel for m in meters for channel in m.heads if channel in m.shaded]
    free = [channel for m in meters for channel in m.heads if channel not in m.shaded]
    return {"global_illuminance_lx": free, "diffuse_illuminance_lx": shaded}


def _mean(session: Session, channels: Sequence[str], start: int, end: int) -> float | None:
    """Mean over the scan of the first channel that has a usable reading [lx], calibrated."""
    for channel in channels:
        readings = session.readings(channel)
        if not len(readings):
            continue
        value: Floats = readings.value * certified(session, readings[0].instrument)
        time: Ints = readings.utc_ns
        good = np.isfinite(value) & (time >= start) & (time <= end)
        if np.any(good):
            return float(value[good].mean())
    return None


def _moment(utc_ns: int) -> datetime:
    return datetime(1970, 1, 1, tzinfo=UTC) + timedelta(microseconds=utc_ns // 1000)
