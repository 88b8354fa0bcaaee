"""A pseudo-terminal that serial clients can open, close and open again.

What was measured on Linux and is arranged for here: a fresh pty echoes and maps CR and LF, so the slave is made raw
before a client can open it; a master whose slave nobody holds reads EIO, so one slave descriptor stays open; the
kernel drops 7-bit and parity settings on ptys, and glibc then refuses a client's ``tcsetattr`` that changes nothing
else (EINVAL), so a keeper sets the slave to an odd speed whenever a client has set its own, and the client's next call
always changes something.
"""

import asyncio
import contextlib
import os
import termios
import threading
import tty
from typing import Final

from simulators.line.wires import CHUNK

ODD_SPEED: Final = termios.B50
"""No instrument here runs at 50 baud, so any client's setting differs from it."""

_ISPEED, _OSPEED = 4, 5  # positions in the list of tcgetattr


class _SpeedKeeper:
    """One thread that sets every open pty back to the odd speed within about a millisecond of a client's opening it.

    A thread, because a client may close and re-open while the event loop is busy with something else. It waits on an
    event, not on a clock: the period needs no precision.
    """

    def __init__(self) -> None:
        self._masters: set[int] = set()
        self._lock = threading.Lock()
        self._thread: threading.Thread | None = None
        self._stop = threading.Event()

    def add(self, master: int) -> None:
        with self._lock:
            self._masters.add(master)
            if self._thread is None:
                self._stop = threading.Event()
                self._thread = threading.Thread(target=self._keep, args=(self._stop,), daemon=True, name="pty-speed")
                self._thread.start()

    def remove(self, master: int) -> None:
        with self._lock:
            self._masters.discard(master)
            if self._masters:
                return
            thread, self._thread = self._thread, None
            self._stop.set()
        if thread is not None:
            thread.join()

    def _keep(self, stop: threading.Event) -> None:
        while not stop.wait(0.001):
            with self._lock:
                for master in self._masters:
                    make_speed_odd(master)


_keeper: Final = _SpeedKeeper()


def make_speed_odd(master: int) -> None:
    """Give the pty the odd speed if it has another; a setting on the master's descriptor acts on the slave."""
    with contextlib.suppress(termios.error):
        settings = termios.tcgetattr(master)
        if settings[_OSPEED] != ODD_SPEED:
            settings[_ISPEED] = settings[_OSPEED] = ODD_SPEED
            termios.tcsetattr(master, termios.TCSANOW, settings)


class PtyWire:
    """The master side of a pty; ``name`` is the port a client opens. Must be made inside a running event loop."""

    def __init__(self) -> None:
        self._master, self._slave = os.openpty()
        tty.setraw(self._slave)
        make_speed_odd(self._master)
        os.set_blocking(self._master, False)
        self.name = os.ttyname(self._slave)
        self._reader = asyncio.StreamReader()
        self._loop = asyncio.get_running_loop()
        self._loop.add_reader(self._master, self._readable)
        self._open = True
        _keeper.add(self._master)

    def _readable(self) -> None:
        with contextlib.suppress(BlockingIOError):
            self._reader.feed_data(os.read(self._master, CHUNK))

    async def read(self) -> bytes:
        """Wait for bytes of whichever client has the port open; ``b""`` after `close`."""
        return await self._reader.read(CHUNK)

    def write(self, data: bytes) -> None:
        """Send bytes; like a UART, what finds no room because nobody reads is lost."""
        if self._open:
            with contextlib.suppress(BlockingIOError):
                os.write(self._master, data)

    def close(self) -> None:
        """Remove the port; a client that holds it reads end of file or an error."""
        if self._open:
            self._open = False
            _keeper.remove(self._master)
            self._loop.remove_reader(self._master)
            os.close(self._slave)
            os.close(self._master)
            self._reader.feed_eof()
