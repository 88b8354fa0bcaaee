"""The verdict: what the search came to, and how surely each name is right."""

from dataclasses import dataclass, field

import numpy as np

from analysis.explain.mechanisms.base import Term
from analysis.explain.retrace import Path
from analysis.explain.search import Hypothesis
from analysis.explain.thresholds import (
    APART,
    DOUBLES,
    IMITATION,
    LEAST_ROUGH,
    MISFIT_LENS,
    MISFIT_LIKE_A_LENS,
    MOST_MISFIT,
    NAMELESS,
    RELIABLE,
    ROUGH,
    SURE,
    TEMPER,
    UNNAMED,
    UNNAMED_ALONE,
)


@dataclass(frozen=True)
class Unnamed:
    """Structure that no catalogued mechanism explains.

    Attributes
    ----------
    along
        What it varies with, in words; the id of a conjecture.
    gain
        Nats of log evidence.
    size
        Its amplitude (relative), or the conjecture's last parameter.
    conjecture
        A law that fits it, of physics beyond the catalogue.
    """

    along: str
    gain: float
    size: float
    conjecture: Term | None = None


@dataclass
class Conclusion:
    """What the search came to.

    Attributes
    ----------
    best
        The accepted hypothesis (may be "nothing").
    nothing, singles
        What it was compared with; singles are sorted, best first.
    unnamed
        Unnamed structure that still gains beside the best, largest gain first.
    unnamed_alone
        Best gain of an unnamed family without any named mechanism [nats].
    one_instrument
        Whether only a meter or a camera was read, no goniometer.
    law_alone
        The same of a law that is not in the catalogue.
    considered
        Further sets of names with their evidence, less what a name more has to bring.
    contradicted, shown
        Random effects that repeated readings speak against (and how), and those that they show by themselves.
    """

    best: Hypothesis
    nothing: Hypothesis
    singles: list[Hypothesis]
    verdict: str = "no-mismatch"
    probability: dict[str, float] = field(default_factory=dict)
    alternatives: list[tuple[tuple[str, ...], float]] = field(default_factory=list)
    indistinguishable: list[tuple[str, str]] = field(default_factory=list)
    unnamed: list[Unnamed] = field(default_factory=list)
    unnamed_alone: float = 0.0
    law_alone: float = -np.inf
    one_instrument: bool = False
    seconds: list[Hypothesis] = field(default_factory=list)
    considered: list[tuple[tuple[str, ...], float]] = field(default_factory=list)
    trail: list[str] = field(default_factory=list)
    contradicted: dict[str, str] = field(default_factory=dict)
    shown: set[str] = field(default_factory=set)

    @property
    def imitation(self) -> float:
        """How many times a name's gain a smooth function must gain to speak against it."""
        return 1.0 if self.one_instrument else IMITATION


def decide(found: Conclusion, few: float) -> None:
    """Set the verdict, probabilities, and what cannot be told apart."""
    left = found.unnamed[0].gain if found.unnamed else 0.0
    gain = found.best.evidence - found.nothing.evidence
    imitated = found.unnamed_alone > found.imitation * gain + UNNAMED
    if not found.best.ids:
        found.verdict = "unexplained" if left > few * UNNAMED_ALONE or _rough(found) else "no-mismatch"
    elif left > UNNAMED + min(misfit(found.best, found.nothing), MOST_MISFIT) or _rough(found):
        wrong = imitated or found.law_alone > gain or (_rough(found) and gain < LEAST_ROUGH)
        found.verdict = "unexplained" if wrong else "partly-explained"
    elif imitated or found.law_alone > gain + APART:
        found.verdict = "unexplained"
    elif not found.best.fit.ids:  # a random effect says how readings scatter together, but predicts none of them
        found.verdict = "partly-explained"
    else:
        found.verdict = "explained"
    _probabilities(found)
    if found.best.ids and _sure(found) < SURE:
        found.verdict = "unexplained"


