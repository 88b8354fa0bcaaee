"""Arm, analog modules and the goniophotometer made of them, against a bench model with faults; in virtual time."""

import asyncio
import math
from dataclasses import replace

import pytest
from bench import START, Answer, Bench, Drive, Module, bench, crc, now

from drivers.goniophotometer import (
    RTU_SETTINGS,
    ArmOptions,
    GoniophotometerOptions,
    HeadOptions,
    LineOptions,
    ModuleOptions,
    ten_heads,
)
from drivers.goniophotometer.codec import Framing
from labdaq.errors import ConfigError, ConnectError, DeviceTimeout, ProtocolError, RefusedError
from labdaq.reading import Flag
from labdaq.units import Quantity, Unit
from labdaq.virtual_time import run_virtual

MOVE, SINGLE = 16, 6


def writes(table: Bench) -> list[bytes]:
    return table.requests(MOVE) + table.requests(SINGLE)


def is_write(request: bytes, function: int = MOVE) -> bool:
    return request[1] == function


# Connecting


def test_the_settings_of_the_line() -> None:
    assert str(RTU_SETTINGS) == "9600 8N1"


def test_connecting_moves_nothing_and_tells_who_is_there() -> None:
    async def main() -> None:
        table = Bench()
        async with bench(table) as gonio:
            await gonio.connect()
            who = gonio.identity()
        assert writes(table) == []
        assert (who.name, who.model, who.port) == ("gonio", "goniophotometer", "/dev/ttyUSB3")
        assert who.firmware == "unit 2: 07082008/00A10102, unit 3: 07082008/00A10102"

    run_virtual(main())


@pytest.mark.parametrize(
    ("drive", "says", "tries"),
    [
        (Drive(alarm=0x180), "alarm 0x180: position following error", "reset the alarm"),
        (Drive(alarm=0x777), "alarm 0x777: see the drive's manual", "reset the alarm"),
        (Drive(enabled=False), "not enabled", "Pr0.07"),
        (Drive(pulses=4000), "counts 4000 a turn", "counts_per_turn"),
    ],
)
def test_a_drive_that_cannot_be_used(drive: Drive, says: str, tries: str) -> None:
    async def main() -> None:
        async with bench(Bench(drive)) as gonio:
            with pytest.raises(RefusedError, match=says) as caught:
                await gonio.connect()
        assert tries in caught.value.hint
        assert str(caught.value.place) == "gonio on /dev/ttyUSB3 unit 1"

    run_virtual(main())


def test_a_unit_that_is_not_there() -> None:
    async def main() -> None:
        async with bench(Bench(modules={2: Module()})) as gonio:
            with pytest.raises(ConnectError, match="does not answer") as caught:
                await gonio.connect()
        assert caught.value.place.port == "/dev/ttyUSB3 unit 3"
        assert "unit number" in caught.value.hint

    run_virtual(main())


def test_modules_are_set_up_once() -> None:
    async def main() -> None:
        table = Bench(modules={2: Module(ranges=[8, 9, 8, 8, 8, 8, 8, 0x0A]), 3: Module(engineering=True)})
        async with bench(table) as gonio:
            began = now()
            await gonio.connect()
            assert now() - began > 2.0  # each changed module settles for a second
            written = len(table.requests(SINGLE) + table.requests(5))
            await gonio.connect()
            assert len(table.requests(SINGLE) + table.requests(5)) == written == 3
        assert table.modules[2].ranges == [8] * 8
        assert not table.modules[3].engineering

    run_virtual(main())


def test_a_module_that_forgets_its_settings() -> None:
    async def main() -> None:
        async with bench(Bench(modules={2: Module(ranges=[9] * 8, stubborn=True), 3: Module()})) as gonio:
            with pytest.raises(RefusedError, match="did not take type code 0x08"):
                await gonio.connect()
        async with bench(Bench(modules={2: Module(engineering=True, stubborn=True), 3: Module()})) as gonio:
            with pytest.raises(RefusedError, match="hexadecimal"):
                await gonio.connect()

    run_virtual(main())


