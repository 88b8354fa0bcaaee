"""A pyusb backend with the emulated camera plugged in: ``usb.core.find(backend=EmulatedUsb(camera))``.

pyusb asks a backend by duck typing. Not emulated: isochronous transfers, alternate settings, power management.
"""

import errno
import struct
import threading
from array import array
from collections.abc import Callable, Iterator
from types import SimpleNamespace
from typing import Any, Final

import usb.core

from simulators.camera.body import Camera
from simulators.camera.datasets import MANUFACTURER
from simulators.camera.usb_descriptors import (
    BULK_IN,
    BULK_OUT,
    INTERRUPT_IN,
    configuration_descriptor,
    device_descriptor,
    endpoint_descriptor,
    interface_descriptor,
)
from simulators.camera.usb_pipes import Pipes, UsbFaults

_STEP_S: Final = 0.002
_GET_DESCRIPTOR, _STRING = 0x06, 0x03
_CANCEL, _RESET, _STATUS = 0x64, 0x66, 0x67


class EmulatedUsb:
    """One camera on one bus.

    Parameters
    ----------
    camera
        What is plugged in.
    serial
        Its serial number string.
    blocking
        Whether a read waits for its time-out when there is nothing yet. In virtual time it must not: there reads are
        made from the event loop, which would stand still, so they time out at once and the caller waits on its clock.
    """

    def __init__(self, camera: Camera, *, serial: str = "000003004711", blocking: bool = True) -> None:
        self.camera = camera
        self.faults = UsbFaults()
        self._pipes = Pipes(camera, self.faults)
        self._device = SimpleNamespace(descriptor=device_descriptor(camera.profile, bus=1, address=7))
        self._strings = ("", MANUFACTURER, camera.profile.model, serial)
        self._blocking = blocking
        self._configuration = 1  # Linux configures a device before programs see it
        self._lock = threading.RLock()
        self._pause = threading.Event()  # never set: waiting on it is the wait

    # --- finding and opening ---

    def enumerate_devices(self) -> Iterator[SimpleNamespace]:
        """The camera, unless it is unplugged."""
        if not self.faults.unplugged:
            yield self._device

    def get_parent(self, dev: Any) -> None:
        """Plugged into the root hub."""
        return

    def get_device_descriptor(self, dev: Any) -> SimpleNamespace:
        """What the device is."""
        descriptor: SimpleNamespace = self._device.descriptor
        return descriptor

    def get_configuration_descriptor(self, dev: Any, config: int) -> SimpleNamespace:
        """The only configuration; raises `IndexError` for others."""
        _only_first(config)
        return configuration_descriptor()

    def get_interface_descriptor(self, dev: Any, intf: int, alt: int, config: int) -> SimpleNamespace:
        """The only interface; raises `IndexError` for others."""
        _only_first(intf, alt, config)
        return interface_descriptor()

    def get_endpoint_descriptor(self, dev: Any, ep: int, intf: int, alt: int, config: int) -> SimpleNamespace:
        """The three endpoints; raises `IndexError` for others."""
        _only_first(intf, alt, config)
        return endpoint_descriptor(ep, self.camera.profile.packet)

    def open_device(self, dev: Any) -> SimpleNamespace:
        """Open; raises `usb.core.USBError` when unplugged."""
        self._plugged()
        return self._device

    def close_device(self, dev_handle: Any) -> None:
        """Close; the PTP session stays as it is."""

    def set_configuration(self, dev_handle: Any, config_value: int) -> None:
        """Configure."""
        self._plugged()
        self._configuration = config_value

    def get_configuration(self, dev_handle: Any) -> int:
        """The configuration in force."""
        return self._configuration

    def set_interface_altsetting(self, dev_handle: Any, intf: int, altsetting: int) -> None:
        """There is one only."""

    def claim_interface(self, dev_handle: Any, intf: int) -> None:
        """Always free."""
        self._plugged()

    def release_interface(self, dev_handle: Any, intf: int) -> None:
        """Free again."""

    def reset_device(self, dev_handle: Any) -> None:
        """Reset the bus: the session is gone."""
        self._plugged()
        self._pipes.reset()

    def clear_halt(self, dev_handle: Any, ep: int) -> None:
        """End a stall."""
        self._plugged()
        self._pipes.halted.discard("in" if ep & 0x80 else "out")

    def is_kernel_driver_active(self, dev_handle: Any, intf: int) -> bool:
        """No kernel driver wants cameras."""
        return False

    def detach_kernel_driver(self, dev_handle: Any, intf: int) -> None:
        """There is none."""

    def attach_kernel_driver(self, dev_handle: Any, intf: int) -> None:
        """There is none."""

    # --- transfers ---

    def bulk_write(self, dev_handle: Any, ep: int, intf: int, data: Any, timeout: int) -> int:
        """Send to the camera; returns how many bytes went."""
        self._plugged()
        if ep != BULK_OUT:
            raise usb.core.USBError("no such endpoint", -5, errno.ENOENT)
        if self.faults.stall_out > 0:
            self.faults.stall_out -= 1
            self._pipes.halted.add("out")
        self._not_halted("out")
        self.camera.advance()
        with self._lock:
            self._pipes.take(bytes(data))
        return len(data)

    def bulk_read(self, dev_handle: Any, ep: int, intf: int, buff: "array[int]", timeout: int) -> int:
        """Fill ``buff`` from the camera; returns how many bytes came, fewer when a transfer ended."""
        if ep != BULK_IN:
            raise usb.core.USBError("no such endpoint", -5, errno.ENOENT)
        if self.faults.stall_in > 0:
            self.faults.stall_in -= 1
            self._pipes.halted.add("in")
        self._wait_for(lambda: self._pipes.has_data or "in" in self._pipes.halted, timeout)
        self._not_halted("in")
        try:
            with self._lock:
                data = self._pipes.give(len(buff) * buff.itemsize)
        except OverflowError:
            raise usb.core.USBError("Overflow", -8, errno.EOVERFLOW) from None
        self._not_halted("in")
        buff[: len(data)] = array("B", data)
        return len(data)

    def intr_read(self, dev_handle: Any, ep: int, intf: int, buff: "array[int]", timeout: int) -> int:
        """Read one event."""
        if ep != INTERRUPT_IN:
            raise usb.core.USBError("no such endpoint", -5, errno.ENOENT)
        self._wait_for(lambda: bool(self.camera.events), timeout)
        with self._lock:
            data = self._pipes.event() or b""
        data = data[: len(buff) * buff.itemsize]
        buff[: len(data)] = array("B", data)
        return len(data)

    def intr_write(self, dev_handle: Any, ep: int, intf: int, data: Any, timeout: int) -> int:
        """The camera has no such endpoint; raises `NotImplementedError`."""
        raise NotImplementedError

    iso_read = iso_write = intr_write  # pyusb looks all of them up before it uses one

    def ctrl_transfer(
        self,
        dev_handle: Any,
        bmRequestType: int,
        bRequest: int,
        wValue: int,
        wIndex: int,
        data: "array[int]",
        timeout: int,
    ) -> int:
        """Standard and still-image class requests; fills ``data`` in place for reads and returns the count."""
        self._plugged()
        match bmRequestType, bRequest:
            case 0x80, 0x06 if wValue >> 8 == _STRING:
                answer = self._string(wValue & 0xFF)
            case 0xA1, 0x67:
                answer = struct.pack("<HH", 4, 0x2019 if self.camera.busy else 0x2001)
            case 0x21, 0x64:
                self._pipes.cancel()
                return len(data)
            case 0x21, 0x66:
                self._pipes.reset()
                return len(data)
            case _:
                raise usb.core.USBError("the device does not know this request", -9, errno.EPIPE)
        answer = answer[: len(data) * data.itemsize]
        data[: len(answer)] = array("B", answer)
        return len(answer)

    def _string(self, index: int) -> bytes:
        if index >= len(self._strings):
            raise usb.core.USBError("no such string", -9, errno.EPIPE)
        content = struct.pack("<H", 0x0409) if index == 0 else self._strings[index].encode("utf-16-le")
        return bytes([len(content) + 2, _STRING]) + content

    def _plugged(self) -> None:
        if self.faults.unplugged:
            raise usb.core.USBError("No such device (it may have been disconnected)", -4, errno.ENODEV)

    def _not_halted(self, direction: str) -> None:
        if direction in self._pipes.halted:
            raise usb.core.USBError("Pipe error", -9, errno.EPIPE)

    def _wait_for(self, condition: Callable[[], bool], timeout_ms: int) -> None:
        """Wait until ``condition``; raises `usb.core.USBTimeoutError`. A time-out of 0 is endless."""
        waited_s = 0.0
        while True:
            self._plugged()
            self.camera.advance()
            if condition():
                return
            if not self._blocking or (timeout_ms and waited_s * 1000.0 >= timeout_ms):
                raise usb.core.USBTimeoutError("Operation timed out", -7, errno.ETIMEDOUT)
            self._pause.wait(_STEP_S)
            waited_s += _STEP_S


def _only_first(*indices: int) -> None:
    """Raise `IndexError` unless all are 0: that is how pyusb finds the end of a list."""
    if any(indices):
        raise IndexError(indices)
