"""Worlds simple enough to know the answer, and clients that speak bytes by hand."""

import asyncio
from collections.abc import Awaitable, Callable, Coroutine
from datetime import UTC, datetime
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from labdaq import directions
from labdaq.clock import VirtualClock, utc_ns_of
from labdaq.pipe import PipeEnd
from labdaq.virtual_time import run_virtual
from simulators.line import MemoryPort, Wire
from simulators.world.observed import SunSeen

Floats = NDArray[np.float64]
T = TypeVar("T")

MORNING_NS = utc_ns_of(datetime(2010, 7, 22, 13, 12, tzinfo=UTC))  # the report's test 18


class UniformWorld:
    """A sky of one luminance, a sun where it is put, and a Lambertian skylight of 1000 cd downwards; all adjustable."""

    def __init__(self, sky: float = 3000.0, beam: float = 0.0, altitude: float = 45.0, azimuth: float = 120.0) -> None:
        self.sky = sky
        self.beam = beam
        self.altitude = altitude
        self.azimuth = azimuth
        self.candela = 1000.0

    def sun(self, utc_ns: int) -> SunSeen:
        return SunSeen(self.altitude, self.azimuth, self.beam)

    def sky_luminance(self, towards: Floats, utc_ns: int) -> Floats:
        return np.where(np.asarray(towards)[..., 2] > 0, self.sky, 0.0)

    def roof_illuminance(self, normal: Floats, utc_ns: int, shaded_half_angle_deg: float = 0.0) -> float:
        """A tilted plane sees (1 + cos tilt) / 2 of a uniform sky; a cap of half angle a holds π L sin²a cos θ."""
        sun = directions.sky_vector(self.altitude, self.azimuth)
        incidence = max(0.0, float(np.asarray(normal) @ sun))
        sky = np.pi * self.sky * (1.0 + float(normal[2])) / 2.0
        if shaded_half_angle_deg > 0:
            return sky - np.pi * self.sky * np.sin(np.radians(shaded_half_angle_deg)) ** 2 * incidence
        return sky + self.beam * incidence

    def room_illuminance(self, gamma_deg: Floats, c_deg: float, utc_ns: int) -> Floats:
        """Lambertian along gamma, and a cosine along C so that the arm's place can be read off."""
        lambertian = self.candela * np.cos(np.radians(gamma_deg))
        return lambertian * (1.0 + 0.5 * np.cos(np.radians(c_deg))) / 2.6**2


def in_virtual_time(main: Callable[[VirtualClock], Coroutine[Any, Any, T]]) -> T:
    """Run ``main(clock)`` in virtual time on the morning of test 18."""

    async def run() -> T:
        return await main(VirtualClock(MORNING_NS))

    return run_virtual(run())


async def on_memory(serve: Callable[[Wire], Coroutine[Any, Any, None]], talk: Callable[[PipeEnd], Awaitable[T]]) -> T:
    """Run ``talk`` on a fresh in-memory line to an emulator, and see that the emulator survived it."""
    port = MemoryPort(serve)
    try:
        return await talk(port.dial())
    finally:
        await port.aclose()


async def silence(end: PipeEnd, clock: VirtualClock, seconds: float) -> bool:
    """Whether nothing arrives for that long."""
    try:
        async with clock.timeout(seconds):
            return await end.reader.read(1) == b"never"
    except TimeoutError:
        return True


async def in_thread(function: Callable[[], T]) -> T:
    """Run a blocking third-party client beside the emulator's event loop."""
    return await asyncio.to_thread(function)
