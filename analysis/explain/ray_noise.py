"""What the rays of the case's own simulation scatter by, where its variants tell, or its files.

The mean of those variants that are the same simulation again (`analysis.explain.idle`) is a nuisance, in each system
with a size of its own; two of them must have something in common: the baseline's rays.

So is what a file's directions scatter by about their neighbours. Whatever reads a prediction between its directions (an
arm that points elsewhere), or blurs it (a near field, haze), evens out its rays, and would gain by that in its name.
(On nulls of two other authors, whose rays scatter by 1 %, near fields had 70 and 155 nats, an arm's angle 12 to 34.)
"""

from collections.abc import Iterator
from typing import Final

import numpy as np
from numpy.typing import NDArray

from analysis.cases.model import Floats
from analysis.explain.fields import C_DEG, GAMMA_DEG, steps_of_file
from analysis.explain.idle import by_rays_alone, changes_by
from analysis.explain.sampler import Sampler
from analysis.explain.scene import Scene
from analysis.explain.variant_rays import LEAST, scatter, scatter_around, spread

USUAL: Final = 0.6
"""Usual share of the variants' mean change that the prediction's own rays have wrong: of K variants, K/(K + 1)."""
SHARED: Final = 0.2
"""Two such changes correlate by this or more; by a half where all runs have as many rays."""
_SAME: Final = 0.999
_EVEN: Final = np.array([-3.0, 12.0, 17.0, 12.0, -3.0]) / 35.0
"""Weights of a parabola through five neighbours at the middle one: Savitzky and Golay 1964, Anal. Chem. 36, 1627."""
_OF_RAYS: Final = -0.3
"""Neighbours' correlation off the parabolas: -.8 of rays that scatter independently. (Of ten other authors' files
whose rays scatter -.3 to -.8, of three whose images alone are sharp -.1 to .7.)"""
_NO_IMAGES: Final = 1.3
"""Planes that scatter about each other no more than so many times as gammas do are of rays alone."""
_MOST: Final = 0.2
_BRIGHT: Final = 0.003
"""Share of the brightest direction above which rays are counted."""


def ray_noise(scene: Scene) -> Floats:
    """Unit effects (N, K) on the stretched scale, one for each system with such variants."""
    r = scene.readings
    if not np.any(scene.is_gonio) or scene.retraced is None:
        return np.zeros((len(r), 0))
    return np.asarray(USUAL * (scene.remember_rows(_again) * np.abs(r.measured) / r.scale).T)


def own_rays(scene: Scene) -> Floats:
    """Unit effect (N, 1) on the stretched scale of the rays that the files' directions show, (N, 0) if they do not."""
    r = scene.readings
    effect = scene.remember_rows(evened_rays) * np.abs(r.measured) / r.scale
    return effect[:, None] if np.any(effect) else np.zeros((len(r), 0))


def evened_rays(scene: Scene) -> Floats:
    """Relative change (N,) of the predictions where the rays of each file's directions are evened out.

    Zero for records whose test brings no file.
    """
    r, files = scene.readings, [t.simulated for t in scene.readings.case.tests]
    told = next((parts for parts in files if parts is not None), None)
    if told is None or not np.any(scene.is_gonio):
        return np.zeros(len(r))
    gammas, planes = (
        max(round(step / float(grid[1])), 1)
        for step, grid in zip(steps_of_file(r.case, told), (GAMMA_DEG, C_DEG), strict=True)
    )
    given, fields = np.array([parts is not None for parts in files]), scene.fields
    even = [np.where(given[:, None, None], _evened(part, gammas, planes), part) for part in (fields.sun, fields.sky)]
    at = Sampler(r.test, np.nan_to_num(r.gamma_deg), np.nan_to_num(r.c_deg))
    here = at(fields.total)
    effect = np.divide(at(even[0] + even[1]), here, out=np.ones(len(r)), where=here > 0.0) - 1.0
    return np.where(scene.is_gonio, np.clip(effect, -_MOST, _MOST), 0.0)


def _evened(part: Floats, gammas: int, planes: int) -> Floats:
    """A part's fields (T, P, G) with each direction on parabolas through its neighbours, in logarithms.

    Neighbours are so many steps apart; those in C are taken as well where they scatter no more than those in gamma,
    as rays do and images do not.
    """
    even = part.copy()
    for test, light in enumerate(part):
        bright = light > _BRIGHT * float(light.max(initial=0.0))
        log = np.log(np.where(bright, light, 1.0))
        rays = scatter(log, bright, gammas)
        if rays < LEAST:
            continue
        smooth = _along_gamma(log, bright, gammas)
        if _neighbours_agree(log - smooth, bright, gammas):
            continue
        if scatter_around(log, bright, planes) < _NO_IMAGES * rays:
            smooth = _around(smooth, bright, planes)
        even[test] = np.where(bright, np.exp(smooth), light)
    return even


def _along_gamma(log: Floats, bright: NDArray[np.bool_], stride: int) -> Floats:
    """Logarithms (P, G) on parabolas through five gammas, where all of these are bright."""
    made, span = log.copy(), log.shape[1] - 4 * stride
    if span < 1:
        return made
    steps = [slice(stride * k, stride * k + span) for k in range(5)]
    seen = np.all([bright[:, s] for s in steps], axis=0)
    smooth = sum(w * log[:, s] for w, s in zip(_EVEN, steps, strict=True))
    made[:, steps[2]] = np.where(seen, smooth, log[:, steps[2]])
    return made


def _neighbours_agree(off: Floats, bright: NDArray[np.bool_], stride: int) -> bool:
    """Whether what is off the parabolas (P, G) is of images: next to each other rays are off to either side."""
    seen = bright & (off != 0.0)
    pairs = seen[:, stride:] & seen[:, :-stride]
    bound = 3.0 * spread(off[seen]) if np.any(pairs) else 0.0
    one, other = (np.clip(x[pairs], -bound, bound) for x in (off[:, stride:], off[:, :-stride]))
    return float(np.sum(one * other)) > _OF_RAYS * float(np.sum(one**2))


def _around(log: Floats, bright: NDArray[np.bool_], stride: int) -> Floats:
    """The same through five planes."""
    steps = [stride * (k - 2) for k in range(5)]
    seen = np.all([np.roll(bright, s, axis=0) for s in steps], axis=0)
    smooth = sum(w * np.roll(log, s, axis=0) for w, s in zip(_EVEN, steps, strict=True))
    return np.where(seen, smooth, log)


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
