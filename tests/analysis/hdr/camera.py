"""A camera whose truth is known: photons, read-out, black level, clipping, tone curve, JPEG."""

from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from tests.analysis.hdr.dng_writer import write_dng

Floats = NDArray[np.float64]

BLACK, WHITE = 64, 4095
ELECTRONS_PER_CODE, READ_NOISE = 2.5, 2.0
LADDER = tuple(2.0 ** (3 - k) for k in range(16))
"""16 exposures, 8 s to 1/4096 s."""


def raw_codes(rate: Floats, time_s: float, rng: np.random.Generator, linearity: float = 0.0) -> NDArray[np.uint16]:
    """Codes of a sensor that collects ``rate`` codes per second (above black) for a time."""
    electrons = rng.poisson(rate * time_s * ELECTRONS_PER_CODE)
    signal = electrons / ELECTRONS_PER_CODE
    signal = signal * (1.0 - linearity * signal / (WHITE - BLACK))
    codes = np.rint(BLACK + signal + rng.normal(0.0, READ_NOISE, signal.shape))
    return np.clip(codes, 0, WHITE).astype(np.uint16)


def raw_bracket(
    folder: Path,
    rate: Floats,
    times_s: tuple[float, ...] = LADDER,
    told_s: tuple[float, ...] | None = None,
    seed: int = 0,
) -> list[Path]:
    """Write DNG files of a mosaic's rates (H, W); ``told_s`` is what their Exif says."""
    rng = np.random.default_rng(seed)
    paths = []
    for k, time in enumerate(times_s):
        paths.append(folder / f"raw{k:02d}.dng")
        write_dng(paths[-1], raw_codes(rate, time, rng), (told_s or times_s)[k], black=BLACK, white=WHITE)
    return paths


def tone(linear: Floats) -> Floats:
    """A camera-like tone curve, [0, 1] to [0, 1]: sRGB with a gentle S on top."""
    x = np.clip(linear, 0.0, 1.0)
    srgb = np.where(x <= 0.0031308, 12.92 * x, 1.055 * np.maximum(x, 1e-9) ** (1 / 2.4) - 0.055)
    return np.asarray(np.clip(srgb + 0.2 * srgb * (1.0 - srgb) * np.sin(np.pi * srgb), 0.0, 1.0))


def picture_codes(rate: Floats, time_s: float, rng: np.random.Generator) -> NDArray[np.uint8]:
    """8-bit codes of signals (full scale 1) with a camera's noise."""
    signal = rate * time_s
    noisy = signal + rng.normal(0.0, 1.0, signal.shape) * np.sqrt(np.maximum(signal, 0.0) / 15_000.0 + 1e-8)
    return np.rint(255.0 * tone(noisy)).astype(np.uint8)


def picture_bracket(
    folder: Path, rate: Floats, times_s: tuple[float, ...] = LADDER, suffix: str = ".png", seed: int = 0
) -> list[Path]:
    """Write pictures of rates (H, W, 3) red, green, blue."""
    rng = np.random.default_rng(seed)
    paths = []
    for k, time in enumerate(times_s):
        paths.append(folder / f"picture{k:02d}{suffix}")
        codes = picture_codes(rate, time, rng)
        assert cv2.imwrite(str(paths[-1]), np.ascontiguousarray(codes[..., ::-1]), [cv2.IMWRITE_JPEG_QUALITY, 95])
    return paths
