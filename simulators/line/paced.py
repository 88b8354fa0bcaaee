"""A serial line at its true pace, between an instrument and whatever carries its bytes.

Bytes a client wrote reach the instrument when they would have arrived, and a reply reaches the client no sooner than
its bytes could have been sent. Even with pacing off a reply is never instant: clients throw away what they have
received right after writing a command, and lose a reply that was already there.
"""

import asyncio
import contextlib
from collections.abc import Awaitable, Callable
from dataclasses import dataclass
from typing import Final

from labdaq.clock import NS, Clock, sleep_until
from simulators.line.faults import FaultBox
from simulators.line.wires import Wire

PIECE_S: Final = 0.005
"""Replies are handed over in pieces of about this much line time [s]: fine enough for readers with short gaps
between bytes, coarse enough to cost nothing."""

LEAST_DELAY_S: Final = 0.002
"""An instrument's reply never begins sooner than this after the command [s]."""


@dataclass(frozen=True, slots=True)
class SerialFormat:
    """How a character looks on a serial line.

    Attributes
    ----------
    baud
        Bits per second.
    data_bits
        7 or 8; with 7 the eighth bit of received bytes is masked off, it is parity seen by an 8N1 sender.
    parity
        ``N``, ``E`` or ``O``.
    stop_bits
        1 or 2.
    """

    baud: int
    data_bits: int = 8
    parity: str = "N"
    stop_bits: int = 1

    @property
    def character_s(self) -> float:
        """Time of one character on the line [s], start bit included."""
        return (1 + self.data_bits + (self.parity != "N") + self.stop_bits) / self.baud

    @property
    def mask(self) -> int:
        """Which bits of a received byte are data."""
        return (1 << self.data_bits) - 1


class Line:
    """An instrument's end of a serial line.

    Parameters
    ----------
    wire
        What carries the bytes.
    clock
        Time of the line; its seconds may be faster than real ones.
    style
        Character format, which gives the pace.
    faults
        Faults in force.
    pacing
        Whether bytes take their time; without it only `LEAST_DELAY_S` passes.
    """

    def __init__(
        self, wire: Wire, clock: Clock, style: SerialFormat, faults: FaultBox | None = None, *, pacing: bool = True
    ) -> None:
        self._wire = wire
        self._clock = clock
        self._style = style
        self._faults = faults or FaultBox()
        self._character_s = style.character_s if pacing else 0.0
        self._received = bytearray()
        self._news = asyncio.Event()
        self._ended = False
        self._sending = asyncio.Lock()

    async def converse(self, conversation: Callable[["Line"], Awaitable[None]]) -> None:
        """Run ``conversation`` on this line until it returns or the line ends for good."""
        pump = asyncio.create_task(self._pump())
        try:
            await conversation(self)
        finally:
            pump.cancel()
            with contextlib.suppress(asyncio.CancelledError):
                await pump
            self._wire.close()

    async def receive(self) -> bytes:
        """Wait for what arrived since the last call; ``b""`` once the line has ended."""
        while not self._received:
            if self._ended:
                return b""
            self._news.clear()
            await self._news.wait()
        data = bytes(self._received)
        self._received.clear()
        return data

    def discard(self) -> None:
        """Forget what has arrived: the instrument was not listening."""
        self._received.clear()

    async def send(self, frame: bytes, delay_s: float = 0.0) -> None:
        """Send a reply that is ready after ``delay_s``, at the line's pace and with its faults."""
        async with self._sending:
            mangled = self._faults.mangle(frame)
            await self._clock.sleep(max(LEAST_DELAY_S, delay_s) + mangled.late_s)
            begun = self._clock.mono_ns()
            size = max(1, int(PIECE_S / self._character_s)) if self._character_s else len(frame) + 1
            for start in range(0, len(mangled.data), size):
                piece = mangled.data[start : start + size]
                if self._character_s:
                    await sleep_until(self._clock, begun + self._wire_ns(start + len(piece)))
                self._wire.write(piece)
            if mangled.disconnect:
                self._wire.close()

    def _wire_ns(self, characters: int) -> int:
        return round(characters * self._character_s * NS)

    async def _pump(self) -> None:
        """Move bytes from the wire to the instrument, each chunk when its last byte would have arrived."""
        free_ns = self._clock.mono_ns()
        try:
            while data := await self._wire.read():
                free_ns = max(free_ns, self._clock.mono_ns()) + self._wire_ns(len(data))
                if self._character_s:
                    await sleep_until(self._clock, free_ns)
                if self._faults.echo:
                    self._wire.write(data)
                self._received += bytes(byte & self._style.mask for byte in data)
                self._news.set()
        finally:
            self._ended = True
            self._news.set()
