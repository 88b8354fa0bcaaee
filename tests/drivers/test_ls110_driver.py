"""The LS-110's driver over a line on which a script plays the meter, in virtual time."""

import asyncio
import math

import pytest
from far_end import Step, far_end, now, on

from drivers.ls110 import LINE, LuminanceMeter, LuminanceMeterOptions
from drivers.transport import PipeTransport
from labdaq.clock import VirtualClock
from labdaq.errors import ConnectError, DeviceTimeout, ProtocolError, RefusedError
from labdaq.pipe import PipeEnd
from labdaq.reading import Flag
from labdaq.units import Quantity, Unit
from labdaq.virtual_time import run_virtual

START = 1_279_804_320_000_000_000
MES, DSR, CLE = b"MES\r\n", b"DSR\r\n", b"CLE\r\n"
OK = b"OK00\r\n"
GREETING = [on(b"MDS,04\r\n", OK), on(b"MDS,09\r\n", OK), on(b"MDS,00\r\n", OK)]


def meter(end: PipeEnd, options: LuminanceMeterOptions | None = None) -> LuminanceMeter:
    line = PipeTransport("roof-luminance", end, "/dev/ttyUSB0")
    return LuminanceMeter("roof-luminance", line, VirtualClock(START), options)


def test_the_settings_of_the_line() -> None:
    assert str(LINE) == "4800 7E2"
    assert LINE.character_s == 11 / 4800  # 11 bit times a character


def test_connect_and_read() -> None:
    async def main() -> None:
        options = LuminanceMeterOptions(channel="sky.zenith", serial="79513021", calibration="K-2010-17")
        async with far_end(*GREETING, on(MES, b"OK00,CcPH 125.3\r\n", after=0.9)) as (end, _):
            driver = meter(end, options)
            await driver.connect()
            began = now()
            reading = await driver.read()
        assert reading.channel == "sky.zenith"
        assert reading.quantity is Quantity.LUMINANCE
        assert (reading.value, reading.unit, reading.flags) == (125.3, Unit.CANDELA_PER_M2, ())
        assert reading.uncertainty == pytest.approx((0.02 * 125.3 + 0.1) / math.sqrt(3))
        assert reading.mono_ns == round((began + 0.45) * 1e9)
        assert reading.utc_ns == START + reading.mono_ns
        assert reading.duration_s == pytest.approx(0.9)
        assert bytes.fromhex(reading.raw) == b"OK00,CcPH 125.3\r\n"
        assert reading.clock.source == "virtual"
        who = reading.instrument
        assert (who.name, who.model, who.serial) == ("roof-luminance", "LS-110", "79513021")
        assert (who.port, who.calibration) == ("/dev/ttyUSB0", "K-2010-17")
        assert reading.usable

    run_virtual(main())


@pytest.mark.parametrize(
    ("record", "value", "uncertainty"),
    [
        (b"CfPH125.35", 125.35 * 3.4262590996, (0.02 * 429.4816 + 0.1 * 3.42626) / math.sqrt(3)),  # fL
        (b"CcPH  0.01", 0.01, (0.02 * 0.01 + 2 * 0.01) / math.sqrt(3)),  # below 10 cd/m2: two digits
        (b"CcPH299900", 299_900.0, (0.02 * 299_900 + 100) / math.sqrt(3)),  # six columns, no blank
    ],
)
def test_values(record: bytes, value: float, uncertainty: float) -> None:
    async def main() -> None:
        async with far_end(*GREETING, on(MES, b"OK00," + record + b"\r\n")) as (end, _):
            driver = meter(end)
            await driver.connect()
            reading = await driver.read()
        assert reading.value == pytest.approx(value, rel=1e-9)
        assert reading.unit is Unit.CANDELA_PER_M2
        assert reading.uncertainty == pytest.approx(uncertainty, rel=1e-5)  # the expected numbers have six digits

    run_virtual(main())


def test_an_ls100_counts_two_digits_only_below_one() -> None:
    async def main() -> None:
        async with far_end(*GREETING, on(MES, b"OK00,CcPH 5.000\r\n")) as (end, _):
            driver = meter(end, LuminanceMeterOptions(model="LS-100"))
            await driver.connect()
            reading = await driver.read()
        assert reading.uncertainty == pytest.approx((0.02 * 5 + 0.001) / math.sqrt(3))

    run_virtual(main())


