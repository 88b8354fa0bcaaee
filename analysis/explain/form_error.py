"""What the forms of mechanisms have wrong themselves, as random effects that grow with the change a mechanism makes.

A formula is near the truth; a re-simulation is that of another lens, whose images lie a little elsewhere. Whoever
takes the change of a mechanism for exact calls the rest scatter, or finds another mechanism that is wrong in fewer
places. So a change may be off by shares of itself: by a smooth function of direction, by a factor per test, and by a
local function of direction. Shares are those by which forms missed in a blind trial (docs/explaining.md), and less.
"""

import numpy as np

from analysis.cases.model import Floats
from analysis.explain.along import in_broken_cloud, sphere
from analysis.explain.fit import Extra, without
from analysis.explain.lens_error import lens_error_of
from analysis.explain.mechanisms.base import Term, lit_by, predict
from analysis.explain.scene import Scene
from analysis.explain.series import unrest

SMOOTH_DEG = 40.0
LOCAL_DEG = 12.0
"""Widths of the smooth and of the local function of direction [deg]."""
OF_CASE = 0.15
"""Both shares, at most, of a change that the case's own variants show. (On another author's cases such changes of a
lens were the true ones to 20 % rms: they correlated by .98, ours by .2 to .4.)"""

ALIKE = 0.2
"""The same of a change that was simulated on a lens which is hardly unlike the prediction's, where the lens decides."""
_LENS_DECIDES = frozenset(
    {
        "circumsolar-aureole",
        "lens-haze",
        "lens-anisotropy",
        "lens-orientation",
        "wall-reflectance",
        "bounce-truncation",
        "clock-offset",
    }
)


def form_error(scene: Scene, terms: tuple[Term, ...], theta: Floats) -> tuple[Extra, ...]:
    """Random effects for what the forms of ``terms`` may have wrong at their parameters (P,); none without terms."""
    r = scene.readings
    parts = []
    by_test = (r.test[:, None] == np.unique(r.test)[None, :]).astype(np.float64)
    for k, term in enumerate(terms):
        smooth, local = _shares(scene, term)
        change = _change(scene, terms, theta, k)[:, None]
        if smooth > 0.0:
            parts += [np.sqrt(0.5) * smooth * change * shape for shape in (scene.remember(sphere, SMOOTH_DEG), by_test)]
        if local > 0.0:
            parts.append(local * change * scene.remember(sphere, LOCAL_DEG))
    unknown = _between_readings(scene, terms, theta)
    other = _other_lens(scene, terms, theta)
    clouds = (Extra(scene.remember(in_broken_cloud, 0.0), np.sqrt(unknown)),) if unknown > 0.0 else ()
    return (*clouds, *other, Extra(np.concatenate(parts, axis=1))) if parts else (*clouds, *other)


def _other_lens(scene: Scene, terms: tuple[Term, ...], theta: Floats) -> tuple[Extra, ...]:
    """What a lens has wrong of the light that terms say was read, where that is other than was predicted."""
    if not any(t.mechanism.other_light for t in terms) or not np.any(scene.is_gonio):
        return ()
    columns = lens_error_of(scene, lit_by(scene, terms, theta), predict(scene, terms, theta))
    return (Extra(columns, of_lens=True),)


def _between_readings(scene: Scene, terms: tuple[Term, ...], theta: Floats) -> float:
    """Time [min] for which these terms do not know what clouds did (`Mechanism.between_readings_min`)."""
    ends = np.cumsum([len(t.parameters) for t in terms])
    own = [theta[end - len(t.parameters) : end] for t, end in zip(terms, ends, strict=True)]
    return sum(t.mechanism.between_readings_min(scene, p, t.branch) for t, p in zip(terms, own, strict=True))


def locally_wrong(scene: Scene, terms: tuple[Term, ...], theta: Floats) -> Floats:
    """Standard deviation (N,) by which a single reading may miss what forms make of it, on the stretched scale."""
    wrong = np.asarray(scene.remember(unrest) * np.sqrt(_between_readings(scene, terms, theta)))
    for k, term in enumerate(terms):
        wrong = np.hypot(wrong, _shares(scene, term)[1] * _change(scene, terms, theta, k))
    return wrong


def _shares(scene: Scene, term: Term) -> tuple[float, float]:
    """By which shares the change that a term makes may be wrong, smoothly and locally."""
    shares = term.mechanism.form_error_in(scene), term.mechanism.local_error_in(scene, term.branch)
    alike = term.branch.alike and term.mechanism.id in _LENS_DECIDES
    most = OF_CASE if term.branch.of_case else ALIKE if alike else 1.0
    return min(shares[0], most), min(shares[1], most)


def _change(scene: Scene, terms: tuple[Term, ...], theta: Floats, k: int) -> Floats:
    """What the k-th mechanism changes on the stretched scale, the others being there; shape (N,)."""
    r = scene.readings
    with_it = r.stretched(predict(scene, terms, theta))
    return np.asarray(with_it - r.stretched(predict(scene, *without(terms, theta, k))))
