"""Look at everything a test needs, without moving anything: each instrument, the clock, the disk, the certificates."""

import shutil
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from labdaq.bench import Bench, close_all, connect, each
from labdaq.clock import Clock
from labdaq.errors import ConfigError, LabdaqError
from labdaq.headers import certificates, expired
from labdaq.instruments import Device, place_of
from labdaq.reading import Instrument, Reading
from labdaq.recorder import PHOTO_BYTES
from labdaq.station import Station
from labdaq.stopping import carry_through

CONNECT_S: Final = 30.0
READ_S: Final = 10.0

SCAN_S: Final = 1.0
"""Analog modules that were just switched on have values only after a scan of all channels [s]."""


@dataclass(frozen=True)
class Finding:
    """What was found about one thing.

    Attributes
    ----------
    check
        ``instrument``, ``clock``, ``disk`` or ``calibration``.
    name
        Which one.
    ok
        Whether a test can be taken with it.
    what
        In one line: who it is and what it reads, or what is wrong.
    hint
        What to try; empty when there is nothing to try.
    facts
        The same for programs.
    exit_code
        What the command ends with if this is not well; 0 for what only deserves attention.
    """

    check: str
    name: str
    ok: bool
    what: str
    hint: str = ""
    facts: dict[str, Any] | None = None
    exit_code: int = 0


async def examine_bench(bench: Bench, clock: Clock) -> list[Finding]:
    """Connect every instrument, ask each for its identity and a reading, and close all of them."""

    async def look(device: Device) -> Finding:
        who = await connect(device, clock, CONNECT_S)
        async with clock.timeout(READ_S):
            readings, extra = await _readings(bench, device, clock)
        return _present(who, readings, extra)

    try:
        found = await each(bench.devices, look)
    finally:
        await carry_through(close_all(bench, clock))
    pairs = zip(bench.devices, found, strict=True)
    return [f if isinstance(f, Finding) else _missing(place_of(d).instrument, place_of(d).port, f) for d, f in pairs]


async def _readings(bench: Bench, device: Device, clock: Clock) -> tuple[Sequence[Reading], str]:
    """A reading of a device, and what else is worth telling."""
    for luminance in bench.luminance:
        if device is luminance:
            return [await luminance.read()], ""
    for chroma in bench.chroma:
        if device is chroma:
            return await chroma.measure(), ""
    if device is bench.goniophotometer:
        await clock.sleep(SCAN_S)
        return await bench.goniophotometer.read(), ""
    times = bench.camera.exposures_s
    return [], f"{len(times)} shutter times, {_shutter(min(times))} to {_shutter(max(times))}" if times else (
        "its shutter time cannot be set: turn the mode dial to M"
    )


def _shutter(seconds: float) -> str:
    return f"{seconds:g} s" if seconds >= 0.3 else f"1/{1 / seconds:.0f} s"


def _present(who: Instrument, readings: Sequence[Reading], extra: str) -> Finding:
    shown = [_shown(r) for r in readings[:3]] + ([f"and {len(readings) - 3} more"] if len(readings) > 3 else [])
    identity = " ".join(filter(None, (who.model, who.serial, who.firmware)))
    facts = {
        "model": who.model,
        "serial": who.serial,
        "firmware": who.firmware,
        "port": who.port,
        "readings": {r.channel: r.value for r in readings if r.channel},
    }
    return Finding(
        "instrument",
        who.name,
        True,
        ", ".join([f"{identity} on {who.port}", *shown, *filter(None, [extra])]),
        facts=facts,
    )


def _shown(reading: Reading) -> str:
    value = "no value" if reading.value is None else f"{reading.value:.4g} {reading.unit}".removesuffix(" 1")
    flags = f" ({' '.join(reading.flags)})" if reading.flags else ""
    return f"{reading.channel} {value}{flags}"


def _missing(name: str, port: str, error: LabdaqError) -> Finding:
    return Finding("instrument", name, False, error.message, error.hint, {"port": port}, exit_code=69)


def examine_clock(clock: Clock, station: Station) -> Finding:
    """Whether the clock is synchronised well enough for the station."""
    state = clock.state()
    facts = {"source": state.source, "synchronised": state.synchronised, "max_error_s": state.max_error_s}
    if state.source != "system":
        return Finding(
            "clock", state.source, True, "emulated time; readings will say that it is not legal time", "", facts
        )
    bound = state.max_error_s
    if state.synchronised and bound is not None and bound <= station.clock.max_error_s:
        return Finding("clock", "system", True, f"synchronised, within {bound:.3f} s of UTC", "", facts)
    why = "not synchronised" if not state.synchronised else f"may be off by {bound} s"
    hint = "start a time service (chrony); scripts with [clock] require = 'refuse' will not run"
    return Finding("clock", "system", False, f"{why} (allowed: {station.clock.max_error_s:g} s)", hint, facts)


def examine_disk(folder: Path) -> Finding:
    """Whether sessions can be written, and how many tests fit."""
    parent = folder.absolute()
    while not parent.exists():
        parent = parent.parent
    try:
        free = shutil.disk_usage(parent).free
        probe = parent / ".labdaq-doctor"
        probe.write_bytes(b"")
        probe.unlink()
    except OSError as error:
        hint = "choose another sessions folder in the station file, or correct its rights"
        return Finding("disk", str(folder), False, f"cannot be written: {error.strerror}", hint, {}, exit_code=74)
    tests = int(free / (1.2 * 16 * PHOTO_BYTES["jpeg"]))
    facts = {"free_bytes": free, "tests": tests}
    hint = "" if tests else "free some space"
    what = f"{free / 1e9:.1f} GB free, room for about {tests} tests of 16 JPEGs"
    return Finding("disk", str(folder), tests > 0, what, hint, facts, exit_code=0 if tests else 74)


def examine_certificates(station: Station, station_file: Path | None, utc_ns: int) -> list[Finding]:
    """Whether the calibration certificates are there and in force."""
    try:
        found = certificates(station, station_file)
    except ConfigError as error:
        return [Finding("calibration", station.name, False, error.message, error.hint, {}, exit_code=78)]
    old = expired(station, utc_ns)
    return [
        Finding(
            "calibration",
            c.id,
            c.id not in old,
            f"of {c.instrument}, {c.date}" + (f", expired on {c.expires}" if c.id in old else ""),
            "have the instrument calibrated" if c.id in old else "",
            {"instrument": c.instrument, "date": c.date, "expires": c.expires},
        )
        for c in found
    ]
