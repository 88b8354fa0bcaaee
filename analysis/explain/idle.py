"""Which of the case's own variants change more than other rays do, and what that says of the prediction.

A variant that changes next to nothing (more bounces where none were cut, the true distance where it was simulated
already) is the same simulation again with other rays. What marks it is that neighbouring directions differ by as much
as far ones. Half of it added would halve the variance of the prediction's rays, and gain in its name what no physics
does; so it is no way in which anything acts, and says that the prediction has already what it was run with.
"""

from collections.abc import Iterator
from enum import Enum
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from analysis.cases.model import Floats
from analysis.explain.fields import Fields
from analysis.explain.readings import GONIOMETER, Readings
from analysis.explain.retrace import Path
from analysis.explain.sampler import Sampler
from labdaq import directions

SMALL: Final = 0.04
"""A variant that changes the readings below a system by more than this (rms, relative) changes something."""
ROUGH: Final = 0.75
"""Scatter about the neighbours, over that about the mean, of a change by rays alone: 1. (That of a smooth change is
small; .6 where a variant of another author's moved sharp images.)"""
HARDLY: Final = 0.012
FAIRLY_ROUGH: Final = 0.5
"""By so little, what is so rough is rays, too: those of a simulation that smooths what it counts. (Another author's of
.4 to .8 % are by .6; what moves images changes a tenth and more.)"""
_PATTERN: Final = " isotropic = False", " anisotropic = True"
_NO_PATTERN: Final = " isotropic = True", " anisotropic = False"
_FAR: Final = " field = far"
"""Words of the labels of settings that give a prediction something, or take it away."""
_NOTHING: Final = 1e-4
_NEIGHBOURS: Final = 4
_LEAST: Final = 40


class Tells(Enum):
    """What a variant tells of the prediction: it has a mechanism, lacks it, has more than the variant, or nothing."""

    HAS = "has"
    LACKS = "lacks"
    LESS = "less"
    NOTHING = "nothing"


def what_it_tells(r: Readings, base: Fields, mechanism: str, path: Path) -> Tells:
    """What one path of settings of a case's variants tells, by its setting and by whether it changes anything."""
    if mechanism == "bounce-truncation" and "max_bounces" in path.held:
        return _of_bounces(r, base, path)
    takes = any(words in path.label for words in (_FAR, *_NO_PATTERN))
    gives = mechanism == "near-field" or any(words in path.label for words in _PATTERN)
    if mechanism not in {"near-field", "lens-anisotropy"} or not (takes or gives):
        return Tells.NOTHING
    if takes:
        return Tells.LESS if is_idle(r, base, path) else Tells.HAS
    if is_idle(r, base, path):
        return Tells.HAS
    return Tells.LACKS if mechanism == "lens-anisotropy" else Tells.NOTHING  # near fields are run as a matter of course


def _of_bounces(r: Readings, base: Fields, path: Path) -> Tells:
    """The real light has no limit (nor has 0): a variant with less light than the prediction is no nearer to it."""
    told, limit = r.case.setup.simulation.max_bounces, path.held["max_bounces"] or np.inf
    if is_idle(r, base, path):
        return Tells.HAS if told and limit != told else Tells.NOTHING
    if not _brightens(r, base, path):
        return Tells.LESS
    return Tells.LACKS if 0 < told < limit else Tells.NOTHING


def is_idle(r: Readings, base: Fields, path: Path) -> bool:
    """Whether all that a path changes of an arm's readings, below any system, is what other rays change."""
    arm = r.kind == GONIOMETER
    for change in changes_by(r, base, path):
        for system in np.unique(r.system[r.test[arm]]):
            rows = np.flatnonzero(arm & (r.system[r.test] == system))
            if np.std(change[rows]) > _NOTHING and not by_rays_alone(r, rows, change[rows]):
                return False
    return bool(np.any(arm))


def _brightens(r: Readings, base: Fields, path: Path) -> bool:
    """Whether a path adds light on the whole."""
    arm = r.kind == GONIOMETER
    return all(float(np.mean(change[arm])) > 0.0 for change in changes_by(r, base, path) if np.any(change[arm]))


def changes_by(r: Readings, base: Fields, path: Path) -> Iterator[Floats]:
    """Relative change (N,) of the readings by each simulated setting of a path."""
    at = Sampler(r.test, np.nan_to_num(r.gamma_deg), np.nan_to_num(r.c_deg))
    here = np.maximum(at(base.total), 1e-9)
    for sun, sky in zip(path.sun, path.sky, strict=True):
        changed = Fields(base.sun * sun, base.sky * sky)
        yield np.clip(at(changed.total) / here - 1.0, -1.0, 1.0)


def by_rays_alone(r: Readings, rows: NDArray[np.int64], change: Floats) -> bool:
    """Whether a change (n,) of the rows below a system is that of other rays alone."""
    sd = float(np.std(change))
    if len(rows) < _LEAST or not _NOTHING < sd < SMALL:
        return False
    squares = []
    for test in np.unique(r.test[rows]):
        mine = np.flatnonzero(r.test[rows] == test)
        if len(mine) <= _NEIGHBOURS:
            return False
        v = directions.vector(r.gamma_deg[rows][mine], r.c_deg[rows][mine])
        _, near = cKDTree(v).query(v, _NEIGHBOURS + 1)
        squares.append((change[mine] - change[mine][near[:, 1:]].mean(axis=1)) ** 2 / (1.0 + 1.0 / _NEIGHBOURS))
    rough = float(np.sqrt(np.mean(np.concatenate(squares)))) / sd
    return rough > ROUGH or (sd < HARDLY and rough > FAIRLY_ROUGH)