def test_another_module_than_expected() -> None:
    async def main() -> None:
        options = GoniophotometerOptions(
            modules=(ModuleOptions(2, module_name="07082008"), ModuleOptions(3, module_name="07002001"))
        )
        async with bench(Bench(), options) as gonio:
            with pytest.raises(RefusedError, match="this is module 07082008, the station file says 07002001") as caught:
                await gonio.connect()
            assert "unit 3" in caught.value.place.port

    run_virtual(main())


# Homing


def test_homing_once_per_power_up() -> None:
    async def main() -> None:
        table = Bench(Drive(homed=False))
        async with bench(table) as gonio:
            await gonio.connect()
            with pytest.raises(RefusedError, match="not homed") as caught:
                await gonio.move_to(22.5)
            assert "home it first" in caught.value.hint
            assert writes(table) == []
            await gonio.home()
            await gonio.home()
            assert len(table.requests(SINGLE)) == 1
            assert await gonio.move_to(22.5) == 22.5

    run_virtual(main())


def test_homing_that_finds_nothing_is_stopped() -> None:
    async def main() -> None:
        table = Bench(Drive(homed=False, home_s=1e9))
        async with bench(table) as gonio:
            await gonio.connect()
            with pytest.raises(DeviceTimeout, match="no reference position"):
                await gonio.home()
            assert table.drive.stopped == 1

    run_virtual(main())


@pytest.mark.parametrize("home_s", [0.5, 10.0])
def test_a_lost_acknowledgement_of_homing(home_s: float) -> None:
    async def main() -> None:
        table = Bench(Drive(homed=False, home_s=home_s))
        table.bend = lambda request, answer: [] if is_write(request, SINGLE) else None
        async with bench(table) as gonio:
            await gonio.connect()
            await gonio.home()
        assert table.drive.homed and len(table.requests(SINGLE)) == 1

    run_virtual(main())


def test_an_alarm_while_homing() -> None:
    async def main() -> None:
        table = Bench(Drive(homed=False))
        async with bench(table) as gonio:
            await gonio.connect()
            asyncio.get_running_loop().call_later(1.0, lambda: setattr(table.drive, "alarm", 0x0F0))
            with pytest.raises(RefusedError, match="over-temperature"):
                await gonio.home()
            table.drive.homing = False
            await gonio.arm.reset_alarm()
            assert table.drive.alarm == 0

    run_virtual(main())


# Moving


def test_one_block_is_sent_once_per_plane_from_below() -> None:
    async def main() -> None:
        table = Bench()
        async with bench(table) as gonio:
            await gonio.connect()
            for k in range(1, 16):
                assert await gonio.move_to(22.5 * k) == 22.5 * k
        assert table.drive.moves == [625 * k for k in range(1, 16)]  # 22.5 degrees are exactly 625 counts

    run_virtual(main())


def test_the_bytes_of_a_move() -> None:
    async def main() -> None:
        table = Bench(Drive(origin=1000.0, target=1000))
        options = GoniophotometerOptions(arm=ArmOptions(direction=-1, speed_rpm=60, ramp_ms=100, backlash_counts=0))
        async with bench(table, options) as gonio:
            await gonio.connect()
            assert await gonio.move_to(22.5) == 22.5
        vendor = "01 10 62 00 00 08 10 00 01 FF FF FD 8F 00 3C 00 64 00 64 00 00 00 10 5A 4F"
        assert table.requests(MOVE) == [bytes.fromhex(vendor)]

    run_virtual(main())


def test_a_target_is_approached_from_below() -> None:
    async def main() -> None:
        table = Bench(Drive(origin=9375.0, target=9375))
        async with bench(table) as gonio:
            await gonio.connect()
            await gonio.move_to(0.0)
            await gonio.move_to(0.0)  # is there already
            await gonio.move_to(22.5)
        assert table.drive.moves == [-25, 0, 625]

    run_virtual(main())


