"""Smallest raw files that LibRaw reads back bit for bit: fixtures for the merge."""

import struct
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

SHORT, LONG, RATIONAL, SRATIONAL, BYTE, ASCII = 3, 4, 5, 10, 1, 2
_FORMATS = {SHORT: "H", LONG: "I", BYTE: "B"}

XYZ_TO_CAMERA = np.array([[0.7, -0.1, -0.05], [-0.35, 1.15, 0.2], [-0.05, 0.15, 0.65]])
"""A made-up camera's matrix: well conditioned, green strongest."""


def write_dng(
    path: Path,
    codes: NDArray[np.uint16],
    exposure_s: float,
    *,
    black: int = 64,
    white: int = 4095,
    pattern: bytes = b"\0\1\1\2",
    f_number: float = 5.6,
    iso: int = 100,
    matrix: NDArray[np.float64] | None = XYZ_TO_CAMERA,
) -> None:
    """Write a 2 x 2 mosaic (H, W) as an uncompressed little-endian DNG 1.4 with Exif exposure data."""
    height, width = codes.shape
    exif = [
        (0x829A, RATIONAL, [exposure_s]),
        (0x829D, RATIONAL, [f_number]),
        (0x8827, SHORT, [iso]),
        (0x9003, ASCII, b"2010:07:22 13:12:00\0"),
    ]
    tags: list[tuple[int, int, Any]] = [
        (254, LONG, [0]), (256, LONG, [width]), (257, LONG, [height]), (258, SHORT, [16]), (259, SHORT, [1]),
        (262, SHORT, [32803]), (271, ASCII, b"labdaq\0"), (272, ASCII, b"test camera\0"), (273, LONG, [0]),
        (274, SHORT, [1]), (277, SHORT, [1]), (278, LONG, [height]), (279, LONG, [codes.nbytes]), (284, SHORT, [1]),
        (33421, SHORT, [2, 2]), (33422, BYTE, list(pattern)), (34665, LONG, [0]), (50706, BYTE, [1, 4, 0, 0]),
        (50707, BYTE, [1, 1, 0, 0]), (50708, ASCII, b"labdaq test camera\0"), (50714, SHORT, [black]),
        (50717, SHORT, [white]), (50778, SHORT, [21]),
    ]  # fmt: skip
    if matrix is not None:
        tags.append((50721, SRATIONAL, matrix.ravel().tolist()))
        tags.append((50728, RATIONAL, [0.6, 1.0, 0.7]))
    tags.sort()
    first = _directory(tags, 8)
    exif_at = 8 + len(first)
    pixels_at = exif_at + len(_directory(exif, exif_at))
    tags = [(t, k, [exif_at] if t == 34665 else [pixels_at] if t == 273 else v) for t, k, v in tags]
    head = b"II*\0" + struct.pack("<I", 8)
    path.write_bytes(head + _directory(tags, 8) + _directory(exif, exif_at) + codes.astype("<u2").tobytes())


def _directory(tags: list[tuple[int, int, Any]], at: int) -> bytes:
    """A TIFF directory placed at an offset, its long values behind it."""
    entries, behind = b"", b""
    start = at + 2 + 12 * len(tags) + 4
    for tag, kind, values in tags:
        if kind == ASCII:
            data, count = values, len(values)
        elif kind in (RATIONAL, SRATIONAL):
            letters = "II" if kind == RATIONAL else "ii"
            parts = [Fraction(v).limit_denominator(1_000_000) for v in values]
            data, count = b"".join(struct.pack(f"<{letters}", p.numerator, p.denominator) for p in parts), len(parts)
        else:
            data, count = struct.pack(f"<{len(values)}{_FORMATS[kind]}", *values), len(values)
        if len(data) <= 4:
            place = data.ljust(4, b"\0")
        else:
            place = struct.pack("<I", start + len(behind))
            behind += data + b"\0" * (len(data) % 2)
        entries += struct.pack("<HHI", tag, kind, count) + place
    return struct.pack("<H", len(tags)) + entries + b"\0\0\0\0" + behind
