"""Frames of the CL-200A's line, seen from the meter.

``STX head(2) command(2) parameter(4) [data] ETX BCC(2) CR LF``. BCC is the exclusive or of every byte from the first
head digit through ETX, two upper-case hexadecimal digits. Source: Konica Minolta technical note KMSE CS-A32T.0100; its
sentence excludes ETX from the sum, but its examples and every frame it prints include it.
"""

from dataclasses import dataclass
from functools import reduce
from operator import xor

STX, ETX = 0x02, 0x03
_SHORT, _SPECIAL = 14, 38  # lengths of requests: all but command 48, command 48


@dataclass(frozen=True, slots=True)
class Request:
    """A request with a good check sum.

    Attributes
    ----------
    head
        Two characters: ``00`` to ``29``, or ``99`` for all.
    command
        Two digits.
    parameter
        Four characters.
    data
        24 hexadecimal digits with command 48, else empty.
    """

    head: str
    command: str
    parameter: str
    data: str = ""


def check_code(body: bytes) -> bytes:
    """BCC of what stands between STX and BCC, ETX included."""
    return b"%02X" % reduce(xor, body, 0)


def frame(body: str) -> bytes:
    """Wrap head, command, status and data into a frame."""
    inner = body.encode("ascii") + bytes([ETX])
    return bytes([STX]) + inner + check_code(inner) + b"\r\n"


def take_request(buffer: bytearray) -> Request | None:
    """Take the next good request out of ``buffer``; ``None`` when it holds none.

    Whatever is not a good frame is dropped silently, as the meter does; an unfinished frame stays for its rest.
    """
    while True:
        start = buffer.find(STX)
        if start < 0:
            buffer.clear()
            return None
        del buffer[:start]
        end = buffer.find(b"\r\n")
        if end < 0:
            restart = buffer.rfind(STX)
            del buffer[:restart]  # a new frame begins: the old one will never be finished
            if len(buffer) > _SPECIAL:
                buffer.clear()
            return None
        text = bytes(buffer[: end + 2])
        del buffer[: end + 2]
        request = _parse(text[text.rfind(STX) :])
        if request is not None:
            return request


def _parse(text: bytes) -> Request | None:
    """A whole frame from STX to LF, or ``None``."""
    if len(text) not in (_SHORT, _SPECIAL) or text[-5] != ETX:
        return None
    inner, code = text[1:-4], text[-4:-2]
    if check_code(inner) != code.upper():
        return None
    body = inner[:-1].decode("ascii", "replace")
    return Request(body[:2], body[2:4], body[4:8], body[8:])
