"""Which reading would best separate the leading explanations, and by how much.

Two explanations that fit alike differ somewhere. For each test of the case the expected log odds of one more scan under
the same sun and sky are half the squared distance of the two predictions there, in the metric of noise and nuisances
(Box and Hill 1967, Technometrics 9: design for discrimination between models).
"""

from dataclasses import dataclass

import numpy as np

from analysis.explain.conclusion import Conclusion
from analysis.explain.fit import Fitter
from analysis.explain.hypothesis import Hypothesis
from analysis.explain.mechanisms.base import Mechanism, predict
from analysis.explain.scene import Scene

_WORTH = 1.0  # nats: a test that separates by less is not worth its time


@dataclass(frozen=True)
class NextMeasurement:
    """What to measure next.

    Attributes
    ----------
    statement
        In a sentence or two.
    would_separate
        Pairs of mechanisms that it tells apart.
    nats_per_test
        Expected log odds of one more test like each of the case's, best first.
    """

    statement: str
    would_separate: list[list[str]]
    nats_per_test: list[tuple[str, float]]


def next_measurement(scene: Scene, found: Conclusion) -> NextMeasurement:
    """Compare the accepted explanation with its best rival, test by test."""
    rivals = [h for h in found.singles if h.ids != found.best.ids and not set(h.ids) & set(found.best.ids)]
    if not found.best.ids or not rivals:
        return NextMeasurement("Nothing needs to be told apart.", [], [])
    first, rival = _first(found.best), rivals[0]
    statement = f"To tell {first.id} from {rival.ids[0]}: {first.tie_breaker or 'repeat under a very different sun'}."
    nats = _nats_per_test(scene, found.best, rival)
    if nats:
        statement += f" {_of_tests(scene, nats)}"
    return NextMeasurement(statement, [[first.id, rival.ids[0]]], nats)


def _first(h: Hypothesis) -> Mechanism:
    mechanism = h.fit.terms[0].mechanism if h.fit.terms else h.wanders[0].wander.mechanism
    assert mechanism is not None
    return mechanism


def _nats_per_test(scene: Scene, best: Hypothesis, rival: Hypothesis) -> list[tuple[str, float]]:
    """Expected nats of one more test like each; nothing where one of the two is a random effect alone."""
    if not best.fit.terms or not rival.fit.terms:
        return []
    r = scene.readings
    apart = r.stretched(predict(scene, best.fit.terms, best.fit.theta)) - r.stretched(
        predict(scene, rival.fit.terms, rival.fit.theta)
    )
    found = []
    for k in np.unique(r.test):
        rows = r.test == k
        squared = Fitter(scene.only(rows)).whitener(best.fit.hyper).squares(apart[rows][:, None])[0]
        found.append((r.case.tests[k].id, 0.5 * float(squared)))
    return sorted(found, key=lambda item: -item[1])


def _of_tests(scene: Scene, nats: list[tuple[str, float]]) -> str:
    r = scene.readings
    name, most = nats[0]
    if most < _WORTH:
        return f"One more test like those of this case would not tell them apart (at most {most:.1g} nats)."
    k = next(i for i, t in enumerate(r.case.tests) if t.id == name)
    sun = f", sun at {r.altitude_deg[k]:.0f}°" if np.isfinite(r.altitude_deg[k]) else ""
    sky = r.case.tests[k].sky or "sky not told"
    text = f"Of the tests of this case a repeat of {name} ({sky}{sun}) separates them best: {most:.1f} nats"
    return f"{text}; of {nats[-1][0]} least: {nats[-1][1]:.1f}." if len(nats) > 1 else f"{text}."
