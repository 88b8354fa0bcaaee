"""The catalogue's forms as a regression problem, for the peers of `benchmarks/explain.py`.

The peers get the same forward models as `labdaq explain`, and its usable ways (which sensor, which variant). What they
do not get is its likelihood, its priors, its thresholds or its doubts: those are what is compared.
"""

from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path

import numpy as np
from scipy.optimize import least_squares

from analysis.cases import Case
from analysis.cases.model import Floats
from analysis.explain.apply import apply_model
from analysis.explain.mechanisms.base import Mechanism, Term, predict, terms_of
from analysis.explain.mechanisms.catalogue import CATALOGUE
from analysis.explain.readings import GONIOMETER, Readings
from analysis.explain.resimulate import OwnSimulation, simulator_of
from analysis.explain.retrace import retraced_of
from analysis.explain.scene import Scene
from simulators.trial.answer import Answer, Named

LEAST_READINGS = 5
"""A test with fewer readings keeps its gain, as in labdaq's own held-out errors."""


_SIMULATIONS: dict[Path, OwnSimulation | None] = {}


def simulation(case: Case) -> OwnSimulation | None:
    """The re-simulations of a case, made once for all methods."""
    if case.folder not in _SIMULATIONS:
        while len(_SIMULATIONS) > 3:
            del _SIMULATIONS[next(iter(_SIMULATIONS))]
        made = _SIMULATIONS[case.folder] = simulator_of(case)
        if made is not None:
            made.paths("clock-offset")  # asks for anything, so that all is traced
    return _SIMULATIONS[case.folder]


def scene_of(case: Case, *, measured_only: bool = True) -> Scene:
    """The scene of a case, with its re-simulations."""
    return Scene(Readings.of(case, measured_only=measured_only), retraced_of(case, simulation(case)))


def usable(scene: Scene) -> list[Mechanism]:
    """Mechanisms with a formula that the case can be tried for."""
    known = scene.readings.case.setup.simulation.includes
    return [
        m
        for m in CATALOGUE
        if not m.random and m.id not in known and set(m.kinds) & set(scene.kinds) and not m.why_not(scene)
    ]


def starts(term: Term) -> list[Floats]:
    """All combinations of a term's starting values."""
    grids = np.meshgrid(*[p.starts for p in term.parameters], indexing="ij")
    return list(np.stack([g.ravel() for g in grids], axis=1)) if grids else [np.zeros(0)]


def _floor(readings: Readings) -> Floats:
    """Where deviations stop being relative: as `Readings.floor`, by the prediction where nothing was measured."""
    level = np.where(np.isfinite(readings.measured), readings.measured, readings.simulated)
    top = np.zeros(len(readings.case.tests))
    np.maximum.at(top, readings.test, np.abs(level))
    return np.maximum(np.maximum(2.0 * readings.noise, 1e-3 * top[readings.test]), 1e-12)


