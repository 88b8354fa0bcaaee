"""Exposure times as cameras write them, and as they are.

Property 500D counts tenths of a millisecond and is cut off to whole ones: 1/4000 s is written as 2, a fifth too
short. What the dial means is the fraction, so each number is traced back to it; the truth of a picture is in its EXIF
data.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

from labdaq.errors import ConfigError

TENTH_MS: Final = 1e-4
"""Unit of property 500D [s]."""
_NO_TIME: Final = 0xFFFF_FFFD
"""From here on numbers mean bulb and the like."""
_SLOPPY: Final = 0.01
"""How far a camera's number may be off the cut-off fraction: 1/15 s is written as 662 instead of 666."""
_SAME: Final = 0.1
"""Steps of a dial are at least a fifth apart; a wish within a tenth of one means it."""

_FULL_STOPS: Final = (
    *(60.0, 30.0, 15.0, 8.0, 4.0, 2.0, 1.0),
    *(1 / n for n in (2, 4, 8, 15, 30, 60, 125, 250, 500, 1000, 2000, 4000, 8000, 16000)),
)
_HALF_STOPS: Final = (
    *(45.0, 20.0, 10.0, 6.0, 3.0, 1.5, 0.7, 1 / 3, 1 / 6, 0.1),
    *(1 / n for n in (20, 45, 90, 180, 350, 750, 1500, 3000, 6000)),
)
_THIRD_STOPS: Final = (
    *(50.0, 40.0, 25.0, 20.0, 13.0, 10.0, 6.0, 5.0, 3.0, 2.5, 1.6, 1.3, 0.8, 0.6, 0.5, 0.4, 0.3),
    *(1 / n for n in (3, 5, 6, 10, 13, 20, 25, 40, 50, 80, 100, 160, 200, 320, 400, 640, 800, 1250, 1600)),
    *(1 / n for n in (2500, 3200, 5000, 6400, 10000, 12800)),
)
_DIALS: Final = tuple(
    tuple(sorted(set(dial), reverse=True))
    for dial in (_FULL_STOPS, _FULL_STOPS + _HALF_STOPS, _FULL_STOPS + _THIRD_STOPS)
)


@dataclass(frozen=True, slots=True)
class Shutter:
    """One step of the dial: the number the camera knows it by, and the exposure time it means [s]."""

    raw: int
    exposure_s: float


def from_tenths_of_ms(numbers: Sequence[int]) -> tuple[Shutter, ...]:
    """Trace all values of property 500D back to the dial, longest first.

    The coarsest dial (full, half or third stops) that explains all of them is taken; numbers that none explains mean
    what they say.
    """
    times = sorted({number for number in numbers if 0 < number < _NO_TIME}, reverse=True)
    for dial in _DIALS:
        traced = [_on_dial(number, dial) for number in times]
        if all(traced) and len(set(traced)) == len(times):
            return tuple(Shutter(number, exposure_s or 0.0) for number, exposure_s in zip(times, traced, strict=True))
    return tuple(Shutter(number, _on_dial(number, _DIALS[-1]) or number * TENTH_MS) for number in times)


def _on_dial(number: int, dial: Sequence[float]) -> float | None:
    """Return the fraction that is written as ``number``: cut off, rounded, or a little wrong."""
    fitting = [
        exposure_s
        for exposure_s in dial
        if number == int(exposure_s / TENTH_MS + 1e-6) or abs(number - exposure_s / TENTH_MS) <= _SLOPPY * number
    ]
    rounded = [exposure_s for exposure_s in dial if number == round(exposure_s / TENTH_MS)]
    return min(fitting or rounded, key=lambda exposure_s: abs(exposure_s / TENTH_MS - number), default=None)


def from_ratios(numbers: Sequence[int]) -> tuple[Shutter, ...]:
    """Read Nikon's own property D100, an exact ratio: numerator in the upper, denominator in the lower 16 bits."""
    steps = {
        Shutter(number, (number >> 16) / (number & 0xFFFF))
        for number in numbers
        if 0 < number < _NO_TIME and number & 0xFFFF and number >> 16
    }
    return tuple(sorted(steps, key=lambda step: -step.exposure_s))


def nearest(steps: Sequence[Shutter], exposure_s: float) -> Shutter:
    """Return the step that an exposure time [s] means; raises `ConfigError` listing the steps when there is none."""
    step = min(steps, key=lambda step: abs(step.exposure_s - exposure_s))
    if abs(step.exposure_s - exposure_s) > _SAME * exposure_s:
        offered = ", ".join(in_words(each.exposure_s) for each in steps)
        raise ConfigError(f"the camera has no exposure time of {exposure_s:g} s", f"it offers {offered}")
    return step


def in_words(exposure_s: float) -> str:
    """Write an exposure time as on the dial: ``1/125 s``, ``2 s``."""
    if exposure_s < 0.4 and abs(1 / exposure_s - round(1 / exposure_s)) < 0.02 / exposure_s:
        return f"1/{round(1 / exposure_s)} s"
    return f"{exposure_s:g} s"
