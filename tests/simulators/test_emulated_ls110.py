"""The LS-110 from its own side: bytes of the reference's tables, modes, ranges, timing and every trap it names."""

import re
from collections.abc import Awaitable, Callable
from dataclasses import replace

import numpy as np
import pytest
from emulator_helpers import MORNING_NS, UniformWorld, in_virtual_time, on_memory, silence
from hypothesis import given
from hypothesis import strategies as st

from labdaq.clock import VirtualClock
from labdaq.pipe import PipeEnd
from labdaq.units import CD_M2_PER_FOOTLAMBERT
from simulators.ls110 import (
    LS100,
    Held,
    LuminanceMeter,
    LuminanceMeterOptions,
    LuminanceMeterWire,
    MeterOptics,
    four_digits,
)
from simulators.ls110.wire import STYLE, record
from simulators.world.observed import SunSeen

QUIET = LuminanceMeterOptions(repeatability=0.0)
RECORD = re.compile(rb"OK00,[CP][cf%][PLKT ][MH][ 0-9.]{6}\r\n")

Talk = Callable[[PipeEnd, VirtualClock, LuminanceMeter], Awaitable[None]]


def talking(talk: Talk, world: UniformWorld | None = None, options: LuminanceMeterOptions = QUIET) -> None:
    async def main(clock: VirtualClock) -> None:
        meter = LuminanceMeter(world or UniformWorld(), clock, options, seed=1)
        await on_memory(LuminanceMeterWire(meter, clock).serve, lambda end: talk(end, clock, meter))

    in_virtual_time(main)


async def ask(end: PipeEnd, command: str) -> bytes:
    end.write(command.encode() + b"\r\n")
    return await end.reader.readuntil(b"\r\n")


@pytest.mark.parametrize(
    ("held", "columns"),
    [
        (Held("125.3", "c", "P", peak=False), "CcPH 125.3"),
        (Held("0.01", "c", "P", peak=False), "CcPH  0.01"),
        (Held("83.02", "%", "P", peak=True), "P% H 83.02"),
        (Held("299900", "c", "P", peak=False), "CcPH299900"),
        (Held("12.30", "f", "T", peak=False), "CfTH 12.30"),
    ],
)
def test_records_look_like_the_manuals(held: Held, columns: str) -> None:
    assert record(held) == columns
    assert len(columns) == 10


@pytest.mark.parametrize(
    ("value", "shown"),
    [
        (0.0, "0.00"),
        (0.014, "0.01"),
        (9.994, "9.99"),
        (12.346, "12.35"),
        (99.994, "99.99"),
        (99.996, "100.0"),
        (125.34, "125.3"),
        (999.96, "1000"),
        (12_345.0, "12340"),
        (299_900.0, "299900"),
        (999_949.0, "999900"),
    ],
)
def test_four_digits_and_no_step_below_a_hundredth(value: float, shown: str) -> None:
    assert four_digits(value) == shown


@given(st.floats(0.0, 999_900.0))
def test_the_display_is_within_half_a_step(value: float) -> None:
    shown = four_digits(value)
    assert len(shown) <= 6
    assert len(shown.replace(".", "").lstrip("0").rstrip("0" if "." not in shown else "")) <= 4
    step = max(0.01, 10.0 ** (np.floor(np.log10(max(value, 1e-9))) - 3))
    assert abs(float(shown) - value) <= step * 0.5000001


def test_a_measurement_takes_half_a_second_to_one_point_six() -> None:
    async def talk(end: PipeEnd, clock: VirtualClock, meter: LuminanceMeter) -> None:
        for mode, least, most in (("06", 0.8, 1.0), ("07", 1.4, 1.6)):
            assert await ask(end, f"MDS,{mode}") == b"OK00\r\n"
            begun = clock.mono_ns()
            assert await ask(end, "MES") == b"OK00,CcPH  3000\r\n"
            took_s = (clock.mono_ns() - begun) / 1e9
            wire_s = (5 + 17) * STYLE.character_s
            assert least + wire_s <= took_s <= most + wire_s + 0.03

    talking(talk)


