"""Containers in which PTP travels over USB, as values, and back. No waiting, no clock."""

import struct
from dataclasses import dataclass
from enum import IntEnum
from typing import Final

from drivers.exchange import FrameError

_HEADER: Final = struct.Struct("<IHHI")
UNKNOWN_LENGTH: Final = 0xFFFF_FFFF
"""Length of a data container whose sender does not know it; it ends with a short packet."""
LONGEST: Final = 1 << 30
"""No picture is longer; a larger length is nonsense."""


class Kind(IntEnum):
    """What a container carries."""

    COMMAND = 1
    DATA = 2
    RESPONSE = 3
    EVENT = 4


@dataclass(frozen=True, slots=True)
class Container:
    """One container.

    Attributes
    ----------
    kind
        Command, data, response or event.
    code
        Operation (also of data), response or event code.
    transaction
        Number of the transaction it belongs to.
    payload
        Parameters (32 bits each) or data.
    """

    kind: Kind
    code: int
    transaction: int
    payload: bytes = b""

    @property
    def parameters(self) -> tuple[int, ...]:
        """The payload as 32-bit numbers; an odd rest is left off."""
        count = len(self.payload) // 4
        return struct.unpack_from(f"<{count}I", self.payload)

    def encode(self) -> bytes:
        """Encode with its true length."""
        length = _HEADER.size + len(self.payload)
        return _HEADER.pack(length, self.kind, self.code, self.transaction) + self.payload


def command(code: int, transaction: int, parameters: tuple[int, ...] = ()) -> Container:
    """Make a command; all parameters are sent, since some cameras insist on zeros too."""
    return Container(Kind.COMMAND, code, transaction, struct.pack(f"<{len(parameters)}I", *parameters))


class ContainerReader:
    """Puts containers together from USB transfers, however these are cut.

    A header may come alone, a zero-length packet may stand before a container, a response may follow its data in the
    same transfer.
    """

    def __init__(self) -> None:
        self._buffer = bytearray()

    @property
    def pending(self) -> bytes:
        """Bytes of a container that is not complete; not more than 256 of them."""
        return bytes(self._buffer[:256])

    def feed(self, transfer: bytes, short: bool) -> list[Container]:
        """Take one transfer; return the containers that it completes.

        ``short`` tells that it ended with a short (or empty) packet. Raises `FrameError` and forgets everything when
        a header makes no sense.
        """
        tail = self._unmeasured_tail(transfer)
        if tail is not None:
            return [tail, *self.feed(transfer, short)]
        self._buffer += transfer
        found = []
        while len(self._buffer) >= _HEADER.size:
            length, kind, code, transaction = _HEADER.unpack_from(self._buffer)
            if length == UNKNOWN_LENGTH and kind == Kind.DATA:
                if not short:
                    break
                length = len(self._buffer)
            elif not _HEADER.size <= length <= LONGEST or kind not in set(Kind):
                received = self.pending
                self._buffer.clear()
                raise FrameError(f"no container begins with {received[:12].hex(' ')}")
            if len(self._buffer) < length:
                break
            found.append(Container(Kind(kind), code, transaction, bytes(self._buffer[_HEADER.size : length])))
            del self._buffer[:length]
        return found

    def _unmeasured_tail(self, transfer: bytes) -> Container | None:
        """Return data of unknown length if ``transfer`` is the response to it (its last packet was a full one)."""
        if len(self._buffer) < _HEADER.size or len(transfer) < _HEADER.size:
            return None
        length, kind, code, transaction = _HEADER.unpack_from(self._buffer)
        if length != UNKNOWN_LENGTH or kind != Kind.DATA:
            return None
        if _HEADER.unpack_from(transfer)[:2] != (len(transfer), Kind.RESPONSE) or (
            _HEADER.unpack_from(transfer)[3] != transaction
        ):
            return None
        data = bytes(self._buffer[_HEADER.size :])
        self._buffer.clear()
        return Container(Kind.DATA, code, transaction, data)
