"""A 12-bit linear sensor: photons, noise, black level, clipping.

Exposure follows ISO 12232:2019: the saturation-based sensitivity is S = 78 / H with H [lx s] in the focal plane at
saturation, and H = 0.65 L t / N². So a luminance of 78 N² / (0.65 S t) just saturates.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Words = NDArray[np.uint16]


@dataclass(frozen=True, slots=True)
class Sensor:
    """An RGGB sensor.

    Attributes
    ----------
    black, white
        Digital numbers without light, and at saturation.
    full_well
        Electrons at saturation at ISO 100; at higher ISO saturation comes with fewer.
    read_noise
        Standard deviation of the noise without light [electrons].
    """

    black: int = 64
    white: int = 4095
    full_well: float = 9000.0
    read_noise: float = 5.0

    def expose(
        self, luminance: Floats, seconds: float, f_number: float, iso: float, noise: np.random.Generator
    ) -> Words:
        """Digital numbers of a picture of luminances [cd/m²] of any shape."""
        well = self.full_well * 100.0 / iso
        saturating = saturation_luminance(seconds, f_number, iso)
        electrons = np.minimum(luminance * (well / saturating), 4.0 * well).astype(np.float32)
        scatter = noise.standard_normal(luminance.shape, dtype=np.float32)
        scatter *= np.sqrt(electrons + np.float32(self.read_noise**2))
        electrons += scatter
        electrons *= np.float32((self.white - self.black) / well)
        electrons += np.float32(self.black + 0.5)  # conversion to integers truncates
        exposed: Words = np.clip(electrons, 0, self.white, out=electrons).astype(np.uint16)
        return exposed


def saturation_luminance(seconds: float, f_number: float, iso: float) -> float:
    """Luminance that just saturates the sensor [cd/m²]."""
    return 78.0 * f_number**2 / (0.65 * iso * seconds)
