"""``labdaq session``: list, show, verify and close sessions."""

import json
from collections import Counter
from pathlib import Path
from typing import Any

import click
import msgspec

from labdaq.cli.files import json_option
from labdaq.clock import NS, SystemClock, utc_text
from labdaq.errors import DataError
from labdaq.session import Session, session_paths


@click.group("session", short_help="List, show and verify recorded sessions.")
def command() -> None:
    """List, show, verify and close recorded sessions."""


@command.command("ls")
@click.argument("folder", type=click.Path(path_type=Path, exists=True, file_okay=False), default="sessions")
@json_option
def ls(folder: Path, as_json: bool) -> None:
    """List the sessions in FOLDER (by default ./sessions), oldest first; exit code 65 when one cannot be read."""
    damaged = []
    for path in session_paths(folder):
        try:
            line = _summary(Session.open(path))
        except DataError as error:
            damaged.append(error.message)
            continue
        if as_json:
            click.echo(json.dumps(line))
        else:
            click.echo(
                f"{line['started']}  {line['test']:<12} {line['system']:<8} {line['sky']:<14} {line['outcome']:<12} "
                f"{line['photos']:>3} photos {line['readings']:>5} readings  {path.name}"
            )
    if damaged:
        raise DataError("\n".join(damaged), "`labdaq session verify` tells good from bad")


@command.command("show")
@click.argument("path", type=click.Path(path_type=Path))
@json_option
def show(path: Path, as_json: bool) -> None:
    """Show what the session at PATH holds: instruments, channels, lateness, faults."""
    session = Session.open(path)
    what = _summary(session) | _details(session)
    if as_json:
        click.echo(json.dumps(what))
        return
    for key in ("test", "system", "sky", "started", "outcome", "sealed", "duration_s", "photos"):
        click.echo(f"{key.replace('_', ' '):<12} {what[key]}")
    for instrument in what["instruments"]:
        click.echo(
            f"instrument   {instrument['name']}: {instrument['model']} {instrument['serial']} {instrument['port']}"
        )
    for channel, row in what["channels"].items():
        mean = "no usable reading" if row["mean"] is None else f"{row['mean']:.5g} {row['unit']} on average"
        click.echo(f"channel      {channel:<14} {row['readings']:>4} readings, {mean}{row['flags']}")
    for name, row in what["steps"].items():
        late = f"late by {row['late_median_s']:.3f} s (median), {row['late_max_s']:.3f} s (most)"
        click.echo(f"steps        {name:<14} {row['done']:>4} done, {row['missed']} missed, {late}")
    for fault in what["faults"]:
        click.echo(f"fault        {fault}")


@command.command("verify")
@click.argument("paths", type=click.Path(path_type=Path), nargs=-1, required=True)
@json_option
def verify(paths: tuple[Path, ...], as_json: bool) -> None:
    """Compare the sessions at PATHS with their journals and manifests; exit code 65 when anything was damaged."""
    from labdaq.seal import verify as check

    bad = []
    for path in paths:
        found = check(path)
        if as_json:
            click.echo(json.dumps({"session": str(path), "ok": not found.problems, **msgspec.to_builtins(found)}))
        else:
            state = "sealed" if found.sealed else "not sealed"
            extra = f", {found.torn_bytes} bytes torn off by a crash" if found.torn_bytes else ""
            extra += f", {len(found.orphans)} pictures never acknowledged" if found.orphans else ""
            verdict = "DAMAGED" if found.problems else "good"
            click.echo(f"{path}: {verdict}, {state}, {found.entries} entries, {found.photos} pictures{extra}")
            for problem in found.problems:
                click.echo(f"  {problem}")
        bad += [str(path)] if found.problems else []
    if bad:
        raise DataError(f"damaged: {', '.join(bad)}", "restore from a copy; nothing here was changed")


@command.command("seal")
@click.argument("path", type=click.Path(path_type=Path))
def seal(path: Path) -> None:
    """Close the session at PATH that a crash left open: cut the torn tail into a side file, write the manifest."""
    import asyncio

    from labdaq.recorder import Recorder
    from labdaq.records import Ended

    async def close() -> None:
        clock = SystemClock()
        recorder = Recorder.reopen(path, clock, inline=True)
        try:
            await recorder.seal(Ended(outcome="crashed", reason="closed by hand", arm="unknown"), clock.utc_ns())
        finally:
            await recorder.close()

    asyncio.run(close())
    click.echo(f"{path}: sealed")


def _summary(session: Session) -> dict[str, Any]:
    header = session.header
    return {
        "session": str(session.path),
        "test": header.test,
        "system": header.system,
        "sky": header.sky,
        "started": header.started,
        "outcome": session.outcome,
        "sealed": session.sealed,
        "photos": len(session.photos()),
        "readings": len(session.readings()),
    }


def _details(session: Session) -> dict[str, Any]:
    events = session.events()
    channels: dict[str, Any] = {}
    for name in session.channels:
        readings = session.readings(name)
        usable = [r.value for r in readings if r.usable and r.value is not None]
        flags = Counter(str(f) for r in readings for f in r.flags)
        channels[name] = {
            "readings": len(readings),
            "unit": str(readings[0].unit),
            "mean": sum(usable) / len(usable) if usable else None,
            "flags": "".join(f", {count} {flag}" for flag, count in flags.items()),
        }
    duration_s = (events[-1].mono_ns - events[0].mono_ns) / NS if events else 0.0
    return {
        "ended": utc_text(events[-1].utc_ns) if events else "",
        "duration_s": round(duration_s, 3),
        "instruments": [msgspec.to_builtins(i) for i in session.header.instruments],
        "channels": channels,
        "steps": _steps(session),
        "faults": [e.body["message"] for e in session.events("fault")],
    }


def _steps(session: Session) -> dict[str, Any]:
    rows: dict[str, Any] = {}
    late: dict[str, list[float]] = {}
    for event in session.events("step.start"):
        late.setdefault(event.body["step"].rsplit("-", 1)[0], []).append(event.body["lateness_s"])
    done = Counter(e.body["step"].rsplit("-", 1)[0] for e in session.events("step.done"))
    missed: Counter[str] = Counter()
    for event in session.events("step.miss"):
        missed[event.body["step"].rsplit("-", 1)[0]] += event.body["count"]
    for name, values in late.items():
        values.sort()
        rows[name] = {
            "done": done[name],
            "missed": missed[name],
            "late_median_s": values[len(values) // 2],
            "late_max_s": values[-1],
        }
    return rows
