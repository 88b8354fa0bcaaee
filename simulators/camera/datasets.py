"""PTP datasets as bytes: numbers little endian, strings counted UCS-2, arrays counted (PIMA 15740, clause 5)."""

import struct
from collections.abc import Sequence
from typing import Final

from simulators.camera.profiles import INT16, STRING, UINT8, UINT16, UINT32, CameraProfile, Choice, Property
from simulators.camera.store import ASSOCIATION, EXIF_JPEG, STORAGE, Card, StoredObject

_PLAIN: Final = {UINT8: "<B", UINT16: "<H", INT16: "<h", UINT32: "<I"}

NIKON_EXTENSION: Final = 0x0000_000A
MANUFACTURER: Final = "Nikon Corporation"
JFIF: Final = 0x3808


def text(value: str) -> bytes:
    """A string: characters including the NUL, then UCS-2; the empty string is one zero byte."""
    return bytes([len(value) + 1]) + value.encode("utf-16-le") + b"\0\0" if value else b"\0"


def codes(values: Sequence[int]) -> bytes:
    """An array of 16-bit codes."""
    return struct.pack(f"<I{len(values)}H", len(values), *values)


def handles(values: Sequence[int]) -> bytes:
    """An array of 32-bit handles."""
    return struct.pack(f"<I{len(values)}I", len(values), *values)


def value(kind: int, content: Choice) -> bytes:
    """One value of a property's type."""
    return text(str(content)) if kind == STRING else struct.pack(_PLAIN[kind], content)


def parse_value(kind: int, data: bytes) -> Choice:
    """The value in ``data``, which must be exactly one; raises `ValueError`."""
    if kind == STRING:
        if not data or len(data) != 1 + 2 * data[0]:
            raise ValueError("not a PTP string")
        return data[1:].decode("utf-16-le").rstrip("\0")
    try:
        content: int = struct.unpack(_PLAIN[kind], data)[0]
    except struct.error as wrong:
        raise ValueError(str(wrong)) from None
    return content


def device_info(profile: CameraProfile, serial: str) -> bytes:
    """DeviceInfo."""
    properties = [item.code for item in profile.properties]
    return (
        struct.pack("<HIH", 100, NIKON_EXTENSION, 100)
        + text("Nikon PTP Extensions")
        + struct.pack("<H", 0)
        + codes(profile.operations)
        + codes(profile.events)
        + codes([*properties, *profile.dead_properties])
        + codes([EXIF_JPEG])
        + codes(profile.image_formats)
        + text(MANUFACTURER)
        + text(profile.model)
        + text(profile.version)
        + text(serial)
    )


def storage_info(card: Card) -> bytes:
    """StorageInfo: a removable card with the camera file system."""
    pictures = card.free // 2**20
    return struct.pack("<HHHQQI", 4, 3, 0, card.capacity, card.free, pictures) + text("") + text("")


def object_info(item: StoredObject) -> bytes:
    """ObjectInfo of a file or folder."""
    file = item.file
    if file is None:
        fixed = struct.pack("<IHHIHIIIIIIIHII", STORAGE, ASSOCIATION, 0, 0, 0, 0, 0, 0, 0, 0, 0, item.parent, 1, 0, 0)
    else:
        depth = 16 if file.format == "dng" else 24
        fixed = struct.pack(
            "<IHHIHIIIIIIIHII",
            STORAGE,
            item.format,
            0,
            len(file.data),
            JFIF,
            len(file.thumbnail),
            160,
            120,
            file.width,
            file.height,
            depth,
            item.parent,
            0,
            0,
            item.handle,
        )
    return fixed + text(item.name) + text(item.when) + text(item.when) + text("")


def property_description(item: Property, current: Choice) -> bytes:
    """DevicePropDesc with an enumeration where choices are known."""
    described = struct.pack("<HHB", item.code, item.type, item.writable)
    described += value(item.type, item.value) + value(item.type, current)
    if not item.choices:
        return described + b"\0"
    return described + struct.pack("<BH", 2, len(item.choices)) + b"".join(value(item.type, c) for c in item.choices)
