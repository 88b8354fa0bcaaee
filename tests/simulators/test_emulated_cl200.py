"""The CL-200A from its own side: every frame of the reference, the sequence, ranges, errors, and each trap it names."""

import math
from collections.abc import Awaitable, Callable
from dataclasses import replace

import numpy as np
import pytest
from emulator_helpers import UniformWorld, in_virtual_time, on_memory, silence
from hypothesis import given
from hypothesis import strategies as st

from labdaq import directions
from labdaq.clock import VirtualClock
from labdaq.pipe import PipeEnd
from simulators.cl200 import ChromaMeter, ChromaMeterOptions, ChromaMeterWire, Head, LevelHead, colour
from simulators.cl200.blocks import BLANK, float_block, long_block, parse_float_block
from simulators.cl200.frames import Request, frame, take_request
from simulators.cl200.wire import reading

QUIET = ChromaMeterOptions(repeatability=0.0, chromaticity_repeatability=0.0)

# body from head to data, and the check code that the reference prints for it
REQUESTS = {
    "00541   ": "13",
    "99551  0": "02",
    "004010  ": "06",
    "014010  ": "07",
    "994021  ": "04",
    "00011200": "01",
    "00021200": "02",
    "00021300": "03",
    "00021201": "03",
    "00021301": "02",
    "01021200": "03",
    "08021200": "0A",
    "29021200": "09",
    "00031200": "03",
    "00081200": "08",
    "00151200": "04",
    "00451000": "03",
    "004711  ": "00",
    "004721  ": "03",
    "004731  ": "02",
    "004811  3F800000000000003E2B367A": "07",
    "004821  000000003F80000000000000": "71",
    "004831  00000000000000003F800000": "70",
}

REPLIES = {
    "0054    ": "02",
    "0040    ": "07",
    "0040 4  ": "13",
    "00021 20+32543+38560+40400": "02",
    "00021 10+ 2733+45450+44990": "1F",
    "00011 20+31063+32543+16953": "06",
    "00031 20+32543+21800+51380": "0F",
    "00081 20+32543+40514+01080": "0D",
    "00451 204417D747442DD82943B3C6C2": "14",
    "0048    ": "0F",
    "0047    3F800000000000003E2B367A": "08",
    "00021 60+32543+38560+40400": "06",
    "00021610+  213+38560+40400": "14",
    "00021540+99995+38560+40400": "17",
    "00021 21+32543+38560+40400": "03",
    "00081720+32543            ": "17",
}

Talk = Callable[[PipeEnd, VirtualClock, ChromaMeter], Awaitable[None]]


def talking(talk: Talk, world: UniformWorld | None = None, options: ChromaMeterOptions = QUIET) -> None:
    async def main(clock: VirtualClock) -> None:
        meter = ChromaMeter(world or UniformWorld(), clock, options, seed=1)
        await on_memory(ChromaMeterWire(meter, clock).serve, lambda end: talk(end, clock, meter))

    in_virtual_time(main)


async def ask(end: PipeEnd, body: str) -> str:
    """Send a request; return the reply without its envelope, whose check sum is verified."""
    end.write(frame(body))
    reply = await end.reader.readuntil(b"\r\n")
    text = reply[1:-5].decode()
    assert reply == frame(text)
    assert len(reply) in (14, 32, 38)
    return text


async def start(end: PipeEnd, clock: VirtualClock, *heads: str) -> None:
    """The documented start: 54, 55, and 40 for each head, with the waits."""
    assert await ask(end, "00541   ") == "0054    "
    await clock.sleep(0.5)
    end.write(frame("99551  0"))
    await clock.sleep(0.5)
    for head in heads or ("00",):
        reply = await ask(end, f"{head}4010  ")
        assert reply in {f"{head}40 {error}  " for error in " 567"}  # 5 to 7 tell of the previous reading
    await clock.sleep(0.5)


async def trigger(end: PipeEnd, clock: VirtualClock) -> None:
    end.write(frame("994021  "))
    await clock.sleep(0.5)


