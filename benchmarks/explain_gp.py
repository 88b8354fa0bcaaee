"""Peers with a Gaussian-process discrepancy, in the manner of Kennedy and O'Hagan (2001, J. R. Stat. Soc. B 63).

reading = simulation(theta) + discrepancy(gamma, C, sun, sky share, system) + noise, on the scale asinh(value / floor),
a gain per test taken off. The discrepancy's kernel is a squared exponential with a length for each input; lengths and
sizes have the largest marginal likelihood on a random part of the readings (scikit-learn), and all readings are
conditioned on exactly.

`Discrepancy` knows no physics: it corrects, and names nothing. `Calibrated` is the whole of Kennedy and O'Hagan, one
step at a time ("modular", Liu, Bayarri and Berger 2009, Bayesian Anal. 4): the catalogue's forms are calibrated beside
that discrepancy, and chosen by BIC under its covariance.
"""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from explain_forms import Problem, scene_of
from explain_search import FormSearch, Model, answered, named

from analysis.cases import Case
from analysis.cases.model import Floats
from analysis.explain.mechanisms.base import predict
from analysis.explain.readings import Readings
from labdaq.directions import sky_vector, vector
from simulators.trial.answer import Answer, Place

LEARNED_FROM = 500
"""Readings that lengths and sizes are learned from; scikit-learn's gradients hold a square matrix for each length."""
NATS = 3.0
"""A discrepancy is there when the marginal likelihood gains so much over noise alone."""


def inputs(r: Readings, systems: list[str]) -> Floats:
    """What the discrepancy may depend on, (N, 7 + systems): direction, sun, share of the sky, system."""
    direction = vector(np.nan_to_num(r.gamma_deg, nan=180.0), np.nan_to_num(r.c_deg))
    altitude, azimuth = (np.nan_to_num(x, nan=45.0) for x in (r.sun_altitude_at_deg, r.sun_azimuth_at_deg))
    share = np.nan_to_num(r.diffuse_lx / r.global_lx, nan=0.3)[r.test]
    mine = np.array([t.system or "" for t in r.case.tests])[r.test]
    which = (mine[:, None] == np.array(systems)[None]).astype(np.float64)
    return np.column_stack([direction, sky_vector(altitude, azimuth), share, which])


@dataclass
class Process:
    """A learned discrepancy."""

    kernel: Any
    systems: list[str]
    gained: float

    def covariance(self, r: Readings) -> Floats:
        """Of readings, noise included; (N, N)."""
        x = inputs(r, self.systems)
        return np.asarray(self.kernel(x)) + np.diag(self._own(r))

    def between(self, a: Readings, b: Readings) -> Floats:
        """Of the discrepancy alone between two sets of readings."""
        return np.asarray(self.kernel(inputs(a, self.systems), inputs(b, self.systems)))

    @staticmethod
    def _own(r: Readings) -> Floats:
        return (r.noise / np.hypot(r.measured, r.floor)) ** 2


def learned(problem: Problem) -> Process:
    """Learn lengths and sizes from what the simulation leaves over."""
    from sklearn.gaussian_process import GaussianProcessRegressor
    from sklearn.gaussian_process.kernels import RBF, ConstantKernel, WhiteKernel

    r, left = problem.readings, problem.residual((), np.zeros(0))
    rng = np.random.default_rng(1)
    some = np.sort(rng.permutation(len(r))[:LEARNED_FROM])
    systems = sorted({t.system or "" for t in r.case.tests})
    x, own = inputs(r, systems)[some], Process._own(r)[some]
    lengths = np.concatenate([np.full(3, 0.5), np.full(3, 0.7), [0.5], np.full(len(systems), 1.0)])
    kernel = ConstantKernel(left.var() + 1e-6, (1e-8, 10.0)) * RBF(lengths, (0.05, 50.0)) + WhiteKernel(
        1e-4, (1e-8, 1.0)
    )
    found = GaussianProcessRegressor(kernel, alpha=own + 1e-10).fit(x, left[some])
    alone = GaussianProcessRegressor(WhiteKernel(1e-4, (1e-8, 10.0)), alpha=own + 1e-10).fit(x, left[some])
    gained = found.log_marginal_likelihood_value_ - alone.log_marginal_likelihood_value_
    return Process(found.kernel_, systems, float(gained))


@dataclass
class Discrepancy:
    """A Gaussian-process discrepancy and nothing else."""

    case: Case
    name = "GP discrepancy"

    def find(self) -> Answer:
        """Say whether there is a discrepancy, and on which rings it is largest."""
        self.problem = Problem(scene_of(self.case))
        self.process = learned(self.problem)
        self.model = Model((), np.zeros(0), np.zeros(0), 0.0, 0.0)
        if self.process.gained < NATS:
            return Answer("no-mismatch")
        return Answer("unexplained", places=self._places())

    def _places(self) -> tuple[Place, ...]:
        """The ring of gamma, and the test, with the largest mean square of the discrepancy."""
        r, size = self.problem.readings, self._expected(self.problem.readings) ** 2
        gammas = r.gamma_deg[np.isfinite(r.gamma_deg)]
        places = []
        if len(gammas):
            ring = max(np.unique(gammas), key=lambda g: float(np.mean(size[r.gamma_deg == g])))
            places.append(Place(gamma_deg=(float(ring) - 10.0, float(ring) + 10.0)))
        test = max(np.unique(r.test), key=lambda k: float(np.mean(size[r.test == k])))
        places.append(Place(tests=(r.case.tests[int(test)].id,)))
        return tuple(places)

    @cached_property
    def _weights(self) -> Floats:
        covariance = self.process.covariance(self.problem.readings)
        return np.linalg.solve(covariance, self.problem.residual(self.model.terms, self.model.theta))

    def _expected(self, r: Readings) -> Floats:
        return self.process.between(r, self.problem.readings) @ self._weights

    def left_out(self, rows: np.ndarray) -> Floats:
        """Predictions of ``rows`` of the readings, conditioned on the others."""
        r = self.problem.readings
        inside, outside = r.only(~rows), r.only(rows)
        covariance = self.process.covariance(inside)
        part = self.problem.only(~rows, np.linalg.cholesky(covariance))
        theta, _, _ = part.fitted(self.model.terms, self.model.theta)
        left = np.linalg.solve(covariance, part.residual(self.model.terms, theta))
        expected = self.process.between(outside, inside) @ left
        base = predict(self.problem.scene, self.model.terms, theta)[rows]
        floor = self.problem.floor[rows]
        return floor * np.sinh(np.arcsinh(base / floor) + expected)

    def elsewhere(self, case: Case) -> Floats:
        """Predictions of all records of another case."""
        other = Problem(replace(self.problem.scene, readings=Readings.of(case, measured_only=False), memory={}))
        base = self.model.elsewhere(case) if self.model.terms else other.readings.simulated
        return other.floor * np.sinh(np.arcsinh(base / other.floor) + self._expected(other.readings))


@dataclass
class Calibrated(Discrepancy):
    """The catalogue's forms, calibrated beside a Gaussian-process discrepancy."""

    name = "GP + catalogue"

    def find(self) -> Answer:
        """Name what gains under the discrepancy's covariance."""
        self.problem = Problem(scene_of(self.case))
        self.process = learned(self.problem)
        self.problem.factor = np.linalg.cholesky(self.process.covariance(self.problem.readings))
        search = FormSearch(self.problem)
        self.model, singles = search.best()
        return answered(named(self.model, self.problem, singles, search.nothing()))
