"""Tables of moments: where the sun was, and how much light came from it and from the sky.

* ``.csv`` with a line of names: ``time`` (ISO 8601; UTC where it says no zone) or ``sun_altitude_deg`` and
  ``sun_azimuth_deg``, or all three; ``diffuse_lx``; ``global_lx`` where there is a sun. Other columns are not read.
* ``.epw``, the hourly weather of a year for EnergyPlus (Auxiliary Programs: EnergyPlus Weather File Data Dictionary).
  Irradiances become illuminances by Perez's luminous efficacies (1990, doi:10.1016/0038-092X(90)90055-H) with the
  water that the dew point tells; the file's own illuminances, which many files lack, are not read. The sun stands
  where it is in the middle of the hour.
"""

import csv
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from analysis.sky.clearness import beam_efficacy, diffuse_efficacy, from_irradiances
from analysis.sky.sun import Site, distance_factor, sun_position
from labdaq.clock import utc_ns_of, utc_text
from labdaq.errors import DataError, Problems

Floats = NDArray[np.float64]

FORM: Final = (
    "name the columns time (e.g. 2010-07-22T13:12:00Z) or sun_altitude_deg,sun_azimuth_deg, then global_lx,diffuse_lx; "
    "or give an .epw file"
)
SUN: Final = ("sun_altitude_deg", "sun_azimuth_deg")
MOST_TOLD: Final = 20
"""Mistakes of one file that are listed."""

_HEAD: Final = 8
"""Lines of an .epw before its hours."""

_USED: Final = {"dni": (0.0, 1500.0), "dhi": (0.0, 1500.0), "temp_dew": (-99.0, 100.0)}
"""pvlib's names of what is used: normal and diffuse irradiance [W/m²], dew point [°C]; and what they may be."""


@dataclass(frozen=True, eq=False)
class Moments:
    """Suns and illuminances.

    Attributes
    ----------
    times
        UTC as text, empty where none was told.
    altitude_deg, azimuth_deg : shape (n,) [deg]
        Sun as seen; azimuth from north through east.
    beam_lx, diffuse_lx : shape (n,) [lx]
        On the horizontal.
    """

    times: tuple[str, ...]
    altitude_deg: Floats
    azimuth_deg: Floats
    beam_lx: Floats
    diffuse_lx: Floats


def read_moments(path: Path, site: Site) -> Moments:
    """Read a table by its suffix; ``site`` places the sun for a table of times (an .epw has its own).

    Raises one `DataError` with the file, and line and column of each mistake.
    """
    if path.suffix.lower() == ".epw":
        return _weather(path)
    if path.suffix.lower() != ".csv":
        raise DataError(f"{path}: a table of moments ends in .csv or .epw", FORM)
    try:
        with path.open(encoding="utf-8-sig", errors="replace", newline="") as file:
            return _table(path, list(csv.reader(file)), site)
    except (OSError, csv.Error) as error:
        raise DataError(f"{path}: {error}", FORM) from error


def _table(path: Path, rows: list[list[str]], site: Site) -> Moments:
    names = [name.strip() for name in rows[0]] if rows else []
    placed = set(SUN) <= set(names)
    missing = [] if placed or "time" in names else ["time"]
    missing += [] if "diffuse_lx" in names else ["diffuse_lx"]
    if missing:
        raise DataError(f"{path}, line 1: no column {' and '.join(missing)} in {', '.join(names) or 'nothing'}", FORM)
    problems = Problems(str(path))
    times, values = [], []
    for line, row in enumerate(rows[1:], 2):
        if not any(word.strip() for word in row):
            continue
        cells = dict(zip(names, (word.strip() for word in row), strict=False))
        ask = _asker(cells, line, problems)
        times.append(_time(cells["time"], line, problems) if cells.get("time") or not placed else None)
        sun = (ask(SUN[0], -90.0, 90.0), ask(SUN[1], -360.0, 360.0)) if placed else (0.0, 0.0)
        diffuse = ask("diffuse_lx", 0.0, 2e5)
        total = ask("global_lx", 0.0, 2e5) if "global_lx" in names else diffuse
        if total < 0.98 * diffuse:
            problems.add(f"line {line}: global_lx", f"{total:g} is less than the diffuse {diffuse:g}")
        if placed and total > diffuse and sun[0] <= 0.0:
            problems.add(f"line {line}: {SUN[0]}", f"a beam of {total - diffuse:g} lx from a sun at {sun[0]:g} degrees")
        values.append((*sun, max(total - diffuse, 0.0), diffuse))
        if len(problems.found) >= MOST_TOLD:
            break
    problems.raise_if_any(DataError, FORM)
    if not values:
        raise DataError(f"{path}: no moments below its line of names", FORM)
    altitude, azimuth, beam, diffuse_lx = np.array(values, dtype=np.float64).T
    if not placed:
        seen = sun_position(np.array(times, dtype=np.int64), site)
        altitude, azimuth = seen.altitude_deg, seen.azimuth_deg
        for k in np.flatnonzero((beam > 0.0) & (altitude <= 0.0))[:MOST_TOLD]:
            when = utc_text(int(times[k] or 0))
            problems.add(when, f"a beam of {beam[k]:g} lx from a sun at {altitude[k]:.2f} degrees (site, time in UTC?)")
        problems.raise_if_any(DataError, "check --site and the zone of the times, or let global be diffuse")
    texts = tuple("" if ns is None else utc_text(ns) for ns in times)
    return Moments(texts, altitude, azimuth, beam, diffuse_lx)


