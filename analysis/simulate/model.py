"""A `System` as the arrays that the kernels read."""

import functools
import math
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from analysis.simulate.components import Lens, Wall
from analysis.simulate.kernels import arrays as k
from analysis.simulate.lens import (
    HALF,
    PARTS,
    WEIGHT_UNITS,
    Sampler,
    Table,
    half_lobe,
    in_parts,
    nodes,
    ring_table,
    sun_table,
    tables,
)
from analysis.simulate.lens_file import WIDE_HALF, file_sampler, file_tables, weight_units, wide_nodes
from analysis.simulate.lens_shift import SHIFT_HALF, shift_samples, shift_tables
from analysis.simulate.obstruction import rows
from analysis.simulate.system import System

Floats = NDArray[np.float64]

LEAST_RING: Final = 512
MOST_RING: Final = 65_536
"""Samples at each azimuth of a ring."""

_WIDE: Final = ("bsdf", "shift")
"""Kinds of lenses whose tables have no symmetry."""
_KINDS: Final = {"none": k.NONE, "clear": k.CLEAR, "diffusing": k.DIFFUSING} | dict.fromkeys(
    ("prismatic", *_WIDE), k.TABLE
)


def skylight(
    system: System, samples: int, sampler: Sampler | None = None, *, prismatic_tables: bool = True
) -> k.Skylight:
    """A system's arrays, with all parts of its scatter tables, which are made or read where lenses need them.

    Without ``prismatic_tables`` only lenses of files have tables: prismatic sheets are then traced at each hit.
    """

    def scatter(lens: Lens) -> tuple[Table, Table]:
        if lens.kind == "prismatic" and not prismatic_tables:
            return _no_table(), _no_table()
        return _lens_tables(lens, samples, sampler, half)

    half = wide_half(system)
    above, below = scatter(system.entry)
    under, _ = scatter(system.exit)
    return k.Skylight(
        geometry=geometry(system),
        facets=facets(system),
        well=_wall(system.wall),
        boot=_wall(system.boot),
        entry=_lens(system.entry, half),
        exit=_lens(system.exit, half),
        above=above,
        below=below,
        under=under,
        nodes=np.ascontiguousarray(nodes(HALF)[:, :2]),
        wide=np.ascontiguousarray(wide_nodes(half)[:, :2]),
        exact=False,
        spots=np.zeros((1, 2)),
        ring=_no_table(),
        ring_nodes=np.zeros((1, 2)),
        ring_cosine=2.0,
        lobe=half_lobe(),
        powers=np.array([[system.wall.reflectance], [system.boot.reflectance]]) ** np.arange(64.0),
        obstructions=obstructions(system),
    )


def for_sun(
    ready: k.Skylight, system: System, towards: Floats, samples: int, sampler: Sampler | None = None
) -> k.Skylight:
    """The same skylight with entry tables made for one sun: no interpolation between directions of incidence.

    ``towards``: unit vector (3,) to the sun in the site's frame.
    """
    turn = math.radians(system.rotation_deg)
    c, s = math.cos(turn), math.sin(turn)
    travel = -np.array([c * towards[0] + s * towards[1], c * towards[1] - s * towards[0], towards[2]])
    normals = ready.facets[:, :3] if ready.geometry[k.COVER] == k.PYRAMID else np.array([[0.0, 0.0, 1.0]])
    spots = np.array([_on_facet(travel, normal) for normal in normals])
    units = WEIGHT_UNITS
    if system.entry.kind == "bsdf":
        sampler, units = file_sampler(system.entry), weight_units(system.entry)
    if system.entry.kind == "shift":
        sampler = shift_samples
    table = sun_table(system.entry, spots, samples, sampler, units)
    return ready._replace(above=in_parts(table), exact=True, spots=np.ascontiguousarray(spots[:, :2]))


def with_ring(
    ready: k.Skylight, system: System, cosine: float, samples: int, sampler: Sampler | None = None
) -> k.Skylight:
    """The same skylight with a finer table of the exit lens at one angle of incidence, at all azimuths.

    A sun that passes a clear cover and mirror walls meets the exit lens at its own zenith angle, so that its light
    uses but a few of the general table's rows again and again, and their noise would not average out.
    """
    spots, table = ring_table(system.exit, cosine, max(LEAST_RING, min(samples, MOST_RING)), sampler)
    return ready._replace(ring=table, ring_nodes=np.ascontiguousarray(spots[:, :2]), ring_cosine=cosine)


