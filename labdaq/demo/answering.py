"""Ask ``labdaq explain`` in a process of its own: it gets the case's folder, and nothing else."""

import contextlib
import os
import signal
import subprocess
import sys
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final

import msgspec

import labdaq
from labdaq.demo.telling import Say
from labdaq.errors import DataError, SimulationError

EXPLANATION: Final = "explanation.json"
REPORT: Final = "report.html"


def explain(case: Path, out: Path, say: Say) -> dict[str, Any]:
    """Let the case be explained; return the answer, which lies under ``out`` with its report.

    Raises `SimulationError` when the process fails, with the end of what it said.
    """
    command = [sys.executable, "-P", "-m", "labdaq", "explain", str(case), "--out", str(out), "--json"]
    home = str(Path(labdaq.__file__).parents[1])
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, [home, os.environ.get("PYTHONPATH")]))}
    said: list[str] = []
    with (
        _ended_by_sigterm(),
        subprocess.Popen(
            command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True, env=environment
        ) as process,
    ):
        assert process.stderr is not None
        try:
            for line in process.stderr:
                said.append(line.rstrip())
                say(line.strip())
        except BaseException:
            process.terminate()
            raise
    if process.returncode:
        raise SimulationError(f"`labdaq explain` ended with {process.returncode}: " + "\n".join(said[-5:]))
    return read_answer(out)


@contextlib.contextmanager
def _ended_by_sigterm() -> Iterator[None]:
    """Let SIGTERM unwind the program, so that the other process does not go on for nobody."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return

    def leave(number: int, _: object) -> None:
        raise SystemExit(128 + number)

    before = signal.signal(signal.SIGTERM, leave)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before)


def read_answer(out: Path) -> dict[str, Any]:
    """The explanation under ``out``; raises `DataError` when there is none."""
    path = out / EXPLANATION
    try:
        return msgspec.json.decode(path.read_bytes(), type=dict[str, Any])
    except (OSError, msgspec.MsgspecError) as error:
        raise DataError(f"{path}: `labdaq explain` left no answer that can be read: {error}") from error
