"""Clock, virtual time, directions, units, pipe and distribution: what every room relies on."""

import asyncio
import time

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from analysis.photometry import Distribution
from labdaq import directions
from labdaq.clock import NS, ScaledClock, SystemClock, VirtualClock, sleep_until, utc_text
from labdaq.errors import DataError, DeviceError, DeviceTimeout, Exchange, LabdaqError, Place
from labdaq.pipe import pipe
from labdaq.units import Unit, to_lab_unit
from labdaq.virtual_time import run_virtual


def test_virtual_time_keeps_an_absolute_grid_and_does_not_wait() -> None:
    async def tick() -> list[int]:
        clock = VirtualClock(0)
        for k in range(1, 1001):
            await sleep_until(clock, k * NS // 10)
        return [clock.mono_ns(), clock.utc_ns()]

    began = time.monotonic()
    assert run_virtual(tick()) == [100 * NS, 100 * NS]
    assert time.monotonic() - began < 50  # a hundredth of it is usual; the virtual wait was 100 s


def test_timeouts_follow_the_clock_in_virtual_time() -> None:
    async def wait() -> None:
        clock = VirtualClock(0)
        async with clock.timeout(5.0):
            await clock.sleep(4.9)
        with pytest.raises(TimeoutError):
            async with clock.timeout(5.0):
                await clock.sleep(5.1)

    run_virtual(wait())


def test_scaled_clock_runs_at_its_rate() -> None:
    async def nap() -> tuple[int, float]:
        clock = ScaledClock(start_utc_ns=1_279_804_320 * NS, rate=100.0)
        began = time.monotonic()
        await clock.sleep(5.0)
        return clock.utc_ns(), time.monotonic() - began

    utc_ns, took_s = asyncio.run(nap())
    assert utc_ns >= (1_279_804_320 + 5) * NS - NS // 100
    assert took_s >= 0.049


def test_system_clock_reports_the_kernels_state() -> None:
    state = SystemClock().state()
    assert state.source == "system"
    assert state.synchronised in (True, False)


def test_utc_text_is_utc() -> None:
    assert utc_text(1_279_804_320 * NS + 5_000_000) == "2010-07-22T13:12:00.005Z"


@given(st.floats(0.01, 179.99), st.floats(0, 359.99))
def test_directions_round_trip(gamma: float, c: float) -> None:
    v = directions.vector(gamma, c)
    back_gamma, back_c = directions.gamma_c(3.0 * v)
    assert back_gamma == pytest.approx(gamma, abs=1e-9)
    assert np.cos(np.radians(back_c - c)) == pytest.approx(1.0, abs=1e-12)


def test_compass_points_are_where_the_report_has_them() -> None:
    north, west, south, east = (directions.vector(90.0, c) for c in (0, 90, 180, 270))
    assert np.allclose([north, west, south, east], [[0, 1, 0], [-1, 0, 0], [0, -1, 0], [1, 0, 0]], atol=1e-15)
    assert np.allclose(directions.sky_vector(0.0, 90.0), [1, 0, 0], atol=1e-15)  # a rising sun is in the east
    assert np.allclose(directions.vector(180.0, 123.0), [0, 0, 1], atol=1e-15)


def test_units_convert_at_the_edge() -> None:
    assert to_lab_unit(9999.0, Unit.FOOTCANDLE) == (pytest.approx(107_628.3, rel=1e-6), Unit.LUX)
    assert to_lab_unit(12.0, Unit.LUX) == (12.0, Unit.LUX)


def test_pipe_carries_both_ways_and_ends() -> None:
    async def talk() -> None:
        a, b = pipe()
        a.write(b"MES\r\n")
        assert await b.reader.readuntil(b"\r\n") == b"MES\r\n"
        b.write(b"OK00")
        b.close()
        assert await a.reader.read() == b"OK00"

    run_virtual(talk())


def test_device_errors_say_where_what_and_what_to_try() -> None:
    place = Place("roof-luminance", "/dev/ttyS0")
    error = DeviceTimeout("no answer", place=place, exchange=Exchange(b"MES\r\n", b"", 5.0), hint="hold F")
    assert isinstance(error, TimeoutError)
    assert isinstance(error, DeviceError)
    text = str(error)
    assert all(part in text for part in ("roof-luminance", "/dev/ttyS0", "MES", "5.00 s", "hold F"))


def test_the_exception_tree_stays_small_and_documented() -> None:
    import labdaq.errors as errors

    tree = [c for c in vars(errors).values() if isinstance(c, type) and issubclass(c, LabdaqError)]
    assert len(tree) <= 15
    assert all(c.__name__ in (errors.__doc__ or "") for c in tree)


def test_flux_of_a_lambertian_distribution() -> None:
    gamma = np.linspace(0, 90, 91)
    lambertian = Distribution.closed(gamma, [0.0, 90.0, 180.0, 270.0], np.tile(np.cos(np.radians(gamma)), (4, 1)))
    assert lambertian.flux() == pytest.approx(np.pi, rel=1e-4)  # piecewise linear in gamma: error below h²/12
    assert lambertian.at(60.0, 359.9) == pytest.approx(0.5, rel=1e-4)
    assert lambertian.at(95.0, 0.0) == 0.0


def test_a_distribution_refuses_nonsense() -> None:
    with pytest.raises(DataError, match="finite"):
        Distribution.closed([0.0, 90.0], [0.0, 180.0], [[1.0, np.nan], [1.0, 1.0]])
    with pytest.raises(DataError, match="increase"):
        Distribution.closed([90.0, 0.0], [0.0, 180.0], np.ones((2, 2)))
