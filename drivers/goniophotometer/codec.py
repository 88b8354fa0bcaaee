"""Modbus requests and answers as values, in RTU and TCP framing. No waiting, no clock.

pymodbus makes and takes apart the frames and their contents; its clients, which retry writes and take a late answer
for the next one, are not used. Addresses are those of the wire (from 0), words are unsigned 16 bits.
"""

from dataclasses import dataclass
from enum import IntEnum, StrEnum
from typing import Final

from pymodbus.framer.rtu import FramerRTU
from pymodbus.framer.socket import FramerSocket
from pymodbus.pdu import DecodePDU, ModbusPDU
from pymodbus.pdu.bit_message import ReadCoilsRequest, ReadDiscreteInputsRequest, WriteSingleCoilRequest
from pymodbus.pdu.register_message import (
    ReadHoldingRegistersRequest,
    ReadInputRegistersRequest,
    WriteMultipleRegistersRequest,
    WriteSingleRegisterRequest,
)

from drivers.exchange import FrameError


class Framing(StrEnum):
    """How frames stand on the line."""

    RTU = "rtu"
    TCP = "tcp"


class Function(IntEnum):
    """Modbus function codes used here."""

    READ_COILS = 1
    READ_INPUTS = 2
    READ_HOLDING = 3
    READ_REGISTERS = 4
    WRITE_COIL = 5
    WRITE_REGISTER = 6
    WRITE_REGISTERS = 16


BIT_READS: Final = frozenset({Function.READ_COILS, Function.READ_INPUTS})
READS: Final = BIT_READS | {Function.READ_HOLDING, Function.READ_REGISTERS}
EXCEPTION: Final = 0x80
"""Added to the function code of an answer that says no."""
BAD_CHECK_SUM: Final = 8
"""Exception code with which the CS2RS drive answers a request that arrived damaged (others keep silent)."""

EXCEPTIONS: Final[dict[int, tuple[str, str]]] = {
    1: ("the device does not know this function", "check the device's type and unit number in the station file"),
    2: ("the device has no such address", "check the device's type and unit number in the station file"),
    3: ("the device does not accept this value", "check speed, position and range in the station file"),
    4: ("the device failed", "look at its lamps; switch it off and on"),
    5: ("the device needs longer and goes on working", "wait, then look at its state"),
    6: ("the device is busy", "wait, then try again"),
    8: ("the device received a damaged request and did not obey it", "check cable, termination and grounding"),
    10: ("the gateway has no path to the device", "check the gateway's settings"),
    11: ("the device behind the gateway does not answer", "check the device's power and unit number"),
}
"""Exception code to meaning and what to try; 8 as the CS2RS uses it, the others after Modbus V1.1b3, section 7."""


@dataclass(frozen=True, slots=True)
class Request:
    """One question.

    Attributes
    ----------
    unit
        Device on the line, 1 to 247.
    function, address
        What is asked, and where it begins.
    count
        How many bits or words are read; 1 for writes of one.
    values
        Words (or one bit) to write; empty for reads.
    """

    unit: int
    function: Function
    address: int
    count: int = 1
    values: tuple[int, ...] = ()

    @property
    def is_read(self) -> bool:
        """Whether asking twice does no harm."""
        return self.function in READS


@dataclass(frozen=True, slots=True)
class Answer:
    """What came back.

    Attributes
    ----------
    values
        Words, or bits as 0 and 1; empty for an accepted write.
    exception
        Exception code, 0 when the device obeyed.
    """

    values: tuple[int, ...] = ()
    exception: int = 0


def encode(request: Request, framing: Framing, transaction: int = 0) -> bytes:
    """Encode a request; only TCP framing sends ``transaction`` (0 to 65535). Raises `FrameError` for bad numbers."""
    try:
        pdu = _pdu(request)
        pdu.transaction_id = transaction
        return _framer(framing).buildFrame(pdu)
    except (ValueError, OverflowError) as error:
        raise FrameError(f"{request} cannot be sent: {error}") from error


def answer_length(request: Request) -> int:
    """Bytes of the good answer without unit number and framing: function code and what follows."""
    if request.function in BIT_READS:
        return 2 + (request.count + 7) // 8
    if request.is_read:
        return 2 + 2 * request.count
    return 5


def rtu_length(request: Request, head: bytes) -> int:
    """Length of the whole RTU answer that begins with ``head`` (2 bytes); raises `FrameError` if it answers another."""
    unit, function = head[0], head[1]
    if unit != request.unit:
        raise FrameError(f"an answer of unit {unit} to a question to unit {request.unit}")
    if function == request.function | EXCEPTION:
        return 5
    if function != request.function:
        raise FrameError(f"an answer to function {function} instead of {request.function.value}")
    return 1 + answer_length(request) + 2


