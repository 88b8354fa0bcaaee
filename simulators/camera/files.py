"""Picture files of the emulated camera: DNG, TIFF and JPEG, each with its exposure data in EXIF.

The JPEG's tone curve is that of sRGB (IEC 61966-2-1) applied to (DN - black) / (white - black) after bilinear
demosaicing; nothing else is done to it (no white balance, sharpening or matrix: the sensor's primaries are sRGB's).
Sources: EXIF 2.3 (CIPA DC-008) for the tags; DNG specification 1.4 for the raw file.
"""

from dataclasses import dataclass
from fractions import Fraction
from functools import lru_cache
from typing import Final

import numpy as np
from numpy.typing import NDArray

from simulators.camera.tiff import (
    ASCII,
    BYTE,
    LONG,
    RATIONAL,
    SHORT,
    SRATIONAL,
    UNDEFINED,
    Directory,
    tiff,
)

Words = NDArray[np.uint16]

# XYZ (D65) to linear sRGB, IEC 61966-2-1, to 4 decimals
_XYZ_TO_SRGB: Final = ("3.2406", "-1.5372", "-0.4986", "-0.9689", "1.8758", "0.0415", "0.0557", "-0.2040", "1.0570")


@dataclass(frozen=True, slots=True)
class ExposureData:
    """What the camera writes about a picture.

    Attributes
    ----------
    make, model
        Names of the camera.
    when
        Its own clock at the beginning of the exposure, ``YYYY:MM:DD HH:MM:SS``.
    nominal_s
        Shutter time as the camera names it [s].
    f_number
        Aperture number as the camera names it.
    iso
        Sensitivity.
    automatic
        Whether the camera chose the exposure.
    focal_length_mm
        Focal length [mm].
    """

    make: str
    model: str
    when: str
    nominal_s: Fraction
    f_number: Fraction
    iso: int
    automatic: bool
    focal_length_mm: Fraction


def exif(data: ExposureData) -> Directory:
    """The EXIF directory."""
    directory = Directory()
    directory.put(0x829A, RATIONAL, data.nominal_s)
    directory.put(0x829D, RATIONAL, data.f_number)
    directory.put(0x8822, SHORT, 2 if data.automatic else 1)
    directory.put(0x8827, SHORT, data.iso)
    directory.put(0x9000, UNDEFINED, b"0230")
    directory.put(0x9003, ASCII, data.when)
    directory.put(0x9004, ASCII, data.when)
    directory.put(0x920A, RATIONAL, data.focal_length_mm)
    return directory


def _described(data: ExposureData) -> Directory:
    directory = Directory(children={0x8769: exif(data)})
    directory.put(0x010F, ASCII, data.make)
    directory.put(0x0110, ASCII, data.model)
    directory.put(0x0112, SHORT, 1)
    directory.put(0x0132, ASCII, data.when)
    return directory


def dng(mosaic: Words, black: int, white: int, data: ExposureData) -> bytes:
    """An uncompressed DNG of an RGGB mosaic, 16 bits a pixel, linear; shape (H, W)."""
    height, width = mosaic.shape
    directory = _described(data)
    directory.put(0x00FE, LONG, 0)
    directory.put(0x0100, LONG, width)
    directory.put(0x0101, LONG, height)
    directory.put(0x0102, SHORT, 16)
    directory.put(0x0103, SHORT, 1)
    directory.put(0x0106, SHORT, 32_803)  # colour filter array
    directory.put(0x0115, SHORT, 1)
    directory.put(0x0116, LONG, height)
    directory.put(0x011C, SHORT, 1)
    directory.put(0x828D, SHORT, (2, 2))
    directory.put(0x828E, BYTE, (0, 1, 1, 2))
    directory.put(0xC612, BYTE, (1, 4, 0, 0))
    directory.put(0xC613, BYTE, (1, 1, 0, 0))
    directory.put(0xC614, ASCII, f"{data.make} {data.model}")
    directory.put(0xC61A, SHORT, black)
    directory.put(0xC61D, SHORT, white)
    directory.put(0xC621, SRATIONAL, [Fraction(value) for value in _XYZ_TO_SRGB])
    directory.put(0xC628, RATIONAL, [Fraction(1)] * 3)
    directory.put(0xC65A, SHORT, 21)  # D65
    directory.strip = mosaic.astype("<u2").tobytes()
    return tiff(directory)


def developed(mosaic: Words, black: int, white: int) -> NDArray[np.uint8]:
    """Demosaiced picture with the tone curve, blue first, shape (H, W, 3)."""
    import cv2

    picture: NDArray[np.uint8] = _curve(black, white)[cv2.cvtColor(mosaic, cv2.COLOR_BayerRGGB2BGR)]
    return picture


@lru_cache(maxsize=4)
def _curve(black: int, white: int) -> NDArray[np.uint8]:
    """Byte for every digital number a 16-bit mosaic can hold."""
    return np.rint(255.0 * srgb_tone((np.arange(2**16) - black) / (white - black))).astype(np.uint8)


def srgb_tone(linear: NDArray[np.float64]) -> NDArray[np.float64]:
    """The sRGB tone curve of values clipped to [0, 1]."""
    x = np.clip(linear, 0.0, 1.0)
    toned: NDArray[np.float64] = np.where(x <= 0.0031308, 12.92 * x, 1.055 * np.maximum(x, 1e-9) ** (1 / 2.4) - 0.055)
    return toned


def jpeg(picture: NDArray[np.uint8], quality: int, data: ExposureData) -> bytes:
    """A baseline JPEG with an EXIF block right after its first marker."""
    import cv2

    _, encoded = cv2.imencode(".jpg", picture, [cv2.IMWRITE_JPEG_QUALITY, quality])
    plain = encoded.tobytes()
    block = b"Exif\0\0" + tiff(_described(data))
    return plain[:2] + b"\xff\xe1" + (len(block) + 2).to_bytes(2, "big") + block + plain[2:]


def thumbnail(mosaic: Words, black: int, white: int) -> bytes:
    """A grey JPEG of 160 × 120 pixels, made of half the green ones, without EXIF."""
    import cv2

    small = cv2.resize(_curve(black, white)[mosaic[0::2, 1::2]], (160, 120), interpolation=cv2.INTER_AREA)
    _, encoded = cv2.imencode(".jpg", small)
    return encoded.tobytes()


def plain_tiff(picture: NDArray[np.uint8], data: ExposureData) -> bytes:
    """An uncompressed TIFF of 8 bits a channel with the same tone curve as the JPEG."""
    height, width, _ = picture.shape
    directory = _described(data)
    directory.put(0x0100, LONG, width)
    directory.put(0x0101, LONG, height)
    directory.put(0x0102, SHORT, (8, 8, 8))
    directory.put(0x0103, SHORT, 1)
    directory.put(0x0106, SHORT, 2)
    directory.put(0x0115, SHORT, 3)
    directory.put(0x0116, LONG, height)
    directory.put(0x011C, SHORT, 1)
    directory.strip = picture[:, :, ::-1].tobytes()
    return tiff(directory)
