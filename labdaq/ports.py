"""Where an instrument is reached, as it is written in a station file.

``/dev/ttyUSB0`` a serial line; ``tcp:10.0.0.7:4001`` a socket; ``usb:04b0:0119`` a USB device; ``emulated`` an
instrument that an emulator stands in for.
"""

import re
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class SerialPort:
    """A serial line, real or pseudo-terminal."""

    device: str

    def __str__(self) -> str:
        return self.device


@dataclass(frozen=True, slots=True)
class TcpPort:
    """A TCP socket: a serial server, Modbus TCP or PTP/IP."""

    host: str
    port: int

    def __str__(self) -> str:
        return f"tcp:{self.host}:{self.port}"


@dataclass(frozen=True, slots=True)
class UsbPort:
    """A USB device by vendor and product."""

    vendor: int
    product: int

    def __str__(self) -> str:
        return f"usb:{self.vendor:04x}:{self.product:04x}"


@dataclass(frozen=True, slots=True)
class EmulatedPort:
    """No port at all: an emulator is started for the instrument."""

    def __str__(self) -> str:
        return "emulated"


Port = SerialPort | TcpPort | UsbPort | EmulatedPort

_SYNTAX = "write /dev/tty..., tcp:host:port, usb:vendor:product (hexadecimal) or emulated"


def parse_port(text: str) -> Port:
    """Read a port; raises `ValueError` saying what may be written."""
    if text == "emulated":
        return EmulatedPort()
    if text.startswith("/"):
        return SerialPort(text)
    if found := re.fullmatch(r"usb:([0-9a-fA-F]{4}):([0-9a-fA-F]{4})", text):
        return UsbPort(int(found[1], 16), int(found[2], 16))
    if (found := re.fullmatch(r"tcp:(\[[0-9a-fA-F:]+\]|[^:\[\]\s]+):(\d{1,5})", text)) and 0 < int(found[2]) < 65536:
        return TcpPort(found[1].strip("[]"), int(found[2]))
    raise ValueError(f"{text!r} is not a port; {_SYNTAX}")
