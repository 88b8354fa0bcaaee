"""PTP containers on the camera's bulk and interrupt pipes (PIMA 15740, annex D).

A transfer ends with a packet shorter than the endpoint's size, of no bytes if need be; a read takes packets until its
buffer is full or such a packet ends the transfer.
"""

import struct
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

from simulators.camera.body import Camera
from simulators.camera.responder import GET_OBJECT, GET_PARTIAL, TAKES_DATA, Responder, Response

COMMAND, DATA, RESPONSE, EVENT = 1, 2, 3, 4
_HEADER: Final = struct.Struct("<IHHI")


def container(kind: int, code: int, transaction: int, payload: bytes = b"") -> bytes:
    """Header and payload."""
    return _HEADER.pack(_HEADER.size + len(payload), kind, code, transaction) + payload


@dataclass
class UsbFaults:
    """Ways for the USB side to misbehave, as real cameras have done.

    Attributes
    ----------
    unplugged
        The cable is out.
    stall_in, stall_out
        The next that many transfers on the bulk pipes stall; each needs a clear halt.
    stale_empty_packet
        An empty packet precedes the next container.
    split_header
        Data containers send their 12-byte header as a transfer of its own.
    """

    unplugged: bool = False
    stall_in: int = 0
    stall_out: int = 0
    stale_empty_packet: bool = False
    split_header: bool = False


class Pipes:
    """The camera's ends of the three pipes."""

    def __init__(self, camera: Camera, faults: UsbFaults) -> None:
        self.camera = camera
        self.halted: set[str] = set()
        self._faults = faults
        self._responder = Responder(camera)
        self._packet = camera.profile.packet
        self._incoming = bytearray()
        self._outgoing: deque[bytes] = deque()
        self._awaits_data: tuple[int, int, Sequence[int]] | None = None

    def reset(self) -> None:
        """Close the session and empty the pipes."""
        self._responder.session = 0
        self.cancel()
        self.halted.clear()

    def cancel(self) -> None:
        """Forget the operation under way."""
        self._incoming.clear()
        self._outgoing.clear()
        self._awaits_data = None

    # --- from the host ---

    def take(self, data: bytes) -> None:
        """Bytes on the bulk pipe out; obeys every container that is complete."""
        self._incoming += data
        while len(self._incoming) >= _HEADER.size:
            length, kind, code, transaction = _HEADER.unpack_from(self._incoming)
            if length < _HEADER.size:
                self._incoming.clear()
                self.halted.add("in")  # a container that lies about itself
                return
            if len(self._incoming) < length:
                return
            payload = bytes(self._incoming[_HEADER.size : length])
            del self._incoming[:length]
            self._obey(kind, code, transaction, payload)

    def _obey(self, kind: int, code: int, transaction: int, payload: bytes) -> None:
        if kind == COMMAND:
            parameters = [p for (p,) in struct.iter_unpack("<I", payload[: len(payload) // 4 * 4])]
            if code in TAKES_DATA:
                self._awaits_data = code, transaction, parameters
            else:
                self._answer(code, transaction, parameters, b"")
        elif kind == DATA and self._awaits_data is not None:
            operation, number, given = self._awaits_data
            self._awaits_data = None
            if (operation, number) == (code, transaction):
                self._answer(operation, transaction, given, payload)

    def _answer(self, operation: int, transaction: int, parameters: Sequence[int], data: bytes) -> None:
        if self.camera.faults.hang[operation] > 0:
            self.camera.faults.hang[operation] -= 1
            return
        response = self._responder.execute(operation, transaction, parameters, data)
        if response.data is not None and not self._queue_data(operation, transaction, response):
            return
        words = struct.pack(f"<{len(response.parameters)}I", *response.parameters)
        self._queue(container(RESPONSE, response.code, transaction, words))

    def _queue_data(self, operation: int, transaction: int, response: Response) -> bool:
        """The data container; false when a fault breaks it off."""
        whole = container(DATA, operation, transaction, response.data or b"")
        broken = self.camera.faults.break_transfer_after if operation in (GET_OBJECT, GET_PARTIAL) else None
        if broken is not None:
            self.camera.faults.break_transfer_after = None
            self._queue(whole[: _HEADER.size + broken])
            self._outgoing.append(b"stall")
            return False
        if self._faults.split_header:
            self._queue(whole[: _HEADER.size])
            whole = whole[_HEADER.size :]
        self._queue(whole)
        return True

    def _queue(self, transfer: bytes) -> None:
        """Cut a transfer into packets, the last shorter than the others or empty."""
        if self._faults.stale_empty_packet:
            self._faults.stale_empty_packet = False
            self._outgoing.append(b"")
        for start in range(0, len(transfer) + 1, self._packet):
            self._outgoing.append(transfer[start : start + self._packet])

    # --- to the host ---

    @property
    def has_data(self) -> bool:
        """Whether the bulk pipe in has a packet."""
        return bool(self._outgoing)

    def give(self, room: int) -> bytes:
        """The bytes of one read with a buffer of ``room``; raises `OverflowError` if a packet does not fit into it."""
        given = bytearray()
        while self._outgoing and len(given) < room:
            if self._outgoing[0] == b"stall":
                if not given:
                    self._outgoing.popleft()
                    self.halted.add("in")
                break
            if len(self._outgoing[0]) > room - len(given):
                raise OverflowError
            packet = self._outgoing.popleft()
            given += packet
            if len(packet) < self._packet:
                break
        return bytes(given)

    def event(self) -> bytes | None:
        """The next event as a container, or ``None``."""
        if not self.camera.events:
            return None
        event = self.camera.events.popleft()
        return container(EVENT, event.code, event.transaction, struct.pack("<I", event.parameter))