def test_done_of_the_move_before_is_not_believed() -> None:
    """Right after the trigger the status still says command and path done; the arm has not moved yet."""

    async def main() -> None:
        table = Bench(Drive(lag_s=0.8))
        async with bench(table) as gonio:
            await gonio.connect()
            began = now()
            assert await gonio.move_to(90.0) == 90.0
            assert now() - began > 0.8 + 2500 / (2 * 10_000 / 60)  # the lag and 90 degrees at 2/min
            assert table.drive.position() == 2500

    run_virtual(main())


def test_a_short_move_that_is_over_before_the_first_look() -> None:
    async def main() -> None:
        table = Bench(Drive(lag_s=0.0))
        options = GoniophotometerOptions(arm=ArmOptions(speed_rpm=3000))
        async with bench(table, options) as gonio:
            await gonio.connect()
            began = now()
            assert await gonio.move_to(22.5) == 22.5
            assert now() - began < 1.0  # half a second of settling, and no waiting for a start that was missed

    run_virtual(main())


def test_settling_is_waited_for() -> None:
    async def main() -> None:
        table = Bench()
        async with bench(table, GoniophotometerOptions(arm=ArmOptions(settle_s=3.0))) as gonio:
            await gonio.connect()
            await gonio.move_to(22.5)
            assert table.asked[-1][0] - table.asked[-2][0] >= 3.0

    run_virtual(main())


def test_a_drive_that_does_not_start_is_stopped() -> None:
    async def main() -> None:
        table = Bench(Drive(deaf=True))
        async with bench(table) as gonio:
            await gonio.connect()
            with pytest.raises(DeviceTimeout, match=r"did not start to move \(status 0x0072\), after 1.0 s") as caught:
                await gonio.move_to(22.5)
            assert "stopped" in caught.value.what
        assert len(table.requests(MOVE)) == 1
        assert table.requests(SINGLE) == [bytes.fromhex("01 06 60 02 00 40 37 FA")]

    run_virtual(main())


def test_a_drive_that_never_arrives_is_stopped() -> None:
    async def main() -> None:
        table = Bench(Drive(stuck_running=True))
        async with bench(table) as gonio:
            await gonio.connect()
            with pytest.raises(DeviceTimeout, match=r"did not arrive, it is at 22\.50 degrees"):
                await gonio.move_to(22.5)
        assert table.drive.stopped == 1

    run_virtual(main())


def test_a_stop_that_nobody_hears_is_told() -> None:
    async def main() -> None:
        table = Bench(Drive(stuck_running=True))
        table.bend = lambda request, answer: [] if is_write(request, SINGLE) else None
        async with bench(table) as gonio:
            await gonio.connect()
            with pytest.raises(DeviceTimeout, match="did not arrive") as caught:
                await gonio.move_to(22.5)
            assert "emergency stop" in caught.value.hint

    run_virtual(main())


def test_an_alarm_on_the_way() -> None:
    async def main() -> None:
        table = Bench()
        async with bench(table) as gonio:
            await gonio.connect()
            asyncio.get_running_loop().call_later(2.0, lambda: setattr(table.drive, "alarm", 0x180))
            with pytest.raises(RefusedError, match="blocked or too heavy"):
                await gonio.move_to(180.0)

    run_virtual(main())


def test_a_cancelled_move_stops_the_arm() -> None:
    async def main() -> None:
        table = Bench()
        async with bench(table) as gonio:
            await gonio.connect()
            moving = asyncio.create_task(gonio.move_to(180.0))
            await asyncio.sleep(2.0)
            moving.cancel()
            with pytest.raises(asyncio.CancelledError):
                await moving
            assert table.drive.stopped == 1
            where = table.drive.position()
            assert 0 < where < 5000
            await asyncio.sleep(5.0)
            assert table.drive.position() == where

    run_virtual(main())


def test_an_arm_that_stops_short() -> None:
    async def main() -> None:
        table = Bench(Drive(stops_short=200))
        async with bench(table) as gonio:
            await gonio.connect()
            with pytest.raises(RefusedError, match=r"stopped at 15\.30 degrees instead of 22\.50") as caught:
                await gonio.move_to(22.5)
            assert "what holds it" in caught.value.hint

    run_virtual(main())


