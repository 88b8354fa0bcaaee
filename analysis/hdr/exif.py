"""How a picture was exposed, read from its file without decoding it.

Looks into the TIFF structure that JPEG (APP1), PNG (eXIf) and TIFF-based raw files (DNG, NEF, CR2 ...) share:
Exif 2.32, section 4.6, and TIFF 6.0, section 2. ExposureTime is what was set, as a fraction; the APEX
ShutterSpeedValue is rounded to an eighth of a stop by some cameras and is used only where there is nothing else.
"""

import struct
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from labdaq.errors import DataError

_EXIF_IFD: Final = 0x8769
_SIZES: Final = {1: 1, 2: 1, 3: 2, 4: 4, 5: 8, 6: 1, 7: 1, 8: 2, 9: 4, 10: 8, 11: 4, 12: 8, 13: 4}
_MODEL, _EXPOSURE, _F_NUMBER, _ISO, _TAKEN = 0x0110, 0x829A, 0x829D, 0x8827, 0x9003
_SHUTTER_APEX, _APERTURE_APEX = 0x9201, 0x9202
_STRIP_OFFSETS, _STRIP_LENGTHS, _TILE_OFFSETS, _TILE_LENGTHS, _SUB_IFDS = 0x0111, 0x0117, 0x0144, 0x0145, 0x014A

_MATRICES: Final = ((0xC621, 0xC65A), (0xC622, 0xC65B))  # ColorMatrix1 and 2 with their CalibrationIlluminant
_D65: Final = 21

Number = int | float


@dataclass(frozen=True, slots=True)
class Exif:
    """Exposure data of one picture; ``None`` where the file does not tell.

    Attributes
    ----------
    exposure_s
        Exposure time [s].
    f_number, iso
        Aperture and sensitivity.
    taken
        Camera's own clock, ``YYYY:MM:DD HH:MM:SS``; no zone.
    model
        Camera.
    """

    exposure_s: float | None = None
    f_number: float | None = None
    iso: float | None = None
    taken: str = ""
    model: str = ""


class _Tiff:
    """A TIFF structure inside ``data``."""

    def __init__(self, data: bytes) -> None:
        marks = {b"II": "<", b"MM": ">"}
        if data[:2] not in marks or len(data) < 8:
            raise ValueError("no TIFF structure")
        self.data = data
        self.order = marks[data[:2]]

    def directories(self) -> Iterator[dict[int, tuple[int, int, int]]]:
        """All directories, sub-directories and the Exif one; tag to (type, count, where its values are)."""
        waiting = [struct.unpack_from(self.order + "I", self.data, 4)[0]]
        seen: set[int] = set()
        while waiting:
            at = waiting.pop(0)
            if at in seen or at == 0 or at + 2 > len(self.data) or len(seen) > 64:
                continue
            seen.add(at)
            count = struct.unpack_from(self.order + "H", self.data, at)[0]
            tags: dict[int, tuple[int, int, int]] = {}
            for entry in range(at + 2, at + 2 + 12 * count, 12):
                if entry + 12 > len(self.data):
                    break
                tag, kind, number = struct.unpack_from(self.order + "HHI", self.data, entry)
                size = _SIZES.get(kind, 1) * number
                inline = entry + 8
                tags[tag] = (
                    kind,
                    number,
                    inline if size <= 4 else struct.unpack_from(self.order + "I", self.data, inline)[0],
                )
            yield tags
            for tag in (_EXIF_IFD, _SUB_IFDS):
                if tag in tags:
                    waiting += [int(v) for v in self.numbers(tags[tag])]
            after = at + 2 + 12 * count
            if after + 4 <= len(self.data):
                waiting.append(struct.unpack_from(self.order + "I", self.data, after)[0])

    def numbers(self, entry: tuple[int, int, int]) -> list[Number]:
        """Values of a numeric entry; empty when they lie outside the data or are not numbers."""
        kind, count, at = entry
        letter = {1: "B", 3: "H", 4: "I", 6: "b", 8: "h", 9: "i", 11: "f", 12: "d", 13: "I", 5: "I", 10: "i"}.get(kind)
        if letter is None or at + _SIZES[kind] * count > len(self.data):
            return []
        ratios = kind in (5, 10)
        values = struct.unpack_from(f"{self.order}{count * (2 if ratios else 1)}{letter}", self.data, at)
        if not ratios:
            return list(values)
        return [values[i] / values[i + 1] if values[i + 1] else 0.0 for i in range(0, len(values), 2)]

    def text(self, entry: tuple[int, int, int]) -> str:
        """Value of a text entry."""
        _, count, at = entry
        return self.data[at : at + count].split(b"\0")[0].decode("latin-1").strip()


