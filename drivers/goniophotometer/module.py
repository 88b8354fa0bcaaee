"""An 8-channel analog input module of ICP DAS (tM-AD8, M-7017 family) on a Modbus line.

Register map after the quick-start guides of tM-AD2, tM-AD4P2C2, tM-AD5C, tM-TH8 and M-7017C, which agree. Values are
read in hexadecimal format: 0x7FFF is full scale, 0x8000 minus full scale. Voltage ranges have no over-range flag, so
those two codes mean saturated.
"""

from dataclasses import dataclass
from typing import Final

from drivers.goniophotometer.codec import Function, signed_word
from drivers.goniophotometer.line import Line
from labdaq.errors import ConfigError, RefusedError

_VALUES: Final = 0x0000
_TYPE_CODES: Final = 0x0100
_FIRMWARE_AND_NAME: Final = 0x01E0
_ENGINEERING_FORMAT: Final = 0x010C
_RESET_FLAG: Final = 0x0110

CHANNELS: Final = 8
FULL_SCALE_V: Final[dict[int, float]] = {0x08: 10.0, 0x09: 5.0, 0x0A: 1.0, 0x0B: 0.5, 0x0C: 0.15}
"""Type code to full scale [V] of the voltage ranges."""
SATURATED_HIGH: Final = 0x7FFF
SATURATED_LOW: Final = 0x8000


@dataclass(frozen=True, slots=True)
class ModuleOptions:
    """What the station file says about an analog module.

    Attributes
    ----------
    unit
        The module on the line.
    type_code
        Range of all its channels, see `FULL_SCALE_V`.
    module_name
        Its name registers as eight hexadecimal digits, high word first (``07002001`` for a tM-AD2); empty: not checked.
    settle_s
        Wait after a range was changed, until the values are of the new one [s].
    """

    unit: int
    type_code: int = 0x08
    module_name: str = ""
    settle_s: float = 1.0

    def __post_init__(self) -> None:
        if self.type_code not in FULL_SCALE_V:
            known = ", ".join(f"0x{code:02X} (±{volts:g} V)" for code, volts in FULL_SCALE_V.items())
            raise ConfigError(f"analog module {self.unit}: type code 0x{self.type_code:02X} is no voltage range", known)

    @property
    def volts_per_code(self) -> float:
        """One step of the converter [V]."""
        return FULL_SCALE_V[self.type_code] / SATURATED_HIGH


class AnalogModule:
    """One module on its line.

    Attributes
    ----------
    module_name, firmware
        What the module says it is, eight hexadecimal digits each; empty before `connect`.
    """

    def __init__(self, line: Line, options: ModuleOptions) -> None:
        self.options: Final = options
        self.module_name = ""
        self.firmware = ""
        self._line = line

    async def connect(self) -> None:
        """Check who it is, set format and ranges, and forget that it was switched on.

        Raises `RefusedError` for another module or one that does not keep its settings, and the line's errors.
        """
        o = self.options
        low, high, name_low, name_high = await self._line.read_words(o.unit, _FIRMWARE_AND_NAME, 4)
        self.firmware, self.module_name = f"{high:04X}{low:04X}", f"{name_high:04X}{name_low:04X}"
        if o.module_name and o.module_name.upper() != self.module_name:
            raise self._refusal(
                f"this is module {self.module_name}, the station file says {o.module_name.upper()}",
                "check the unit numbers on the modules and in the station file",
            )
        await self._restarted()
        changed = False
        if (await self._line.read_bits(o.unit, _ENGINEERING_FORMAT, 1))[0]:
            await self._line.write_coil(o.unit, _ENGINEERING_FORMAT, False)
            changed = True
        for channel, code in enumerate(await self._line.read_words(o.unit, _TYPE_CODES, CHANNELS)):
            if code != o.type_code:
                await self._line.write_word(o.unit, _TYPE_CODES + channel, o.type_code)
                changed = True
        if changed:
            await self._line.clock.sleep(o.settle_s)
            await self._check_settings()

    async def read_codes(self) -> tuple[int, ...]:
        """Read the eight channels as raw words (two's complement of the range).

        Raises `RefusedError` when the module was restarted since `connect`: its settings may be lost and these values
        void.
        """
        codes = await self._line.read_words(self.options.unit, _VALUES, CHANNELS, Function.READ_REGISTERS)
        if await self._restarted():
            raise self._refusal(
                "the module was restarted in the middle of the run, its settings may be lost",
                "check its power supply, then connect again",
            )
        return codes

    def volts(self, code: int) -> float:
        """Voltage [V] of a raw word."""
        return signed_word(code) * self.options.volts_per_code

    async def _restarted(self) -> bool:
        """Whether this is the first such question since the module was switched on."""
        return bool((await self._line.read_bits(self.options.unit, _RESET_FLAG, 1))[0])

    async def _check_settings(self) -> None:
        o = self.options
        codes = await self._line.read_words(o.unit, _TYPE_CODES, CHANNELS)
        engineering = (await self._line.read_bits(o.unit, _ENGINEERING_FORMAT, 1))[0]
        if engineering or any(code != o.type_code for code in codes):
            raise self._refusal(
                f"the module did not take type code 0x{o.type_code:02X} in hexadecimal format on all channels",
                "check that it is a voltage module and not write-protected (INIT switch)",
            )

    def _refusal(self, what: str, hint: str) -> RefusedError:
        return RefusedError(what, place=self._line.place(self.options.unit), hint=hint)
