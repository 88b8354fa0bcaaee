"""A line over TCP: Modbus TCP, PTP/IP, or a serial device server."""

import asyncio
import socket
from typing import Any

from drivers.transport import CHUNK, DescriptorTransport
from labdaq.errors import ConnectError, Place


class TcpTransport(DescriptorTransport):
    """A TCP connection to ``host``:``port``.

    Small packets are sent at once (no Nagle delay): a question and its answer are all there is on these lines.
    """

    def __init__(self, instrument: str, host: str, port: int) -> None:
        super().__init__(Place(instrument, f"{host}:{port}"))
        self._address = (host, port)
        self._socket: socket.socket | None = None

    async def open(self) -> None:
        """Connect; raises `ConnectError` when nobody listens there."""
        if self._socket is not None:
            return
        loop = asyncio.get_running_loop()
        host, port = self._address
        try:
            found = await loop.getaddrinfo(host, port, type=socket.SOCK_STREAM)
            self._socket = await _first_that_answers(found)
        except OSError as error:
            raise ConnectError(
                f"cannot connect: {error.strerror or error}",
                place=self.place,
                hint="check that the instrument is switched on and the host and port in the station file",
            ) from error
        self._buffer.clear()

    async def aclose(self) -> None:
        """Close the connection."""
        self._release()

    def _descriptor(self) -> int:
        return self._open_socket().fileno()

    def _read_now(self) -> bytes:
        return self._open_socket().recv(CHUNK)

    def _write_now(self, data: bytes) -> int:
        return self._open_socket().send(data)

    def _release(self) -> None:
        if self._socket is not None:
            self._socket.close()
            self._socket = None

    def _open_socket(self) -> socket.socket:
        if self._socket is None:
            raise self._gone("the connection is not open")
        return self._socket


async def _first_that_answers(found: list[tuple[Any, ...]]) -> socket.socket:
    """Try one address after the other (a name may stand for several); raises the last `OSError`."""
    loop = asyncio.get_running_loop()
    refused: OSError = OSError("the name stands for no address")
    for family, kind, protocol, _, address in found:
        made = socket.socket(family, kind, protocol)
        try:
            made.setblocking(False)
            await loop.sock_connect(made, address)
            made.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            return made
        except OSError as error:
            made.close()
            refused = error
        except BaseException:
            made.close()
            raise
    raise refused
