"""Scatter tables of prismatic sheets: made once per lens, then one memory access per pass.

For directions of incidence on a grid over the hemisphere (Shirley & Chiu's square, equal solid angles) a table keeps
many traced outgoing directions as *differences of direction cosines*. A clear sheet is exact in such a table
(all differences are 0), and peaks keep their width, because a ray adds the difference to its own direction. A sheet
with the symmetry of a square needs an eighth of the grid; the tracer folds a direction into it.
"""

import dataclasses
import functools
import math
import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from numpy.typing import NDArray

from analysis.simulate.components import Lens
from analysis.simulate.store import code_digest, kept
from labdaq.errors import DataError

if TYPE_CHECKING:
    from analysis.bsdf.prism import PrismSheet

Floats = NDArray[np.float64]
Table = NDArray[np.int16]
Sampler = Callable[[Lens, bool, Floats, int, np.random.Generator], tuple[Floats, Floats]]

HALF: Final = 48
"""Grid steps from the middle of the square to its edge; a step is about 1.7 degrees."""

SAMPLES: Final = 8192
"""Outgoing directions kept per direction of incidence for light that meets the prisms.

Light that meets the flat face gets a quarter: only a whole sky enters by that table, and it averages over all rows.
"""

PARTS: Final = 8
"""A table comes in so many parts of equally many samples, one for each batch of the tracer."""

LEAST: Final = 32 * PARTS
"""Samples of a row that leave each part the 32 neighbours which are scored at once (`Settings.split`)."""

RING_STEPS: Final = 48
"""Steps of azimuth, from 0 to 45 degrees, in a table of one angle of incidence."""

DELTA_UNITS: Final = 16000.0
WEIGHT_UNITS: Final = 32000.0
"""Of weight 1, where no weight exceeds 1; see `analysis.simulate.lens_file` for files that send on more."""

_MOST: Final = 32767

OPTICAL: Final = ("refractive_index", "thickness_mm", "absorption_per_mm", "pitch_mm", "slope_deg", "blur_deg")
"""What a prismatic sheet does to light follows from these."""

_VERSION: Final = 1


@dataclass(frozen=True)
class LensTables:
    """Scatter of a sheet for light that meets its flat face and for light that meets its prisms.

    Attributes
    ----------
    flat, prisms : shape (PARTS, directions, samples / PARTS, 3), int16
        Differences of the two tangential direction cosines (in 1/16000) and weight (in 1/32000; negative: reflected).
    half
        Steps of the grid from middle to edge.
    """

    flat: Table
    prisms: Table
    half: int


def nodes(half: int) -> Floats:
    """Directions of incidence (N, 3), pointing down (z < 0), in the order of the table's rows.

    Row i (i + 1) / 2 + j is place u = i / half, v = j / half (0 <= v <= u) of the folded square. Grazing incidence,
    where nothing would pass and differences are undefined, is taken at 89.4 degrees.
    """
    i, j = np.tril_indices(half + 1)
    rho = i / half
    phi = 0.25 * math.pi * np.divide(j, i, out=np.zeros(len(i)), where=i > 0)
    cosine = np.maximum(1.0 - rho**2, 0.01)
    sine = np.sqrt(1.0 - cosine**2)
    return np.stack([sine * np.cos(phi), sine * np.sin(phi), -cosine], axis=-1)


def traced_samples(
    lens: Lens, from_prisms: bool, directions: Floats, per_direction: int, rng: np.random.Generator
) -> tuple[Floats, Floats]:
    """Trace the sheet's micro-geometry: outgoing directions (N, M, 3) and weights (N, M)."""
    from analysis.bsdf.prism import scatter_samples

    return scatter_samples(sheet_of(lens), "prism" if from_prisms else "flat", directions, per_direction, rng)


def sheet_of(lens: Lens) -> "PrismSheet":
    """A prismatic lens as the sheet that is traced; orientation, mirroring, isotropy, haze and dirt come on top."""
    from analysis.bsdf.prism import PrismSheet

    return PrismSheet(
        index=lens.refractive_index,
        thickness_mm=lens.thickness_mm,
        pitch_mm=lens.pitch_mm,
        slope_deg=lens.slope_deg,
        slope_error_deg=lens.blur_deg,
        absorption_per_mm=lens.absorption_per_mm,
    )


