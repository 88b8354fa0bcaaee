"""The goniophotometer from its own side: the reference's frames, motion, converters, and each way they fail."""

import math
import struct
from collections.abc import Awaitable, Callable
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from emulator_helpers import UniformWorld, in_virtual_time, on_memory, silence
from hypothesis import assume, given
from hypothesis import strategies as st

from labdaq.clock import NS, VirtualClock
from labdaq.pipe import PipeEnd
from simulators.goniophotometer import (
    BentArm,
    ExceptionReply,
    Goniophotometer,
    GoniophotometerOptions,
    ImperfectSensors,
    LateReply,
    LostReply,
    SensorChain,
    SilentUnit,
    WrongCrc,
)
from simulators.goniophotometer.motion import Profile, move
from simulators.goniophotometer.pdu import answer
from simulators.goniophotometer.rtu import crc16, rtu_frame, silent_interval_s
from simulators.line import Garbage, MemoryPort, SerialFormat

V_PER_LX = 3e-3
PLAIN = GoniophotometerOptions(chain=SensorChain(noise_v=0.0))

Talk = Callable[[PipeEnd, VirtualClock, Goniophotometer], Awaitable[None]]


def talking(
    talk: Talk, options: GoniophotometerOptions = PLAIN, world: UniformWorld | None = None, *, tcp: bool = False
) -> None:
    async def main(clock: VirtualClock) -> None:
        bench = Goniophotometer(world or UniformWorld(), clock, options, seed=3)
        await on_memory(bench.tcp.serve if tcp else bench.rtu.serve, lambda end: talk(end, clock, bench))

    in_virtual_time(main)


async def exchange(end: PipeEnd, request: bytes, length: int) -> bytes:
    end.write(request)
    return await end.reader.readexactly(length)


async def words(end: PipeEnd, unit: int, address: int, count: int, function: int = 3) -> list[int]:
    reply = await exchange(end, rtu_frame(unit, struct.pack(">BHH", function, address, count)), 5 + 2 * count)
    assert crc16(reply[:-2]) == reply[-2:]
    assert reply[:3] == bytes([unit, function, 2 * count])
    return list(struct.unpack(f">{count}H", reply[3:-2]))


async def position(end: PipeEnd) -> int:
    high, low = await words(end, 1, 0x1014, 2)
    value: int = struct.unpack(">i", struct.pack(">HH", high, low))[0]
    return value


async def write(end: PipeEnd, unit: int, address: int, value: int) -> None:
    request = rtu_frame(unit, struct.pack(">BHH", 6, address, value))
    assert await exchange(end, request, 8) == request


async def go(end: PipeEnd, counts: int, rpm: int = 2, mode: int = 1) -> None:
    body = struct.pack(">HHB", 0x6200, 8, 16) + struct.pack(">HiHHHHH", mode, counts, rpm, 100, 100, 0, 0x10)
    assert await exchange(end, rtu_frame(1, b"\x10" + body), 8) == bytes.fromhex("01 10 62 00 00 08 DE 77")


async def wait_until_still(end: PipeEnd, clock: VirtualClock) -> int:
    await clock.sleep(0.05)
    while (await words(end, 1, 0x1003, 1))[0] & 0x04:
        await clock.sleep(0.05)
    return (await words(end, 1, 0x1003, 1))[0]


async def home(end: PipeEnd, clock: VirtualClock) -> None:
    await write(end, 1, 0x6002, 0x20)
    assert await wait_until_still(end, clock) == 0x72


# --- frames ---


@pytest.mark.parametrize(
    "text",
    [
        "01 10 62 00 00 08 10 00 01 FF FF FD 8F 00 3C 00 64 00 64 00 00 00 10 5A 4F",
        "01 10 62 00 00 08 DE 77",
        "01 03 10 03 00 01 70 CA",
        "01 03 02 00 06 38 46",
        "01 03 02 00 32 39 91",
        "01 03 02 00 72 38 61",
        "01 03 10 14 00 02 80 CF",
        "01 03 04 FF FF FD 8F FB 23",
        "01 06 60 02 00 20 37 D2",
        "01 06 60 02 00 21 F6 12",
        "01 06 60 02 00 40 37 FA",
        "01 03 22 03 00 01 7E 72",
        "01 03 02 00 01 79 84",
        "01 06 18 01 11 11 12 F6",
        "01 83 02 C0 F1",
        "01 90 03 0C 01",
        "01 83 08 40 F6",
        "07 10 62 00 00 08 10 00 01 00 00 27 10 00 00 27 10 27 10 00 00 00 10 8D 50",
        "02 04 00 00 00 08 F1 FF",
        "02 04 10 00 00 40 00 7F FF 80 00 00 03 00 00 00 00 00 00 02 7C",
        "02 03 01 00 00 08 45 C3",
        "02 06 01 00 00 08 89 C3",
        "02 03 01 E0 00 04 44 30",
        "02 02 00 80 00 08 78 17",
        "02 02 01 00 A1 CC",
        "02 01 01 10 00 01 FD C0",
    ],
)
def test_every_frame_of_the_reference_has_its_crc(text: str) -> None:
    frame = bytes.fromhex(text)
    assert rtu_frame(frame[0], frame[1:-2]) == frame