def read_exif(path: Path) -> Exif:
    """Exposure data of a JPEG, PNG, TIFF or TIFF-based raw file; empty when it holds none.

    Raises `DataError` when the file cannot be read at all.
    """
    try:
        data = path.read_bytes()
    except OSError as error:
        raise DataError(f"{path}: cannot be read: {error.strerror}") from error
    try:
        tiff = _Tiff(tiff_block(data))
    except ValueError:
        return Exif()
    first: dict[int, tuple[int, int, int]] = {}
    for tags in tiff.directories():
        for tag, entry in tags.items():
            first.setdefault(tag, entry)

    def number(tag: int) -> float | None:
        values = tiff.numbers(first[tag]) if tag in first else []
        return float(values[0]) if values else None

    def positive(value: float | None) -> float | None:
        return value if value is not None and value > 0.0 else None

    exposure, shutter = positive(number(_EXPOSURE)), number(_SHUTTER_APEX)
    aperture, apex = positive(number(_F_NUMBER)), number(_APERTURE_APEX)
    return Exif(
        exposure_s=exposure or (2.0**-shutter if shutter is not None else None),
        f_number=aperture or (2.0 ** (apex / 2.0) if apex is not None else None),
        iso=positive(number(_ISO)),
        taken=tiff.text(first[_TAKEN]) if _TAKEN in first else "",
        model=tiff.text(first[_MODEL]) if _MODEL in first else "",
    )


def dng_matrix(data: bytes) -> list[float] | None:
    """Nine numbers from CIE XYZ to the camera, row by row, of a DNG's bytes; ``None`` when it has none.

    Of two matrices the one for D65 is taken (DNG specification 1.4, ColorMatrix1 and 2): the sky is nearer to it.
    LibRaw knows matrices by camera model only.
    """
    try:
        tiff = _Tiff(data)
    except ValueError:
        return None
    found: list[tuple[bool, list[float]]] = []
    for tags in tiff.directories():
        for matrix, illuminant in _MATRICES:
            values = tiff.numbers(tags[matrix]) if matrix in tags else []
            if len(values) == 9:
                light = tiff.numbers(tags[illuminant]) if illuminant in tags else []
                found.append((light == [_D65], [float(v) for v in values]))
    return max(found, key=lambda pair: pair[0])[1] if found else None


def tiff_block(data: bytes) -> bytes:
    """The TIFF structure of a file's bytes; raises `ValueError` when there is none."""
    if data[:2] in (b"II", b"MM"):
        return data
    if data[:2] == b"\xff\xd8":
        for marker, start, end in jpeg_segments(data):
            if marker == 0xE1 and data[start : start + 6] == b"Exif\0\0":
                return data[start + 6 : end]
    if data[:8] == b"\x89PNG\r\n\x1a\n":
        for kind, start, end in png_chunks(data):
            if kind == b"eXIf":
                return data[start:end]
    raise ValueError("no TIFF structure")


def jpeg_segments(data: bytes) -> Iterator[tuple[int, int, int]]:
    """Marker and content (start, end) of a JPEG's segments up to and including the start of the scan."""
    at = 2
    while at + 4 <= len(data) and data[at] == 0xFF:
        marker, length = data[at + 1], int.from_bytes(data[at + 2 : at + 4], "big")
        yield marker, at + 4, at + 2 + length
        if marker == 0xDA:
            return
        at += 2 + length


def png_chunks(data: bytes) -> Iterator[tuple[bytes, int, int]]:
    """Type and content (start, end) of a PNG's chunks."""
    at = 8
    while at + 8 <= len(data):
        length = int.from_bytes(data[at : at + 4], "big")
        yield data[at + 4 : at + 8], at + 8, at + 8 + length
        at += 12 + length


def missing_end(data: bytes) -> str:
    """Why a file's bytes cannot be all of it; empty when nothing is missing.

    OpenCV paints the missing part of a truncated JPEG grey and LibRaw that of an uncompressed raw black, both without
    an error, so it is looked at before they are asked.
    """
    if data[:2] == b"\xff\xd8":
        scan = next((end for marker, _, end in jpeg_segments(data) if marker == 0xDA), len(data))
        return "" if data.find(b"\xff\xd9", scan) >= 0 else "its end marker is missing"
    if data[:8] == b"\x89PNG\r\n\x1a\n":
        whole = any(kind == b"IEND" and end + 4 <= len(data) for kind, _, end in png_chunks(data))
        return "" if whole else "its end chunk is missing"
    if data[:2] in (b"II", b"MM"):
        return _missing_strip(data)
    return ""


def _missing_strip(data: bytes) -> str:
    try:
        tiff = _Tiff(data)
        for tags in tiff.directories():
            for offsets, lengths in ((_STRIP_OFFSETS, _STRIP_LENGTHS), (_TILE_OFFSETS, _TILE_LENGTHS)):
                if offsets in tags and lengths in tags:
                    pairs = zip(tiff.numbers(tags[offsets]), tiff.numbers(tags[lengths]), strict=False)
                    end = max((at + length for at, length in pairs), default=0)
                    if end > len(data):
                        return f"its pixels should reach to byte {end:.0f}, but it ends at {len(data)}"
    except (ValueError, struct.error):
        return "its TIFF structure is damaged"
    return ""
