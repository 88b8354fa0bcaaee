"""Many decimal numbers of a text at once, exactly as Python reads them one by one, in half of the time."""

from typing import Final

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Places = NDArray[np.intp]
Bytes = NDArray[np.uint8]

EXACT_DIGITS: Final = 15
"""Digits of a whole number that a double always holds, and of the power of ten that it is divided by."""

_TENS: Final = 10.0 ** np.arange(EXACT_DIGITS + 1)
_ZERO, _POINT, _MINUS = (np.uint8(ord(mark)) for mark in "0.-")


def words(text: Bytes) -> tuple[Places, Places]:
    """First places and lengths (n,) of the words between blanks, which are those of `bytes.split`."""
    blank = (text == ord(" ")) | ((text >= ord("\t")) & (text <= ord("\r")))
    edges = np.flatnonzero(np.diff(blank, prepend=True, append=True))
    return edges[::2], edges[1::2] - edges[::2]


def plain_decimals(text: Bytes, starts: Places, lengths: Places) -> Floats | None:
    """Values (n,) of the words of a text; None where a word is more than a minus, digits and one point.

    The digits make a whole number below 10^15 and the point a power of ten up to 10^15, both of which are doubles; so
    their quotient is the double nearest to the decimal (Clinger 1990, doi:10.1145/93548.93557).
    """
    longest = int(lengths.max(initial=0))
    if longest > EXACT_DIGITS + 2:
        return None
    whole = np.zeros(starts.size)
    digits, decimals, points = (np.zeros(starts.size, dtype=np.int8) for _ in range(3))
    inside = np.concatenate([text, np.zeros(longest, dtype=np.uint8)])
    for k in range(longest):
        mark = inside[starts + k]
        mark[lengths <= k] = 0
        value = mark - _ZERO
        digit = value < 10
        whole = np.where(digit, 10.0 * whole + value, whole)
        digits += digit
        decimals += digit & (points > 0)
        points += mark == _POINT
    negative = text[starts] == _MINUS
    plain = (digits + points + negative == lengths) & (digits > 0) & (digits <= EXACT_DIGITS) & (points < 2)
    if not plain.all():
        return None
    return np.where(negative, -1.0, 1.0) * whole / _TENS[decimals]
