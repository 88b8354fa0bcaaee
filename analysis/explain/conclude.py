"""From evidence to a conclusion: which mechanisms are named, how surely, and what stays unnamed.

Thresholds are in nats of log evidence. They were set on null worlds and on pairs made by the blind trial's generator
(docs/explaining.md says how, and what they give there).
"""

from dataclasses import dataclass, field

import numpy as np

from analysis.explain.families import named_wanders, unnamed_wanders
from analysis.explain.fit import Extra, Fit, posterior_covariance
from analysis.explain.search import Hypothesis, Search, best_hypers

NAME_FIRST = 8.0
"""A first mechanism must beat "nothing" by this."""
NAME_FIRST_RANDOM = 25.0
"""The same for a random effect: it also leans on a simulation's own ripple."""
NAME_SECOND = 18.0
"""A second (third) must beat the first alone by this, its form error allowed for."""
UNNAMED = 15.0
"""Unnamed structure beside a named mechanism must gain this before something is said to be left."""
UNNAMED_ALONE = 25.0
"""Unnamed structure alone must gain this before something is said to be there."""
NAME_SECOND_RANDOM = 60.0
"""The same for a random effect, which can lean on whatever another form has left."""
LEAST_EFFECT = 0.012
"""A second (third) mechanism must change the readings by this (rms, relative, a gain per test removed): the forms are
not right to better than that."""
APART = 3.0
"""Hypotheses closer than this are not told apart."""
SURE = 0.5
"""A mechanism (with those that cannot be told from it) less probable than this is not named: that is to abstain."""
TEMPER = 1.6
"""Evidence is divided by this before it becomes probability: forms are never quite right."""


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
        Unnamed families that still gain beside the best: (family, nats).
    unnamed_alone
        Best gain of an unnamed family without any named mechanism [nats].
    one_instrument
        Whether only a meter or a camera was read, no goniometer.
    law_alone
        The same of a law that is not in the catalogue.
    """

    best: Hypothesis
    nothing: Hypothesis
    singles: list[Hypothesis]
    verdict: str = "no-mismatch"
    probability: dict[str, float] = field(default_factory=dict)
    alternatives: list[tuple[tuple[str, ...], float]] = field(default_factory=list)
    indistinguishable: list[tuple[str, str]] = field(default_factory=list)
    unnamed: list[tuple[Hypothesis, float]] = field(default_factory=list)
    unnamed_alone: float = 0.0
    law_alone: float = -np.inf
    one_instrument: bool = False
    seconds: list[Hypothesis] = field(default_factory=list)
    trail: list[str] = field(default_factory=list)


def conclude(search: Search) -> Conclusion:
    """Search, compare, and decide."""
    nothing = search.nothing()
    singles = search.singles() + _wandering_singles(search, nothing)
    singles.sort(key=lambda h: -h.evidence)
    found = Conclusion(best=nothing, nothing=nothing, singles=singles)
    found.one_instrument = not bool(np.any(search.scene.is_gonio))
    few = _few(search)
    needs = {True: few * NAME_FIRST_RANDOM, False: NAME_FIRST}
    named = [h for h in singles if h.evidence - nothing.evidence > needs[bool(h.wanders)]]
    if named:
        found.best = named[0]
        _grow(search, found)
    _look_for_unnamed(search, found)
    _decide(found, few)
    if found.best.ids:
        _widen(search, found)
    return found


def _few(search: Search) -> float:
    """Share of a threshold that guards against ripple: where there are few readings, ripple cannot add up."""
    return float(np.clip(np.sqrt(len(search.scene.readings) / 1000.0), 0.25, 1.0))


def _widen(search: Search, found: Conclusion) -> None:
    """Let the parameters' uncertainties hold what the forms themselves have wrong."""
    fit = found.best.fit
    random = tuple(w.extra(search.scene, a, x) for w, a, x in found.best.wanders)
    whitener = search.fitter.whitener(fit.hyper, (*search.form_error(fit), *random))
    fit.covariance = posterior_covariance(whitener, fit) + (0.0 if fit.spread is None else fit.spread)


def _wandering_singles(search: Search, nothing: Hypothesis) -> list[Hypothesis]:
    tried = {m.id for m in search.mechanisms if m.random}
    return [search.wandering(nothing, w, (), search.fitter.grid) for w in named_wanders(search.scene, tried)]


def _grow(search: Search, found: Conclusion) -> None:
    """Add a second and a third mechanism while the evidence carries them."""
    near = [h for h in found.singles[:3] if h.evidence > found.best.evidence - 15.0]
    bases = near if found.best in near else [found.best]
    for _ in range(2):
        grown = [g for base in bases if (g := _one_more(search, found, base)) is not None]
        if not grown:
            return
        gain, best = max(grown, key=lambda item: item[1].evidence)
        found.trail.append(f"{' + '.join(best.ids)} beats its parts by {gain:.1f} nats")
        found.best = best
        bases = [best]


