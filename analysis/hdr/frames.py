"""Pixels of exposures as they were coded: JPEG, PNG and TIFF pictures, and raw files.

Raw files give the sensor's own numbers (`rawpy`'s ``raw_image``): LibRaw's developed pictures are brightened frame by
frame, or scaled by each frame's own maximum, unless several defaults are turned off, and then still demosaiced.
"""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from analysis.hdr.exif import dng_matrix, missing_end
from labdaq.errors import DataError

Codes = NDArray[Any]

PICTURE_SUFFIXES: Final = frozenset({".jpg", ".jpeg", ".png", ".tif", ".tiff"})


@dataclass(frozen=True)
class Sensor:
    """What the numbers of a raw file mean.

    Attributes
    ----------
    black : shape (2, 2) [code]
        Black level of the four places of the mosaic's cell.
    white : [code]
        Where the sensor clips.
    colours : shape (2, 2)
        0 red, 1 green, 2 blue for each place; all 1 for a sensor without filters.
    mosaic
        Whether there are filters.
    xyz_to_camera : shape (3, 3)
        From CIE XYZ to the sensor's red, green, blue; zeros when the file does not tell.
    dark : [code]
        Median of the covered pixels beside the picture, ``None`` without any.
    """

    black: NDArray[np.float64]
    white: float
    colours: NDArray[np.int64]
    mosaic: bool
    xyz_to_camera: NDArray[np.float64]
    dark: float | None = None


@dataclass(frozen=True)
class Frame:
    """One exposure.

    Attributes
    ----------
    codes : shape (H, W) for a mosaic or a grey picture, (H, W, 3) red, green, blue for a colour picture
        uint8 or uint16.
    sensor
        For raw files.
    """

    codes: Codes
    sensor: Sensor | None = field(default=None)

    @property
    def white(self) -> float:
        """Largest code."""
        return self.sensor.white if self.sensor else float(np.iinfo(self.codes.dtype).max)


def is_raw(path: Path) -> bool:
    """Whether a file is read as a raw file (anything that is no JPEG, PNG or TIFF by its name)."""
    return path.suffix.lower() not in PICTURE_SUFFIXES


def read_frame(path: Path) -> Frame:
    """Read an exposure.

    Raises `DataError`, one sentence, when the file is absent, truncated, or no picture that can be merged.
    """
    try:
        data = path.read_bytes()
    except OSError as error:
        raise DataError(f"{path}: cannot be read: {error.strerror}") from error
    missing = missing_end(data)
    if missing:
        raise DataError(f"{path}: the file is truncated: {missing}", "copy it from the camera again")
    return _read_raw(path, data) if is_raw(path) else _read_picture(path, data)


def _read_picture(path: Path, data: bytes) -> Frame:
    import cv2

    flags = cv2.IMREAD_ANYCOLOR | cv2.IMREAD_ANYDEPTH | cv2.IMREAD_IGNORE_ORIENTATION
    try:
        codes = cv2.imdecode(np.frombuffer(data, np.uint8), flags)
    except cv2.error:
        codes = None
    if codes is None:
        raise DataError(f"{path}: not a JPEG, PNG or TIFF picture that can be decoded")
    if codes.dtype not in (np.uint8, np.uint16) or (codes.ndim == 3 and codes.shape[2] != 3):
        raise DataError(f"{path}: {codes.dtype} with shape {codes.shape}; an exposure has 8 or 16 bits, grey or colour")
    return Frame(np.ascontiguousarray(codes[..., ::-1]) if codes.ndim == 3 else codes)


def _read_raw(path: Path, data: bytes) -> Frame:
    import io

    import rawpy

    try:
        with rawpy.imread(io.BytesIO(data)) as raw:
            if raw.raw_type != rawpy.RawType.Flat:
                raise DataError(
                    f"{path}: not a plain mosaic (stacked or linear raw)", "merge its developed TIFF instead"
                )
            codes = np.array(raw.raw_image_visible)
            return Frame(codes, _sensor(raw, path, dng_matrix(data)))
    except rawpy.LibRawError as error:
        text = error.args[0].decode() if error.args and isinstance(error.args[0], bytes) else str(error)
        raise DataError(
            f"{path}: not a raw file that can be read: {text}", "is it whole, and of a known camera?"
        ) from error


def _sensor(raw: Any, path: Path, matrix: list[float] | None) -> Sensor:
    """Levels and colours of an opened raw file; its own ``matrix`` goes before LibRaw's."""
    pattern = raw.raw_pattern
    mosaic = pattern is not None and raw.num_colors == 3
    if mosaic and pattern.shape != (2, 2):
        raise DataError(
            f"{path}: a mosaic of {pattern.shape[0]} x {pattern.shape[1]} places; only 2 x 2 ones are merged"
        )
    places = np.asarray(pattern if mosaic else np.zeros((2, 2)), dtype=np.int64)
    names = raw.color_desc.decode()
    levels = np.asarray(raw.black_level_per_channel, dtype=np.float64)
    whites = [w for w in (raw.camera_white_level_per_channel or []) if w]
    sizes, image = raw.sizes, raw.raw_image
    covered = [image[:, : max(0, sizes.left_margin - 4)], image[: max(0, sizes.top_margin - 4)]]
    enough = [strip.ravel() for strip in covered if strip.size > 1000]
    return Sensor(
        black=levels[places],
        white=float(min([raw.white_level, *whites])),
        colours=np.array([["RGB".find(names[p]) for p in row] for row in places])
        if mosaic
        else np.ones((2, 2), np.int64),
        mosaic=mosaic,
        xyz_to_camera=np.reshape(matrix, (3, 3)) if matrix else np.asarray(raw.rgb_xyz_matrix, dtype=np.float64)[:3],
        dark=float(np.median(np.concatenate(enough))) if enough else None,
    )
