"""From the text of a port in a station file to the line behind it.

::

    /dev/ttyUSB0            a serial port (or a link to one, best below /dev/serial/by-id)
    tcp://10.0.0.5:502      a TCP connection
    usb                     the only camera on USB
    usb:04b0:010d           the camera with this vendor and product
    usb:04b0:010d:4007219   the same with this serial number; * stands for any, as in usb:*:*:4007219
    ptpip://10.0.0.6        a camera on the network; port 15740 unless given as ptpip://10.0.0.6:15741
"""

from typing import Any
from urllib.parse import urlsplit

from drivers.camera.link import Link
from drivers.serial_port import SerialSettings, SerialTransport
from drivers.tcp import TcpTransport
from drivers.transport import Transport
from labdaq.errors import ConfigError


def line(instrument: str, port: str, settings: SerialSettings) -> Transport:
    """Return the (unopened) line behind ``port``; ``settings`` are for a serial one. Raises `ConfigError`."""
    if port.startswith("/"):
        return SerialTransport(instrument, port, settings)
    if port.startswith("tcp://"):
        return TcpTransport(instrument, *_host_and_port(instrument, port, None))
    raise ConfigError(f"{instrument}: {port!r} is no port", "write /dev/... for a serial port or tcp://HOST:PORT")


def camera_link(instrument: str, port: str, backend: Any = None) -> Link:
    """Return the (unopened) link behind ``port``; raises `ConfigError`. ``backend`` of pyusb takes libusb's place."""
    if port.startswith("ptpip://"):
        from drivers.camera.ip import PtpIp
        from drivers.camera.packets import PORT

        host, number = _host_and_port(instrument, port, PORT)
        return PtpIp(TcpTransport(instrument, host, number), TcpTransport(instrument, host, number))
    scheme, *parts = port.split(":")
    if scheme == "usb" and len(parts) in {0, 2, 3}:
        from drivers.camera.usb import UsbPtp
        from drivers.camera.usb_device import UsbOptions

        try:
            vendor, product = (None if part == "*" else int(part, 16) for part in (parts or ["*", "*"])[:2])
        except ValueError:
            pass
        else:
            serial = "".join(parts[2:])
            return UsbPtp(instrument, UsbOptions(vendor, product, "" if serial == "*" else serial), backend)
    raise ConfigError(f"{instrument}: {port!r} is no camera", "write usb, usb:VENDOR:PRODUCT or ptpip://HOST")


def _host_and_port(instrument: str, port: str, default: int | None) -> tuple[str, int]:
    try:
        parts = urlsplit(port)
        host, number = parts.hostname, parts.port or default
    except ValueError:
        host = number = None
    if not host or not number:
        raise ConfigError(
            f"{instrument}: {port!r} lacks a host or a port", "write tcp://HOST:PORT, e.g. tcp://10.0.0.5:502"
        )
    return host, number
