"""Registers, words and alarms of the CS2RS stepper drive.

Registers and words after the CS2RS and iEM-RS manuals, status bits and trigger codes after two public drivers that
agree.
"""

from enum import IntFlag
from typing import Final

PULSES_PER_TURN: Final = 0x0001
STATUS: Final = 0x1003
FEEDBACK: Final = 0x1014
CONTROL: Final = 0x1801
ALARM: Final = 0x2203
TRIGGER: Final = 0x6002
PATH_0: Final = 0x6200

ABSOLUTE: Final = 0x0001
RUN_PATH_0: Final = 0x0010
HOME: Final = 0x0020
QUICK_STOP: Final = 0x0040
RESET_ALARM: Final = 0x1111


class Status(IntFlag):
    """Bits of the motion status word."""

    FAULT = 0x01
    ENABLED = 0x02
    RUNNING = 0x04
    COMMAND_DONE = 0x10
    PATH_DONE = 0x20
    HOMED = 0x40


ALARMS: Final[dict[int, str]] = {
    0x001: "over-current",
    0x002: "over-voltage",
    0x0A1: "current sampling fault",
    0x0C0: "over-voltage",
    0x0E0: "over-current",
    0x0F0: "over-temperature",
    0x150: "encoder cable",
    0x152: "motor phase lost",
    0x180: "position following error: the arm is blocked or too heavy",
    0x210: "an input is assigned twice",
    0x240: "EEPROM error",
}
"""Alarm codes; the small ones are the RS485 manuals', the others newer firmware's."""
