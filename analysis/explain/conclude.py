"""From evidence to a conclusion: which mechanisms are named, how surely, and what stays unnamed."""

from dataclasses import replace

import numpy as np

from analysis.cases.model import Floats
from analysis.explain import asked
from analysis.explain.alone import odd_readings
from analysis.explain.calibration import state
from analysis.explain.conclusion import Conclusion, Unnamed
from analysis.explain.families import SCAN_ORDER, unnamed_wanders
from analysis.explain.fit import Extra, Fit, posterior_covariance, without
from analysis.explain.further import grow, name_two_together, wandering_beside
from analysis.explain.heldout import HeldOut, held_out
from analysis.explain.hypothesis import Hypothesis
from analysis.explain.mechanisms.base import Stage, predict
from analysis.explain.mechanisms.sensors import Nonlinearity, Saturation
from analysis.explain.repeats import repeats
from analysis.explain.search import Search
from analysis.explain.shift_pattern import has_pattern
from analysis.explain.thresholds import (
    LIKE_THE_BEST,
    TEMPER,
    TEMPER_ONE,
)
from analysis.explain.told_form import ends_softly
from analysis.explain.told_pattern import with_its_pattern
from analysis.explain.verdict import decide, first_of, name_the_sure, no_better, share_with_doubles


def conclude(search: Search) -> Conclusion:
    """Search, compare, and decide."""
    nothing = search.nothing()
    found = Conclusion(best=nothing, nothing=nothing, singles=[], readings=len(search.scene.readings))
    found.singles = search.singles() + wandering_beside(search, found, nothing, ())
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
    found.enough = frozenset(h.ids[0] for h in named if not h.wanders)
    if named:
        found.best = first_of(named, found)
        grow(search, found)
    elif not found.one_instrument:
        name_two_together(search, found, few)
    found.best = with_its_pattern(search, found.best)
    found.alike = _not_told_apart(search, found.best)
    _look_for_unnamed(search, found)
    decide(found, few)
    found = _only_the_sure(search, found)
    _what_others_bear_out(search, found)
    state(found)
    share_with_doubles(found)
    if found.best.ids:
        _widen(search, found)
    return found


def _not_told_apart(search: Search, best: Hypothesis) -> frozenset[str]:
    """Names that another may bear as well, whatever our forms of that gain.

    A lens that is stretched may be turned, where its prediction shows a pattern: any turn looks like some stretch. (Of
    other authors' skylights with stretched lenses that were told, five whose predictions show no pattern, or of tubes,
    were right; of eight others three were, four were turned ones, by our account with two fifths of the evidence and
    less, one was none.) A range that ends softly may be a response that bends (`SUDDEN`).
    """
    if any(asked.stretches(t) for t in best.fit.terms) and has_pattern(search.scene):
        return asked.ONE_PATTERN
    return frozenset({Saturation.id, Nonlinearity.id}) if ends_softly(best) else frozenset()


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


def _what_others_bear_out(search: Search, found: Conclusion) -> None:
    """Withdraw names by which tests that are left out are predicted no better; the first alone stays if it does better.

    (Of other authors' names below skylights five sets were so, each with a wrong one.)
    """
    found.outside = _left_out(search, found.kept)
    if found.one_instrument or found.kept is found.nothing or not no_better(found.outside):
        return
    first = found.best.first
    alone = next((h for h in found.singles if h.ids == (first,) != found.best.ids and h.fit.ids), None)
    outside = None if alone is None else _left_out(search, alone)
    found.trail.append("tests that are left out are predicted no better")
    if alone is None or outside is None or no_better(outside):
        found.verdict, found.withdrawn = "unexplained", True
        found.outside = _left_out(search, found.nothing)
        return
    found.best, found.verdict, found.outside = alone, "partly-explained", outside
    found.probability = {first: found.probability[first]}
    found.indistinguishable = [pair for pair in found.indistinguishable if first in pair]
    _look_for_unnamed(search, found)


def _left_out(search: Search, h: Hypothesis) -> HeldOut | None:
    return held_out(search.scene, h.fit.terms, h.fit.theta, h.fit.hyper)


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
