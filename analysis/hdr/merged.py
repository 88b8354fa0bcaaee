"""What goes into a merge and what comes out."""

from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from analysis.hdr.bracket import Crop
from analysis.hdr.noise import Noise
from analysis.hdr.response import Response

Plane = NDArray[np.float32]


@dataclass(frozen=True, slots=True)
class Exposure:
    """One exposure of a bracket.

    Attributes
    ----------
    path
        The picture.
    time_s
        Exposure time [s]; ``None`` for what the file tells.
    when_s
        Middle of the exposure on a clock that all exposures share [s]; ``None`` when unknown.
    """

    path: Path
    time_s: float | None = None
    when_s: float | None = None


@dataclass(frozen=True)
class Recipe:
    """How to merge.

    Attributes
    ----------
    response
        Of pictures; ``None`` recovers it from the bracket (8 bits), or takes 16 bits as linear.
    snap
        Replace times that are camera labels by the exact steps they stand for. ``None`` lets the exposures decide for
        times read from the files, and takes times given as they are.
    refine
        Refine the times from the exposures; ``None`` does so for raw files only (pictures mend errors of the response
        with the times).
    luminance_row
        Weights of red, green and blue; ``None`` takes the camera's matrix, or sRGB's row for pictures.
    noise
        Of one channel's signal; ``None`` learns it.
    crop
        Part of the pictures to merge.
    memory_mb
        About how much memory the decoded exposures may take [MB].
    keep_channels
        Keep red, green and blue of colour pictures beside luminance.
    """

    response: Response | None = None
    snap: bool | None = None
    refine: bool | None = None
    luminance_row: tuple[float, float, float] | None = None
    noise: Noise | None = None
    crop: Crop | None = None
    memory_mb: float = 1024.0
    keep_channels: bool = False


@dataclass(frozen=True, eq=False)
class Merged:
    """A merged picture, in signal per second: one factor away from luminance.

    Attributes
    ----------
    signal, variance : shape (H, W)
        Estimate, and its variance from noise; where ``flags`` says saturated, a lower bound and infinity.
    worth, mean_time : shape (H, W)
        How many equal exposures would tell as much, and the weighted middle of those used [s since the middle of the
        earliest exposure].
    flags : shape (H, W), uint8
        See `analysis.hdr.flags`.
    pixel_step
        Picture pixels across a merged pixel: 2 for a mosaic, whose cells are merged into one.
    channels : shape (3, H, W)
        Red, green and blue signal, if they were kept.
    response
        That was used for pictures.
    record
        What was decided and found; JSON-able.
    """

    signal: Plane
    variance: Plane
    worth: Plane
    mean_time: Plane
    flags: NDArray[np.uint8]
    pixel_step: int
    channels: Plane | None = None
    response: Response | None = None
    record: dict[str, Any] = field(default_factory=dict)

    def scaled(self, factor: float) -> "Merged":
        """The picture times ``factor``: luminance, when the factor is cd/m² per signal per second."""
        return replace(
            self,
            signal=self.signal * np.float32(factor),
            variance=self.variance * np.float32(factor**2),
            channels=None if self.channels is None else self.channels * np.float32(factor),
            record={**self.record, "scale": factor},
        )