@pytest.mark.parametrize("code", [b"ER10", b"ER19"])
def test_over_range_is_a_reading_without_a_value(code: bytes) -> None:
    async def main() -> None:
        async with far_end(*GREETING, on(MES, code + b"\r\n")) as (end, _):
            driver = meter(end)
            await driver.connect()
            reading = await driver.read()
        assert (reading.value, reading.uncertainty, reading.flags) == (None, None, (Flag.OVER_RANGE,))
        assert not reading.usable
        assert bytes.fromhex(reading.raw) == code + b"\r\n"

    run_virtual(main())


@pytest.mark.parametrize(
    ("code", "says", "tries"),
    [
        ("ER01", "setting error", "hold F"),
        ("ER11", "correction factor", "MDS,00"),
        ("ER20", "EEPROM", "repair"),
        ("ER30", "battery", "new battery"),
        ("ER77", "does not know", "manual"),
    ],
)
def test_error_codes_say_what_to_try(code: str, says: str, tries: str) -> None:
    async def main() -> None:
        async with far_end(*GREETING, on(MES, code.encode() + b"\r\n")) as (end, _):
            driver = meter(end)
            await driver.connect()
            with pytest.raises(RefusedError) as caught:
                await driver.read()
        error = caught.value
        assert f"{code}: " in error.message and says in error.message
        assert tries in error.hint
        assert str(error.place) == "roof-luminance on /dev/ttyUSB0"
        assert (error.exchange.sent, error.exchange.received) == (MES, code.encode() + b"\r\n")

    run_virtual(main())


def test_er00_is_asked_once_more() -> None:
    async def main() -> None:
        steps = [on(MES, b"ER00\r\n"), on(MES, b"OK00,CcPH 125.3\r\n"), on(MES, b"ER00\r\n"), on(MES, b"ER00\r\n")]
        async with far_end(*GREETING, *steps) as (end, _):
            driver = meter(end)
            await driver.connect()
            reading = await driver.read()
            assert (reading.value, reading.flags) == (125.3, (Flag.RETRIED,))
            with pytest.raises(RefusedError, match="ER00") as caught:
                await driver.read()
            assert "4800 7E2" in caught.value.hint

    run_virtual(main())


@pytest.mark.parametrize(
    ("record", "says"),
    [
        (b"C% H 83.02", "percent"),
        (b"PcPH 125.3", "peak"),
        (b"CcLH 125.3", "user's calibration"),
        (b"CcKH 125.3", "user's calibration"),
        (b"CcPM 125.3", "printer"),
    ],
)
def test_a_meter_in_another_mode_is_noticed_at_each_reading(record: bytes, says: str) -> None:
    async def main() -> None:
        async with far_end(*GREETING, on(MES, b"OK00," + record + b"\r\n")) as (end, _):
            driver = meter(end)
            await driver.connect()
            with pytest.raises(ProtocolError, match=says) as caught:
                await driver.read()
            assert "connect again" in caught.value.hint
            assert record in caught.value.exchange.received

    run_virtual(main())


def test_a_users_calibration_may_be_wanted() -> None:
    async def main() -> None:
        options = LuminanceMeterOptions(factory_calibration=False, response="slow")
        steps = [on(b"MDS,04\r\n", OK), on(b"MDS,09\r\n", OK), on(b"MDS,07\r\n", OK), on(MES, b"OK00,CcKH 125.3\r\n")]
        async with far_end(*steps) as (end, _):
            driver = meter(end, options)
            await driver.connect()
            assert (await driver.read()).value == 125.3

    run_virtual(main())


def test_held_value_is_stale_and_memory_can_be_cleared() -> None:
    async def main() -> None:
        async with far_end(*GREETING, on(DSR, b"OK00,CcPH 125.3\r\n"), on(CLE, OK)) as (end, _):
            driver = meter(end)
            await driver.connect()
            assert (await driver.held()).flags == (Flag.STALE,)
            await driver.clear_memory()

    run_virtual(main())


