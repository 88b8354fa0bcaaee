"""From evidence to a conclusion: which mechanisms are named, how surely, and what stays unnamed."""

from dataclasses import replace

import numpy as np

from analysis.cases.model import Floats
from analysis.explain import asked
from analysis.explain.alone import odd_readings
from analysis.explain.calibration import state
from analysis.explain.conclusion import Conclusion, Unnamed
from analysis.explain.families import CLOUD, PATTERN, SCAN_ORDER, named_wanders, unnamed_wanders
from analysis.explain.fit import Extra, Fit, posterior_covariance, without
from analysis.explain.hypothesis import Hypothesis
from analysis.explain.likelier import beforehand, unseen
from analysis.explain.mechanisms.base import Stage, predict
from analysis.explain.repeats import repeats
from analysis.explain.search import Search
from analysis.explain.shift_pattern import has_pattern
from analysis.explain.thresholds import (
    ALIKE,
    BASES,
    HOLDS_LAWS,
    LIKE_THE_BEST,
    NAME_FIRST_BELOW,
    NAME_SECOND_BELOW,
    RUNNER_UP,
    SHOWN,
    TEMPER,
    TEMPER_ONE,
)
from analysis.explain.told_pattern import with_its_pattern
from analysis.explain.verdict import decide, first_of, name_the_sure, share_of, share_with_doubles


def conclude(search: Search) -> Conclusion:
    """Search, compare, and decide."""
    nothing = search.nothing()
    found = Conclusion(best=nothing, nothing=nothing, singles=[], readings=len(search.scene.readings))
    found.singles = search.singles() + _wandering_beside(search, found, nothing, ())
    found.singles.sort(key=lambda h: -h.evidence)
    found.one_instrument = not bool(np.any(search.scene.is_gonio))
    found.pictures = bool(np.all(search.scene.is_sky))
    if found.one_instrument and np.any(search.scene.is_roof):
        found.level = float(np.median(nothing.fit.residual[search.scene.is_roof]))
    if not found.one_instrument:
        found.taken_by_lens = search.fitter.taken_by_lens(nothing.fit)
    found.nat = TEMPER_ONE if found.one_instrument else TEMPER
    if not np.any(search.scene.is_roof):  # such meters act on an arm by the split of sun and sky alone
        found.unseen = frozenset(m.id for m in search.mechanisms if m.stage is Stage.ROOF_METERS)
    found.lacked = search.scene.retraced.lacks if search.scene.retraced else frozenset()
    few = asked.share_of_few(search)
    named = [h for h in found.singles if h.evidence - nothing.evidence > asked.first(h, found, few)]
    if not found.one_instrument:
        named = [h for h in named if search.least_effect(h) > asked.least_effect(h, found)]
    else:
        named = [h for h in named if not asked.is_a_moment(h)]
    if named:
        found.best = first_of(named, found)
        _grow(search, found)
    elif not found.one_instrument:
        _name_two_together(search, found, few)
    found.best = with_its_pattern(search, found.best)
    found.alike = _not_told_apart(search, found.best)
    _look_for_unnamed(search, found)
    decide(found, few)
    found = _only_the_sure(search, found)
    state(found)
    share_with_doubles(found)
    if found.best.ids:
        _widen(search, found)
    return found


def _not_told_apart(search: Search, best: Hypothesis) -> frozenset[str]:
    """A lens that is stretched from one that is turned, where its prediction shows a pattern: any turn looks like some.

    (Of other authors' skylights with stretched lenses that were told, seven whose predictions show no pattern, or of
    tubes, were right; of seven others four were turned ones, by our account with a third of the evidence and less.)
    """
    stretched = any(asked.stretches(t) for t in best.fit.terms)
    return asked.ONE_PATTERN if stretched and has_pattern(search.scene) else frozenset()


def _only_the_sure(search: Search, found: Conclusion) -> Conclusion:
    """Name what all likely sets hold in place of what is doubtful; not where that changes too little by itself."""
    before = replace(found)
    if not name_the_sure(found):
        return found
    if search.least_effect(found.best) <= asked.least_effect(found.best, found):
        return replace(before, verdict="unexplained")
    found.best = with_its_pattern(search, found.best)
    _look_for_unnamed(search, found)
    return found


def _widen(search: Search, found: Conclusion) -> None:
    """Let the parameters' uncertainties hold what the forms themselves have wrong."""
    fit = found.best.fit
    whitener = search.fitter.whitener(fit.hyper, search.allowed(found.best))
    fit.covariance = posterior_covariance(whitener, fit) + (0.0 if fit.spread is None else fit.spread)
    if len(fit.terms) == 1 and fit.terms[0].mechanism.modelled_twice:
        fit.covariance = fit.covariance + _between_ways(fit, found)
    fit.covariance = fit.covariance + np.diag(np.square(_open_sizes(search, fit)))


