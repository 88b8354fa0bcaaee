"""A Leadshine CS2RS closed-loop stepper drive: its registers, and what writing them makes the axis do.

Sources: CS2RS and iEM-RS manuals for the parameters, the PR block, the control word, feedback position and exceptions;
published drivers for the status bits, the triggers 20h, 21h, 40h and the homing registers (see the project's
reference). Not emulated: inputs and outputs, paths that call further paths, homing offsets (all homing methods find the
same mark), the coil functions 01, 05 and 0F.
"""

from dataclasses import dataclass, field
from typing import Final

from simulators.goniophotometer.arm import COUNTS_PER_REVOLUTION
from simulators.goniophotometer.axis import Axis, Pace, Phase
from simulators.goniophotometer.units import ILLEGAL_ADDRESS, ILLEGAL_VALUE, Refusal

MOST_WORDS: Final = 95
"""Words in one request or reply: messages are at most 200 bytes."""

STATUS, SAVE_STATUS, CONTROL, ALARM, TRIGGER = 0x1003, 0x1901, 0x1801, 0x2203, 0x6002
PATHS: Final = range(0x6200, 0x6280)  # 16 paths of 8 words: mode, position high, low, rpm, acc, dec, pause, trigger
ABSOLUTE, VELOCITY, RELATIVE = 0x0001, 0x0002, 0x0041
START: Final = 0x0010

NOT_SAVED, SAVED = 0x1111, 0x5555
OVER_CURRENT, FOLLOWING_ERROR = 0x00E0, 0x0180
"""Alarm codes of newer closed-loop firmware."""

_PARAMETERS: Final = {
    0x0001: COUNTS_PER_REVOLUTION,
    0x0003: 2,  # closed loop
    0x0007: 0,  # direction
    0x000F: 0,  # forced enable
    0x0191: 30,  # peak current, 0.1 A
    0x01BD: 6,
    0x01BF: 1,
    0x01C1: 4,
}
"""32-bit parameters: the low word is at the address, the high word just before."""

_WORDS: Final = {
    **dict.fromkeys((0x6000, 0x6006, 0x6007, 0x6008, 0x6009, 0x600A), 0),
    0x600F: 6,  # homing: high rpm, low rpm, acceleration, deceleration, stall time, stall current
    0x6010: 1,
    0x6011: 100,
    0x6012: 100,
    0x6013: 100,
    0x6014: 30,
    **dict.fromkeys(PATHS, 0),
}


