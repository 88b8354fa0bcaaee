"""A skylight as a matrix: once per system from patches of sky to intensities, then any sky is a product.

Daylight coefficients (Tregenza & Waters 1983, doi:10.1177/096032718301500201) with the aperture's distribution in place
of an illuminance: candela towards each outgoing direction per cd/m² of each patch, kept by number of wall
bounces so that wall reflectance and bounce limit stay free. The sun is not in it; see `predict` and `series` for that.
"""

import dataclasses
import functools
import os
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from analysis.simulate.lens import Sampler
from analysis.simulate.smooth import smoother
from analysis.simulate.source import Luminance, cell_luminance, patches
from analysis.simulate.store import code_digest, kept
from analysis.simulate.system import System
from analysis.simulate.tally import Field
from analysis.simulate.tracer import Settings, trace
from labdaq.errors import ConfigError

Floats = NDArray[np.float64]
Singles = NDArray[np.float32]
Whole = NDArray[np.int64]

GAMMA_DEG: Final[Floats] = np.arange(0.0, 90.1, 5.0)
C_DEG: Final[Floats] = np.arange(0.0, 360.1, 7.5)
SKY_SIDE: Final = 192
"""Cells along the sky's square; patches are made of them."""

_SIDES: Final = 64
_GROUP: Final = 12
"""Patches traced at a time; bounds the memory of the tallies."""


@dataclass(frozen=True, eq=False)
class SkylightMatrix:
    """Intensities per patch luminance.

    Attributes
    ----------
    system
    subdivision
        k of the MF:k patches.
    gamma_deg, c_deg : shape (G,), (P,)
        The outgoing grid; C is closed.
    distance_m
        Of the near field.
    far, near : shape (bounces, patches, (P - 1) * G), float32 [m²]
        Candela per cd/m² by number of wall bounces.
    error : shape (2,)
        Relative standard uncertainty of a uniform sky's prediction, far and near, root mean square over directions.
    flux, flux_error : shape (patches,) [m² sr]
        Lumens out of the aperture per cd/m², and their standard uncertainty from statistics.
    nadir_error : shape (2, patches) [m²]
        Standard uncertainty of candela at nadir per cd/m², far and near.
    """

    system: System
    subdivision: int
    gamma_deg: Floats
    c_deg: Floats
    distance_m: float
    far: Singles
    near: Singles
    error: Floats
    flux: Floats
    flux_error: Floats
    nadir_error: Floats
    _memory: dict[Any, Floats] = dataclasses.field(default_factory=dict, repr=False)

    @property
    def patch_count(self) -> int:
        """Number of sky patches."""
        return int(self.far.shape[1])

    def patch_luminances(self, sky: Luminance, diffuse_lx: float | None = None, parts: int = 3) -> Floats:
        """Mean luminance [cd/m²] of a sky's patches, shape (patches,).

        With ``diffuse_lx`` the sky is scaled to that horizontal illuminance [lx]; a black one stays black. It is read
        at ``parts`` squared points of each of `SKY_SIDE` squared cells.
        """
        group, up, size = _groups(self.subdivision)
        cells = cell_luminance(sky, SKY_SIDE, parts)
        means: Floats = np.bincount(group, weights=cells, minlength=len(size)) / size
        if diffuse_lx is None:
            return means
        total = float(cells @ up) * 2.0 * np.pi / SKY_SIDE**2
        return means * (diffuse_lx / total if total > 0.0 else 0.0)

    def predict(
        self,
        luminances: Floats,
        field: Field = "far",
        *,
        wall_reflectance: float | None = None,
        max_bounces: int | None = None,
    ) -> Floats:
        """Candela (..., P, G) of skies given by their patches' luminances (..., patches) [cd/m²].

        Raises `ConfigError` for luminances of another subdivision.
        """
        values = np.asarray(luminances, dtype=np.float64)
        if values.shape[-1] != self.patch_count:
            raise ConfigError(f"{values.shape[-1]} luminances for a matrix of {self.patch_count} patches")
        flat = values @ self._collapsed(field, wall_reflectance, max_bounces)
        open_ = flat.reshape(*values.shape[:-1], len(self.c_deg) - 1, len(self.gamma_deg))
        return np.concatenate([open_, open_[..., :1, :]], axis=-2)

    def _collapsed(self, field: Field, wall_reflectance: float | None, max_bounces: int | None) -> Floats:
        """All bounces added up, (patches, directions); remembered."""
        key = (field, wall_reflectance, max_bounces)
        if key not in self._memory:
            self._memory[key] = self._added(field, wall_reflectance, max_bounces)
        return self._memory[key]

    def _added(self, field: Field, wall_reflectance: float | None, max_bounces: int | None) -> Floats:
        by_bounce = self.near if field == "near" else self.far
        n = np.arange(len(by_bounce))
        before = self.system.wall.reflectance
        if wall_reflectance is not None and before == 0.0:
            raise ConfigError("a matrix of black walls cannot be re-weighted to a higher reflectance")
        weights = np.ones(len(n)) if wall_reflectance is None else (wall_reflectance / before) ** n
        if max_bounces is not None:
            weights = np.where(n <= max_bounces, weights, 0.0)
        total: Floats = np.tensordot(weights, by_bounce.astype(np.float64), axes=1)
        return total


