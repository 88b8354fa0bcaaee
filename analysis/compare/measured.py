"""Measured intensities from files: a goniophotometer's .ies, or a table of its readings."""

import csv
import math
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import Any, Final

import numpy as np

from analysis.cases.model import Floats, Goniometer, Ints
from analysis.compare.listing import Noise
from analysis.photometry import Distribution
from analysis.photometry.lm63 import read_lm63
from analysis.photometry.testdata import TestData
from labdaq.clock import utc_ns_of
from labdaq.errors import DataError, Problems

_COLUMNS: Final = ("gamma_deg", "c_deg", "candela", "lux", "time", "uncertainty", "channel")
_SHOWN: Final = 12
_SAME_DEG: Final = 1e-6


@dataclass(frozen=True, kw_only=True)
class Measured:
    """Measured intensities of one test; all arrays have shape (N,).

    Attributes
    ----------
    channel
        Name of each reading's channel.
    utc_ns
        -1 where unknown.
    candela, uncertainty
        Reading and standard uncertainty of its noise [cd]; NaN where there is no reading.
    facts
        What the file says about the test, by the names of a case.
    """

    channel: tuple[str, ...]
    utc_ns: Ints
    gamma_deg: Floats
    c_deg: Floats
    candela: Floats
    uncertainty: Floats
    facts: dict[str, Any]


def read_measured(path: Path, goniometer: Goniometer | None, noise: Noise) -> Measured:
    """Read an .ies file (any other suffix than .csv) or a table of readings (.csv).

    From an .ies file those gammas are taken that the goniometer has, or where that is not said all below 90 degrees (an
    opening in a ceiling shows no area at 90, what stands there was filled in); a nadir that is the same in all planes
    counts once. Raises `DataError` naming file, row and column.
    """
    if path.suffix.lower() == ".csv":
        return _from_table(path, goniometer, noise)
    distribution = read_lm63(path).distribution
    return _from_ies(path, distribution, goniometer, noise)


def _from_ies(path: Path, measured: Distribution, goniometer: Goniometer | None, noise: Noise) -> Measured:
    gammas, planes = measured.gamma_deg, measured.c_deg[:-1]
    wanted = gammas < 90.0
    if goniometer is not None and goniometer.gammas_deg:
        near = np.abs(gammas[:, None] - np.array(goniometer.gammas_deg))
        missing = [g for g, off in zip(goniometer.gammas_deg, near.min(axis=0), strict=True) if off > _SAME_DEG]
        if missing:
            raise DataError(f"{path}: holds no gamma {missing[0]:g}, which the goniometer has")
        wanted = near.min(axis=1) <= _SAME_DEG
    table = np.argwhere(np.broadcast_to(wanted, (len(planes), len(gammas))))
    if gammas[0] == 0.0 and np.ptp(measured.candela[:, 0]) == 0.0:
        table = table[(table[:, 1] != 0) | (table[:, 0] == 0)]
    j, i = table.T
    candela = measured.candela[j, i]
    return Measured(
        channel=tuple(channel_of(g) for g in gammas[i]),
        utc_ns=np.full(len(table), -1, dtype=np.int64),
        gamma_deg=gammas[i],
        c_deg=planes[j],
        candela=candela,
        uncertainty=np.hypot(candela * noise.percent / 100, noise.cd),
        facts=_facts(path, measured),
    )


def channel_of(gamma_deg: float) -> str:
    """Name of the channel of the sensor at a gamma, as in sessions: ``gonio.g45``."""
    return f"gonio.g{gamma_deg:g}"


def _facts(path: Path, measured: Distribution) -> dict[str, Any]:
    """Test data in the keywords of labdaq's own files."""
    try:
        told = TestData.from_keywords(measured.keywords)
        moments = {name: _moment(text) for name, text in (("start", told.start_utc), ("end", told.end_utc))}
    except (DataError, ValueError) as error:
        raise DataError(f"{path}: test data in the keywords: {error}") from None
    facts = {
        **moments,
        "sky": told.sky if told.sky in ("clear", "partly-cloudy", "overcast") else None,
        "sun_altitude_deg": told.sun_altitude_deg,
        "sun_azimuth_deg": told.sun_azimuth_deg,
        "global_illuminance_lx": told.global_lx,
        "diffuse_illuminance_lx": told.diffuse_lx,
    }
    return {key: value for key, value in facts.items() if value is not None}


