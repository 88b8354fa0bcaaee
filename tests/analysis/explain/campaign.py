"""An invented campaign: smooth images of sun and sky under two skylights, and what a recording of them went through.

Nothing here is taken from `analysis.explain`. The light is written as functions of direction, so that what an effect
does (a turned arm, say) is worked out by asking the function elsewhere, not by resampling a grid.
"""

import csv
from collections.abc import Callable
from dataclasses import dataclass, replace
from datetime import UTC, datetime, timedelta
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from analysis.cases import Case, write_case
from analysis.cases.model import CaseFile, Records
from analysis.photometry import Distribution
from analysis.photometry.lm63 import FileGeneration, render_lm63
from analysis.sky.sun import Site, sun_position

Floats = NDArray[np.float64]

GAMMAS = np.array([0.0, 5, 15, 25, 35, 45, 55, 65, 75, 85])
PLANES = np.arange(0.0, 360.0, 22.5)
DISTANCE_M = 2.6
ROOM_M = (5.486, 5.486, 5.486)
SITE = {"latitude_deg": 34.2176, "longitude_deg": -82.1084, "elevation_m": 180.0}

_KEYWORDS = {"TEST": "invented", "TESTLAB": "invented", "ISSUEDATE": "2010-07-22", "MANUFAC": "invented"}


@dataclass(frozen=True)
class Sky:
    """One test: a system under one sky, from ``start`` on."""

    id: str
    system: str
    start: datetime
    global_lx: float
    diffuse_lx: float
    sky: str

    @property
    def sun(self) -> tuple[float, float]:
        """Altitude and azimuth [deg] in the middle of the scan."""
        return _sun(self.start + timedelta(seconds=80))


@lru_cache(maxsize=64)
def _sun(moment: datetime) -> tuple[float, float]:
    ns = np.array([int(moment.timestamp()) * 1_000_000_000])
    seen = sun_position(ns, Site(SITE["latitude_deg"], SITE["longitude_deg"], SITE["elevation_m"]))
    return float(seen.altitude_deg[0]), float(seen.azimuth_deg[0])


def _at(day: int, hour: int, minute: int) -> datetime:
    return datetime(2010, 7, day, hour, minute, tzinfo=UTC)


TESTS = (
    Sky("T1", "box", _at(22, 13, 12), 45_000.0, 15_000.0, "clear"),
    Sky("T2", "box", _at(22, 17, 30), 98_000.0, 22_000.0, "clear"),
    Sky("T3", "box", _at(22, 21, 5), 41_000.0, 24_000.0, "partly-cloudy"),
    Sky("T4", "box", _at(23, 15, 0), 21_000.0, 20_500.0, "overcast"),
    Sky("T5", "tube", _at(23, 14, 2), 62_000.0, 14_000.0, "clear"),
    Sky("T6", "tube", _at(23, 18, 45), 86_000.0, 31_000.0, "partly-cloudy"),
    Sky("T7", "tube", _at(23, 21, 20), 33_000.0, 12_000.0, "clear"),
    Sky("T8", "tube", _at(24, 16, 0), 28_000.0, 27_000.0, "overcast"),
)
WITHHELD = (
    Sky("W1", "box", _at(25, 14, 30), 70_000.0, 19_000.0, "clear"),
    Sky("W2", "tube", _at(25, 20, 0), 61_000.0, 25_000.0, "partly-cloudy"),
)


@dataclass(frozen=True)
class Rows:
    """The readings of a campaign as arrays (N,): which test, which sensor, where and when."""

    tests: tuple[Sky, ...]
    test: NDArray[np.int64]
    ring: NDArray[np.int64]
    gamma_deg: Floats
    c_deg: Floats
    seconds: Floats

    def of_test(self, values: Callable[[Sky], float]) -> Floats:
        """A fact of each row's test; shape (N,)."""
        return np.array([values(t) for t in self.tests])[self.test]


def rows_of(tests: tuple[Sky, ...]) -> Rows:
    """All sensors at once, plane after plane, ten seconds each."""
    one = len(PLANES) * len(GAMMAS)
    plane, ring = np.divmod(np.arange(one), len(GAMMAS))
    count = len(tests)
    return Rows(
        tests,
        np.repeat(np.arange(count), one),
        np.tile(ring, count),
        np.tile(GAMMAS[ring], count),
        np.tile(PLANES[plane], count),
        np.tile(10.0 * plane + 5.0, count),
    )


