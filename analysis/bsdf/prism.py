"""The prismatic lens: a clear sheet, flat on one side, with square pyramids on the other.

The sheet's frame: the flat side faces up (+z), the prisms hang down. As an entry lens of a skylight it lies like this;
as an exit lens (flat side to the room) the caller turns it over: (x, y, z) becomes (x, -y, -z) before and after.
Scattering is found by following rays through one cell of the periodic pattern: exact planes for perfect pyramids
(`analysis.bsdf.prism_trace`), height maps for rounded ones, dimples and scans (`analysis.bsdf.relief_trace`).
"""

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import Final, Literal

import numpy as np
from numpy.random import Generator
from numpy.typing import ArrayLike, NDArray

from analysis.bsdf.model import Incidence, Tracer
from analysis.bsdf.relief import ReliefSheet, dimple_map, pyramid_map, rounded
from labdaq.errors import ConfigError, Problems

Floats = NDArray[np.float64]
Side = Literal["flat", "prism"]

TURNED_OVER: Final = np.array([1.0, -1.0, -1.0])
"""From the sheet's frame (flat side up) to that of a BSDF (z from front to back), and back."""


@dataclass(frozen=True, kw_only=True)
class PrismSheet:
    """A prismatic sheet; the defaults are the acrylic lens of the three skylight systems.

    Attributes
    ----------
    index
        Refractive index.
    thickness_mm
        From the flat side to the peaks.
    pitch_mm
        Side of a pyramid's square base; pyramids stand side by side.
    slope_deg
        Angle between facets and the sheet.
    slope_error_deg
        Moulding imperfections: standard deviation of the facets' slope in each of two directions [deg].
    absorption_per_mm
        Of the material; light is multiplied by exp(-absorption * path).
    peak_radius_mm
        Rounds peaks and ridges to this radius; 0 leaves them sharp.
    valley_radius_mm
        Fillets of the valleys between pyramids; 0 leaves them sharp.
    dimple_radius_mm, dimple_depth_mm
        A spherical dimple in the flat side above each peak: radius of its rim and depth.
    orientation_deg
        Turns the base edges from x and y, counter-clockwise seen from above (+z).
    mirrored
        The mirror image in the plane x = 0: the orientation changes its sign.
    isotropic
        Every ray meets the sheet at a random orientation: what an isotropic description of the sheet would know.
    """

    index: float = 1.491
    thickness_mm: float = 3.0
    pitch_mm: float = 5.0
    slope_deg: float = 27.0
    slope_error_deg: float = 4.0
    absorption_per_mm: float = 0.03
    peak_radius_mm: float = 0.0
    valley_radius_mm: float = 0.0
    dimple_radius_mm: float = 0.0
    dimple_depth_mm: float = 0.0
    orientation_deg: float = 0.0
    mirrored: bool = False
    isotropic: bool = False

    def __post_init__(self) -> None:
        problems = Problems("prismatic sheet")
        if not 1.0 < self.index < 5.0:
            problems.add("index", f"must lie between 1 and 5, not {self.index:g}")
        if not self.pitch_mm > 0.0:
            problems.add("pitch_mm", f"must be positive, not {self.pitch_mm:g}")
        if not 0.0 <= self.slope_deg < 85.0:
            problems.add("slope_deg", f"must lie in [0, 85), not {self.slope_deg:g}")
        elif not self.thickness_mm > self.height_mm:
            problems.add(
                "thickness_mm", f"must exceed the pyramids' {self.height_mm:.3f} mm, not {self.thickness_mm:g}"
            )
        if not 0.0 <= self.slope_error_deg <= 20.0:
            problems.add("slope_error_deg", f"must lie in [0, 20], not {self.slope_error_deg:g}")
        if not self.absorption_per_mm >= 0.0:
            problems.add("absorption_per_mm", f"must not be negative, {self.absorption_per_mm:g} is")
        for name in ("peak_radius_mm", "valley_radius_mm"):
            if not 0.0 <= getattr(self, name) < self.pitch_mm / 2.0:
                problems.add(name, f"must lie in [0, pitch / 2), not {getattr(self, name):g}")
        if not 0.0 <= self.dimple_radius_mm <= self.pitch_mm / 2.0:
            problems.add("dimple_radius_mm", f"must lie in [0, pitch / 2], not {self.dimple_radius_mm:g}")
        if not 0.0 <= self.dimple_depth_mm <= self.dimple_radius_mm:
            problems.add("dimple_depth_mm", f"must lie in [0, dimple radius], not {self.dimple_depth_mm:g}")
        problems.raise_if_any(ConfigError)

    @property
    def perfect(self) -> bool:
        """Whether the pyramids have sharp edges and the flat side no dimples, so that planes describe the sheet."""
        return self.peak_radius_mm == self.valley_radius_mm == self.dimple_depth_mm == 0.0

    def relief(self, samples: int = 256) -> ReliefSheet:
        """The sheet as height maps of samples x samples; sharp edges are blunted by about one sample."""
        pyramid = pyramid_map(self.pitch_mm, self.slope_deg, samples)
        height = rounded(pyramid, self.pitch_mm, self.peak_radius_mm, self.valley_radius_mm)
        return ReliefSheet(
            index=self.index,
            absorption_per_mm=self.absorption_per_mm,
            slope_error_deg=self.slope_error_deg,
            pitch_mm=self.pitch_mm,
            prism_mm=self.thickness_mm - self.height_mm + height,
            flat_mm=dimple_map(self.pitch_mm, self.dimple_radius_mm, self.dimple_depth_mm, samples),
            orientation_deg=self.orientation_deg,
            mirrored=self.mirrored,
            isotropic=self.isotropic,
        )

    @property
    def height_mm(self) -> float:
        """Height of the pyramids [mm]."""
        return self.pitch_mm / 2.0 * math.tan(math.radians(self.slope_deg))

    def geometry(self) -> Floats:
        """The numbers `analysis.bsdf.prism_trace` works with."""
        slope = math.radians(self.slope_deg)
        turn = math.radians(-self.orientation_deg if self.mirrored else self.orientation_deg)
        return np.array(
            [
                self.index,
                self.absorption_per_mm,
                self.thickness_mm - self.height_mm,
                self.height_mm,
                self.pitch_mm / 2.0,
                math.sin(slope),
                math.cos(slope),
                math.tan(math.radians(self.slope_error_deg)),
                math.cos(turn),
                math.sin(turn),
                float(self.isotropic),
            ]
        )


