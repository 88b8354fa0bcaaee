"""The CL-200A's dialogue on its serial line, 9600 baud 7E1. The meter never complains: what is wrong gets no answer."""

import re
from typing import Final

import numpy as np

from labdaq.clock import Clock
from simulators.cl200 import colour
from simulators.cl200.blocks import BLANK, float_block, long_block, parse_float_block
from simulators.cl200.frames import Request, frame, take_request
from simulators.cl200.meter import ChromaMeter, Floats
from simulators.line import FaultBox, Line, SerialFormat, Wire

STYLE: Final = SerialFormat(9600, data_bits=7, parity="E", stop_bits=1)

THINKING_S: Final = 0.01
"""Time from the end of a request to the beginning of its reply [s]."""

ALL_HEADS: Final = "99"
_READS: Final = {"01", "02", "03", "08", "15"}
_ONLY_CL200A: Final = {"15", "45", "47", "48"}
_CEILING_LX: Final = 99_990.0


class ChromaMeterWire:
    """Gives a `ChromaMeter` its serial line; call `serve` with whatever carries the bytes."""

    def __init__(
        self, meter: ChromaMeter, clock: Clock, faults: FaultBox | None = None, *, pacing: bool = True
    ) -> None:
        self.meter = meter
        self.faults = faults or FaultBox()
        self._clock = clock
        self._pacing = pacing

    async def serve(self, wire: Wire) -> None:
        """Talk until the line ends."""
        await Line(wire, self._clock, STYLE, self.faults, pacing=self._pacing).converse(self._converse)

    async def _converse(self, line: Line) -> None:
        buffer = bytearray()
        while data := await line.receive():
            buffer += data
            while (request := take_request(buffer)) is not None:
                reply = self.obey(request)
                if reply is not None:
                    await line.send(frame(reply), THINKING_S)

    def obey(self, request: Request) -> str | None:
        """Do what a request asks; return the reply's text from head to data, or ``None`` for silence."""
        meter = self.meter
        if not meter.awake:
            return None
        if request.command == "54":
            if (request.head, request.parameter) != ("00", "1   "):
                return None
            meter.connect()
            return "0054    "
        if not meter.connected or (request.command in _ONLY_CL200A and meter.options.model != "CL-200A"):
            return None
        if request.head == ALL_HEADS:
            self._obey_broadcast(request)
            return None
        if not re.fullmatch(r"\d\d", request.head, re.ASCII) or not meter.has(int(request.head)):
            return None
        answer = self._answer(int(request.head), request)
        return None if answer is None else request.head + request.command + answer

    def _obey_broadcast(self, request: Request) -> None:
        match request.command, request.parameter:
            case "55", "1  0":
                self.meter.hold()
            case "40", "21  ":
                self.meter.trigger()

    def _answer(self, head: int, request: Request) -> str | None:
        """Status and data of the reply to a request for one head."""
        meter = self.meter
        match request.command, request.parameter:
            case "40", "10  ":
                return f" {meter.set_external(head)}  "
            case "45", "1000":
                last = meter.read(head)
                x, y, z = last.xyz
                return self._status(last.error, last.range) + "".join(map(float_block, (x - 0.1672 * z, y, z)))
            case "47", parameter if re.fullmatch(r"[123]1  ", parameter):
                return "    " + "".join(map(float_block, meter.matrix_row(head, int(parameter[0]) - 1)))
            case "48", parameter if re.fullmatch(r"[123]1  ", parameter) and len(request.data) == 24:
                row = [parse_float_block(request.data[k : k + 8]) for k in (0, 8, 16)]
                return "    " if meter.set_matrix_row(head, int(parameter[0]) - 1, row) else " 4  "
            case command, parameter if command in _READS and re.fullmatch(r"1[23]0[01]", parameter):
                last = meter.read(head)
                xyz = meter.user_calibrated(head, last.xyz) if parameter[1] == "3" else last.xyz
                return self._status(last.error, last.range) + reading(command, xyz, last.error)
        return None

    def _status(self, error: str, range_used: str) -> str:
        return f"1{error}{range_used}{'1' if self.meter.battery_low else '0'}"


def reading(command: str, xyz: Floats, error: str) -> str:
    """The three blocks of a read: X Y Z, Ev x y, Ev u' v', Ev Tcp Δuv, or Ev dominant wavelength and purity."""
    x, y = colour.chromaticity(xyz)
    if command == "01":
        return "".join(long_block(float(np.clip(v, 0.0, _CEILING_LX)), 1) for v in xyz)
    level = long_block(min(max(float(xyz[1]), 0.0), _CEILING_LX), 1)
    match command:
        case "02":
            pair = long_block(x, 4, zeros=True) + long_block(y, 4, zeros=True)
        case "03":
            pair = "".join(long_block(v, 4, zeros=True) for v in colour.uv_1976((x, y)))
        case "15":
            wavelength, purity = colour.dominant_wavelength((x, y))
            pair = long_block(wavelength, 1) + long_block(purity, 1)
        case _:
            found = None if error == "7" else colour.colour_temperature((x, y))
            pair = long_block(found[0], 0) + long_block(found[1], 4, zeros=True) if found else BLANK + BLANK
    return level + pair
