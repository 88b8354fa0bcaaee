"""The driver of the LS-110: one question, one answer, nothing in between."""

import math
from dataclasses import dataclass
from typing import Final, Literal

from drivers.exchange import FrameError, answer_within, open_within, span
from drivers.ls110.codec import (
    BAD_COMMAND,
    CHECK_CODES,
    END,
    LONGEST_REPLY,
    OK,
    OVER_RANGE,
    Calibration,
    CheckCode,
    Mode,
    Record,
    Reply,
    decode_reply,
    encode_command,
    encode_mode,
)
from drivers.serial_port import SerialSettings
from drivers.transport import Transport
from labdaq.clock import NS, Clock
from labdaq.errors import ConnectError, DeviceTimeout, Exchange, ProtocolError, RefusedError
from labdaq.reading import Flag, Instrument, Reading
from labdaq.units import Quantity, Unit, to_lab_unit

LINE: Final = SerialSettings(4800, 7, "E", 2)
"""The meter's fixed serial settings."""

_CONNECT_HINT: Final = (
    "switch the meter off, hold F and switch it on until a C shows at the lower right; point it at something bright "
    "(it may leave this mode after a very dark first reading); check the cable"
)
_LINE_HINT: Final = "check the serial settings (4800 7E2) and the cable; with wrong parity everything looks like noise"


@dataclass(frozen=True, slots=True)
class LuminanceMeterOptions:
    """What the station file says about a luminance meter.

    Attributes
    ----------
    channel
        Name of its readings.
    model
        ``LS-110`` or ``LS-100``; they differ in the digits they show and in range.
    serial, firmware, calibration
        Declared, since the protocol has no word for them.
    factory_calibration
        Set PRESET on connecting and refuse values made with a user's calibration or colour correction.
    response
        ``fast`` (0.1 s, wider range) or ``slow`` (0.4 s) sets that mode on connecting; ``as set`` leaves it.
    timeout_s
        Longest wait for a reply [s]; the meter itself gives up after 5 s.
    limit_relative, limit_digits_low, limit_digits
        The maker's limits of error, see `LuminanceMeter.read`.
    """

    channel: str = "luminance"
    model: Literal["LS-110", "LS-100"] = "LS-110"
    serial: str = ""
    firmware: str = ""
    calibration: str = ""
    factory_calibration: bool = True
    response: Literal["as set", "fast", "slow"] = "as set"
    timeout_s: float = 5.0
    limit_relative: float = 0.02
    limit_digits_low: int = 2
    limit_digits: int = 1


