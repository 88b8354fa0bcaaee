"""What a session is made of on disk: its header, and the bodies of the journal's entries (docs/formats.md)."""

from typing import Any, Final

import msgspec

from labdaq.clock import ClockState
from labdaq.reading import Flag, Instrument, Reading

FORMAT: Final = "labdaq-session/1"


class Certificate(msgspec.Struct, frozen=True, kw_only=True):
    """A calibration certificate in force, with the SHA-256 of its file where the station has one."""

    id: str
    instrument: str
    date: str
    expires: str = ""
    factor: float = 1.0
    uncertainty: float = 0.0
    coverage_factor: float = 2.0
    sha256: str = ""


class Header(msgspec.Struct, frozen=True, kw_only=True):
    """``session.json``: what was known when the session began; never changed.

    Attributes
    ----------
    name
        The session's folder.
    test, system, sky
        From the script.
    started, started_utc_ns
        UTC of the first entry, as text and in nanoseconds.
    clock
        The clock that stamps the session, at the start.
    boot_id
        Of the computer: monotonic times of two sessions compare only when it is the same.
    station, script
        The files as they were understood, every default filled in.
    station_file, script_file
        Name and SHA-256 of the files; empty for the built-in station.
    instruments
        As they answered when they were connected.
    software
        Versions of labdaq, Python and the system.
    """

    format: str = FORMAT
    name: str
    test: str
    system: str
    sky: str
    started: str
    started_utc_ns: int
    clock: ClockState
    boot_id: str
    station: dict[str, Any]
    script: dict[str, Any]
    station_file: dict[str, str]
    script_file: dict[str, str]
    instruments: tuple[Instrument, ...]
    certificates: tuple[Certificate, ...]
    software: dict[str, str]


class StepStart(msgspec.Struct, frozen=True, kw_only=True):
    """``step.start``: an instrument begins a step; late by ``lateness_s`` against the grid [s]."""

    step: str
    instrument: str
    lateness_s: float


class StepDone(msgspec.Struct, frozen=True, kw_only=True):
    """``step.done``: the step took ``took_s`` [s], and what it brought is in the journal before this entry."""

    step: str
    instrument: str
    took_s: float


class StepMiss(msgspec.Struct, frozen=True, kw_only=True):
    """``step.miss``: ``count`` ticks of a periodic reading went by while the one before was under way."""

    step: str
    instrument: str
    count: int


class TakenReading(msgspec.Struct, frozen=True, kw_only=True):
    """``reading``: a reading, and the step that asked for it."""

    step: str
    reading: Reading


class StoredPhoto(msgspec.Struct, frozen=True, kw_only=True):
    """``photo``: a picture that is on disk.

    Attributes
    ----------
    file
        Relative to the session's folder.
    sha256, size
        Of the file [size in bytes].
    camera_name
        What the camera called it.
    exposure_s, nominal_exposure_s
        By the camera's account (``None`` when it gives none), and as set [s].
    utc_ns, mono_ns
        Middle of the exposure [ns].
    """

    step: str
    file: str
    sha256: str
    size: int
    camera_name: str
    exposure_s: float | None
    nominal_exposure_s: float
    f_number: float | None
    iso: float | None
    utc_ns: int
    mono_ns: int
    clock: ClockState
    instrument: Instrument
    flags: tuple[Flag, ...] = ()


class ClockCheck(msgspec.Struct, frozen=True, kw_only=True):
    """``clock``: the clock's state; the entry's own two times tie UTC to the monotonic count.

    Attributes
    ----------
    good
        Whether it meets what script and station ask.
    stepped_s
        How far UTC ran away from the monotonic count since the last check [s].
    """

    state: ClockState
    good: bool
    stepped_s: float


class Fault(msgspec.Struct, frozen=True, kw_only=True):
    """``fault``: what went wrong, with which instrument, in which step."""

    instrument: str
    step: str
    error: str
    message: str
    trace: str = ""


class Opened(msgspec.Struct, frozen=True, kw_only=True):
    """``session.open``: the first entry."""

    boot_id: str


class Resumed(msgspec.Struct, frozen=True, kw_only=True):
    """``session.resume``: opened again after a crash; what was torn off, and pictures that no entry names."""

    boot_id: str
    last_seq: int
    torn_bytes: int
    orphans: tuple[str, ...] = ()


class Ended(msgspec.Struct, frozen=True, kw_only=True):
    """``session.end``: the last entry.

    Attributes
    ----------
    outcome
        ``finished``, ``failed``, ``interrupted`` (the operator asked) or ``crashed`` (found and closed later).
    arm
        ``parked``, or why it is not.
    """

    outcome: str
    reason: str = ""
    arm: str = ""


BODIES: Final[dict[str, type[msgspec.Struct]]] = {
    "session.open": Opened,
    "session.resume": Resumed,
    "session.end": Ended,
    "clock": ClockCheck,
    "step.start": StepStart,
    "step.done": StepDone,
    "step.miss": StepMiss,
    "reading": TakenReading,
    "photo": StoredPhoto,
    "fault": Fault,
}
"""Kinds of entries and what their bodies are; readers pass over kinds they do not know."""

KINDS: Final[dict[type[msgspec.Struct], str]] = {body: kind for kind, body in BODIES.items()}
