"""Numbers as the meter sends them: blocks of six characters, or single floats in hexadecimal."""

import math
import struct
from typing import Final

BLANK: Final = "      "
"""A block without a value."""


def long_block(value: float, decimals: int, *, zeros: bool = False) -> str:
    """Sign, four digits, exponent digit; the value is sign × digits × 10^(exponent - 4).

    Parameters
    ----------
    value
        What to send; beyond the largest four digits the exponent grows, and rounding comes first (999.96 with one
        decimal is ``+10004``).
    decimals
        Decimals of the fixed-point display the digits come from: 1 for lx, 4 for chromaticity, 0 for kelvin.
    zeros
        Whether leading digits are zeros rather than spaces.
    """
    exponent = 4 - decimals
    digits = round(abs(value) * 10**decimals)
    while digits > 9999:
        exponent += 1
        digits = round(abs(value) * 10.0 ** (4 - exponent))
    sign = "=" if digits == 0 else "-" if value < 0 else "+"
    return f"{sign}{digits:{'04d' if zeros else '4d'}}{exponent}"


def float_block(value: float) -> str:
    """Eight upper-case hexadecimal digits of a big-endian IEEE-754 single float."""
    return struct.pack(">f", value).hex().upper()


def parse_float_block(text: str) -> float:
    """Value of eight hexadecimal digits; NaN when they are not."""
    try:
        value: float = struct.unpack(">f", bytes.fromhex(text))[0]
    except (ValueError, struct.error):
        return math.nan
    return value
