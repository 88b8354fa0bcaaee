"""Search the hypotheses: nothing, one mechanism, two, three; and structure that nobody has named.

Singles are all tried, with what their forms have wrong allowed for. A second mechanism is asked for only beside the
best singles, and accepted only with evidence to spare; likewise a third.
"""

from collections.abc import Callable, Iterable
from copy import copy
from dataclasses import replace
from functools import cached_property
from typing import TypeVar

import numpy as np
from scipy.special import softmax

from analysis.cases.model import Floats
from analysis.explain.abreast import abreast
from analysis.explain.clock_under_cloud import SHOWN_ITSELF, clock_under_cloud
from analysis.explain.conclusion import temper
from analysis.explain.evidence import inside
from analysis.explain.families import UNREST
from analysis.explain.fit import MIDDLE, Extra, Fit, Fitter, posterior_covariance, without
from analysis.explain.form_error import form_error, locally_wrong
from analysis.explain.hypers import STRIDES
from analysis.explain.hypothesis import Hypothesis
from analysis.explain.mechanisms.base import Mechanism, Term, predict
from analysis.explain.mechanisms.catalogue import CATALOGUE
from analysis.explain.mechanisms.conjectures import CONJECTURES
from analysis.explain.mechanisms.states import terms_of
from analysis.explain.thresholds import ALIKE, AS_IT_IS, BENDS_AMONG_WAYS, STANDS_IN, TEMPER_ONE
from analysis.explain.wander import Wander, likeliest

X = TypeVar("X")
Y = TypeVar("Y")

_STARTS = 2
_PROMISING = 12.0
"""A mechanism is fitted beside others only where it may lower the objective by this (twice the nats it could gain)."""


_HOPELESS = 100.0
"""What raises the objective by so much is not weighed at sizes of its own."""
_A_SHARE = 0.25
"""What its form may have wrong is asked of mechanisms that gain such a share of what the best gains."""
_LARGER = (1.0, 4.0)
"""Fits with the error of a form begin at so many times the change that was found without."""
_BY_CHANGE = 8.0
"""What a change must tell by itself [nats] where its form's error is allowed for."""


