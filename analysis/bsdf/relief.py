"""The relief of a prismatic sheet as height maps: rounded pyramids, fillets, dimples, or a scan.

A moulded lens has no sharp edges. Peaks and ridges are rounded as far as a ball fits into the material (opening),
valleys are filled as far as a ball fits into the air (closing; J. Serra, Image Analysis and Mathematical Morphology,
1982, grey scale operations); dimples are spherical caps pressed into the flat side at the middle of each cell, as
injection points leave them. A map covers one cell and repeats.
"""

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from labdaq.errors import ConfigError, Problems

Floats = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class ReliefSheet:
    """A sheet given by height maps of one square cell.

    Attributes
    ----------
    index, absorption_per_mm, slope_error_deg, orientation_deg, mirrored, isotropic
        As in `analysis.bsdf.prism.PrismSheet`.
    pitch_mm
        Side of the cell.
    prism_mm : shape (n, n)
        Distance of the prism side from the plane of the flat side, by (x, y) in the sheet's frame; samples lie in the
        middle of n x n squares.
    flat_mm : shape (n, n)
        Depth of the flat side below its plane (dimples), not negative.
    """

    index: float
    absorption_per_mm: float
    slope_error_deg: float
    pitch_mm: float
    prism_mm: Floats
    flat_mm: Floats
    orientation_deg: float = 0.0
    mirrored: bool = False
    isotropic: bool = False

    def __post_init__(self) -> None:
        problems = Problems("relief")
        n = self.prism_mm.shape[0]
        if self.prism_mm.shape != (n, n) or self.flat_mm.shape != (n, n) or n < 4:
            problems.add("maps", f"must be square and alike, not {self.prism_mm.shape} and {self.flat_mm.shape}")
        elif not (np.isfinite(self.prism_mm).all() and np.isfinite(self.flat_mm).all()):
            problems.add("maps", "a height is not finite")
        elif self.flat_mm.min() < 0 or self.prism_mm.min() <= self.flat_mm.max():
            problems.add(
                "maps", "the prism side must lie below the flat side everywhere, and dimples must not stand up"
            )
        if not self.pitch_mm > 0:
            problems.add("pitch_mm", f"must be positive, not {self.pitch_mm:g}")
        problems.raise_if_any(ConfigError)

    @cached_property
    def steepness(self) -> tuple[float, float]:
        """Largest slope of the prism and of the flat side: bounds for the step of the ray tracer."""
        step = self.pitch_mm / len(self.prism_mm)
        return _steepest(self.prism_mm, step), _steepest(self.flat_mm, step)

    def geometry(self) -> Floats:
        """The numbers `analysis.bsdf.relief_trace` works with."""
        turn = math.radians(-self.orientation_deg if self.mirrored else self.orientation_deg)
        return np.array(
            [
                self.index,
                self.absorption_per_mm,
                self.pitch_mm,
                float(self.prism_mm.max()),
                self.steepness[0],
                self.steepness[1],
                math.tan(math.radians(self.slope_error_deg)),
                math.cos(turn),
                math.sin(turn),
                float(self.isotropic),
            ]
        )


def pyramid_map(pitch_mm: float, slope_deg: float, n: int) -> Floats:
    """Height of a square pyramid above its base [mm] over one cell, shape (n, n)."""
    axis = np.abs((np.arange(n) + 0.5) / n - 0.5) * pitch_mm
    return (pitch_mm / 2.0 - np.maximum(axis[:, None], axis)) * math.tan(math.radians(slope_deg))


def rounded(height_mm: Floats, pitch_mm: float, peak_radius_mm: float, valley_radius_mm: float) -> Floats:
    """A periodic relief with its convex edges rounded to one radius and its concave ones filled to another."""
    from scipy.ndimage import grey_dilation, grey_erosion  # slow to import

    for radius, first, second in (
        (peak_radius_mm, grey_erosion, grey_dilation),
        (valley_radius_mm, grey_dilation, grey_erosion),
    ):
        if radius > 0.0:
            step = pitch_mm / len(height_mm)
            ball, footprint = _ball(radius, step, _steepest(height_mm, step))
            options = {"footprint": footprint, "structure": ball, "mode": "wrap"}
            height_mm = second(first(height_mm, **options), **options)
    return height_mm


def _steepest(height_mm: Floats, step_mm: float) -> float:
    """Bound of the slope of a periodic map."""
    x, y = (np.abs(np.roll(height_mm, 1, axis) - height_mm).max() / step_mm for axis in (0, 1))
    return math.hypot(x, y)


def _ball(radius_mm: float, step_mm: float, steepest: float) -> tuple[Floats, NDArray[np.bool_]]:
    """Top of a ball on a grid, its highest point at 0 [mm], and where it is.

    Only as far as the ball is no steeper than the relief: beyond, they cannot touch.
    """
    touching = radius_mm * math.sin(math.atan(steepest)) + step_mm
    reach = int(min(radius_mm, touching) / step_mm)
    axis = np.arange(-reach, reach + 1) * step_mm
    square = axis[:, None] ** 2 + axis**2
    inside = square <= min(radius_mm, touching) ** 2
    return np.where(inside, np.sqrt(np.maximum(0.0, radius_mm**2 - square)) - radius_mm, 0.0), inside


def dimple_map(pitch_mm: float, radius_mm: float, depth_mm: float, n: int) -> Floats:
    """Depth of a spherical cap in the middle of a cell [mm], shape (n, n); ``radius_mm`` is that of its rim."""
    if depth_mm <= 0.0 or radius_mm <= 0.0:
        return np.zeros((n, n))
    sphere = (radius_mm**2 + depth_mm**2) / (2.0 * depth_mm)
    axis = ((np.arange(n) + 0.5) / n - 0.5) * pitch_mm
    square = axis[:, None] ** 2 + axis**2
    cap: Floats = np.sqrt(np.maximum(0.0, sphere**2 - square)) - (sphere - depth_mm)
    return np.where(square < radius_mm**2, np.maximum(0.0, cap), 0.0)
