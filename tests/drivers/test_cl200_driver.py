"""The CL-200's driver over a line on which a script plays the meter, in virtual time."""

import math
from collections.abc import Sequence

import pytest
from far_end import Step, far_end, now, on

from drivers.cl200 import ChromaMeter, ChromaMeterOptions, Head
from drivers.cl200.codec import Command, check_sum
from drivers.transport import PipeTransport
from labdaq.clock import VirtualClock
from labdaq.errors import ConfigError, ConnectError, DeviceTimeout, ProtocolError, RefusedError
from labdaq.pipe import PipeEnd
from labdaq.reading import Flag, Reading
from labdaq.units import Quantity, Unit
from labdaq.virtual_time import run_virtual

START = 1_279_804_320_000_000_000
WIRE_S = 14 * 10 / 9600  # a short frame at 9600 7E1


def framed(body: str) -> bytes:
    inner = body.encode() + b"\x03"
    return b"\x02" + inner + check_sum(inner) + b"\r\n"


CONNECT = on(framed("00541   "), framed("0054    "))
HOLD = Step(framed("99551  0"))
TRIGGER = Step(framed("994021  "))
SOUND = "00021 20+32543+38560+40400"


def set_external(head: int = 0, status: str = "    ") -> Step:
    return on(framed(f"{head:02d}4010  "), framed(f"{head:02d}40{status}"))


def read(reply: str = SOUND, command: str = "02", head: int = 0) -> Step:
    return on(framed(f"{head:02d}{command}1200"), framed(reply))


GREETING = [CONNECT, HOLD, set_external()]


def meter(end: PipeEnd, options: ChromaMeterOptions | None = None) -> ChromaMeter:
    line = PipeTransport("roof-global", end, "/dev/ttyUSB1")
    return ChromaMeter("roof-global", line, VirtualClock(START), options)


def measured(steps: Sequence[Step], options: ChromaMeterOptions | None = None) -> list[Reading]:
    async def main() -> list[Reading]:
        async with far_end(*GREETING, *steps) as (end, _):
            driver = meter(end, options)
            await driver.connect()
            return await driver.measure()

    return run_virtual(main())


def test_one_measurement() -> None:
    options = ChromaMeterOptions(heads=(Head(0, "sky.global", "H-7", "K-2010-18"),), serial="B-3")
    lux, x, y = measured([TRIGGER, read()], options)
    assert (lux.channel, x.channel, y.channel) == ("sky.global", "sky.global.x", "sky.global.y")
    assert (lux.value, lux.unit, lux.quantity) == (325.4, Unit.LUX, Quantity.ILLUMINANCE)
    assert (x.value, y.value) == (0.3856, 0.404)
    assert (x.quantity, y.quantity) == (Quantity.CHROMATICITY_X, Quantity.CHROMATICITY_Y)
    assert lux.uncertainty == pytest.approx((0.02 * 325.4 + 0.1) / math.sqrt(3))
    assert x.uncertainty == y.uncertainty == pytest.approx(0.002 / math.sqrt(3))
    assert bytes.fromhex(lux.raw) == framed(SOUND)
    assert lux.flags == x.flags == y.flags == ()
    who = lux.instrument
    assert (who.name, who.model, who.serial, who.calibration) == ("roof-global", "CL-200A", "B-3/H-7", "K-2010-18")


def test_the_makers_waiting_times() -> None:
    async def main() -> None:
        async with far_end(*GREETING, TRIGGER, read()) as (end, player):
            driver = meter(end)
            await driver.connect()
            lux = (await driver.measure())[0]
        connect, hold, external, trigger, reading = (when for when, _ in player.heard)
        assert hold - connect >= 0.5 + 0.02  # the reply took 20 ms
        assert external - hold >= 0.5 + WIRE_S
        assert trigger - external >= 0.5 + 0.02
        assert reading - trigger >= 0.5 + WIRE_S
        assert lux.mono_ns == round((trigger + 0.25) * 1e9)
        assert (lux.utc_ns, lux.duration_s) == (START + lux.mono_ns, 0.5)

    run_virtual(main())


