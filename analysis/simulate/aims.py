"""What the kernels need to score light in wanted directions, and for which skylights that is possible."""

import math
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from analysis.simulate.components import Lens
from analysis.simulate.kernels import arrays as k
from analysis.simulate.lens import Sampler, sheet_of
from analysis.simulate.system import System
from labdaq.directions import vector

Floats = NDArray[np.float64]

LEAST_BLUR_DEG: Final = 0.5
"""Prisms with less blur send light in peaks that no estimate of a density resolves."""

_NO_SHEET: Final = np.zeros(0)


def aims(system: System, gamma_deg: Floats, c_deg: Floats, distances_m: Floats) -> k.Aims:
    """Room and arrays for scoring in directions (each of shape (n,)); distance 0 means the far field."""
    turn = math.radians(system.rotation_deg)
    x, y, z = vector(gamma_deg, c_deg).T
    where = np.stack(
        [math.cos(turn) * x + math.sin(turn) * y, math.cos(turn) * y - math.sin(turn) * x, z, distances_m]
    ).astype(np.float32)
    count = where.shape[1]
    return k.Aims(
        on=True,
        back=False,
        where=where,
        entry=_sheet(system.entry),
        exit=_sheet(system.exit),
        entry_up=system.entry.prisms == "up",
        exit_up=system.exit.prisms == "up",
        wanted=np.zeros((4, count), dtype=np.float32),
        reach=np.zeros(count, dtype=np.float32),
        found=np.zeros(count),
        state=np.zeros(1, dtype=np.uint64),
    )


def own(shared: k.Aims) -> k.Aims:
    """The same directions with sums and random numbers that no other batch writes to."""
    fresh: dict[str, Any] = {name: np.zeros_like(getattr(shared, name)) for name in ("wanted", "reach", "found")}
    return shared._replace(state=np.zeros(1, dtype=np.uint64), **fresh)


def can_be_aimed(system: System, sampler: Sampler | None = None) -> bool:
    """Whether what scatters light last has a density: a blurred prismatic or diffusing sheet, or Lambertian walls.

    Without an exit lens the cover must be a prismatic sheet with its prisms down, and without haze.
    """
    if sampler is not None:
        return False
    if system.exit.kind in ("prismatic", "diffusing"):
        return _blurred(system.exit)
    walls = [system.wall, system.boot] if system.boot_height_m > 0.0 else [system.wall]
    return (
        system.exit.kind == "none"
        and all(wall.lambertian == 1.0 for wall in walls)
        and system.entry.kind == "prismatic"
        and system.entry.prisms == "down"
        and system.entry.haze == 0.0
        and _blurred(system.entry)
    )


def can_be_followed_back(system: System, sampler: Sampler | None = None) -> bool:
    """Whether light passes as well backwards: our own sheets without haze under an open sky, no foreign samplers."""
    lenses = (system.entry, system.exit)
    own = all(lens.kind not in ("bsdf", "shift") and lens.haze == 0.0 for lens in lenses)
    return own and sampler is None and not system.obstructions


def _blurred(lens: Lens) -> bool:
    return lens.kind != "prismatic" or lens.blur_deg >= LEAST_BLUR_DEG


def _sheet(lens: Lens) -> Floats:
    return sheet_of(lens).geometry() if lens.kind == "prismatic" else _NO_SHEET


NO_AIMS: Final = k.Aims(
    on=False,
    back=False,
    where=np.zeros((4, 0), dtype=np.float32),
    entry=_NO_SHEET,
    exit=_NO_SHEET,
    entry_up=False,
    exit_up=False,
    wanted=np.zeros((4, 0), dtype=np.float32),
    reach=np.zeros(0, dtype=np.float32),
    found=np.zeros(0),
    state=np.zeros(1, dtype=np.uint64),
)
"""For runs that count."""
