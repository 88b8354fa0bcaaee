"""Frames, data blocks and status characters of the CL-200 and CL-200A, as values. No waiting, no clock.

Source: Konica Minolta technical note KMSE CS-A32T.0100, "Chroma Meter CL-200A Communication Specifications" (2010).

A frame is STX, head (2 decimal digits), command (2), four characters (parameter of a request, status of a reply),
data, ETX, check sum, CR LF. The check sum is the XOR of everything after STX up to and *including* ETX, as two
hexadecimal digits (the note's sentence says "excluding", its table, example, program and every printed sum include
it).
"""

import re
import struct
from dataclasses import dataclass
from enum import StrEnum
from functools import reduce
from operator import xor
from typing import Final

from drivers.exchange import FrameError

STX: Final = b"\x02"
ETX: Final = b"\x03"
END: Final = b"\r\n"
BROADCAST: Final = 99
"""Head number that all heads obey and none answers."""
LENGTHS: Final = frozenset({14, 32, 38})
"""Short (no data), long (three blocks of six), special (three blocks of eight hexadecimal digits)."""


class Command(StrEnum):
    """What a frame asks for, or answers."""

    XYZ = "01"
    EV_XY = "02"
    EV_UV = "03"
    EV_TCP_DUV = "08"
    EV_WAVELENGTH_PURITY = "15"
    EXTERNAL = "40"
    RAW_X2YZ = "45"
    READ_COEFFICIENTS = "47"
    WRITE_COEFFICIENTS = "48"
    CONNECT = "54"
    HOLD = "55"


CONNECT_PARAMETER: Final = "1   "
HOLD_PARAMETER: Final = "1  0"
SET_EXTERNAL_PARAMETER: Final = "10  "
TRIGGER_PARAMETER: Final = "21  "
FACTORY_PARAMETER: Final = "1200"
"""Read without the user's calibration matrix, normal mode: the meter applies what each request says."""

LONG_REPLIES: Final = frozenset(
    {Command.XYZ, Command.EV_XY, Command.EV_UV, Command.EV_TCP_DUV, Command.EV_WAVELENGTH_PURITY}
)
_HEX_BLOCK: Final = re.compile(r"[0-9A-Fa-f]{8}")
_BLOCK: Final = re.compile(rb"([+\-=])( *\d+)(\d)")
_INNER: Final = re.compile(rb"(\d\d)(\d\d)([ -~]{4})([ -~]*)")


@dataclass(frozen=True, slots=True)
class Frame:
    """One frame, in either direction.

    Attributes
    ----------
    head
        0 to 29, or `BROADCAST`.
    command
        What it is about.
    note
        Four characters: the parameter of a request, the status of a reply.
    data
        Nothing, 18 or 24 characters.
    """

    head: int
    command: Command
    note: str
    data: str = ""

    def __post_init__(self) -> None:
        if not (0 <= self.head <= 29 or self.head == BROADCAST):
            raise FrameError(f"head {self.head} is neither 0 to 29 nor {BROADCAST}")
        if len(self.note) != 4 or len(self.data) not in {0, 18, 24}:
            raise FrameError(f"{len(self.note)} characters of parameter and {len(self.data)} of data make no frame")


def check_sum(inner: bytes) -> bytes:
    """XOR of ``inner`` (first head digit through ETX) as two upper-case hexadecimal digits."""
    return f"{reduce(xor, inner, 0):02X}".encode("ascii")


def encode(frame: Frame) -> bytes:
    """Encode a frame with its check sum."""
    inner = f"{frame.head:02d}{frame.command.value}{frame.note}{frame.data}".encode("ascii") + ETX
    return STX + inner + check_sum(inner) + END


def decode(line: bytes) -> Frame:
    """Decode one line that ends with CR LF, from its last STX on; raises `FrameError` saying what makes it void."""
    start = line.rfind(STX)
    if start < 0:
        raise FrameError("no beginning of a frame (STX)")
    raw = line[start:]
    if len(raw) not in LENGTHS:
        raise FrameError(f"a frame of {len(raw)} bytes, not 14, 32 or 38")
    inner, given, end = raw[1:-4], raw[-4:-2], raw[-2:]
    if end != END or not inner.endswith(ETX):
        raise FrameError("the frame does not end with ETX, check sum, CR LF")
    if check_sum(inner) != given.upper():
        raise FrameError(f"check sum {given!r} instead of {check_sum(inner)!r}")
    found = _INNER.fullmatch(inner[:-1])
    if found is None:
        raise FrameError("characters that no frame has")
    head, command, note, data = (part.decode("ascii") for part in found.groups())
    if command not in set(Command):
        raise FrameError(f"command {command} does not exist")
    return Frame(int(head), Command(command), note, data)


@dataclass(frozen=True, slots=True)
class Number:
    """A six-character block: sign, four digits, exponent.

    Attributes
    ----------
    value
        The number, in the unit of its column (lx, K, or none).
    digit
        One step of its last digit.
    """

    value: float
    digit: float


