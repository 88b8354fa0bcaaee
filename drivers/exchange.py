"""Waiting for an answer, and telling when a measurement was made."""

from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from dataclasses import dataclass
from typing import Protocol

from labdaq.clock import NS, Clock
from labdaq.errors import ConnectError, DeviceError, DeviceTimeout, Exchange, Place


class FrameError(ValueError):
    """Bytes that break a protocol. Codecs raise it, drivers turn it into an error that names the instrument."""


class Waited(Protocol):
    """What an answer may be waited for on: a transport, or a camera's link."""

    @property
    def place(self) -> Place:
        """Which instrument is meant, and where."""
        ...

    @property
    def pending(self) -> bytes:
        """What has come of an answer that is not complete."""
        ...


@asynccontextmanager
async def answer_within(seconds: float, line: Waited, clock: Clock, sent: bytes, hint: str = "") -> AsyncIterator[None]:
    """Limit a block that waits for the answer to ``sent``.

    Raises `DeviceTimeout` with what had come by then. An error of the line itself, which does not know the question, is
    raised again with it.
    """
    began_ns = clock.mono_ns()
    try:
        async with clock.timeout(seconds):
            yield
    except (TimeoutError, DeviceError) as error:
        elapsed_s = (clock.mono_ns() - began_ns) / NS
        if not isinstance(error, DeviceError):
            received = line.pending
            what = "the answer broke off, nothing more" if received else "no answer"
            exchange = Exchange(sent, received, elapsed_s)
            raise DeviceTimeout(
                f"{what} within {seconds:g} s", place=line.place, exchange=exchange, hint=hint
            ) from None
        if error.exchange.sent:
            raise
        exchange = Exchange(sent, error.exchange.received, elapsed_s)
        raise type(error)(error.what, place=error.place, exchange=exchange, hint=error.hint) from error


class Openable(Protocol):
    """What can be opened: a transport, or a camera's link."""

    @property
    def place(self) -> Place:
        """Which instrument is meant, and where."""
        ...

    async def open(self) -> None:
        """Open it."""
        ...


async def open_within(seconds: float, line: Openable, clock: Clock) -> None:
    """Open a line; raises `ConnectError`, also when it takes longer than ``seconds``."""
    try:
        async with clock.timeout(seconds):
            await line.open()
    except TimeoutError:
        raise ConnectError(
            f"the line did not open within {seconds:g} s",
            place=line.place,
            hint="check that the instrument is switched on and the host and port in the station file",
        ) from None


@dataclass(frozen=True, slots=True)
class Span:
    """When a measurement was made: its middle on both clocks [ns], and its length [s]."""

    utc_ns: int
    mono_ns: int
    duration_s: float


def span(clock: Clock, began_ns: int, ended_ns: int) -> Span:
    """Return the `Span` between two moments of the clock's monotonic time [ns]."""
    middle_ns = (began_ns + ended_ns) // 2
    return Span(clock.utc_ns() - (clock.mono_ns() - middle_ns), middle_ns, (ended_ns - began_ns) / NS)
