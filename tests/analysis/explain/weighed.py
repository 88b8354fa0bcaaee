"""Hypotheses with the evidence that a test wants them to have, for what is concluded from evidence."""

from dataclasses import replace

import numpy as np

from analysis.explain.conclusion import Conclusion, Unnamed
from analysis.explain.fit import Fit
from analysis.explain.hypers import Hyper
from analysis.explain.hypothesis import Hypothesis
from analysis.explain.mechanisms.base import Branch, Term
from analysis.explain.mechanisms.catalogue import BY_ID
from analysis.explain.mechanisms.conjectures import CONJECTURES
from analysis.explain.mechanisms.states import terms_of
from analysis.explain.retrace import Path
from analysis.explain.scene import Scene
from analysis.explain.thresholds import (
    TEMPER_ONE,
)
from analysis.explain.verdict import decide

USUAL = Hyper(1.0, 1.0, 1.0)


def hypothesis(scene: Scene, gain: float, *ids: str) -> Hypothesis:
    terms = tuple(terms_of(BY_ID[name], scene)[0] for name in ids)
    return Hypothesis(
        Fit(terms, np.zeros(sum(len(t.parameters) for t in terms)), np.zeros(0), np.zeros((0, 0)), hyper=USUAL), gain
    )


def law(scene: Scene, gain: float) -> Unnamed:
    """A law outside the catalogue that gains so much in place of all names."""
    (mechanism,) = [m for m in CONJECTURES if m.id == "arm-sag"]
    return Unnamed("arm-sag", gain, 1.0, Term(mechanism, Branch(), mechanism.parameters))


def decided(
    scene: Scene,
    *singles: tuple[str, float],
    left: float = 0.0,
    law_alone: float = -np.inf,
    considered: tuple[tuple[tuple[str, ...], float], ...] = (),
    hyper: Hyper = USUAL,
    unseen: tuple[str, ...] = (),
) -> Conclusion:
    """A conclusion that names the first single, with the evidence that each single gains."""
    found = [hypothesis(scene, gain, name) for name, gain in singles]
    found[0].fit.hyper = hyper
    conclusion = Conclusion(found[0], hypothesis(scene, 0.0), found, considered=list(considered))
    conclusion.unseen = frozenset(unseen)
    conclusion.instead = [law(scene, law_alone)]
    conclusion.unnamed = [Unnamed("gamma", left, 0.1)]
    decide(conclusion, 1.0)
    return conclusion


def on_another_lens(found: Conclusion, *, of_case: bool = False) -> None:
    """Let what is named have been traced, or come with the case."""
    (way,) = found.best.fit.terms
    one = np.ones((2, 1, 1, 1))
    turned = Path("own re-simulation", way.parameters[0], np.array([0.0, 30.0]), one, one, of_case=of_case)
    found.best.fit.terms = (replace(way, branch=Branch("own re-simulation", turned)),)


def pair_and_rival(picture: Scene, first: float, rival: float, both: float) -> Conclusion:
    """Vignetting, which came first, and a projection, each told beside a rival that imitates their sum."""
    single = hypothesis(picture, first, "vignetting")
    singles = [hypothesis(picture, rival, "nonlinearity"), single]
    found = Conclusion(single, hypothesis(picture, 0.0), singles, one_instrument=True, nat=TEMPER_ONE)
    found.best = hypothesis(picture, both, "vignetting", "projection-error")
    found.best.added_to = "vignetting"
    found.shares = {(frozenset({"vignetting"}), "projection-error"): 1.0}
    return found
