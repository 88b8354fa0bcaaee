"""What carries PTP: USB or TCP. Both answer alike, so everything above them is the same code."""

from dataclasses import dataclass
from typing import Protocol

from labdaq.errors import Place


@dataclass(frozen=True, slots=True)
class Reply:
    """The end of a transaction: response code and parameters, and the data that came before it."""

    code: int
    parameters: tuple[int, ...] = ()
    data: bytes = b""


@dataclass(frozen=True, slots=True)
class Event:
    """What a camera said by itself."""

    code: int
    transaction: int
    parameters: tuple[int, ...] = ()


class Link(Protocol):
    """A camera's connection.

    Its waits have no end of their own, the caller limits them; a wait cut short loses nothing.
    """

    @property
    def place(self) -> Place:
        """Which camera is meant, and where."""
        ...

    @property
    def pending(self) -> bytes:
        """Beginning of what has been received of an answer that is not complete."""
        ...

    async def open(self) -> None:
        """Find the camera and connect; does nothing when connected. Raises `ConnectError`."""
        ...

    async def transact(
        self, code: int, transaction: int, parameters: tuple[int, ...], data: bytes | None = None
    ) -> Reply:
        """Send a command (and ``data``), return its reply; answers to other transactions are passed over.

        Raises `ConnectError` when the camera is gone, `ProtocolError` for what is no PTP.
        """
        ...

    async def next_event(self) -> Event:
        """Wait for what the camera says next. Raises as `transact`."""
        ...

    async def aclose(self) -> None:
        """Disconnect; it may be opened again."""
        ...
