"""The line between a driver and an instrument, whatever it is made of.

A driver asks for bytes by what ends them or by how many there are; where they come from (a serial port, a TCP
connection, memory) it cannot tell. Transports do not know the time: the driver limits its waiting with its own clock
(see `drivers.exchange`). A wait that is cut short loses nothing: what has come stays in the buffer.
"""

import asyncio
from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import Final, Protocol

from labdaq.errors import ConnectError, Exchange, Place, ProtocolError
from labdaq.limits import limited
from labdaq.pipe import PipeEnd

CHUNK: Final = 65_536
"""Most bytes taken from a line at once."""


class Transport(Protocol):
    """A two-way byte line to one instrument, with one owner."""

    @property
    def place(self) -> Place:
        """Which instrument is meant, and the port it is reached on."""
        ...

    @property
    def pending(self) -> bytes:
        """What has been received and not yet been asked for."""
        ...

    async def open(self) -> None:
        """Open the line; does nothing on an open one. Raises `ConnectError`."""
        ...

    async def write(self, data: bytes) -> None:
        """Send all of ``data``; raises `ConnectError` when the line is gone."""
        ...

    async def read_until(self, end: bytes, limit: int) -> bytes:
        """Return everything up to and including ``end``.

        Raises `ProtocolError` when ``limit`` bytes came without it, `ConnectError` when the line is gone.
        """
        ...

    async def read_exactly(self, count: int) -> bytes:
        """Return the next ``count`` bytes; raises `ConnectError` when the line is gone before."""
        ...

    async def read_frame(self, head: int, length_of: Callable[[bytes], int]) -> bytes:
        """Return one frame whose whole length ``length_of`` tells from its first ``head`` bytes.

        Nothing is taken from the line before all of it is there, nor when ``length_of`` raises.
        """
        ...

    async def drain_input(self) -> bytes:
        """Throw away what has been received so far, and return it."""
        ...

    async def aclose(self) -> None:
        """Close the line; it may be opened again."""
        ...


class BufferedTransport(ABC):
    """What all transports share: a buffer of received bytes and the ways to ask for them."""

    def __init__(self, place: Place) -> None:
        self._place = place
        self._buffer = bytearray()

    @property
    def place(self) -> Place:
        """Which instrument is meant, and the port it is reached on."""
        return self._place

    @property
    def pending(self) -> bytes:
        """What has been received and not yet been asked for."""
        return bytes(self._buffer)

    @abstractmethod
    async def open(self) -> None:
        """Open the line; does nothing on an open one."""

    @abstractmethod
    async def write(self, data: bytes) -> None:
        """Send all of ``data``."""

    @abstractmethod
    async def aclose(self) -> None:
        """Close the line."""

    @abstractmethod
    async def _receive(self) -> bytes:
        """Wait for at least one byte; ``b""`` when no more will come. Cancelling loses nothing."""

    @abstractmethod
    async def _receive_now(self) -> bytes:
        """Return what is there without waiting; ``b""`` when there is nothing."""

    async def read_until(self, end: bytes, limit: int) -> bytes:
        """Return everything up to and including ``end``."""
        searched = 0
        while (at := self._buffer.find(end, searched)) < 0:
            if len(self._buffer) >= limit:
                received = bytes(self._buffer)
                self._buffer.clear()
                raise ProtocolError(
                    f"{len(received)} bytes came without the end of an answer ({end!r})",
                    place=self._place,
                    exchange=Exchange(received=received),
                    hint="check that no other instrument or program is on this line, and its serial settings",
                )
            searched = max(0, len(self._buffer) - len(end) + 1)
            await self._more()
        return self._take(at + len(end))

    async def read_exactly(self, count: int) -> bytes:
        """Return the next ``count`` bytes."""
        while len(self._buffer) < count:
            await self._more()
        return self._take(count)

    async def read_frame(self, head: int, length_of: Callable[[bytes], int]) -> bytes:
        """Return one frame whose whole length ``length_of`` tells from its first ``head`` bytes."""
        while len(self._buffer) < head:
            await self._more()
        return await self.read_exactly(length_of(bytes(self._buffer[:head])))

    async def drain_input(self) -> bytes:
        """Throw away what has been received so far, and return it."""
        while chunk := await self._receive_now():
            self._buffer += chunk
        return self._take(len(self._buffer))

    async def _more(self) -> None:
        chunk = await self._receive()
        if not chunk:
            raise self._gone()
        self._buffer += chunk

    def _release(self) -> None:  # noqa: B027, most have nothing to do
        """Let go of a line that is gone, so that `open` can have it again."""

    def _take(self, count: int) -> bytes:
        taken = bytes(self._buffer[:count])
        del self._buffer[:count]
        return taken

    def _gone(self, why: str = "the far end closed the line") -> ConnectError:
        self._release()
        return ConnectError(
            why,
            place=self._place,
            exchange=Exchange(received=bytes(self._buffer)),
            hint="check cable and power, then connect again",
        )