def test_a_lost_acknowledgement_of_an_obeyed_move_is_seen_not_repeated() -> None:
    async def main() -> None:
        table = Bench()
        table.bend = lambda request, answer: [] if is_write(request) else None
        async with bench(table) as gonio:
            await gonio.connect()
            assert await gonio.move_to(90.0) == 90.0
        assert table.drive.moves == [2500]

    run_virtual(main())


def test_a_lost_acknowledgement_of_a_finished_move() -> None:
    async def main() -> None:
        table = Bench()
        table.bend = lambda request, answer: [] if is_write(request) else None
        async with bench(table, GoniophotometerOptions(arm=ArmOptions(speed_rpm=600))) as gonio:
            await gonio.connect()
            assert await gonio.move_to(22.5) == 22.5
        assert table.drive.moves == [625]

    run_virtual(main())


def test_a_lost_move_is_reported_and_the_arm_stopped() -> None:
    async def main() -> None:
        table = Bench(Drive(deaf=True))
        table.bend = lambda request, answer: [] if is_write(request) else None
        async with bench(table) as gonio:
            await gonio.connect()
            with pytest.raises(DeviceTimeout, match="no answer") as caught:
                await gonio.move_to(22.5)
            assert "nobody knows whether the device obeyed" in caught.value.hint
        assert len(table.requests(MOVE)) == 1
        assert len(table.requests(SINGLE)) == 1

    run_virtual(main())


def test_a_damaged_write_is_refused_by_the_drive_and_not_repeated() -> None:
    async def main() -> None:
        table = Bench(Drive(deaf=True))
        table.bend = lambda request, answer: (
            [(0.01, bytes([1, 0x90, 8]) + crc(bytes([1, 0x90, 8])))] if is_write(request) else None
        )
        async with bench(table) as gonio:
            await gonio.connect()
            with pytest.raises(RefusedError, match="did not obey"):
                await gonio.move_to(22.5)
        assert len(table.requests(MOVE)) == 1

    run_virtual(main())


def test_a_late_status_is_not_taken_for_a_position() -> None:
    """Each poll's answer is delayed beyond its time-out now and then; the arm still arrives where it was sent."""

    async def main() -> None:
        table = Bench()
        polls = iter(range(1_000_000))

        def bend(request: bytes, answer: bytes) -> Answer | None:
            return [(1.6, answer)] if request[1] == 3 and next(polls) % 7 == 6 else None

        table.bend = bend
        async with bench(table) as gonio:
            await gonio.connect()
            for k in range(1, 5):
                assert await gonio.move_to(22.5 * k) == 22.5 * k
        assert table.drive.moves == [625, 1250, 1875, 2500]

    run_virtual(main())


@pytest.mark.parametrize("late_s", [0.1, 0.2, 0.3, 0.7, 1.7, 3.0])
def test_one_late_answer_at_any_moment_of_a_move(late_s: float) -> None:
    """Whichever answer is late: the arm is where it was sent in the end, or the error says that nobody knows."""

    async def main(at: int) -> str:
        table = Bench()
        count = 0

        def bend(request: bytes, answer: bytes) -> Answer | None:
            nonlocal count
            count += 1
            return [(late_s, answer)] if count == at else None

        async with bench(table) as gonio:
            await gonio.connect()
            table.bend = bend
            try:
                assert await gonio.move_to(22.5) == 22.5
            except DeviceTimeout as error:
                assert "nobody knows whether the device obeyed" in error.hint
                return "told"
            assert table.drive.position() == 625
            return "arrived"

    outcomes = [run_virtual(main(at)) for at in range(1, 40)]
    assert outcomes.count("told") == 0


@pytest.mark.parametrize("c_deg", [-22.5, 360.1, math.nan])
def test_angles_that_are_none(c_deg: float) -> None:
    async def main() -> None:
        async with bench(Bench()) as gonio:
            await gonio.connect()
            with pytest.raises(ConfigError, match="0 to 360"):
                await gonio.move_to(c_deg)

    run_virtual(main())


