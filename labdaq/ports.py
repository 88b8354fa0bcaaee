"""Where an instrument is reached, as it is written in a station file (`drivers.ports` opens it).

::

    /dev/ttyUSB0            a serial line (best a link below /dev/serial/by-id)
    tcp://10.0.0.7:502      a TCP connection: Modbus TCP, or a serial device server
    usb                     the only camera on USB
    usb:04b0:010d           the camera with this vendor and product; usb:04b0:010d:4007219 with this serial number
    ptpip://10.0.0.6        a camera on the network, at port 15740 unless ptpip://host:port says otherwise
    emulated                no port: an emulator stands in for the instrument
"""

import re
from enum import StrEnum
from typing import Final


class PortKind(StrEnum):
    """What a port is made of."""

    SERIAL = "serial"
    TCP = "tcp"
    USB = "usb"
    PTP_IP = "ptpip"
    EMULATED = "emulated"


_HOST: Final = r"(\[[0-9a-fA-F:.]+\]|[^:/\[\]\s]+)"
_SYNTAX: Final = {
    PortKind.SERIAL: re.compile(r"/\S+"),
    PortKind.TCP: re.compile(rf"tcp://{_HOST}:(?P<number>\d{{1,5}})"),
    PortKind.USB: re.compile(r"usb(:([0-9a-fA-F]{4}|\*):([0-9a-fA-F]{4}|\*)(:\S+)?)?"),
    PortKind.PTP_IP: re.compile(rf"ptpip://{_HOST}(:(?P<number>\d{{1,5}}))?"),
    PortKind.EMULATED: re.compile("emulated"),
}


def port_kind(text: str) -> PortKind:
    """Tell what a port is made of; raises `ValueError` saying what may be written."""
    for kind, syntax in _SYNTAX.items():
        if found := syntax.fullmatch(text):
            number = found.groupdict().get("number")
            if number is None or 0 < int(number) < 65536:
                return kind
    raise ValueError(f"{text!r} is not a port; write /dev/tty..., tcp://host:port, usb, ptpip://host or emulated")
