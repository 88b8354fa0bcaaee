"""Run the explainer on one case in a process of its own that has no way to the truth.

The child gets a folder with the case and nothing else, a small environment of its own, a home and a cache of its
own, and an import guard that refuses this package. The truth stays in this process's memory until the answer is
written.
"""

import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import labdaq
from labdaq.clock import NS, SystemClock
from labdaq.errors import DataError
from simulators.trial import truth as truths
from simulators.trial.answer import read_answer
from simulators.trial.files import write_folder
from simulators.trial.generate import WITHHELD
from simulators.trial.made import Made
from simulators.trial.outcome import Outcome, judge, read_records, withheld_errors

EXPLANATION: Final = "explanation.json"
FAILED: Final = "failed.txt"
PREDICTED: Final = "withheld.csv"

GUARD: Final = '''"""Refuse the concealed physics to whoever runs under a blind trial."""

import sys


class _Refuse:
    def find_spec(self, name, path=None, target=None):
        if name.split(".")[:2] in (["simulators", "trial"], ["simulators", "hidden"]):
            raise ImportError(f"{name} is concealed during a blind trial")
        return None


sys.meta_path.insert(0, _Refuse())
'''


@dataclass(frozen=True)
class Program:
    """What is on trial.

    Attributes
    ----------
    command
        Words before ``explain CASE --out DIR`` and ``predict DIR CASE --out FILE``.
    limit_s
        Longest time for one answer [s].
    cache
        A folder the program may keep caches in, over all cases.
    """

    command: tuple[str, ...] = (sys.executable, "-m", "labdaq")
    limit_s: float = 600.0
    cache: Path | None = None


def run(made: Made, program: Program, out: Path) -> Outcome:
    """Let ``program`` answer a case; keep case, answer and (afterwards) truth under ``out``; judge."""
    name = made.order.name
    with tempfile.TemporaryDirectory(prefix="labdaq-blind-") as room_:
        room = Path(room_)
        write_folder(room / "case", made.files)
        environment = _environment(room, program)
        clock = SystemClock()
        began = clock.mono_ns()
        answer = room / "answer"
        error = _call(program, ["explain", str(room / "case"), "--out", str(answer)], room, environment)
        seconds = (clock.mono_ns() - began) / NS
        if made.withheld and not error:
            write_folder(room / "withheld", made.withheld)
            words = ["predict", str(answer), str(room / "withheld"), "--out", str(answer / PREDICTED)]
            trouble = _call(program, words, room, environment)
            if trouble:
                (answer / "predict-failed.txt").write_text(trouble, encoding="utf-8")
        kept = out / "answers" / name
        if kept.exists():
            shutil.rmtree(kept)
        kept.parent.mkdir(parents=True, exist_ok=True)
        if answer.is_dir():
            shutil.copytree(answer, kept)
        else:
            kept.mkdir()
        if error:
            (kept / FAILED).write_text(error, encoding="utf-8")
        (kept / "seconds.txt").write_text(f"{seconds:.3f}\n", encoding="utf-8")
    write_folder(out / "cases" / name, made.files)
    if made.withheld:
        write_folder(out / "cases" / f"{name}{WITHHELD}", made.withheld)
    truths.write(made.truth, out / "truth" / f"{name}.json")
    return judged(out, name)


def judged(out: Path, name: str) -> Outcome:
    """Judge the answer that lies under ``out`` beside its case and truth."""
    truth = truths.read(out / "truth" / f"{name}.json")
    folder = out / "answers" / name
    seconds = 0.0
    if (folder / "seconds.txt").is_file():
        seconds = float((folder / "seconds.txt").read_text(encoding="utf-8"))
    failed = folder / FAILED
    if failed.is_file():
        return Outcome(truth, "failed", seconds=seconds, error=failed.read_text(encoding="utf-8")[-400:])
    try:
        answer = read_answer(folder / EXPLANATION)
    except DataError as error:
        return Outcome(truth, "failed", seconds=seconds, error=str(error))
    records = read_records((out / "cases" / name / "records.csv").read_text(encoding="utf-8"))
    held = None
    if truth.withheld_clean and (folder / PREDICTED).is_file():
        case = (out / "cases" / f"{name}{WITHHELD}" / "records.csv").read_text(encoding="utf-8")
        try:
            held = withheld_errors(truth, case, (folder / PREDICTED).read_text(encoding="utf-8"))
        except (ValueError, KeyError) as error:
            return Outcome(truth, "failed", seconds=seconds, error=f"{PREDICTED}: {error}")
    return judge(truth, answer, records, seconds, held)


def _environment(room: Path, program: Program) -> dict[str, str]:
    """An environment that tells the child nothing about where it came from."""
    guard = room / "guard"
    guard.mkdir()
    (guard / "sitecustomize.py").write_text(GUARD, encoding="utf-8")
    home = room / "home"
    home.mkdir()
    cache = program.cache or room / "cache"
    cache.mkdir(parents=True, exist_ok=True)
    installed = Path(labdaq.__file__).resolve().parent.parent
    return {
        "PATH": os.environ.get("PATH", os.defpath),
        "HOME": str(home),
        "TMPDIR": str(room),
        "XDG_CACHE_HOME": str(cache),
        "PYTHONPATH": os.pathsep.join([str(guard), str(installed)]),
        "LANG": os.environ.get("LANG", "C.UTF-8"),
        "OPENBLAS_NUM_THREADS": os.environ.get("OPENBLAS_NUM_THREADS", "1"),
        "MPLBACKEND": "Agg",
    }


def _call(program: Program, words: Sequence[str], room: Path, environment: dict[str, str]) -> str:
    """Run one command of the program; return what went wrong, or nothing."""
    try:
        done = subprocess.run(
            [*program.command, *words],
            cwd=room,
            env=environment,
            capture_output=True,
            text=True,
            check=False,
            timeout=program.limit_s,
            stdin=subprocess.DEVNULL,
        )
    except subprocess.TimeoutExpired:
        return f"no answer within {program.limit_s:g} s"
    if done.returncode:
        return f"exit code {done.returncode}: {done.stderr[-2000:]}"
    return ""