def _moment(text: str) -> datetime | None:
    if not text:
        return None
    moment = datetime.fromisoformat(text)
    utc_ns_of(moment)  # refuses a time without zone
    return moment


def _from_table(path: Path, goniometer: Goniometer | None, noise: Noise) -> Measured:
    try:
        with path.open(newline="", encoding="utf-8-sig") as file:
            lines = [(n, row) for n, row in enumerate(csv.reader(file), start=1) if any(f.strip() for f in row)]
    except OSError as error:
        raise DataError(f"{path}: cannot be read: {error.strerror}") from None
    except (UnicodeDecodeError, csv.Error) as error:
        raise DataError(f"{path}: not a CSV file: {error}") from None
    problems = Problems(str(path))
    header = [name.strip() for name in lines[0][1]] if lines else []
    _check_header(header, goniometer, problems)
    problems.raise_if_any(DataError, f"columns are {', '.join(_COLUMNS)}; candela or lux, the last three optional")
    factor = 1.0 if "candela" in header else ((goniometer and goniometer.distance_m) or math.nan) ** 2
    rows = [_row(header, n, row, problems) for n, row in lines[1:]]
    if not rows:
        problems.add("file", "there are no readings")
    if len(problems.found) > _SHOWN:
        problems.found[_SHOWN:] = [f"... and {len(problems.found) - _SHOWN} more"]
    problems.raise_if_any(DataError)
    column = {name: np.array([row.get(name, math.nan) for row in rows], dtype=np.float64) for name in _COLUMNS[:6]}
    candela = column["candela" if "candela" in header else "lux"] * factor
    stated = column["uncertainty"] * factor
    return Measured(
        channel=tuple(row["channel"] or channel_of(row["gamma_deg"]) for row in rows),
        utc_ns=np.array([row["utc_ns"] for row in rows], dtype=np.int64),
        gamma_deg=column["gamma_deg"],
        c_deg=column["c_deg"] % 360.0,
        candela=candela,
        uncertainty=np.where(np.isnan(stated), np.hypot(candela * noise.percent / 100, noise.cd), stated),
        facts={},
    )


def _check_header(header: list[str], goniometer: Goniometer | None, problems: Problems) -> None:
    for name in dict.fromkeys(header):
        if name not in _COLUMNS:
            problems.add("header", f"unknown column '{name}'")
        elif header.count(name) > 1:
            problems.add("header", f"column '{name}' is given twice")
    for name in ("gamma_deg", "c_deg"):
        if name not in header:
            problems.add("header", f"column '{name}' is missing")
    if ("candela" in header) == ("lux" in header):
        problems.add("header", "either candela or lux is needed")
    if "lux" in header and not (goniometer and goniometer.distance_m):
        problems.add("header", "lux needs the goniometer's distance_m to become candela")


def _row(header: list[str], number: int, row: list[str], problems: Problems) -> dict[str, Any]:
    made: dict[str, Any] = {"utc_ns": -1, "channel": ""}
    if len(row) != len(header):
        problems.add(f"row {number}", f"has {len(row)} fields, the header has {len(header)}")
        return made
    for name, text in zip(header, (field.strip() for field in row), strict=True):
        if name == "channel":
            made[name] = text
        elif name == "time":
            try:
                made["utc_ns"] = utc_ns_of(datetime.fromisoformat(text)) if text else -1
            except ValueError as error:
                problems.add(f"row {number}, column time", f"'{text}' is not a UTC time: {error}")
        elif text or name in ("gamma_deg", "c_deg"):
            made[name] = _number(number, name, text, problems)
    if made.get("uncertainty", 0.0) < 0:
        problems.add(f"row {number}, column uncertainty", "is negative")
    return made


def _number(number: int, name: str, text: str, problems: Problems) -> float:
    try:
        value = float(text) if text.isascii() and "_" not in text else math.nan
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        problems.add(f"row {number}, column {name}", f"'{text}' is not a finite number")
    elif name == "gamma_deg" and not 0.0 <= value <= 180.0:
        problems.add(f"row {number}, column {name}", f"{value:g} is outside 0 to 180")
    return value
