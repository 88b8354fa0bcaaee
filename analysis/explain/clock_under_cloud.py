"""A clock that is off under broken cloud: what the cloud did in the meantime has no formula, but a size.

The scatter that an offset leaves where the daylight is restless says how long it was.
"""

from dataclasses import replace

import numpy as np

from analysis.explain.families import UNREST, evenly_restless
from analysis.explain.fit import MIDDLE, Fitter
from analysis.explain.hypothesis import Hypothesis
from analysis.explain.mechanisms.base import Term
from analysis.explain.shifts import likely_shifts
from analysis.explain.wander import Wandering

SHOWN_ITSELF = 8.0
"""What a clock's offset must gain [nats] before the scatter under cloud tells its size. (On another author's roofs
two clocks that had less were none; right ones had 80 and more.)"""
_AS_FAR, _FARTHEST = (1.0, 4.0, 0.6), (5.0, 20.0, 3.0)
"""Usual and largest offset of a clock, over that of which a random walk would leave the scatter that is there; four
times as much up to so many minutes, for where readings follow each other fast the offset itself takes most of the
scatter. (On another author's roofs clocks .6 min off left as little as .06 min would.)"""


def clock_under_cloud(fitter: Fitter, ways: tuple[Term, ...]) -> Hypothesis | None:
    """A clock's offset, in any of its ways, with what broken cloud did in the meantime; it stands beside it alone.

    The offset's prior follows the size of the scatter. ``None`` where the scatter is that of few readings: a shadow's.
    Two instruments that stand apart scatter so, too: the offset itself must have shown a little (`SHOWN_ITSELF`).
    """
    made = [h for root_min in UNREST.amplitudes for way in ways for h in _with_scatter(fitter, way, root_min)]
    logs = np.array([h.evidence for h in made])
    best = max(made, key=lambda h: h.evidence)
    if not evenly_restless(fitter.scene, best.fit.residual, best.wanders[0].amplitude):
        return None
    off = np.array([float(h.fit.theta[0] - best.fit.theta[0]) for h in made])
    shares = np.exp(logs - np.logaddexp.reduce(logs))
    sizes = np.array([h.wanders[0].amplitude ** 2 for h in made])  # that clouds walk at random is roughly so
    best.fit.spread = np.array([[float(shares @ (off**2 + sizes**2))]])  # and earlier or later is often left open
    return replace(best, evidence=float(np.logaddexp.reduce(logs) - np.log(len(made))))


def _with_scatter(fitter: Fitter, way: Term, root_min: float) -> list[Hypothesis]:
    """One way with a scatter of one size, earlier and later; a series also where its own ups and downs say it is.

    There the scatter is what clouds did between two readings, and tells nothing of how far the series moved.
    """
    unrest = Wandering(UNREST, root_min)
    extra = (unrest.extra(fitter.scene),)
    about = root_min**2
    usual, far = (max(x * about, min(y * about, most)) for x, y, most in (_AS_FAR, _FARTHEST))
    whole = way.parameters[0]
    near = replace(whole, low=-far, high=far, sigma=usual, starts=(-usual, usual))
    begun = [(near, start) for start in near.starts]
    if way.branch.value == "series":
        begun += [(whole, float(start)) for start in fitter.scene.remember(likely_shifts, whole.high)]
    made = []
    for p, start in begun:
        fit = fitter.fit((replace(way, parameters=(p,)),), np.array([start]), MIDDLE, extra)
        fitter.weigh([fit], extra)
        made.append(Hypothesis(fit, fit.log_evidence, (unrest,)))
    return made