def _rough(found: Conclusion) -> bool:
    """Whether what is left below a skylight is larger or rougher than simulations usually leave."""
    hyper = found.best.fit.hyper
    return not found.one_instrument and (hyper.shape > ROUGH.shape or hyper.scatter > ROUGH.scatter)


def _sure(found: Conclusion) -> float:
    """Probability of the first named mechanism, or of its double."""
    first = found.best.ids[0]
    alike = sum(p for ids, p in found.alternatives if len(ids) == 1 and _double(ids[0], first))
    return found.probability[first] + alike


def _double(one: str, other: str) -> bool:
    return any({one, other} <= pair for pair in DOUBLES)


def stands_out(best: Hypothesis, base: Hypothesis, candidates: list[Hypothesis]) -> bool:
    """Whether what ``best`` adds to ``base`` is surely the one, among all that could be added."""
    odds = np.array([(h.evidence - best.evidence) / TEMPER for h in candidates])
    share = np.exp(odds - np.logaddexp.reduce(odds))
    (new,) = set(best.ids) - set(base.ids)
    others = [next(iter(set(h.ids) - set(base.ids))) for h in candidates]
    return float(sum(s for m, s in zip(others, share, strict=True) if m == new or _double(m, new))) > SURE


def misfit(h: Hypothesis, nothing: Hypothesis) -> float:
    """Evidence [nats] that forms as wrong as those of ``h`` may be leave for others to take."""
    gain = max(h.evidence - nothing.evidence, 0.0)
    if any(t.mechanism.like_a_lens and isinstance(t.branch.value, Path) for t in h.fit.terms):
        return MISFIT_LENS * gain
    if any(t.mechanism.like_a_lens for t in h.fit.terms):
        return MISFIT_LIKE_A_LENS * gain
    wrong = max((t.mechanism.form_error for t in h.fit.terms), default=0.0)
    return min(wrong**2 * gain, MOST_MISFIT)


def _probabilities(found: Conclusion) -> None:
    """Posterior over nothing, singles, the accepted set, and unnamed structure; tempered."""
    top = found.best.evidence
    logs: dict[tuple[str, ...], float] = {(): found.nothing.evidence}
    for h in found.singles:
        logs[h.ids] = max(h.evidence, logs.get(h.ids, -np.inf))
    for ids, evidence in found.considered:
        logs[ids] = max(evidence, logs.get(ids, -np.inf))
    left = found.unnamed[0].gain if found.unnamed else 0.0
    logs[found.best.ids] = top
    # what is left beside the named does not speak against it, and would be left beside its rivals as well
    unnamed = max(found.unnamed_alone / found.imitation - max(left, 0.0), 0.0) if found.best.ids else left
    logs[("unnamed",)] = found.nothing.evidence + unnamed - NAMELESS
    values = np.array([v / TEMPER for v in logs.values()])
    share = np.exp(values - np.logaddexp.reduce(values))
    ranked = sorted(zip(logs, share, strict=True), key=lambda item: -item[1])
    for m in found.best.ids:
        found.probability[m] = RELIABLE * float(sum(s for ids, s in ranked if m in ids))
    found.alternatives = [(ids, float(s)) for ids, s in ranked if ids not in {found.best.ids, (), ("unnamed",)}][:5]
    found.indistinguishable += [*_like_the_first(found), *found.best.tied]


def _like_the_first(found: Conclusion) -> list[tuple[str, str]]:
    """The first name, and what would do as well in its place; beside others, only its doubles."""
    ids = found.best.ids
    alone = [h for h in found.singles if h.ids == ids[:1]]
    if not alone:
        return []
    near = [h for h in found.singles if h.ids not in ((), ids[:1]) and alone[0].evidence - h.evidence < APART]
    return [(ids[0], h.ids[0]) for h in near if len(ids) == 1 or _double(ids[0], h.ids[0])]