class LuminanceMeter:
    """An LS-110 or LS-100 in remote mode (switched on with F held).

    Parameters
    ----------
    name
        Its name in the station file.
    transport
        The line to it; a serial port is opened with `LINE`.
    clock
        What stamps readings and limits waiting.
    options
        See `LuminanceMeterOptions`.
    """

    def __init__(
        self, name: str, transport: Transport, clock: Clock, options: LuminanceMeterOptions | None = None
    ) -> None:
        self.options: Final = options or LuminanceMeterOptions()
        self._name = name
        self._line = transport
        self._clock = clock
        self._owed_until_ns: int | None = None  # an answer is still to come, at the latest then

    def identity(self) -> Instrument:
        """Who it is, as declared."""
        o = self.options
        return Instrument(
            name=self._name,
            model=o.model,
            serial=o.serial,
            firmware=o.firmware,
            port=self._line.place.port,
            calibration=o.calibration,
        )

    async def connect(self) -> None:
        """Open the line and set absolute values, no peak hold and (see options) the factory calibration.

        Raises `ConnectError` when the port cannot be had or nobody answers, `RefusedError` for an error code.
        """
        await open_within(self.options.timeout_s, self._line, self._clock)
        modes = [Mode.ABSOLUTE, Mode.CONTINUOUS]
        if self.options.factory_calibration:
            modes.append(Mode.PRESET)
        if self.options.response != "as set":
            modes.append(Mode.FAST if self.options.response == "fast" else Mode.SLOW)
        for mode in modes:
            try:
                await self._order(encode_mode(mode))
            except DeviceTimeout as error:
                raise ConnectError(
                    "the meter does not answer", place=error.place, exchange=error.exchange, hint=_CONNECT_HINT
                ) from error

    async def aclose(self) -> None:
        """Close the line; the meter stays in remote mode until it is switched off."""
        await self._line.aclose()

    async def read(self) -> Reading:
        """Measure once and return the luminance [cd/m²].

        The time given is the middle between question and answer, within which the meter measured; the duration is
        their distance. The standard uncertainty takes the maker's limits of error as the half-width of a uniform
        distribution (GUM 4.3.7): (2 % of the value + n digits)/√3, n = 2 below 10 cd/m² (LS-100: below 1 cd/m²), else
        1. These are the data sheet's figures for illuminant A; a certificate's go into the options.

        Too bright a field gives no value and the flag ``OVER_RANGE``. Raises `DeviceTimeout`, `ProtocolError` (void
        answer, or the meter left the mode it was set to), `RefusedError` (another error code), `ConnectError` (line
        gone).
        """
        return await self._value_of(encode_command("MES"), ())

    async def held(self) -> Reading:
        """Return the value on the display without a new measurement; flagged ``STALE``. Errors as for `read`."""
        return await self._value_of(encode_command("DSR"), (Flag.STALE,))

    async def clear_memory(self) -> None:
        """Clear the meter's memory (``CLE``)."""
        await self._order(encode_command("CLE"))

    async def _value_of(self, command: bytes, flags: tuple[Flag, ...]) -> Reading:
        reply, exchange, began_ns, retried = await self._ask(command)
        when = span(self._clock, began_ns, self._clock.mono_ns())
        flags += (Flag.RETRIED,) if retried else ()
        value: float | None = None
        uncertainty: float | None = None
        if reply.code in OVER_RANGE:
            flags += (Flag.OVER_RANGE,)
        else:
            record = self._accepted(reply, exchange)
            value, _ = to_lab_unit(record.value, record.unit)
            digit, _ = to_lab_unit(record.digit, record.unit)
            uncertainty = self._uncertainty(value, digit)
        return Reading(
            channel=self.options.channel,
            quantity=Quantity.LUMINANCE,
            value=value,
            unit=Unit.CANDELA_PER_M2,
            uncertainty=uncertainty,
            utc_ns=when.utc_ns,
            mono_ns=when.mono_ns,
            duration_s=when.duration_s,
            clock=self._clock.state(),
            instrument=self.identity(),
            flags=flags,
            raw=exchange.received.hex(),
        )

    def _uncertainty(self, value: float, digit: float) -> float:
        o = self.options
        low = value < (1.0 if o.model == "LS-100" else 10.0)
        digits = o.limit_digits_low if low else o.limit_digits
        return (o.limit_relative * value + digits * digit) / math.sqrt(3)

    def _accepted(self, reply: Reply, exchange: Exchange) -> Record:
        """Return the record if it is in the mode that was set."""
        record = reply.record
        if reply.code != OK:
            raise self._refused(reply.code, exchange)
        if record is None:
            raise self._broken("an acknowledgement came instead of a value", exchange)
        wrong = []
        if record.unit is Unit.PERCENT:
            wrong.append("percent of a reference")
        if record.peak:
            wrong.append("the peak, not the present value")
        if not record.held:
            wrong.append("the printer's stream, not the answer to a command")
        if self.options.factory_calibration and record.calibration not in {Calibration.PRESET, Calibration.NONE}:
            wrong.append(f"a user's calibration (letter {record.calibration.value})")
        if wrong:
            raise self._broken(
                f"the meter shows {' and '.join(wrong)}",
                exchange,
                "connect again, which sets its modes; somebody may have switched it off and on",
            )
        return record

    async def _order(self, command: bytes) -> None:
        reply, exchange, _, _ = await self._ask(command)
        if reply.code != OK:
            raise self._refused(reply.code, exchange)

    async def _ask(self, command: bytes) -> tuple[Reply, Exchange, int, bool]:
        """Return the reply, the exchange, when the (last) question was sent [mono ns], and whether it was repeated."""
        reply, exchange, began_ns = await self._exchange(command)
        if reply.code != BAD_COMMAND:
            return reply, exchange, began_ns, False
        return *await self._exchange(command), True

    async def _exchange(self, command: bytes) -> tuple[Reply, Exchange, int]:
        await self._await_what_is_owed()
        await self._line.drain_input()
        began_ns = self._clock.mono_ns()
        self._owed_until_ns = began_ns + round(self.options.timeout_s * NS)
        async with answer_within(self.options.timeout_s, self._line, self._clock, command, _CONNECT_HINT):
            await self._line.write(command)
            line = await self._line.read_until(END, LONGEST_REPLY)
        self._owed_until_ns = None
        exchange = Exchange(command, line, (self._clock.mono_ns() - began_ns) / NS)
        if line == command:
            raise self._broken("the line gives back what is sent", exchange, "switch off the echo of the adapter")
        try:
            return decode_reply(line), exchange, began_ns
        except FrameError as error:
            raise self._broken(str(error), exchange) from error

    async def _await_what_is_owed(self) -> None:
        """Wait for the answer to a question that was given up: while it measures, the meter accepts nothing."""
        if self._owed_until_ns is None:
            return
        remaining_s = (self._owed_until_ns - self._clock.mono_ns()) / NS
        if remaining_s > 0:
            try:
                async with self._clock.timeout(remaining_s):
                    await self._line.read_until(END, LONGEST_REPLY)
            except (TimeoutError, ProtocolError):
                pass  # it never came, or was noise: the meter listens again either way
        self._owed_until_ns = None

    def _broken(self, what: str, exchange: Exchange, hint: str = _LINE_HINT) -> ProtocolError:
        return ProtocolError(what, place=self._line.place, exchange=exchange, hint=hint)

    def _refused(self, code: str, exchange: Exchange) -> RefusedError:
        meaning, hint = CHECK_CODES.get(code, CheckCode("a code this driver does not know", "see the meter's manual"))
        return RefusedError(f"{code}: {meaning}", place=self._line.place, exchange=exchange, hint=hint)
