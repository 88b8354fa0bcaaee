"""What the rays of the case's own simulation scatter by, where its variants tell.

A variant that changes next to nothing (more bounces where none were cut, the true distance where it was simulated
already) is the same simulation again with other rays. Half of such a change added would halve the variance of the
prediction's rays, and gain in its name what no physics does: so all such variants' mean is a nuisance, in each system
with a size of its own. What marks them is that neighbouring directions differ by as much as far ones, and that
two of them have something in common nevertheless: the baseline's rays.

And what has by its setting what the prediction lacks, but differs by no more than rays, says that it lacks nothing.
"""

from collections.abc import Iterator
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from analysis.cases.model import Floats
from analysis.explain.fields import Fields
from analysis.explain.retrace import Path
from analysis.explain.sampler import Sampler
from analysis.explain.scene import Scene
from labdaq import directions

USUAL: Final = 0.6
"""Usual share of the variants' mean change that the prediction's own rays have wrong: of K variants, K/(K + 1)."""
SMALL: Final = 0.04
"""A variant that changes the readings below a system by more than this (rms, relative) changes something."""
ROUGH: Final = 0.75
"""Scatter about the neighbours, over that about the mean, of a change by rays alone: 1. (That of a smooth change is
small; .6 where a variant of another author's moved sharp images.)"""
SHARED: Final = 0.2
"""Two such changes correlate by this or more; by a half where all runs have as many rays."""
_SAME: Final = 0.999
_NOTHING: Final = 1e-4
_NEIGHBOURS: Final = 4
_LEAST: Final = 40


def ray_noise(scene: Scene) -> Floats:
    """Unit effects (N, K) on the stretched scale, one for each system with such variants."""
    r = scene.readings
    if not np.any(scene.is_gonio) or scene.retraced is None:
        return np.zeros((len(r), 0))
    return np.asarray(USUAL * (scene.remember_rows(_again) * np.abs(r.measured) / r.scale).T)


def _again(scene: Scene) -> Floats:
    """Mean relative change (K, N) by those variants that are the same simulation again, below each system."""
    r = scene.readings
    changes = list(_changes(scene))
    found = []
    for system in np.unique(r.system[r.test[scene.is_gonio]]):
        rows = np.flatnonzero(scene.is_gonio & (r.system[r.test] == system))
        again = _alike([x[rows] for x in changes if _is_again(scene, rows, x[rows])])
        if len(again) > 1:
            effect = np.zeros(len(r))
            effect[rows] = np.mean(again, axis=0)
            found.append(effect)
    return np.array(found).reshape(len(found), len(r))


def lacked_by(scene: Scene) -> frozenset[str]:
    """Mechanisms that the prediction lacks by the case's account: a variant has them, and differs by more than rays."""
    paths = {} if scene.retraced is None else scene.retraced.case_paths
    return frozenset(m for m, own in paths.items() if any(p.adds and _changes_something(scene, p) for p in own))


def had_by(scene: Scene) -> frozenset[str]:
    """Mechanisms that the prediction has, likewise: a variant takes them away, and none gives more of them."""
    paths = {} if scene.retraced is None else scene.retraced.taken
    taken = frozenset(m for m, own in paths.items() if any(_changes_something(scene, p) for p in own))
    return taken - lacked_by(scene)


def _changes_something(scene: Scene, path: Path) -> bool:
    r = scene.readings
    for change in _changes_by(scene, path):
        for system in np.unique(r.system[r.test[scene.is_gonio]]):
            rows = np.flatnonzero(scene.is_gonio & (r.system[r.test] == system))
            if np.std(change[rows]) > _NOTHING and not _is_again(scene, rows, change[rows]):
                return True
    return False


def _changes(scene: Scene) -> Iterator[Floats]:
    """Relative change (N,) of the readings by each simulated setting of each variant."""
    for path in scene.retraced.of_case() if scene.retraced is not None else ():
        yield from _changes_by(scene, path)


def _changes_by(scene: Scene, path: Path) -> Iterator[Floats]:
    r, base = scene.readings, scene.fields
    at = Sampler(r.test, np.nan_to_num(r.gamma_deg), np.nan_to_num(r.c_deg))
    here = np.maximum(at(base.total), 1e-9)
    for sun, sky in zip(path.sun, path.sky, strict=True):
        changed = Fields(base.sun * sun, base.sky * sky)
        yield np.clip(at(changed.total) / here - 1.0, -1.0, 1.0)


def _is_again(scene: Scene, rows: NDArray[np.int64], change: Floats) -> bool:
    """Whether a change (n,) of the rows below a system is that of other rays alone."""
    r = scene.readings
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
    return float(np.sqrt(np.mean(np.concatenate(squares)))) > ROUGH * sd


def _alike(changes: list[Floats]) -> list[Floats]:
    """Those that share the baseline's rays with another, each run once, though it may be told of two mechanisms."""
    runs: list[Floats] = []
    for x in changes:
        if all(np.corrcoef(x, y)[0, 1] < _SAME for y in runs):
            runs.append(x)
    return [x for x in runs if any(np.corrcoef(x, y)[0, 1] > SHARED for y in runs if y is not x)]
