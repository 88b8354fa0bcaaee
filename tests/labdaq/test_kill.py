"""kill -9 at random moments: what was acknowledged is there, and the session can be recovered and sealed."""

import hashlib
import os
import random
import signal
import subprocess
import sys
import threading
from pathlib import Path

import pytest

from labdaq.clock import VirtualClock
from labdaq.recorder import Recorder
from labdaq.records import Ended
from labdaq.seal import verify
from labdaq.session import Session
from labdaq.virtual_time import run_virtual

WRITER = Path(__file__).with_name("killed_writer.py")


def write_and_kill(folder: Path, after_s: float) -> list[list[str]]:
    """Start the writer, kill it ``after_s`` after its first word; return what it said was acknowledged."""
    path = os.pathsep.join([str(WRITER.parent), str(WRITER.parents[2])])
    writer = subprocess.Popen(
        [sys.executable, str(WRITER), str(folder)],
        stdout=subprocess.PIPE,
        text=True,
        env={**os.environ, "PYTHONPATH": path},
    )
    assert writer.stdout
    with writer, writer.stdout:
        assert writer.stdout.readline() == "started\n"
        killer = threading.Timer(after_s, writer.send_signal, [signal.SIGKILL])
        killer.start()
        said = writer.stdout.read()
        killer.join()
    assert writer.returncode == -signal.SIGKILL
    return [line.split() for line in said.splitlines()]


def survive(folder: Path, trials: int) -> int:
    seed = random.randrange(2**32)
    print(f"seed {seed}")
    chance = random.Random(seed)
    acknowledged = 0
    for trial in range(trials):
        told = write_and_kill(folder / str(trial), chance.uniform(0.0, 0.3))
        (path,) = (p for p in (folder / str(trial)).iterdir() if not p.name.startswith("."))
        found, result = Session.open(path), verify(path)
        assert result.problems == (), f"seed {seed}, trial {trial}"
        photos = {p.file: p.sha256 for p in found.photos()}
        for kind, *what in told:
            acknowledged += 1
            if kind == "photo":
                file, digest = what
                assert photos[file] == digest == hashlib.sha256((path / file).read_bytes()).hexdigest()
            else:
                channel, number = what
                values = found.readings(channel).value
                assert list(values[: int(number)]) == [float(k) for k in range(1, int(number) + 1)]
        recover(path, len(found.readings()))
    return acknowledged


def recover(path: Path, readings: int) -> None:
    async def reopen() -> None:
        recorder = Recorder.reopen(path, VirtualClock(0), inline=True)
        await recorder.seal(Ended(outcome="crashed"), 0)
        await recorder.close()

    run_virtual(reopen())
    after = verify(path)
    assert (after.sealed, after.problems, after.torn_bytes) == (True, (), 0)
    assert len(Session.open(path).readings()) == readings


def test_kill_9_loses_nothing_acknowledged(tmp_path: Path) -> None:
    assert survive(tmp_path, 8) > 0


@pytest.mark.slow
@pytest.mark.timeout(1800)
def test_kill_9_loses_nothing_acknowledged_in_many_trials(tmp_path: Path) -> None:
    assert survive(tmp_path, 300) > 1000
