"""The LS-110's codec against the frames of the maker's manual, and against everything else."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.exchange import FrameError
from drivers.ls110.codec import (
    CHECK_CODES,
    LONGEST_REPLY,
    Calibration,
    Mode,
    Record,
    Reply,
    decode_reply,
    encode_command,
    encode_mode,
    encode_reply,
)
from labdaq.units import Unit


def record(number: str, unit: Unit = Unit.CANDELA_PER_M2, peak: bool = False) -> Record:
    return Record(peak, unit, Calibration.NONE if unit is Unit.PERCENT else Calibration.PRESET, True, number)


@pytest.mark.parametrize(
    ("wire", "expected", "value"),
    [
        ("4F 4B 30 30 2C 43 63 50 48 20 31 32 35 2E 33 0D 0A", record("125.3"), 125.3),
        ("4F 4B 30 30 2C 43 63 50 48 20 20 30 2E 30 31 0D 0A", record("0.01"), 0.01),
        ("4F 4B 30 30 2C 43 66 50 48 31 32 35 2E 33 35 0D 0A", record("125.35", Unit.FOOTLAMBERT), 125.35),
        ("4F 4B 30 30 2C 50 25 20 48 20 38 33 2E 30 32 0D 0A", record("83.02", Unit.PERCENT, peak=True), 83.02),
        ("4F 4B 30 30 2C 43 63 50 48 32 39 39 39 30 30 0D 0A", record("299900"), 299_900.0),
    ],
)
def test_records_of_the_manual(wire: str, expected: Record, value: float) -> None:
    line = bytes.fromhex(wire)
    assert decode_reply(line) == Reply("OK00", expected)
    assert expected.value == value
    assert encode_reply(Reply("OK00", expected)) == line


def test_a_blank_after_the_comma_is_accepted() -> None:
    assert decode_reply(b"OK00, CcPH 125.3\r\n") == decode_reply(b"OK00,CcPH 125.3\r\n")
    assert len(b"OK00, CcPH 125.3\r\n") == LONGEST_REPLY


@pytest.mark.parametrize(
    ("wire", "code"), [("4F 4B 30 30 0D 0A", "OK00"), ("45 52 31 30 0D 0A", "ER10"), ("45 52 30 30 0D 0A", "ER00")]
)
def test_codes_alone(wire: str, code: str) -> None:
    assert decode_reply(bytes.fromhex(wire)) == Reply(code)
    assert code in CHECK_CODES


def test_commands() -> None:
    assert encode_command("MES") == bytes.fromhex("4D 45 53 0D 0A")
    assert encode_command("DSR") == bytes.fromhex("44 53 52 0D 0A")
    assert encode_command("CLE") == bytes.fromhex("43 4C 45 0D 0A")
    assert encode_mode(Mode.ABSOLUTE) == bytes.fromhex("4D 44 53 2C 30 34 0D 0A")
    assert encode_mode(Mode.CONTINUOUS) == b"MDS,09\r\n"


@pytest.mark.parametrize(
    "line",
    [
        b"",
        b"\r\n",
        b"OK00",  # no end
        b"OK0\r\n",
        b"OK01\r\n",
        b"\xcfK00\r\n",  # parity bit set: a 7E line read as 8N
        b"OK00,CcPH 125.3 \r\n",  # one column too many
        b"OK00,CcPH 125.3\n",
        b"OK00,CcPH125.3\r\n",  # a column lost
        b"OK00,  CcPH 125.3\r\n",  # two blanks
        b"OK00,XcPH 125.3\r\n",
        b"OK00,CxPH 125.3\r\n",
        b"OK00,CcXH 125.3\r\n",
        b"OK00,CcPX 125.3\r\n",
        b"OK00,Cc H 125.3\r\n",  # cd/m2 without a calibration
        b"OK00,C%PH 125.3\r\n",  # percent with one
        b"OK00,CcPH12 5.3\r\n",  # a blank inside
        b"OK00,CcPH125.3 \r\n",  # not right-justified
        b"OK00,CcPH1.2.34\r\n",
        b"OK00,CcPH      \r\n",
        b"OK00,CcPH     .\r\n",
        b"OK00,CcPH -1.25\r\n",
        b"OK00,CcPH 1\x00.53\r\n",  # a character void by its parity
        b"MES\r\n",
    ],
)
def test_nothing_else_is_taken_for_a_reply(line: bytes) -> None:
    with pytest.raises(FrameError):
        decode_reply(line)


@pytest.mark.parametrize(
    ("number", "digit"),
    [("0.01", 0.01), ("9.99", 0.01), ("125.3", 0.1), ("1253", 1.0), ("299900", 100.0), ("12530", 10.0), ("0", 1.0)],
)
def test_the_last_digit(number: str, digit: float) -> None:
    assert record(number).digit == pytest.approx(digit, rel=1e-12)  # powers of ten: rounding of the last bit


numbers = st.one_of(
    st.integers(0, 999_999).map(str),
    st.integers(0, 9_999).flatmap(lambda n: st.sampled_from([f"{n / 10:.1f}", f"{n / 100:.2f}", f"{n / 1000:.3f}"])),
)
records = st.builds(
    lambda peak, unit, calibration, held, number: Record(
        peak, unit, Calibration.NONE if unit is Unit.PERCENT else calibration, held, number
    ),
    st.booleans(),
    st.sampled_from([Unit.CANDELA_PER_M2, Unit.FOOTLAMBERT, Unit.PERCENT]),
    st.sampled_from([c for c in Calibration if c is not Calibration.NONE]),
    st.booleans(),
    numbers,
)


@given(records)
def test_records_survive_the_wire(value: Record) -> None:
    line = encode_reply(Reply("OK00", value))
    assert len(line) == 17
    assert decode_reply(line) == Reply("OK00", value)


@given(records, st.integers(0, 16), st.integers(0, 7))
def test_a_flipped_bit_is_never_taken_for_another_length_or_prefix(value: Record, at: int, bit: int) -> None:
    """Without a check sum a flipped bit may make another valid digit or letter, but never a reply of another kind."""
    line = bytearray(encode_reply(Reply("OK00", value)))
    line[at] ^= 1 << bit
    try:
        reply = decode_reply(bytes(line))
    except FrameError:
        return
    assert at >= 5, "the prefix was damaged and taken"
    assert reply.record is not None
    assert reply.record != value


@given(st.binary(max_size=40))
def test_noise_never_crashes(noise: bytes) -> None:
    try:
        reply = decode_reply(noise)
    except FrameError:
        return
    assert noise.endswith(b"\r\n") and reply.code.encode() == noise[:4]
