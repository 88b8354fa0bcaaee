"""Packets in which PTP travels over TCP (PTP/IP, CIPA DC-005), as values, and back. No waiting, no clock."""

import struct
from dataclasses import dataclass
from enum import IntEnum
from typing import Final

from drivers.exchange import FrameError

HEADER: Final = 8
LONGEST: Final = 1 << 30
VERSION: Final = 0x0001_0000
PORT: Final = 15740


class PacketType(IntEnum):
    """What a packet is."""

    INIT_COMMAND_REQUEST = 1
    INIT_COMMAND_ACK = 2
    INIT_EVENT_REQUEST = 3
    INIT_EVENT_ACK = 4
    INIT_FAIL = 5
    COMMAND_REQUEST = 6
    COMMAND_RESPONSE = 7
    EVENT = 8
    START_DATA = 9
    DATA = 10
    CANCEL = 11
    END_DATA = 12
    PING = 13
    PONG = 14


@dataclass(frozen=True, slots=True)
class Packet:
    """One packet: its type and what follows its header."""

    type: PacketType
    payload: bytes = b""

    def encode(self) -> bytes:
        """Encode with its length."""
        return struct.pack("<II", HEADER + len(self.payload), self.type) + self.payload


def packet_length(head: bytes) -> int:
    """Length of the packet that begins with ``head`` (8 bytes); raises `FrameError` if none does."""
    length, kind = struct.unpack("<II", head)
    if not HEADER <= length <= LONGEST or kind not in set(PacketType):
        raise FrameError(f"no packet begins with {head.hex(' ')}")
    return int(length)


def decode_packet(raw: bytes) -> Packet:
    """Decode a whole packet; raises `FrameError`."""
    if len(raw) < HEADER or len(raw) != packet_length(raw[:HEADER]):
        raise FrameError(f"a packet of {len(raw)} bytes")
    return Packet(PacketType(int.from_bytes(raw[4:8], "little")), raw[HEADER:])


def init_command(guid: bytes, name: str) -> Packet:
    """Ask for the command connection; ``guid`` has 16 bytes."""
    if len(guid) != 16:
        raise FrameError(f"a GUID has 16 bytes, not {len(guid)}")
    payload = guid + (name + "\0").encode("utf-16-le") + struct.pack("<I", VERSION)
    return Packet(PacketType.INIT_COMMAND_REQUEST, payload)


def connection_number(ack: Packet) -> int:
    """Connection number that the camera gave out; raises `FrameError`."""
    return _unpack("<I", ack)[0]


def init_event(connection: int) -> Packet:
    """Ask for the event connection that belongs to a command connection."""
    return Packet(PacketType.INIT_EVENT_REQUEST, struct.pack("<I", connection))


def command_request(code: int, transaction: int, parameters: tuple[int, ...], sends_data: bool) -> Packet:
    """Make a command; ``sends_data`` announces data from us."""
    head = struct.pack("<IHI", 2 if sends_data else 1, code, transaction)
    return Packet(PacketType.COMMAND_REQUEST, head + struct.pack(f"<{len(parameters)}I", *parameters))


def data_packets(transaction: int, data: bytes, chunk: int = 65_536) -> list[Packet]:
    """Cut data into its packets: the announcement, full chunks, and the rest in the last."""
    number = struct.pack("<I", transaction)
    packets = [Packet(PacketType.START_DATA, number + struct.pack("<Q", len(data)))]
    pieces = [data[i : i + chunk] for i in range(0, len(data), chunk)] or [b""]
    packets += [Packet(PacketType.DATA, number + piece) for piece in pieces[:-1]]
    return [*packets, Packet(PacketType.END_DATA, number + pieces[-1])]


def transaction_of(packet: Packet) -> int:
    """Transaction number of a start, data, end or cancel packet; raises `FrameError`."""
    return _unpack("<I", packet)[0]


def code_and_parameters(packet: Packet) -> tuple[int, int, tuple[int, ...]]:
    """Code, transaction and parameters of a response or event; raises `FrameError`."""
    code, transaction = _unpack("<HI", packet)
    count = (len(packet.payload) - 6) // 4
    return code, transaction, struct.unpack_from(f"<{count}I", packet.payload, 6)


def _unpack(layout: str, packet: Packet) -> tuple[int, ...]:
    if len(packet.payload) < struct.calcsize(layout):
        raise FrameError(f"a packet {packet.type.name} of {len(packet.payload)} bytes")
    return struct.unpack_from(layout, packet.payload)