def _asker(cells: Mapping[str, str], line: int, problems: Problems) -> Callable[[str, float, float], float]:
    def ask(name: str, low: float, high: float) -> float:
        text = cells.get(name, "")
        try:
            value = float(text)
        except ValueError:
            value = math.nan
        if not low <= value <= high:
            problems.add(f"line {line}: {name}", f"{text!r} is not a number from {low:g} to {high:g}")
            return low
        return value

    return ask


def _time(text: str, line: int, problems: Problems) -> int | None:
    try:
        moment = datetime.fromisoformat(text)
    except ValueError:
        problems.add(f"line {line}: time", f"{text!r} is not a time such as 2010-07-22T13:12:00Z")
        return None
    return utc_ns_of(moment if moment.tzinfo else moment.replace(tzinfo=UTC))


def _weather(path: Path) -> Moments:
    """A year's weather as pvlib reads it, with the range of what is used checked; the sun in the middle of the hour."""
    from pandas import to_numeric
    from pvlib.iotools import read_epw

    try:
        hours, place = read_epw(path)
        middle = (hours.index + timedelta(minutes=30)).tz_convert("UTC")
    except OSError as error:
        raise DataError(f"{path}: {error}", FORM) from error
    except (ValueError, TypeError, KeyError, AttributeError) as error:  # of pandas, too
        why, *_ = str(error).splitlines() or ["unreadable"]
        hint = "it starts with LOCATION and has eight lines of header, then 35 values an hour"
        raise DataError(f"{path}: is not an EPW file ({why})", hint) from None
    problems = Problems(str(path))
    if middle.has_duplicates:
        problems.add("line 8", "its records are not hourly")
    weather = {name: to_numeric(hours[name], errors="coerce").to_numpy(dtype=np.float64) for name in _USED}
    for name, (low, high) in _USED.items():
        for k in np.flatnonzero(~((weather[name] >= low) & (weather[name] <= high)))[:MOST_TOLD]:
            problems.add(f"line {k + _HEAD + 1}: {name}", f"{hours[name].iloc[k]} is not from {low:g} to {high:g}")
    problems.raise_if_any(DataError, "9999 stands for what is missing: fill it, or leave such hours out")
    utc_ns = middle.as_unit("ns").asi8
    seen = sun_position(utc_ns, Site(place["latitude"], place["longitude"], place["altitude"]))
    columns = (*weather.values(), seen.geometric_altitude_deg, seen.altitude_deg, distance_factor(utc_ns))
    lit = [_illuminances(*(float(value) for value in row)) for row in zip(*columns, strict=True)]
    beam, diffuse_lx = np.array(lit, dtype=np.float64).reshape(-1, 2).T
    return Moments(tuple(utc_text(int(ns)) for ns in utc_ns), seen.altitude_deg, seen.azimuth_deg, beam, diffuse_lx)


def _illuminances(
    normal: float, diffuse: float, dew_deg: float, geometric_deg: float, seen_deg: float, factor: float
) -> tuple[float, float]:
    """Beam and diffuse illuminance on the horizontal [lx] of irradiances [W/m²] and a dew point [°C].

    Precipitable water [cm] is exp(0.07 T - 0.075) (Wright, Perez and Michalsky 1989, Solar Energy 42, which Perez 1990
    takes); 2 cm where the dew point is missing (99.9 in an .epw).
    """
    if normal <= 0.0 and diffuse <= 0.0:
        return 0.0, 0.0
    sky = from_irradiances(normal, max(diffuse, 1.0), geometric_deg, factor)
    zenith = math.radians(min(90.0, 90.0 - geometric_deg))
    water_cm = math.exp(0.07 * dew_deg - 0.075) if dew_deg < 99.0 else 2.0
    up = max(0.0, math.sin(math.radians(seen_deg)))
    return normal * up * beam_efficacy(sky, zenith, water_cm), diffuse * diffuse_efficacy(sky, zenith, water_cm)