def test_the_references_conversation() -> None:
    """Home, a move to -625 counts (-22.5 degrees), and the refusals, in the reference's bytes."""

    async def talk(end: PipeEnd, clock: VirtualClock, bench: Goniophotometer) -> None:
        async def ask(request: str, reply: str) -> None:
            assert await exchange(end, bytes.fromhex(request), len(bytes.fromhex(reply))) == bytes.fromhex(reply)

        await ask("01 06 60 02 00 20 37 D2", "01 06 60 02 00 20 37 D2")
        await clock.sleep(20.0)
        await ask("01 03 10 03 00 01 70 CA", "01 03 02 00 72 38 61")
        move_frame = "01 10 62 00 00 08 10 00 01 FF FF FD 8F 00 3C 00 64 00 64 00 00 00 10 5A 4F"
        await ask(move_frame, "01 10 62 00 00 08 DE 77")
        await clock.sleep(0.03)
        status = await words(end, 1, 0x1003, 1)
        assert status == [0x46]  # moving, homed
        await clock.sleep(0.2)
        await ask("01 03 10 14 00 02 80 CF", "01 03 04 FF FF FD 8F FB 23")
        assert bench.arm.c_deg(clock.mono_ns()) == pytest.approx(337.5)
        bench.axis.raise_alarm(0x0001)
        await ask("01 03 22 03 00 01 7E 72", "01 03 02 00 01 79 84")
        await ask("01 06 18 01 11 11 12 F6", "01 06 18 01 11 11 12 F6")
        assert await words(end, 1, 0x2203, 1) == [0]
        await ask(rtu_frame(1, b"\x03\x50\x00\x00\x01").hex(), "01 83 02 C0 F1")
        bad_mode = rtu_frame(1, b"\x10\x62\x00\x00\x01\x02\x00\x77")
        await ask(bad_mode.hex(), "01 90 03 0C 01")
        await ask("01 03 10 03 00 01 70 CB", "01 83 08 40 F6")

    talking(talk)


def test_unknown_units_and_spoilt_frames_get_silence() -> None:
    async def talk(end: PipeEnd, clock: VirtualClock, bench: Goniophotometer) -> None:
        for frame in (
            rtu_frame(9, b"\x03\x10\x03\x00\x01"),
            bytes.fromhex("02 04 00 00 00 08 F1 FE"),  # a module keeps silent where the drive complains
            b"\x01",
            b"\x55\xaa\x00",
        ):
            end.write(frame)
            assert await silence(end, clock, 1.0)
        assert await words(end, 1, 0x1003, 1) == [0x32]

    talking(talk)


def test_frames_are_told_apart_by_silence() -> None:
    request = rtu_frame(1, b"\x03\x10\x03\x00\x01")

    async def talk(end: PipeEnd, clock: VirtualClock, bench: Goniophotometer) -> None:
        end.write(request[:3])
        await clock.sleep(0.010)  # a hiccup of the sender's computer
        assert len(await exchange(end, request[3:], 7)) == 7
        end.write(request[:3])
        await clock.sleep(0.1)  # given up
        assert await exchange(end, request, 7) == bytes.fromhex("01 03 02 00 32 39 91")
        end.write(b"\xff\xff" + request)  # noise without a gap spoils the frame
        assert await silence(end, clock, 1.0)
        end.write(request + request)  # and so does another frame without a gap
        assert await exchange(end, b"", 5) == bytes.fromhex("01 83 08 40 F6")
        assert await words(end, 1, 0x1003, 1) == [0x32]

    talking(talk)
    assert silent_interval_s(SerialFormat(115_200)) == 0.00175
    assert silent_interval_s(SerialFormat(9600, parity="E")) == pytest.approx(3.5 * 11 / 9600)


def test_answers_come_no_sooner_than_the_line_and_the_drive_allow() -> None:
    async def talk(end: PipeEnd, clock: VirtualClock, bench: Goniophotometer) -> None:
        begun = clock.mono_ns()
        await words(end, 1, 0x1003, 1)
        took_s = (clock.mono_ns() - begun) / NS
        assert took_s >= (8 + 7 + 3.5) * 10 / 9600 + 0.025 - 1e-6
        assert took_s < 0.06

    talking(talk, replace(PLAIN, baud=9600))


