"""Rays as text: x y z l m n flux, one ray a line, with blanks, tabs or commas between.

Lines that start with ``#``, and a first line of names, are not rays. Places are in metres unless a comment
``# unit: mm`` says millimetres. Ray tracing programs that import rays as columns of text (TracePro, Zemax, LightTools
through a script) read and write this form; columns after the seventh (wavelength) are not read.
"""

import io
import warnings
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from analysis.text_numbers import is_number
from labdaq.errors import DataError
from labdaq.whole_file import write_whole_bytes

Floats = NDArray[np.float64]

FORM: Final = (
    "write a ray a line as x y z l m n flux, blanks, tabs or commas between, e.g. 0.1 -0.2 0.9 0 0 -1 2.5; "
    "# starts a comment, `# unit: mm` tells another unit than metres"
)
"""What text of rays looks like, for who wrote it otherwise."""

_UNITS = {"m": 1.0, "mm": 0.001, "cm": 0.01, "in": 0.0254, "ft": 0.3048}


def write_rows(path: Path, rows: Floats, title: str) -> None:
    """Write rows (n, 7) [m, lm]; commas in a ``.csv``, else blanks. Raises `StorageError`."""
    comma = path.suffix.lower() == ".csv"
    between = "," if comma else " "
    names = between.join(("x", "y", "z", "l", "m", "n", "flux"))
    text = io.StringIO()
    text.write(
        f"# {' '.join(title.split())}\n# unit: m, lm; x east, y north, z up, origin in the centre of the aperture\n"
    )
    text.write(f"{names}\n" if comma else f"# {names}\n")
    np.savetxt(text, rows, fmt=["%.7f"] * 3 + ["%.9f"] * 3 + ["%.7g"], delimiter=between)
    write_whole_bytes(path, text.getvalue().encode())


def read_rows(path: Path) -> Floats:
    """Read rows (n, 7) [m, lm]. Raises `DataError` naming file and line."""
    try:
        lines = path.read_text(encoding="utf-8-sig").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        raise DataError(f"{path}: {error}", FORM) from error
    unit = 1.0
    first = 0
    for number, line in enumerate(lines):
        words = line.replace(",", " ").split()
        if line.startswith("#"):
            if line[1:].strip().lower().startswith("unit:"):
                unit = _unit(path, number, line)
        elif words and not is_number(words[0]) and first == number:
            pass  # names of the columns
        elif words:
            break
        first = number + 1
    body = [line.replace(",", " ") for line in lines[first:]]
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # an empty body is told below
            rows: Floats = np.loadtxt(body, dtype=np.float64, usecols=range(7), ndmin=2)
    except ValueError:
        raise _first_mistake(path, body, first) from None
    if len(rows) == 0:
        raise DataError(f"{path}: no rays", FORM)
    bad = unusable(rows)
    if bad.any():
        number, line = _rays(body, first)[int(np.argmax(bad))]
        raise DataError(
            f"{path}, line {number}: {_short(line)} has an undefined place or direction, or negative flux", FORM
        )
    rows[:, :3] *= unit
    return rows


def unusable(rows: Floats) -> NDArray[np.bool_]:
    """Which rows (n, 7) make no ray: a number that is none, a direction without length, or negative flux."""
    length = np.linalg.norm(rows[:, 3:6], axis=1)
    return np.asarray(~(np.isfinite(rows).all(axis=1) & (length > 0.0) & (rows[:, 6] >= 0.0)))


def _unit(path: Path, number: int, line: str) -> float:
    word = line.split(":", 1)[1].replace(",", " ").split()[:1]
    if not word or word[0].lower() not in _UNITS:
        raise DataError(f"{path}, line {number + 1}: {line.strip()!r} names no unit of {', '.join(_UNITS)}")
    return _UNITS[word[0].lower()]


def _first_mistake(path: Path, body: list[str], first: int) -> DataError:
    for number, line in _rays(body, first):
        words = line.split("#")[0].split()
        if len(words) < 7 or not all(is_number(word) for word in words[:7]):
            return DataError(f"{path}, line {number}: {_short(line)} is not x y z l m n flux", FORM)
    return DataError(f"{path}: cannot be read as rows of x y z l m n flux", FORM)


def _rays(body: list[str], first: int) -> list[tuple[int, str]]:
    """The lines that should hold a ray, with their numbers in the file."""
    return [(number, line) for number, line in enumerate(body, first + 1) if line.split("#")[0].strip()]


def _short(line: str) -> str:
    return repr(line.strip()[:60])