def test_several_heads_measure_at_one_trigger() -> None:
    async def main() -> None:
        heads = (Head(0, "sky.global"), Head(8, "sky.diffuse"), Head(29, "room"))
        steps = [
            *[CONNECT, HOLD, set_external(0), set_external(8), set_external(29), TRIGGER],
            read("00021 20+32543+38560+40400", head=0),
            read("08021 10+ 2733+45450+44990", head=8),
            read("29021 30+12344+31270+32900", head=29),
        ]
        async with far_end(*steps) as (end, _):
            driver = meter(end, ChromaMeterOptions(heads=heads))
            await driver.connect()
            readings = await driver.measure()
        lux = {r.channel: r.value for r in readings if r.quantity is Quantity.ILLUMINANCE}
        assert lux == {"sky.global": 325.4, "sky.diffuse": 27.3, "room": 1234.0}
        assert len({r.mono_ns for r in readings}) == 1

    run_virtual(main())


def test_colour_temperature_when_asked() -> None:
    options = ChromaMeterOptions(colour_temperature=True)
    *_, tcp = measured([TRIGGER, read(), read("00081 20+32543+40514+01080", "08")], options)
    assert (tcp.channel, tcp.value, tcp.unit) == ("illuminance.tcp", 4051.0, Unit.KELVIN)
    assert tcp.uncertainty is None
    *_, tcp = measured([TRIGGER, read(), read("00081720+32543            ", "08")], options)
    assert (tcp.value, tcp.flags) == (None, (Flag.MISSING,))


@pytest.mark.parametrize("status", ["1 60", "1 00", "1560", "1660"])
def test_a_range_change_is_triggered_again(status: str) -> None:
    poor = f"0002{status}+99995+38560+40400"
    lux, *_ = measured([TRIGGER, read(poor), TRIGGER, read(poor), TRIGGER, read()])
    assert (lux.value, lux.flags) == (325.4, ())


@pytest.mark.parametrize(("status", "flag"), [("1 60", Flag.OVER_RANGE), ("1 00", Flag.MISSING)])
def test_at_most_three_more_triggers(status: str, flag: Flag) -> None:
    poor = f"0002{status}+32543+38560+40400"  # a well-formed number that must be thrown away
    readings = measured([TRIGGER, read(poor)] * 4)
    assert [r.value for r in readings] == [None] * 3
    assert all(flag in r.flags and not r.usable for r in readings)


def test_one_head_that_changes_its_range_makes_all_measure_again() -> None:
    async def main() -> None:
        heads = (Head(0, "a"), Head(1, "b"))
        steps = [
            *[CONNECT, HOLD, set_external(0), set_external(1)],
            *[TRIGGER, read("00021 20+10003+38560+40400"), read("01021 60+99995+38560+40400", head=1)],
            *[TRIGGER, read("00021 20+20003+38560+40400"), read("01021 30+30003+38560+40400", head=1)],
        ]
        async with far_end(*steps) as (end, _):
            driver = meter(end, ChromaMeterOptions(heads=heads))
            await driver.connect()
            readings = await driver.measure()
        assert [r.value for r in readings if r.quantity is Quantity.ILLUMINANCE] == [200.0, 300.0]

    run_virtual(main())


def test_a_low_battery_voids_everything() -> None:
    for status in ("1 21", "1561"):
        readings = measured([TRIGGER, read(f"0002{status}+32543+38560+40400")])
        assert [r.value for r in readings] == [None] * 3
        assert all(r.flags == (Flag.LOW_BATTERY,) for r in readings)


def test_too_bright() -> None:
    for data in ("+99995+38560+40400", "                  ", "??????????????????"):  # nobody knows what it sends
        readings = measured([TRIGGER, read(f"00021540{data}")])
        assert [r.value for r in readings] == [None] * 3
        assert all(r.flags == (Flag.OVER_RANGE,) for r in readings)


def test_low_light_spoils_the_colour_only() -> None:
    lux, x, y = measured([TRIGGER, read("00021610+  213+38560+40400")])
    assert (lux.value, lux.flags) == (2.1, ())
    assert lux.uncertainty is not None
    assert (x.value, x.flags, x.uncertainty) == (0.3856, (Flag.LOW_LIGHT,), None)
    assert y.flags == (Flag.LOW_LIGHT,)


@pytest.mark.parametrize("error", ["4", "7"])
def test_errors_that_say_nothing_about_illuminance(error: str) -> None:
    lux, x, _ = measured([TRIGGER, read(f"00021{error}20+32543+38560+40400")])
    assert (lux.value, lux.flags, x.flags) == (325.4, (), ())


