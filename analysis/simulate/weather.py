"""The hourly weather of a year for EnergyPlus (``.epw``), as suns and illuminances.

The form: EnergyPlus, Auxiliary Programs, Weather File Data Dictionary. Irradiances become illuminances by Perez's
luminous efficacies (1990, doi:10.1016/0038-092X(90)90055-H) with the water that the dew point tells; the file's own
illuminances, which many files lack, are not read.

Each line is an hour that ends at its number, so the sun should stand where it is in the middle of the hour. Not all
who make such files keep to that: of seven real ones (of IWEC, TMY3, Meteonorm, PVGIS, Climate.OneBuilding and others)
three had the normal irradiance of a sun 1, 60 and 71 minutes into the hour. The file itself tells: global is diffuse
plus normal times the sine of the sun's height.
"""

import io
import math
from datetime import timedelta
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from numpy.typing import NDArray

from analysis.simulate.moments import Floats, Moments
from analysis.sky.clearness import beam_efficacy, diffuse_efficacy, from_irradiances
from analysis.sky.sun import Site, distance_factor, sun_position
from labdaq.clock import utc_text
from labdaq.errors import DataError, Problems

if TYPE_CHECKING:
    from pandas import DataFrame, DatetimeIndex

MIDDLE_MIN: Final = 30.0
"""Where in its hour the sun should stand [min]."""

_HEAD: Final = 8
"""Lines of an .epw before its hours."""
_USED: Final = {"dni": (0.0, 1500.0), "dhi": (0.0, 1500.0), "temp_dew": (-99.0, 100.0)}
"""pvlib's names of what is used: normal and diffuse irradiance [W/m²], dew point [°C]; and what they may be."""
_MOST_TOLD: Final = 20
_BRIGHT: Final = 50.0
"""Hours with more normal irradiance [W/m²] than this tell where the sun stood,"""
_ENOUGH: Final = 100
"""if there are so many."""
_SEARCHED_MIN: Final = (-90.0, 150.0)
_OFF_MIN: Final = 10.0
"""A sun nearer to the middle of the hour than this is left there."""
_BETTER: Final = 0.5
"""Elsewhere the three irradiances must disagree by less than this share of what they do in the middle."""


def read_weather(path: Path) -> Moments:
    """Read an .epw; the place is its own. Where the sun does not stand in the middle of the hour, a note says so.

    Raises one `DataError` with the file, and line and column of each mistake.
    """
    hours, site = _read(path)
    start = hours.index
    problems = Problems(str(path))
    for k in np.flatnonzero(start.isna())[:_MOST_TOLD]:
        problems.add(f"line {k + _HEAD + 1}", "no date and hour")
    if start.dropna().has_duplicates:
        problems.add("line 8", "its records are not hourly")
    weather = {name: _numbers(hours, name) for name in _USED}
    for name, (low, high) in _USED.items():
        for k in np.flatnonzero(~((weather[name] >= low) & (weather[name] <= high)))[:_MOST_TOLD]:
            problems.add(f"line {k + _HEAD + 1}: {name}", f"{hours[name].iloc[k]} is not from {low:g} to {high:g}")
    problems.raise_if_any(DataError, "9999 stands for what is missing: fill it, or leave such hours out")
    minutes = _minutes_into_the_hour(start, site, _numbers(hours, "ghi"), weather["dni"], weather["dhi"])
    utc_ns = _moments(start, minutes)
    seen = sun_position(utc_ns, site)
    columns = (*weather.values(), seen.geometric_altitude_deg, seen.altitude_deg, distance_factor(utc_ns))
    lit = [_illuminances(*(float(value) for value in row)) for row in zip(*columns, strict=True)]
    beam, diffuse_lx = np.array(lit, dtype=np.float64).reshape(-1, 2).T
    times = tuple(utc_text(int(ns)) for ns in utc_ns)
    notes = () if minutes == MIDDLE_MIN else (_note(path, minutes),)
    return Moments(times, seen.altitude_deg, seen.azimuth_deg, beam, diffuse_lx, notes)


def _read(path: Path) -> "tuple[DataFrame, Site]":
    """The hours as pvlib reads them, and the place; names of places may be of UTF-8 or of Western Europe's one byte."""
    from pvlib.iotools import read_epw

    try:
        raw = path.read_bytes()
        try:
            text = raw.decode("utf-8-sig")
        except UnicodeDecodeError:
            text = raw.decode("latin-1")
        hours, place = read_epw(io.StringIO(text))
        return hours, Site(place["latitude"], place["longitude"], place["altitude"])
    except OSError as error:
        raise DataError(f"{path}: {error}", "name an .epw file that is there") from error
    except (ValueError, TypeError, KeyError, AttributeError) as error:  # of pandas, too
        why, *_ = str(error).splitlines() or ["unreadable"]
        hint = "it starts with LOCATION and has eight lines of header, then 35 values an hour"
        raise DataError(f"{path}: is not an EPW file ({why})", hint) from None


def _numbers(hours: "DataFrame", name: str) -> Floats:
    from pandas import to_numeric

    return np.asarray(to_numeric(hours[name], errors="coerce"), dtype=np.float64)


def _moments(start: "DatetimeIndex", minutes: float) -> NDArray[np.int64]:
    """UTC [ns] so many minutes after the hours began."""
    moved: Any = start + timedelta(minutes=minutes)
    return np.asarray(moved.tz_convert("UTC").as_unit("ns").asi8)


def _minutes_into_the_hour(start: "DatetimeIndex", site: Site, whole: Floats, normal: Floats, diffuse: Floats) -> float:
    """Where in its hour the sun stands, of global, normal and diffuse irradiances [W/m²]: whole minutes.

    The middle, unless they agree far better with a sun elsewhere.
    """
    from scipy.optimize import minimize_scalar

    told = np.flatnonzero((normal > _BRIGHT) & (whole > 0.0) & (whole < 1500.0))
    if len(told) < _ENOUGH:
        return MIDDLE_MIN

    def disagree(minutes: float) -> float:
        up = np.sin(np.radians(sun_position(_moments(start[told], minutes), site).altitude_deg))
        return float(np.sqrt(np.mean((whole[told] - diffuse[told] - normal[told] * np.maximum(up, 0.0)) ** 2)))

    best = minimize_scalar(disagree, bounds=_SEARCHED_MIN, method="bounded", options={"xatol": 0.2})
    elsewhere = abs(best.x - MIDDLE_MIN) > _OFF_MIN and best.fun < _BETTER * disagree(MIDDLE_MIN)
    return float(round(best.x)) if elsewhere else MIDDLE_MIN


def _note(path: Path, minutes: float) -> str:
    return (
        f"{path}: global, diffuse and normal irradiances agree with the sun {minutes:g} minutes into each hour, "
        f"not in its middle as the format has it: the sun is put there"
    )


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