def _open_sizes(search: Search, fit: Fit) -> Floats:
    """What forms leave open of each parameter (P,): their share of how far it is from changing nothing.

    Of a lone parameter that is the change it makes over the change per unit, whatever its scale.
    """
    r = search.scene.readings
    found: list[float] = []
    model = r.stretched(predict(search.scene, fit.terms, fit.theta))
    for k, term in enumerate(fit.terms):
        mine = slice(len(found), len(found) + len(term.parameters))
        sizes = np.array(
            [0.0 if q.direction else abs(x) for q, x in zip(term.parameters, fit.theta[mine], strict=True)]
        )
        if len(sizes) == 1:
            change = np.linalg.norm(model - r.stretched(predict(search.scene, *without(fit.terms, fit.theta, k))))
            per_unit = max(float(np.linalg.norm(fit.jacobian[:, mine])), 1e-12)
            at_most = sizes[0] if term.parameters[0].centre == 0.0 else np.inf
            sizes = np.array([min(change / per_unit, at_most)])
        found += (term.mechanism.size_error_in(search.scene, term.branch) * sizes).tolist()
    return np.array(found)


def _between_ways(fit: Fit, found: Conclusion) -> Floats:
    """Covariance (P, P) for what another way of modelling the same mechanism says, if that also explains much."""
    least = LIKE_THE_BEST * (fit.log_evidence - found.nothing.evidence)
    ways = next((h.ways for h in found.singles if h.ids == fit.ids), [])
    names = [p.name for p in fit.parameters]
    alike = [
        w.theta - fit.theta
        for w in ways
        if [p.name for p in w.parameters] == names and w.log_evidence - found.nothing.evidence > least
    ]
    return 0.5 * np.diag(np.max(np.square(alike), axis=0)) if alike else np.zeros((len(names), len(names)))


def _wandering_beside(
    search: Search, found: Conclusion, base: Hypothesis, extra: tuple[Extra, ...]
) -> list[Hypothesis]:
    """``base`` with each of the catalogue's random effects that repeated readings do not contradict."""
    tried = {m.id for m in search.mechanisms} - set(base.ids)
    kept = []
    for h in search.each_wandering(base, named_wanders(search.scene, tried), extra):
        wander = h.wanders[-1].wander
        told = repeats(search.scene, base.fit, h.wanders[-1]) if wander is CLOUD else None
        if told and told.contradict:
            found.contradicted[wander.name] = "readings of one direction at several moments of a test do not show it"
            continue
        if told and told.told > SHOWN:
            found.shown.add(wander.name)
        elif not base.ids and wander is not PATTERN:
            h.evidence -= HOLDS_LAWS * max(h.evidence - base.evidence, 0.0)
        kept.append(h)
    return kept


def _grow(search: Search, found: Conclusion) -> None:
    """Add a second and a third mechanism while the evidence carries them.

    Of two that act together a third may imitate the sum better than either does alone: so the runners-up are bases too,
    but no random effect that would not be named first, and nothing that no physics makes.
    """
    nothing = found.nothing.evidence
    least = nothing + min(RUNNER_UP * (found.best.evidence - nothing), found.best.evidence - nothing - 15.0)
    few = asked.share_of_few(search)
    near = [h for h in found.singles[:BASES] if h.ids and h.evidence > least]
    near = [h for h in near if not h.wanders or h.evidence - nothing > asked.first(h, found, few)]
    near = [h for h in near if not asked.absurd(h.fit)]
    bases = near if found.best in near else [found.best, *near]
    for _ in range(2):
        grown = [g for base in bases if (g := _one_more(search, found, base)) is not None]
        if not grown:
            return
        gain, best = max(grown, key=lambda item: _less_unseen(found, item[1]))
        if any(found.shares.get((_others(best.ids, m), m), 1.0) < found.sure_beside for m in best.ids):
            found.best = next(h for h in found.singles if set(h.ids) <= set(best.ids) and h.ids)
            return  # beside one of the two, another might stand for the other
        found.trail.append(f"{' + '.join(best.ids)} beats its parts by {gain:.1f} nats")
        found.best = best
        bases = [best]


def _less_unseen(found: Conclusion, h: Hypothesis) -> float:
    """Evidence of a set, less what is thought of instruments that no reading is of."""
    return h.evidence - found.temper(max(h.evidence - found.nothing.evidence, 0.0)) * unseen(found, h.ids)


def _name_two_together(search: Search, found: Conclusion, few: float) -> None:
    """Where no name gains enough by itself, two may that together gain it and each beside the other what a second must.

    Two that act together hide each other: either alone leaves what the other does, and counts for less beside that.
    Where a third does alone what two do together, two are no better known than one. (An aureole that had 58 nats, and
    was not told, for little was sure of it, left a clock and a wall that were told for 56.)
    """
    nothing = found.nothing.evidence
    bases = [h for h in found.singles[:BASES] if not h.wanders and h.evidence - nothing > NAME_FIRST_BELOW]
    grown = [g[1] for base in bases if not asked.absurd(base.fit) and (g := _one_more(search, found, base)) is not None]
    alone = {h.ids[0]: h.evidence for h in reversed(found.singles) if len(h.ids) == 1}
    told = [h for h in grown if h.evidence - nothing > asked.first(h, found, few)]
    third = max((h.evidence for h in found.singles if not h.wanders), default=nothing)
    told = [h for h in told if h.evidence > third]
    told = [h for h in told if min(h.evidence - alone.get(m, nothing) for m in h.ids) > NAME_SECOND_BELOW]
    found.best = max(told, key=lambda h: h.evidence, default=found.nothing)