def test_blank_blocks_are_missing_values() -> None:
    lux, x, y = measured([TRIGGER, read("00021 20+32543            ")])
    assert lux.value == 325.4
    assert (x.value, x.flags, y.value, y.flags) == (None, (Flag.MISSING,), None, (Flag.MISSING,))


@pytest.mark.parametrize(
    ("error", "says", "tries"), [("1", "lost its power", "off and on"), ("2", "memory", "service")]
)
def test_a_broken_head_is_refused(error: str, says: str, tries: str) -> None:
    with pytest.raises(RefusedError, match=says) as caught:
        measured([TRIGGER, read(f"00021{error}20+32543+38560+40400")])
    assert tries in caught.value.hint
    assert "head 00" in caught.value.what
    assert caught.value.exchange.sent == framed("00021200")
    assert b"00021" in caught.value.exchange.received
    assert str(caught.value.place) == "roof-global on /dev/ttyUSB1"


def test_a_broken_head_that_hides_behind_its_range() -> None:
    with pytest.raises(RefusedError, match="lost its power"):
        measured([TRIGGER, read("00021100+32543+38560+40400")] * 4)


def test_a_void_answer_is_read_again_but_never_triggered_again() -> None:
    damaged = framed(SOUND).replace(b"+32543", b"+32544")  # its check sum no longer fits
    again = on(framed("00021200"), damaged)
    lux, *_ = measured([TRIGGER, again, read()])
    assert (lux.value, lux.flags) == (325.4, (Flag.RETRIED,))
    with pytest.raises(ProtocolError, match="check sum") as caught:
        measured([TRIGGER, again, again, again])
    assert caught.value.exchange.received == damaged
    assert "9600 7E1" in caught.value.hint


def test_a_missing_answer_is_asked_for_again() -> None:
    lux, *_ = measured([TRIGGER, Step(framed("00021200")), read()])
    assert (lux.value, lux.flags) == (325.4, (Flag.RETRIED,))
    with pytest.raises(DeviceTimeout, match="no answer within 2 s") as caught:
        measured([TRIGGER, *[Step(framed("00021200"))] * 3])
    assert caught.value.exchange.sent == framed("00021200")


def test_a_truncated_answer_is_asked_for_again() -> None:
    lux, *_ = measured([TRIGGER, on(framed("00021200"), framed(SOUND)[:20]), read()])
    assert (lux.value, lux.flags) == (325.4, (Flag.RETRIED,))


def test_after_too_many_faults_the_meter_is_started_anew() -> None:
    async def main() -> None:
        silent = [Step(framed("00021200"))] * 3
        async with far_end(*GREETING, TRIGGER, *silent, *GREETING, TRIGGER, read()) as (end, _):
            driver = meter(end)
            await driver.connect()
            with pytest.raises(DeviceTimeout):
                await driver.measure()
            assert (await driver.measure())[0].value == 325.4

    run_virtual(main())


def test_noise_before_a_frame_is_dropped() -> None:
    lux, *_ = measured([TRIGGER, on(framed("00021200"), b"\x00\x7f\x02garbage" + framed(SOUND))])
    assert (lux.value, lux.flags) == (325.4, ())


def test_a_late_answer_of_another_head_is_passed_over() -> None:
    late = framed("01021 10+ 2733+45450+44990")
    lux, *_ = measured([TRIGGER, on(framed("00021200"), late, framed(SOUND))])
    assert lux.value == 325.4


def test_a_late_answer_to_an_earlier_measurement_is_flushed() -> None:
    async def main() -> None:
        late = Step(framed("00021200"), [(7.0, framed("00021 20+11113+38560+40400"))])

        async with far_end(*GREETING, TRIGGER, late, *GREETING, TRIGGER, read()) as (end, _):
            driver = meter(end, ChromaMeterOptions(resends=0))
            await driver.connect()
            with pytest.raises(DeviceTimeout):
                await driver.measure()
            await VirtualClock(0).sleep(6.0)
            assert (await driver.measure())[0].value == 325.4

    run_virtual(main())


def test_what_comes_before_the_question_is_no_answer_to_it() -> None:
    early = Step(framed("994021  "), [(0.3, framed("00021 20+11113+38560+40400"))])
    lux, *_ = measured([early, read()])
    assert lux.value == 325.4


