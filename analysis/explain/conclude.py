"""From evidence to a conclusion: which mechanisms are named, how surely, and what stays unnamed."""

from dataclasses import dataclass, field

import numpy as np

from analysis.explain.families import CLOUD, named_wanders, odd_readings, unnamed_wanders
from analysis.explain.fit import Extra, posterior_covariance
from analysis.explain.mechanisms.base import Term
from analysis.explain.repeats import repeats
from analysis.explain.search import Hypothesis, Search
from analysis.explain.thresholds import (
    APART,
    DOUBLES,
    IMITATION,
    LEAST_EFFECT,
    LEAST_EFFECT_FIRST,
    LEAST_ROUGH,
    MISFIT_LENS,
    MOST_MISFIT,
    NAME_FIRST,
    NAME_FIRST_BELOW,
    NAME_FIRST_LENS,
    NAME_FIRST_RANDOM,
    NAME_SECOND,
    NAME_SECOND_LENS,
    NAME_SECOND_RANDOM,
    NAMELESS,
    RELIABLE,
    ROUGH,
    SHOWN,
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
    trail: list[str] = field(default_factory=list)
    contradicted: dict[str, str] = field(default_factory=dict)
    shown: set[str] = field(default_factory=set)


def conclude(search: Search) -> Conclusion:
    """Search, compare, and decide."""
    nothing = search.nothing()
    found = Conclusion(best=nothing, nothing=nothing, singles=[])
    found.singles = search.singles() + _wandering_beside(search, found, nothing, ())
    found.singles.sort(key=lambda h: -h.evidence)
    found.one_instrument = not bool(np.any(search.scene.is_gonio))
    few = _few(search)
    named = [h for h in found.singles if h.evidence - nothing.evidence > _needed(h, found, few)]
    if not found.one_instrument:
        named = [h for h in named if search.least_effect(h) > LEAST_EFFECT_FIRST]
    if named:
        found.best = named[0]
        _grow(search, found)
    _look_for_unnamed(search, found)
    _decide(found, few)
    if found.best.ids:
        _widen(search, found)
    return found


def _needed(h: Hypothesis, found: Conclusion, few: float) -> float:
    """What a first mechanism must gain over "nothing"."""
    if h.wanders:
        return NAME_FIRST if h.ids[-1] in found.shown else few * NAME_FIRST_RANDOM
    if any(t.mechanism.like_a_lens for t in h.fit.terms):
        return NAME_FIRST_LENS
    return NAME_FIRST if found.one_instrument else NAME_FIRST_BELOW


def _few(search: Search) -> float:
    """Share of a threshold that guards against ripple: where there are few readings, ripple cannot add up."""
    return float(np.clip(np.sqrt(len(search.scene.readings) / 1000.0), 0.25, 1.0))


def _widen(search: Search, found: Conclusion) -> None:
    """Let the parameters' uncertainties hold what the forms themselves have wrong."""
    fit = found.best.fit
    random = tuple(w.extra(search.scene, a, x) for w, a, x in found.best.wanders)
    whitener = search.fitter.whitener(fit.hyper, (*search.form_error(fit), *random))
    fit.covariance = posterior_covariance(whitener, fit) + (0.0 if fit.spread is None else fit.spread)


def _wandering_beside(
    search: Search, found: Conclusion, base: Hypothesis, extra: tuple[Extra, ...]
) -> list[Hypothesis]:
    """``base`` with each of the catalogue's random effects that repeated readings do not contradict."""
    tried = {m.id for m in search.mechanisms if m.random} - set(base.ids)
    kept = []
    for wander in named_wanders(search.scene, tried):
        h = search.wandering(base, wander, extra)
        _, amplitude, length = h.wanders[-1]
        told = repeats(search.scene, base.fit, wander, amplitude, length) if wander is CLOUD else None
        if told and told.contradict:
            found.contradicted[wander.name] = "readings of one direction at several moments of a test do not show it"
            continue
        if told and told.gain > SHOWN:
            found.shown.add(wander.name)
        kept.append(h)
    return kept


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
    extra = (*search.form_error(base.fit), *(w.extra(search.scene, a, x) for w, a, x in base.wanders))
    alone = search.reweighed(base, extra)
    candidates = search.beside(base, extra) + _wandering_beside(search, found, base, extra)
    if not candidates:
        return None
    seen = [h for h in candidates if search.least_effect(h) > LEAST_EFFECT]
    best = max(seen or candidates, key=lambda h: h.evidence)
    gain = best.evidence - alone
    if base is found.best or base in found.singles[:1]:
        found.seconds = sorted(candidates, key=lambda h: -h.evidence)
    random = len(best.wanders) > len(base.wanders) and best.ids[-1] not in found.shown
    needed = NAME_SECOND_RANDOM if random else NAME_SECOND_LENS if _like_a_lens(best, base) else NAME_SECOND
    needed += _misfit(base, found.nothing)
    if not seen or gain < needed or base.evidence + gain < found.best.evidence + needed:
        return None
    if not _stands_out(best, base, candidates):
        return None
    best.evidence = base.evidence + gain
    return gain, best


def _like_a_lens(h: Hypothesis, base: Hypothesis) -> bool:
    """Whether what ``h`` adds to ``base`` looks like a lens simulated a little wrong."""
    return any(t.mechanism.like_a_lens for t in h.fit.terms if t.mechanism.id not in base.ids)


def _misfit(h: Hypothesis, nothing: Hypothesis) -> float:
    """Evidence [nats] that forms as wrong as those of ``h`` may be leave for others to take."""
    gain = max(h.evidence - nothing.evidence, 0.0)
    if any(t.mechanism.like_a_lens for t in h.fit.terms):
        return MISFIT_LENS * gain
    wrong = max((t.mechanism.form_error for t in h.fit.terms), default=0.0)
    return min(wrong**2 * gain, MOST_MISFIT)


def _look_for_unnamed(search: Search, found: Conclusion) -> None:
    """Does unnamed structure gain beside the best model, and how much would it gain alone?"""
    best = found.best
    extra: tuple[Extra, ...] = (
        *search.form_error(best.fit),
        *(w.extra(search.scene, a, x) for w, a, x in best.wanders),
    )
    found.unnamed = _unnamed_beside(search, best, extra)
    if best.ids:
        alone = _unnamed_beside(search, found.nothing, ())
        found.unnamed_alone = max((u.gain for u in alone if u.conjecture is None), default=0.0)
        found.law_alone = max((u.gain for u in alone if u.conjecture is not None), default=-np.inf)


def _unnamed_beside(search: Search, base: Hypothesis, extra: tuple[Extra, ...]) -> list[Unnamed]:
    """Unnamed structure that could stand beside ``base``, largest gain first."""
    alone = search.reweighed(base, extra)
    families = [(family, 0.0) for family in unnamed_wanders(search.scene)]
    if odd := odd_readings(search.scene, base.fit, search.fitter.whitener(base.fit.hyper, extra)):
        families.append(odd)
    found = []
    for family, ways in families:
        h = search.wandering(base, family, extra)
        found.append(Unnamed(family.along, h.evidence - ways - alone, h.wanders[-1][1]))
    for h in search.beside(base, extra, search.conjectures):
        law = h.fit.terms[-1]
        found.append(Unnamed(law.mechanism.id, h.evidence - alone, float(h.fit.theta[-1]), law))
    return sorted(found, key=lambda u: -u.gain)


def _decide(found: Conclusion, few: float) -> None:
    left = found.unnamed[0].gain if found.unnamed else 0.0
    gain = found.best.evidence - found.nothing.evidence
    imitation = 1.0 if found.one_instrument else IMITATION
    imitated = found.unnamed_alone > imitation * gain + UNNAMED
    if not found.best.ids:
        found.verdict = "unexplained" if left > few * UNNAMED_ALONE or _rough(found) else "no-mismatch"
    elif left > UNNAMED + min(_misfit(found.best, found.nothing), MOST_MISFIT) or _rough(found):
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


def _stands_out(best: Hypothesis, base: Hypothesis, candidates: list[Hypothesis]) -> bool:
    """Whether what ``best`` adds to ``base`` is surely the one, among all that could be added."""
    odds = np.array([(h.evidence - best.evidence) / TEMPER for h in candidates])
    share = np.exp(odds - np.logaddexp.reduce(odds))
    (new,) = set(best.ids) - set(base.ids)
    others = [next(iter(set(h.ids) - set(base.ids))) for h in candidates]
    return float(sum(s for m, s in zip(others, share, strict=True) if m == new or _double(m, new))) > SURE


def _probabilities(found: Conclusion) -> None:
    """Posterior over nothing, singles, the accepted set, and unnamed structure; tempered."""
    top = found.best.evidence
    logs: dict[tuple[str, ...], float] = {(): found.nothing.evidence}
    for h in found.singles:
        logs[h.ids] = max(h.evidence, logs.get(h.ids, -np.inf))
    left = found.unnamed[0].gain if found.unnamed else 0.0
    logs[found.best.ids] = top
    # what is left beside the named does not speak against it, and would be left beside its rivals as well
    unnamed = max(found.unnamed_alone - max(left, 0.0), 0.0) if found.best.ids else left
    logs[("unnamed",)] = found.nothing.evidence + unnamed - NAMELESS
    values = np.array([v / TEMPER for v in logs.values()])
    share = np.exp(values - np.logaddexp.reduce(values))
    ranked = sorted(zip(logs, share, strict=True), key=lambda item: -item[1])
    for m in found.best.ids:
        found.probability[m] = RELIABLE * float(sum(s for ids, s in ranked if m in ids))
    found.alternatives = [(ids, float(s)) for ids, s in ranked if ids not in {found.best.ids, (), ("unnamed",)}][:5]
    if found.best.ids and len(found.best.ids) == 1:
        for h in found.singles[1:]:
            if h.ids != found.best.ids and found.singles[0].evidence - h.evidence < APART:
                found.indistinguishable.append((found.best.ids[0], h.ids[0]))
