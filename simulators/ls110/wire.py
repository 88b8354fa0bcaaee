r"""The LS-110's dialogue: ASCII lines ended by CR LF, 4800 baud 7E2, one reply to a command, no check sum.

Source: Minolta "LS-100/LS-110 Communication Manual" 9222-1842-12; where it contradicts itself the reply is what its
examples and known clients agree on (no blank after the comma, ``MDS`` acknowledged bare, ``CCW`` under its own name).
"""

import contextlib
import re
from typing import Final

from labdaq.clock import Clock
from simulators.line import FaultBox, Line, SerialFormat, Wire
from simulators.ls110.meter import Held, LuminanceMeter, Trouble

STYLE: Final = SerialFormat(4800, data_bits=7, parity="E", stop_bits=2)

PARTIAL_COMMAND_S: Final = 5.0
"""A command not finished this long after its last character is answered with ``ER00`` and dropped [s]."""

THINKING_S: Final = 0.02
"""Time to answer a command that does not measure [s]; the reference allows anything below 0.1."""

_LONGEST = 32  # no command comes near it
_VALUE = re.compile(r" *(\d+\.?\d*|\.\d+)")  # right-justified in six columns

_CODES: Final = {
    Trouble.Kind.PARAMETER: "ER00",
    Trouble.Kind.RANGE_OVER: "ER10",
    Trouble.Kind.MEMORY: "ER11",
    Trouble.Kind.DISPLAY_OVER: "ER19",
    Trouble.Kind.BATTERY: "ER30",
}


def record(held: Held) -> str:
    """The ten characters of ``MES`` and ``DSR``: header letters and the value right-justified in six columns."""
    calibration = " " if held.unit == "%" else held.calibration
    return f"{'P' if held.peak else 'C'}{held.unit}{calibration}H{held.number:>6}"


class LuminanceMeterWire:
    """Gives a `LuminanceMeter` its serial line; call `serve` with whatever carries the bytes."""

    def __init__(
        self, meter: LuminanceMeter, clock: Clock, faults: FaultBox | None = None, *, pacing: bool = True
    ) -> None:
        self.meter = meter
        self.faults = faults or FaultBox()
        self._clock = clock
        self._pacing = pacing

    async def serve(self, wire: Wire) -> None:
        """Talk until the line ends."""
        await Line(wire, self._clock, STYLE, self.faults, pacing=self._pacing).converse(self._converse)

    async def _converse(self, line: Line) -> None:
        pending = bytearray()
        while True:
            try:
                async with self._clock.timeout(PARTIAL_COMMAND_S) if pending else contextlib.nullcontext():
                    data = await line.receive()
            except TimeoutError:
                pending.clear()
                await self._reply(line, "ER00")
                continue
            if not data:
                return
            pending += data
            while (end := pending.find(b"\r\n")) >= 0:
                command = pending[:end].decode("ascii", "replace")
                del pending[: end + 2]
                if await self._obey(line, command):
                    pending.clear()  # what came during a measurement was not accepted
            if len(pending) > _LONGEST:
                pending.clear()
                await self._reply(line, "ER00")

    async def _reply(self, line: Line, text: str) -> None:
        if self.meter.remote_mode:
            await line.send(text.encode("ascii") + b"\r\n", THINKING_S)

    async def _obey(self, line: Line, command: str) -> bool:
        """Answer one command; return whether it measured."""
        if not self.meter.remote_mode:
            return False
        measured = command == "MES"
        try:
            if measured:
                reply = await self._measure(line)
            else:
                reply = self._answer(command)
        except Trouble as trouble:
            reply = _CODES[trouble.kind]
        await self._reply(line, reply)
        return measured

    async def _measure(self, line: Line) -> str:
        """Measure with deaf ears: what arrives meanwhile is thrown away."""
        try:
            return f"OK00,{record(await self.meter.measure())}"
        finally:
            line.discard()

    def _answer(self, command: str) -> str:
        """The reply to every command but ``MES``."""
        meter = self.meter
        match command.split(",", 1):
            case ["DSR"]:
                return f"OK00,{record(meter.held())}"
            case ["CLE"]:
                meter.clear()
            case ["CMS"]:
                meter.store_percent_reference()
            case ["CMR"]:
                return f"OK00,{meter.unit},{meter.percent_reference:>6}"
            case ["LMR"]:
                return f"OK00,{meter.unit},{meter.lumi_reference:>6}"
            case ["CCR"]:
                return f"OK00,{meter.colour_correction}"
            case ["MDS", mode] if re.fullmatch(r"\d\d", mode):
                meter.set_mode(int(mode))
            case ["CMW", value]:
                meter.store_percent_reference(_six_columns(value))
            case ["LMW", value]:
                meter.store_lumi_reference(_six_columns(value))
            case ["CCW", factor] if re.fullmatch(r"\d\.\d{3}", factor):
                meter.store_colour_correction(float(factor))
            case _:
                raise Trouble(Trouble.Kind.PARAMETER)
        return "OK00"


def _six_columns(text: str) -> float:
    """A number in six columns; raises `Trouble`."""
    if len(text) != 6 or not _VALUE.fullmatch(text):
        raise Trouble(Trouble.Kind.PARAMETER)
    return float(text)
