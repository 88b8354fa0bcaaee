"""Modbus protocol data units, from the slave's side (Modbus Application Protocol V1.1b3, chapter 6)."""

import struct

from simulators.goniophotometer.units import ILLEGAL_FUNCTION, ILLEGAL_VALUE, Refusal, Unit

_MOST_BITS, _MOST_WORDS, _MOST_WRITTEN_BITS, _MOST_WRITTEN_WORDS = 2000, 125, 1968, 123


def exception(function: int, code: int) -> bytes:
    """The reply that refuses."""
    return bytes([function | 0x80, code])


def answer(unit: Unit, pdu: bytes) -> bytes:
    """Let ``unit`` do what ``pdu`` asks and return the reply's PDU."""
    function = pdu[0]
    try:
        if function not in unit.functions:
            raise Refusal(ILLEGAL_FUNCTION)
        return bytes([function]) + _obey(unit, function, pdu[1:])
    except Refusal as refusal:
        return exception(function, refusal.code)


def _obey(unit: Unit, function: int, body: bytes) -> bytes:
    if len(body) < 4:
        raise Refusal(ILLEGAL_VALUE)
    address, second = struct.unpack(">HH", body[:4])
    match function:
        case 1 | 2:
            _require(1 <= second <= _MOST_BITS and len(body) == 4)
            packed = _pack(unit.read_bits(address, second))
            return bytes([len(packed)]) + packed
        case 3 | 4:
            _require(1 <= second <= _MOST_WORDS and len(body) == 4)
            words = unit.read_words(address, second, inputs=function == 4)
            return struct.pack(f">B{second}H", 2 * second, *words)
        case 5:
            _require(second in (0x0000, 0xFF00) and len(body) == 4)
            unit.write_bits(address, [second == 0xFF00])
        case 6:
            _require(len(body) == 4)
            unit.write_words(address, [second])
        case 15:
            _require(1 <= second <= _MOST_WRITTEN_BITS and len(body) == 5 + (second + 7) // 8 == 5 + body[4])
            unit.write_bits(address, [bool(body[5 + k // 8] >> k % 8 & 1) for k in range(second)])
        case 16:
            _require(1 <= second <= _MOST_WRITTEN_WORDS and len(body) == 5 + 2 * second == 5 + body[4])
            unit.write_words(address, list(struct.unpack(f">{second}H", body[5:])))
        case _:
            raise Refusal(ILLEGAL_FUNCTION)
    return body[:4]


def _require(condition: bool) -> None:
    if not condition:
        raise Refusal(ILLEGAL_VALUE)


def _pack(bits: list[bool]) -> bytes:
    """Eight to a byte, the first in the lowest bit."""
    packed = bytearray((len(bits) + 7) // 8)
    for k, bit in enumerate(bits):
        packed[k // 8] |= bit << k % 8
    return bytes(packed)