def tables(lens: Lens, samples: int = SAMPLES, half: int = HALF, sampler: Sampler | None = None) -> LensTables:
    """The scatter tables of a prismatic sheet; from memory, from disk, or traced now (some seconds, once).

    Only the sheet's optics count: orientation, mirroring, isotropy, haze and soiling belong to the tracer.
    """
    optics = dataclasses.replace(Lens(), **{name: getattr(lens, name) for name in OPTICAL})
    return _tables(optics, samples, half, sampler or traced_samples)


@functools.lru_cache(maxsize=16)
def _tables(lens: Lens, samples: int, half: int, sampler: Sampler) -> LensTables:
    recipe: dict[str, Any] = {name: getattr(lens, name) for name in OPTICAL}
    recipe |= {
        "samples": samples,
        "half": half,
        "code": code_digest("analysis/bsdf"),
        "version": _VERSION,
        "sampler": f"{sampler.__module__}.{sampler.__qualname__}",
    }

    def make() -> dict[str, NDArray[Any]]:
        return {
            "flat": _one_side(lens, False, max(samples // 4, LEAST), half, sampler),
            "prisms": _one_side(lens, True, max(samples, LEAST), half, sampler),
        }

    stored = kept("lenses", recipe, make)
    return LensTables(in_parts(stored["flat"]), in_parts(stored["prisms"]), half)


def in_parts(table: Table) -> Table:
    """A table (rows, samples, 3) as (PARTS, rows, samples / PARTS, 3): what one batch reads lies close together."""
    rows, samples, _ = table.shape
    use = samples - samples % PARTS
    return np.ascontiguousarray(table[:, :use].reshape(rows, PARTS, use // PARTS, 3).swapaxes(0, 1))


def piece_of(table: Table, number: int, pieces: int, together: int) -> Table:
    """One of several pieces of a table (rows, samples, 3), for rays that read ``together`` neighbours of a row at once.

    A run of neighbours starts in one piece only, so pieces overlap by ``together - 1`` samples, and rays spread evenly
    over the pieces read the whole table as evenly as before; rays that read fewer at once meet samples of overlaps more
    often. A table with fewer starts than pieces is returned whole.
    """
    starts = table.shape[1] - together + 1
    if starts < pieces:
        return table
    first, after = starts * number // pieces, starts * (number + 1) // pieces
    return np.ascontiguousarray(table[:, first : after + together - 1])


def sun_table(
    lens: Lens, spots: Floats, samples: int, sampler: Sampler | None = None, units: float = WEIGHT_UNITS
) -> Table:
    """Scatter of a lens for light of a few directions, shape (n, samples, 3); turned, mirrored, or isotropic as it is.

    ``spots`` (n, 3): directions of travel in the sheet's frame, z up; rows with z >= 0 meet no light and are skipped.
    ``units``: of weight 1. The last few tables are remembered.
    """
    return _sun_table(lens, tuple(map(tuple, spots.tolist())), samples, sampler or traced_samples, units)


@functools.lru_cache(maxsize=64)
def _sun_table(lens: Lens, spots: tuple[tuple[float, ...], ...], samples: int, sampler: Sampler, units: float) -> Table:
    samples = max(samples, LEAST)
    rng = np.random.default_rng([_VERSION, 7, samples])
    table = np.full((len(spots), samples, 3), -1, dtype=np.int16)
    turn = math.radians(lens.orientation_deg)
    flip = np.array([-1.0 if lens.mirrored else 1.0, 1.0, 1.0])
    from_prisms = lens.prisms == "up"
    z = np.array([1.0, 1.0, -1.0 if from_prisms else 1.0])
    for row, spot in enumerate(np.array(spots)):
        if spot[2] >= 0.0:
            continue
        angle = 2.0 * math.pi * (np.arange(samples) + 0.5) / samples if lens.isotropic else np.array([turn])
        sent = _turned(np.broadcast_to(spot * flip, (len(angle), 3)), -angle) * z
        per = 1 if lens.isotropic else samples
        out, weight = sampler(lens, from_prisms, np.ascontiguousarray(sent), per, rng)
        back = _turned(out.reshape(samples, 3) * z, angle) * flip
        order = rng.permutation(samples)
        table[row] = packed(back, spot, weight.reshape(samples), units)[order]
    return table


def ring_table(lens: Lens, cosine: float, samples: int, sampler: Sampler | None = None) -> tuple[Floats, Table]:
    """Scatter at one angle of incidence from above: directions of travel (n, 3), azimuths 0 to 45 degrees, and table.

    The table has the form of `in_parts`, in the pattern's frame; orientation, mirroring and isotropy belong to the
    tracer, as with `tables`. The last few are remembered.
    """
    optics = dataclasses.replace(Lens(), prisms=lens.prisms, **{name: getattr(lens, name) for name in OPTICAL})
    return _ring_table(optics, cosine, samples, sampler or traced_samples)


@functools.lru_cache(maxsize=64)
def _ring_table(lens: Lens, cosine: float, samples: int, sampler: Sampler) -> tuple[Floats, Table]:
    azimuth = 0.25 * math.pi * np.arange(RING_STEPS + 1) / RING_STEPS
    sine = math.sqrt(1.0 - cosine**2)
    spots = np.stack([sine * np.cos(azimuth), sine * np.sin(azimuth), np.full(len(azimuth), -cosine)], axis=1)
    from_prisms = lens.prisms == "up"
    return spots, in_parts(_traced(lens, from_prisms, spots, samples, 11, sampler))


@functools.lru_cache(maxsize=1)
def half_lobe(samples: int = 1 << 14) -> Table:
    """The lower half (y <= 0) of a Lambertian lobe: points uniform on half a disc (Nusselt), as a table of one row.

    Consecutive points are evenly spread (additive recurrence with powers of the plastic number, Roberts 2018).
    """
    plastic = 1.32471795724474602596
    k = np.arange(samples)
    radius = np.sqrt((0.5 + k / plastic) % 1.0) * 0.99999
    angle = math.pi * ((0.5 + k / plastic**2) % 1.0)
    x, y = radius * np.cos(angle), -radius * np.sin(angle)
    return np.stack([np.rint(x * DELTA_UNITS), np.rint(y * DELTA_UNITS), np.full(samples, WEIGHT_UNITS)], axis=1)[
        None
    ].astype(np.int16)


def _turned(vectors: Floats, angle: Floats) -> Floats:
    c, s = np.cos(angle), np.sin(angle)
    return np.stack(
        [c * vectors[:, 0] - s * vectors[:, 1], s * vectors[:, 0] + c * vectors[:, 1], vectors[:, 2]], axis=1
    )


def packed(out: Floats, sent: Floats, weight: Floats, units: float = WEIGHT_UNITS) -> Table:
    """Entries of a table: differences of tangential cosines, and the weight, negative where light is reflected.

    ``out`` (..., 3) for light sent along ``sent``, which broadcasts; ``units``: of weight 1. Raises `DataError` for a
    weight that the table cannot hold.
    """
    entries = np.empty(out.shape, dtype=np.int16)
    through = (out[..., 2] * sent[..., 2] > 0.0) & (weight > 0.0)
    difference = (out[..., :2] - sent[..., :2]) * DELTA_UNITS
    entries[..., :2] = np.rint(np.clip(difference, -32767, 32767))
    # weight 0 (absorbed) is kept as the smallest reflected weight: nothing passes
    count = np.maximum(1.0, np.rint(weight * units))
    if not (count <= _MOST).all():  # also for what is no number
        much, most = float(weight.max()), _MOST / units
        raise DataError(f"a lens sends on {much:.4g} times the light of a direction; its table holds 0 to {most:.4g}")
    entries[..., 2] = np.where(through, count, -count)
    return entries


def _one_side(lens: Lens, from_prisms: bool, samples: int, half: int, sampler: Sampler) -> Table:
    """All rows of one table."""
    return _traced(lens, from_prisms, nodes(half), samples, int(from_prisms), sampler)


def _traced(lens: Lens, from_prisms: bool, down: Floats, samples: int, stream: int, sampler: Sampler) -> Table:
    """Trace rows of a table; pieces have random numbers of their own, so threads do not matter."""
    sent = np.ascontiguousarray(down * np.array([1.0, 1.0, -1.0])) if from_prisms else down
    table = np.empty((len(down), samples, 3), dtype=np.int16)
    step = max(1, 400_000 // samples)

    def piece(first: int) -> None:
        rng = np.random.default_rng([_VERSION, stream, samples, first])
        rows = slice(first, first + step)
        out, weight = sampler(lens, from_prisms, sent[rows], samples, rng)
        table[rows] = packed(out, sent[rows, None, :], weight)

    with ThreadPoolExecutor(len(os.sched_getaffinity(0))) as pool:
        list(pool.map(piece, range(0, len(down), step)))
    return table
