"""Modbus frames against those of the makers' manuals, and against everything else."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.exchange import FrameError
from drivers.goniophotometer.codec import (
    Answer,
    Framing,
    Function,
    Request,
    answer_length,
    decode_rtu,
    decode_tcp,
    encode,
    rtu_length,
    signed_pair,
    signed_word,
    tcp_length,
    words_of,
)

HOLDING, WORD, WORDS = Function.READ_HOLDING, Function.WRITE_REGISTER, Function.WRITE_REGISTERS
MOVE = Request(1, WORDS, 0x6200, 8, (1, 0xFFFF, 0xFD8F, 60, 100, 100, 0, 0x10))
VENDOR = Request(7, WORDS, 0x6200, 8, (1, 0, 0x2710, 0, 0x2710, 0x2710, 0, 0x10))
STATUS = Request(1, HOLDING, 0x1003)
FEEDBACK = Request(1, HOLDING, 0x1014, 2)
ALARM = Request(1, HOLDING, 0x2203)
VALUES = Request(2, Function.READ_REGISTERS, 0, 8)

REQUESTS = [
    (MOVE, "01 10 62 00 00 08 10 00 01 FF FF FD 8F 00 3C 00 64 00 64 00 00 00 10 5A 4F"),
    (VENDOR, "07 10 62 00 00 08 10 00 01 00 00 27 10 00 00 27 10 27 10 00 00 00 10 8D 50"),
    (STATUS, "01 03 10 03 00 01 70 CA"),
    (FEEDBACK, "01 03 10 14 00 02 80 CF"),
    (ALARM, "01 03 22 03 00 01 7E 72"),
    (Request(1, WORD, 0x6002, values=(0x20,)), "01 06 60 02 00 20 37 D2"),
    (Request(1, WORD, 0x6002, values=(0x21,)), "01 06 60 02 00 21 F6 12"),
    (Request(1, WORD, 0x6002, values=(0x40,)), "01 06 60 02 00 40 37 FA"),
    (Request(1, WORD, 0x1801, values=(0x1111,)), "01 06 18 01 11 11 12 F6"),
    (VALUES, "02 04 00 00 00 08 F1 FF"),
    (Request(2, HOLDING, 0x0100, 8), "02 03 01 00 00 08 45 C3"),
    (Request(2, WORD, 0x0100, values=(8,)), "02 06 01 00 00 08 89 C3"),
    (Request(2, HOLDING, 0x01E0, 4), "02 03 01 E0 00 04 44 30"),
    (Request(2, Function.READ_INPUTS, 0x0080, 8), "02 02 00 80 00 08 78 17"),
    (Request(2, Function.READ_COILS, 0x0110), "02 01 01 10 00 01 FD C0"),
]

ANSWERS = [
    (MOVE, "01 10 62 00 00 08 DE 77", Answer()),
    (VENDOR, "07 10 62 00 00 08 DE 11", Answer()),
    (STATUS, "01 03 02 00 06 38 46", Answer((0x0006,))),
    (STATUS, "01 03 02 00 32 39 91", Answer((0x0032,))),
    (STATUS, "01 03 02 00 72 38 61", Answer((0x0072,))),
    (FEEDBACK, "01 03 04 FF FF FD 8F FB 23", Answer((0xFFFF, 0xFD8F))),
    (ALARM, "01 03 02 00 01 79 84", Answer((1,))),
    (Request(1, WORD, 0x6002, values=(0x20,)), "01 06 60 02 00 20 37 D2", Answer()),
    (STATUS, "01 83 02 C0 F1", Answer(exception=2)),
    (STATUS, "01 83 08 40 F6", Answer(exception=8)),
    (MOVE, "01 90 03 0C 01", Answer(exception=3)),
    (
        VALUES,
        "02 04 10 00 00 40 00 7F FF 80 00 00 03 00 00 00 00 00 00 02 7C",
        Answer((0, 0x4000, 0x7FFF, 0x8000, 3, 0, 0, 0)),
    ),
    (Request(2, Function.READ_INPUTS, 0x0080, 8), "02 02 01 00 A1 CC", Answer((0,) * 8)),
]


@pytest.mark.parametrize(("request_", "wire"), REQUESTS)
def test_requests_of_the_manuals(request_: Request, wire: str) -> None:
    assert encode(request_, Framing.RTU) == bytes.fromhex(wire)


@pytest.mark.parametrize(("request_", "wire", "answer"), ANSWERS)
def test_answers_of_the_manuals(request_: Request, wire: str, answer: Answer) -> None:
    frame = bytes.fromhex(wire)
    assert rtu_length(request_, frame[:2]) == len(frame)
    assert decode_rtu(request_, frame) == answer
    tcp = bytes([0, 9, 0, 0, 0, len(frame) - 2]) + frame[:-2]
    assert tcp_length(tcp[:6]) == len(tcp)
    assert decode_tcp(request_, tcp) == answer


def test_tcp_form() -> None:
    assert encode(FEEDBACK, Framing.TCP, 1) == bytes.fromhex("00 01 00 00 00 06 01 03 10 14 00 02")


def test_wrong_check_sums_printed_in_a_manual_are_refused() -> None:
    with pytest.raises(FrameError, match="check sum"):
        decode_rtu(Request(1, WORD, 0x0191, values=(0x20,)), bytes.fromhex("01 06 01 91 00 20 DD 7B"))


def crc(data: bytes) -> bytes:
    """CRC-16/MODBUS from its definition, independent of pymodbus."""
    value = 0xFFFF
    for byte in data:
        value ^= byte
        for _ in range(8):
            value = value >> 1 ^ (0xA001 if value & 1 else 0)
    return value.to_bytes(2, "little")


words = st.integers(0, 0xFFFF)
requests = st.one_of(
    st.builds(
        Request,
        st.integers(1, 247),
        st.sampled_from([Function.READ_HOLDING, Function.READ_REGISTERS, Function.READ_COILS, Function.READ_INPUTS]),
        words,
        st.integers(1, 125),
    ),
    st.builds(
        lambda unit, address, value: Request(unit, WORD, address, values=(value,)), st.integers(1, 247), words, words
    ),
    st.builds(
        lambda unit, address, value: Request(unit, Function.WRITE_COIL, address, values=(value,)),
        st.integers(1, 247),
        words,
        st.integers(0, 1),
    ),
    st.builds(
        lambda unit, address, values: Request(unit, WORDS, address, len(values), tuple(values)),
        st.integers(1, 247),
        words,
        st.lists(words, min_size=1, max_size=123),
    ),
)


@given(requests)
def test_requests_end_with_their_check_sum(request_: Request) -> None:
    frame = encode(request_, Framing.RTU)
    assert frame[0] == request_.unit and frame[1] == request_.function
    assert frame[-2:] == crc(frame[:-2])
    tcp = encode(request_, Framing.TCP, 0xBEEF)
    assert tcp == b"\xbe\xef\x00\x00" + (len(frame) - 2).to_bytes(2, "big") + frame[:-2]


def answered(request_: Request, values: list[int]) -> bytes:
    """What a device would answer, put together by hand."""
    if request_.function in {Function.READ_COILS, Function.READ_INPUTS}:
        packed = sum(value << i for i, value in enumerate(values)).to_bytes((len(values) + 7) // 8, "little")
        content = bytes([len(packed)]) + packed
    elif request_.is_read:
        content = bytes([2 * len(values)]) + b"".join(value.to_bytes(2, "big") for value in values)
    elif request_.function is WORDS:
        content = request_.address.to_bytes(2, "big") + len(request_.values).to_bytes(2, "big")
    else:
        word = request_.values[0] if request_.function is WORD else 0xFF00 * request_.values[0]
        content = request_.address.to_bytes(2, "big") + word.to_bytes(2, "big")
    return bytes([request_.unit, request_.function]) + content


@given(requests, st.data())
def test_answers_survive_the_wire(request_: Request, data: st.DataObject) -> None:
    one = st.integers(0, 1) if request_.function in {Function.READ_COILS, Function.READ_INPUTS} else words
    values = data.draw(st.lists(one, min_size=request_.count, max_size=request_.count)) if request_.is_read else []
    body = answered(request_, values)
    assert len(body) == 1 + answer_length(request_)
    frame = body + crc(body)
    assert decode_rtu(request_, frame) == Answer(tuple(values))
    at = data.draw(st.integers(0, len(frame) - 1))
    damaged = bytearray(frame)
    damaged[at] ^= data.draw(st.integers(1, 255))
    with pytest.raises(FrameError):
        decode_rtu(request_, bytes(damaged))
    with pytest.raises(FrameError):
        decode_rtu(request_, frame[:at])


@given(st.integers(1, 60), st.integers(1, 60), st.binary(min_size=0, max_size=130))
def test_an_answer_to_another_count_is_no_answer(wanted: int, came: int, behind: bytes) -> None:
    """A late answer of another length, with the beginning of the true one behind it: each has a sound check sum."""
    request = Request(1, HOLDING, 0x1014, wanted)
    body = answered(Request(1, HOLDING, 0x1003, came), [7] * came)
    stream = (body + crc(body) + behind)[: 5 + 2 * wanted]
    if came != wanted and len(stream) == 5 + 2 * wanted:
        with pytest.raises(FrameError):
            decode_rtu(request, stream)


@given(requests, st.integers(1, 11))
def test_exceptions_survive_the_wire(request_: Request, code: int) -> None:
    body = bytes([request_.unit, request_.function | 0x80, code])
    assert decode_rtu(request_, body + crc(body)) == Answer(exception=code)


@given(requests, st.binary(max_size=64))
def test_noise_never_crashes(request_: Request, noise: bytes) -> None:
    with pytest.raises(FrameError):
        decode_rtu(request_, noise)
        raise FrameError("a hit by chance")
    framed = b"\x00\x01\x00\x00" + (len(noise) + 1).to_bytes(2, "big") + bytes([request_.unit]) + noise
    if len(framed) >= 9:
        try:
            decode_tcp(request_, framed)
        except FrameError:
            return
        assert noise[0] & 0x7F == request_.function


@given(st.integers(-(2**31), 2**31 - 1))
def test_pairs_of_words(value: int) -> None:
    assert signed_pair(*words_of(value)) == value


def test_signs() -> None:
    assert words_of(-625) == (0xFFFF, 0xFD8F)
    assert (signed_word(0x7FFF), signed_word(0x8000), signed_word(0xFFFF)) == (32767, -32768, -1)


@pytest.mark.parametrize(
    "request_",
    [
        Request(0, HOLDING, 0),
        Request(248, HOLDING, 0),
        Request(1, HOLDING, 0, 126),
        Request(1, HOLDING, 0, 0),
        Request(1, HOLDING, 0x10000),
        Request(1, WORD, 0, values=(0x10000,)),
        Request(1, WORD, 0, values=(-1,)),
        Request(1, WORD, 0),
        Request(1, WORD, 0, values=(1, 2)),
        Request(1, WORDS, 0, 124, (0,) * 124),
    ],
)
def test_requests_that_cannot_be_sent(request_: Request) -> None:
    with pytest.raises(FrameError, match="cannot be sent"):
        encode(request_, Framing.RTU)


def test_other_protocols_on_the_port() -> None:
    with pytest.raises(FrameError, match="protocol"):
        tcp_length(b"HTTP/1")
    with pytest.raises(FrameError, match="length"):
        tcp_length(bytes([0, 1, 0, 0, 0, 1]))
