"""PTP over USB by pyusb, whose calls block: each runs in a thread for a quarter of a second at most.

A wait that is cut short lets its last call end and keeps what it brought, so nothing is lost and the device has one
user at a time.
"""

import asyncio
import errno
from collections.abc import Callable
from contextlib import suppress
from functools import partial
from typing import Any, Final, TypeVar

import usb.core

from drivers.camera.containers import Container, ContainerReader, Kind, command
from drivers.camera.link import Event, Reply
from drivers.camera.usb_device import UsbCamera, UsbOptions, find_and_claim, give_back
from drivers.exchange import FrameError
from labdaq.errors import ConnectError, DeviceError, DeviceTimeout, Exchange, Place, ProtocolError

T = TypeVar("T")

_SLICE_MS: Final = 250
_WRITE_MS: Final = 5_000
_READ_SIZE: Final = 1 << 18
"""Bytes asked for at once; a multiple of every packet size."""
_IN_USE: Final = "end other programs that hold the camera (a desktop may have mounted it: `gio mount -l`)"


class UsbPtp:
    """A camera on USB.

    Parameters
    ----------
    name
        Its name in the station file.
    options
        Which one it is; by default the only camera there is.
    backend
        A pyusb backend, in place of libusb.
    """

    def __init__(self, name: str, options: UsbOptions | None = None, backend: Any = None) -> None:
        self._options = options or UsbOptions()
        self._backend = backend
        self._place = Place(name, str(self._options))
        self._opened: UsbCamera | None = None
        self._lost: UsbCamera | None = None  # failed, and not yet given back to the system
        self._bulk = ContainerReader()
        self._interrupt = ContainerReader()
        self._containers: list[Container] = []
        self._events: list[Event] = []

    @property
    def place(self) -> Place:
        """Which camera is meant, and where."""
        return self._place

    @property
    def pending(self) -> bytes:
        """Beginning of what has been received of an answer that is not complete."""
        return self._bulk.pending

    async def open(self) -> None:
        """Find the camera and claim it."""
        if self._opened is None:
            await self._give_back_lost()
            find = partial(find_and_claim, self._options, self._place, self._backend)
            self._opened = await self._in_thread(find, keep=give_back)
            self._bulk, self._interrupt = ContainerReader(), ContainerReader()
            self._containers.clear()
            self._events.clear()

    async def aclose(self) -> None:
        """Give the camera back."""
        await self._give_back_lost()
        opened, self._opened = self._opened, None
        if opened is not None:
            await self._in_thread(partial(give_back, opened))

    async def _give_back_lost(self) -> None:
        lost, self._lost = self._lost, None
        if lost is not None:
            with suppress(ConnectError):  # it may be unplugged
                await self._in_thread(partial(give_back, lost))

    async def transact(
        self, code: int, transaction: int, parameters: tuple[int, ...], data: bytes | None = None
    ) -> Reply:
        """Send a command, with data if there are any, and return its reply."""
        sent = command(code, transaction, parameters).encode()
        await self._write(sent)
        if data is not None:
            await self._write(Container(Kind.DATA, code, transaction, data).encode())
        received = b""
        while True:
            container = await self._next(sent)
            if container.transaction != transaction:
                continue  # the end of a transaction that was given up
            if container.kind is Kind.DATA:
                received = container.payload
            elif container.kind is Kind.RESPONSE:
                return Reply(container.code, container.parameters, received)

    async def next_event(self) -> Event:
        """Wait for the next event on the interrupt endpoint."""
        while not self._events:
            opened = self._have()
            size = max(64, opened.interrupt.wMaxPacketSize)
            transfer = await self._read(opened.interrupt, size)
            if transfer is not None:
                self._take_events(transfer)
        return self._events.pop(0)

    # Containers

    def _take_events(self, transfer: bytes) -> None:
        try:
            for found in self._interrupt.feed(transfer, short=True):
                self._events.append(Event(found.code, found.transaction, found.parameters))
        except FrameError as error:
            raise self._broken(error, b"", transfer) from error

    async def _next(self, sent: bytes) -> Container:
        while not self._containers:
            opened = self._have()
            transfer = await self._read(opened.bulk_in, _READ_SIZE)
            if transfer is None:
                continue
            short = len(transfer) % opened.bulk_in.wMaxPacketSize != 0 or not transfer
            try:
                self._containers += self._bulk.feed(transfer, short)
            except FrameError as error:
                raise self._broken(error, sent, transfer) from error
        return self._containers.pop(0)

    # Transfers

    async def _write(self, data: bytes) -> None:
        opened = self._have()
        await self._unstalled(opened, opened.bulk_out, lambda: opened.bulk_out.write(data, _WRITE_MS))
        if len(data) % opened.bulk_out.wMaxPacketSize == 0:  # a full last packet does not end a transfer
            await self._unstalled(opened, opened.bulk_out, lambda: opened.bulk_out.write(b"", _WRITE_MS))

    async def _read(self, endpoint: Any, size: int) -> bytes | None:
        """Return one transfer, or ``None`` when none came within the slice."""

        def read() -> bytes | None:
            try:
                return bytes(endpoint.read(size, _SLICE_MS))
            except usb.core.USBTimeoutError:
                return None

        return await self._unstalled(self._have(), endpoint, read, keep=self._keep_for(endpoint))

    def _keep_for(self, endpoint: Any) -> "Callable[[bytes | None], None]":
        """Return what saves a transfer whose reader has gone."""

        def keep(transfer: bytes | None) -> None:
            if transfer is None or self._opened is None:
                return
            try:
                if endpoint is self._opened.interrupt:
                    self._take_events(transfer)
                else:
                    short = len(transfer) % endpoint.wMaxPacketSize != 0 or not transfer
                    self._containers += self._bulk.feed(transfer, short)
            except (FrameError, ProtocolError):
                pass  # nobody waits for it; the next answer will say

        return keep

    async def _unstalled(
        self,
        opened: UsbCamera,
        endpoint: Any,
        call: "Callable[[], T]",
        keep: "Callable[[T], None] | None" = None,
    ) -> T:
        """Run a transfer; clear a stalled endpoint and try once more."""

        def run() -> T:
            try:
                return call()
            except usb.core.USBError as error:
                if error.errno != errno.EPIPE:
                    raise
                opened.device.clear_halt(endpoint.bEndpointAddress)
                return call()

        return await self._in_thread(run, keep)

    async def _in_thread(self, call: "Callable[[], T]", keep: "Callable[[T], None] | None" = None) -> T:
        """Run a blocking call in a thread; when cancelled, wait for its end first and ``keep`` its result."""
        running = asyncio.ensure_future(asyncio.to_thread(call))
        try:
            return await asyncio.shield(running)
        except asyncio.CancelledError:
            result = (await asyncio.gather(running, return_exceptions=True))[0]
            if keep is not None and not isinstance(result, BaseException):
                keep(result)
            raise
        except usb.core.USBTimeoutError as error:
            raise DeviceTimeout(
                "the camera does not take what is sent",
                place=self._place,
                exchange=Exchange(elapsed_s=_WRITE_MS / 1000),
                hint="switch the camera off and on, then connect again",
            ) from error
        except usb.core.USBError as error:
            raise self._failed(error) from error

    # Errors

    def _have(self) -> UsbCamera:
        if self._opened is None:
            raise self._cannot("the camera is not connected", "connect again")
        return self._opened

    def _failed(self, error: usb.core.USBError) -> DeviceError:
        if error.errno in {errno.EACCES, errno.EPERM}:
            return self._cannot(
                "you may not use this USB device", "add a udev rule for it, or the user to group plugdev"
            )
        if error.errno == errno.EBUSY:
            return self._cannot("another program holds the camera", _IN_USE)
        if error.errno == errno.EPIPE:
            return self._broken(FrameError("the endpoint stays stalled"), b"", b"")
        self._lost, self._opened = self._opened, None
        return self._cannot(
            f"the camera is gone ({error.strerror or error})", "check cable and power, then connect again"
        )

    def _cannot(self, what: str, hint: str) -> ConnectError:
        return ConnectError(what, place=self._place, hint=hint)

    def _broken(self, error: FrameError, sent: bytes, received: bytes) -> ProtocolError:
        return ProtocolError(
            f"this is no PTP: {error}",
            place=self._place,
            exchange=Exchange(sent, received[:256]),
            hint="switch the camera off and on, then connect again",
        )