def test_a_broadcast_is_obeyed_and_not_answered() -> None:
    async def talk(end: PipeEnd, clock: VirtualClock, bench: Goniophotometer) -> None:
        end.write(rtu_frame(0, b"\x06\x60\x0f\x00\x09"))
        assert await silence(end, clock, 1.0)
        assert await words(end, 1, 0x600F, 1) == [9]

    talking(talk)


@given(st.binary(min_size=1, max_size=60))
def test_no_pdu_breaks_a_unit(pdu: bytes) -> None:
    async def main(clock: VirtualClock) -> None:
        bench = Goniophotometer(UniformWorld(), clock, PLAIN)
        for unit in (bench.drive, *bench.modules):
            reply = answer(unit, pdu)
            assert reply[0] & 0x7F == pdu[0] & 0x7F
            assert len(reply) <= 253

    in_virtual_time(main)


@given(st.lists(st.binary(min_size=1, max_size=40), max_size=4), st.booleans())
def test_no_bytes_break_a_line(noise: list[bytes], tcp: bool) -> None:
    async def main(clock: VirtualClock) -> None:
        bench = Goniophotometer(UniformWorld(), clock, PLAIN)
        port = MemoryPort(bench.tcp.serve if tcp else bench.rtu.serve)
        end = port.dial()
        for piece in noise:
            try:
                end.write(piece)
            except ConnectionResetError:
                break  # a gateway hangs up on nonsense
            await clock.sleep(0.1)
        request = bytes.fromhex("000900000006011310030001") if tcp else rtu_frame(1, b"\x03\x10\x03\x00\x01")
        again = port.dial()
        again.write(request)
        await again.reader.readexactly(7)
        await port.aclose()

    in_virtual_time(main)


@pytest.mark.parametrize(
    ("unit", "pdu", "reply"),
    [
        (1, "01 0000 0001", "81 01"),  # a function the drive does not know
        (1, "03 1003 0000", "83 03"),
        (1, "03 1003 007E", "83 03"),
        (1, "03 6200 0060", "83 03"),  # more than 200 bytes
        (1, "03 1015 0002", "83 02"),
        (1, "06 1003 0000", "86 02"),  # read only
        (1, "06 6002 0123", "86 03"),
        (1, "10 6200 0002 04 0001", "90 03"),  # byte count and data disagree
        (1, "10 6207 0001 02 0010", "90 03"),  # a path without a speed
        (1, "03 0000 0002", "03 04 0000 2710"),  # a parameter's high and low word
        (2, "03 0009 0001", "83 02"),
        (2, "06 0100 0033", "86 03"),
        (2, "05 0110 FF00", "85 02"),
        (2, "05 010D 1234", "85 03"),
        (2, "10 0100 0001 02 0008", "90 01"),
        (3, "03 01E4 0001", "03 02 0003"),
        (2, "03 01E2 0002", "03 04 8001 0700"),
    ],
)
def test_exceptions_and_plain_registers(unit: int, pdu: str, reply: str) -> None:
    async def main(clock: VirtualClock) -> None:
        bench = Goniophotometer(UniformWorld(), clock, PLAIN)
        assert answer(bench.rtu.slaves.units[unit], bytes.fromhex(pdu)) == bytes.fromhex(reply)

    in_virtual_time(main)


# --- motion ---


@given(
    st.floats(-1e4, 1e4), st.floats(-2e3, 2e3), st.floats(-1e4, 1e4), st.floats(10, 3e3), st.floats(50, 1e5),
    st.floats(50, 1e5),
)  # fmt: skip
def test_every_move_is_continuous_and_ends_at_rest_at_its_target(
    start: float, velocity: float, target: float, speed: float, acc: float, dec: float
) -> None:
    assume(abs(target - start) > 1e-6)
    legs = move(start, velocity, target, speed, acc, dec)
    assert legs[0].position == start
    assert legs[0].velocity == pytest.approx(velocity)
    for before, after in pairwise(legs):
        assert after.position == pytest.approx(before.end[0], abs=1e-3)
        assert after.velocity == pytest.approx(before.end[1], abs=1e-3)
    assert legs[-1].end == pytest.approx((target, 0.0), abs=1e-3)
    assert all(leg.seconds >= 0 for leg in legs)
    fastest = max(abs(leg.velocity) for leg in legs)
    assert fastest <= max(speed, abs(velocity)) * (1 + 1e-9)
    profile = Profile(0, tuple(legs))
    assert profile.at(profile.end_ns + 1)[0] == pytest.approx(target, abs=1e-3)


def test_a_move_takes_a_trapezoids_time() -> None:
    """2 rpm = 333.3 counts/s, 100 ms per 1000 rpm = 1.667e6 counts/s²: 625 counts in 1.875 s + 0.2 ms."""
    legs = move(0.0, 0.0, 625.0, 1000 / 3, 1e4 / 60 * 1e4, 1e4 / 60 * 1e4)
    assert Profile(0, tuple(legs)).seconds == pytest.approx(625 / (1000 / 3) + (1000 / 3) / (1e8 / 60), rel=1e-9)


