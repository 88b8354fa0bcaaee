"""PTP over TCP (PTP/IP): two connections to one port, one for commands and one for events."""

from typing import Final

from drivers.camera.link import Event, Reply
from drivers.camera.packets import (
    HEADER,
    Packet,
    PacketType,
    code_and_parameters,
    command_request,
    connection_number,
    data_packets,
    decode_packet,
    init_command,
    init_event,
    packet_length,
    transaction_of,
)
from drivers.exchange import FrameError
from drivers.transport import Transport
from labdaq.errors import ConnectError, Exchange, Place, ProtocolError

_GUID: Final = b"labdaq".ljust(16, b"\0")
_DATA: Final = frozenset({PacketType.START_DATA, PacketType.DATA, PacketType.END_DATA})


class PtpIp:
    """A camera at the far end of two byte lines (TCP, or memory).

    Parameters
    ----------
    commands, events
        Lines to the same port, not yet open.
    guid, computer
        16 bytes and a name by which some cameras remember whom they were paired with.
    """

    def __init__(self, commands: Transport, events: Transport, guid: bytes = _GUID, computer: str = "labdaq") -> None:
        self._commands = commands
        self._events = events
        self._guid = guid
        self._computer = computer
        self._open = False

    @property
    def place(self) -> Place:
        """Which camera is meant, and where."""
        return self._commands.place

    @property
    def pending(self) -> bytes:
        """Beginning of what has been received of an answer that is not complete."""
        return self._commands.pending[:256]

    async def open(self) -> None:
        """Connect twice and shake hands twice, the command connection first."""
        if self._open:
            return
        await self._commands.open()
        request = init_command(self._guid, self._computer)
        ack = await self._greet(self._commands, request, PacketType.INIT_COMMAND_ACK)
        await self._events.open()
        await self._greet(self._events, init_event(self._number(request, ack)), PacketType.INIT_EVENT_ACK)
        self._open = True

    async def aclose(self) -> None:
        """Close both connections."""
        self._open = False
        await self._events.aclose()
        await self._commands.aclose()

    async def transact(
        self, code: int, transaction: int, parameters: tuple[int, ...], data: bytes | None = None
    ) -> Reply:
        """Send a command, with data if there are any, and return its reply."""
        request = command_request(code, transaction, parameters, data is not None)
        packets = [request] if data is None else [request, *data_packets(transaction, data)]
        await self._commands.write(b"".join(packet.encode() for packet in packets))
        received = bytearray()
        while True:
            packet = await self._next(self._commands, request)
            try:
                if packet.type in _DATA and transaction_of(packet) == transaction:
                    if packet.type is PacketType.START_DATA:
                        received.clear()
                    else:
                        received += packet.payload[4:]
                elif packet.type is PacketType.COMMAND_RESPONSE:
                    answer, number, values = code_and_parameters(packet)
                    if number == transaction:
                        return Reply(answer, values, bytes(received))
            except FrameError as error:
                raise self._broken(error, request.encode(), packet.encode()) from error

    async def next_event(self) -> Event:
        """Wait for the next event; a ping on the way is answered."""
        while True:
            packet = await self._next(self._events, None)
            if packet.type is PacketType.EVENT:
                try:
                    return Event(*code_and_parameters(packet))
                except FrameError as error:
                    raise self._broken(error, b"", packet.encode()) from error

    async def _next(self, line: Transport, request: Packet | None) -> Packet:
        sent = b"" if request is None else request.encode()[:256]
        try:
            packet = decode_packet(await line.read_frame(HEADER, packet_length))
        except FrameError as error:
            received = await line.drain_input()
            await self.aclose()  # where the next packet begins cannot be told any more
            raise self._broken(error, sent, received[:256]) from error
        if packet.type is PacketType.PING:
            await line.write(Packet(PacketType.PONG).encode())
        return packet

    async def _greet(self, line: Transport, request: Packet, expected: PacketType) -> Packet:
        await line.write(request.encode())
        answer = await self._next(line, request)
        if answer.type is not expected:
            await self.aclose()
            said = f"reason {int.from_bytes(answer.payload[:4], 'little')}" if answer.payload else answer.type.name
            raise ConnectError(
                f"the camera refuses the connection ({said})",
                place=line.place,
                exchange=Exchange(request.encode(), answer.encode()[:256]),
                hint="end other programs that hold the camera; pair it with this computer in its menu",
            )
        return answer

    def _number(self, request: Packet, ack: Packet) -> int:
        try:
            return connection_number(ack)
        except FrameError as error:
            raise self._broken(error, request.encode(), ack.encode()) from error

    def _broken(self, error: FrameError, sent: bytes, received: bytes) -> ProtocolError:
        return ProtocolError(
            f"this is no PTP/IP: {error}",
            place=self.place,
            exchange=Exchange(sent, received),
            hint="check that host and port are the camera's (usually port 15740), then connect again",
        )
