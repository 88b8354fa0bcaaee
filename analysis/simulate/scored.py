"""Few directions scored one by one, until they are sure.

Forwards from a sun; for a sky behind lenses backwards from each direction, which takes two thirds of the time for the
same error. An open diffuse well is quicker forwards: each of its bounces lights all directions evenly.
"""

import dataclasses
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from analysis.simulate.aimed import BATCHES, trace_aimed, trace_back
from analysis.simulate.aims import can_be_aimed, can_be_followed_back
from analysis.simulate.kernels.arrays import SKY
from analysis.simulate.lens import Sampler
from analysis.simulate.source import Source
from analysis.simulate.system import System
from analysis.simulate.tally import Balance
from analysis.simulate.tracer import Settings
from labdaq.errors import ConfigError

Floats = NDArray[np.float64]

PILOT: Final = 1_000_000
"""Rays that a run forwards has at least: directions share them, so that an unlucky run is off in all of them."""

MOST_RAYS: Final = 5_000_000
"""Rays forwards: with `MOST_BACK` some 20 seconds on two cores."""

PILOT_BACK: Final = 64
MOST_BACK: Final = 1250
"""Rays back to a sky, for each direction and batch."""

LAST_SEED: Final = 7919


@dataclass(frozen=True)
class Grid:
    """The different directions of a grid of planes: the nadir is one, and so are C 0 and 360.

    Attributes
    ----------
    gamma_deg, c_deg : shape (n,)
    place : shape (C, gamma)
        Which of the n stands where.
    """

    gamma_deg: Floats
    c_deg: Floats
    place: NDArray[np.int64]

    @classmethod
    def of(cls, gamma_deg: Floats, c_deg: Floats) -> "Grid":
        """From the axes of a closed grid; raises `ConfigError` where C does not run from 0 to 360."""
        if c_deg[0] != 0.0 or c_deg[-1] != 360.0:
            raise ConfigError(f"C must run from 0 to 360, not from {c_deg[0]:g} to {c_deg[-1]:g}")
        gamma, c = np.broadcast_arrays(gamma_deg[None, :], c_deg[:, None])
        keys = np.stack([gamma.ravel(), np.where(gamma == 0.0, 0.0, c % 360.0).ravel()])
        unique, place = np.unique(keys, axis=1, return_inverse=True)
        return cls(unique[0], unique[1], np.ravel(place).reshape(gamma.shape))


@dataclass(frozen=True)
class Scored:
    """Intensity of one sun or sky in a grid's directions, with standard uncertainty, each (C, gamma) [cd]."""

    candela: Floats
    uncertainty: Floats
    balance: Balance


def score(
    system: System, source: Source, settings: Settings, precision: float, grid: Grid, sampler: Sampler | None = None
) -> Scored | None:
    """Score one sun or sky in all directions of a grid; None for a skylight in which that is not possible.

    ``precision``: relative standard uncertainty to reach, forwards in the root mean square of the brighter directions,
    backwards in each; 0 takes the settings' rays (backwards: for all directions together).
    """
    aimed = can_be_aimed(system, sampler)
    if source.mode == SKY and can_be_followed_back(system, sampler) and not (aimed and system.exit.kind == "none"):
        return _backwards(system, source, settings, precision, grid)
    return _forwards(system, source, settings, precision, grid) if aimed else None


def _forwards(system: System, source: Source, settings: Settings, precision: float, grid: Grid) -> Scored:
    distance = np.full(len(grid.gamma_deg), settings.distance_m)

    def traced(rays: int, again: int) -> "tuple[int, Floats, Balance]":
        use = dataclasses.replace(settings, rays=rays, seed=settings.seed + again * LAST_SEED)
        run = trace_aimed(system, source, use, grid.gamma_deg, grid.c_deg, distance)
        return rays, run.batches, run.balance

    runs = [traced(PILOT if precision > 0.0 else settings.rays, 0)]
    for again in range(1, 4):
        batches = np.average([run[1] for run in runs], axis=0, weights=[run[0] for run in runs])
        have, rays = _relative(batches), sum(run[0] for run in runs)
        needed = min(MOST_RAYS, 1.05 * rays * (have / precision) ** 2) if precision > 0.0 else 0
        if needed <= 1.05 * rays:
            break
        runs.append(traced(int(needed - rays), again))
    batches = np.average([run[1] for run in runs], axis=0, weights=[run[0] for run in runs])
    balance = runs[0][2]
    for run in runs[1:]:
        balance = balance.plus(run[2])
    return _scored(batches.mean(axis=0), _error(batches), balance, grid)


def _backwards(system: System, source: Source, settings: Settings, precision: float, grid: Grid) -> Scored:
    count = len(grid.gamma_deg)
    distance = np.full(count, settings.distance_m)

    def traced(rays: NDArray[np.int64], again: int) -> Floats:
        use = dataclasses.replace(settings, seed=settings.seed + again * LAST_SEED)
        return trace_back(system, source, use, grid.gamma_deg, grid.c_deg, distance, rays)

    fixed = max(1, settings.rays // (count * BATCHES))
    rays = np.full(count, PILOT_BACK if precision > 0.0 else fixed)
    batches = traced(rays, 0)
    if precision > 0.0:
        mean = np.maximum(batches.mean(axis=0), 1e-300)
        needed = np.minimum(MOST_BACK, rays * (_error(batches) / mean / precision) ** 2)
        # no less than as many again: what is traced must not depend much on the pilot's luck
        more = np.maximum(needed - rays, rays).astype(np.int64)
        batches = (rays * batches + more * traced(more, 1)) / (rays + more)
    flows = dataclasses.replace(settings, rays=1 << 16)
    balance = trace_aimed(system, source, flows, grid.gamma_deg[:1], grid.c_deg[:1], distance[:1]).balance
    return _scored(batches.mean(axis=0), _error(batches), balance, grid)


def _scored(candela: Floats, error: Floats, balance: Balance, grid: Grid) -> Scored:
    return Scored(candela[grid.place], error[grid.place], balance)


def _error(batches: Floats) -> Floats:
    error: Floats = batches.std(axis=0, ddof=1) / len(batches) ** 0.5
    return error


def _relative(batches: Floats) -> float:
    """Root mean square relative uncertainty of the directions above 5 % of the brightest."""
    candela = batches.mean(axis=0)
    bright = candela > 0.05 * candela.max()
    if not bright.any():
        return 0.0
    return float(np.sqrt(np.mean((_error(batches)[bright] / candela[bright]) ** 2)))
