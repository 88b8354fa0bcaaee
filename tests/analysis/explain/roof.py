"""Invented roofs: illuminance meters over two days, and a fisheye camera under four skies."""

from datetime import timedelta
from pathlib import Path
from typing import Any

import numpy as np

from analysis.cases import Case, write_case
from analysis.cases.model import CaseFile, Records
from analysis.sky.sun import Site, sun_position
from tests.analysis.explain.campaign import SITE, Floats, Sky, _at

ROOF_TESTS = tuple(
    Sky(f"R{day}{hour}", "", _at(day, hour, 20), 0.0, 0.0, "clear") for day in (22, 23) for hour in range(12, 23)
)
SKY_TESTS = (
    Sky("S1", "", _at(22, 13, 30), 60_000.0, 12_000.0, "clear"),
    Sky("S2", "", _at(22, 17, 0), 95_000.0, 18_000.0, "clear"),
    Sky("S3", "", _at(22, 20, 30), 50_000.0, 26_000.0, "partly-cloudy"),
    Sky("S4", "", _at(23, 15, 0), 24_000.0, 23_500.0, "overcast"),
)


def sun_of(tests: tuple[Sky, ...], seconds: float) -> tuple[Floats, Floats]:
    """Altitude and azimuth [deg] ``seconds`` after each test's start; (T,), (T,)."""
    ns = np.array([int(t.start.timestamp()) * 10**9 for t in tests]) + int(seconds * 1e9)
    seen = sun_position(ns, Site(SITE["latitude_deg"], SITE["longitude_deg"], SITE["elevation_m"]))
    return np.asarray(seen.altitude_deg), np.asarray(seen.azimuth_deg)


def beam_and_sky(altitude_deg: Floats) -> tuple[Floats, Floats]:
    """Invented horizontal beam and diffuse illuminance [lx] of a clear day; no air-mass model is followed."""
    up = np.sin(np.radians(altitude_deg))
    return 100_000.0 * up * np.exp(-0.2 / up), 9_000.0 + 9_000.0 * up


def roof_case(folder: Path, readings: dict[str, Floats], change: dict[str, Any] | None = None) -> Case:
    """Two meters, one reading each in every test; ``readings`` [lx] by channel id, else as predicted."""
    altitude, azimuth = sun_of(ROOF_TESTS, 60.0)
    beam, sky = beam_and_sky(altitude)
    count, names = len(ROOF_TESTS), ("velux", "konica")
    measured = np.concatenate([readings.get(n, beam + sky) for n in names])
    times = np.array([int(t.start.timestamp() + 60) * 10**9 for t in ROOF_TESTS])
    unknown = np.full(2 * count, np.nan)
    records = Records(
        test=np.tile(np.arange(count), 2),
        channel=np.repeat([0, 1], count),
        utc_ns=np.tile(times, 2),
        gamma_deg=unknown,
        c_deg=unknown,
        measured=measured,
        uncertainty=0.002 * np.tile(beam + sky, 2),
        simulated=np.tile(beam + sky, 2),
        sun=np.tile(beam, 2),
        sky=np.tile(sky, 2),
    )
    table = {
        "format": "labdaq-case/1",
        "site": SITE,
        "channel": [{"id": n, "kind": "illuminance-meter", "quantity": "illuminance", "unit": "lx"} for n in names],
        "test": [
            {"id": t.id, "start": t.start, "end": t.start + timedelta(seconds=120), "sky": t.sky,
             "sun_altitude_deg": float(a), "sun_azimuth_deg": float(z),
             "global_illuminance_lx": float(b + s), "diffuse_illuminance_lx": float(s)}
            for t, a, z, b, s in zip(ROOF_TESTS, altitude, azimuth, beam, sky, strict=True)
        ],
    }  # fmt: skip
    return write_case(folder, CaseFile.model_validate(table | (change or {})), records, replace=True)


def picture_points() -> tuple[Floats, Floats]:
    """Zenith angle and azimuth [deg] of forty places of the picture."""
    zenith = np.concatenate([[0.0], np.full(9, 20.0), np.full(12, 45.0), np.full(18, 70.0)])
    azimuth = np.concatenate([[0.0], np.arange(9) * 40.0, np.arange(12) * 30.0, np.arange(18) * 20.0])
    return zenith, azimuth


def luminance(test: Sky, zenith_deg: Floats, azimuth_deg: Floats) -> Floats:
    """Invented luminance [cd/m²], brighter towards the horizon and the sun."""
    altitude, azimuth = test.sun
    away = sun_distance(zenith_deg, azimuth_deg, altitude, azimuth)
    glow = 0.0 if test.sky == "overcast" else 3.0 * np.exp(-away / 25.0)
    return np.asarray(test.diffuse_lx / np.pi * (0.7 + 0.4 * (zenith_deg / 90.0) ** 2 + glow))


def sun_distance(zenith_deg: Floats, azimuth_deg: Floats, altitude: float, azimuth: float) -> Floats:
    """Angle from the sun [deg] by the spherical law of cosines."""
    z, h = np.radians(zenith_deg), np.radians(altitude)
    cosine = np.cos(z) * np.sin(h) + np.sin(z) * np.cos(h) * np.cos(np.radians(azimuth_deg - azimuth))
    return np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0)))


def sky_case(folder: Path, measured: Floats | None = None, kind: str = "camera") -> Case:
    """Luminance readings of the sky, forty a test; ``measured`` (160,) [cd/m²], else as predicted."""
    zenith, azimuth = picture_points()
    predicted = np.concatenate([luminance(t, zenith, azimuth) for t in SKY_TESTS])
    n, count = len(zenith), len(SKY_TESTS)
    records = Records(
        test=np.repeat(np.arange(count), n),
        channel=np.zeros(n * count, dtype=np.int64),
        utc_ns=np.repeat([int(t.start.timestamp() + 80) * 10**9 for t in SKY_TESTS], n),
        gamma_deg=np.tile(180.0 - zenith, count),
        c_deg=np.tile((360.0 - azimuth) % 360.0, count),
        measured=predicted if measured is None else measured,
        uncertainty=0.01 * predicted,
        simulated=predicted,
        sun=np.full(n * count, np.nan),
        sky=np.full(n * count, np.nan),
    )
    setup = sky_setup(("sky",), kind, timedelta(seconds=160))
    return write_case(folder, setup, records, replace=True)


def sky_setup(channels: tuple[str, ...], kind: str, lasting: timedelta) -> CaseFile:
    """Luminance channels of one ``kind`` under the four skies, each ``lasting`` so long."""
    table = {
        "format": "labdaq-case/1",
        "site": SITE,
        "channel": [{"id": n, "kind": kind, "quantity": "luminance", "unit": "cd/m2"} for n in channels],
        "test": [
            {"id": t.id, "start": t.start, "end": t.start + lasting, "sky": t.sky,
             "sun_altitude_deg": t.sun[0], "sun_azimuth_deg": t.sun[1],
             "global_illuminance_lx": t.global_lx, "diffuse_illuminance_lx": t.diffuse_lx}
            for t in SKY_TESTS
        ],
    }  # fmt: skip
    return CaseFile.model_validate(table)
