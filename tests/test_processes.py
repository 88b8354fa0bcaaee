"""Processes of a pool do not outlive the one that owns it."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

PROGRAM = """
import multiprocessing, os, sys, time
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from labdaq.processes import end_with_parent

def work(folder):
    (Path(folder) / str(os.getpid())).write_text("")
    time.sleep(120.0)

if __name__ == "__main__":
    initializer = end_with_parent if sys.argv[2] == "ending" else None
    with ProcessPoolExecutor(2, multiprocessing.get_context("spawn"), initializer) as pool:
        list(pool.map(work, [sys.argv[1]] * 2))
"""


def _alive(pid: int) -> bool:
    """Whether a process runs: one that has ended and that nobody asked about does not."""
    try:
        stat = Path(f"/proc/{pid}/stat").read_text()
    except OSError:
        return False
    return stat.rsplit(")", 1)[1].split()[0] != "Z"


def _after_kill(folder: Path, how: str) -> list[int]:
    """Start a pool, kill its owner at work, and return those of its processes that live on (looked for 20 s)."""
    program = folder / "pool.py"
    program.write_text(PROGRAM)
    started = folder / how
    started.mkdir()
    owner = subprocess.Popen([sys.executable, str(program), str(started), how], stderr=subprocess.DEVNULL)
    workers: list[int] = []
    for _ in range(600):
        workers = [int(path.name) for path in started.iterdir()]
        if len(workers) == 2 or owner.poll() is not None:
            break
        time.sleep(0.1)
    assert len(workers) == 2
    owner.send_signal(signal.SIGKILL)
    owner.wait()
    patience = 200 if how == "ending" else 20
    for _ in range(patience):
        if not any(map(_alive, workers)):
            break
        time.sleep(0.1)
    left = [pid for pid in workers if _alive(pid)]
    for pid in left:
        os.kill(pid, signal.SIGKILL)
    return left


def test_a_killed_owner_takes_its_workers_with_it(tmp_path: Path) -> None:
    assert not _after_kill(tmp_path, "ending")


def test_without_it_they_would_work_on(tmp_path: Path) -> None:
    assert len(_after_kill(tmp_path, "going-on")) == 2
