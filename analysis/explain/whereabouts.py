"""Where a mismatch lies that no region shows by itself, but a law or a mechanism does over all readings."""

import numpy as np

from analysis.cases.model import Floats
from analysis.explain.conclusion import Conclusion
from analysis.explain.fit import Fitter
from analysis.explain.hypothesis import Hypothesis
from analysis.explain.locate import Mismatch, Scan
from analysis.explain.mechanisms.base import predict


def places(scan: Scan, residual: Floats, fitter: Fitter, found: Conclusion) -> list[Mismatch]:
    """The places of a mismatch: those that stand out by themselves, and where a law shows that no name explains.

    ``residual`` (N,) is reading minus prediction on the stretched scale. Where there is neither, they are those that
    the names tell, or the region that stands out most, with a p-value that says how little; where there is no mismatch,
    none.
    """
    standing_out = scan.standing_out(residual)
    if found.verdict == "no-mismatch" or (standing_out and found.verdict == "explained"):
        return standing_out
    known = {m.region.name for m in standing_out}
    further = [m for m in _told(scan, fitter, found) if m.region.name not in known and m.p_value < 1.0]
    return [*standing_out, *further] or scan.standing_out(residual, 1, level=1.0)


def _told(scan: Scan, fitter: Fitter, found: Conclusion) -> list[Mismatch]:
    """Where the names change most and where half of that lies, or else what gains most without a name.

    Under no change, evidence for one is e^n with a probability of at most e^-n (Markov's inequality); of all that were
    tried, the sum of that is the p-value.
    """
    structure = [
        (u.weighed, u.gain, u.along if u.conjecture else f"some function of {u.along}")
        for u in found.unnamed_told
        if u.weighed is not None and u.gain > 0.0
    ]
    best = (found.best, found.best.evidence - found.nothing.evidence, " and ".join(found.best.ids))
    if not found.kept.ids:  # nothing is named: what gains most, but nothing that was withdrawn
        claims = [] if found.withdrawn else [best]
        best = max([*claims, *structure], key=lambda row: row[1], default=(found.nothing, 0.0, ""))
    h, gain, by = best
    tried = len(found.singles) + len(found.unnamed)
    p_value = min(1.0, tried * float(np.exp(-gain)))
    if not by:
        return []
    change = _change(fitter, h)
    most = scan.changed(change, p_value, by)
    names = {m.region.name for m in most}
    return most + [m for m in scan.holding_half(change, p_value, by) if m.region.name not in names]


def _change(fitter: Fitter, h: Hypothesis) -> Floats:
    """What a hypothesis changes of the prediction, on the stretched scale (N,): by its laws and random effects.

    The mean of random effects E given a residual r of covariance C, E included, is E Eᵀ C⁻¹ r.
    """
    r = fitter.scene.readings
    change = r.stretched(predict(fitter.scene, h.fit.terms, h.fit.theta)) - r.stretched(r.simulated)
    extra = tuple(x.extra(fitter.scene) for x in h.wanders)
    if extra:
        whitener = fitter.whitener(h.fit.hyper, extra)
        columns = np.concatenate([e.amplitude * e.columns for e in extra], axis=1)
        white = whitener.whitened(np.column_stack([columns, h.fit.residual]))
        change = change + columns @ (white[:, :-1].T @ white[:, -1])
    return np.asarray(change)
