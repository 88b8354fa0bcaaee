"""Where clients reach an emulated instrument: a pty, a TCP port, or a dial-up line in memory.

An instrument gives one coroutine function, ``serve(wire)``, which talks on a wire until that ends. A port calls it for
every client (a pty has one wire for all of them) and, when closed, ends the calls and raises what went wrong in any.
"""

import asyncio
import contextlib
import logging
from collections.abc import Callable, Coroutine
from typing import Any, Protocol

from labdaq.pipe import PipeEnd, pipe
from simulators.line.pseudoterminal import PtyWire
from simulators.line.wires import PipeWire, StreamWire, Wire

_log = logging.getLogger(__name__)

Serve = Callable[[Wire], Coroutine[Any, Any, None]]


class Port(Protocol):
    """An open port."""

    endpoint: str

    async def aclose(self) -> None:
        """Close it and end all conversations; raises the first error an emulator had on it."""
        ...


class _Calls:
    """The conversations on one port."""

    def __init__(self, serve: Serve) -> None:
        self._serve = serve
        self._calls: dict[asyncio.Task[None], Wire] = {}
        self._failure: BaseException | None = None

    def begin(self, wire: Wire) -> None:
        call = asyncio.create_task(self._serve(wire))
        self._calls[call] = wire
        call.add_done_callback(self._ended)

    def _ended(self, call: asyncio.Task[None]) -> None:
        self._calls.pop(call).close()
        if not call.cancelled() and (error := call.exception()) is not None:
            _log.error("an emulated instrument broke down; its line is closed", exc_info=error)
            self._failure = self._failure or error

    async def aclose(self) -> None:
        calls = tuple(self._calls)
        for call in calls:
            call.cancel()
        await asyncio.gather(*calls, return_exceptions=True)
        if self._failure is not None:
            raise self._failure


class PtyPort:
    """A pseudo-terminal; ``endpoint`` is its path."""

    def __init__(self, serve: Serve) -> None:
        wire = PtyWire()
        self.endpoint = wire.name
        self._calls = _Calls(serve)
        self._calls.begin(wire)

    async def aclose(self) -> None:
        """Remove the pty."""
        await self._calls.aclose()


class TcpPort:
    """A listening TCP port; ``endpoint`` is ``host:port``. Make it with `open_tcp`."""

    def __init__(self, server: asyncio.Server, calls: _Calls) -> None:
        host, port = server.sockets[0].getsockname()[:2]
        self.endpoint = f"{host}:{port}"
        self._server = server
        self._calls = calls

    async def aclose(self) -> None:
        """Stop listening and hang up."""
        self._server.close()
        try:
            await self._calls.aclose()
        finally:
            with contextlib.suppress(ConnectionError):
                await self._server.wait_closed()


class MemoryPort:
    """A port in memory: every `dial` is a fresh connection, as opening a port is."""

    def __init__(self, serve: Serve, endpoint: str = "memory") -> None:
        self.endpoint = endpoint
        self._calls = _Calls(serve)

    def dial(self) -> PipeEnd:
        """Connect, and return the client's end of the new line."""
        ours, theirs = pipe()
        self._calls.begin(PipeWire(ours))
        return theirs

    async def aclose(self) -> None:
        """Hang up on everybody."""
        await self._calls.aclose()


def open_pty(serve: Serve) -> PtyPort:
    """Make a pseudo-terminal served by ``serve``."""
    return PtyPort(serve)


async def open_tcp(serve: Serve, host: str = "127.0.0.1", port: int = 0) -> TcpPort:
    """Listen on ``host``:``port`` (0: any free port) and serve every connection; raises `OSError` if it is taken."""
    calls = _Calls(serve)

    def connected(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        calls.begin(StreamWire(reader, writer))

    return TcpPort(await asyncio.start_server(connected, host, port), calls)