def cover_area_m2(system: System) -> float:
    """Area of the cover's surface [m²]."""
    row = geometry(system)
    if row[k.COVER] == k.PYRAMID:
        return float(facets(system)[:, k.FACET_AREA].sum())
    if row[k.COVER] == k.DOME:
        return 2.0 * math.pi * row[k.CAP_RADIUS] * row[k.RISE]
    return system.aperture_area_m2


def facets(system: System) -> Floats:
    """Outward normal, offset and area of the pyramid's facets east, north, west, south; zeros where there is none."""
    rows = np.zeros((4, 5))
    if system.aperture.shape == "disc" or system.rise_m == 0.0:
        return rows
    ax, ay = (side / 2 for side in system.aperture.size_m)
    for f, (out, along) in enumerate(((ax, ay), (ay, ax), (ax, ay), (ay, ax))):
        slant = math.hypot(out, system.rise_m)
        sign = 1.0 if f < 2 else -1.0
        rows[f, k.NX if f % 2 == 0 else k.NY] = sign * system.rise_m / slant
        rows[f, k.NZ] = out / slant
        rows[f, k.OFFSET] = (system.well_depth_m + system.rise_m) * out / slant
        rows[f, k.FACET_AREA] = along * slant
    return rows


def geometry(system: System) -> tuple[float, ...]:
    """Shape and sizes; the columns are named in `analysis.simulate.kernels.arrays`."""
    row = [0.0] * 12
    disc = system.aperture.shape == "disc"
    radius = system.aperture.diameter_m / 2
    row[k.SHAPE] = k.DISC if disc else k.RECTANGLE
    row[k.AX], row[k.AY] = (radius, radius) if disc else (side / 2 for side in system.aperture.size_m)
    row[k.HEIGHT] = system.well_depth_m
    row[k.BOOT] = system.boot_height_m
    row[k.RISE] = system.rise_m
    row[k.AREA] = system.aperture_area_m2
    if system.rise_m > 0.0:
        row[k.COVER] = k.DOME if disc else k.PYRAMID
        row[k.CAP_RADIUS] = (radius**2 + system.rise_m**2) / (2.0 * system.rise_m)
        row[k.CAP_CENTRE] = system.well_depth_m + system.rise_m - row[k.CAP_RADIUS]
    turn = math.radians(system.rotation_deg)
    row[k.TURN_C], row[k.TURN_S] = math.cos(turn), math.sin(turn)
    return tuple(float(value) for value in row)


def obstructions(system: System) -> Floats:
    """What stands around the skylight, in its own frame, shape (n, 12); see `analysis.simulate.obstruction.rows`."""
    return rows(system.obstructions, system.rotation_deg)


def _wall(wall: Wall) -> tuple[float, float, float]:
    return wall.reflectance, wall.lambertian, math.radians(wall.scatter_deg)


def wide_half(system: System) -> int:
    """Grid steps from the middle to the edge of the tables without symmetry: of files as many as they need."""
    return WIDE_HALF if "bsdf" in (system.entry.kind, system.exit.kind) else SHIFT_HALF


def _lens(lens: Lens, half: int) -> tuple[float, ...]:
    turn = math.radians(lens.orientation_deg)
    row = (
        _KINDS[lens.kind],
        math.cos(turn),
        math.sin(turn),
        lens.mirrored,
        lens.isotropic,
        lens.haze,
        lens.soiling,
        lens.refractive_index,
        lens.absorption_per_mm * lens.thickness_mm,
        lens.transmittance,
        lens.reflectance,
        half if lens.kind in _WIDE else HALF,
        lens.kind in _WIDE,
        1.0 / (weight_units(lens) if lens.kind == "bsdf" else WEIGHT_UNITS),
    )
    return tuple(float(value) for value in row)


@functools.lru_cache(maxsize=1)
def _no_table() -> Table:
    return np.zeros((PARTS, 1, 1, 3), dtype=np.int16)


def _lens_tables(lens: Lens, samples: int, sampler: Sampler | None, half: int) -> tuple[Table, Table]:
    """For light from above and for light from below."""
    if lens.kind == "bsdf":
        return file_tables(lens, samples)
    if lens.kind == "shift":
        return shift_tables(lens, samples, half)
    if lens.kind != "prismatic":
        return _no_table(), _no_table()
    made = tables(lens, samples, sampler=sampler)
    return (made.flat, made.prisms) if lens.prisms == "down" else (made.prisms, made.flat)


def _on_facet(travel: Floats, normal: Floats) -> Any:
    """Direction of travel in the sheet's frame, which follows from its normal; z < 0 where light falls on it."""
    x = np.array([1.0, 0.0, 0.0])
    east = x - normal[0] * normal
    east /= np.linalg.norm(east)
    return np.array([travel @ east, travel @ np.cross(normal, east), travel @ normal])
