"""Lenses that add a difference of direction cosines to whatever light they send on.

A thin sheet of facets, a grating or a slightly rough surface moves the tangential direction cosines of light by an
amount that hardly depends on where the light comes from. A lens that is known no better than by its images can be
described so: by how much of the light has each difference.
"""

import dataclasses
import functools
import math
from typing import Final

import numpy as np
from numpy.typing import NDArray

from analysis.simulate.components import Lens
from analysis.simulate.kernels.jit import as_python
from analysis.simulate.kernels.optics import slab
from analysis.simulate.lens import LEAST, Table, in_parts, packed
from analysis.simulate.lens_file import wide_nodes

Floats = NDArray[np.float64]

REACH: Final = 1.6
"""Differences are told from minus to plus so much in x and in y."""
SIDE: Final = 81
"""Cells along each side of the square of differences."""
SHIFT_HALF: Final = 8
"""Grid steps from the middle of the square of incidences to its edge: where light keeps all its direction cosines, rows
differ by their transmittance alone."""
_GRAZING: Final = 0.998
_STREAM: Final = 17
_OPTICAL: Final = (
    "shifts",
    "kept",
    "stretch",
    "stretch_axis_deg",
    "refractive_index",
    "thickness_mm",
    "absorption_per_mm",
)


def cells() -> Floats:
    """Middles (SIDE,) of the cells of differences, along x or y."""
    return np.linspace(-REACH, REACH, SIDE)


def shift_samples(
    lens: Lens, from_prisms: bool, directions: Floats, per_direction: int, rng: np.random.Generator
) -> tuple[Floats, Floats]:
    """Outgoing directions (N, M, 3) and weights (N, M) of light of directions (N, 3); both faces alike.

    What would leave beyond grazing is lost, and so is what a clear slab would reflect.
    """
    shape = (len(directions), per_direction)
    moved = lens.kept * directions[:, None, :2] + _stretched(lens, _drawn(lens.shifts, shape, rng))
    square = np.sum(moved**2, axis=-1)
    leaves = square < _GRAZING
    out = np.zeros((*shape, 3))
    out[..., :2] = np.where(leaves[..., None], moved, 0.0)
    side = np.sign(directions[:, 2])[:, None]
    out[..., 2] = side * np.sqrt(np.where(leaves, 1.0 - square, 1.0))
    depth = lens.absorption_per_mm * lens.thickness_mm
    through = as_python(slab)
    clear = np.array([through(max(abs(float(z)), 0.02), lens.refractive_index, depth)[0] for z in directions[:, 2]])
    return out, np.where(leaves, clear[:, None], 0.0)


def _drawn(shifts: tuple[float, ...], shape: tuple[int, int], rng: np.random.Generator) -> Floats:
    """Differences (N, M, 2), evenly spread over the density and in no order."""
    rows, each = shape if shape[1] > 1 else (1, shape[0])
    places = (np.arange(each) + rng.random((rows, each))) / each
    share = np.cumsum(shifts)
    cell = np.minimum(np.searchsorted(share, places * share[-1]), len(shifts) - 1)  # in order: found sooner
    cell = rng.permuted(cell, axis=1).reshape(shape)
    side = math.isqrt(len(shifts))
    step = 2.0 * REACH / (side - 1)
    inside = rng.random((*shape, 2)) - 0.5
    return np.asarray((np.stack(np.divmod(cell, side), axis=-1) + inside) * step - REACH)


def _stretched(lens: Lens, changes: Floats) -> Floats:
    """Changes (..., 2) of direction cosines as a stretched lens has them."""
    if lens.stretch == 0.0:
        return changes
    axis = math.radians(lens.stretch_axis_deg)
    along = np.array([math.cos(axis), math.sin(axis)])
    across = np.array([-along[1], along[0]])
    longer = 1.0 + lens.stretch
    return np.asarray(changes @ (longer * np.outer(along, along) + np.outer(across, across) / longer))


def shift_tables(lens: Lens, samples: int, half: int) -> tuple[Table, Table]:
    """Scatter tables for light from above and for light from below, in parts, on `wide_nodes` of ``half``.

    They are one, as both faces do the same to direction cosines. Orientation, mirroring, isotropy, haze and soiling
    belong to the tracer; the last few tables are remembered.
    """
    optics = {name: getattr(lens, name) for name in _OPTICAL}
    table = _table(dataclasses.replace(Lens(), kind="shift", **optics), samples, half)
    return table, table


@functools.lru_cache(maxsize=8)
def _table(lens: Lens, samples: int, half: int) -> Table:
    count = max(samples if half == SHIFT_HALF else samples // 16, LEAST)
    sent = wide_nodes(half)
    out, weight = shift_samples(lens, False, sent, count, np.random.default_rng([_STREAM, count, half]))
    return in_parts(packed(out, sent[:, None, :], weight))
