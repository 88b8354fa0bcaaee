"""Just enough TIFF to write a DNG, a TIFF picture and an EXIF block: directories of tags, little endian.

Source: TIFF 6.0, sections 2 and 8.
"""

import struct
from collections.abc import Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from typing import Final

BYTE, ASCII, SHORT, LONG, RATIONAL, UNDEFINED, SRATIONAL = 1, 2, 3, 4, 5, 7, 10

_SIZES: Final = {BYTE: 1, ASCII: 1, SHORT: 2, LONG: 4, RATIONAL: 8, UNDEFINED: 1, SRATIONAL: 8}

Value = int | str | bytes | Fraction


@dataclass
class Directory:
    """One image file directory.

    Attributes
    ----------
    entries
        Tag to its type and packed values.
    children
        Tag to a directory it points to (EXIF at 8769h).
    strip
        Picture data, pointed to by StripOffsets (0111h); empty without a picture.
    """

    entries: dict[int, tuple[int, bytes]] = field(default_factory=dict)
    children: dict[int, "Directory"] = field(default_factory=dict)
    strip: bytes = b""

    def put(self, tag: int, kind: int, values: Value | Sequence[Value]) -> None:
        """Set a tag; a string gets its NUL, rationals are given as `Fraction`."""
        self.entries[tag] = (kind, _pack(kind, values))


def _pack(kind: int, values: Value | Sequence[Value]) -> bytes:
    if isinstance(values, str):
        return values.encode("ascii") + b"\0"
    if isinstance(values, bytes):
        return values
    many = [values] if isinstance(values, int | Fraction) else list(values)
    if kind in (RATIONAL, SRATIONAL):
        pairs = [Fraction(value) for value in many if isinstance(value, int | Fraction)]
        letter = "i" if kind == SRATIONAL else "I"
        return b"".join(struct.pack(f"<2{letter}", pair.numerator, pair.denominator) for pair in pairs)
    return struct.pack(f"<{len(many)}{ {BYTE: 'B', SHORT: 'H', LONG: 'I'}[kind] }", *many)


def tiff(directory: Directory) -> bytes:
    """The whole file: header, directories, values and picture data."""
    return b"II*\0" + struct.pack("<I", 8) + _write(directory, 8)


def _write(directory: Directory, offset: int) -> bytes:
    """A directory that will lie at ``offset``, with everything it points to behind it."""
    entries = dict(directory.entries)
    for tag in directory.children:
        entries[tag] = (LONG, b"\0\0\0\0")
    if directory.strip:
        entries[0x0111] = (LONG, b"\0\0\0\0")
        entries[0x0117] = (LONG, struct.pack("<I", len(directory.strip)))
    table_size = 2 + 12 * len(entries) + 4
    tail = bytearray()
    pointers: dict[int, int] = {}
    for tag, (_, data) in sorted(entries.items()):
        if len(data) > 4:
            pointers[tag] = offset + table_size + len(tail)
            tail += data + b"\0" * (len(data) % 2)
    for tag, child in directory.children.items():
        at = offset + table_size + len(tail)
        entries[tag] = (LONG, struct.pack("<I", at))
        written = _write(child, at)
        tail += written + b"\0" * (len(written) % 2)
    if directory.strip:
        entries[0x0111] = (LONG, struct.pack("<I", offset + table_size + len(tail)))
        tail += directory.strip
    table = struct.pack("<H", len(entries))
    for tag, (kind, data) in sorted(entries.items()):
        value = struct.pack("<I", pointers[tag]) if tag in pointers else data.ljust(4, b"\0")
        table += struct.pack("<HHI", tag, kind, len(data) // _SIZES[kind]) + value
    return table + b"\0\0\0\0" + bytes(tail)
