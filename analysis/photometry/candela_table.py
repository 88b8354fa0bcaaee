"""Candela tables as text: what programs without an .ies export print, and what a spreadsheet holds.

Values lie between blanks, tabs, commas or semicolons; lines that start with ``#`` or ``//`` are comments. Two forms:

* a grid: the first row has a name and the C angles, every other row a gamma and its candelas (or C and gamma the other
  way round, where the name's first word is C or one of its other names, as in ``C\\gamma``);
* a list: a row of names, then a direction and its candela on each line, in any order, of a complete grid.

Angles are those of type C: gamma from the nadir; C counter-clockwise seen from above (0 north, 90 west). A name that
says ``azimuth`` means the compass instead, clockwise from north. C may end at 0, 90 or 180 where the rest is its mirror
image.
"""

import math
import re
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from analysis.photometry.distribution import Distribution
from analysis.photometry.unfold import UnfoldError, unfold_c
from analysis.text_numbers import is_number
from labdaq.errors import DataError

Floats = NDArray[np.float64]
Line = tuple[int, list[str]]

_GAMMA: Final = ("gamma_deg", "gamma", "theta", "theta_deg", "vertical", "vertical_deg", "vertical_angle")
_C: Final = ("c_deg", "c", "c-plane", "c_plane", "phi", "phi_deg", "horizontal", "horizontal_deg", "horizontal_angle")
_COMPASS: Final = ("azimuth", "azimuth_deg")
_CANDELA: Final = ("candela", "cd", "intensity", "intensity_cd", "candela_cd", "luminous_intensity", "value")


def read_candela_table(path: Path) -> Distribution:
    """Read a table; raises `DataError` naming file, line and reason."""
    try:
        text = path.read_text(encoding="utf-8-sig")
    except (OSError, UnicodeDecodeError) as error:
        raise DataError(f"{path}: cannot be read: {error}") from None
    return parse_candela_table(text, str(path))


def parse_candela_table(text: str, source: str = "candela table") -> Distribution:
    """Read a table from memory; ``source`` names it in messages. Raises `DataError`."""
    lines = [
        (number, _words(line))
        for number, line in enumerate(text.splitlines(), 1)
        if line.strip() and not line.lstrip().startswith(("#", "//"))
    ]
    if len(lines) < 2:
        raise DataError(f"{source}: no table", "give a row of C angles and rows of gamma with candelas")
    names = [word.lower() for word in lines[0][1]]
    listed = sum(any(name in known for name in names) for known in (_GAMMA, (*_C, *_COMPASS), _CANDELA)) == 3
    read = _list if listed else _grid
    gamma, c, candela, compass = read(lines, names, source)
    if compass:
        c = np.mod(360.0 - c, 360.0)
        order = np.argsort(c)
        c, candela = c[order], candela[order]
    if gamma[0] < 0.0 or gamma[-1] > 180.0 or len(gamma) < 2:
        raise DataError(f"{source}: gamma runs from {gamma[0]:g} to {gamma[-1]:g}, not within 0 and 180")
    try:
        full_c, full, _ = unfold_c(c, candela)
    except UnfoldError as error:
        raise DataError(f"{source}: {error}") from None
    return Distribution(gamma, full_c, full)


def _list(lines: list[Line], names: list[str], source: str) -> tuple[Floats, Floats, Floats, bool]:
    """Gamma, C, candela (C, gamma) and whether C is a compass's, from one direction a line."""

    def column(known: tuple[str, ...]) -> int:
        return next(k for k, name in enumerate(names) if name in known)

    compass = not any(name in _C for name in names)
    places = [column(_GAMMA), column(_COMPASS if compass else _C), column(_CANDELA)]
    rows = []
    for number, words in lines[1:]:
        if len(words) <= max(places):
            raise DataError(f"{source}, line {number}: {len(words)} values, but {len(names)} names")
        rows.append(
            [*(_number(words[k], source, number) for k in places[:2]), _candela(words[places[2]], source, number)]
        )
    values = np.array(rows)
    _refuse_repeats(values[:, :2], [number for number, _ in lines[1:]], source)
    if not compass and np.any(values[:, 1] == 360.0) and np.any(values[:, 1] == 0.0):
        values = values[values[:, 1] < 360.0]
    elif compass:
        values[:, 1] %= 360.0
    gamma, g = np.unique(values[:, 0], return_inverse=True)
    c, p = np.unique(values[:, 1], return_inverse=True)
    candela = np.full((len(c), len(gamma)), np.nan)
    candela[p, g] = values[:, 2]
    if np.isnan(candela).any():
        where = np.argwhere(np.isnan(candela))[0]
        raise DataError(f"{source}: nothing at gamma {gamma[where[1]]:g}, C {c[where[0]]:g}", "give a complete grid")
    return gamma, c, candela, compass


def _grid(lines: list[Line], names: list[str], source: str) -> tuple[Floats, Floats, Floats, bool]:
    """The same from a grid; a first row without a name has gamma down and C across."""
    first, words = lines[0]
    width = len(lines[1][1])
    named = len(words) == width
    label = names[0] if named and not is_number(words[0]) else ""
    across = np.array([_number(word, source, first) for word in words[len(words) - width + 1 :]])
    down, body = [], []
    for number, row in lines[1:]:
        if len(row) != width:
            raise DataError(f"{source}, line {number}: {len(row)} values, but {width} in the line before")
        down.append(_number(row[0], source, number))
        body.append([_candela(word, source, number) for word in row[1:]])
        if len(down) > 1 and down[-1] <= down[-2]:
            raise DataError(f"{source}, line {number}: the angles down do not increase")
    if len(across) != width - 1:
        raise DataError(f"{source}, line {first}: {len(across)} angles for {width - 1} columns")
    if np.any(np.diff(across) <= 0.0):
        raise DataError(f"{source}, line {first}: the angles across do not increase")
    compass = "azimuth" in label
    rows, columns, candela = np.array(down), across, np.array(body)
    if label in _C or re.split(r"[^a-z-]+", label)[0] in (*_C, *_COMPASS):
        gamma, c = columns, rows
    else:
        gamma, c, candela = rows, columns, candela.T
    if compass and c[-1] == 360.0 and c[0] == 0.0:
        c, candela = c[:-1], candela[:-1]
    return gamma, c, candela, compass


def _refuse_repeats(directions: Floats, numbers: list[int], source: str) -> None:
    """Refuse a direction (gamma, C) that stands on two lines."""
    first: dict[tuple[float, float], int] = {}
    for (gamma, c), number in zip(directions.tolist(), numbers, strict=True):
        before = first.setdefault((gamma, c), number)
        if before != number:
            raise DataError(f"{source}, line {number}: gamma {gamma:g}, C {c:g} again, after line {before}")


def _words(line: str) -> list[str]:
    """Values of a line; with commas or semicolons a field may be empty (the corner of a grid) or hold blanks."""
    for mark in (";", ",", "\t"):
        if mark in line:
            return [word.strip().replace(" ", "_") for word in line.strip().rstrip(mark).split(mark)]
    return re.split(r"\s+", line.strip())


def _number(word: str, source: str, line: int) -> float:
    try:
        value = float(word)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise DataError(f"{source}, line {line}: {word!r} is not a number")
    return value


def _candela(word: str, source: str, line: int) -> float:
    value = _number(word, source, line)
    if value < 0.0:
        raise DataError(f"{source}, line {line}: {word} cd, a negative intensity")
    return value