class Search:
    """One search over one scene."""

    def __init__(
        self,
        fitter: Fitter,
        mechanisms: Iterable[Mechanism] = CATALOGUE,
        conjectures: Iterable[Mechanism] = CONJECTURES,
    ) -> None:
        self.fitter = fitter
        self.scene = fitter.scene
        self.before_quieting = self
        self.not_tried: dict[str, str] = {}
        self.mechanisms = tuple(m for m in mechanisms if self._can_try(m))
        possible = [m for m in conjectures if set(m.kinds) & set(self.scene.kinds) and not m.why_not(self.scene)]
        self.conjectures = {m.id: terms_of(m, self.scene) for m in possible}
        known = {m.id: terms_of(m, self.scene) for m in self.mechanisms if not m.random}
        self._terms = {m: tuple(t for t in terms if not t.branch.of_random) for m, terms in known.items()}

    def _can_try(self, mechanism: Mechanism) -> bool:
        setup = self.scene.readings.case.setup
        if mechanism.id in setup.simulation.includes:
            because = "the prediction already models it"
        elif not set(mechanism.kinds) & set(self.scene.kinds):
            because = f"it cannot show in the channels of this case (it needs: {', '.join(mechanism.kinds)})"
        else:
            because = mechanism.why_not(self.scene)
        if because:
            self.not_tried[mechanism.id] = because
        return not because

    def quieter(self, alone: Floats) -> "Search":
        """The same search where readings may err by themselves (`Scene.alone`), begun where this one's looks ended."""
        self.fitter.forget()
        other = copy(self)
        other.fitter = Fitter(self.scene.quieted(alone))
        other.scene, other.before_quieting = other.fitter.scene, self
        return other

    # nothing and singles

    @cached_property
    def looks(self) -> dict[str, list[Fit]]:
        """Each parametric mechanism's most promising ways as they fit at usual sizes, not weighed."""
        return dict(zip(self._terms, self._abreast(self._fit_ways, self._terms.values(), size=len), strict=True))

    def nothing(self) -> Hypothesis:
        """The hypothesis that nothing was left out."""
        fit = self.fitter.fit((), np.zeros(0), MIDDLE)
        self.fitter.weigh([fit])
        return Hypothesis(fit, fit.log_evidence)

    def singles(self) -> list[Hypothesis]:
        """One hypothesis per parametric mechanism, best first."""
        alone = self.nothing()
        weighed = self._abreast(lambda looks: self._weighed(looks, alone), self.looks.values(), size=len)
        fits, nothing = dict(zip(self.looks, weighed, strict=True)), alone.evidence
        best = max((f.log_evidence for ways in fits.values() for f in ways), default=nothing)
        least = nothing + max(_A_SHARE * (best - nothing), 0.0)
        allowed = self._abreast(lambda ways: self._allowing_for_forms(ways, least), fits.values(), size=len)
        fits = dict(zip(fits, allowed, strict=True))
        for ways in fits.values():
            self._less_what_stands_in(ways, nothing)
        found = [self._joined(ways, len(self._terms[m])) for m, ways in fits.items() if ways]
        if self.scene.on_the_roof:
            shown = any(h.ids == (UNREST.name,) and h.evidence >= nothing + SHOWN_ITSELF for h in found)
            clock = clock_under_cloud(self.fitter, self._terms[UNREST.name]) if shown else None
            found += [] if clock is None else [clock]
        return sorted(found, key=lambda h: -h.evidence)

    @staticmethod
    def _less_what_stands_in(fits: list[Fit], without_it: float) -> None:
        """Take off what counts for nothing of the last mechanism's gain over evidence ``without_it``."""
        for f in (f for f in fits if f.terms[-1].branch.stands_in):
            f.log_evidence -= STANDS_IN * max(f.log_evidence - without_it, 0.0)

    def _fit_ways(self, terms: tuple[Term, ...]) -> list[Fit]:
        """Fit a mechanism's most promising ways, and the best of those that the case brings."""
        looks = []
        for term in terms:
            starts = self.fitter.scan_starts(term, MIDDLE)
            looks.append((starts[0][0], term, [s for _, s in starts[:_STARTS]]))
        looks.sort(key=lambda look: look[0])
        most = terms[0].mechanism.fitted_ways
        brought = [look for look in looks[most:] if look[1].branch.of_case]
        kept = looks[:most]
        kept += [] if any(look[1].branch.of_case for look in kept) else brought[:1]
        return [self._best_fit((term,), starts) for _, term, starts in kept]

    def _weighed(self, looks: list[Fit], nothing: Hypothesis) -> list[Fit]:
        """First looks' fits with their evidence; fitted again, if readings were quieted since.

        What fits far worse than nothing is told at the sizes where fits begin: at those where all is noise it may err.
        """
        whole, least = self.before_quieting is self, nothing.fit.objective
        fits = [replace(f) if whole else self.fitter.fit(f.terms, f.theta, MIDDLE) for f in looks]
        self.fitter.weigh([f for f in fits if f.objective <= least + _HOPELESS])
        for f in fits:
            if f.objective > least + _HOPELESS:
                f.log_evidence = nothing.evidence - 0.5 * (f.objective - least)
                f.covariance = posterior_covariance(self.fitter.whitener(MIDDLE), f)
        return fits

    def _abreast(
        self, work: Callable[[X], Y], items: Iterable[X], *shared: object, size: Callable[[X], int] | None = None
    ) -> list[Y]:
        """`abreast`, whose results may hold this search's terms."""
        terms = [t for ways in (*self._terms.values(), *self.conjectures.values()) for t in ways]
        return abreast(work, items, (*terms, *shared), size)

    def _allowing_for_forms(self, ways: list[Fit], least: float) -> list[Fit]:
        """The best way of each sort that may be locally wrong fitted again with that, if the mechanism tells enough."""
        wrong = [f for f in ways if np.any(locally_wrong(self.scene, f.terms, f.theta))]
        if not wrong or max(f.log_evidence for f in ways) < least:
            return ways
        wrong.sort(key=lambda f: f.log_evidence)
        best = {f.terms[-1].branch.sort: f for f in wrong}.values()
        return [self._allowing_for_form(f) if any(f is b for b in best) else f for f in ways]

    def _allowing_for_form(self, plain: Fit) -> Fit:
        """The fit with its own form's error, if the change itself tells something beside its error.

        The error grows with the change. A form that is taken for exact pays wherever it is wrong, and may be found too
        small: so one fit begins at a larger change.
        """
        centre = np.array([p.centre for p in plain.parameters])
        starts = [centre + factor * (plain.theta - centre) for factor in _LARGER]
        begun = [replace(plain, theta=inside(start, plain.parameters)) for start in starts]
        fits = [self._with_form_error(fit, STRIDES[:-1]) for fit in begun]
        fit = self._with_form_error(max(fits, key=lambda f: f.log_evidence), STRIDES[1:])
        told = self._told_by_change(fit, form_error(self.scene, fit.terms, fit.theta))
        return fit if fit.log_evidence > plain.log_evidence and told > _BY_CHANGE else plain

    def _with_form_error(self, fit: Fit, strides: tuple[int, ...]) -> Fit:
        """A fit again, with the error that its form has at its parameters."""
        extra = form_error(self.scene, fit.terms, fit.theta)
        again = self.fitter.fit(fit.terms, fit.theta, fit.hyper, extra)
        self.fitter.weigh([again], extra, strides=strides)
        return again

    def _told_by_change(self, fit: Fit, extra: tuple[Extra, ...]) -> float:
        """Nats that the change of a fit brings over its form's error alone: any scatter is explained by an error."""
        without_it = self.fitter.residual((), np.zeros(0))
        gram = self.fitter.whitener(fit.hyper, extra).gram(np.column_stack([without_it, fit.residual]))
        return 0.5 * float(gram[0, 0] - gram[1, 1])

    def _best_fit(self, terms: tuple[Term, ...], starts: list[Floats], extra: tuple[Extra, ...] = ()) -> Fit:
        fits = [self.fitter.fit(terms, s, MIDDLE, extra) for s in starts]
        return min(fits, key=lambda f: f.objective)

    @staticmethod
    def _joined(ways: list[Fit], count: int) -> Hypothesis:
        """Average a mechanism's ways (those not fitted count as hopeless).

        Among them what bends to ripple counts for less by a part only: whichever acts, it is the same name. What stands
        in for others is the best only where all other ways are well behind it.
        """

        def as_way(f: Fit) -> float:
            stands_in = ALIKE if f.terms[-1].branch.stands_in else 0.0
            return f.log_evidence + (1.0 - BENDS_AMONG_WAYS) * f.bending - stands_in

        best = max(ways, key=as_way)
        logs = np.array([f.log_evidence for f in ways])
        return Hypothesis(best, float(np.logaddexp.reduce(logs) - np.log(count)), ways=ways)

    # one more mechanism beside others

    def beside(
        self,
        first: Hypothesis,
        extra: tuple[Extra, ...],
        among: dict[str, tuple[Term, ...]] | None = None,
    ) -> list[Hypothesis]:
        """Hypotheses of ``first`` and one mechanism more (of the catalogue, or ``among`` others), best first.

        They are weighed with ``extra`` effects.
        """
        others = [terms for m, terms in (self._terms if among is None else among).items() if m not in first.ids]
        known = (*first.fit.terms, *(x.wander for x in first.wanders))
        found = self._abreast(lambda terms: self._one_beside(first, terms, extra), others, *known, size=len)
        return sorted((h for h in found if h is not None), key=lambda h: -h.evidence)

    def _one_beside(self, first: Hypothesis, terms: tuple[Term, ...], extra: tuple[Extra, ...]) -> Hypothesis | None:
        """``first`` and one mechanism more; ``None`` where it promises nothing."""
        fits = self._fit_beside(first.fit, terms, extra)
        if not fits:
            return None
        self.fitter.weigh(fits, extra, first.fit.hyper)
        if any(f.terms[-1].branch.stands_in for f in fits):
            self._less_what_stands_in(fits, self.reweighed(first, extra))
        return replace(self._joined(fits, len(terms)), wanders=first.wanders, added=terms[0].mechanism.id)

    def _fit_beside(self, first: Fit, terms: tuple[Term, ...], extra: tuple[Extra, ...]) -> list[Fit]:
        looks = list(zip(self.fitter.promises(terms, MIDDLE, first, extra), terms, strict=True))
        looks.sort(key=lambda look: -look[0][0])
        return [
            self.fitter.fit((*first.terms, term), np.concatenate([first.theta, start]), MIDDLE, extra)
            for (drop, start), term in looks[:2]
            if drop > _PROMISING
        ]

    def reweighed(self, hypothesis: Hypothesis, extra: tuple[Extra, ...]) -> float:
        """Evidence of a hypothesis' best way under extra covariance."""
        weighed = replace(hypothesis.fit)
        self.fitter.weigh([weighed], extra)
        return weighed.log_evidence

    def allowed(self, hypothesis: Hypothesis) -> tuple[Extra, ...]:
        """What is allowed for beside a hypothesis: what its forms have wrong, and its random effects.

        But no form is wrong of a lone name that is much likelier by its form as it is (`AS_IT_IS`): what it does is
        large, and elsewhere nothing is off by a share of that.
        """
        random = tuple(x.extra(self.scene) for x in hypothesis.wanders)
        forms = self.forms_wrong(hypothesis.fit)
        if forms and len(hypothesis.ids) == 1:
            exact = hypothesis.fit.log_evidence - self.reweighed(hypothesis, (*forms, *random)) > AS_IT_IS
            forms = () if exact else forms
        return (*forms, *random)

    def forms_wrong(self, fit: Fit) -> tuple[Extra, ...]:
        """What the forms of a fit may have wrong."""
        return form_error(self.scene, fit.terms, fit.theta)

    def least_effect(self, hypothesis: Hypothesis) -> float:
        """Relative rms change of the readings by the mechanism that changes them least, a gain per test removed.

        A clock that is told by its scatter under broken cloud changes them by that, not by what the sun's way tells.
        """
        fit, r = hypothesis.fit, self.scene.readings
        random = hypothesis.wanders
        sizes = [x.amplitude for x in random if x.wander.mechanism is not None and x.wander is not UNREST]
        scattered = {x.wander.name for x in random}
        with_it = predict(self.scene, fit.terms, fit.theta)
        for k, term in enumerate(fit.terms):
            if term.mechanism.id in scattered:
                continue
            change = (with_it - predict(self.scene, *without(fit.terms, fit.theta, k))) / r.scale
            if np.any(self.scene.is_gonio):
                change = r.free_of_gains(change)
            sizes.append(float(np.sqrt(np.mean(change**2))))
        return min(sizes, default=0.0)

    # random effects and unnamed structure

    def each_wandering(self, base: Hypothesis, wanders: Iterable[Wander], extra: tuple[Extra, ...]) -> list[Hypothesis]:
        """``base`` with each of some random effects more."""
        tried = list(wanders)
        known = (*tried, *base.fit.terms, *(x.wander for x in base.wanders))
        return self._abreast(lambda wander: self.wandering(base, wander, extra), tried, *known)

    def wandering(self, base: Hypothesis, wander: Wander, extra: tuple[Extra, ...]) -> Hypothesis:
        """``base`` with a random effect more: evidence averaged over its forms, amplitudes and lengths.

        They are compared at the sizes of ``base``, and again at those that are best with the best of them.
        """
        tried = wander.sizes()
        effects = [(*extra, x.extra(self.scene)) for x in tried]
        fit = base.fit
        best = int(np.argmax([self.fitter.density(fit, effect)(fit.hyper) for effect in effects]))
        weighed = replace(fit)
        self.fitter.weigh([weighed], effects[best])
        logs = np.array([self.fitter.density(fit, effect)(weighed.hyper) for effect in effects])
        evidence = weighed.log_evidence - logs[best] + float(np.logaddexp.reduce(logs)) - float(np.log(len(tried)))
        nats = temper(float(logs.max() - self.fitter.density(fit, extra)(weighed.hyper)), TEMPER_ONE)
        return Hypothesis(weighed, evidence, (*base.wanders, likeliest(tried, softmax(logs / nats))))