def test_what_is_sent_during_a_measurement_is_not_accepted() -> None:
    async def talk(end: PipeEnd, clock: VirtualClock, meter: LuminanceMeter) -> None:
        end.write(b"MES\r\n")
        await clock.sleep(0.3)
        end.write(b"MDS,05\r\nMES\r\n")
        assert await end.reader.readuntil(b"\r\n") == b"OK00,CcPH  3000\r\n"
        assert await silence(end, clock, 10.0)
        end.write(b"MES\r\nDSR\r\n")  # in one go: the second is deaf ears' too
        assert RECORD.fullmatch(await end.reader.readuntil(b"\r\n"))
        assert await silence(end, clock, 10.0)

    talking(talk)


def test_a_partial_command_times_out_after_five_seconds() -> None:
    async def talk(end: PipeEnd, clock: VirtualClock, meter: LuminanceMeter) -> None:
        end.write(b"ME")
        begun = clock.mono_ns()
        assert await end.reader.readuntil(b"\r\n") == b"ER00\r\n"
        assert (clock.mono_ns() - begun) / 1e9 == pytest.approx(5.0, abs=0.1)
        end.write(b"ME")
        await clock.sleep(4.0)
        end.write(b"S\r\n")
        assert RECORD.fullmatch(await end.reader.readuntil(b"\r\n"))
        end.write(b"MES\n")  # a bare LF does not end a command
        assert await end.reader.readuntil(b"\r\n") == b"ER00\r\n"

    talking(talk)


@pytest.mark.parametrize(
    "wrong",
    ["", "mes", "\\MES", "MDS04", "MDS,4", "MDS,10", "MDS,004", "CLE,", "CMW,1", "CMW,     0", "CMW,12 456",
     "CCW,0.000", "CCW,10.00", "CCW,1.00", "CCW,0,990", "XYZ", "MES,"],
)  # fmt: skip
def test_what_is_not_a_command_is_refused(wrong: str) -> None:
    async def talk(end: PipeEnd, clock: VirtualClock, meter: LuminanceMeter) -> None:
        assert await ask(end, wrong) == b"ER00\r\n"

    talking(talk)


def test_noise_without_end_is_dropped() -> None:
    async def talk(end: PipeEnd, clock: VirtualClock, meter: LuminanceMeter) -> None:
        end.write(b"\x7f" * 100)
        assert await end.reader.readuntil(b"\r\n") == b"ER00\r\n"
        await clock.sleep(6)
        assert (await ask(end, "DSR")).startswith(b"OK00")

    talking(talk)


@pytest.mark.parametrize(
    ("luminance", "mode", "reply"),
    [
        (600_000.0, "06", b"OK00,CcPH600000\r\n"),
        (600_000.0, "07", b"ER10\r\n"),
        (1_200_000.0, "06", b"ER10\r\n"),
        (499_900.0, "07", b"OK00,CcPH499900\r\n"),
        (0.0, "06", b"OK00,CcPH  0.00\r\n"),
    ],
)
def test_ranges_end_by_fast_and_slow(luminance: float, mode: str, reply: bytes) -> None:
    async def talk(end: PipeEnd, clock: VirtualClock, meter: LuminanceMeter) -> None:
        assert await ask(end, f"MDS,{mode}") == b"OK00\r\n"
        assert await ask(end, "MES") == reply
        assert await ask(end, "DSR") == reply

    talking(talk, UniformWorld(sky=luminance))


def test_an_ls100_ends_earlier() -> None:
    async def talk(end: PipeEnd, clock: VirtualClock, meter: LuminanceMeter) -> None:
        assert await ask(end, "MES") == b"ER10\r\n"

    talking(talk, UniformWorld(sky=300_500.0), replace(QUIET, model=LS100))


