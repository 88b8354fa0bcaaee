"""From a case to an explanation: the whole way, in one function."""

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from analysis.cases import Case
from analysis.cases.model import Floats
from analysis.explain.again import Again, simulated_again
from analysis.explain.alone import quieted
from analysis.explain.conclude import conclude
from analysis.explain.conclusion import Conclusion
from analysis.explain.condense import condensed
from analysis.explain.fit import Extra, Fit, Fitter
from analysis.explain.forensics import forensics
from analysis.explain.form_error import form_error
from analysis.explain.heldout import HeldOut, deviations, rms
from analysis.explain.hypers import Hyper
from analysis.explain.locate import Mismatch, Scan
from analysis.explain.mechanisms.base import predict
from analysis.explain.readings import Readings
from analysis.explain.retrace import Simulator
from analysis.explain.scene import Scene, scene_of
from analysis.explain.search import Search
from analysis.explain.shared_error import SharedError, shared_error
from analysis.explain.verdict import stand_out
from analysis.explain.whereabouts import places
from labdaq.errors import DataError

LOOKING = Hyper(1.0, 1.0, 0.4)
"""Size of the usual nuisances, when it is asked where (not why) something differs."""


@dataclass
class Explanation:
    """Everything found about a case; `analysis.explain.answer` writes it down.

    Attributes
    ----------
    scene, whole
        What was weighed, and the case as it was given; the scene's has fewer records where those of the roof are many.
    shared
        What the simulation gets wrong alike in all tests of a system.
    again
        The found physics put into our own simulation, where it is a setting of one.
    mismatch, leftover
        Where the recording differs from the prediction, and from the corrected prediction.
    corrected, corrected_sd : shape (N,) [lx, cd, cd/m²]
        The prediction with the named mechanisms, and its standard uncertainty.
    """

    scene: Scene
    whole: Case
    conclusion: Conclusion
    findings: list[str]
    mismatch: list[Mismatch]
    leftover: list[Mismatch]
    corrected: Floats
    corrected_sd: Floats
    before: float
    after: float
    chi2_before: float
    chi2_after: float
    held_out: HeldOut | None
    not_tried: dict[str, str] = field(default_factory=dict)
    again: Again | None = None
    shared: SharedError = field(default_factory=lambda: SharedError({}, {}))


def explain(
    case: Case, simulator: Simulator | None = None, progress: Callable[[str], None] = lambda step: None
) -> Explanation:
    """Explain ``case``; ``progress`` is told each step as it begins."""
    from threadpoolctl import threadpool_limits

    with threadpool_limits(1, "blas"):  # the matrices are many and small: threads would only wait for each other
        return _explain(case, simulator, progress)


def _explain(case: Case, simulator: Simulator | None, progress: Callable[[str], None]) -> Explanation:
    progress("forensics")
    if not np.any(case.records.simulated > 0.0):
        raise DataError(f"{case.folder}: no prediction is above zero", "fill the column simulated of records.csv")
    findings = forensics(Readings.of(case))
    whole, (case, _) = case, condensed(case)
    if len(case.records) < len(whole.records):
        findings.append(f"{len(whole.records)} records are weighed as {len(case.records)} means of neighbours in time.")
    scene = scene_of(case, simulator)
    readings = scene.readings
    if scene.sky_part is not None:
        findings.append("The records do not give the predicted sun and sky parts apart; our own simulation split them.")
    fitter = Fitter(scene)
    progress("locating the mismatch")
    null = fitter.residual((), np.zeros(0))
    usual = fitter.whitener(LOOKING)
    scan = Scan.of(readings, usual)
    progress("weighing mechanisms")
    search = quieted(Search(fitter))
    scene, fitter = search.scene, search.fitter
    found = conclude(search)
    mismatch = places(scan, null, fitter, found)
    stand_out(found, [m.p_value for m in mismatch])
    kept = found.kept
    best = kept.fit
    corrected = predict(scene, best.terms, best.theta)
    if simulator is not None:
        progress("simulating again with what was found")
    again = simulated_again(scene, best.terms, best.theta) if simulator is not None else None
    wrong = form_error(scene, best.terms, best.theta)
    extra = (*wrong, *(x.extra(scene) for x in kept.wanders))
    beside = fitter.whitener(LOOKING, extra)
    leftover = Scan.of(readings, beside).standing_out(best.residual)
    dof = max(len(readings) - len(best.theta), 1)
    return Explanation(
        scene=scene,
        whole=whole,
        conclusion=found,
        findings=findings,
        mismatch=mismatch,
        leftover=leftover,
        corrected=corrected,
        corrected_sd=corrected_sd(scene, best, fitter, wrong),
        before=rms(deviations(readings, readings.simulated)),
        after=rms(deviations(readings, corrected)),
        chi2_before=float(usual.squares(null[:, None])[0]) / len(readings),
        chi2_after=float(beside.squares(best.residual[:, None])[0]) / dof,
        held_out=found.outside,
        not_tried=search.not_tried,
        again=again,
        shared=_shared(fitter, best, extra, found.outside),
    )


def _shared(fitter: Fitter, best: Fit, extra: tuple[Extra, ...], outside: HeldOut | None) -> SharedError:
    """The simulation's shared error, if left-out tests are predicted better with what the others say of it."""
    if outside is None or outside.with_shared_error >= outside.after:
        return SharedError({}, {})
    return shared_error(fitter, best.residual, best.hyper, extra)


def corrected_sd(scene: Scene, fit: Fit, fitter: Fitter, wrong: tuple[Extra, ...]) -> Floats:
    """Standard uncertainty (N,) of the corrected prediction: parameters, forms, gains, and the shape discrepancy."""
    r = scene.readings
    variance = np.einsum("ij,jk,ik->i", fit.jacobian, fit.covariance, fit.jacobian)
    # what any lens has wrong is a nuisance of every hypothesis, wherever it lies: no form's error
    variance += sum(np.sum((e.amplitude * e.columns) ** 2, axis=1) for e in wrong if not e.of_lens)
    for block in fitter.nuisance.blocks:
        noise = (r.noise[block.rows] / r.scale[block.rows]) ** 2
        variance[block.rows] += np.diag(fitter.nuisance.matrix(block, fit.hyper)) - noise
    return np.asarray(np.sqrt(np.maximum(variance, 0.0)) * r.scale)