@pytest.mark.parametrize(("body", "code"), REQUESTS.items())
def test_every_request_of_the_reference_is_understood(body: str, code: str) -> None:
    data = f"\x02{body}\x03{code}\r\n".encode()
    assert frame(body) == data
    assert take_request(bytearray(data)) == Request(body[:2], body[2:4], body[4:8], body[8:])
    assert take_request(bytearray(data[:-4] + data[-4:].lower())) is not None


@pytest.mark.parametrize(("body", "code"), REPLIES.items())
def test_every_reply_of_the_reference_has_its_bytes(body: str, code: str) -> None:
    assert frame(body) == f"\x02{body}\x03{code}\r\n".encode()


def test_a_frame_in_full() -> None:
    assert frame("00541   ") == bytes.fromhex("02 30 30 35 34 31 20 20 20 03 31 33 0D 0A")
    assert frame("08021200") == bytes.fromhex("02 30 38 30 32 31 32 30 30 03 30 41 0D 0A")  # hexadecimal, not decimal
    long = frame("00021 10+ 2733+45450+44990")  # captured from a real meter
    assert long == bytes.fromhex("0230303032312031302B20323733332B34353435302B343439393003") + b"1F\r\n"


def test_the_manuals_light_gives_the_manuals_numbers() -> None:
    xyz = colour.tristimulus(325.4, (0.3856, 0.4040))
    assert reading("01", xyz, " ") == "+31063+32543+16953"
    assert reading("02", xyz, " ") == "+32543+38560+40400"
    assert reading("03", xyz, " ") == "+32543+21800+51380"
    found = colour.colour_temperature((0.3856, 0.4040))
    assert found is not None
    # the reference's 4051 K, +0.0108 comes from an approximation it calls illustrative
    assert found[0] == pytest.approx(4051, abs=10)
    assert found[1] == pytest.approx(0.0108, abs=0.0002)
    assert reading("08", xyz, "7") == "+32543" + BLANK + BLANK


@pytest.mark.parametrize(
    ("value", "decimals", "zeros", "block"),
    [
        (325.4, 1, False, "+32543"),
        (0.3856, 4, True, "+38560"),
        (27.3, 1, False, "+ 2733"),
        (1234.0, 1, False, "+12344"),
        (-0.0001, 4, True, "-00010"),
        (0.0, 1, False, "=   03"),
        (0.0, 4, True, "=00000"),
        (99_990.0, 1, False, "+99995"),
        (999.96, 1, False, "+10004"),
        (999.94, 1, False, "+99993"),
        (9999.4, 1, False, "+99994"),
        (9999.6, 1, False, "+10005"),
        (4051.0, 0, False, "+40514"),
        (15_370.0, 0, False, "+15375"),
        (0.0108, 4, True, "+01080"),
    ],
)
def test_blocks_round_before_they_choose_the_exponent(value: float, decimals: int, zeros: bool, block: str) -> None:
    assert long_block(value, decimals, zeros=zeros) == block


@given(st.floats(0.05, 99_990.0))
def test_blocks_keep_four_digits(value: float) -> None:
    block = long_block(value, 1)
    assert len(block) == 6
    back = int(block[1:5]) * 10.0 ** (int(block[5]) - 4)
    assert abs(back - value) <= max(0.0500001, value * 0.5001e-3)


@given(st.floats(width=32, allow_nan=False))
def test_float_blocks_round_trip(value: float) -> None:
    assert parse_float_block(float_block(value)) == value


def test_float_blocks_of_the_reference() -> None:
    assert float_block(1.0) == "3F800000"
    assert float_block(0.1672) == "3E2B367A"
    assert parse_float_block("4417D747") == pytest.approx(607.3637, abs=1e-4)
    assert math.isnan(parse_float_block("XYZ"))


@given(st.binary(max_size=80))
def test_no_bytes_break_the_parser_and_a_good_frame_still_gets_through(noise: bytes) -> None:
    buffer = bytearray(bytes(b & 0x7F for b in noise) + b"\r\n" + frame("00541   "))
    found = []
    while (request := take_request(buffer)) is not None:
        found.append(request)
    assert found[-1] == Request("00", "54", "1   ")