def test_nobody_answers_at_connecting() -> None:
    async def main() -> None:
        async with far_end(Step(b"MDS,04\r\n")) as (end, _):
            began = now()
            with pytest.raises(ConnectError, match="does not answer") as caught:
                await meter(end).connect()
            assert now() - began == pytest.approx(5.0)
        assert "hold F" in caught.value.hint
        assert caught.value.exchange.sent == b"MDS,04\r\n"
        assert caught.value.exchange.elapsed_s == pytest.approx(5.0)

    run_virtual(main())


def test_a_truncated_answer_is_shown_in_the_error() -> None:
    async def main() -> None:
        async with far_end(*GREETING, on(MES, b"OK00,CcPH 12")) as (end, _):
            driver = meter(end)
            await driver.connect()
            with pytest.raises(DeviceTimeout, match="broke off") as caught:
                await driver.read()
            assert isinstance(caught.value, TimeoutError)
            assert caught.value.exchange.received == b"OK00,CcPH 12"
            assert caught.value.exchange.elapsed_s == pytest.approx(5.0)

    run_virtual(main())


def test_a_late_answer_is_flushed_before_the_next_question() -> None:
    async def main() -> None:
        steps = [Step(MES, [(5.5, b"OK00,CcPH 111.1\r\n")]), on(MES, b"OK00,CcPH 222.2\r\n", after=1.0)]
        async with far_end(*GREETING, *steps) as (end, _):
            driver = meter(end)
            await driver.connect()
            with pytest.raises(DeviceTimeout, match="no answer within 5 s"):
                await driver.read()
            await asyncio.sleep(1.0)
            assert (await driver.read()).value == 222.2

    run_virtual(main())


def test_a_reading_given_up_is_waited_for_before_the_next_question() -> None:
    """The meter accepts nothing while it measures, and its answer belongs to the question that was given up."""

    async def main() -> None:
        steps = [on(MES, b"OK00,CcPH 111.1\r\n", after=1.2), on(MES, b"OK00,CcPH 222.2\r\n", after=0.9)]
        async with far_end(*GREETING, *steps) as (end, player):
            driver = meter(end)
            await driver.connect()
            given_up = asyncio.create_task(driver.read())
            began = now()
            await asyncio.sleep(0.3)
            given_up.cancel()
            await asyncio.gather(given_up, return_exceptions=True)
            assert (await driver.read()).value == 222.2
        asked = [when - began for when, what in player.heard if what == MES]
        assert asked[1] >= 1.2

    run_virtual(main())


@pytest.mark.parametrize(
    ("answer", "says"),
    [
        (b"MES\r\n", "gives back what is sent"),
        (b"OK00\r\n", "acknowledgement"),
        (b"OK00,CcPH 1\x00.53\r\n", "not a reply"),
        (b"\xcf\x4b\x30\x30\r\n", "not a reply"),
        (b"\xff" * 18, "18 bytes came without the end"),
    ],
)
def test_a_void_answer_names_place_bytes_and_cure(answer: bytes, says: str) -> None:
    async def main() -> None:
        async with far_end(*GREETING, on(MES, answer)) as (end, _):
            driver = meter(end)
            await driver.connect()
            with pytest.raises(ProtocolError, match=says) as caught:
                await driver.read()
        assert (caught.value.exchange.sent, caught.value.exchange.received) == (MES, answer)
        assert "roof-luminance on /dev/ttyUSB0" in str(caught.value)
        assert caught.value.hint

    run_virtual(main())


def test_the_line_breaks() -> None:
    async def main() -> None:
        async with far_end(*GREETING, Step(MES, [(0.3, b"OK0")], hang_up=True)) as (end, _):
            driver = meter(end)
            await driver.connect()
            with pytest.raises(ConnectError, match="closed the line") as caught:
                await driver.read()
            assert (caught.value.exchange.sent, caught.value.exchange.received) == (MES, b"OK0")
            with pytest.raises(ConnectError):
                await driver.read()
            await driver.aclose()

    run_virtual(main())


def test_an_error_code_to_a_mode_ends_connecting() -> None:
    async def main() -> None:
        async with far_end(on(b"MDS,04\r\n", b"ER30\r\n")) as (end, _):
            with pytest.raises(RefusedError, match="battery"):
                await meter(end).connect()

    run_virtual(main())
