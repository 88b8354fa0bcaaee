"""A sparse-regression peer: PySINDy's sequentially thresholded least squares over the catalogue's signatures.

The library of candidates holds what each form does to the prediction at each of its starting values. PySINDy is made
for time derivatives; here its optimiser is given the library and what the simulation leaves over, as its
documentation allows. Threshold, as rms change of the readings, and ridge are chosen by cross-validation over whole
tests: the ridge by the least error, then the largest threshold within one standard error of it (Hastie, Tibshirani
and Friedman 2009, section 7.10).
"""

import warnings
from dataclasses import dataclass
from itertools import product

import numpy as np
from explain_forms import Problem, scene_of, starts, usable
from explain_search import answered

from analysis.cases import Case
from analysis.cases.model import Floats
from analysis.explain.mechanisms.base import Term
from analysis.explain.mechanisms.states import terms_of
from analysis.explain.scene import Scene
from simulators.trial.answer import Answer, Named

THRESHOLDS = (0.002, 0.004, 0.007, 0.012, 0.02, 0.035, 0.06, 0.1)
RIDGES = (1e-5, 1e-3, 1e-1)
"""Over the number of readings."""
FOLDS = 6
ALIKE = 0.9995


@dataclass(frozen=True)
class Candidate:
    """A column of the library: a form at one setting."""

    term: Term
    setting: Floats

    @property
    def key(self) -> tuple[str, str, tuple[float, ...]]:
        """What it is called in every case of a station."""
        return self.term.mechanism.id, self.term.branch.label, tuple(self.setting.tolist())


def column(problem: Problem, candidate: Candidate, base: Floats) -> Floats:
    """What the candidate does to the readings [relative], gains not taken off."""
    return problem.model((candidate.term,), candidate.setting) - base


@dataclass
class Sindy:
    """Sparse regression over the catalogue's signatures."""

    case: Case
    name = "PySINDy"

    def find(self) -> Answer:
        """Name the mechanisms whose columns survive, the one that changes the readings most first."""
        self.problem = p = Problem(scene_of(self.case))
        base = p.stretched(p.readings.simulated)
        self.target = p.residual((), np.zeros(0))
        self.candidates, columns = self._library(p.scene, base)
        self.raw = columns
        self.library = np.column_stack([p.without_gains(c) for c in columns.T])
        self.size = np.sqrt(np.mean(self.library**2, axis=0))
        threshold, self.ridge = self._chosen()
        self.weights = self._solved(self.library / self.size, self.target, threshold, self.ridge) / self.size
        change: dict[str, Floats] = {}
        for candidate, weight, what in zip(self.candidates, self.weights, self.library.T, strict=True):
            if weight:
                name = candidate.term.mechanism.id
                change[name] = change.get(name, 0.0) + weight * what
        ranked = sorted(change, key=lambda name: -float(np.mean(change[name] ** 2)))
        return answered(tuple(Named(name, 1.0) for name in ranked))

    def _library(self, scene: Scene, base: Floats) -> tuple[list[Candidate], Floats]:
        """Candidates and their columns; of those that do the same, the first."""
        found: list[Candidate] = []
        columns: list[Floats] = []
        units: list[Floats] = []
        for mechanism in usable(scene):
            for term in terms_of(mechanism, scene):
                for setting in starts(term):
                    candidate = Candidate(term, setting)
                    values = column(self.problem, candidate, base)
                    bare = self.problem.without_gains(values)
                    length = float(np.linalg.norm(bare))
                    if not np.isfinite(length) or length < 1e-4 * np.sqrt(len(bare)):
                        continue
                    if units and np.max(np.abs(np.stack(units) @ (bare / length))) > ALIKE:
                        continue
                    found.append(candidate)
                    columns.append(values)
                    units.append(bare / length)
        return found, np.stack(columns, axis=1)

    @staticmethod
    def _solved(library: Floats, target: Floats, threshold: float, ridge: float) -> Floats:
        from pysindy import STLSQ

        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # that every column was thresholded away is an answer here
            optimiser = STLSQ(threshold=threshold, alpha=ridge * len(target))
            return np.asarray(optimiser.fit(library, target[:, None]).coef_[0])

    def _chosen(self) -> tuple[float, float]:
        """Threshold and ridge."""
        test = self.problem.readings.test
        fold = np.unique(test, return_inverse=True)[1] % FOLDS
        scaled, folds = self.library / self.size, np.unique(fold)
        errors = np.zeros((len(RIDGES), len(THRESHOLDS), len(folds)))
        for (i, ridge), (j, threshold), (k, one) in product(*map(enumerate, (RIDGES, THRESHOLDS, folds))):
            out = fold == one
            weights = self._solved(scaled[~out], self.target[~out], threshold, ridge)
            errors[i, j, k] = np.mean((self.target[out] - scaled[out] @ weights) ** 2)
        mean, spread = errors.mean(axis=2), errors.std(axis=2, ddof=1) / np.sqrt(len(folds))
        i, j = np.unravel_index(int(np.argmin(mean)), mean.shape)
        good = mean[i] <= mean[i, j] + spread[i, j]
        return max(np.array(THRESHOLDS)[good].tolist()), RIDGES[i]

    def left_out(self, rows: np.ndarray) -> Floats:
        """Predictions of ``rows`` of the readings: the same columns, weighed by the others."""
        p = self.problem
        kept = np.flatnonzero(self.weights)
        part = self.library[~rows][:, kept] / self.size[kept]
        inner = part.T @ part + self.ridge * len(part) * np.eye(len(kept))
        weights = np.linalg.solve(inner, part.T @ self.target[~rows]) / self.size[kept]
        base = p.stretched(p.readings.simulated)[rows]
        return p.floor[rows] * np.sinh(base + self.raw[rows][:, kept] @ weights)

    def elsewhere(self, case: Case) -> Floats:
        """Predictions of all records of another case; a candidate that it has no equal of does nothing there."""
        other = Problem(scene_of(case, measured_only=False))
        base = other.stretched(other.readings.simulated)
        wanted = {c.key: w for c, w in zip(self.candidates, self.weights, strict=True) if w}
        total = base.copy()
        for mechanism in usable(other.scene):
            if any(key[0] == mechanism.id for key in wanted):
                for term in terms_of(mechanism, other.scene):
                    for setting in starts(term):
                        candidate = Candidate(term, setting)
                        if candidate.key in wanted:
                            total += wanted[candidate.key] * column(other, candidate, base)
        return other.floor * np.sinh(total)