class PipeTransport(BufferedTransport):
    """A driver's end of an in-memory line (see `labdaq.pipe`)."""

    def __init__(self, instrument: str, end: PipeEnd, port: str = "memory") -> None:
        super().__init__(Place(instrument, port))
        self._end = end

    async def open(self) -> None:
        """Do nothing: the line exists."""

    async def write(self, data: bytes) -> None:
        """Put ``data`` on the line."""
        try:
            self._end.write(data)
        except ConnectionResetError as error:
            raise self._gone(str(error)) from None

    async def aclose(self) -> None:
        """Let the far end read to the end, then nothing."""
        self._end.close()

    async def _receive(self) -> bytes:
        return await self._end.reader.read(CHUNK)

    async def _receive_now(self) -> bytes:
        if self._end.reader.at_eof():
            return b""
        try:
            async with limited(0.0):  # no waiting, so no clock is asked
                return await self._end.reader.read(CHUNK)
        except TimeoutError:
            return b""


class DescriptorTransport(BufferedTransport):
    """A line behind a file descriptor that the event loop watches."""

    @abstractmethod
    def _descriptor(self) -> int:
        """Return the open descriptor; raises `ConnectError` when there is none."""

    @abstractmethod
    def _read_now(self) -> bytes:
        """Read without waiting; raises `BlockingIOError` when there is nothing, other `OSError` when it is gone."""

    @abstractmethod
    def _write_now(self, data: bytes) -> int:
        """Write what fits without waiting and return how much that was; raises as `_read_now`."""

    async def write(self, data: bytes) -> None:
        """Send all of ``data``, waiting while the line is full."""
        rest = memoryview(data)
        while rest:
            descriptor = self._descriptor()
            try:
                rest = rest[self._write_now(bytes(rest[:CHUNK])) :]
            except BlockingIOError:
                await _ready(descriptor, writing=True)
            except OSError as error:
                raise self._gone(f"cannot write: {error.strerror or error}") from error

    async def _receive(self) -> bytes:
        # First wait, then read: were the bytes read by a callback, a time-out in the same turn of the loop would lose
        # them.
        while True:
            await _ready(self._descriptor(), writing=False)
            try:
                return self._read_now()
            except BlockingIOError:
                continue
            except OSError as error:
                raise self._gone(f"cannot read: {error.strerror or error}") from error

    async def _receive_now(self) -> bytes:
        self._descriptor()
        try:
            return self._read_now()
        except OSError:  # nothing there, or gone: the next real read will say which
            return b""


async def _ready(descriptor: int, *, writing: bool) -> None:
    loop = asyncio.get_running_loop()
    woken: asyncio.Future[None] = loop.create_future()
    add, remove = (loop.add_writer, loop.remove_writer) if writing else (loop.add_reader, loop.remove_reader)
    add(descriptor, _wake, woken)
    try:
        await woken
    finally:
        remove(descriptor)


def _wake(woken: "asyncio.Future[None]") -> None:
    if not woken.done():
        woken.set_result(None)
