"""Lenses that are densities of shifts: where a system has them, and what may be done to one.

Its mean over all turns, a pattern of four, a stretch.
"""

from typing import Final

import numpy as np
from scipy.ndimage import map_coordinates

from analysis.cases.model import Floats
from analysis.simulate.components import Lens
from analysis.simulate.lens_shift import SIDE, cells
from analysis.simulate.system import System

STRETCH_OF: Final = "stretch"
"""The parameter that tells how far a lens is stretched."""
STRETCH: Final = 0.25
"""By so much further along an axis, and less far across it, light is sent in what is traced of a stretch."""
_STEP: Final = float(cells()[1] - cells()[0])
_X, _Y = np.meshgrid(cells(), cells(), indexing="ij")
_RING: Final = np.rint(np.hypot(_X, _Y) / _STEP).astype(np.intp)


def densities(system: System) -> list[str]:
    """Where a system has lenses that are densities of shifts."""
    return [place for place in ("entry", "exit") if getattr(system, place).kind == "shift"]


def even(shifts: tuple[float, ...]) -> Floats:
    """The density (SIDE, SIDE) that has on each ring the mean of what one has there."""
    mean = np.bincount(_RING.ravel(), shifts) / np.maximum(np.bincount(_RING.ravel()), 1)
    return np.asarray(mean[_RING])


def seen_by(lens: Lens) -> tuple[float, ...]:
    """The density of a lens's shifts, whether its pattern is turned at random or not."""
    return tuple(even(lens.shifts).ravel().tolist()) if lens.isotropic else lens.shifts


def fourfold(shifts: tuple[float, ...]) -> tuple[float, ...]:
    """A density that has, on each ring, what one has there, most of it along the axes."""
    return tuple((even(shifts) * (1.0 + np.cos(4.0 * np.arctan2(_Y, _X)))).ravel().tolist())


def stretched(shifts: tuple[float, ...], axis_deg: float) -> tuple[float, ...]:
    """A density whose shifts are longer by `STRETCH` along an axis, from east to north, and shorter across it."""
    c, s = np.cos(np.radians(axis_deg)), np.sin(np.radians(axis_deg))
    along, across = (c * _X + s * _Y) / (1.0 + STRETCH), (c * _Y - s * _X) * (1.0 + STRETCH)
    at = np.stack([c * along - s * across, s * along + c * across]) / _STEP + 0.5 * (SIDE - 1)
    made = map_coordinates(np.reshape(shifts, (SIDE, SIDE)), at, order=1)
    return tuple(np.maximum(made, 0.0).ravel().tolist())
