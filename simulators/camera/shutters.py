"""Shutter times by name, by PTP code, and as they truly are.

Nikon's ExposureTime property (500Dh) counts tenths of a millisecond and is truncated, so 1/4000 s is 2 and 1/15 s is,
in two dumps of Coolpix cameras, 662. Behind the names lies a ladder of exact powers of two (or of their cube roots):
1/60 s is 1/64 s.
"""

from dataclasses import dataclass
from fractions import Fraction
from typing import Final


@dataclass(frozen=True, slots=True)
class Shutter:
    """One shutter time.

    Attributes
    ----------
    code
        Value of property 500Dh.
    nominal_s
        Its name [s], as EXIF has it.
    ladder_s
        The time on the exact ladder [s].
    """

    code: int
    nominal_s: Fraction
    ladder_s: float


_COOLPIX_CODES: Final = (80_000, 40_000, 20_000, 10_000, 5000, 2500, 1250, 662, 333, 167, 80, 40, 20, 10, 5, 2)
_COOLPIX_NAMES: Final = "8 4 2 1 1/2 1/4 1/8 1/15 1/30 1/60 1/125 1/250 1/500 1/1000 1/2000 1/4000"

COOLPIX: Final = tuple(
    Shutter(code, Fraction(name), 2.0 ** (3 - k))
    for k, (code, name) in enumerate(zip(_COOLPIX_CODES, _COOLPIX_NAMES.split(), strict=True))
)
"""Sixteen whole stops from 8 s to 1/4000 s: the list of the Coolpix 5000 and 5700 (libgphoto2's camera dumps)."""

_THIRDS: Final = """30 25 20 15 13 10 8 6 5 4 3 5/2 2 8/5 13/10 1 10/13 5/8 1/2 2/5 1/3 1/4 1/5 1/6 1/8 1/10 1/13 1/15
1/20 1/25 1/30 1/40 1/50 1/60 1/80 1/100 1/125 1/160 1/200 1/250 1/320 1/400 1/500 1/640 1/800 1/1000 1/1250 1/1600
1/2000 1/2500 1/3200 1/4000"""

THIRD_STOPS: Final = tuple(
    Shutter(int(Fraction(name) * 10_000), Fraction(name), 2.0 ** (5 - k / 3)) for k, name in enumerate(_THIRDS.split())
)
"""Thirds of a stop from 30 s to 1/4000 s, codes truncated."""
