"""The frame of a sheet of the cover, and the way back from it."""

import math

import numpy as np

from analysis.simulate.kernels.arrays import Frame
from analysis.simulate.kernels.jit import jit

Turned = tuple[float, float, float, bool, float, np.uint64]
"""Direction after a lens, whether it passed, its weight, and the random state."""


@jit
def frame_of(nx: float, ny: float, nz: float) -> Frame:
    """The sheet's x axis (the world's x laid onto it) and y axis, for an outward normal with nz > 0."""
    k = 1.0 / math.sqrt(max(1e-12, 1.0 - nx * nx))
    ex, ey, ez = (1.0 - nx * nx) * k, -nx * ny * k, -nx * nz * k
    return Frame(ex, ey, ez, ny * ez - nz * ey, nz * ex - nx * ez, nx * ey - ny * ex, nx, ny, nz)


@jit
def inward(f: Frame, ox: float, oy: float, oz: float) -> tuple[float, float, float]:
    """From the sheet's frame to the skylight's."""
    x = ox * f.ex + oy * f.fx + oz * f.nx
    y = ox * f.ey + oy * f.fy + oz * f.ny
    return x, y, ox * f.ez + oy * f.fz + oz * f.nz
