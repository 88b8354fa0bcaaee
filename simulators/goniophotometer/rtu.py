"""Modbus RTU: frames told apart by silence, ended by a CRC (Modbus over Serial Line V1.02, 2.5.1)."""

import asyncio
import contextlib
from typing import Final

from labdaq.clock import Clock
from simulators.goniophotometer.pdu import exception
from simulators.goniophotometer.slave import Answer, Slaves
from simulators.goniophotometer.units import BAD_CRC
from simulators.line import FaultBox, Line, SerialFormat, Wire

RESYNC_S: Final = 0.02
"""An unfinished or spoilt frame is given up after this much silence [s]. Longer than 3.5 characters, because a busy
computer may pause in the middle of a frame where a UART would not."""


def crc16(data: bytes) -> bytes:
    """CRC of a Modbus RTU frame: polynomial A001h reflected, initial FFFFh, low byte first."""
    crc = 0xFFFF
    for byte in data:
        crc ^= byte
        for _ in range(8):
            crc = crc >> 1 ^ (0xA001 if crc & 1 else 0)
    return crc.to_bytes(2, "little")


def rtu_frame(unit: int, pdu: bytes) -> bytes:
    """Unit, PDU and CRC."""
    body = bytes([unit]) + pdu
    return body + crc16(body)


def silent_interval_s(style: SerialFormat) -> float:
    """The silence that ends a frame [s]: 3.5 characters, or 1.75 ms above 19 200 baud."""
    return 0.00175 if style.baud > 19_200 else 3.5 * style.character_s


class RtuSlaves:
    """Units on one RS-485 line; call `serve` with whatever carries the bytes."""

    def __init__(
        self,
        slaves: Slaves,
        clock: Clock,
        style: SerialFormat,
        faults: FaultBox | None = None,
        *,
        pacing: bool = True,
    ) -> None:
        self.slaves = slaves
        self.line_faults = faults or FaultBox()
        self._clock = clock
        self._style = style
        self._pacing = pacing

    async def serve(self, wire: Wire) -> None:
        """Talk until the line ends."""
        await Line(wire, self._clock, self._style, self.line_faults, pacing=self._pacing).converse(self._converse)

    async def _converse(self, line: Line) -> None:
        buffer = bytearray()
        late: set[asyncio.Task[None]] = set()
        try:
            while True:
                quiet = bool(buffer)
                patience_s = silent_interval_s(self._style) if _whole(buffer) else RESYNC_S
                try:
                    async with self._clock.timeout(patience_s) if quiet else contextlib.nullcontext():
                        data = await line.receive()
                except TimeoutError:
                    frame = bytes(buffer)
                    buffer.clear()
                    await self._obey(line, frame, late)
                    continue
                if not data:
                    return
                buffer += data
        finally:
            for task in late:
                task.cancel()

    async def _obey(self, line: Line, frame: bytes, late: set[asyncio.Task[None]]) -> None:
        """Answer what came between two silences."""
        unit_id, pdu = frame[0], frame[1:-2]
        if not _whole(frame):
            unit = self.slaves.units.get(unit_id)
            if unit is not None and unit.answering and unit.answers_bad_crc and len(frame) > 3:
                await line.send(rtu_frame(unit_id, exception(frame[1], BAD_CRC)), unit.turnaround_s)
            return
        if unit_id == 0:
            self.slaves.broadcast(pdu)
        if unit_id not in self.slaves.units:
            return
        answer = self.slaves.answer(unit_id, pdu)
        if answer is None:
            return
        reply = rtu_frame(unit_id, answer.pdu)
        if answer.spoil_crc:
            reply = reply[:-1] + bytes([reply[-1] ^ 0x5A])
        if answer.late:
            task = asyncio.create_task(self._send_later(line, reply, answer))
            late.add(task)
            task.add_done_callback(late.discard)
        else:
            await line.send(reply, answer.delay_s)

    async def _send_later(self, line: Line, reply: bytes, answer: Answer) -> None:
        await self._clock.sleep(answer.delay_s)
        await line.send(reply)


def _whole(frame: bytes | bytearray) -> bool:
    return len(frame) >= 4 and crc16(bytes(frame[:-2])) == frame[-2:]
