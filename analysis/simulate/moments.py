"""Tables of moments: where the sun was, and how much light came from it and from the sky.

A line of names: ``time`` (ISO 8601; UTC where it says no zone) or ``sun_altitude_deg`` and ``sun_azimuth_deg``, or all
three; ``diffuse_lx``; ``global_lx`` where there is a sun. Other columns are not read.
"""

import csv
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from analysis.sky.sun import Site, sun_position
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
    notes
        What a reader should be told.
    """

    times: tuple[str, ...]
    altitude_deg: Floats
    azimuth_deg: Floats
    beam_lx: Floats
    diffuse_lx: Floats
    notes: tuple[str, ...] = ()


def read_table(path: Path, site: Site) -> Moments:
    """Read a .csv; ``site`` places the sun for a table of times.

    Raises one `DataError` with the file, and line and column of each mistake.
    """
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