def _one_more(search: Search, found: Conclusion, base: Hypothesis) -> tuple[float, Hypothesis] | None:
    """``base`` with one mechanism more, if that is accepted; evidence is put on the common scale of `Conclusion`."""
    extra = search.allowed(base)
    alone = search.reweighed(base, extra)
    candidates = search.beside(base, extra) + _wandering_beside(search, found, base, extra)
    candidates = [h for h in candidates if not asked.absurd(h.fit)]
    if not candidates:
        return None
    seen = [h for h in candidates if search.least_effect(h) > asked.least_effect(h, found) and not asked.is_a_moment(h)]
    best = _likeliest(found, seen or candidates, base, alone)
    gain = best.evidence - alone
    if base is found.best or base in found.singles[:1]:
        found.seconds = sorted(candidates, key=lambda h: -h.evidence)
    random = len(best.wanders) > len(base.wanders) and best.last not in found.shown
    (new,) = set(best.ids) - set(base.ids)
    share = share_of(found, best, base, candidates, gain)
    needed = asked.beside(best, base, found, new, random, share)
    # what gains too little to be told does not say either that others would do as well
    found.shares[frozenset(base.ids), new] = share if gain >= needed else 1.0
    found.considered.append((best.ids, base.evidence + gain - 0.5 * needed))
    if not seen or gain < needed or base.evidence + gain < found.best.evidence + needed:
        return None
    if share < found.sure_beside or _no_more_a_cloud(search, best):
        return None
    if asked.mistaken(base, new, base.evidence + gain, found):
        return None
    near = max(ALIKE, found.temper(gain))
    tied = (h for h in candidates if h.last in found.doubles(new) and abs(h.evidence - best.evidence) < near)
    best.tied = base.tied + tuple((new, h.last) for h in tied)
    best.added_to = base.first
    best.evidence = base.evidence + gain
    return gain, best


def _no_more_a_cloud(search: Search, h: Hypothesis) -> bool:
    """Whether a cloud that was there first is none beside what was added: repeated readings no longer show it."""
    return any(x.wander is CLOUD and repeats(search.scene, h.fit, x).contradict for x in h.wanders)


def _likeliest(found: Conclusion, candidates: list[Hypothesis], base: Hypothesis, alone: float) -> Hypothesis:
    """The best of what could be added to ``base``, which has some evidence ``alone``.

    No instrument that no reading is of, if another is hardly behind it; but what the prediction lacks by the case's own
    account, if it is hardly behind another.
    """
    nats = found.temper(max(h.evidence for h in candidates) - alone)
    ids = frozenset(base.ids)
    return max(candidates, key=lambda h: h.evidence + nats * beforehand(found, frozenset(h.ids) - ids))


def _others(ids: tuple[str, ...], name: str) -> frozenset[str]:
    return frozenset(ids) - {name}


def _look_for_unnamed(search: Search, found: Conclusion) -> None:
    """Does unnamed structure gain beside the best model, and how much would it gain alone?"""
    best = found.best
    extra = search.allowed(best)
    found.unnamed = _unnamed_beside(search, best, extra)
    if best.ids and not found.instead:  # a second look, beside other names, finds the same without any
        found.instead = _unnamed_beside(search, found.nothing, ())


def _unnamed_beside(search: Search, base: Hypothesis, extra: tuple[Extra, ...]) -> list[Unnamed]:
    """Unnamed structure that could stand beside ``base``, largest gain first."""
    alone = search.reweighed(base, extra)
    found = []
    for h in search.each_wandering(base, unnamed_wanders(search.scene), extra):
        some = h.wanders[-1]
        if some.wander.along == SCAN_ORDER and repeats(search.scene, base.fit, some).alone:
            continue  # what nadir alone does in the order of the planes is no function of time
        found.append(Unnamed(some.wander.along, h.evidence - alone, some.amplitude, weighed=h))
    whole = search.before_quieting
    if odd := odd_readings(whole, base.fit, extra):
        family, ways = odd
        h = whole.wandering(base, family, extra)
        gain = h.evidence - ways - whole.reweighed(base, extra)
        found.append(Unnamed(family.along, gain, h.wanders[-1].amplitude, single=True, weighed=h))
    for h in search.beside(base, extra, search.conjectures):
        law = h.fit.terms[-1]
        size = float(h.fit.theta[-len(law.parameters)])
        found.append(Unnamed(law.mechanism.id, h.evidence - alone, size, law, weighed=h))
    return sorted(found, key=lambda u: -u.gain)