def test_nothing_but_54_is_answered_before_pc_mode() -> None:
    async def talk(end: PipeEnd, clock: VirtualClock, meter: ChromaMeter) -> None:
        for body in ("00021200", "004010  ", "99551  0", "01541   ", "00541  0"):
            end.write(frame(body))
            assert await silence(end, clock, 2.0)
        assert await ask(end, "00541   ") == "0054    "

    talking(talk)


def test_a_wrong_check_sum_gets_no_answer_at_all() -> None:
    async def talk(end: PipeEnd, clock: VirtualClock, meter: ChromaMeter) -> None:
        await start(end, clock)
        good = frame("00021200")
        for k in range(len(good)):
            end.write(good[:k] + bytes([good[k] ^ 0x01]) + good[k + 1 :])
            assert await silence(end, clock, 2.0)
        assert (await ask(end, "00021200")).startswith("00021")

    talking(talk)


def test_a_seven_bit_meter_seen_through_8n1_is_understood() -> None:
    async def talk(end: PipeEnd, clock: VirtualClock, meter: ChromaMeter) -> None:
        end.write(bytes.fromhex("82 30 30 35 B4 B1 A0 A0 A0 03 B1 33 8D 0A"))
        assert await end.reader.readuntil(b"\r\n") == frame("0054    ")

    talking(talk)


def test_an_absent_head_and_a_broadcast_read_get_no_answer() -> None:
    async def talk(end: PipeEnd, clock: VirtualClock, meter: ChromaMeter) -> None:
        await start(end, clock)
        for body in ("01021200", "99021200", "0A021200", "00021400", "00021202", "00991200"):
            end.write(frame(body))
            assert await silence(end, clock, 2.0)

    talking(talk)


def test_the_documented_sequence_reads_pi_times_the_sky() -> None:
    async def talk(end: PipeEnd, clock: VirtualClock, meter: ChromaMeter) -> None:
        await start(end, clock)
        await trigger(end, clock)
        reply = await ask(end, "00021200")
        assert reply.startswith("00021 30")  # 9425 lx: range 3
        assert reply[8:14] == long_block(3000.0 * math.pi, 1)
        assert (await ask(end, "00011200"))[14:20] == reply[8:14]  # same measurement, another unit
        assert (await ask(end, "00081200"))[8:14] == reply[8:14]
        assert (await ask(end, "00031200"))[8:14] == reply[8:14]

    talking(talk)


def test_readers_that_ask_exactly_half_a_second_after_writing_the_trigger_are_served() -> None:
    async def talk(end: PipeEnd, clock: VirtualClock, meter: ChromaMeter) -> None:
        await start(end, clock)
        for _ in range(20):
            await trigger(end, clock)
            assert (await ask(end, "00021200"))[6] == "3"

    talking(talk)


def test_reading_too_early_is_range_0() -> None:
    async def talk(end: PipeEnd, clock: VirtualClock, meter: ChromaMeter) -> None:
        await start(end, clock)
        end.write(frame("994021  "))
        await clock.sleep(0.2)
        assert (await ask(end, "00021200"))[4:8] == "1 00"
        await clock.sleep(0.5)
        assert (await ask(end, "00021200"))[4:8] == "1 30"

    talking(talk)


def test_external_mode_needs_hold_and_hold_needs_its_wait() -> None:
    async def talk(end: PipeEnd, clock: VirtualClock, meter: ChromaMeter) -> None:
        await ask(end, "00541   ")
        assert await ask(end, "004010  ") == "0040 4  "
        end.write(frame("99551  0"))
        await clock.sleep(0.1)
        assert await ask(end, "004010  ") == "0040 4  "
        await clock.sleep(0.5)
        assert await ask(end, "004010  ") == "0040    "

    talking(talk)