def test_the_old_bits_stay_for_a_moment_after_the_trigger() -> None:
    async def talk(end: PipeEnd, clock: VirtualClock, bench: Goniophotometer) -> None:
        await home(end, clock)
        await go(end, 625)
        assert await words(end, 1, 0x1003, 1) == [0x72]  # as if it had arrived already
        assert await words(end, 1, 0x6002, 1) == [0x010]
        await clock.sleep(0.03)
        assert await words(end, 1, 0x1003, 1) == [0x46]
        assert await words(end, 1, 0x6002, 1) == [0x100]
        assert await words(end, 1, 0x1045, 1) == [2]  # rpm
        assert await wait_until_still(end, clock) == 0x72
        assert await words(end, 1, 0x6002, 1) == [0x000]
        assert await position(end) == 625
        await go(end, -1250, mode=0x41)
        await wait_until_still(end, clock)
        assert await position(end) == -625

    talking(talk)


def test_before_homing_the_position_means_nothing() -> None:
    async def talk(end: PipeEnd, clock: VirtualClock, bench: Goniophotometer) -> None:
        assert (await words(end, 1, 0x1003, 1))[0] & 0x40 == 0
        assert await position(end) == 0
        assert bench.arm.c_deg(clock.mono_ns()) == pytest.approx(37.4, abs=0.02)
        for mode in (0x0C, 0x0D):  # reverse, forward
            await write(end, 1, 0x600A, mode)
            await home(end, clock)
            assert await position(end) == 0
            assert bench.arm.c_deg(clock.mono_ns()) == pytest.approx(0.0, abs=1e-6)
        await go(end, 625)
        await wait_until_still(end, clock)
        bench.drive.power_cycle()
        assert (await words(end, 1, 0x1003, 1))[0] & 0x40 == 0
        assert await position(end) == 0
        assert bench.arm.c_deg(clock.mono_ns()) == pytest.approx(22.5)

    talking(talk)


def test_homing_that_is_stopped_is_not_homed() -> None:
    async def talk(end: PipeEnd, clock: VirtualClock, bench: Goniophotometer) -> None:
        await write(end, 1, 0x6002, 0x20)
        await clock.sleep(0.2)
        await write(end, 1, 0x6002, 0x40)
        status = await wait_until_still(end, clock)
        assert status & 0x60 == 0
        await clock.sleep(30)
        assert (await words(end, 1, 0x1003, 1))[0] & 0x60 == 0

    talking(talk)


def test_a_quick_stop_leaves_the_path_incomplete() -> None:
    async def talk(end: PipeEnd, clock: VirtualClock, bench: Goniophotometer) -> None:
        await home(end, clock)
        await go(end, 5000)
        await clock.sleep(1.0)
        await write(end, 1, 0x6002, 0x40)
        assert await wait_until_still(end, clock) == 0x52
        here = await position(end)
        assert 300 < here < 400
        await clock.sleep(5)
        assert await position(end) == here

    talking(talk)


def test_an_alarm_stops_the_arm_and_bars_moves_until_it_is_reset() -> None:
    async def talk(end: PipeEnd, clock: VirtualClock, bench: Goniophotometer) -> None:
        await home(end, clock)
        await go(end, 5000)
        await clock.sleep(1.0)
        bench.axis.raise_alarm(0x0180)
        await clock.sleep(1.0)
        assert (await words(end, 1, 0x1003, 1))[0] & 0x07 == 0x01
        here = await position(end)
        await go(end, 0)
        await clock.sleep(2.0)
        assert await position(end) == here
        await write(end, 1, 0x1801, 0x1111)
        await go(end, 0)
        assert await wait_until_still(end, clock) == 0x72
        assert await position(end) == 0

    talking(talk)


def test_soft_limits_zeroing_direction_velocity_and_jog() -> None:
    async def talk(end: PipeEnd, clock: VirtualClock, bench: Goniophotometer) -> None:
        await home(end, clock)
        for address, value in ((0x6006, 0), (0x6007, 300), (0x6008, 0xFFFF), (0x6009, 0xFFFF), (0x6000, 2)):
            await write(end, 1, address, value)
        await go(end, 625)
        assert await wait_until_still(end, clock) & 0x30 == 0x10  # stopped, and not where it was sent
        assert await position(end) == 300
        await write(end, 1, 0x6000, 0)
        await write(end, 1, 0x6002, 0x21)
        assert await position(end) == 0
        assert bench.arm.c_deg(clock.mono_ns()) == pytest.approx(10.8)
        await write(end, 1, 0x0007, 1)
        await go(end, 100)
        await wait_until_still(end, clock)
        assert bench.arm.c_deg(clock.mono_ns()) == pytest.approx(7.2)
        await write(end, 1, 0x0007, 0)
        await go(end, 0, rpm=3, mode=2)
        await clock.sleep(2.0)
        assert await words(end, 1, 0x1047, 1) == [3]
        await write(end, 1, 0x6002, 0x40)
        await wait_until_still(end, clock)
        before = await position(end)
        for _ in range(10):
            await write(end, 1, 0x1801, 0x4002)
            await clock.sleep(0.03)
        await clock.sleep(0.5)
        jogged = before - await position(end)
        assert 100 < jogged < 160  # about 0.35 to 0.45 s of 333 counts/s
        await write(end, 1, 0x1801, 0x2211)
        assert await words(end, 1, 0x1901, 1) == [0x5555]
        assert await words(end, 1, 0x1901, 1) == [0x1111]

    talking(talk)