def sun_part(test: Sky, gamma_deg: Floats, c_deg: Floats) -> Floats:
    """Invented intensity [cd] of the beam's light: an image opposite the sun, with a wide foot; shapes broadcast."""
    altitude, azimuth = test.sun
    beam = test.global_lx - test.diffuse_lx
    # light goes on away from the sun: towards azimuth + 180°, so C = 180° - azimuth
    tilt, width, bend = (0.75, 16.0, 0.35) if test.system == "box" else (0.5, 20.0, 0.15)
    away = _angle(gamma_deg, c_deg, tilt * (90.0 - altitude), 180.0 - azimuth)
    around = 1.0 + bend * np.cos(4.0 * np.radians(c_deg)) * np.sin(np.radians(gamma_deg)) ** 2
    image = np.exp(-0.5 * (away / width) ** 2) * around
    foot = 0.22 * np.maximum(np.cos(np.radians(gamma_deg)), 0.0) ** 1.5
    edge = np.clip((90.0 - np.asarray(gamma_deg)) / 12.0, 0.0, 1.0)
    return np.asarray(0.16 * beam * (image + foot) * edge)


def sky_part(test: Sky, gamma_deg: Floats, c_deg: Floats) -> Floats:
    """Invented intensity [cd] of the sky's light, a little brighter opposite the sun; shapes broadcast."""
    _, azimuth = test.sun
    power = 1.6 if test.system == "box" else 2.4
    tilt = 1.0 + 0.15 * np.sin(np.radians(gamma_deg)) * np.cos(np.radians(c_deg - (180.0 - azimuth)))
    return np.asarray(0.09 * test.diffuse_lx * np.maximum(np.cos(np.radians(gamma_deg)), 0.0) ** power * tilt)


def _angle(gamma_deg: Floats, c_deg: Floats, other_gamma: float, other_c: float) -> Floats:
    """Angle between directions [deg], by the spherical law of cosines."""
    a, b = np.radians(gamma_deg), np.radians(other_gamma)
    cosine = np.cos(a) * np.cos(b) + np.sin(a) * np.sin(b) * np.cos(np.radians(c_deg - other_c))
    return np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0)))


def part(rows: Rows, of: Callable[[Sky, Floats, Floats], Floats], gamma_deg: Floats, c_deg: Floats) -> Floats:
    """A part's intensity [cd] at a direction for each row (N,)."""
    values = np.zeros(len(rows.test))
    for k, test in enumerate(rows.tests):
        here = rows.test == k
        values[here] = of(test, gamma_deg[here], c_deg[here])
    return values


def light(rows: Rows, gamma_deg: Floats | None = None, c_deg: Floats | None = None) -> Floats:
    """Sun and sky together [cd] (N,), at the sensors or elsewhere; a negative gamma lies in the opposite plane."""
    gamma = rows.gamma_deg if gamma_deg is None else gamma_deg
    c = rows.c_deg if c_deg is None else c_deg
    c = np.where(gamma < 0, c + 180.0, c)
    gamma = np.abs(gamma)
    return part(rows, sun_part, gamma, c) + part(rows, sky_part, gamma, c)


@dataclass(frozen=True)
class Flaws:
    """What any recording and any simulation have, and no explanation should name."""

    noise: float = 0.01  # relative, standard
    floor_cd: float = 1.0
    gain_of_tests: float = 0.02
    gain_of_sensors: float = 0.006
    ripple: float = 0.012  # of the simulation's shape, per system


NONE = Flaws(0.0, 1.0, 0.0, 0.0, 0.0)

Truth = Callable[[Rows], Floats]


def make_case(
    folder: Path,
    truth: Truth = light,
    *,
    tests: tuple[Sky, ...] = TESTS,
    flaws: Flaws = Flaws(),
    seed: int = 1,
    files: bool = True,
    measured: bool = True,
    parts: bool = True,
    without: tuple[str, ...] = (),
    change: dict[str, Any] | None = None,
    more: dict[str, bytes] | None = None,
) -> Case:
    """Write a case whose recording is ``truth`` [cd] with ``flaws`` and whose prediction is `light`.

    ``without`` names tables of case.toml to leave out, ``change`` replaces tables, ``more`` are files that it names.
    """
    rows = rows_of(tests)
    exact = truth(rows)
    noise = np.hypot(flaws.noise * exact, flaws.floor_cd)
    records = Records(
        test=rows.test,
        channel=rows.ring,
        utc_ns=_times(rows),
        gamma_deg=rows.gamma_deg,
        c_deg=rows.c_deg,
        measured=recorded(rows, exact, flaws, seed) if measured else np.full(len(exact), np.nan),
        uncertainty=noise,
        simulated=light(rows),
        sun=part(rows, sun_part, rows.gamma_deg, rows.c_deg) if parts else np.full(len(exact), np.nan),
        sky=part(rows, sky_part, rows.gamma_deg, rows.c_deg) if parts else np.full(len(exact), np.nan),
    )
    table = _setup(tests, files) | (change or {})
    for name in without:
        del table[name]
    made = {name: content for t in tests for name, content in _files(t).items()} if files else {}
    return write_case(folder, CaseFile.model_validate(table), records, files=made | (more or {}), replace=True)


