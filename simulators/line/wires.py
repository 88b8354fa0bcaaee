"""Carriers of raw bytes: the emulator's end of a pipe or a TCP connection (a pseudo-terminal has its own module)."""

import asyncio
import contextlib
from typing import Final, Protocol

from labdaq.pipe import PipeEnd

CHUNK: Final = 65_536


class Wire(Protocol):
    """The emulator's end of something that carries bytes."""

    async def read(self) -> bytes:
        """Wait for bytes; ``b""`` when the far end is gone for good."""
        ...

    def write(self, data: bytes) -> None:
        """Send bytes; nothing happens when nobody is there to receive them."""
        ...

    def close(self) -> None:
        """Hang up; `read` ends."""
        ...


class PipeWire:
    """A wire made of memory (`labdaq.pipe`)."""

    def __init__(self, end: PipeEnd) -> None:
        self._end = end

    async def read(self) -> bytes:
        """Wait for bytes; ``b""`` when the far end was closed."""
        return await self._end.reader.read(CHUNK)

    def write(self, data: bytes) -> None:
        """Put bytes on the pipe."""
        with contextlib.suppress(ConnectionResetError):
            self._end.write(data)

    def close(self) -> None:
        """Close this end and stop reading."""
        self._end.close()
        if not self._end.reader.at_eof():
            self._end.reader.feed_eof()


class StreamWire:
    """A TCP connection."""

    def __init__(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        self._reader = reader
        self._writer = writer

    async def read(self) -> bytes:
        """Wait for bytes; ``b""`` when the peer closed or the connection broke."""
        try:
            return await self._reader.read(CHUNK)
        except (ConnectionError, TimeoutError):
            return b""

    def write(self, data: bytes) -> None:
        """Queue bytes for the peer."""
        if not self._writer.is_closing():
            self._writer.write(data)

    def close(self) -> None:
        """Close the connection."""
        self._writer.close()
        if not self._reader.at_eof():
            self._reader.feed_eof()
