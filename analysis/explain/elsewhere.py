"""What a case's own variant showed, for other cases: how our own simulation shows it best, and how much of that.

Another case of the same station may bring no such variant. Our lens is another than the prediction's; what it makes of
the same setting may be something else altogether. (Of another author's box of prisms a turn by 10° made the next tests'
predictions five times as wrong as they had been.) So of our own ways and settings that one is told whose change of the
fitted readings is most like what the variant changes, and by which share of it (least squares): none, if it is unlike.
"""

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from analysis.cases.model import Floats
from analysis.explain.fit import Fit, without
from analysis.explain.mechanisms.base import Term, predict
from analysis.explain.mechanisms.states import terms_of
from analysis.explain.retrace import Path
from analysis.explain.scene import Scene
from analysis.explain.variant_gaps import seen_of


def elsewhere(scene: Scene, fit: Fit, k: int) -> dict[str, Any]:
    """The k-th mechanism of a fit in our own way: its name, settings, and share; empty where there is none.

    Only of what the case brings itself, in tests that its variants cover, or in which their gaps were filled.
    """
    term, r = fit.terms[k], scene.readings
    if not term.branch.of_case:
        return {}
    start = sum(len(t.parameters) for t in fit.terms[:k])
    end = start + len(term.parameters)
    bare = predict(scene, *without(fit.terms, fit.theta, k))
    ours = scene.without_variants(term.mechanism.id) if term.branch.brought else scene  # else ours stand beside them

    def change(seen: Scene, other: Term, own: Floats) -> Floats:
        """What it changes in those tests, a gain per test removed; zero in the rest."""
        terms = (*fit.terms[:k], other, *fit.terms[k + 1 :])
        made = predict(seen, terms, np.concatenate([fit.theta[:start], own, fit.theta[end:]]))
        return r.free_of_gains(r.stretched(made) - r.stretched(bare))

    shown = change(scene, term, fit.theta[start:end])
    found = dict(zip([p.name for p in term.parameters], fit.theta[start:end].tolist(), strict=True))
    told: dict[str, Any] = {}
    least = np.inf
    for way in _our_ways(ours, term):
        for at in _settings(way, found):
            made = np.where(_covered(scene, shown), change(ours, way, np.array([at])), 0.0)
            left, share = seen_of(made, shown)
            if left < least:
                names = [p.name for p in way.parameters]
                told = {"way": way.branch.label, "names": names, "theta": [at], "share": round(share, 4)}
                least = left
    return told


def _our_ways(scene: Scene, term: Term) -> Iterator[Term]:
    """Ways of the same mechanism that need no variant and have one parameter."""
    for way in terms_of(term.mechanism, scene):
        if not way.branch.of_case and not way.branch.of_random and way.tests is None and len(way.parameters) == 1:
            yield way


def _settings(way: Term, found: Mapping[str, float]) -> list[float]:
    """Settings to try along a way: where fits begin, those that were simulated, and that which was found."""
    (parameter,) = way.parameters
    path = way.branch.value
    tried = {*parameter.starts, found.get(parameter.name, parameter.starts[0])}
    tried |= set(path.positions.tolist()) if isinstance(path, Path) else set()
    return sorted(float(x) for x in tried if parameter.low <= x <= parameter.high)


def _covered(scene: Scene, shown: Floats) -> NDArray[np.bool_]:
    """Whether each row's test is one in which something was shown; (N,)."""
    test = scene.readings.test
    return np.isin(test, np.unique(test[np.abs(shown) > 1e-9]))
