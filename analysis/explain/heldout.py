"""Improvement on readings that were not fitted: whole tests, or whole skies, are left out and predicted.

Neighbouring directions share the simulation's shape error, so a random tenth of the points would flatter any model;
only what a whole test or sky says of the others counts.
"""

from dataclasses import dataclass

import numpy as np

from analysis.cases.model import Floats
from analysis.explain.abreast import abreast
from analysis.explain.fit import Fitter
from analysis.explain.form_error import form_error
from analysis.explain.hypers import Hyper
from analysis.explain.mechanisms.base import Term, predict
from analysis.explain.readings import ROOF, Readings
from analysis.explain.scene import Scene
from analysis.explain.shared_error import SharedError, shared_error


@dataclass(frozen=True)
class HeldOut:
    """Errors on left-out readings, per cent, with what each left-out group says.

    Attributes
    ----------
    scheme
        ``leave-one-test-out`` or ``leave-one-sky-out``.
    before, after
        rms of the relative deviation, a free gain per test removed [1].
    groups
        Per left-out group: name, before, after.
    with_shared_error
        As ``after``, with what the other tests say of the simulation's own error.
    """

    scheme: str
    before: float
    after: float
    groups: tuple[tuple[str, float, float], ...]
    with_shared_error: float = 0.0


def held_out(scene: Scene, terms: tuple[Term, ...], theta: Floats, hyper: Hyper) -> HeldOut | None:
    """Leave out each test (each sky, if there are three kinds); ``None`` with fewer than two tests.

    The parameters start from the fit to all tests and are fitted again without the left-out rows.
    """
    r = scene.readings
    skies = [t.sky for t in r.case.tests]
    present = np.unique(r.test)
    if len(present) < 2:
        return None
    if len({skies[k] for k in present} - {None}) >= 3:
        scheme, label = "leave-one-sky-out", np.array([skies[k] or "" for k in range(len(skies))])[r.test]
    else:
        scheme, label = "leave-one-test-out", np.array([t.id for t in r.case.tests])[r.test]
    before, after, with_shared = deviations(r, r.simulated), np.zeros(len(r)), np.zeros(len(r))

    def without(name: str) -> tuple[Floats, Floats]:
        """Deviations of the rows left out, without and with what the others say of the shared error."""
        out = label == name
        fitted, learned = _fit_without(scene, terms, theta, hyper, ~out)
        corrected = predict(scene, terms, fitted)
        return deviations(r, corrected)[out], deviations(r, corrected * np.exp(learned.at(scene)))[out]

    names, groups = list(dict.fromkeys(label.tolist())), []
    for name, made in zip(names, abreast(without, names), strict=True):
        out = label == name
        after[out], with_shared[out] = made
        groups.append((str(name), rms(before[out]), rms(after[out])))
    return HeldOut(scheme, rms(before), rms(after), tuple(groups), rms(with_shared))


def _fit_without(
    scene: Scene, terms: tuple[Term, ...], theta: Floats, hyper: Hyper, keep: np.ndarray
) -> tuple[Floats, SharedError]:
    """Parameters fitted to the rows kept (terms keep the reference levels of the whole fit), and the shared error."""
    part = scene.only(keep)
    fitter = Fitter(part)
    if len(theta) == 0:
        return theta, shared_error(fitter, fitter.residual((), theta), hyper)
    wrong = form_error(part, terms, theta)
    fit = fitter.fit(terms, theta, hyper, wrong)
    return fit.theta, shared_error(fitter, fit.residual, hyper, wrong)


def deviations(readings: Readings, model: Floats) -> Floats:
    """Reading minus model on the stretched scale (relative), a gain per test removed; shape (N,).

    Roof meters, and tests with fewer than five readings, keep their gain: there it is the message, not a nuisance.
    """
    difference = readings.stretched(readings.measured) - readings.stretched(model)
    free = readings.kind != ROOF
    weight = np.where(free, (np.abs(readings.measured) / readings.scale) ** 2, 0.0)
    count = len(readings.case.tests)
    sums = np.bincount(readings.test, weights=weight, minlength=count)
    mean = np.bincount(readings.test, weights=weight * difference, minlength=count) / np.maximum(sums, 1e-12)
    many = np.bincount(readings.test, weights=free, minlength=count) >= 5
    return np.asarray(difference - np.where(free & many[readings.test], mean[readings.test], 0.0))


def rms(values: Floats) -> float:
    """Root mean square."""
    return float(np.sqrt(np.mean(values**2))) if len(values) else 0.0
