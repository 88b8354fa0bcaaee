"""What a run shows while it goes: lines of JSON, bars on a terminal, or a few plain lines."""

import contextlib
import os
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final

import msgspec

from labdaq.clock import utc_text
from labdaq.headers import Order
from labdaq.records import (
    ClockCheck,
    Ended,
    Fault,
    Header,
    StepDone,
    StepMiss,
    StepStart,
    StoredPhoto,
    TakenReading,
)
from labdaq.steps import Watch
from labdaq.units import Unit


def emit(event: dict[str, Any]) -> None:
    """Print one line of JSON at once; a reader that has gone away is no reason to end a test."""
    try:
        sys.stdout.write(msgspec.json.encode(event).decode() + "\n")
        sys.stdout.flush()
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


_PLAIN: Final[dict[type[msgspec.Struct], tuple[str, tuple[str, ...]]]] = {
    StoredPhoto: ("photo", ("step", "file", "sha256", "size", "exposure_s", "nominal_exposure_s")),
    StepDone: ("step", ("step", "instrument", "took_s")),
    StepMiss: ("missed", ("step", "instrument", "count")),
    Fault: ("fault", ("instrument", "step", "error", "message")),
    Ended: ("end", ("outcome", "reason", "arm")),
}
"""Entries whose lines are some of their own fields: the event's name, and which."""


def as_event(body: msgspec.Struct, sessions: Path, lateness_s: float) -> dict[str, Any] | None:
    """The line of JSON for an entry that is on disk (docs/formats.md); ``None`` for what is not shown."""
    event: dict[str, Any] = {}
    if plain := _PLAIN.get(type(body)):
        event = {"event": plain[0]} | {name: getattr(body, name) for name in plain[1]}
    match body:
        case Header():
            event = {"event": "session"} | {k: getattr(body, k) for k in ("test", "system", "sky", "started")}
            event["session"] = str(sessions / body.name)
        case TakenReading(step=step, reading=r):
            event = {"event": "reading", "step": step, "utc": utc_text(r.utc_ns)}
            event |= {k: getattr(r, k) for k in ("channel", "value", "unit", "uncertainty", "flags", "at")}
        case StoredPhoto():
            event["utc"] = utc_text(body.utc_ns)
        case StepDone():
            event["lateness_s"] = round(lateness_s, 6)
        case ClockCheck(state=state):
            event = {"event": "clock"} | {k: getattr(state, k) for k in ("source", "synchronised", "max_error_s")}
            event |= {"good": body.good, "stepped_s": body.stepped_s}
    return event or None


def json_lines(order: Order, started: list[str]) -> Watch:
    """A watch that prints one line of JSON for each thing that is on disk; ``started`` collects the sessions."""
    lateness_s = {}

    def watch(body: msgspec.Struct) -> None:
        if isinstance(body, StepStart):
            lateness_s[body.step, body.instrument] = body.lateness_s
        late = lateness_s.pop((body.step, body.instrument), 0.0) if isinstance(body, StepDone) else 0.0
        if event := as_event(body, order.sessions, late):
            if isinstance(body, Header):
                started.append(event["session"])
            emit(event)

    return watch


@contextlib.contextmanager
def bars(order: Order) -> Iterator[Watch]:
    """A watch that draws bars on the terminal behind standard error."""
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

    script = order.script
    columns = TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TextColumn("{task.fields[last]}")
    with Progress(*columns, TimeElapsedColumn(), console=Console(stderr=True)) as progress:
        totals = {
            "exposure": len(script.exposures.times_s),
            "zenith": len(script.exposures.times_s) if script.exposures.zenith_readings else 0,
            "plane": len(script.scan.c_planes_deg),
            "illuminance": None,
        }
        tasks = {name: progress.add_task(name, total=total, last="") for name, total in totals.items() if total != 0}

        def watch(body: msgspec.Struct) -> None:
            if isinstance(body, Header):
                for task in tasks.values():
                    progress.reset(task)
                progress.console.print(f"test {body.test}: {body.system}, {body.sky}, {body.started}")
            if isinstance(body, TakenReading) and body.reading.value is not None and body.reading.unit is not Unit.ONE:
                _advance(body.step, last=f"{body.reading.value:.4g} {body.reading.unit}")
            if isinstance(body, StoredPhoto):
                _advance(body.step, last=f"{body.nominal_exposure_s:g} s")
            if isinstance(body, StepDone):
                _advance(body.step, advance=1)
            if isinstance(body, Fault):
                progress.console.print(f"fault: {body.message}", style="red")

        def _advance(step: str, **change: Any) -> None:
            task = tasks.get(step.rsplit("-", 1)[0])
            if task is not None:
                progress.update(task, **change)

        yield watch


@contextlib.contextmanager
def plain_lines(order: Order) -> Iterator[Watch]:
    """A watch for logs: where the session is, and what went wrong."""

    def watch(body: msgspec.Struct) -> None:
        if isinstance(body, Header):
            sys.stderr.write(f"test {body.test}: {body.started}, {order.sessions / body.name}\n")
        if isinstance(body, Fault):
            sys.stderr.write(f"fault: {body.message}\n")

    yield watch