def _one_more(search: Search, found: Conclusion, base: Hypothesis) -> tuple[float, Hypothesis] | None:
    """``base`` with one mechanism more, if that is accepted; evidence is put on the common scale of `Conclusion`."""
    grid = best_hypers(base.fit, 6)
    extra = (*search.form_error(base.fit), *(w.extra(search.scene, a, x) for w, a, x in base.wanders))
    alone = search.reweighed(base, extra, grid)
    candidates = search.beside(base, grid, extra)
    tried = {m.id for m in search.mechanisms if m.random} - set(base.ids)
    candidates += [search.wandering(base, w, extra, grid) for w in named_wanders(search.scene, tried)]
    if not candidates:
        return None
    seen = [h for h in candidates if search.least_effect(h) > LEAST_EFFECT]
    best = max(seen or candidates, key=lambda h: h.evidence)
    gain = best.evidence - alone
    if base is found.best or base in found.singles[:1]:
        found.seconds = sorted(candidates, key=lambda h: -h.evidence)
    random = len(best.wanders) > len(base.wanders)
    needed = NAME_SECOND_RANDOM if random else NAME_SECOND
    if not seen or gain < needed or base.evidence + gain < found.best.evidence + needed:
        return None
    best.evidence = base.evidence + gain
    return gain, best


def _look_for_unnamed(search: Search, found: Conclusion) -> None:
    """Does unnamed structure gain beside the best model, and how much would it gain alone?"""
    best = found.best
    extra: tuple[Extra, ...] = (
        *search.form_error(best.fit),
        *(w.extra(search.scene, a, x) for w, a, x in best.wanders),
    )
    grid = best_hypers(best.fit, 6)
    alone = search.reweighed(best, extra, grid)
    for family in unnamed_wanders(search.scene):
        with_it = search.wandering(best, family, extra, grid)
        found.unnamed.append((with_it, with_it.evidence - alone))
    found.unnamed.sort(key=lambda item: -item[1])
    if best.ids:
        grid = best_hypers(found.nothing.fit, 6)
        base = search.reweighed(found.nothing, (), grid)
        gains = [search.wandering(found.nothing, f, (), grid).evidence - base for f in unnamed_wanders(search.scene)]
        found.unnamed_alone = max(gains, default=0.0)
        found.law_alone = max((h.evidence - found.nothing.evidence for h in search.laws()), default=-np.inf)


def _decide(found: Conclusion, few: float) -> None:
    left = found.unnamed[0][1] if found.unnamed else 0.0
    gain = found.best.evidence - found.nothing.evidence
    if not found.best.ids:
        found.verdict = "unexplained" if left > few * UNNAMED_ALONE else "no-mismatch"
    elif left > UNNAMED:
        found.verdict = "partly-explained" if gain > found.unnamed_alone else "unexplained"
    elif found.unnamed_alone > gain + UNNAMED or found.law_alone > gain + APART:
        found.verdict = "unexplained"
    elif not found.best.fit.ids:  # a random effect says how readings scatter together, but predicts none of them
        found.verdict = "partly-explained"
    else:
        found.verdict = "explained"
    _probabilities(found)
    if found.best.ids and _sure(found) < SURE:
        found.verdict = "unexplained"


def _sure(found: Conclusion) -> float:
    """Probability of the first named mechanism, or of one that cannot be told from it."""
    first = found.best.ids[0]
    group = {first, *(other for one, other in found.indistinguishable if one == first)}
    alike = sum(p for ids, p in found.alternatives if len(ids) == 1 and ids[0] in group)
    return found.probability[first] + alike


def _probabilities(found: Conclusion) -> None:
    """Posterior over nothing, singles, the accepted set, and unnamed structure; tempered."""
    top = found.best.evidence
    logs: dict[tuple[str, ...], float] = {(): found.nothing.evidence}
    for h in found.singles:
        logs[h.ids] = max(h.evidence, logs.get(h.ids, -np.inf))
    left = found.unnamed[0][1] if found.unnamed else 0.0
    # what is left beside it does not speak against it; where one instrument was read it would fit beside others as well
    shared = max(left, 0.0)
    beside = 0.0 if found.one_instrument else shared
    logs[found.best.ids] = top + beside
    logs[("unnamed",)] = (
        found.nothing.evidence + max(found.unnamed_alone, 0.0 if found.best.ids else left) - np.log(4.0)
    )
    if found.best.ids and found.one_instrument:
        logs[("unnamed",)] -= shared
    values = np.array([v / TEMPER for v in logs.values()])
    share = np.exp(values - np.logaddexp.reduce(values))
    ranked = sorted(zip(logs, share, strict=True), key=lambda item: -item[1])
    for m in found.best.ids:
        found.probability[m] = float(sum(s for ids, s in ranked if m in ids))
    found.alternatives = [(ids, float(s)) for ids, s in ranked if ids not in {found.best.ids, (), ("unnamed",)}][:5]
    if found.best.ids and len(found.best.ids) == 1:
        for h in found.singles[1:]:
            if h.ids != found.best.ids and found.singles[0].evidence - h.evidence < APART:
                found.indistinguishable.append((found.best.ids[0], h.ids[0]))


def joint_sd(fit: Fit) -> np.ndarray:
    """Standard deviations of a fit's parameters; shape (P,)."""
    return np.asarray(np.sqrt(np.diag(fit.covariance)))