def test_a_motor_without_power_does_not_move() -> None:
    async def talk(end: PipeEnd, clock: VirtualClock, bench: Goniophotometer) -> None:
        await go(end, 625)
        await clock.sleep(3.0)
        assert await position(end) == 0
        await write(end, 1, 0x000F, 1)
        await go(end, 625)
        await wait_until_still(end, clock)
        assert await position(end) == 625

    talking(talk, replace(PLAIN, enabled=False))


def test_a_drive_may_lie_about_arriving_or_never_stop_running() -> None:
    async def talk(end: PipeEnd, clock: VirtualClock, bench: Goniophotometer) -> None:
        await home(end, clock)
        bench.axis.faults.stop_error_counts = 12
        await go(end, 625)
        assert await wait_until_still(end, clock) == 0x72
        assert await position(end) == 637
        bench.axis.faults.stuck_running = True
        await go(end, 0)
        await clock.sleep(60.0)
        assert (await words(end, 1, 0x1003, 1))[0] & 0x34 == 0x04

    talking(talk)


# --- analog modules ---


async def volts(end: PipeEnd, unit: int, full_scale: float = 10.0) -> np.ndarray:
    raw = np.array(await words(end, unit, 0, 8, function=4)).astype(np.uint16).view(np.int16)
    return raw / 32767.0 * full_scale


def expected_lux(c_deg: float) -> np.ndarray:
    gammas = np.array([0.0, 5, 15, 25, 35, 45, 55, 65, 75, 85])
    return UniformWorld().room_illuminance(gammas, c_deg, 0)


def test_ten_heads_read_the_worlds_illuminance() -> None:
    async def talk(end: PipeEnd, clock: VirtualClock, bench: Goniophotometer) -> None:
        await home(end, clock)
        for c in (0.0, 22.5, 337.5):
            await go(end, round(c / 0.036))
            await wait_until_still(end, clock)
            await clock.sleep(1.0)
            read = np.concatenate([await volts(end, 2), await volts(end, 3)])
            assert read[10:] == pytest.approx(np.zeros(6), abs=1e-9)
            # half a step of the ±10 V range is 0.15 mV, that is 0.05 lx
            assert read[:10] / V_PER_LX == pytest.approx(expected_lux(c), abs=0.051)

    talking(talk)


def test_a_finer_range_takes_effect_with_the_next_scan() -> None:
    async def talk(end: PipeEnd, clock: VirtualClock, bench: Goniophotometer) -> None:
        await clock.sleep(0.85)
        coarse = await words(end, 2, 0, 1, 4)
        await write(end, 2, 0x0100, 0x0A)
        assert await words(end, 2, 0x0100, 1) == [0x0A]
        assert await words(end, 2, 0, 1, 4) == coarse  # still the old scan's code, in the old range
        await clock.sleep(0.9)
        fine = (await words(end, 2, 0, 1, 4))[0] / 32767 * 1.0 / V_PER_LX
        assert fine == pytest.approx(expected_lux(37.4)[0], abs=0.0052)

    talking(talk)


def test_saturation_looks_like_the_end_of_the_range_and_nothing_else() -> None:
    world = UniformWorld()

    async def talk(end: PipeEnd, clock: VirtualClock, bench: Goniophotometer) -> None:
        world.candela = 1e6
        await clock.sleep(1.0)
        assert (await words(end, 2, 0, 1, 4))[0] == 0x7FFF
        assert await exchange(end, bytes.fromhex("02 02 00 80 00 08 78 17"), 6) == rtu_frame(2, b"\x02\x01\x00")
        world.candela = -1e6  # a wrong wire
        await clock.sleep(1.0)
        assert (await words(end, 2, 0, 1, 4))[0] == 0x8000
        await write(end, 2, 0x0100, 0x07)
        await clock.sleep(1.0)
        assert await exchange(end, bytes.fromhex("02 02 00 80 00 08 78 17"), 6) == rtu_frame(2, b"\x02\x01\x01")

    talking(talk, world=world)


