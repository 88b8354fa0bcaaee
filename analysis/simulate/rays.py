"""Sets of rays: those that fall on a cover under a daylight, and files of them.

Files: text (``.txt`` with blanks, ``.csv`` with commas: x y z l m n flux) and IES TM-25 (``.tm25ray``).
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Final, Self

import numpy as np
from numpy.typing import NDArray

from analysis.simulate.daylight import Daylight, sky_source, sun_source
from analysis.simulate.model import facets, geometry, obstructions
from analysis.simulate.ray_text import unusable
from analysis.simulate.source import Source
from analysis.simulate.system import System
from labdaq.errors import DataError

Floats = NDArray[np.float64]

BACK_M: Final = 0.1
"""Rays start so far before the cover, so that a reader's rays meet it from outside."""

SUFFIXES: Final = (".txt", ".csv", ".tm25ray")


@dataclass(frozen=True, eq=False)
class RaySet:
    """Rays in the site's frame (x east, y north, z up, origin in the centre of the aperture).

    Attributes
    ----------
    points : shape (n, 3) [m]
    directions : shape (n, 3)
        Of travel; unit vectors.
    flux_lm : shape (n,) [lm]
    """

    points: Floats
    directions: Floats
    flux_lm: Floats

    @classmethod
    def of(cls, rows: Floats) -> Self:
        """From rows of x y z l m n flux (n, 7); directions become unit vectors.

        Raises `DataError` for numbers that make no rays.
        """
        rows = np.asarray(rows, dtype=np.float64)
        if rows.ndim != 2 or rows.shape[1] != 7 or len(rows) == 0:
            raise DataError(f"rays of shape {rows.shape} are not rows of x y z l m n flux")
        bad = unusable(rows)
        if bad.any():
            raise DataError(f"ray {int(np.argmax(bad)) + 1}: undefined place or direction, or negative flux")
        length = np.linalg.norm(rows[:, 3:6], axis=1)
        return cls(rows[:, :3].copy(), rows[:, 3:6] / length[:, None], rows[:, 6].copy())

    @property
    def rows(self) -> Floats:
        """All of it as (n, 7): x y z l m n flux."""
        return np.concatenate([self.points, self.directions, self.flux_lm[:, None]], axis=1)


def entering(system: System, daylight: Daylight, rays: int = 100_000, seed: int = 1) -> RaySet:
    """About ``rays`` rays of sun and sky that fall on a skylight's cover, in random order; their flux adds up to what
    falls on it. The sun gets the beam's share of the rays, at least a tenth.
    """
    parts: list[tuple[Source, int]] = []
    sun, sky = sun_source([daylight]), sky_source([daylight])
    total = daylight.beam_lx + daylight.diffuse_lx
    share = min(0.9, max(0.1, daylight.beam_lx / total)) if total > 0.0 else 0.0
    if sun is not None:
        parts.append((sun, max(1, round(rays * share))))
    if daylight.diffuse_lx > 0.0:
        parts.append((sky, max(1, rays - sum(count for _, count in parts))))
    if not parts:
        raise DataError("neither sun nor sky shines", "give illuminances")
    rows = np.concatenate([_launched(system, source, count, seed + k) for k, (source, count) in enumerate(parts)])
    rows = rows[rows[:, 6] > 0.0]
    rows = np.random.default_rng(seed).permutation(rows)
    rows[:, :3] -= BACK_M * rows[:, 3:6]
    return RaySet.of(rows)


def read_rays(path: Path) -> RaySet:
    """Read a file of rays by its suffix (`SUFFIXES`). Raises `DataError` with line or ray and reason."""
    from analysis.simulate import ray_text, tm25

    _check(path)
    if path.suffix.lower() != ".tm25ray":
        return RaySet.of(ray_text.read_rows(path))
    try:
        return RaySet.of(tm25.read_rows(path))
    except DataError as error:
        raise error if str(path) in error.message else DataError(f"{path}: {error.message}") from error


def write_rays(path: Path, rays: RaySet, title: str, when: str = "") -> None:
    """Write a file of rays by its suffix (`SUFFIXES`); ``when`` is an ISO 8601 moment. Raises `StorageError`."""
    from analysis.simulate import ray_text, tm25

    _check(path)
    if path.suffix.lower() == ".tm25ray":
        tm25.write_rows(path, rays.rows, title, when)
    else:
        ray_text.write_rows(path, rays.rows, title)


def _check(path: Path) -> None:
    if path.suffix.lower() not in SUFFIXES:
        raise DataError(f"{path}: a file of rays ends in {', '.join(SUFFIXES)}", "rename it after its format")


def _launched(system: System, source: Source, count: int, seed: int) -> Floats:
    from analysis.simulate.kernels import arrays as k
    from analysis.simulate.kernels.entering import entering as kernel
    from analysis.simulate.tracer import per_ray

    steps = np.concatenate([[0.0], np.cumsum(source.probability)])
    light = k.Light(source.mode, source.side, steps, per_ray(source, count), source.span, source.suns, source.rays)
    rows = np.zeros((count, 7))
    kernel(geometry(system), facets(system), obstructions(system), light, np.uint64(seed), count, rows)
    return rows
