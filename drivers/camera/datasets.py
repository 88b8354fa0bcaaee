"""Datasets of the Picture Transfer Protocol as values, and back. No waiting, no clock.

All numbers are little-endian. A string is a count of characters with its closing NUL, then UCS-2; the empty one is a
single zero byte. An array is a 32-bit count, then its elements. What a camera sends is not trusted: each length is
checked against what is there.
"""

import struct
from dataclasses import dataclass
from typing import Final

from drivers.exchange import FrameError

Value = int | str | tuple[int, ...]
"""Value of a property: a number, a text, or an array of numbers."""

STRING: Final = 0xFFFF
_ARRAY: Final = 0x4000
_WIDTH: Final = {1: 1, 2: 1, 3: 2, 4: 2, 5: 4, 6: 4, 7: 8, 8: 8, 9: 16, 10: 16}
"""Type code to bytes; odd codes are signed."""


class Reader:
    """Takes values from the front of a dataset; raises `FrameError` when it is cut short."""

    def __init__(self, data: bytes) -> None:
        self._data = data
        self._at = 0

    def _bytes(self, count: int) -> bytes:
        taken = self._data[self._at : self._at + count]
        if len(taken) < count:
            raise FrameError(f"the dataset is cut short: {count} bytes wanted at {self._at} of {len(self._data)}")
        self._at += count
        return taken

    def number(self, width: int, signed: bool = False) -> int:
        """Return the next number of ``width`` bytes."""
        return int.from_bytes(self._bytes(width), "little", signed=signed)

    def numbers(self, width: int, signed: bool = False) -> tuple[int, ...]:
        """Return the next array."""
        count = self.number(4)
        if count * width > len(self._data) - self._at:
            raise FrameError(
                f"an array of {count} elements does not fit in the {len(self._data) - self._at} bytes left"
            )
        return tuple(self.number(width, signed) for _ in range(count))

    def text(self) -> str:
        """Return the next string; at the very end of the dataset an empty one (some cameras leave off the last)."""
        if self._at == len(self._data):
            return ""
        return self._bytes(2 * self.number(1)).decode("utf-16-le", "replace").split("\0", 1)[0]

    def value(self, kind: int) -> Value:
        """Return the next value of a type code."""
        if kind == STRING:
            return self.text()
        width = _WIDTH.get(kind & ~_ARRAY)
        if width is None:
            raise FrameError(f"type code 0x{kind:04X} does not exist")
        signed = bool(kind & 1)
        return self.numbers(width, signed) if kind & _ARRAY else self.number(width, signed)