@dataclass
class Problem:
    """A scene as least squares on the scale asinh(value / floor), a free gain per test taken off.

    Attributes
    ----------
    factor : shape (N, N), optional
        Lower Cholesky factor of a covariance; without one all readings err alike and independently.
    """

    scene: Scene
    factor: Floats | None = None
    memory: dict[object, Floats] = field(default_factory=dict)

    @cached_property
    def readings(self) -> Readings:
        """The readings that are explained."""
        return self.scene.readings

    @cached_property
    def floor(self) -> Floats:
        """Level below which deviations are absolute [lx, cd, cd/m²]; shape (N,)."""
        return _floor(self.readings)

    def stretched(self, values: Floats) -> Floats:
        """``values`` on the scale of the problem."""
        return np.asarray(np.arcsinh(values / self.floor))

    @cached_property
    def seen(self) -> Floats:
        """What was measured, on the scale of the problem."""
        return self.stretched(self.readings.measured)

    @cached_property
    def _gains(self) -> list[tuple[np.ndarray, Floats]]:
        """Rows of each test whose gain is free, and what a gain does there."""
        r = self.readings
        loud = np.abs(r.simulated) / np.hypot(r.simulated, self.floor)
        groups = [np.flatnonzero((r.test == k) & (r.kind == GONIOMETER)) for k in np.unique(r.test)]
        return [(rows, loud[rows]) for rows in groups if len(rows) >= LEAST_READINGS]

    def without_gains(self, values: Floats) -> Floats:
        """``values`` (N,) with each test's gain fitted and taken off."""
        left = np.array(values, dtype=np.float64)
        for rows, loud in self._gains:
            left[rows] -= loud * (loud @ left[rows]) / (loud @ loud)
        return left

    def model(self, terms: tuple[Term, ...], theta: Floats) -> Floats:
        """What is predicted with ``terms``, on the scale of the problem."""
        return self.stretched(predict(self.scene, terms, theta))

    def residual(self, terms: tuple[Term, ...], theta: Floats) -> Floats:
        """What is left of the readings [relative], gains taken off."""
        return self.without_gains(self.seen - self.model(terms, theta))

    def white(self, columns: Floats) -> Floats:
        """Columns in units in which errors are independent."""
        if self.factor is None:
            return columns
        from scipy.linalg import solve_triangular

        return np.asarray(solve_triangular(self.factor, columns, lower=True, check_finite=False))

    def only(self, keep: np.ndarray, factor: Floats | None = None) -> "Problem":
        """The problem without the rows not kept."""
        return Problem(replace(self.scene, readings=self.readings.only(keep), memory={}), factor)

    def fitted(self, terms: tuple[Term, ...], theta: Floats) -> tuple[Floats, float, Floats]:
        """Least squares from ``theta``: parameters, sum of squares, and standard deviations for unit errors."""
        parameters = [p for t in terms for p in t.parameters]
        if not parameters:
            return theta, float(np.sum(self.white(self.residual(terms, theta)) ** 2)), theta
        low, high = (np.array([getattr(p, end) for p in parameters]) for end in ("low", "high"))
        inside = 1e-6 * (high - low)
        found = least_squares(
            lambda x: self.white(self.residual(terms, x)),
            np.clip(theta, low + inside, high - inside),
            bounds=(low, high),
            x_scale=np.array([p.width for p in parameters]),
            diff_step=1e-3,
            max_nfev=15,
        )
        spread = np.sqrt(np.diag(np.linalg.pinv(found.jac.T @ found.jac)))
        return np.asarray(found.x), float(2.0 * found.cost), spread


@dataclass(frozen=True)
class Model:
    """Terms with their parameters and standard deviations; ``criterion`` is smaller where the model is better."""

    terms: tuple[Term, ...]
    theta: Floats
    sd: Floats
    squares: float
    criterion: float

    @property
    def ids(self) -> tuple[str, ...]:
        """Ids of the terms."""
        return tuple(t.mechanism.id for t in self.terms)

    def parts(self) -> list[tuple[Term, Floats, Floats]]:
        """Each term with its own parameters and deviations."""
        ends = np.cumsum([len(t.parameters) for t in self.terms])[:-1]
        return list(zip(self.terms, np.split(self.theta, ends), np.split(self.sd, ends), strict=True))

    def elsewhere(self, case: Case) -> Floats:
        """All records of another case with the model applied [lx, cd, cd/m²]; by `labdaq predict`'s own way."""
        import csv
        import io

        entries = [
            {
                "id": term.mechanism.id,
                "way": term.branch.label,
                "facts": term.branch.facts,
                "theta": theta.tolist(),
                "sd": sd.tolist(),
                "names": [p.name for p in term.parameters],
            }
            for term, theta, sd in self.parts()
        ]
        rows = csv.DictReader(io.StringIO(apply_model(entries, case, simulation(case))))
        factor = Readings.of(case, measured_only=False).unit_factor
        return np.array([float(row["corrected"]) for row in rows]) * factor