def decode_rtu(request: Request, frame: bytes) -> Answer:
    """Decode a whole RTU answer to ``request``; raises `FrameError`."""
    if len(frame) < 5 or len(frame) != rtu_length(request, frame):
        raise FrameError(f"an answer of {len(frame)} bytes")
    used, _, _, payload = _framer(Framing.RTU).decode(frame)
    if used != len(frame) or not payload:
        raise FrameError("wrong check sum")
    if len(payload) != len(frame) - 3:  # the framer is content with a shorter frame and something behind it
        raise FrameError(f"an answer of {len(payload)} bytes in a frame for {len(frame) - 3}")
    return _answer(request, payload)


def tcp_length(header: bytes) -> int:
    """Length of the whole TCP frame that begins with ``header`` (6 bytes); raises `FrameError` for another protocol."""
    protocol, length = int.from_bytes(header[2:4], "big"), int.from_bytes(header[4:6], "big")
    if protocol or not 3 <= length <= 254:
        raise FrameError(f"not a Modbus TCP frame: protocol {protocol}, length {length}")
    return 6 + length


def transaction_of(frame: bytes) -> int:
    """Transaction number of a TCP frame."""
    return int.from_bytes(frame[:2], "big")


def decode_tcp(request: Request, frame: bytes) -> Answer:
    """Decode a whole TCP answer to ``request`` whose transaction fits; raises `FrameError`."""
    if frame[6] != request.unit:
        raise FrameError(f"an answer of unit {frame[6]} to a question to unit {request.unit}")
    function = frame[7] & ~EXCEPTION
    if function != request.function:
        raise FrameError(f"an answer to function {function} instead of {request.function.value}")
    expected = 2 if frame[7] & EXCEPTION else answer_length(request)
    used, _, _, payload = _framer(Framing.TCP).decode(frame)
    if used != len(frame) or len(payload) != expected:
        raise FrameError(f"an answer of {len(payload)} bytes instead of {expected}")
    return _answer(request, payload)


def signed_word(word: int) -> int:
    """Two's complement of 16 bits."""
    return word - 0x10000 if word & 0x8000 else word


def signed_pair(high: int, low: int) -> int:
    """Two's complement of 32 bits in two words, the high one first."""
    value = high << 16 | low
    return value - (1 << 32) if value & 1 << 31 else value


def words_of(value: int) -> tuple[int, int]:
    """Split a signed 32-bit number into two words, the high one first."""
    return value >> 16 & 0xFFFF, value & 0xFFFF


def _pdu(request: Request) -> ModbusPDU:
    unit, address, values = request.unit, request.address, list(request.values)
    if not 1 <= unit <= 247:
        raise ValueError(f"unit {unit} is not 1 to 247")
    if any(not 0 <= value <= 0xFFFF for value in values):
        raise ValueError("a value is not 0 to 65535")
    reads: dict[Function, type[ModbusPDU]] = {
        Function.READ_COILS: ReadCoilsRequest,
        Function.READ_INPUTS: ReadDiscreteInputsRequest,
        Function.READ_HOLDING: ReadHoldingRegistersRequest,
        Function.READ_REGISTERS: ReadInputRegistersRequest,
    }
    if request.function in reads:
        return reads[request.function](dev_id=unit, address=address, count=request.count)
    if not 1 <= len(values) <= (123 if request.function is Function.WRITE_REGISTERS else 1):
        raise ValueError(f"{len(values)} values to write")
    if request.function is Function.WRITE_COIL:
        return WriteSingleCoilRequest(dev_id=unit, address=address, bits=[bool(values[0])])
    if request.function is Function.WRITE_REGISTER:
        return WriteSingleRegisterRequest(dev_id=unit, address=address, registers=values)
    return WriteMultipleRegistersRequest(dev_id=unit, address=address, registers=values)


def _framer(framing: Framing) -> FramerRTU | FramerSocket:
    decoder = DecodePDU(is_server=False)
    return FramerRTU(decoder) if framing is Framing.RTU else FramerSocket(decoder)


def _answer(request: Request, payload: bytes) -> Answer:
    """Decode function code and content, which have the right length; check what a write gives back."""
    if payload[0] & EXCEPTION:
        return Answer(exception=payload[1])
    if request.is_read and payload[1] != len(payload) - 2:
        raise FrameError(f"{payload[1]} bytes announced, {len(payload) - 2} sent")
    pdu = DecodePDU(is_server=False).decode(payload)
    if pdu is None:
        raise FrameError("the answer makes no sense")
    if request.function in BIT_READS:
        return Answer(tuple(int(bit) for bit in pdu.bits[: request.count]))
    if request.is_read:
        return Answer(tuple(pdu.registers))
    if request.function is Function.WRITE_REGISTERS:
        fits = (pdu.address, pdu.count) == (request.address, len(request.values))
    elif request.function is Function.WRITE_REGISTER:
        fits = (pdu.address, list(pdu.registers)) == (request.address, list(request.values))
    else:
        fits = (pdu.address, list(pdu.bits)) == (request.address, [bool(request.values[0])])
    if not fits:
        raise FrameError("the answer to a write is about something else")
    return Answer()
