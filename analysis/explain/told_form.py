"""Of what kind the form is by which a mechanism is told: a change of the lens, a response that flattens, a soft end."""

from analysis.explain.hypothesis import Hypothesis
from analysis.explain.mechanisms.base import Term
from analysis.explain.mechanisms.sensors import Nonlinearity, Saturation
from analysis.explain.retrace import Path
from analysis.explain.thresholds import SUDDEN


def of_another_lens(h: Hypothesis) -> bool:
    """Whether a change of the lens was traced on a lens that is only like the prediction's."""
    return any(traced(t) for t in h.fit.terms)


def traced(term: Term) -> bool:
    """Whether a term is a change of the lens that we simulated again, on one that is not hardly unlike the case's."""
    path = term.branch.value
    return term.mechanism.like_a_lens and isinstance(path, Path) and not (path.of_case or path.alike)


def of_optics(term: Term) -> bool:
    """Whether a term changes lens or well, or was simulated again: its form is as good as what was simulated."""
    return term.mechanism.like_a_lens or isinstance(term.branch.value, Path)


def flattens(h: Hypothesis) -> bool:
    """Whether a response that is not proportional only flattens towards bright light, as a range does that ends."""
    return any(_is_bent(term) and h.fit.theta[k] < 0.0 for term, k in h.fit.placed)


def _is_bent(term: Term) -> bool:
    """All forms but a power, which bends dim light as well."""
    return term.mechanism.id == Nonlinearity.id and isinstance(term.branch.value, tuple)


def flatten_alike(one: Hypothesis, other: Hypothesis) -> bool:
    """Whether two are one response that flattens towards bright light, under two names."""
    return (flattens(one) and flattens_all(other)) or (flattens(other) and flattens_all(one))


def flattens_all(h: Hypothesis) -> bool:
    """Whether a range that ends is told by sensors of which all readings are too small, the bright ones the more.

    That is a response which is not proportional as well: by the same word other authors mean such a law, and by a range
    that ends a sudden one.
    """
    return any(t.mechanism.id == Saturation.id and t.branch.value[1] in Saturation.smooth for t in h.fit.terms)


def ends_softly(h: Hypothesis) -> bool:
    """Whether a range of an arm's sensors ends so gradually that it is as well a response that is not proportional."""
    ends = [k for t, k in h.fit.placed if t.mechanism.id == Saturation.id and t.branch.value[1] == "rounded"]
    return any(h.fit.theta[k + 1] < SUDDEN for k in ends)