def decode_block(block: str) -> Number | None:
    """Decode a six-character block: ±dddd × 10^(exponent - 4); six blanks are no value (``None``).

    Leading digits may be blanks or zeros; the sign ``=`` (plus or minus) goes with zero. Raises `FrameError`.
    """
    if block == " " * 6:
        return None
    found = _BLOCK.fullmatch(block.encode("ascii", "replace"))
    if len(block) != 6 or found is None:
        raise FrameError(f"{block!r} is not a number")
    sign, digits, exponent = found[1], int(found[2]), int(found[3])
    if sign == b"=" and digits:
        raise FrameError(f"{block!r} is neither positive nor negative")
    magnitude = float(f"{digits}e{exponent - 4}")
    return Number(-magnitude if sign == b"-" else magnitude, float(f"1e{exponent - 4}"))


def encode_block(value: float | None, exponent: int) -> str:
    """Encode a block with four digits after rounding to 10^(exponent - 4); raises `FrameError` if it does not fit."""
    if value is None:
        return " " * 6
    digits = round(abs(value) * 10.0 ** (4 - exponent))
    if digits > 9999 or not 0 <= exponent <= 9:
        raise FrameError(f"{value} does not fit four digits with exponent {exponent}")
    sign = "=" if digits == 0 else "-" if value < 0 else "+"
    return f"{sign}{digits:4d}{exponent}"


def long_data(frame: Frame) -> tuple[Number | None, Number | None, Number | None]:
    """Return the three numbers of a reply to 01, 02, 03, 08 or 15; raises `FrameError`."""
    if frame.command not in LONG_REPLIES or len(frame.data) != 18:
        raise FrameError(f"a reply to {frame.command.value} with {len(frame.data)} characters of data")
    data = frame.data
    return decode_block(data[:6]), decode_block(data[6:12]), decode_block(data[12:])


def special_data(frame: Frame) -> tuple[float, float, float]:
    """Return the three float32 of a reply to 45 or 47 (big-endian, as hexadecimal digits); raises `FrameError`."""
    blocks = (frame.data[:8], frame.data[8:16], frame.data[16:])
    if not all(_HEX_BLOCK.fullmatch(block) for block in blocks):
        raise FrameError(f"{frame.data!r} are not three blocks of eight hexadecimal digits")
    x, y, z = (struct.unpack(">f", bytes.fromhex(block))[0] for block in blocks)
    return x, y, z


def encode_special(values: tuple[float, float, float]) -> str:
    """Encode three float32 as a special block."""
    return struct.pack(">3f", *values).hex().upper()


class Complaint(StrEnum):
    """What the status of a reply complains about, the most serious first.

    A low battery comes before everything, then the range, then the error character, as the maker's note has it.
    """

    BATTERY = "the battery is low: its values must not be used"
    OUT_OF_RANGE = "the range is being changed: measure again"
    RANGE_UNKNOWN = "the range was not determined yet: measure again"
    HEAD_POWER = "the head lost its power"
    EEPROM = "the head's memory is faulty"
    NOT_HELD = "the meter is not in hold mode"
    TOO_BRIGHT = "too bright for the meter"
    LOW_LIGHT = "little light: colour values are inaccurate"
    NO_COLOUR_TEMPERATURE = "colour temperature cannot be computed"


_ERRORS: Final[dict[str, Complaint | None]] = {
    " ": None,
    "1": Complaint.HEAD_POWER,
    "2": Complaint.EEPROM,
    "3": Complaint.EEPROM,
    "4": Complaint.NOT_HELD,
    "5": Complaint.TOO_BRIGHT,
    "6": Complaint.LOW_LIGHT,
    "7": Complaint.NO_COLOUR_TEMPERATURE,
}
_RANGES: Final[dict[str, Complaint | None]] = {
    "0": Complaint.RANGE_UNKNOWN,
    "6": Complaint.OUT_OF_RANGE,
    "1": None,
    "2": None,
    "3": None,
    "4": None,
    " ": None,
}


def error_of(frame: Frame) -> Complaint | None:
    """Return the complaint of the error character alone (as a reply to 40 has it); raises `FrameError`."""
    if frame.note[1] not in _ERRORS:
        raise FrameError(f"error character {frame.note[1]!r} does not exist")
    return _ERRORS[frame.note[1]]


def complaint_of(frame: Frame) -> Complaint | None:
    """Return what the status of a measured reply complains about, or ``None``; raises `FrameError`.

    The first status character only tells whether the meter runs or holds and is not looked at.
    """
    error = error_of(frame)
    reach, battery = frame.note[2], frame.note[3]
    if reach not in _RANGES or battery not in "01 ":
        raise FrameError(f"status {frame.note!r} does not exist")
    if battery == "1":
        return Complaint.BATTERY
    return _RANGES[reach] or error
