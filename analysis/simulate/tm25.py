"""IES TM-25-13 ray files: a header of 36,288 bytes, then records of 4-byte floats; little-endian throughout.

The standard's text is not public. The layout follows the public-domain reading and writing library by J. Muschaweck
(github.com/JuliusMuschaweck/TM25RaySetTools), whose members bear the standard's section numbers, as the names here do.
Places are in millimetres. Of other people's files the luminous flux is read; where a file has radiant flux alone, its
rays are scaled so that they add up to the luminous flux of the header, if that is given.
"""

from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from labdaq.errors import DataError
from labdaq.whole_file import write_whole_bytes

Floats = NDArray[np.float64]

_TEXT: Final = 1000
_HEAD: Final = np.dtype(
    [
        ("type", "S4"),  # 4.7.1.1
        ("version", "<i4"),
        ("creation", "<i4"),  # 0: simulation, 1: measurement
        ("luminous_flux", "<f4"),
        ("radiant_flux", "<f4"),
        ("rays", "<u8"),
        ("date", "S28"),
        ("start", "<i4"),  # where rays start, 0 to 7; 0 in all makers' files seen
        ("spectrum", "<i4"),  # 0: none
        ("wavelength", "<f4", 3),
        ("tables", "<i4"),
        ("items", "<i4"),  # further columns
        ("text_bytes", "<i4"),
        ("reserved", "V168"),
        ("flags", "<i4", 8),  # 4.7.2: place, direction, radiant flux, wavelength, luminous flux, Stokes, XZ, table
        ("texts", "<u4", (9, _TEXT)),  # 4.7.3, UTF-32
    ]
)
_COLUMNS: Final = (3, 3, 1, 1, 1, 6, 2, 1)
"""Columns that each flag stands for, in the order of the file."""
_RADIANT, _LUMINOUS = 2, 4


def write_rows(path: Path, rows: Floats, title: str, when: str = "") -> None:
    """Write rows (n, 7) [m, lm] with luminous flux, without spectra. Raises `StorageError`."""
    head: Any = np.zeros((), dtype=_HEAD)
    head["type"], head["version"] = b"TM25", 2013
    head["luminous_flux"], head["radiant_flux"] = rows[:, 6].sum(), np.nan
    head["rays"], head["date"] = len(rows), when.encode()[:28]
    head["wavelength"] = np.nan
    head["flags"][[0, 1, _LUMINOUS]] = 1
    for place, text in ((0, title), (3, "labdaq"), (4, "labdaq, forward ray tracing of sun and sky")):
        codes = np.frombuffer(text[:_TEXT].encode("utf-32-le"), dtype="<u4")
        head["texts"][place, : len(codes)] = codes
    record = rows.astype("<f4")
    record[:, :3] = 1000.0 * rows[:, :3]
    write_whole_bytes(path, head.tobytes() + record.tobytes())


def read_rows(path: Path) -> Floats:
    """Read rows (n, 7) [m, lm]. Raises `DataError` for what is not such a file, is cut short, or has no lumens."""
    try:
        data = path.read_bytes()
    except OSError as error:
        raise DataError(f"{path}: {error.strerror}", "give a TM-25 ray file") from error
    if len(data) < _HEAD.itemsize or data[:4] != b"TM25":
        raise DataError(f"{path}: is not a TM-25 ray file", "it starts with TM25 and a header of 36,288 bytes")
    head: Any = np.frombuffer(data, dtype=_HEAD, count=1)[0]
    if head["version"] != 2013:
        raise DataError(f"{path}: TM-25 version {head['version']}; 2013 is read")
    flags = head["flags"] != 0
    if not (flags[0] and flags[1] and (flags[_RADIANT] or flags[_LUMINOUS])):
        raise DataError(f"{path}: its flags promise no place, direction and flux")
    items, count = int(head["items"]), int(head["rays"])
    width = sum(n for n, flag in zip(_COLUMNS, flags, strict=True) if flag) + items
    start = _first_ray(path, data, head)
    if min(items, int(head["text_bytes"])) < 0 or count < 1 or start + 4 * width * count > len(data):
        held = max(0, len(data) - start) // (4 * max(1, width))
        raise DataError(f"{path}: promises {count} rays and holds {held}", "the file was cut short, or is damaged")
    table = np.frombuffer(data, dtype="<f4", count=width * count, offset=start).reshape(count, width)
    rows = np.empty((count, 7))
    rows[:, :6] = table[:, :6]
    rows[:, :3] *= 0.001
    if flags[_LUMINOUS]:
        rows[:, 6] = table[:, 6 + int(flags[2]) + int(flags[3])]
        return rows
    lumens, watts = float(head["luminous_flux"]), float(table[:, 6].sum(dtype=np.float64))
    if not (lumens > 0.0 and watts > 0.0):
        raise DataError(f"{path}: has watts and no lumens", "give the luminous flux in its header")
    rows[:, 6] = table[:, 6] * (lumens / watts)
    return rows


def _first_ray(path: Path, data: bytes, head: Any) -> int:
    """Where the rays start: after spectral tables (4.7.4, padded to 32 bytes), names of columns, and a text."""
    size = 0
    for _ in range(int(head["tables"])):
        place = _HEAD.itemsize + size
        if place + 4 > len(data):
            raise DataError(f"{path}: ends within its spectral tables", "the file was cut short")
        size += 4 + 8 * max(0, int(np.frombuffer(data, "<i4", 1, place)[0]))
    size += -size % 32
    return _HEAD.itemsize + size + 512 * max(0, int(head["items"])) + max(0, int(head["text_bytes"]))
