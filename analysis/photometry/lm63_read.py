"""Read LM-63 files of 1986 to 2019: lenient about form, strict about numbers.

What can be understood in only one way is read and noted as an `Oddity` with its line; whatever could give a wrong
number is refused with one `DataError` that names the line and the reason.
"""

import re
from pathlib import Path
from typing import Final

import numpy as np

from analysis.photometry.lm63_header import parse_header
from analysis.photometry.lm63_model import Lm63, Oddity
from analysis.photometry.lm63_numbers import Numbers
from analysis.photometry.lm63_records import COUNTS, TILT_HEAD, Records
from labdaq.errors import DataError

_TILT: Final = re.compile(rb"^[ \t]*TILT[ \t]*=([^\n\r]*)\r?\n?", re.IGNORECASE | re.MULTILINE)


def read_lm63(path: Path | str) -> Lm63:
    """Read an LM-63 file.

    Raises
    ------
    DataError
        The file is missing, or malformed; the message names the line and the reason.
    """
    try:
        data = Path(path).read_bytes()
    except OSError as error:
        raise DataError(f"{path}: cannot be read ({error.strerror or error})") from error
    return parse_lm63(data, str(path))


def parse_lm63(data: bytes, source: str = "LM-63 data") -> Lm63:
    """Read LM-63 from memory; ``source`` names it in messages. Raises `DataError`."""
    data, oddities = _plain(data, source)
    match = _TILT.search(data)
    if match is None:
        raise DataError(f"{source}: no line starts with TILT=", "is this an LM-63 (.ies) file?")
    raw_lines = data[: match.start()].splitlines()
    tilt_line = len(raw_lines) + 1
    tilt_text = match[1].decode("latin-1")
    numbers, remarks = _settle_commas(source, data[match.end() :], tilt_line + 1, _includes(tilt_text))
    oddities += remarks
    if match[0].split(b"=")[0] != b"TILT" or tilt_text != tilt_text.strip():
        oddities.append(Oddity(tilt_line, "the TILT line has blanks or small letters around its words"))
    return Records(parse_header(raw_lines), numbers, oddities, tilt_line).read(tilt_text.strip())


def _includes(tilt_text: str) -> bool:
    return tilt_text.strip().upper() == "INCLUDE"


def _plain(data: bytes, source: str) -> tuple[bytes, list[Oddity]]:
    """Take off byte order marks and foreign line ends."""
    oddities = []
    if data.startswith((b"\xff\xfe", b"\xfe\xff")):
        try:
            data = data.decode("utf-16").encode("utf-8")
        except UnicodeDecodeError as error:
            raise DataError(f"{source}: line 1: starts like UTF-16 but is not ({error.reason})") from error
        oddities.append(Oddity(1, "the file is UTF-16; LM-63 is ASCII"))
    elif data.startswith(b"\xef\xbb\xbf"):
        data = data[3:]
        oddities.append(Oddity(1, "the file starts with a UTF-8 byte order mark"))
    if b"\0" in data:
        line = data[: data.index(b"\0")].count(b"\n") + 1
        raise DataError(f"{source}: line {line}: a zero byte; this is not a text file")
    if data.rstrip(b"\r\n \t").endswith(b"\x1a"):
        data = data.rstrip(b"\r\n \t\x1a") + b"\r\n"
        oddities.append(Oddity(max(1, data.count(b"\n")), "the file ends with Ctrl-Z"))
    if b"\r" in data and b"\n" not in data:
        data = data.replace(b"\r", b"\n")
        oddities.append(Oddity(1, "lines end with CR only"))
    elif data.count(b"\r\n") < data.count(b"\n"):
        oddities.append(Oddity(1, "lines end with LF instead of CR LF"))
    return data, oddities


def _settle_commas(source: str, body: bytes, line: int, include: bool) -> tuple[Numbers, list[Oddity]]:
    """Decide whether commas separate numbers or are decimal points; two different readings must never both fit."""
    separated = Numbers(source, body, line)
    if b"," not in body:
        return separated, []
    pointed = Numbers(source, body, line, comma=b".")
    if not _fits(pointed, include):
        return separated, []
    if _fits(separated, include) and not np.array_equal(separated.values, pointed.values):
        raise DataError(
            f"{source}: line {line}: the commas could be separators or decimal points", "write decimal points"
        )
    if np.array_equal(separated.values, pointed.values):
        return separated, []
    return pointed, [Oddity(line, "decimal commas, read as decimal points")]


def _fits(numbers: Numbers, include: bool) -> bool:
    """Whether there are exactly as many numbers as the counts among them announce."""
    values = numbers.values
    at = 0
    if include:
        if len(values) < TILT_HEAD or not values[1] >= 0:
            return False
        at = TILT_HEAD + 2 * int(values[1])
    if len(values) < at + COUNTS or numbers.text_after:
        return False
    n_v, n_h = values[at + 3], values[at + 4]
    return bool(len(values) == at + COUNTS + n_v + n_h + n_v * n_h)