def skylight_matrix(
    system: System,
    subdivision: int = 1,
    *,
    rays_per_patch: int = 20_000,
    distance_m: float = 2.6,
    seed: int = 1,
    threads: int = 0,
    gamma_deg: Floats = GAMMA_DEG,
    c_deg: Floats = C_DEG,
    sampler: Sampler | None = None,
) -> SkylightMatrix:
    """The matrix of a system, from the cache, or traced now (some seconds for 145 patches).

    ``subdivision`` 1 are Tregenza's 145 patches, 2 Reinhart's 577.
    """
    recipe = {
        "system": dataclasses.asdict(system.replace(name="")),
        "subdivision": subdivision,
        "rays": rays_per_patch,
        "distance": distance_m,
        "seed": seed,
        "gamma": gamma_deg.tolist(),
        "c": c_deg.tolist(),
        "sampler": "" if sampler is None else f"{sampler.__module__}.{sampler.__qualname__}",
        "code": code_digest("analysis/simulate", "analysis/bsdf"),
    }

    def make() -> dict[str, NDArray[Any]]:
        settings = Settings(
            seed=seed,
            distance_m=distance_m,
            sharp_side=_SIDES,
            soft_side=_SIDES,
            threads=threads or len(os.sched_getaffinity(0)),
        )
        return _traced(system, subdivision, rays_per_patch, settings, gamma_deg, c_deg, sampler)

    found = kept("matrices", recipe, make)
    return SkylightMatrix(
        system,
        subdivision,
        gamma_deg,
        c_deg,
        distance_m,
        found["far"],
        found["near"],
        found["error"],
        found["flux"],
        found["flux_error"],
        found["nadir_error"],
    )


@functools.lru_cache(maxsize=4)
def _groups(subdivision: int) -> tuple[Whole, Floats, Whole]:
    """The patch of each cell of the sky's square, the sine of its altitude, and the number of each patch's cells."""
    from analysis.simulate.source import cell_directions
    from analysis.sky.patches import reinhart

    made = reinhart(subdivision)
    x, y, z = cell_directions(SKY_SIDE, 1)
    group = made.index(np.concatenate([x, y, z], axis=1))
    return group, z[:, 0], np.bincount(group, minlength=made.count)


def _traced(
    system: System,
    subdivision: int,
    rays_per_patch: int,
    settings: Settings,
    gamma_deg: Floats,
    c_deg: Floats,
    sampler: Sampler | None,
) -> dict[str, NDArray[Any]]:
    group, _, cells = _groups(subdivision)
    count = len(cells)
    use = smoother(gamma_deg[None, :], c_deg[:-1, None], (_SIDES, _SIDES), (6.5,), (8.5,))
    fields: dict[str, list[Any]] = {"far": [], "near": []}
    variance = np.zeros((2, (len(c_deg) - 1) * len(gamma_deg)))
    flux, nadir = np.zeros((2, count)), np.zeros((2, count))
    for first in range(0, count, _GROUP):
        size = min(_GROUP, count - first)
        member = np.where((group >= first) & (group < first + size), group - first, -1)
        run = dataclasses.replace(settings, rays=rays_per_patch * size, seed=settings.seed + first)
        tally = trace(system, patches(SKY_SIDE, member, size), run, sampler)
        flux[:, first : first + size] = tally.flux()
        for f, rows in enumerate(fields.values()):
            by_bounce = tally.by_bounce(gamma_deg[None, :], c_deg[:-1, None], "near" if f else "far", use)
            rows.append(by_bounce.reshape(len(by_bounce), size, -1).astype(np.float32))
            whole = tally.intensity(gamma_deg[None, :], c_deg[:-1, None], "near" if f else "far", smoothing=use)
            nadir[f, first : first + size] = whole.uncertainty[:, 0, 0]
            variance[f] += (whole.uncertainty.reshape(size, -1) ** 2).sum(axis=0)
    made = {name: np.concatenate(rows, axis=1) for name, rows in fields.items()}
    used = max(1, *(int(np.max(np.nonzero(m.any(axis=(1, 2)))[0])) + 1 for m in made.values()))
    made = {name: m[:used] for name, m in made.items()}
    totals = [m.sum(axis=(0, 1)) for m in made.values()]
    error = np.array([_relative(v, t) for v, t in zip(variance, totals, strict=True)])
    return made | {"error": error, "flux": flux[0], "flux_error": flux[1], "nadir_error": nadir}


def _relative(variance: Floats, total: Floats) -> float:
    bright = total > 0.05 * total.max()
    return float(np.sqrt(np.mean(variance[bright] / total[bright] ** 2)))
