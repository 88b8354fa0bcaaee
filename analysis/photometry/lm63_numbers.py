"""The numbers of an LM-63 file, and on which line each of them stands.

Numbers are separated by spaces, commas or line ends. A whole file is converted at once; only when something is wrong
are its words looked at one by one, so that the message can name the place.
"""

import math
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from analysis.photometry.decimals import plain_decimals, words
from labdaq.errors import DataError

Floats = NDArray[np.float64]


class Numbers:
    """All numbers after the TILT line.

    Parameters
    ----------
    source
        File name for messages.
    body
        The bytes after the TILT line.
    first_line
        Line number of the first byte of ``body``.
    comma
        What commas are read as: a space between numbers, or a decimal point.

    Attributes
    ----------
    values : shape (n,)
        The numbers up to the first text that is none, all finite.
    text_after
        Whether other text follows.
    """

    def __init__(self, source: str, body: bytes, first_line: int, comma: bytes = b" ") -> None:
        self.source = source
        self.first_line = first_line
        if b"," in body:
            body = body.replace(b",", comma)
        self._body = body
        text = np.frombuffer(body, dtype=np.uint8)
        self._places, self._lengths = words(text)
        plain = plain_decimals(text, self._places, self._lengths)
        self.values = _convert(body.split(), suspicious=b"_" in body) if plain is None else plain
        self.text_after = len(self.values) < len(self._places)
        if not np.isfinite(self.values).all():
            bad = int(np.flatnonzero(~np.isfinite(self.values))[0])
            raise self.error(bad, f"{self.token(bad)!r} is not a finite number")

    def token(self, index: int) -> str:
        """The text of number ``index``."""
        start = self._places[index]
        return self._body[start : start + self._lengths[index]].decode("latin-1")

    @cached_property
    def starts(self) -> NDArray[np.intp]:
        """Index of the first number of each line, shape (lines + 1,); the last entry is the count of all."""
        text = np.frombuffer(self._body, dtype=np.uint8)
        feed, back = text == ord("\n"), text == ord("\r")
        ends = np.flatnonzero(feed | (back & ~np.concatenate([feed[1:], [False]])))
        lines = np.concatenate([[0], ends[ends < text.size - 1] + 1])
        return np.append(np.searchsorted(self._places, lines), self._places.size)

    def line(self, index: int) -> int:
        """Line number of number ``index``; the last line that holds a number for an index beyond the end."""
        index = max(0, min(index, int(self.starts[-1]) - 1))
        return self.first_line + max(0, int(np.searchsorted(self.starts, index, side="right")) - 1)

    def error(self, index: int, what: str, hint: str = "") -> DataError:
        """An error that names the line of number ``index``."""
        return DataError(f"{self.source}: line {self.line(index)}: {what}", hint)

    def need(self, end: int, what: str) -> None:
        """Raise `DataError` unless there are at least ``end`` numbers; ``what`` names the missing ones."""
        have = len(self.values)
        if have >= end:
            return
        if self.text_after:
            raise self.error(have, f"{self.token(have)!r} is not a number ({what} expected)")
        raise self.error(have, f"the file ends here, before the {what}", "is the file complete?")

    def whole(self, index: int, what: str) -> int:
        """Number ``index`` as a whole number."""
        self.need(index + 1, what)
        value = float(self.values[index])
        if value != math.floor(value):
            raise self.error(index, f"the {what} must be a whole number, not {self.token(index)}")
        return int(value)


def _convert(tokens: list[bytes], suspicious: bool) -> Floats:
    """Floats of the tokens before the first one that is no number."""
    if not suspicious:
        try:
            return np.fromiter(map(float, tokens), np.float64, len(tokens))
        except ValueError:
            pass
    good = next((i for i, token in enumerate(tokens) if not _is_number(token)), len(tokens))
    return np.fromiter(map(float, tokens[:good]), np.float64, good)


def _is_number(token: bytes) -> bool:
    try:
        float(token)
    except ValueError:
        return False
    return b"_" not in token  # Python reads 1_000 as a number, LM-63 does not