def test_a_trigger_too_soon_after_external_mode_leaves_the_range_undetermined() -> None:
    async def talk(end: PipeEnd, clock: VirtualClock, meter: ChromaMeter) -> None:
        await ask(end, "00541   ")
        end.write(frame("99551  0"))
        await clock.sleep(0.5)
        await ask(end, "004010  ")
        end.write(frame("994021  "))
        await clock.sleep(2.0)
        assert (await ask(end, "00021200"))[6] == "0"
        await trigger(end, clock)
        assert (await ask(end, "00021200"))[6] == "3"

    talking(talk)


def test_broadcasts_are_never_answered() -> None:
    async def talk(end: PipeEnd, clock: VirtualClock, meter: ChromaMeter) -> None:
        await start(end, clock)
        end.write(frame("99551  0"))
        assert await silence(end, clock, 2.0)
        end.write(frame("994021  "))
        assert await silence(end, clock, 2.0)

    talking(talk)


def test_a_light_step_needs_up_to_four_triggers() -> None:
    world = UniformWorld(sky=10.0)

    async def talk(end: PipeEnd, clock: VirtualClock, meter: ChromaMeter) -> None:
        await start(end, clock)
        for sky, ranges in ((20_000.0, "6664"), (20_000.0, "4"), (10.0, "6661"), (200.0, "62")):
            world.sky = sky
            for expected in ranges:
                await trigger(end, clock)
                reply = await ask(end, "00021200")
                assert reply[6] == expected
                if expected == "6":
                    assert reply[8:14] != long_block(math.pi * sky, 1)  # well-formed, and to be thrown away
            assert reply[8:14] == long_block(math.pi * sky, 1)

    talking(talk, world)


def test_errors_by_light() -> None:
    world = UniformWorld(sky=40_000.0)

    async def talk(end: PipeEnd, clock: VirtualClock, meter: ChromaMeter) -> None:
        await start(end, clock)
        await trigger(end, clock)
        over = await ask(end, "00021200")
        assert over[4:8] == "1540"
        assert over[8:14] == "+99995"
        assert await ask(end, "004010  ") == "0040 " + "5  "  # the previous reading's, to be ignored
        world.sky = 1.0
        for _ in range(4):
            await trigger(end, clock)
        low = await ask(end, "00021200")
        assert low[4:8] == "1610"
        assert low[8:14] == "+  313"

    talking(talk, world)


def test_range_6_beats_error_5() -> None:
    world = UniformWorld(sky=10.0)

    async def talk(end: PipeEnd, clock: VirtualClock, meter: ChromaMeter) -> None:
        await start(end, clock)
        world.sky = 60_000.0
        await trigger(end, clock)
        assert (await ask(end, "00021200"))[6] == "6"

    talking(talk, world)


def test_a_low_battery_and_a_powerless_head_say_so() -> None:
    async def battery(end: PipeEnd, clock: VirtualClock, meter: ChromaMeter) -> None:
        await start(end, clock)
        await trigger(end, clock)
        assert (await ask(end, "00021200"))[4:8] == "1 31"

    async def powerless(end: PipeEnd, clock: VirtualClock, meter: ChromaMeter) -> None:
        await ask(end, "00541   ")
        end.write(frame("99551  0"))
        await clock.sleep(0.5)
        assert await ask(end, "004010  ") == "0040 1  "
        assert (await ask(end, "00021200"))[5] == "1"

    talking(battery, options=replace(QUIET, battery_low=True))
    talking(powerless, options=replace(QUIET, heads=(Head(error="1"),)))


def test_a_colour_without_temperature_is_error_7_with_blank_blocks() -> None:
    class Green:
        def illuminance(self, world: object, utc_ns: int) -> tuple[float, float]:
            return 0.0, 5000.0

    async def talk(end: PipeEnd, clock: VirtualClock, meter: ChromaMeter) -> None:
        await start(end, clock)
        end.write(frame("004811  " + float_block(0.2) + float_block(0.0) + float_block(0.0)))
        assert await end.reader.readuntil(b"\r\n") == frame("0048    ")
        await trigger(end, clock)
        assert (await ask(end, "00081200"))[5] == " "
        assert (await ask(end, "00081300"))[14:] == BLANK + BLANK

    talking(talk, options=replace(QUIET, heads=(Head(response=Green()),)))