def test_engineering_format_counts_millivolts() -> None:
    async def talk(end: PipeEnd, clock: VirtualClock, bench: Goniophotometer) -> None:
        await clock.sleep(1.0)
        request = rtu_frame(2, b"\x05\x01\x0d\xff\x00")
        assert await exchange(end, request, 8) == request
        assert (await words(end, 2, 0, 1, 4))[0] == pytest.approx(expected_lux(37.4)[0] * 3.0, abs=1)

    talking(talk)


def test_the_reset_flag_is_up_once_and_a_reboot_loses_settings() -> None:
    async def talk(end: PipeEnd, clock: VirtualClock, bench: Goniophotometer) -> None:
        flag = bytes.fromhex("02 01 01 10 00 01 FD C0")
        assert (await exchange(end, flag, 6))[3] == 1
        assert (await exchange(end, flag, 6))[3] == 0
        await write(end, 2, 0x0103, 0x0A)
        bench.modules[0].reboot()
        end.write(flag)
        assert await silence(end, clock, 0.5)
        await clock.sleep(1.0)
        assert (await exchange(end, flag, 6))[3] == 1
        assert await words(end, 2, 0x0103, 1) == [0x08]

    talking(talk)


def test_the_host_watchdog_trips_after_silence() -> None:
    async def talk(end: PipeEnd, clock: VirtualClock, bench: Goniophotometer) -> None:
        await write(end, 2, 0x01E8, 20)  # 2 s
        on = rtu_frame(2, b"\x05\x01\x04\xff\x00")
        assert await exchange(end, on, 8) == on
        status = rtu_frame(2, b"\x01\x01\x0c\x00\x01")
        await clock.sleep(1.5)
        assert (await exchange(end, status, 6))[3] == 0
        await clock.sleep(2.5)
        assert (await exchange(end, status, 6))[3] == 1
        assert await words(end, 2, 0x01EB, 1) == [1]
        clear = rtu_frame(2, b"\x05\x01\x0c\xff\x00")
        assert await exchange(end, clear, 8) == clear
        assert (await exchange(end, status, 6))[3] == 0

    talking(talk)


def test_heads_have_sensitivities_and_dark_voltages_of_their_own() -> None:
    gains = tuple(1e7 * (1 + 0.01 * k) for k in range(10))
    dark = tuple(1e-3 * k for k in range(10))

    async def talk(end: PipeEnd, clock: VirtualClock, bench: Goniophotometer) -> None:
        await clock.sleep(1.0)
        scale = V_PER_LX * (1 + 0.01 * np.arange(8))
        assert await volts(end, 2) == pytest.approx(scale * expected_lux(37.4)[:8] + 1e-3 * np.arange(8), abs=1.6e-4)

    talking(talk, replace(PLAIN, chain=SensorChain(transimpedance_ohm=gains, offset_v=dark, noise_v=0.0)))


def test_a_frozen_channel_stays_and_a_disabled_one_is_zero() -> None:
    world = UniformWorld()

    async def talk(end: PipeEnd, clock: VirtualClock, bench: Goniophotometer) -> None:
        await clock.sleep(1.0)
        first = await words(end, 2, 0, 3, 4)
        bench.modules[0].freeze(1)
        await write(end, 2, 0x01E9, 0xFE)
        world.candela *= 2
        await clock.sleep(1.0)
        second = await words(end, 2, 0, 3, 4)
        assert second[0] == 0
        assert second[1] == first[1]
        assert second[2] == pytest.approx(2 * first[2], abs=2)
        bench.modules[0].thaw()
        assert (await words(end, 2, 0, 2, 4))[1] == pytest.approx(2 * first[1], abs=2)

    talking(talk, world=world)


def test_conversion_noise_is_what_was_asked_for() -> None:
    async def main(clock: VirtualClock) -> np.ndarray:
        bench = Goniophotometer(UniformWorld(), clock, GoniophotometerOptions(chain=SensorChain(noise_v=1e-3)), seed=2)
        rows = []
        for _ in range(300):
            await clock.sleep(0.8)
            rows.append(bench.modules[0].read_words(0, 8, inputs=True))
        return np.array(rows) / 32767 * 10.0

    read = in_virtual_time(main)
    assert np.std(read - read.mean(axis=0)) == pytest.approx(1e-3, rel=0.07)  # 2400 samples know it to 1.5 %
    assert np.array_equal(read, in_virtual_time(main))


# --- hooks ---


def lux_of(options: GoniophotometerOptions, moves: tuple[int, ...] = ()) -> np.ndarray:
    """What the heads respond to after the arm went through ``moves`` (counts)."""
    result: list[np.ndarray] = []

    async def talk(end: PipeEnd, clock: VirtualClock, bench: Goniophotometer) -> None:
        await home(end, clock)
        for counts in moves:
            await go(end, counts)
            await wait_until_still(end, clock)
        result.append(bench.illuminance(clock.utc_ns(), clock.mono_ns()))

    talking(talk, options)
    return result[0]


