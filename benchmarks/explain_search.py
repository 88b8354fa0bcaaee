"""Models of several forms, chosen by an information criterion, for the peers of `benchmarks/explain.py`."""

import csv
import io
from dataclasses import dataclass

import numpy as np
from explain_forms import Problem, scene_of, simulation, starts, usable

from analysis.cases import Case
from analysis.cases.model import Floats
from analysis.explain import apply
from analysis.explain.mechanisms.base import Term, predict
from analysis.explain.mechanisms.states import terms_of
from analysis.explain.readings import Readings
from simulators.trial.answer import Answer, Named


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
        rows = csv.DictReader(io.StringIO(apply.apply_model(apply.Model(tuple(entries)), case, simulation(case))))
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