def test_many_heads_measure_at_one_trigger() -> None:
    heads = (
        Head(0),
        Head(1, LevelHead(shaded_half_angle_deg=5.0)),
        Head(29, LevelHead(tilt_deg=10.0, tilt_azimuth_deg=120.0)),
    )
    world = UniformWorld(sky=2000.0, beam=60_000.0)

    async def talk(end: PipeEnd, clock: VirtualClock, meter: ChromaMeter) -> None:
        await start(end, clock, "00", "01", "29")
        for _ in range(2):
            await trigger(end, clock)
        values = {}
        for head in ("00", "01", "29"):
            reply = await ask(end, head + "021200")
            assert reply.startswith(head + "02")
            values[head] = int(reply[9:13]) * 10.0 ** (int(reply[13]) - 4)
        sine = math.sin(math.radians(45))
        cap = math.sin(math.radians(5)) ** 2
        assert values["00"] == pytest.approx(math.pi * 2000 + 60_000 * sine, rel=1e-3)
        assert values["01"] == pytest.approx(math.pi * 2000 * (1 - cap * sine), rel=1e-3)
        leaning = math.pi * 1000 * (1 + math.cos(math.radians(10))) + 60_000 * math.cos(math.radians(35))
        assert values["29"] == pytest.approx(leaning, rel=1e-3)

    talking(talk, world, replace(QUIET, heads=heads))
    with pytest.raises(ValueError, match="different numbers"):
        ChromaMeterOptions(heads=(Head(3), Head(3)))


def test_a_cosine_error_acts_on_sun_and_sky() -> None:
    world = UniformWorld(sky=2000.0, beam=60_000.0, altitude=30.0)
    droop = LevelHead(cosine=lambda angle: 1.0 - 0.1 * np.sin(np.radians(angle)) ** 2)
    beam, sky = droop.illuminance(world, 0)
    assert beam == pytest.approx(60_000 * 0.5 * (1 - 0.1 * 0.75), rel=1e-9)
    # the cosine-weighted mean of sin² over a hemisphere is one half; 40 rings integrate it to 1e-3 of itself
    assert sky == pytest.approx(math.pi * 2000 * (1 - 0.05), rel=1e-4)
    assert LevelHead(gain=1.02).illuminance(world, 0)[0] == pytest.approx(1.02 * 30_000.0)


def test_user_calibration_is_read_written_and_applied() -> None:
    async def talk(end: PipeEnd, clock: VirtualClock, meter: ChromaMeter) -> None:
        await start(end, clock)
        await trigger(end, clock)
        plain = await ask(end, "00021200")
        assert await ask(end, "00021300") == plain  # the identity matrix changes nothing
        assert await ask(end, "004711  ") == "0047    3F800000000000003E2B367A"
        assert await ask(end, "004821  " + "00000000" + float_block(2.0) + "00000000") == "0048    "
        assert await ask(end, "004721  ") == "0047    " + "00000000" + float_block(2.0) + "00000000"
        doubled = await ask(end, "00021300")
        assert doubled[8:14] == long_block(6000.0 * math.pi, 1)
        assert await ask(end, "00021200") == plain
        assert await ask(end, "004821  " + "7F800000" * 3) == "0048 4  "
        special = await ask(end, "00451000")
        x2, y, z = (parse_float_block(special[k : k + 8]) for k in (8, 16, 24))
        assert y == pytest.approx(3000.0 * math.pi, rel=1e-6)
        x = (x2 + 0.1672 * z) / (x2 + 0.1672 * z + y + z)
        assert x == pytest.approx(int(plain[15:19]) / 1e4, abs=0.6e-4)

    talking(talk)


def test_a_cl200_ignores_what_only_a_cl200a_knows() -> None:
    async def talk(end: PipeEnd, clock: VirtualClock, meter: ChromaMeter) -> None:
        await start(end, clock)
        await trigger(end, clock)
        for body in ("00151200", "00451000", "004711  "):
            end.write(frame(body))
            assert await silence(end, clock, 2.0)
        assert (await ask(end, "00021200"))[6] == "3"

    talking(talk, options=replace(QUIET, model="CL-200"))