def test_a_value_too_long_for_the_display_is_er19() -> None:
    async def talk(end: PipeEnd, clock: VirtualClock, meter: LuminanceMeter) -> None:
        assert await ask(end, "CCW,2.000") == b"OK00\r\n"
        assert await ask(end, "MDS,01") == b"OK00\r\n"
        assert await ask(end, "MES") == b"ER19\r\n"
        assert await ask(end, "MDS,00") == b"OK00\r\n"
        assert await ask(end, "MES") == b"OK00,CcPH600000\r\n"

    talking(talk, UniformWorld(sky=600_000.0))


def test_percent_mode_needs_a_reference_and_answers_in_percent() -> None:
    async def talk(end: PipeEnd, clock: VirtualClock, meter: LuminanceMeter) -> None:
        assert await ask(end, "CMS") == b"ER11\r\n"  # nothing measured yet
        assert await ask(end, "MDS,05") == b"OK00\r\n"
        assert await ask(end, "MES") == b"ER11\r\n"
        assert await ask(end, "CMW,  6000") == b"OK00\r\n"
        assert await ask(end, "CMR") == b"OK00,c,  6000\r\n"
        assert await ask(end, "MES") == b"OK00,C% H 50.00\r\n"
        assert await ask(end, "CMS") == b"OK00\r\n"
        assert await ask(end, "CMR") == b"OK00,c,  3000\r\n"
        assert await ask(end, "MES") == b"OK00,C% H 100.0\r\n"
        assert await ask(end, "MDS,04") == b"OK00\r\n"
        assert await ask(end, "MES") == b"OK00,CcPH  3000\r\n"

    talking(talk)


def test_memory_commands_in_the_manuals_bytes() -> None:
    async def talk(end: PipeEnd, clock: VirtualClock, meter: LuminanceMeter) -> None:
        assert await ask(end, "CMW,748000") == b"OK00\r\n"
        assert await ask(end, "CMR") == bytes.fromhex("4F 4B 30 30 2C 63 2C 37 34 38 30 30 30 0D 0A")
        assert await ask(end, "CMW,123456") == b"OK00\r\n"  # rounded to four digits
        assert await ask(end, "CMR") == b"OK00,c,123500\r\n"
        assert await ask(end, "CCW,0.990") == b"OK00\r\n"
        assert await ask(end, "CCR") == b"OK00,0.990\r\n"
        assert await ask(end, "LMW, 100.0") == b"ER11\r\n"  # no reading to compare it with
        await ask(end, "MES")
        assert await ask(end, "LMW,  3300") == b"OK00\r\n"
        assert await ask(end, "LMR") == b"OK00,c,  3300\r\n"
        assert await ask(end, "MDS,02") == b"OK00\r\n"
        assert await ask(end, "MES") == b"OK00,CcLH  3300\r\n"
        assert await ask(end, "MDS,03") == b"OK00\r\n"
        assert await ask(end, "MES") == b"OK00,CcTH  3267\r\n"
        assert await ask(end, "CLE") == b"OK00\r\n"
        assert await ask(end, "CCR") == b"OK00,1.000\r\n"
        assert await ask(end, "MES") == b"OK00,CcPH  3000\r\n"
        assert await ask(end, "MDS,02") == b"OK00\r\n"
        assert await ask(end, "MES") == b"ER11\r\n"

    talking(talk)


def test_footlamberts_are_the_switchs_business() -> None:
    async def talk(end: PipeEnd, clock: VirtualClock, meter: LuminanceMeter) -> None:
        shown = four_digits(3000.0 / CD_M2_PER_FOOTLAMBERT)
        assert await ask(end, "MES") == f"OK00,CfPH{shown:>6}\r\n".encode()

    talking(talk, options=replace(QUIET, footlamberts=True))


def test_peak_keeps_the_largest() -> None:
    class Brightening(UniformWorld):
        def sky_luminance(self, towards: np.ndarray, utc_ns: int) -> np.ndarray:
            return super().sky_luminance(towards, utc_ns) * (2.0 if (utc_ns - MORNING_NS) % 2e9 > 3e8 else 1.0)

    async def talk(end: PipeEnd, clock: VirtualClock, meter: LuminanceMeter) -> None:
        assert await ask(end, "MDS,08") == b"OK00\r\n"
        assert await ask(end, "MES") == b"OK00,PcPH  6000\r\n"

    talking(talk, Brightening())


