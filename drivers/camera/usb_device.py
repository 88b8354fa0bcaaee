"""Finding a camera on USB and claiming it. These calls block."""

from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from typing import Any, Final

import usb.core
import usb.util

from labdaq.errors import ConnectError, Place

_STILL_IMAGE: Final = (6, 1, 1)
"""Class, subclass and protocol of a PTP interface."""


@dataclass(frozen=True, slots=True)
class UsbOptions:
    """Which camera is meant, if there are several.

    Attributes
    ----------
    vendor_id, product_id
        As `lsusb` shows them, e.g. 0x04B0 and 0x010D for a Coolpix 5700.
    serial
        Serial number in its USB descriptor.
    """

    vendor_id: int | None = None
    product_id: int | None = None
    serial: str = ""

    def __str__(self) -> str:
        parts = [f"{number:04x}" if number is not None else "*" for number in (self.vendor_id, self.product_id)]
        return f"usb:{':'.join(parts)}" + (f":{self.serial}" if self.serial else "")


@dataclass(frozen=True, slots=True)
class UsbCamera:
    """A claimed camera: its device and the endpoints of its PTP interface."""

    device: Any
    bulk_in: Any
    bulk_out: Any
    interrupt: Any


def find_and_claim(options: UsbOptions, place: Place, backend: Any) -> UsbCamera:
    """Find the one camera that is meant and take it from the system.

    Raises `ConnectError` when there is none or more than one, and what pyusb raises.
    """
    found = list(_candidates(options, place, backend))
    if not found:
        raise ConnectError(
            "no such camera is there",
            place=place,
            hint="switch it on, set its USB mode to PTP, check the cable (`lsusb`)",
        )
    if len(found) > 1:
        ids = ", ".join(f"{device.idVendor:04x}:{device.idProduct:04x}" for device, _ in found)
        raise ConnectError(f"{len(found)} cameras are there ({ids})", place=place, hint="say which in the station file")
    device, interface = found[0]
    try:
        return _claim(device, interface, place)
    except BaseException:
        usb.util.dispose_resources(device)
        raise


def give_back(camera: UsbCamera) -> None:
    """Release the camera for others."""
    usb.util.dispose_resources(camera.device)


def _claim(device: Any, interface: Any, place: Place) -> UsbCamera:
    _configure(device, device[interface.configuration].bConfigurationValue)
    number = interface.bInterfaceNumber
    with suppress(NotImplementedError):  # only Linux has kernel drivers to detach
        if device.is_kernel_driver_active(number):
            device.detach_kernel_driver(number)
    usb.util.claim_interface(device, number)
    ends = [
        _endpoint(interface, usb.util.ENDPOINT_IN, usb.util.ENDPOINT_TYPE_BULK),
        _endpoint(interface, usb.util.ENDPOINT_OUT, usb.util.ENDPOINT_TYPE_BULK),
        _endpoint(interface, usb.util.ENDPOINT_IN, usb.util.ENDPOINT_TYPE_INTR),
    ]
    if None in ends:
        raise ConnectError("its PTP interface lacks an endpoint", place=place, hint="this device is not suited")
    return UsbCamera(device, *ends)


def _candidates(options: UsbOptions, place: Place, backend: Any) -> Iterator[tuple[Any, Any]]:
    """Yield devices that fit, each with its PTP interface."""
    wanted = {"idVendor": options.vendor_id, "idProduct": options.product_id}
    given = {key: value for key, value in wanted.items() if value is not None}
    try:
        devices = usb.core.find(find_all=True, backend=backend, **given)
    except usb.core.NoBackendError as error:
        raise ConnectError(
            "there is no USB library", place=place, hint="install libusb (Debian: apt install libusb-1.0-0)"
        ) from error
    for device in devices or ():
        interface = _ptp_interface(device)
        if interface is not None and (not options.serial or device.serial_number == options.serial):
            yield device, interface


def _ptp_interface(device: Any) -> Any:
    """Return the PTP interface of a device, or ``None``; reads descriptors only, which needs no rights."""
    for configuration in device:
        for interface in configuration:
            kind = (interface.bInterfaceClass, interface.bInterfaceSubClass, interface.bInterfaceProtocol)
            if kind == _STILL_IMAGE:
                return interface
    return None


def _configure(device: Any, value: int) -> None:
    """Choose the configuration, unless the system has done so already (choosing again would reset the device)."""
    try:
        device.get_active_configuration()
    except usb.core.USBError as error:
        if error.errno is not None:
            raise
        device.set_configuration(value)


def _endpoint(interface: Any, direction: int, kind: int) -> Any:
    """Return the endpoint of a direction and type, whatever its number."""
    return usb.util.find_descriptor(
        interface,
        custom_match=lambda end: (
            usb.util.endpoint_direction(end.bEndpointAddress) == direction
            and usb.util.endpoint_type(end.bmAttributes) == kind
        ),
    )