class FormSearch:
    """Forward selection of the catalogue's forms by an information criterion.

    With independent errors of unknown size the criterion is n ln(RSS/n) + k ln n (Schwarz 1978, Ann. Statist. 6);
    with a known covariance it is the weighted sum of squares + k ln n.
    """

    MOST = 3
    FITTED_WAYS = 2

    def __init__(self, problem: Problem) -> None:
        self.problem = problem
        self.terms = {m.id: terms_of(m, problem.scene) for m in usable(problem.scene)}

    def criterion(self, squares: float, parameters: int) -> float:
        """The information criterion; smaller is better."""
        n = len(self.problem.readings)
        fit = squares if self.problem.factor is not None else n * np.log(squares / n)
        return float(fit + parameters * np.log(n))

    def nothing(self) -> Model:
        """The model that leaves the prediction as it is."""
        squares = float(np.sum(self.problem.white(self.problem.residual((), np.zeros(0))) ** 2))
        return Model((), np.zeros(0), np.zeros(0), squares, self.criterion(squares, 0))

    def beside(self, first: Model) -> list[Model]:
        """``first`` with each mechanism more, best first."""
        found = []
        for name, terms in self.terms.items():
            if name in first.ids:
                continue
            looks = sorted((self._look(first, term) for term in terms), key=lambda look: look[0])
            fits = [self._fitted(first, term, start) for _, _, term, start in looks[: self.FITTED_WAYS]]
            if fits:
                found.append(min(fits, key=lambda m: m.criterion))
        return sorted(found, key=lambda m: m.criterion)

    def _look(self, first: Model, term: Term) -> tuple[float, int, Term, Floats]:
        """Squares left by the best of a term's starting points, its effect scaled as suits best."""
        p = self.problem
        rest = p.residual(first.terms, first.theta)
        points = starts(term)
        base = p.model(first.terms, first.theta)
        moved = [
            p.without_gains(p.model((*first.terms, term), np.concatenate([first.theta, x])) - base) for x in points
        ]
        white = p.white(np.column_stack([rest, *moved]))
        onto, size = white[:, 1:].T @ white[:, 0], np.sum(white[:, 1:] ** 2, axis=0)
        drop = np.where(onto > 0.0, onto**2 / np.maximum(size, 1e-12), 0.0)
        best = int(np.argmax(drop))
        return -float(drop[best]), id(term), term, points[best]

    def _fitted(self, first: Model, term: Term, start: Floats) -> Model:
        terms = (*first.terms, term)
        theta, squares, spread = self.problem.fitted(terms, np.concatenate([first.theta, start]))
        sigma = 1.0 if self.problem.factor is not None else np.sqrt(squares / len(self.problem.readings))
        return Model(terms, theta, sigma * spread, squares, self.criterion(squares, len(theta)))

    def best(self) -> tuple[Model, list[Model]]:
        """The chosen model, and the singles."""
        found = self.nothing()
        singles = self.beside(found)
        ranked = singles
        while ranked and len(found.terms) < self.MOST and ranked[0].criterion < found.criterion:
            found = ranked[0]
            ranked = self.beside(found) if len(found.terms) < self.MOST else []
        return found, singles


def named(model: Model, problem: Problem, singles: list[Model], nothing: Model) -> tuple[Named, ...]:
    """The model's mechanisms, the one that changes most first, with probabilities from the criterion's weights.

    A weight is exp(-criterion / 2), shared out among nothing and the singles; mechanisms added later get what their
    step gained against the step not taken.
    """
    if not model.terms:
        return ()
    logs = -0.5 * np.array([nothing.criterion, *(m.criterion for m in singles)])
    weights = np.exp(logs - np.logaddexp.reduce(logs))
    by_id = {m.ids[0]: float(w) for m, w in zip(singles, weights[1:], strict=True)}
    rows = []
    for k, (term, theta, sd) in enumerate(model.parts()):
        probability = by_id.get(term.mechanism.id, 0.0) if k == 0 else 1.0 / (1.0 + np.exp(-_gain(model, k, problem)))
        parameters = {
            name: (float(p["value"]), float(p["uncertainty"]))
            for name, p in term.mechanism.report(theta, sd, term).items()
            if not isinstance(p["value"], str)
        }
        rows.append(Named(term.mechanism.id, probability, parameters))
    return tuple(rows)


def _gain(model: Model, k: int, problem: Problem) -> float:
    """Half of what the criterion loses when the k-th term is taken out and the others are fitted again."""
    kept = [part for j, part in enumerate(model.parts()) if j != k]
    terms = tuple(t for t, _, _ in kept)
    theta = np.concatenate([x for _, x, _ in kept]) if kept else np.zeros(0)
    _, squares, _ = problem.fitted(terms, theta)
    n = len(problem.readings)
    fit = squares - model.squares if problem.factor is not None else n * np.log(squares / model.squares)
    return float(np.clip(0.5 * (fit - (len(model.theta) - len(theta)) * np.log(n)), -30.0, 30.0))


def answered(named_: tuple[Named, ...]) -> Answer:
    """An answer in the trial's form: a peer of this kind either names or sees nothing; it cannot abstain."""
    return Answer("explained" if named_ else "no-mismatch", named_)


@dataclass
class Bic:
    """Plain BIC: the catalogue's forms, independent errors, forward selection."""

    case: Case
    name = "iid BIC"

    def find(self) -> Answer:
        """Answer; what was found stays for predictions."""
        self.problem = Problem(scene_of(self.case))
        search = FormSearch(self.problem)
        self.model, singles = search.best()
        return answered(named(self.model, self.problem, singles, search.nothing()))

    def left_out(self, rows: np.ndarray) -> Floats:
        """Predictions [lab units] of ``rows`` of the readings, fitted to the others."""
        part = self.problem.only(~rows)
        theta, _, _ = part.fitted(self.model.terms, self.model.theta)
        return predict(self.problem.scene, self.model.terms, theta)[rows]

    def elsewhere(self, case: Case) -> Floats:
        """Predictions of all records of another case."""
        return self.model.elsewhere(case)