@dataclass
class Drive:
    """The drive as a Modbus unit.

    Parameters
    ----------
    axis
        Its position control.
    answers_bad_crc
        Copy the vendor's habit of answering a corrupted frame with exception 08.
    turnaround_s
        Time from request to reply [s]: about 3 ms at 115 200 baud, 25 ms at 9600.
    """

    axis: Axis
    answers_bad_crc: bool = True
    turnaround_s: float = 0.003
    functions: frozenset[int] = frozenset({3, 6, 16})
    _save_status: int = NOT_SAVED
    _words: dict[int, int] = field(default_factory=lambda: _WORDS | _PARAMETERS)

    @property
    def answering(self) -> bool:
        """Always: it starts faster than anybody asks."""
        return True

    def power_cycle(self) -> None:
        """Forget position, homing and all settings; the arm stays where it is."""
        self.axis.power_cycle()
        self._words = _WORDS | _PARAMETERS

    def read_bits(self, address: int, count: int) -> list[bool]:
        """There are none."""
        raise Refusal(ILLEGAL_ADDRESS)

    def write_bits(self, address: int, values: list[bool]) -> None:
        """There are none."""
        raise Refusal(ILLEGAL_ADDRESS)

    def read_words(self, address: int, count: int, *, inputs: bool) -> list[int]:
        """Holding registers; raises `Refusal`."""
        if count > MOST_WORDS:
            raise Refusal(ILLEGAL_VALUE)
        live = self._live()
        words = [self._read(at, live) for at in range(address, address + count)]
        if address <= SAVE_STATUS < address + count:
            self._save_status = NOT_SAVED  # reading it takes it back
        return words

    def write_words(self, address: int, values: list[int]) -> None:
        """Holding registers, checked as a whole before anything is done; raises `Refusal`."""
        if len(values) > MOST_WORDS:
            raise Refusal(ILLEGAL_VALUE)
        new = dict(enumerate(values, address))
        for at, value in new.items():
            self._check(at, value, new)
        for at, value in new.items():
            self._write(at, value)

    def _read(self, address: int, live: dict[int, int]) -> int:
        if address in live:
            return live[address]
        if address in self._words:
            return self._words[address]
        if address + 1 in _PARAMETERS:
            return 0
        raise Refusal(ILLEGAL_ADDRESS)

    def _live(self) -> dict[int, int]:
        """Registers that follow the motor."""
        axis = self.axis
        busy = {Phase.ACCEPTED: 0x010, Phase.RUNNING: 0x100, Phase.SETTLING: 0x100, Phase.DONE: 0x000}[axis.phase]
        live = {
            STATUS: axis.status,
            SAVE_STATUS: self._save_status,
            ALARM: axis.alarm,
            TRIGGER: busy + axis.path,
        }
        (command, command_rpm), (actual, actual_rpm) = axis.commanded(), axis.actual()
        live |= _pair(0x1012, command) | _pair(0x1014, actual) | _pair(0x602A, command) | _pair(0x602C, actual)
        return live | _pair(0x1044, round(command_rpm)) | _pair(0x1046, round(actual_rpm))

    def _check(self, address: int, value: int, new: dict[int, int]) -> None:
        """Raise `Refusal` for what must not be written."""
        if address in PATHS:
            word = (address - PATHS.start) % 8
            unknown_mode = word == 0 and value not in {0, ABSOLUTE, VELOCITY, RELATIVE}
            no_speed = word == 7 and value == START and not new.get(address - 4, self._words[address - 4])
            if unknown_mode or no_speed:
                raise Refusal(ILLEGAL_VALUE)
        elif address == TRIGGER:
            if value not in {0x020, 0x021, 0x040, *range(0x010, 0x020)}:
                raise Refusal(ILLEGAL_VALUE)
        elif address not in self._words and address != CONTROL and address + 1 not in _PARAMETERS:
            raise Refusal(ILLEGAL_ADDRESS)

    def _write(self, address: int, value: int) -> None:
        if address == CONTROL:
            self._control(value)
        elif address == TRIGGER:
            self._trigger(value)
        elif address in self._words:
            self._words[address] = value
            if address == 0x0007:
                self.axis.reversed = bool(value)
            elif address == 0x000F and value == 1:
                self.axis.enabled = True
            elif address in PATHS and address % 8 == 7 and value == START:
                self._run((address - PATHS.start) // 8)

    def _control(self, value: int) -> None:
        match value:
            case 0x1111:
                self.axis.alarm = 0
            case 0x2211:
                self._save_status = SAVED
            case 0x4001 | 0x4002:
                self.axis.jog(1 if value == 0x4001 else -1)

    def _trigger(self, value: int) -> None:
        words = self._words
        match value:
            case 0x020:
                fast = Pace(words[0x600F], words[0x6011], words[0x6012])
                self.axis.home(bool(words[0x600A] & 0x01), fast, words[0x6010])
            case 0x021:
                self.axis.zero_here()
            case 0x040:
                self.axis.quick_stop()
            case _:
                self._run(value - 0x010)

    def _run(self, path: int) -> None:
        """Start a path of the PR block."""
        words = self._words
        mode, high, low, rpm, acc, dec = (words[PATHS.start + 8 * path + k] for k in range(6))
        if mode == VELOCITY:
            self.axis.spin(Pace(_signed(0xFFFF if rpm & 0x8000 else 0, rpm), acc, dec), path)
        elif mode in (ABSOLUTE, RELATIVE):
            limits = None
            if words[0x6000] & 0x02:
                limits = _signed(words[0x6008], words[0x6009]), _signed(words[0x6006], words[0x6007])
            pace = Pace(rpm, acc, dec)
            self.axis.go(_signed(high, low), pace, relative=mode == RELATIVE, limits=limits, path=path)


def _pair(address: int, value: int) -> dict[int, int]:
    """A 32-bit value in two registers, high word first."""
    unsigned = value & 0xFFFF_FFFF
    return {address: unsigned >> 16, address + 1: unsigned & 0xFFFF}


def _signed(high: int, low: int) -> int:
    value = high << 16 | low
    return value - (1 << 32) if value & 1 << 31 else value
