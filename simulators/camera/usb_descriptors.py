"""Descriptors of a still image USB device, with every attribute pyusb copies from its backend."""

from types import SimpleNamespace
from typing import Final

from simulators.camera.profiles import CameraProfile

NIKON: Final = 0x04B0
BULK_IN, BULK_OUT, INTERRUPT_IN = 0x81, 0x02, 0x83
_BULK, _INTERRUPT = 2, 3


def device_descriptor(profile: CameraProfile, bus: int, address: int) -> SimpleNamespace:
    """The device: one configuration, strings 1 to 3."""
    return SimpleNamespace(
        bLength=18,
        bDescriptorType=1,
        bcdUSB=0x0200 if profile.packet > 64 else 0x0110,
        bDeviceClass=0,
        bDeviceSubClass=0,
        bDeviceProtocol=0,
        bMaxPacketSize0=64,
        idVendor=NIKON,
        idProduct=profile.product_id,
        bcdDevice=0x0100,
        iManufacturer=1,
        iProduct=2,
        iSerialNumber=3,
        bNumConfigurations=1,
        address=address,
        bus=bus,
        port_number=1,
        port_numbers=(1,),
        speed=3 if profile.packet > 64 else 2,
    )


def configuration_descriptor() -> SimpleNamespace:
    """The only configuration: one interface."""
    return SimpleNamespace(
        bLength=9,
        bDescriptorType=2,
        wTotalLength=39,
        bNumInterfaces=1,
        bConfigurationValue=1,
        iConfiguration=0,
        bmAttributes=0xC0,
        bMaxPower=1,
        extra_descriptors=[],
    )


def interface_descriptor() -> SimpleNamespace:
    """The only interface: still image capture, class 06/01/01."""
    return SimpleNamespace(
        bLength=9,
        bDescriptorType=4,
        bInterfaceNumber=0,
        bAlternateSetting=0,
        bNumEndpoints=3,
        bInterfaceClass=6,
        bInterfaceSubClass=1,
        bInterfaceProtocol=1,
        iInterface=0,
        extra_descriptors=[],
    )


def endpoint_descriptor(index: int, packet: int) -> SimpleNamespace:
    """Bulk in, bulk out, interrupt in; raises `IndexError` beyond, which is how pyusb finds the end."""
    address, kind, size = ((BULK_IN, _BULK, packet), (BULK_OUT, _BULK, packet), (INTERRUPT_IN, _INTERRUPT, 32))[index]
    return SimpleNamespace(
        bLength=7,
        bDescriptorType=5,
        bEndpointAddress=address,
        bmAttributes=kind,
        wMaxPacketSize=size,
        bInterval=10 if kind == _INTERRUPT else 0,
        bRefresh=0,
        bSynchAddress=0,
        extra_descriptors=[],
    )