def test_without_the_f_key_there_is_never_an_answer() -> None:
    async def talk(end: PipeEnd, clock: VirtualClock, meter: LuminanceMeter) -> None:
        for sent in (b"MES\r\n", b"nonsense\r\n", b"par"):
            end.write(sent)
            assert await silence(end, clock, 10.0)

    talking(talk, options=replace(QUIET, remote_mode=False))


def test_a_dark_first_reading_may_end_remote_mode() -> None:
    async def talk(end: PipeEnd, clock: VirtualClock, meter: LuminanceMeter) -> None:
        end.write(b"MES\r\n")
        assert await silence(end, clock, 10.0)
        end.write(b"DSR\r\n")
        assert await silence(end, clock, 10.0)
        meter.remote_mode = True  # switched off, and on again with F
        assert await ask(end, "DSR") == b"OK00,CcPH  0.00\r\n"

    talking(talk, UniformWorld(sky=0.0), replace(QUIET, leaves_remote_mode_in_the_dark=True))


def test_an_exhausted_battery_is_er30() -> None:
    async def talk(end: PipeEnd, clock: VirtualClock, meter: LuminanceMeter) -> None:
        assert await ask(end, "MES") == b"ER30\r\n"

    talking(talk, options=replace(QUIET, battery_exhausted=True))


def test_repeated_readings_scatter_as_the_data_sheet_says() -> None:
    async def main(clock: VirtualClock) -> list[float]:
        meter = LuminanceMeter(UniformWorld(sky=9000.0), clock, LuminanceMeterOptions(), seed=5)
        return [float((await meter.measure()).number) for _ in range(400)]

    values = np.array(in_virtual_time(main))
    # 0.2 % is two standard deviations; 400 samples know theirs to 3.5 %
    assert np.std(values) / 9000.0 == pytest.approx(0.001, rel=0.15)
    assert np.mean(values) == pytest.approx(9000.0, rel=2e-4)
    assert np.array_equal(values, in_virtual_time(main))


def test_the_field_is_averaged_and_the_sun_blinds_the_meter() -> None:
    class Edge(UniformWorld):
        def sky_luminance(self, towards: np.ndarray, utc_ns: int) -> np.ndarray:
            return np.where(np.asarray(towards)[..., 0] > 0, 2000.0, 0.0)

    assert MeterOptics(Edge()).luminance(0) == pytest.approx(1000.0, abs=40.0)  # half the field, to one sample of 61
    at_sun = UniformWorld(beam=80_000.0, altitude=60.0, azimuth=100.0)
    towards_sun = MeterOptics(at_sun, altitude_deg=60.0, azimuth_deg=100.0)
    assert towards_sun.luminance(0) == pytest.approx(80_000.0 / 6.797e-5, rel=1e-2)
    beside = MeterOptics(at_sun, altitude_deg=60.0, azimuth_deg=102.0)
    assert beside.luminance(0) == pytest.approx(3000.0)


def test_the_hook_changes_what_is_seen() -> None:
    def glare(luminance: float, sun: SunSeen, angle: float) -> float:
        return luminance + sun.normal_illuminance_lx / angle**2

    world = UniformWorld(beam=45_000.0, altitude=60.0)
    assert MeterOptics(world, response=glare).luminance(0) == pytest.approx(3000.0 + 45_000.0 / 900.0, rel=1e-6)


@given(st.binary(max_size=40))
def test_no_bytes_break_the_meter(noise: bytes) -> None:
    async def talk(end: PipeEnd, clock: VirtualClock, meter: LuminanceMeter) -> None:
        end.write(noise)
        await clock.sleep(20.0)
        end.reader._buffer.clear()  # type: ignore[attr-defined]
        assert await ask(end, "CCR") in {b"OK00,1.000\r\n", b"ER00\r\n"}

    talking(talk)