def test_pc_mode_ends_only_with_the_power_switch() -> None:
    async def talk(end: PipeEnd, clock: VirtualClock, meter: ChromaMeter) -> None:
        await start(end, clock)
        for _ in range(3):  # a second program starts over and finds hold and external mode in force
            await ask(end, "00541   ")
        await start(end, clock)
        meter.switch_off_and_on()
        end.write(frame("00541   "))
        assert await silence(end, clock, 2.0)  # zero calibration
        await clock.sleep(3.0)
        end.write(frame("00021200"))
        assert await silence(end, clock, 2.0)
        assert await ask(end, "00541   ") == "0054    "

    async def later(end: PipeEnd, clock: VirtualClock, meter: ChromaMeter) -> None:
        assert not meter.awake
        await clock.sleep(4.5)
        await talk(end, clock, meter)

    talking(later, options=replace(QUIET, zero_calibration_s=4.0))


def test_without_hold_the_meter_runs_free() -> None:
    world = UniformWorld(sky=10.0)

    async def talk(end: PipeEnd, clock: VirtualClock, meter: ChromaMeter) -> None:
        await ask(end, "00541   ")
        for sky, used in ((10.0, "1"), (20_000.0, "4"), (100.0, "2")):
            world.sky = sky
            reply = await ask(end, "00021200")
            assert reply[6] == used
            assert reply[8:14] == long_block(math.pi * sky, 1)

    talking(talk, world)


def test_repeated_readings_scatter_as_the_data_sheet_says() -> None:
    async def main(clock: VirtualClock) -> list[float]:
        meter = ChromaMeter(UniformWorld(), clock, ChromaMeterOptions(), seed=4)
        return [float(meter.read(0).xyz[1]) for _ in range(400)]

    values = np.array(in_virtual_time(main)) / (3000.0 * math.pi)
    # 0.5 % is two standard deviations; 400 samples know theirs to 3.5 %
    assert np.std(values) == pytest.approx(0.0025, rel=0.15)
    assert np.mean(values) == pytest.approx(1.0, abs=6e-4)


def test_colours_are_where_the_tables_have_them() -> None:
    assert colour.OBSERVER.sum(axis=1) == pytest.approx([10.68] * 3, abs=0.01)  # equal areas, CIE 15
    d65 = colour.colour_temperature((0.3127, 0.3290))
    a = colour.colour_temperature((0.4476, 0.4074))
    assert d65 is not None
    assert a is not None
    assert d65[0] == pytest.approx(6504, abs=10)
    assert d65[1] == pytest.approx(0.0032, abs=2e-4)
    assert a[0] == pytest.approx(2856, abs=5)
    assert a[1] == pytest.approx(0.0, abs=1e-4)
    assert colour.daylight_chromaticity(6504.0) == pytest.approx((0.3127, 0.3291), abs=2e-4)
    red = colour.OBSERVER[:, list(colour.WAVELENGTHS_NM).index(620.0)]
    assert colour.dominant_wavelength(colour.chromaticity(red)) == pytest.approx((620.0, 100.0), abs=0.2)
    assert colour.dominant_wavelength((0.4, 0.2))[0] == pytest.approx(-521.0, abs=1.0)
    low, high = colour.sun_chromaticity(5.0), colour.sun_chromaticity(60.0)
    assert low[0] > high[0] > colour.sky_chromaticity(5000.0)[0] > colour.sky_chromaticity(1000.0)[0]


def test_a_mixture_of_sun_and_sky_lies_between_them() -> None:
    sun = directions.sky_vector(45.0, 120.0)
    assert sun[2] > 0

    async def main(clock: VirtualClock) -> tuple[float, float]:
        meter = ChromaMeter(UniformWorld(beam=60_000.0), clock, QUIET)
        return colour.chromaticity(meter.read(0).xyz)

    x, _ = in_virtual_time(main)
    assert colour.sky_chromaticity(3000.0)[0] < x < colour.sun_chromaticity(45.0)[0]
