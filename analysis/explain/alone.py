"""Readings that stand alone: a glint, a spike, the shadow of something thin, an image where no simulated lens has one.

Below a skylight a few readings can be off by tens of per cents where all others are right to one: sharp images lie
elsewhere. Taken for scatter they would make all others count for little, and whatever happens to move a few of them
would gain what it does not explain. So readings that neither nothing nor any promising mechanism explains are quieted:
each may err by itself. They are told, and where nothing is named they say that something is there.

Under broken cloud a picture has edges everywhere, and a fraction of a degree between two instruments is worth tens of
per cents there: such readings are quieted, too, but tell nothing. So are whole pictures, in which clouds moved between
the two instruments (`restless`): one scatter for all pictures would make the calm ones count for as little.
"""

from dataclasses import replace
from functools import partial, reduce

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree
from scipy.special import gammaln

from analysis.cases.model import Floats, Ints
from analysis.explain.abreast import abreast
from analysis.explain.families import SIZES
from analysis.explain.fit import MIDDLE, Extra, Fit
from analysis.explain.form_error import locally_wrong
from analysis.explain.pointing_error import steepness
from analysis.explain.scene import Scene
from analysis.explain.search import Search
from analysis.explain.sky_shape import towards
from analysis.explain.wander import Wander

ODD = 4.5
"""A reading this many standard deviations from what all others say of it is odd."""
QUIET = 0.5
"""Relative standard deviation by which a reading that was quieted may err by itself."""
_USUAL = 45.0
"""Evidence [nats] for odd readings that a lens's images make where nothing was left out."""
_EDGE_DEG = 0.7
"""By how much the edges of a lens's images may be misplaced [deg]."""
_FEW = 0.04
"""At most this share of the readings can be odd; more are a shape of their own."""
_PROMISING, _MOST = 10.0, 4
"""Mechanisms that lower the objective by this are asked for what they explain, at most so many of the best."""
_NEIGHBOURS = 4
"""What a reading of a picture differs from so many of its neighbours is no smooth error."""
_LEAST_PICTURE = 20
"""Readings of a picture that tell how much it scatters."""
_RESTLESS = 2.0
"""A picture under broken cloud that scatters so many times as much as the middle one of its case is restless."""


def quieted(search: Search) -> Search:
    """The search, with those readings quieted that stand alone beside nothing and beside each promising mechanism.

    Only below a skylight, and of pictures under broken cloud: a meter's lone readings are what a shadow did.
    """
    if not np.any(search.scene.is_gonio | at_clouds(search.scene)):
        return search
    nothing = search.fitter.fit((), np.zeros(0), MIDDLE)
    looks = sorted((min(fits, key=lambda f: f.objective) for fits in search.looks.values()), key=lambda f: f.objective)
    promising = [f for f in looks if f.objective < nothing.objective - _PROMISING][:_MOST]
    rows = _odd_beside(search, nothing)
    if len(rows):
        rows = reduce(np.intersect1d, abreast(partial(_odd_beside, search), promising), rows)
    alone = np.min([restless(search.scene, look.residual) for look in (nothing, *promising)], axis=0)
    alone[rows] = QUIET
    return search.quieter(alone) if np.any(alone > 0.0) else search


def _odd_beside(search: Search, look: Fit) -> Ints:
    """Rows that stand alone beside a first look's fit, its sizes found."""
    fit, extra = replace(look), search.forms_wrong(look)
    search.fitter.weigh([fit], extra)
    odd = _odd(search, fit, extra)
    return odd[(search.scene.is_gonio | at_clouds(search.scene))[odd]]


def at_clouds(scene: Scene) -> NDArray[np.bool_]:
    """Luminances under broken cloud (N,), where a cloud's edge may lie."""
    r = scene.readings
    broken = np.array([t.sky == "partly-cloudy" for t in r.case.tests])
    return np.asarray(scene.is_sky & broken[r.test])


def restless(scene: Scene, residual: Floats) -> Floats:
    """Standard deviation (N,) by which readings of restless pictures err by themselves, given a fit's residual (N,)."""
    r = scene.readings
    placed = scene.is_sky & np.isfinite(r.gamma_deg)
    pictures = [np.flatnonzero(placed & (r.test == k)) for k in np.unique(r.test[placed])]
    pictures = [rows for rows in pictures if len(rows) >= _LEAST_PICTURE]
    alone = np.zeros(len(r))
    if len(pictures) < 3:
        return alone
    scatter = np.array([_scatter(towards(r)[rows], residual[rows]) for rows in pictures])
    usual = float(np.median(scatter))
    for rows, sd in zip(pictures, scatter, strict=True):
        if sd > _RESTLESS * usual and at_clouds(scene)[rows[0]]:
            alone[rows] = np.sqrt(sd**2 - usual**2)
    return alone


def _scatter(v: Floats, residual: Floats) -> float:
    """Robust standard deviation of residuals (n,) about those of the neighbours of their directions ``v`` (n, 3)."""
    _, near = cKDTree(v).query(v, _NEIGHBOURS + 1)
    apart = residual - residual[near[:, 1:]].mean(axis=1)
    return float(np.median(np.abs(apart)) / 0.6745 / np.sqrt(1.0 + 1.0 / _NEIGHBOURS))


def odd_readings(search: Search, fit: Fit, extra: tuple[Extra, ...]) -> tuple[Wander, float] | None:
    """Readings that stand alone beside a fit, edges of images allowed for, as a random effect of their own.

    Returns the effect and the log of the number of ways in which so many readings could have been picked; ``None``
    where no reading stands alone.
    """
    count = len(search.scene.readings)
    # where a lens's image is steep, a reading may be off by itself
    odd = _odd(search, fit, extra, max([_EDGE_DEG, *(t.mechanism.displaces_deg(search.scene) for t in fit.terms)]))
    odd = odd[~at_clouds(search.scene)[odd]]
    if len(odd) == 0:
        return None
    columns = np.eye(count)[:, odd]
    ways = _USUAL + float(gammaln(count + 1) - gammaln(len(odd) + 1) - gammaln(count - len(odd) + 1))
    return Wander("odd readings", f"{len(odd)} readings that stand alone", (lambda *_: columns,), SIZES, (1.0,)), ways


def _odd(search: Search, fit: Fit, extra: tuple[Extra, ...], edge_deg: float = 0.0) -> Ints:
    """Rows that are far from what all others say of them, the oddest first."""
    scene, whitener = search.scene, search.fitter.whitener(fit.hyper, extra)
    precision = whitener.squares(np.eye(len(scene.readings)))
    wrong = (edge_deg * steepness(scene)) ** 2 + locally_wrong(scene, fit.terms, fit.theta) ** 2
    deviation = np.abs(whitener.weights(fit.residual)) / precision / np.sqrt(1.0 / precision + wrong)
    oddest = np.argsort(-deviation)[: max(int(_FEW * len(deviation)), 1)]
    return np.asarray(oddest[deviation[oddest] > ODD])
