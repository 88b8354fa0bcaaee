"""What the rays of the case's own simulation scatter by, where its variants tell.

The mean of those variants that are the same simulation again (`analysis.explain.idle`) is a nuisance, in each system
with a size of its own; two of them must have something in common: the baseline's rays.
"""

from collections.abc import Iterator
from typing import Final

import numpy as np

from analysis.cases.model import Floats
from analysis.explain.idle import by_rays_alone, changes_by
from analysis.explain.scene import Scene

USUAL: Final = 0.6
"""Usual share of the variants' mean change that the prediction's own rays have wrong: of K variants, K/(K + 1)."""
SHARED: Final = 0.2
"""Two such changes correlate by this or more; by a half where all runs have as many rays."""
_SAME: Final = 0.999


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
        again = _alike([x[rows] for x in changes if by_rays_alone(r, rows, x[rows])])
        if len(again) > 1:
            effect = np.zeros(len(r))
            effect[rows] = np.mean(again, axis=0)
            found.append(effect)
    return np.array(found).reshape(len(found), len(r))


def _changes(scene: Scene) -> Iterator[Floats]:
    """Relative change (N,) of the readings by each simulated setting of each variant."""
    for path in scene.retraced.of_case() if scene.retraced is not None else ():
        yield from changes_by(scene.readings, scene.fields, path)


def _alike(changes: list[Floats]) -> list[Floats]:
    """Those that share the baseline's rays with another, each run once, though it may be told of two mechanisms."""
    runs: list[Floats] = []
    for x in changes:
        if all(np.corrcoef(x, y)[0, 1] < _SAME for y in runs):
            runs.append(x)
    return [x for x in runs if any(np.corrcoef(x, y)[0, 1] > SHARED for y in runs if y is not x)]
