"""An eight-channel analog input module of the ICP DAS tM-AD8 / M-7017 family: registers, ranges and conversions.

Register numbers and type codes: ICP DAS quick starts (tM-AD2, tM-AD4P2C2, tM-AD5C, tM-TH8, M-7017C), which agree.
Decided here, because no source says: a scan of all channels is converted with the ranges in force when it ends; in
engineering format a range's end is its millivolts (or microamperes) scaled to at most 20 000; a channel that is
switched off reads 0.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Final

import numpy as np
from numpy.typing import NDArray

from labdaq.clock import NS, Clock
from simulators.goniophotometer.units import ILLEGAL_ADDRESS, ILLEGAL_VALUE, Refusal

Floats = NDArray[np.float64]

CHANNELS: Final = 8

RANGES_V: Final = {0x08: 10.0, 0x09: 5.0, 0x0A: 1.0, 0x0B: 0.5, 0x0C: 0.15}
"""Full scale of the voltage ranges by type code [V]."""

CURRENT_TYPES: Final = {0x07, 0x0D, 0x1A}
"""4-20 mA, ±20 mA, 0-20 mA: on these inputs there is no current here, so they read zero."""

_ENGINEERING: Final = {0x08: 10_000, 0x09: 5000, 0x0A: 10_000, 0x0B: 5000, 0x0C: 15_000}

_TYPE, _FIRMWARE, _NAME, _ID, _COMM = 0x0100, 0x01E0, 0x01E2, 0x01E4, 0x01E5
_DELAY, _WATCHDOG_TIME, _ENABLED, _TRIPS = 0x01E7, 0x01E8, 0x01E9, 0x01EB
_OVER_RANGE, _PROTOCOL, _WATCHDOG_ON, _TRIPPED, _FORMAT, _RESET = 0x0080, 0x0100, 0x0104, 0x010C, 0x010D, 0x0110


@dataclass
class AnalogModule:
    """The module as a Modbus unit.

    Parameters
    ----------
    inputs
        Voltages at the terminals (8,) at a time, given as UTC and monotonic [ns].
    clock
        Its time.
    noise
        Random generator of conversion noise, of standard deviation ``noise_v`` [V].
    unit_id
        Number on the line, as its register tells it.
    conversion_s
        Time of one channel's conversion [s]; a scan takes eight.
    boot_s
        Silence after a restart [s].
    """

    inputs: Callable[[int, int], Floats]
    clock: Clock
    noise: np.random.Generator
    noise_v: float = 10e-6
    unit_id: int = 2
    conversion_s: float = 0.1
    boot_s: float = 1.0
    turnaround_s: float = 0.003
    answers_bad_crc: bool = False
    functions: frozenset[int] = frozenset({1, 2, 3, 4, 5, 6})
    _words: dict[int, int] = field(default_factory=dict)
    _coils: dict[int, bool] = field(default_factory=dict)
    _frozen: dict[int, int] = field(default_factory=dict)
    _codes: list[int] = field(default_factory=lambda: [0] * CHANNELS)
    _scans: int = 0

    def __post_init__(self) -> None:
        self._ready_ns = self._heard_ns = self.clock.mono_ns()
        self._set_up()

    def _set_up(self) -> None:
        self._words = {_TYPE + k: 0x08 for k in range(CHANNELS)}
        # the name follows the pattern of the family's smaller modules (2001/0700, 4001/0722); firmware A1.0
        self._words |= {_FIRMWARE: 0x0100, _FIRMWARE + 1: 0x00A1, _NAME: 0x8001, _NAME + 1: 0x0700}
        self._words |= {_ID: self.unit_id, _COMM: 0x0A, _DELAY: 0, _WATCHDOG_TIME: 0, _ENABLED: 0xFF, _TRIPS: 0}
        self._coils = {_PROTOCOL: True, _WATCHDOG_ON: False, _TRIPPED: False, _FORMAT: False, _RESET: True}
        self._codes, self._scans = [0] * CHANNELS, 0

    # --- faults that tests cause ---

    def reboot(self) -> None:
        """Restart: silence, then everything the host had set is lost and the reset flag is up."""
        self._ready_ns = self._heard_ns = self.clock.mono_ns() + round(self.boot_s * NS)
        self._set_up()

    def freeze(self, channel: int, code: int | None = None) -> None:
        """Keep a channel at ``code``, or at what it reads now."""
        self._convert()
        self._frozen[channel] = self._codes[channel] if code is None else code & 0xFFFF

    def thaw(self) -> None:
        """Let all channels convert again."""
        self._frozen.clear()

    # --- what the master asks ---

    @property
    def answering(self) -> bool:
        """Whether it has started."""
        return self.clock.mono_ns() >= self._ready_ns

    def read_bits(self, address: int, count: int) -> list[bool]:
        """Coils and range flags; raises `Refusal`."""
        self._hear()
        bits = [self._bit(at) for at in range(address, address + count)]
        if address <= _RESET < address + count:
            self._coils[_RESET] = False  # up only on the first reading
        return bits

    def read_words(self, address: int, count: int, *, inputs: bool) -> list[int]:
        """Readings at 0 to 7, settings beyond; raises `Refusal`."""
        self._hear()
        self._convert()
        readings = dict(enumerate(self._shown(k) for k in range(CHANNELS)))
        known = readings if inputs else readings | self._words
        wanted = range(address, address + count)
        if any(at not in known for at in wanted):
            raise Refusal(ILLEGAL_ADDRESS)
        return [known[at] for at in wanted]

    def write_bits(self, address: int, values: list[bool]) -> None:
        """Watchdog and data format; raises `Refusal`."""
        self._hear()
        (value,) = values
        match address:
            case 0x0104 | 0x010D:
                self._coils[address] = value
            case 0x010C:
                self._coils[_TRIPPED] = self._coils[_TRIPPED] and not value
            case _:
                raise Refusal(ILLEGAL_ADDRESS)

    def write_words(self, address: int, values: list[int]) -> None:
        """Type codes and settings; raises `Refusal`."""
        self._hear()
        (value,) = values
        if _TYPE <= address < _TYPE + CHANNELS:
            if value not in RANGES_V and value not in CURRENT_TYPES:
                raise Refusal(ILLEGAL_VALUE)
            self._convert()  # what was converted before keeps its range
        elif address == _TRIPS:
            value = 0
        elif address not in (_ID, _COMM, _DELAY, _WATCHDOG_TIME, _ENABLED):
            raise Refusal(ILLEGAL_ADDRESS)
        self._words[address] = value

    def _bit(self, address: int) -> bool:
        if _OVER_RANGE <= address < _OVER_RANGE + CHANNELS:
            return self._words[_TYPE + address - _OVER_RANGE] == 0x07  # under 4 mA; voltage ranges have no flag
        if address not in self._coils:
            raise Refusal(ILLEGAL_ADDRESS)
        return self._coils[address]

    def _hear(self) -> None:
        """Note that the host lives, and whether it was silent too long."""
        now = self.clock.mono_ns()
        allowed_ns = self._words[_WATCHDOG_TIME] * NS // 10
        if self._coils[_WATCHDOG_ON] and allowed_ns and now - self._heard_ns > allowed_ns:
            self._coils[_TRIPPED] = True
            self._coils[_WATCHDOG_ON] = False
            self._words[_TRIPS] += 1
        self._heard_ns = now

    # --- conversions ---

    def _convert(self) -> None:
        """Bring the codes up to the last scan that is complete."""
        scan_ns = round(self.conversion_s * CHANNELS * NS)
        now = self.clock.mono_ns()
        scans = (now - self._ready_ns) // scan_ns
        if scans <= self._scans:
            return
        self._scans = scans
        ended_ns = self._ready_ns + scans * scan_ns
        volts = self.inputs(self.clock.utc_ns() - (now - ended_ns), ended_ns)
        volts = volts + self.noise_v * self.noise.standard_normal(CHANNELS)
        self._codes = [self._code(k, float(volts[k])) for k in range(CHANNELS)]

    def _code(self, channel: int, volts: float) -> int:
        """Two's complement of the range: 7FFFh and 8000h at, and beyond, its ends."""
        full_scale = RANGES_V.get(self._words[_TYPE + channel])
        if full_scale is None or not self._words[_ENABLED] >> channel & 1:
            return 0
        return max(-32_768, min(32_767, round(volts / full_scale * 32_767))) & 0xFFFF

    def _shown(self, channel: int) -> int:
        code = self._frozen.get(channel, self._codes[channel])
        if not self._coils[_FORMAT]:
            return code
        signed = code - 0x10000 if code & 0x8000 else code
        return round(signed / 32_767 * _ENGINEERING.get(self._words[_TYPE + channel], 20_000)) & 0xFFFF
