"""A line made of memory: what one end writes the other end reads, without a port in between.

Tests and virtual time use it in place of a serial line or a TCP connection; both ends look alike, so a driver may
sit on one and an emulator on the other.
"""

import asyncio


class PipeEnd:
    """One end of an in-memory byte line."""

    def __init__(self) -> None:
        self.reader = asyncio.StreamReader()
        self._far: PipeEnd | None = None

    def write(self, data: bytes) -> None:
        """Put ``data`` on the line; raises `ConnectionResetError` when either end was closed."""
        if self._far is None:
            raise ConnectionResetError("the line is closed")
        self._far.reader.feed_data(data)

    def close(self) -> None:
        """Let the far end read to the end of what was written, then nothing."""
        far, self._far = self._far, None
        if far is not None:
            far._far = None
            far.reader.feed_eof()


def pipe() -> tuple[PipeEnd, PipeEnd]:
    """Make a line and return its two ends; must be called inside a running event loop."""
    a, b = PipeEnd(), PipeEnd()
    a._far, b._far = b, a
    return a, b