def recorded(rows: Rows, exact: Floats, flaws: Flaws, seed: int) -> Floats:
    """``exact`` [cd] as a flawed arm would record it."""
    rng = np.random.default_rng(seed)
    gains = np.exp(flaws.gain_of_tests * rng.standard_normal(len(rows.tests)))[rows.test]
    sensors = np.exp(flaws.gain_of_sensors * rng.standard_normal(len(GAMMAS)))[rows.ring]
    values = exact * gains * sensors
    for system in dict.fromkeys(t.system for t in rows.tests):
        here = np.array([t.system == system for t in rows.tests])[rows.test]
        values[here] *= np.exp(flaws.ripple * _waves(rows.gamma_deg[here], rows.c_deg[here], rng))
    if flaws.noise > 0:
        values = values + np.hypot(flaws.noise * exact, flaws.floor_cd) * rng.standard_normal(len(exact))
    return values


def _waves(gamma_deg: Floats, c_deg: Floats, rng: np.random.Generator) -> Floats:
    """A smooth random function of direction with unit variance: twelve plane waves through the sphere."""
    g, c = np.radians(gamma_deg), np.radians(c_deg)
    v = np.stack([np.sin(g) * np.cos(c), np.sin(g) * np.sin(c), np.cos(g)], axis=1)
    waves = rng.standard_normal((12, 3)) * 3.0
    return np.asarray(np.sqrt(2.0 / 12) * np.sum(np.cos(v @ waves.T + rng.uniform(0, 2 * np.pi, 12)), axis=1))


def _times(rows: Rows) -> NDArray[np.int64]:
    start = np.array([int(t.start.timestamp()) * 1_000_000_000 for t in rows.tests])
    return np.asarray(start[rows.test] + (1e9 * rows.seconds).astype(np.int64))


def _files(test: Sky) -> dict[str, bytes]:
    gamma, c = np.arange(0.0, 90.1, 2.5), np.arange(0.0, 360.1, 5.0)
    made = {}
    for name, of in (("sun", sun_part), ("sky", sky_part)):
        candela = of(test, gamma[None, :], c[:, None])
        candela[-1] = candela[0]
        made[f"simulated/{test.id}-{name}.ies"] = render_lm63(
            Distribution(gamma, c, candela, dict(_KEYWORDS)), generation=FileGeneration.SIMULATED
        )
    return made


def _setup(tests: tuple[Sky, ...], files: bool) -> dict[str, Any]:
    return {
        "format": "labdaq-case/1",
        "title": "invented <campaign> & more",
        "site": SITE,
        "room": {"size_m": ROOM_M},
        "goniometer": {
            "distance_m": DISTANCE_M,
            "gammas_deg": GAMMAS.tolist(),
            "c_planes_deg": PLANES.tolist(),
            "sensor_half_angle_deg": 60.0,
        },
        "simulation": {"engine": "invented", "field": "near"},
        "system": [
            {"id": "box", "kind": "box", "aperture": {"shape": "rectangle", "size_m": (0.6096, 0.6096)}},
            {"id": "tube", "kind": "tube", "aperture": {"shape": "disc", "diameter_m": 0.3556}},
        ],
        "channel": [
            {"id": f"gonio.g{g:02.0f}", "kind": "goniometer", "quantity": "luminous_intensity", "unit": "cd"}
            for g in GAMMAS
        ],
        "test": [_test(t, files) for t in tests],
    }


def _test(test: Sky, files: bool) -> dict[str, Any]:
    altitude, azimuth = test.sun
    table: dict[str, Any] = {
        "id": test.id,
        "system": test.system,
        "start": test.start,
        "end": test.start + timedelta(seconds=160),
        "sky": test.sky,
        "sun_altitude_deg": altitude,
        "sun_azimuth_deg": azimuth,
        "global_illuminance_lx": test.global_lx,
        "diffuse_illuminance_lx": test.diffuse_lx,
    }
    if files:
        table["simulated"] = {"sun": f"simulated/{test.id}-sun.ies", "sky": f"simulated/{test.id}-sky.ies"}
    return table


def named(tests: tuple[Sky, ...], **change: Any) -> tuple[Sky, ...]:
    """The tests with something changed in each."""
    return tuple(replace(t, **change) for t in tests)


def columns(text: str, *names: str) -> list[Floats]:
    """Columns of numbers of a CSV text."""
    table = list(csv.DictReader(text.splitlines()))
    return [np.array([float(row[n]) for row in table]) for n in names]
