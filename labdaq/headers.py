"""Make a session's header: everything that is known when a test begins."""

import hashlib
import platform
import secrets
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

import labdaq
from labdaq.clock import NS, Clock, utc_text
from labdaq.errors import ConfigError, Problems
from labdaq.reading import Instrument
from labdaq.records import Certificate, Header
from labdaq.script import Script
from labdaq.seal import boot_id
from labdaq.station import Station


@dataclass(frozen=True)
class Order:
    """What the operator asked for.

    Attributes
    ----------
    station_file, script_file
        Where they were read from; ``None`` for what was made in the program.
    sessions
        The folder in which each test becomes a session.
    """

    station: Station
    script: Script
    sessions: Path
    station_file: Path | None = None
    script_file: Path | None = None


def certificates(station: Station, station_file: Path | None) -> tuple[Certificate, ...]:
    """The station's certificates with the SHA-256 of their files; raises `ConfigError` for files that are not there."""
    home = station_file.parent if station_file else Path()
    problems = Problems(str(station_file or "the station"))
    found = []
    for c in station.calibration:
        digest = ""
        if c.file:
            try:
                digest = hashlib.sha256((home / c.file).read_bytes()).hexdigest()
            except OSError as error:
                problems.add(f"calibration[{c.id}].file", f"{home / c.file} cannot be read: {error.strerror}")
        found.append(
            Certificate(
                id=c.id,
                instrument=c.instrument,
                date=c.date.isoformat(),
                expires=c.expires.isoformat() if c.expires else "",
                factor=c.factor,
                uncertainty=c.uncertainty,
                coverage_factor=c.coverage_factor,
                sha256=digest,
            )
        )
    problems.raise_if_any(ConfigError, "put the certificate there, or correct the path (relative to the station file)")
    return tuple(found)


def expired(station: Station, utc_ns: int) -> list[str]:
    """Identifiers of certificates that are no longer valid at ``utc_ns`` [ns]."""
    today = datetime.fromtimestamp(utc_ns // NS, UTC).date()
    return [c.id for c in station.calibration if c.expires is not None and c.expires < today]


def make_header(order: Order, instruments: tuple[Instrument, ...], clock: Clock) -> Header:
    """Describe the session that begins now, under a name that no session in the folder has."""
    now_ns = clock.utc_ns()
    stamp = utc_text(now_ns)[:19].replace(":", "") + "Z"
    name = f"{stamp}-{order.script.test}-{secrets.token_hex(2)}"
    while (order.sessions / name).exists():
        name = f"{stamp}-{order.script.test}-{secrets.token_hex(2)}"
    return Header(
        name=name,
        test=order.script.test,
        system=order.script.system,
        sky=order.script.sky,
        started=utc_text(now_ns),
        started_utc_ns=now_ns,
        clock=clock.state(),
        boot_id=boot_id(),
        station=order.station.model_dump(mode="json"),
        script=order.script.model_dump(mode="json"),
        station_file=_file(order.station_file),
        script_file=_file(order.script_file),
        instruments=instruments,
        certificates=certificates(order.station, order.station_file),
        software={"labdaq": labdaq.__version__, "python": platform.python_version(), "system": platform.platform()},
    )


def _file(path: Path | None) -> dict[str, str]:
    if path is None:
        return {}
    try:
        return {"name": path.name, "sha256": hashlib.sha256(path.read_bytes()).hexdigest()}
    except OSError as error:
        raise ConfigError(f"{path}: cannot be read: {error.strerror}") from error
