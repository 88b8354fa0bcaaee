"""PTP over TCP/IP (CIPA DC-005): a command and an event connection to one port, packets of length, type and payload."""

import asyncio
import contextlib
import struct
from collections.abc import AsyncIterator
from typing import Final

from labdaq.clock import Clock, sleep_until
from simulators.camera.body import Camera
from simulators.camera.responder import GET_OBJECT, GET_PARTIAL, Responder, Response
from simulators.line import Wire
from simulators.line.paced import LEAST_DELAY_S

INIT_COMMAND, INIT_COMMAND_ACK, INIT_EVENT, INIT_EVENT_ACK, INIT_FAIL = 1, 2, 3, 4, 5
COMMAND, RESPONSE, EVENT, START_DATA, DATA, CANCEL, END_DATA, PING, PONG = 6, 7, 8, 9, 10, 11, 12, 13, 14
DATA_OUT: Final = 2
BUSY: Final = 2
VERSION: Final = 0x0001_0000
CHUNK: Final = 32_768
LONGEST: Final = 2**20  # nothing a client sends comes near

GUID: Final = bytes.fromhex("6c61 6264 6171 0000 0000 0000 0000 0001")


def packet(kind: int, payload: bytes) -> bytes:
    """Length, type, payload."""
    return struct.pack("<II", len(payload) + 8, kind) + payload


async def packets(wire: Wire) -> AsyncIterator[tuple[int, bytes]]:
    """Packets as they come, until the connection ends or sends nonsense."""
    buffer = bytearray()
    while data := await wire.read():
        buffer += data
        while len(buffer) >= 8:
            length, kind = struct.unpack_from("<II", buffer)
            if not 8 <= length <= LONGEST:
                return
            if len(buffer) < length:
                break
            payload = bytes(buffer[8:length])
            del buffer[:length]
            yield kind, payload


class PtpIpFront:
    """A camera's network side; give `serve` to a port. One client at a time, as with real cameras."""

    def __init__(self, camera: Camera, clock: Clock) -> None:
        self.camera = camera
        self._clock = clock
        self._connection = 0
        self._command: Wire | None = None
        self._hang_up: list[Wire] = []

    async def serve(self, wire: Wire) -> None:
        """Talk on one connection; its first packet says which of the two it is."""
        incoming = packets(wire)
        try:
            async for kind, payload in incoming:
                if kind == INIT_COMMAND:
                    await self._serve_commands(wire, incoming, payload)
                elif kind == INIT_EVENT:
                    await self._serve_events(wire, incoming, payload)
                return
        finally:
            await incoming.aclose()  # type: ignore[attr-defined]
            wire.close()

    async def _serve_commands(self, wire: Wire, incoming: AsyncIterator[tuple[int, bytes]], payload: bytes) -> None:
        if self._command is not None or len(payload) < 16:
            wire.write(packet(INIT_FAIL, struct.pack("<I", BUSY)))
            return
        self._command = wire
        self._connection += 1
        name = "emulated camera".encode("utf-16-le") + b"\0\0"
        wire.write(
            packet(INIT_COMMAND_ACK, struct.pack("<I", self._connection) + GUID + name + struct.pack("<I", VERSION))
        )
        try:
            await self._operate(wire, incoming, Responder(self.camera, needs_complete=True))
        finally:
            self._command = None
            for other in self._hang_up:
                other.close()

    async def _operate(self, wire: Wire, incoming: AsyncIterator[tuple[int, bytes]], responder: Responder) -> None:
        """Operations one after the other."""
        async for kind, payload in incoming:
            if kind == PING:
                wire.write(packet(PONG, b""))
            if kind != COMMAND or len(payload) < 10:
                continue  # a Cancel comes too late for an operation that is already answered
            phase, operation, transaction = struct.unpack_from("<IHI", payload)
            parameters = [p for (p,) in struct.iter_unpack("<I", payload[10 : 10 + (len(payload) - 10) // 4 * 4])]
            data = await self._data_out(incoming) if phase == DATA_OUT else b""
            await self._clock.sleep(LEAST_DELAY_S)
            if self.camera.faults.hang[operation] > 0:
                self.camera.faults.hang[operation] -= 1
                continue
            response = responder.execute(operation, transaction, parameters, data)
            if not self._send(wire, operation, transaction, response):
                return

    async def _data_out(self, incoming: AsyncIterator[tuple[int, bytes]]) -> bytes:
        """Data from the client: StartData, Data..., EndData."""
        data = b""
        async for kind, payload in incoming:
            if kind in (DATA, END_DATA):
                data += payload[4:]
            if kind in (END_DATA, CANCEL):
                break
        return data

    def _send(self, wire: Wire, operation: int, transaction: int, response: Response) -> bool:
        """Data phase and response; false when a fault broke the connection off."""
        number = struct.pack("<I", transaction)
        if response.data is not None:
            wire.write(packet(START_DATA, number + struct.pack("<Q", len(response.data))))
            broken = self.camera.faults.break_transfer_after if operation in (GET_OBJECT, GET_PARTIAL) else None
            if broken is not None:
                self.camera.faults.break_transfer_after = None
                wire.write(packet(DATA, number + response.data[:broken]))
                return False
            last = max(0, len(response.data) - 1) // CHUNK * CHUNK
            for start in range(0, last, CHUNK):
                wire.write(packet(DATA, number + response.data[start : start + CHUNK]))
            wire.write(packet(END_DATA, number + response.data[last:]))
        parameters = struct.pack(f"<{len(response.parameters)}I", *response.parameters)
        wire.write(packet(RESPONSE, struct.pack("<H", response.code) + number + parameters))
        return True

    # --- events ---

    async def _serve_events(self, wire: Wire, incoming: AsyncIterator[tuple[int, bytes]], payload: bytes) -> None:
        if self._command is None or payload != struct.pack("<I", self._connection):
            wire.write(packet(INIT_FAIL, struct.pack("<I", 1)))
            return
        wire.write(packet(INIT_EVENT_ACK, b""))
        self._hang_up.append(wire)
        teller = asyncio.create_task(self._tell(wire))
        try:
            async for kind, _ in incoming:
                if kind == PING:
                    wire.write(packet(PONG, b""))
        finally:
            self._hang_up.remove(wire)
            teller.cancel()
            with contextlib.suppress(asyncio.CancelledError):
                await teller

    async def _tell(self, wire: Wire) -> None:
        """Let the camera do what becomes due, and pass its events on."""
        news = asyncio.Event()
        loop = asyncio.get_running_loop()

        def wake() -> None:
            loop.call_soon_threadsafe(news.set)  # a USB client may sit in another thread

        self.camera.changed = wake
        while True:
            news.clear()
            due_ns = self.camera.next_due_ns
            if due_ns is None:
                await news.wait()
                continue
            await sleep_until(self._clock, due_ns)
            if self._clock.state().source == "virtual":
                self.camera.advance()
            else:  # a picture takes a while to render; let the other instruments answer meanwhile
                await asyncio.to_thread(self.camera.advance)
            while self.camera.events:
                event = self.camera.events.popleft()
                wire.write(packet(EVENT, struct.pack("<HII", event.code, event.transaction, event.parameter)))
