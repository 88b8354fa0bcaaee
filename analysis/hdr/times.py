"""Exposure times: what a camera prints is not what it does.

Shutters step in exact thirds of a stop, 2^(k/3) s, and are labelled with round numbers: 1/60 is 1/64, 1/125 is 1/128,
15 is 16. Taking the labels tilts a merge by up to 5 % along the brightness scale (measured). So labels a camera
uses are replaced by the step they stand for; times that are no such label are taken as they are.
"""

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Final

from labdaq.errors import DataError, Problems

_LABELS_S: Final = (
    60,
    50,
    40,
    30,
    25,
    20,
    15,
    13,
    10,
    8,
    6,
    5,
    4,
    3.2,
    3,
    2.5,
    2,
    1.6,
    1.5,
    1.3,
    1,
    0.8,
    0.7,
    0.6,
    0.5,
    0.4,
    0.3,
)
_LABELS_PER_S: Final = (
    *(3, 4, 5, 6, 8, 10, 13, 15, 20, 25, 30, 40, 45, 50, 60, 80, 90, 100, 125, 160, 180, 200, 250, 320, 350, 400, 500),
    *(
        640,
        750,
        800,
        1000,
        1250,
        1500,
        1600,
        2000,
        2500,
        3000,
        3200,
        4000,
        5000,
        6000,
        6400,
        8000,
        10_000,
        12_800,
        16_000,
    ),
)
LABELS_S: Final = tuple(float(s) for s in _LABELS_S) + tuple(1.0 / n for n in _LABELS_PER_S)
"""Exposure times as cameras label them [s], in thirds and halves of a stop."""


def step_of(time_s: float) -> float:
    """The exact third (or, where nearer, half) of a stop that a camera's label stands for [s].

    A time that is no label (to 1 %) is returned unchanged.
    """
    if not any(abs(time_s / label - 1.0) < 0.01 for label in LABELS_S):
        return time_s
    stops = math.log2(time_s)
    third, half = round(stops * 3.0) / 3.0, round(stops * 2.0) / 2.0
    # half stops (1.5, 3, 0.7, 1/45, 1/90 ...) only where they fit clearly better
    nearest = half if abs(stops - half) < abs(stops - third) - 0.05 else third
    return float(2.0**nearest)


def read_times(path: Path) -> list[float]:
    """Exposure times [s] of a file with one a line: ``0.25``, ``1/250``, ``2.5e-4``; ``#`` starts a comment.

    Raises `DataError` that lists every line that is no positive number.
    """
    try:
        lines = path.read_text(encoding="utf-8").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        raise DataError(f"{path}: cannot be read as text: {error}") from error
    problems = Problems(str(path))
    times = []
    for number, line in enumerate(lines, 1):
        words = line.partition("#")[0].strip()
        if not words:
            continue
        value = _seconds(words)
        times.append(value)
        if not (math.isfinite(value) and value > 0.0):
            problems.add(
                f"line {number}", f"'{words}' is not an exposure time: write seconds above 0, like 0.25 or 1/250"
            )
    if not times:
        problems.add("line 1", "there is no exposure time in the file")
    problems.raise_if_any(DataError)
    return times


def _seconds(words: str) -> float:
    top, stroke, bottom = words.removesuffix("s").strip().partition("/")
    try:
        return float(top) / float(bottom) if stroke else float(top)
    except (ValueError, ZeroDivisionError):
        return math.nan


def check_times(names: Sequence[str], times: Sequence[float | None], problems: Problems) -> None:
    """Note every exposure whose time is missing or not positive."""
    for name, time in zip(names, times, strict=True):
        if time is None:
            problems.add(name, "its file does not tell the exposure time; give --times")
        elif not (math.isfinite(time) and time > 0.0):
            problems.add(name, f"its exposure time is {time:g} s; it must be above 0")