def test_a_bent_arm_looks_elsewhere() -> None:
    bent = lux_of(replace(PLAIN, arm=BentArm(gamma_offset_deg=2.0, c_offset_deg=5.0)), (2500,))
    world = UniformWorld()
    assert bent == pytest.approx(world.room_illuminance(np.array([2.0, 7, 17, 27, 37, 47, 57, 67, 77, 87]), 95.0, 0))
    nadir = lux_of(replace(PLAIN, arm=BentArm(gamma_offset_deg=-2.0)), (2500,))
    assert nadir[0] == pytest.approx(world.room_illuminance(np.array([2.0]), 270.0, 0)[0])
    mirrored = lux_of(replace(PLAIN, arm=BentArm(mirrored=True, c_offset_deg=10.0)), (625,))
    assert mirrored == pytest.approx(expected_lux(-32.5))


def test_backlash_depends_on_the_side_the_arm_came_from() -> None:
    loose = replace(PLAIN, arm=BentArm(backlash_deg=2.0))
    assert lux_of(loose, (2500,)) == pytest.approx(expected_lux(89.0))
    assert lux_of(loose, (3000, 2500)) == pytest.approx(expected_lux(91.0))


def test_imperfect_sensors() -> None:
    true = expected_lux(0.0)
    gain = np.ones(10)
    gain[3] = 1.1
    assert lux_of(replace(PLAIN, sensors=ImperfectSensors(gain=gain))) == pytest.approx(true * gain)
    assert lux_of(replace(PLAIN, sensors=ImperfectSensors(offset_lx=2.0))) == pytest.approx(true + 2.0)
    assert lux_of(replace(PLAIN, sensors=ImperfectSensors(saturation_lx=50.0))).max() == 50.0
    bent = lux_of(replace(PLAIN, sensors=ImperfectSensors(exponent=0.98)))
    assert bent == pytest.approx(1000 * (true / 1000) ** 0.98)
    shield = ImperfectSensors(angular=lambda gamma, c: 1 - gamma / 900.0)
    assert lux_of(replace(PLAIN, sensors=shield))[9] == pytest.approx(true[9] * (1 - 85 / 900))


def test_swapped_wires() -> None:
    async def talk(end: PipeEnd, clock: VirtualClock, bench: Goniophotometer) -> None:
        await clock.sleep(1.0)
        read = await volts(end, 2)
        assert read[1] / V_PER_LX == pytest.approx(expected_lux(37.4)[2], abs=0.051)
        assert read[2] / V_PER_LX == pytest.approx(expected_lux(37.4)[1], abs=0.051)

    talking(talk, replace(PLAIN, wiring=(0, 2, 1, 3, 4, 5, 6, 7, 8, 9)))
    with pytest.raises(ValueError, match="each of the 10 heads once"):
        GoniophotometerOptions(wiring=(0, 0))


def test_units_and_heads_are_what_the_options_say() -> None:
    async def talk(end: PipeEnd, clock: VirtualClock, bench: Goniophotometer) -> None:
        await clock.sleep(1.0)
        assert await words(end, 17, 0x1003, 1) == [0x32]
        assert (await words(end, 20, 1, 1, 4))[0] / 32767 * 10 / V_PER_LX == pytest.approx(
            UniformWorld().room_illuminance(np.array([40.0]), 37.4, 0)[0], abs=0.051
        )
        end.write(rtu_frame(1, b"\x03\x10\x03\x00\x01"))
        assert await silence(end, clock, 1.0)

    talking(talk, replace(PLAIN, gammas_deg=(0.0, 40.0), motor_unit=17, sensor_units=(20,)))
    with pytest.raises(ValueError, match="too few for 10 heads"):
        GoniophotometerOptions(sensor_units=(2,))
    with pytest.raises(ValueError, match="different numbers"):
        GoniophotometerOptions(sensor_units=(1, 2))


# --- faults ---