def prism_tracer(sheet: PrismSheet | ReliefSheet) -> Tracer:
    """The sheet as a `Tracer` in the frame of a BSDF: the flat side is the front."""

    def trace(incidence: Incidence, travel: Floats, per_direction: int, rng: Generator) -> tuple[Floats, Floats]:
        side: Side = "flat" if incidence == "front" else "prism"
        out, weights = scatter_samples(sheet, side, travel * TURNED_OVER, per_direction, rng)
        return out * TURNED_OVER, weights

    return trace


def turned_over(tracer: Tracer) -> Tracer:
    """A sheet turned over about its x axis: front and back are exchanged."""

    def trace(incidence: Incidence, travel: Floats, per_direction: int, rng: Generator) -> tuple[Floats, Floats]:
        other: Incidence = "back" if incidence == "front" else "front"
        out, weights = tracer(other, travel * TURNED_OVER, per_direction, rng)
        return out * TURNED_OVER, weights

    return trace


@lru_cache(maxsize=16)
def _relief_of(sheet: PrismSheet) -> ReliefSheet:
    return sheet.relief()


def scatter_samples(
    sheet: PrismSheet | ReliefSheet, side: Side, directions: ArrayLike, per_direction: int, rng: Generator
) -> tuple[Floats, Floats]:
    """Where light goes that meets the sheet from given directions.

    Parameters
    ----------
    sheet
        The lens. Perfect pyramids are traced exactly, others through height maps.
    side
        The side the light arrives at: ``flat`` (travelling down, z < 0) or ``prism`` (travelling up, z > 0).
    directions : shape (n, 3)
        Unit vectors of travel in the sheet's frame; the sign of z is taken from ``side``.
    per_direction
        Number m of samples of each direction; every sample meets the sheet at a random place.
    rng
        Source of the seeds; the same state gives the same samples.

    Returns
    -------
    out_directions : shape (n, m, 3)
        Unit vectors of travel; transmitted where z has the sign of the incident z, reflected otherwise.
    weights : shape (n, m)
        Part of the light that was not absorbed on the way, 0 to 1. The sum of the weights of transmitted samples
        divided by m is the directional-hemispherical transmittance.
    """
    d = np.array(directions, dtype=np.float64).reshape(-1, 3)
    d[:, 2] = np.abs(d[:, 2]) * (-1.0 if side == "flat" else 1.0)
    out = np.empty((len(d), per_direction, 3))
    weights = np.empty((len(d), per_direction))
    seeds = rng.integers(0, 2**64, size=len(d), dtype=np.uint64)
    # numba is slow to import
    if isinstance(sheet, PrismSheet) and sheet.perfect:
        from analysis.bsdf.prism_trace import scatter_many

        scatter_many(d, per_direction, seeds, sheet.geometry(), out, weights)
    else:
        from analysis.bsdf.relief_trace import scatter_relief_many

        relief = _relief_of(sheet) if isinstance(sheet, PrismSheet) else sheet
        scatter_relief_many(d, per_direction, seeds, relief.prism_mm, relief.flat_mm, relief.geometry(), out, weights)
    return out, weights