# Reading


def loaded() -> Bench:
    first = [0, 0x4000, 0x7FFF, 0x8000, 3, 0xFFFF, 3277, 0x0CCD]
    return Bench(modules={2: Module(codes=first), 3: Module(codes=[16384, 1638, 9, 9, 9, 9, 9, 9])})


def test_ten_readings_in_lux() -> None:
    async def main() -> None:
        table = loaded()
        async with bench(table) as gonio:
            await gonio.connect()
            await gonio.move_to(22.5)
            readings = await gonio.read()
        names = [f"gonio.g{g}" for g in (0, 5, 15, 25, 35, 45, 55, 65, 75, 85)]
        assert [r.channel for r in readings] == names
        g5, g85 = readings[1], readings[9]
        assert (g5.quantity, g5.unit) == (Quantity.ILLUMINANCE, Unit.LUX)
        assert g5.value == pytest.approx(0x4000 / 32767 * 10.0 * 100 / 3)
        assert g85.value == pytest.approx(1638 / 32767 * 10.0 * 100 / 3)  # the tenth head is on the second module
        assert g5.at == {"gamma_deg": 5.0, "c_deg": 22.5, "c_feedback_deg": 22.5}
        assert g5.raw == "4000"
        assert g5.flags == ()
        step_v = 10 / 32767 / math.sqrt(12)
        floor = 100 / 3 * math.hypot(0.0005, step_v)
        assert g5.uncertainty == pytest.approx(math.hypot(0.025 * (g5.value or 0), floor))
        assert readings[5].value == pytest.approx(-1 / 32767 * 10 * 100 / 3)  # noise below the dark stays
        assert readings[0].mono_ns < g85.mono_ns  # each module at its own time
        assert g5.utc_ns == START + g5.mono_ns

    run_virtual(main())


def test_saturated_converters() -> None:
    async def main() -> None:
        async with bench(loaded()) as gonio:
            await gonio.connect()
            await gonio.move_to(22.5)
            readings = await gonio.read()
        high, low = readings[2], readings[3]
        assert high.flags == (Flag.SATURATED, Flag.LOWER_BOUND)
        assert high.value == pytest.approx(1000 / 3)
        assert (low.value, low.uncertainty, low.flags, low.raw) == (None, None, (Flag.SATURATED,), "8000")
        assert not high.usable and not low.usable

    run_virtual(main())


def test_sensitivity_dark_and_range_of_each_head() -> None:
    async def main() -> None:
        heads = (replace(ten_heads()[0], lux_per_volt=2000.0, dark_v=0.001, channel=1, calibration="K-1"),)
        options = GoniophotometerOptions(modules=(ModuleOptions(2, type_code=0x0C),), heads=heads)
        table = loaded()
        async with bench(table, options) as gonio:
            await gonio.connect()
            await gonio.home()
            (reading,) = await gonio.read()
        assert table.modules[2].ranges == [0x0C] * 8
        assert reading.value == pytest.approx((0x4000 / 32767 * 0.15 - 0.001) * 2000)
        assert reading.instrument.calibration == "K-1"

    run_virtual(main())


def test_an_arm_that_is_pushed_away_is_flagged() -> None:
    async def main() -> None:
        table = loaded()
        async with bench(table) as gonio:
            await gonio.connect()
            assert Flag.MOVED in (await gonio.read())[0].flags  # it was never sent anywhere
            await gonio.move_to(22.5)
            assert Flag.MOVED not in (await gonio.read())[0].flags
            table.drive.target += 5
            table.drive.origin = table.drive.target
            assert Flag.MOVED not in (await gonio.read())[0].flags  # within the tolerance
            table.drive.target += 5
            table.drive.origin = table.drive.target
            readings = await gonio.read()
            assert all(Flag.MOVED in r.flags for r in readings)
            assert readings[0].at["c_deg"] == 22.5
            assert readings[0].at["c_feedback_deg"] == pytest.approx(22.5 + 10 * 0.036)

    run_virtual(main())