def test_faults_of_units() -> None:
    status = rtu_frame(1, b"\x03\x10\x03\x00\x01")

    async def talk(end: PipeEnd, clock: VirtualClock, bench: Goniophotometer) -> None:
        bench.faults.arm(WrongCrc(), unit=1)
        reply = await exchange(end, status, 7)
        assert crc16(reply[:-2]) != reply[-2:]
        bench.faults.arm(ExceptionReply(4), unit=1, function=3)
        assert await exchange(end, status, 5) == rtu_frame(1, b"\x83\x04")
        bench.faults.arm(SilentUnit(), unit=1, times=2)
        for _ in range(2):
            end.write(status)
            assert await silence(end, clock, 1.0)
        bench.faults.arm(LostReply(), unit=1, function=6)
        end.write(rtu_frame(1, b"\x06\x60\x0f\x00\x05"))
        assert await silence(end, clock, 1.0)
        assert await words(end, 1, 0x600F, 1) == [5]  # it was obeyed all the same
        bench.faults.arm(SilentUnit(), unit=2, times=None)
        assert await words(end, 1, 0x1003, 1) == [0x32]
        end.write(rtu_frame(2, b"\x04\x00\x00\x00\x01"))
        assert await silence(end, clock, 1.0)
        bench.faults.clear()
        await words(end, 2, 0, 1, 4)

    talking(talk)


def test_a_late_reply_comes_after_the_next_requests() -> None:
    """The trap of RTU, which has no transaction number: the answer to A is taken for the answer to B."""

    async def talk(end: PipeEnd, clock: VirtualClock, bench: Goniophotometer) -> None:
        await write(end, 1, 0x600F, 7)
        bench.faults.arm(LateReply(2.0), unit=1)
        end.write(rtu_frame(1, b"\x03\x60\x0f\x00\x01"))
        assert await silence(end, clock, 1.0)
        assert await words(end, 1, 0x1003, 1) == [0x32]  # the unit still serves others
        await clock.sleep(1.5)
        assert await end.reader.readexactly(7) == rtu_frame(1, b"\x03\x02\x00\x07")

    talking(talk)


def test_line_faults_reach_the_bus() -> None:
    async def main(clock: VirtualClock) -> None:
        bench = Goniophotometer(UniformWorld(), clock, PLAIN)
        bench.rtu.line_faults.arm(Garbage(b"\xff"))

        async def talk(end: PipeEnd) -> bytes:
            return await exchange(end, rtu_frame(1, b"\x03\x10\x03\x00\x01"), 8)

        assert await on_memory(bench.rtu.serve, talk) == b"\xff" + bytes.fromhex("01 03 02 00 32 39 91")

    in_virtual_time(main)


# --- TCP ---


def test_tcp_requests_may_be_pipelined_and_split_anywhere() -> None:
    async def talk(end: PipeEnd, clock: VirtualClock, bench: Goniophotometer) -> None:
        first = bytes.fromhex("00 01 00 00 00 06 01 03 10 14 00 02")
        second = bytes.fromhex("00 02 00 00 00 06 01 03 10 03 00 01")
        third = bytes.fromhex("00 03 00 00 00 06 09 03 10 03 00 01")
        stream = first + second + third
        for cut in range(len(stream)):
            end.write(stream[:cut])
            await clock.sleep(0.001)
            end.write(stream[cut:])
            assert await end.reader.readexactly(13) == bytes.fromhex("00 01 00 00 00 07 01 03 04 00 00 00 00")
            assert await end.reader.readexactly(11) == bytes.fromhex("00 02 00 00 00 05 01 03 02 00 32")
            assert await end.reader.readexactly(9) == bytes.fromhex("00 03 00 00 00 03 09 83 0B")

    talking(talk, tcp=True)


def test_tcp_hangs_up_on_nonsense_and_orders_late_replies_by_time() -> None:
    async def late(end: PipeEnd, clock: VirtualClock, bench: Goniophotometer) -> None:
        bench.faults.arm(LateReply(1.0), unit=1)
        end.write(bytes.fromhex("00 01 00 00 00 06 01 03 10 03 00 01"))
        end.write(bytes.fromhex("00 02 00 00 00 06 01 03 10 03 00 01"))
        assert (await end.reader.readexactly(11))[1] == 2
        assert (await end.reader.readexactly(11))[1] == 1

    async def nonsense(end: PipeEnd, clock: VirtualClock, bench: Goniophotometer) -> None:
        end.write(b"GET / HTTP/1.1\r\n\r\n")
        assert await end.reader.read() == b""

    talking(late, tcp=True)
    talking(nonsense, tcp=True)


def test_both_ways_in_lead_to_the_same_arm() -> None:
    async def main(clock: VirtualClock) -> None:
        bench = Goniophotometer(UniformWorld(), clock, PLAIN)

        async def over_rtu(end: PipeEnd) -> None:
            await home(end, clock)
            await go(end, 1250)
            await wait_until_still(end, clock)

        async def over_tcp(end: PipeEnd) -> bytes:
            return await exchange(end, bytes.fromhex("00 01 00 00 00 06 01 03 10 14 00 02"), 13)

        await on_memory(bench.rtu.serve, over_rtu)
        assert await on_memory(bench.tcp.serve, over_tcp) == bytes.fromhex("00 01 00 00 00 07 01 03 04 00 00 04 E2")
        assert math.isclose(bench.arm.c_deg(clock.mono_ns()), 45.0)

    in_virtual_time(main)
