"""What the LS-110 says, as values: commands to bytes, bytes to replies. No waiting, no clock.

Source: Minolta, "LS-100/LS-110 Communication Manual", 9222-1842-12 (2000). A command and a reply end with CR LF;
there is no check sum, so a reply is taken only if its length, prefix, letters and number all fit. The manual prints a
blank after each comma that the meter does not seem to send; both are accepted.
"""

import math
import re
from dataclasses import dataclass
from enum import IntEnum, StrEnum
from typing import Final, NamedTuple

from drivers.exchange import FrameError
from labdaq.units import Unit

END: Final = b"\r\n"
LONGEST_REPLY: Final = 18
"""``OK00,`` with a blank, ten characters, CR LF."""


class Mode(IntEnum):
    """Settings of ``MDS``: four groups, of which each setting changes one."""

    PRESET = 0
    COLOUR_CORRECTION = 1
    USER_CALIBRATION = 2
    BOTH_CORRECTIONS = 3
    ABSOLUTE = 4
    PERCENT = 5
    FAST = 6
    SLOW = 7
    PEAK = 8
    CONTINUOUS = 9


class Calibration(StrEnum):
    """Third letter of a record: which calibration made the value."""

    PRESET = "P"
    USER = "L"
    COLOUR_CORRECTION = "K"
    BOTH = "T"
    NONE = " "  # a value in percent has none


class CheckCode(NamedTuple):
    """What a check code means, and what the operator should do about it."""

    meaning: str
    hint: str


OK: Final = "OK00"
BAD_COMMAND: Final = "ER00"
OVER_RANGE: Final = frozenset({"ER10", "ER19"})
"""Too bright for the detector range, too large for the display: the measurement has no value."""

CHECK_CODES: Final[dict[str, CheckCode]] = {
    "OK00": CheckCode("normal", ""),
    "ER00": CheckCode(
        "the command was not understood", "check the cable and the serial settings (4800 7E2), then connect again"
    ),
    "ER01": CheckCode("setting error (display: E)", "switch the meter off, hold F and switch it on"),
    "ER10": CheckCode(
        "too bright for the measuring range (display: E0)", "set the meter to FAST, or use a grey filter"
    ),
    "ER11": CheckCode(
        "a stored reference or correction factor is unusable (display: E1)",
        "set the factory calibration (MDS,00) or store the reference anew",
    ),
    "ER19": CheckCode("the value does not fit the display (display: E9)", "check the correction factor in the meter"),
    "ER20": CheckCode("EEPROM error (display: E2)", "the meter needs repair"),
    "ER30": CheckCode("the battery is exhausted", "put in a new battery, hold F and switch the meter on"),
}

_UNIT_OF: Final = {"c": Unit.CANDELA_PER_M2, "f": Unit.FOOTLAMBERT, "%": Unit.PERCENT}
_LETTER_OF: Final = {unit: letter for letter, unit in _UNIT_OF.items()}
_RECORD: Final = re.compile(rb"OK00, ?([CP])([cf%])([PLKT ])([MH])([ 0-9.]{6})\r\n")
_CODE_ALONE: Final = re.compile(rb"(OK00|ER\d\d)\r\n")
_NUMBER: Final = re.compile(r" *(\d+\.?\d*|\.\d+)")


@dataclass(frozen=True, slots=True)
class Record:
    """A value with the letters before it.

    Attributes
    ----------
    peak
        Whether it is the highest value since the measurement began, not the present one.
    unit
        cd/m², fL or percent, as a switch in the meter or its mode has it.
    calibration
        Which calibration made it.
    held
        Held value (reply to a command) or one of the printer's continuous stream.
    number
        The value's characters without padding, at most six.
    """

    peak: bool
    unit: Unit
    calibration: Calibration
    held: bool
    number: str

    @property
    def value(self) -> float:
        """The number in the record's own unit."""
        return float(self.number)

    @property
    def digit(self) -> float:
        """One step of the last digit shown; four digits are valid, whatever follows is filled with zeros."""
        decimals = len(self.number.partition(".")[2])
        shown = 10.0**-decimals
        return max(shown, 10.0 ** (math.floor(math.log10(self.value)) - 3)) if self.value > 0 else shown


@dataclass(frozen=True, slots=True)
class Reply:
    """A check code, and the record that came with it if there was one."""

    code: str
    record: Record | None = None


def encode_command(name: str, parameter: str = "") -> bytes:
    """Encode a command, e.g. ``MES`` or ``MDS`` with parameter ``04``; the comma before a parameter is needed."""
    return f"{name},{parameter}".encode("ascii") + END if parameter else name.encode("ascii") + END


def encode_mode(mode: Mode) -> bytes:
    """Encode the command that sets one mode."""
    return encode_command("MDS", f"{mode:02d}")


def encode_reply(reply: Reply) -> bytes:
    """Encode a reply as the meter sends it."""
    record = reply.record
    if record is None:
        return reply.code.encode("ascii") + END
    letters = (
        ("P" if record.peak else "C") + _LETTER_OF[record.unit] + record.calibration + ("H" if record.held else "M")
    )
    return f"{reply.code},{letters}{record.number:>6}".encode("ascii") + END


def decode_reply(line: bytes) -> Reply:
    """Decode one line with its CR LF; raises `FrameError` saying what does not fit."""
    if alone := _CODE_ALONE.fullmatch(line):
        return Reply(alone[1].decode("ascii"))
    found = _RECORD.fullmatch(line)
    if found is None:
        raise FrameError("not a reply of this meter")
    measuring, unit, calibration, state, columns = (part.decode("ascii") for part in found.groups())
    if (unit == "%") != (calibration == " "):
        raise FrameError(f"calibration letter {calibration!r} does not go with unit letter {unit!r}")
    if not _NUMBER.fullmatch(columns):
        raise FrameError(f"{columns!r} is not a number")
    record = Record(measuring == "P", _UNIT_OF[unit], Calibration(calibration), state == "H", columns.lstrip(" "))
    return Reply(OK, record)
