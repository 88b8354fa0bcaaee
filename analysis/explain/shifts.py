"""How much earlier or later a predicted series seems to have been read: where fits of a clock begin.

Under broken cloud a clock that is off by more than a cloud takes to pass agrees no better than none until it is nearly
right; no fit that follows a slope finds it. But what changes from one reading to the next, the daylight's own ups and
downs, agrees with the other series' at one shift alone.
"""

import numpy as np

from analysis.cases.model import Floats
from analysis.explain.scene import Scene
from analysis.explain.series import series_of, step_min, unrest

_PER_STEP = 3.0
"""Shifts tried per step of the series,"""
_MOST_TRIED = 600
"""at most so many on either side."""
_HALF = 0.5
"""Such a share of the changes must be left where the series overlap."""
_BEST = 3
"""So many of the best shifts, apart from each other, are told,"""
_BETTER = 0.7
"""if they leave so much less than no shift does, of what there is."""
_A_PART, _BROKEN = 0.1, 0.02
"""Such a part of the readings must lie under broken cloud (of so much `unrest`) for the clouds to tell anything."""
_ALIKE = 0.3
"""Where no more is left at the best shift, or at none, prediction and readings saw the same daylight go up and down."""


def likely_shifts(scene: Scene, most_min: float) -> Floats:
    """Shifts [min] of the predicted series by which its changes agree best with the readings', the best first; (K,).

    Positive where the readings were taken later than recorded. Empty where no shift does better than none.
    """
    step = step_min(scene) / _PER_STEP
    count = min(int(most_min / step), _MOST_TRIED)
    shifts = np.asarray(step * np.arange(-count, count + 1), dtype=np.float64)
    left = _left(scene, shifts)
    inner = (left[1:-1] < left[:-2]) & (left[1:-1] < left[2:]) & (left[1:-1] < _BETTER * left[count])
    at = 1 + np.flatnonzero(inner)
    return np.asarray(shifts[at[np.argsort(left[at])][:_BEST]])


def saw_the_clouds(scene: Scene, most_min: float) -> bool:
    """Whether the prediction's ups and downs are those of the readings, sooner or later; a model's clouds are not.

    Where there are hardly any, it makes no difference.
    """
    if np.quantile(scene.remember(unrest), 1.0 - _A_PART) < _BROKEN:
        return False
    shifts = np.append(0.0, scene.remember(likely_shifts, most_min))
    return bool(np.min(_left(scene, shifts)) < _ALIKE)


def _left(scene: Scene, shifts: Floats) -> Floats:
    """What the readings' changes (of the logarithm) leave beside the shifted prediction's, over both alone; (S,).

    About one where the two have nothing to do with each other: where clouds are fewer there is less to agree, too.
    """
    r = scene.readings
    total, alone, counted, pairs = (np.zeros(len(shifts)) for _ in range(4))
    for s in series_of(scene):
        seen, said = (np.log(np.maximum(x[s.rows], r.floor[s.rows])) for x in (r.measured, r.simulated))
        at = s.t[None, :] + shifts[:, None]
        inside = (at >= s.t[0]) & (at <= s.t[-1])
        both = inside[:, 1:] & inside[:, :-1]
        changed, moved = np.diff(seen)[None, :], np.diff(np.interp(at, s.t, said), axis=1)
        total += np.sum(both * (changed - moved) ** 2, axis=1)
        alone += np.sum(both * (changed**2 + moved**2), axis=1)
        counted += both.sum(axis=1)
        pairs += len(s.t) - 1
    return np.where(counted >= _HALF * pairs, total / np.maximum(alone, 1e-30), np.inf)
