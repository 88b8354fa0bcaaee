"""From a random effect to a term: the pattern that recordings tell of, so that it predicts other tests."""

from dataclasses import replace

import numpy as np

from analysis.explain.families import PATTERN
from analysis.explain.fit import posterior_covariance
from analysis.explain.hypothesis import Hypothesis
from analysis.explain.mechanisms.base import Term
from analysis.explain.mechanisms.lens import ANY_PATTERN, LensAnisotropy
from analysis.explain.search import Search
from analysis.explain.shift_pattern import without_pattern


def with_its_pattern(search: Search, h: Hypothesis) -> Hypothesis:
    """The same hypothesis, a lens's pattern (`families.PATTERN`) in it no more a random effect but as it was told.

    Its evidence is what it was: that of all patterns together.
    """
    told = next((x for x in h.wanders if x.wander is PATTERN), None)
    if told is None:
        return h
    branch = replace(ANY_PATTERN, facts=dict.fromkeys(without_pattern(search.scene), 1.0))
    mechanism = LensAnisotropy()
    sized = (replace(p, sigma=told.amplitude) for p in mechanism.parameters_in(search.scene, branch))
    term = Term(mechanism, branch, tuple(sized))
    others = tuple(x for x in h.wanders if x is not told)
    extra = (*search.forms_wrong(h.fit), *(x.extra(search.scene) for x in others))
    start = [*h.fit.theta, *(0.0 for _ in term.parameters)]
    fit = search.fitter.fit((*h.fit.terms, term), np.array(start), h.fit.hyper, extra)
    fit.log_evidence, fit.bending = h.fit.log_evidence, h.fit.bending
    fit.covariance = posterior_covariance(search.fitter.whitener(fit.hyper, extra), fit)
    return replace(h, fit=fit, wanders=others)
