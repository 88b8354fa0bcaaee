"""Run a script to its end from a program without an event loop: choose the clock, catch signals, take the tests."""

import asyncio
import contextlib
import signal
from collections.abc import Callable, Coroutine, Iterator
from pathlib import Path
from typing import Any, TypeVar

import msgspec

from labdaq.acquisition import Mount, acquire
from labdaq.clock import Clock, ScaledClock, SystemClock, VirtualClock, utc_ns_of
from labdaq.errors import ConfigError
from labdaq.headers import Order
from labdaq.station import Station
from labdaq.steps import Watch
from labdaq.stopping import Stop
from labdaq.virtual_time import run_virtual

T = TypeVar("T")
MountOn = Callable[[Station, Clock, bool], Mount]
"""Makes a `Mount` from station, clock, and whether the lines are to be of memory."""


def choose_clock(station: Station, *, virtual: bool, rate: float | None) -> Clock:
    """The clock a run lives by.

    A station of emulators has its own time, from ``[emulation] start`` on: virtual, or real at ``rate`` (by default the
    station's). Real instruments have the computer's. Raises `ConfigError` when real instruments are to run faster.
    """
    if not station.emulated and (virtual or rate not in (None, 1.0)):
        real = ", ".join(f"'{e.name}' on {e.port}" for e in station.instrument if not e.emulated)
        what = "virtual time" if virtual else "a rate"
        raise ConfigError(f"station '{station.name}': {what} is for emulated instruments, but {real} is real")
    emulation = station.emulation
    if not station.emulated or emulation is None:
        return SystemClock()
    start_ns = utc_ns_of(emulation.start) if emulation.start else SystemClock().utc_ns()
    if virtual:
        return VirtualClock(start_ns)
    return ScaledClock(start_ns, rate or emulation.rate)


def run(
    order: Order, mount_on: MountOn, *, virtual: bool = False, rate: float | None = None, watch: Watch | None = None
) -> list[Path]:
    """Take the order's tests; return the sessions' folders.

    SIGINT and SIGTERM ask to stop: steps under way may end, then the arm is parked and the session sealed; a second
    signal does not wait for the steps. Raises as `labdaq.acquisition.acquire`.
    """
    clock = choose_clock(order.station, virtual=virtual, rate=rate)

    async def main() -> list[Path]:
        stop = Stop()
        with _signals(stop):
            mount = mount_on(order.station, clock, virtual)
            return await acquire(order, mount, clock, stop, watch or _unwatched, inline=virtual)

    return run_on(clock, main())


def run_on(clock: Clock, main: Coroutine[Any, Any, T]) -> T:
    """Run ``main`` in the event loop that the clock needs."""
    return run_virtual(main) if isinstance(clock, VirtualClock) else asyncio.run(main)


def _unwatched(body: msgspec.Struct) -> None:
    """Nobody is looking."""


@contextlib.contextmanager
def _signals(stop: Stop) -> Iterator[None]:
    loop = asyncio.get_running_loop()
    caught = []
    for number in (signal.SIGINT, signal.SIGTERM):
        with contextlib.suppress(ValueError, RuntimeError, NotImplementedError):  # not in the main thread
            loop.add_signal_handler(number, stop.request, number.name)
            caught.append(number)
    try:
        yield
    finally:
        for number in caught:
            loop.remove_signal_handler(number)
