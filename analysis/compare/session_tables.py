"""A session as plain tables: facts as TOML, readings and exposures as CSV, and what analysis made of it."""

import csv
import io
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import msgspec

from analysis.cases.toml_text import toml_text
from analysis.compare.session_facts import test_facts
from labdaq.clock import utc_ns_of, utc_text
from labdaq.errors import DataError
from labdaq.session import Session

READING_COLUMNS: Final = (
    "utc", "mono_ns", "duration_s", "channel", "quantity", "value", "uncertainty", "unit", "gamma_deg", "c_deg",
    "usable", "flags", "instrument", "step",
)  # fmt: skip
EXPOSURE_COLUMNS: Final = (
    "utc", "mono_ns", "exposure_s", "nominal_exposure_s", "f_number", "iso", "file", "size", "sha256", "instrument",
    "flags", "step",
)  # fmt: skip
_DERIVED: Final = (".hdr", ".ies", ".csv", ".toml", ".txt", ".xml")
"""Kinds of derived files that are read without labdaq."""


@dataclass(frozen=True)
class SessionFiles:
    """Content by name, files to copy by name, and what the table of tests says about the session."""

    content: dict[str, bytes]
    copies: dict[str, Path]
    facts: dict[str, object]


def session_files(session: Session, home: str, *, raw: bool) -> SessionFiles:
    """Describe a session in plain files below ``home``; with ``raw`` the recorded folder is copied as it is, too."""
    content = {
        f"{home}/session.toml": toml_text(_header(session)).encode(),
        f"{home}/readings.csv": _csv(READING_COLUMNS, _readings(session)),
    }
    if session.photos():
        content[f"{home}/exposures.csv"] = _csv(EXPOSURE_COLUMNS, _exposures(session))
    copies = {}
    derived = session.path / "derived"
    for path in sorted(derived.rglob("*")) if derived.is_dir() else []:
        if path.is_file() and path.suffix.lower() in _DERIVED and not path.name.startswith("."):
            copies[f"{home}/derived/{path.relative_to(derived).as_posix()}"] = path
    if raw:
        for path in sorted(session.path.rglob("*")):
            name = path.relative_to(session.path)
            if path.is_file() and name.parts[0] != "derived":
                copies[f"{home}/original/{name.as_posix()}"] = path
    return SessionFiles(content, copies, _facts(session, list(copies)))


def _facts(session: Session, copies: Sequence[str]) -> dict[str, object]:
    facts: dict[str, object] = {"test": session.header.test, "system": session.header.system}
    try:
        told = test_facts(session, session.station)
    except DataError:  # no reading of the arm: a session of the roof alone
        told = {}
    known = session.header.sky if session.header.sky != "unknown" else None
    facts |= {"sky": known, **{k: v for k, v in told.items() if k not in ("start", "end")}}
    for name, key in (("start_utc", "start"), ("end_utc", "end")):
        facts[name] = utc_text(utc_ns_of(told[key])) if key in told else None
    maps = [name for name in copies if name.endswith(".hdr")]
    facts["readings"] = sum(r.usable for r in session.readings())
    facts["sky_hdr"] = maps[0] if maps else ""
    return facts


def _header(session: Session) -> dict[str, Any]:
    table: dict[str, Any] = msgspec.to_builtins(session.header)
    return {**_without_none(table), "outcome": session.outcome}


def _without_none(value: Any) -> Any:
    """TOML has no null: what is not known is left out."""
    if isinstance(value, dict):
        return {k: _without_none(v) for k, v in value.items() if v is not None}
    return [_without_none(v) for v in value if v is not None] if isinstance(value, list | tuple) else value


def _readings(session: Session) -> Iterable[dict[str, object]]:
    readings = session.readings()
    for step, r in zip(readings.step, readings, strict=True):
        yield {
            "utc": _micros(r.utc_ns),
            "mono_ns": r.mono_ns,
            "duration_s": r.duration_s,
            "channel": r.channel,
            "quantity": str(r.quantity),
            "value": r.value,
            "uncertainty": r.uncertainty,
            "unit": str(r.unit),
            "gamma_deg": r.at.get("gamma_deg"),
            "c_deg": r.at.get("c_deg"),
            "usable": "yes" if r.usable else "no",
            "flags": " ".join(r.flags),
            "instrument": r.instrument.name,
            "step": step,
        }


def _exposures(session: Session) -> Iterable[dict[str, object]]:
    for photo in session.photos():
        row = {name: getattr(photo, name, None) for name in EXPOSURE_COLUMNS}
        named = {"utc": _micros(photo.utc_ns), "instrument": photo.instrument.name, "flags": " ".join(photo.flags)}
        yield {**row, **named}


def _micros(utc_ns: int) -> str:
    """UTC to the microsecond."""
    return f"{utc_text(utc_ns)[:-5]}.{utc_ns % 1_000_000_000 // 1000:06d}Z"


def _csv(columns: Sequence[str], rows: Iterable[dict[str, object]]) -> bytes:
    out = io.StringIO()
    writer = csv.DictWriter(out, columns, lineterminator="\n")
    writer.writeheader()
    writer.writerows({k: "" if v is None else v for k, v in row.items()} for row in rows)
    return out.getvalue().encode()
