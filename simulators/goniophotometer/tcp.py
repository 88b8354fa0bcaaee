"""Modbus TCP: the same units behind a gateway; requests may be pipelined (Modbus Messaging on TCP/IP V1.0b)."""

import asyncio
import struct

from labdaq.clock import Clock
from simulators.goniophotometer.pdu import exception
from simulators.goniophotometer.slave import Answer, Slaves
from simulators.goniophotometer.units import NO_SUCH_DEVICE
from simulators.line import Wire
from simulators.line.paced import LEAST_DELAY_S

_HEADER = struct.Struct(">HHHB")  # transaction, protocol (0), length, unit
_LONGEST = 254  # length field: unit and PDU


class TcpSlaves:
    """Units behind a Modbus TCP gateway; call `serve` for every connection."""

    def __init__(self, slaves: Slaves, clock: Clock) -> None:
        self.slaves = slaves
        self._clock = clock

    async def serve(self, wire: Wire) -> None:
        """Answer requests in their order until the connection ends, or breaks the protocol."""
        buffer = bytearray()
        late: set[asyncio.Task[None]] = set()
        try:
            while data := await wire.read():
                buffer += data
                while len(buffer) >= _HEADER.size:
                    transaction, protocol, length, unit_id = _HEADER.unpack_from(buffer)
                    if protocol != 0 or not 2 <= length <= _LONGEST:
                        return  # what follows cannot be told apart any more
                    if len(buffer) < 6 + length:
                        break
                    pdu = bytes(buffer[_HEADER.size : 6 + length])
                    del buffer[: 6 + length]
                    await self._obey(wire, transaction, unit_id, pdu, late)
        finally:
            for task in late:
                task.cancel()
            wire.close()

    async def _obey(
        self, wire: Wire, transaction: int, unit_id: int, pdu: bytes, late: set[asyncio.Task[None]]
    ) -> None:
        if unit_id in self.slaves.units:
            answer = self.slaves.answer(unit_id, pdu)
        else:
            answer = Answer(exception(pdu[0], NO_SUCH_DEVICE), LEAST_DELAY_S)
        if answer is None or answer.spoil_crc:
            return
        sending = self._send(wire, transaction, unit_id, answer)
        if answer.late:
            task = asyncio.create_task(sending)
            late.add(task)
            task.add_done_callback(late.discard)
        else:
            await sending

    async def _send(self, wire: Wire, transaction: int, unit_id: int, answer: Answer) -> None:
        await self._clock.sleep(max(answer.delay_s, LEAST_DELAY_S))
        wire.write(_HEADER.pack(transaction, 0, len(answer.pdu) + 1, unit_id) + answer.pdu)