def test_a_module_that_restarts_in_mid_run() -> None:
    async def main() -> None:
        table = loaded()
        async with bench(table) as gonio:
            await gonio.connect()
            await gonio.move_to(22.5)
            await gonio.read()
            table.modules[3] = Module(ranges=[5] * 8)  # restarted, its ranges are the factory's
            with pytest.raises(RefusedError, match="restarted in the middle of the run") as caught:
                await gonio.read()
            assert "unit 3" in caught.value.place.port and "connect again" in caught.value.hint
            await gonio.connect()
            assert table.modules[3].ranges == [8] * 8
            await gonio.read()

    run_virtual(main())


def test_a_repeated_read_is_flagged() -> None:
    async def main() -> None:
        table = loaded()
        async with bench(table) as gonio:
            await gonio.connect()
            await gonio.move_to(22.5)
            broken = iter([True])
            table.bend = lambda request, answer: (
                [(0.01, answer[:-1] + b"\0")] if request[:2] == b"\x02\x04" and next(broken, False) else None
            )
            assert all(r.flags[-1:] == (Flag.RETRIED,) for r in await gonio.read())
            assert Flag.RETRIED not in (await gonio.read())[0].flags

    run_virtual(main())


def test_a_line_that_goes_bad_names_unit_and_bytes() -> None:
    async def main() -> None:
        table = loaded()
        async with bench(table) as gonio:
            await gonio.connect()
            table.bend = lambda request, answer: (
                [(0.01, answer[:-1] + bytes([answer[-1] ^ 0x10]))] if request[0] == 3 else None
            )
            with pytest.raises(ProtocolError, match="check sum") as caught:
                await gonio.read()
            assert caught.value.place.port == "/dev/ttyUSB3 unit 3"
            assert caught.value.exchange.sent.hex().startswith("030400000008")
            assert len(caught.value.exchange.received) == 21

    run_virtual(main())


def test_dark_voltages() -> None:
    async def main() -> None:
        async with bench(loaded()) as gonio:
            await gonio.connect()
            dark = await gonio.dark_voltages(3)
        assert dark[5.0] == pytest.approx(0x4000 / 32767 * 10.0)
        assert dark[35.0] == pytest.approx(3 / 32767 * 10.0)

    run_virtual(main())


def test_the_same_over_modbus_tcp() -> None:
    async def main() -> None:
        table = replace(loaded(), tcp=True)
        options = GoniophotometerOptions(line=LineOptions(framing=Framing.TCP))
        async with bench(table, options) as gonio:
            await gonio.connect()
            assert await gonio.move_to(337.5) == 337.5
            assert (await gonio.read())[9].value == pytest.approx(1638 / 32767 * 10.0 * 100 / 3)
        numbers = [int.from_bytes(request[:2], "big") for _, request in table.asked]
        assert numbers == list(range(1, len(numbers) + 1))

    run_virtual(main())


def test_a_wiring_that_cannot_be() -> None:
    heads = (HeadOptions(0.0, 2, 0), HeadOptions(5.0, 2, 0), HeadOptions(15.0, 9, 1), HeadOptions(25.0, 2, 8))
    with pytest.raises(ConfigError) as caught:
        GoniophotometerOptions(modules=(ModuleOptions(2), ModuleOptions(1)), heads=heads)
    for mistake in (
        "unit 1 is given twice",
        "no analog module with unit 9",
        "not 8",
        "gamma 5: this gamma or this channel",
    ):
        assert mistake in caught.value.message
    with pytest.raises(ConfigError, match="0x07 is no voltage range"):
        ModuleOptions(2, type_code=0x07)
    with pytest.raises(ConfigError, match="direction"):
        ArmOptions(direction=0)
    with pytest.raises(ConfigError, match="speed_rpm"):
        ArmOptions(speed_rpm=0)


def test_the_usual_wiring() -> None:
    assert [(h.gamma_deg, h.unit, h.channel) for h in ten_heads()][7:] == [(65.0, 2, 7), (75.0, 3, 0), (85.0, 3, 1)]
