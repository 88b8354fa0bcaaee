"""Time, injected. Nothing outside this module asks the computer what time it is.

Two times, always both: UTC in nanoseconds for people and for the sun's position, and a monotonic count in
nanoseconds for intervals. A clock may run at a rate other than one (an emulated test at a visible, accelerated pace),
or in virtual time (see `labdaq.virtual_time`), where a test of 150 s takes milliseconds. Sleeping and time-outs are
asked of the same clock that stamps the readings, so a driver behaves alike under all of them.
"""

import asyncio
import ctypes
import functools
import time
from contextlib import AbstractAsyncContextManager
from datetime import UTC, datetime
from typing import Final, Protocol

import msgspec

from labdaq.limits import limited

NS: Final = 1_000_000_000


class ClockState(msgspec.Struct, frozen=True):
    """How far a clock can be trusted.

    Attributes
    ----------
    source
        ``system``, ``scaled`` or ``virtual``.
    synchronised
        Whether the kernel says a time server disciplines the clock.
    max_error_s, est_error_s
        The kernel's bound and estimate of the offset from UTC [s]; ``None`` where there is none.
    """

    source: str
    synchronised: bool
    max_error_s: float | None = None
    est_error_s: float | None = None


class Clock(Protocol):
    """What stamps readings, sleeps and limits waiting; durations are in this clock's own seconds."""

    def utc_ns(self) -> int:
        """UTC since 1970-01-01 [ns]."""
        ...

    def mono_ns(self) -> int:
        """Monotonic time from an arbitrary origin [ns]."""
        ...

    async def sleep(self, seconds: float) -> None:
        """Wait for ``seconds``; zero or less only lets others run."""
        ...

    def timeout(self, seconds: float) -> AbstractAsyncContextManager[None]:
        """Limit an ``async with`` block to ``seconds``; raises builtin `TimeoutError` beyond."""
        ...

    def state(self) -> ClockState:
        """Whether and how well the clock is synchronised, now."""
        ...


async def sleep_until(clock: Clock, mono_ns: int) -> int:
    """Wait for an absolute deadline; return how late we woke [ns, >= 0 up to rounding of the timer].

    An absolute grid does not drift: relative sleeps lose about a millisecond each.
    """
    await clock.sleep((mono_ns - clock.mono_ns()) / NS)
    return clock.mono_ns() - mono_ns


def utc_text(utc_ns: int) -> str:
    """Format UTC as ``2010-07-22T13:12:00.000Z``."""
    moment = datetime.fromtimestamp(utc_ns // NS, UTC)
    return f"{moment:%Y-%m-%dT%H:%M:%S}.{utc_ns % NS // 1_000_000:03d}Z"


def utc_ns_of(moment: datetime) -> int:
    """Nanoseconds since 1970 of an aware ``datetime``; raises `ValueError` for a naive one."""
    if moment.tzinfo is None:
        raise ValueError(f"{moment.isoformat()} has no time zone; write UTC, e.g. {moment.isoformat()}Z")
    since = moment - datetime(1970, 1, 1, tzinfo=UTC)
    return (since.days * 86_400 + since.seconds) * NS + since.microseconds * 1_000


class SystemClock:
    """The computer's own clocks, at their own pace."""

    def utc_ns(self) -> int:
        """UTC since 1970-01-01 [ns]."""
        return time.time_ns()

    def mono_ns(self) -> int:
        """CLOCK_MONOTONIC [ns]."""
        return time.monotonic_ns()

    async def sleep(self, seconds: float) -> None:
        """Wait for ``seconds`` of real time."""
        await asyncio.sleep(max(0.0, seconds))

    def timeout(self, seconds: float) -> AbstractAsyncContextManager[None]:
        """Limit a block to ``seconds`` of real time."""
        return limited(seconds)

    def state(self) -> ClockState:
        """Ask the kernel (adjtimex) whether the clock is disciplined."""
        return _kernel_clock_state()


class ScaledClock:
    """Real time run ``rate`` times faster from a chosen UTC: an emulated morning in a minute.

    Parameters
    ----------
    start_utc_ns
        UTC shown at the moment of construction [ns].
    rate
        Clock seconds per real second (> 0).
    """

    def __init__(self, start_utc_ns: int, rate: float = 1.0) -> None:
        if not rate > 0:
            raise ValueError(f"a clock's rate must be positive, not {rate}")
        self.rate = rate
        self._start_utc_ns = start_utc_ns
        self._origin_ns = time.monotonic_ns()

    def utc_ns(self) -> int:
        """UTC on the scaled clock [ns]."""
        return self._start_utc_ns + self.mono_ns()

    def mono_ns(self) -> int:
        """Scaled nanoseconds since construction."""
        return int((time.monotonic_ns() - self._origin_ns) * self.rate)

    async def sleep(self, seconds: float) -> None:
        """Wait for ``seconds`` of scaled time."""
        await asyncio.sleep(max(0.0, seconds / self.rate))

    def timeout(self, seconds: float) -> AbstractAsyncContextManager[None]:
        """Limit a block to ``seconds`` of scaled time."""
        return limited(seconds / self.rate)

    def state(self) -> ClockState:
        """A scaled clock is never legal time."""
        return ClockState(source="scaled", synchronised=False)


class VirtualClock:
    """The time of a `labdaq.virtual_time` event loop, which jumps to the next event instead of waiting."""

    def __init__(self, start_utc_ns: int) -> None:
        self._start_utc_ns = start_utc_ns

    def utc_ns(self) -> int:
        """UTC in virtual time [ns]."""
        return self._start_utc_ns + self.mono_ns()

    def mono_ns(self) -> int:
        """The running loop's time [ns]."""
        return round(asyncio.get_running_loop().time() * NS)

    async def sleep(self, seconds: float) -> None:
        """Let virtual time pass."""
        await asyncio.sleep(max(0.0, seconds))

    def timeout(self, seconds: float) -> AbstractAsyncContextManager[None]:
        """Limit a block to ``seconds`` of virtual time."""
        return limited(seconds)

    def state(self) -> ClockState:
        """Virtual time agrees with itself exactly, and with nothing else."""
        return ClockState(source="virtual", synchronised=False)


class _Timex(ctypes.Structure):
    """``struct timex`` of adjtimex(2), as far as it is read here."""

    _fields_ = (
        ("modes", ctypes.c_uint),
        ("offset", ctypes.c_long),
        ("freq", ctypes.c_long),
        ("maxerror", ctypes.c_long),
        ("esterror", ctypes.c_long),
        ("status", ctypes.c_int),
        ("rest", ctypes.c_byte * 256),
    )


_UNSYNCHRONISED: Final = 0x0040  # STA_UNSYNC


@functools.cache
def _libc() -> ctypes.CDLL:
    return ctypes.CDLL(None)


def _kernel_clock_state() -> ClockState:
    timex = _Timex()
    try:
        failed = _libc().adjtimex(ctypes.byref(timex)) < 0
    except (AttributeError, OSError):
        failed = True
    if failed:
        return ClockState(source="system", synchronised=False)
    return ClockState(
        source="system",
        synchronised=not timex.status & _UNSYNCHRONISED,
        max_error_s=timex.maxerror / 1e6,
        est_error_s=timex.esterror / 1e6,
    )