def test_an_echoing_line_is_named() -> None:
    echo = on(framed("00541   "), framed("00541   "))

    async def main() -> None:
        async with far_end(echo, echo, echo) as (end, _):
            with pytest.raises(ProtocolError, match="gives back what is sent"):
                await meter(end).connect()

    run_virtual(main())


def test_setting_a_head_that_is_not_in_hold() -> None:
    async def main() -> None:
        cured = [CONNECT, HOLD, set_external(status=" 4  "), HOLD, set_external(), TRIGGER, read()]
        async with far_end(*cured) as (end, _):
            driver = meter(end)
            await driver.connect()
            assert (await driver.measure())[0].value == 325.4
        async with far_end(CONNECT, HOLD, set_external(status=" 4  "), HOLD, set_external(status=" 4  ")) as (end, _):
            with pytest.raises(RefusedError, match="not in hold") as caught:
                await meter(end).connect()
            assert "CAL" in caught.value.hint

    run_virtual(main())


@pytest.mark.parametrize("old", ["5", "6", "7"])
def test_setting_a_head_may_tell_of_an_old_measurement(old: str) -> None:
    async def main() -> None:
        async with far_end(CONNECT, HOLD, set_external(status=f" {old}  "), TRIGGER, read()) as (end, _):
            driver = meter(end)
            await driver.connect()
            assert (await driver.measure())[0].value == 325.4

    run_virtual(main())


def test_a_head_without_power_at_connecting() -> None:
    async def main() -> None:
        async with far_end(CONNECT, HOLD, set_external(status=" 1  ")) as (end, _):
            with pytest.raises(RefusedError, match="lost its power"):
                await meter(end).connect()

    run_virtual(main())


def test_nobody_answers_at_connecting() -> None:
    async def main() -> None:
        async with far_end(*[Step(framed("00541   "))] * 3) as (end, _):
            with pytest.raises(ConnectError, match="does not answer") as caught:
                await meter(end).connect()
            assert now() == pytest.approx(6.0)
        assert "CAL" in caught.value.hint and "9600 7E1" in caught.value.hint
        assert caught.value.exchange.sent == framed("00541   ")

    run_virtual(main())


def test_a_head_that_is_not_there() -> None:
    async def main() -> None:
        absent = [Step(framed("054010  "))] * 3
        async with far_end(CONNECT, HOLD, *absent) as (end, _):
            with pytest.raises(ConnectError, match="one of its heads"):
                await meter(end, ChromaMeterOptions(heads=(Head(5),))).connect()

    run_virtual(main())


def test_the_line_breaks_while_measuring() -> None:
    async def main() -> None:
        async with far_end(*GREETING, Step(framed("994021  "), hang_up=True)) as (end, _):
            driver = meter(end)
            await driver.connect()
            with pytest.raises(ConnectError, match="closed"):
                await driver.measure()

    run_virtual(main())


def test_other_terms_of_the_last_measurement() -> None:
    async def main() -> None:
        steps = [
            read("00011 20+31063+32543+16953", "01"),
            read("00031 20+32543+21800+51380", "03"),
            read("00081720+32543garbage_data", "08"),
            read("00031 60+32543+21800+51380", "03"),
        ]
        async with far_end(*GREETING, TRIGGER, read(), *steps) as (end, _):
            driver = meter(end)
            await driver.connect()
            await driver.measure()
            xyz = (await driver.read_last(Command.XYZ))[0]
            assert [n and n.value for n in xyz] == [310.6, 325.4, 169.5]
            uv = (await driver.read_last(Command.EV_UV))[0]
            assert [n and n.value for n in uv] == [325.4, 0.218, 0.5138]
            tcp = (await driver.read_last(Command.EV_TCP_DUV))[0]
            assert tcp[0] is not None and tcp[0].value == 325.4 and tcp[1:] == (None, None)
            assert (await driver.read_last(Command.EV_UV))[0] == (None, None, None)

    run_virtual(main())


def test_heads_that_cannot_be() -> None:
    with pytest.raises(ConfigError) as caught:
        ChromaMeterOptions(heads=(Head(1), Head(1), Head(30)))
    assert "number 1 is given twice" in caught.value.message
    assert "number 30" in caught.value.message
    with pytest.raises(ConfigError, match="at least one"):
        ChromaMeterOptions(heads=())