def pack_text(text: str) -> bytes:
    """Encode a string; raises `FrameError` for one of more than 254 characters."""
    if not text:
        return b"\0"
    encoded = (text + "\0").encode("utf-16-le")
    if len(encoded) > 2 * 255:
        raise FrameError(f"a string of {len(text)} characters is too long")
    return bytes([len(encoded) // 2]) + encoded


def pack_numbers(values: tuple[int, ...], width: int, signed: bool = False) -> bytes:
    """Encode an array."""
    return struct.pack("<I", len(values)) + b"".join(value.to_bytes(width, "little", signed=signed) for value in values)


def pack_value(value: Value, kind: int) -> bytes:
    """Encode a value of a type code; raises `FrameError` when it does not fit."""
    try:
        if kind == STRING and isinstance(value, str):
            return pack_text(value)
        width, signed = _WIDTH[kind & ~_ARRAY], bool(kind & 1)
        if kind & _ARRAY and isinstance(value, tuple):
            return pack_numbers(value, width, signed)
        if not kind & _ARRAY and isinstance(value, int):
            return value.to_bytes(width, "little", signed=signed)
    except (KeyError, OverflowError) as error:
        raise FrameError(f"{value!r} cannot be sent as type 0x{kind:04X}") from error
    raise FrameError(f"{value!r} cannot be sent as type 0x{kind:04X}")


@dataclass(frozen=True, slots=True)
class DeviceInfo:
    """Who a camera is and what it says it can do; codes as in `drivers.camera.codes`."""

    version: int
    vendor_extension: int
    vendor_version: int
    vendor_text: str
    mode: int
    operations: tuple[int, ...]
    events: tuple[int, ...]
    properties: tuple[int, ...]
    capture_formats: tuple[int, ...]
    image_formats: tuple[int, ...]
    manufacturer: str
    model: str
    device_version: str
    serial: str

    @classmethod
    def decode(cls, data: bytes) -> "DeviceInfo":
        """Decode the dataset; raises `FrameError`."""
        r = Reader(data)
        head = (r.number(2), r.number(4), r.number(2), r.text(), r.number(2))
        lists = (r.numbers(2), r.numbers(2), r.numbers(2), r.numbers(2), r.numbers(2))
        return cls(*head, *lists, r.text(), r.text(), r.text(), r.text())

    def encode(self) -> bytes:
        """Encode the dataset."""
        lists = (self.operations, self.events, self.properties, self.capture_formats, self.image_formats)
        return b"".join(
            (
                struct.pack("<HIH", self.version, self.vendor_extension, self.vendor_version),
                pack_text(self.vendor_text),
                struct.pack("<H", self.mode),
                *(pack_numbers(codes, 2) for codes in lists),
                *(pack_text(text) for text in (self.manufacturer, self.model, self.device_version, self.serial)),
            )
        )


@dataclass(frozen=True, slots=True)
class StorageInfo:
    """A card: its kind, room in bytes, and how many pictures still fit."""

    storage_type: int
    filesystem: int
    access: int
    capacity: int
    free: int
    free_images: int
    description: str
    label: str

    @classmethod
    def decode(cls, data: bytes) -> "StorageInfo":
        """Decode the dataset; raises `FrameError`."""
        r = Reader(data)
        return cls(r.number(2), r.number(2), r.number(2), r.number(8), r.number(8), r.number(4), r.text(), r.text())

    def encode(self) -> bytes:
        """Encode the dataset."""
        fixed = (self.storage_type, self.filesystem, self.access, self.capacity, self.free, self.free_images)
        return struct.pack("<HHHQQI", *fixed) + pack_text(self.description) + pack_text(self.label)


_OBJECT_FIXED: Final = struct.Struct("<IHHIHIIIIIIIHII")


@dataclass(frozen=True, slots=True)
class ObjectInfo:
    """A picture or folder in the camera; dates as the camera writes them (``YYYYMMDDThhmmss``)."""

    storage: int
    format: int
    protection: int
    size: int
    thumb_format: int
    thumb_size: int
    thumb_width: int
    thumb_height: int
    width: int
    height: int
    bit_depth: int
    parent: int
    association: int
    association_text: int
    sequence: int
    name: str
    capture_date: str
    modification_date: str
    keywords: str

    @classmethod
    def decode(cls, data: bytes) -> "ObjectInfo":
        """Decode the dataset; raises `FrameError`."""
        if len(data) < _OBJECT_FIXED.size:
            raise FrameError(f"an ObjectInfo of {len(data)} bytes")
        r = Reader(data[_OBJECT_FIXED.size :])
        texts = (r.text(), r.text(), r.text(), r.text())
        return cls(*(*_OBJECT_FIXED.unpack_from(data), *texts))

    def encode(self) -> bytes:
        """Encode the dataset."""
        fixed = (
            *(self.storage, self.format, self.protection, self.size),
            *(self.thumb_format, self.thumb_size, self.thumb_width, self.thumb_height),
            *(self.width, self.height, self.bit_depth),
            *(self.parent, self.association, self.association_text, self.sequence),
        )
        texts = (self.name, self.capture_date, self.modification_date, self.keywords)
        return _OBJECT_FIXED.pack(*fixed) + b"".join(pack_text(text) for text in texts)


@dataclass(frozen=True, slots=True)
class PropertyDescription:
    """A setting: its type, whether it may be set now, its values.

    Attributes
    ----------
    code, kind
        Property and type code.
    writable
        Whether the camera takes another value, in its present mode.
    default, current
        Values.
    choices
        All values there are, or empty.
    limits
        Lowest, highest, step; or empty.
    """

    code: int
    kind: int
    writable: bool
    default: Value
    current: Value
    choices: tuple[Value, ...] = ()
    limits: tuple[Value, ...] = ()

    @classmethod
    def decode(cls, data: bytes) -> "PropertyDescription":
        """Decode the dataset; raises `FrameError`."""
        r = Reader(data)
        code, kind, access = r.number(2), r.number(2), r.number(1)
        default, current = r.value(kind), r.value(kind)
        form = r.number(1)
        limits = tuple(r.value(kind) for _ in range(3)) if form == 1 else ()
        choices = tuple(r.value(kind) for _ in range(r.number(2))) if form == 2 else ()
        return cls(code, kind, access == 1, default, current, choices, limits)

    def encode(self) -> bytes:
        """Encode the dataset."""
        head = struct.pack("<HHB", self.code, self.kind, self.writable)
        form = b"\0"
        if self.limits:
            form = b"\1" + b"".join(pack_value(value, self.kind) for value in self.limits)
        elif self.choices:
            listed = b"".join(pack_value(value, self.kind) for value in self.choices)
            form = b"\2" + struct.pack("<H", len(self.choices)) + listed
        return head + pack_value(self.default, self.kind) + pack_value(self.current, self.kind) + form


def decode_handles(data: bytes) -> tuple[int, ...]:
    """Decode a list of object handles or storage numbers; raises `FrameError`."""
    return Reader(data).numbers(4)
