"""Many moments of one skylight: each sky through a matrix, each sun with rays of its own.

Patches of sky are 12 degrees wide, so a sun does not go through them: its flux would be up to a third off, and its
images would lie elsewhere. Few rays a sun tell its flux to one per cent, and a year of suns takes minutes.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from analysis.simulate.daylight import Daylight, sky_model, sun_source
from analysis.simulate.matrix import SkylightMatrix, skylight_matrix
from analysis.simulate.moments import FORM, Moments, read_table
from analysis.simulate.system import System
from analysis.simulate.tally import Field
from analysis.simulate.tracer import Settings, trace
from analysis.simulate.weather import read_weather
from analysis.sky.sun import Site
from labdaq.errors import DataError

Floats = NDArray[np.float64]

RAYS: Final = 20_000
"""For each sun."""

PATCHES: Final = {"flux": 0.01, "nadir": 0.03, "below": 0.02}
"""What even patches in the sky's place cost (rms, relative): docs/simulation.md, A year of moments."""

SUNS: Final = 16
"""Suns traced at a time; bounds the memory of the tallies. Neighbours within a group have the same random numbers."""


@dataclass(frozen=True, eq=False)
class Part:
    """Sun part or sky part of a series.

    Attributes
    ----------
    flux, nadir, below : shape (moments,) [lm], [cd], [lx]
        Out of the aperture; towards the nadir in the far field; on a horizontal plane right below the aperture's
        centre at the distance asked for (zeros without one).
    flux_uncertainty, nadir_uncertainty, below_uncertainty
        Their standard uncertainties: statistics; for the sun's candela and lux also what smoothing bends, and for
        skies what `PATCHES` cost.
    """

    flux: Floats
    flux_uncertainty: Floats
    nadir: Floats
    nadir_uncertainty: Floats
    below: Floats
    below_uncertainty: Floats


@dataclass(frozen=True, eq=False)
class Series:
    """What a skylight does at many moments."""

    moments: Moments
    sun: Part
    sky: Part
    distance_m: float


def read_moments(path: Path, site: Site) -> Moments:
    """Read a .csv table or an .epw weather file; ``site`` places the sun for a table of times.

    Raises one `DataError` with the file, and line and column of each mistake.
    """
    if path.suffix.lower() == ".epw":
        return read_weather(path)
    if path.suffix.lower() != ".csv":
        raise DataError(f"{path}: a table of moments ends in .csv or .epw", FORM)
    return read_table(path, site)


def series(
    system: System,
    moments: Moments,
    sky: str = "perez",
    *,
    distance_m: float = 0.0,
    rays: int = RAYS,
    seed: int = 1,
    threads: int = 0,
) -> Series:
    """Flux and light below a skylight at many moments.

    Parameters
    ----------
    sky
        A name of `analysis.simulate.daylight.MODELS`, scaled to each moment's diffuse illuminance.
    distance_m
        Of a point right below the aperture, where a horizontal plane is lit; 0 leaves it out.
    rays
        For each sun.

    Raises `DataError` for another sky.
    """
    matrix = skylight_matrix(system, distance_m=distance_m or 2.6, threads=threads)
    settings = Settings(
        rays=rays,
        seed=seed,
        distance_m=distance_m,
        bounces=1,
        threads=threads,
        sun_samples=max(8192, rays // 8),
    )
    return Series(moments, _suns(system, moments, settings), _skies(matrix, moments, sky, distance_m), distance_m)


def _skies(matrix: SkylightMatrix, moments: Moments, sky: str, distance_m: float) -> Part:
    nadir = matrix.far.sum(axis=0, dtype=np.float64)[:, 0]  # C 0, gamma 0 of each patch
    near = matrix.near.sum(axis=0, dtype=np.float64)[:, 0]
    rows = np.zeros((6, len(moments.diffuse_lx)))
    to_lux = distance_m**-2 if distance_m > 0.0 else 0.0
    for m in np.flatnonzero(moments.diffuse_lx > 0.0):
        diffuse = float(moments.diffuse_lx[m])
        place = float(moments.altitude_deg[m]), float(moments.azimuth_deg[m])
        shape = sky_model(sky, *place, float(moments.beam_lx[m]), diffuse)
        patches = matrix.patch_luminances(shape, diffuse, 1)
        far_error, near_error = np.linalg.norm(matrix.nadir_error * patches, axis=1)
        error = float(np.linalg.norm(matrix.flux_error * patches))
        below, below_error = to_lux * (near @ patches), to_lux * near_error
        rows[:, m] = matrix.flux @ patches, error, nadir @ patches, far_error, below, below_error
    for k, cost in enumerate(PATCHES.values()):
        rows[2 * k + 1] = np.hypot(rows[2 * k + 1], cost * rows[2 * k])
    return Part(*rows)


def _suns(system: System, moments: Moments, settings: Settings) -> Part:
    rows = np.zeros((6, len(moments.beam_lx)))
    lit = np.flatnonzero(moments.beam_lx > 0.0)
    for number, first in enumerate(range(0, len(lit), SUNS)):
        group = lit[first : first + SUNS]
        source = sun_source([_beam(moments, m) for m in group])
        assert source is not None
        use = Settings(**{**vars(settings), "seed": settings.seed + number})
        tally = trace(system, source, use)
        rows[:2, group] = tally.flux()
        fields: tuple[tuple[Field, float], ...] = (("far", 1.0), ("near", settings.distance_m))
        for f, (field, distance) in enumerate(fields):
            if distance > 0.0:
                down = tally.intensity(0.0, 0.0, field, bias=True)
                both = np.stack([np.ravel(down.candela), np.ravel(down.uncertainty)])
                rows[2 + 2 * f : 4 + 2 * f, group] = both / distance**2
    return Part(*rows)


def _beam(moments: Moments, m: int) -> Daylight:
    altitude, azimuth = float(moments.altitude_deg[m]), float(moments.azimuth_deg[m])
    return Daylight("", altitude, azimuth, float(moments.beam_lx[m]), lambda v: np.zeros(v.shape[:-1]))
