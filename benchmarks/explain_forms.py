"""The catalogue's forms as a regression problem, for the peers of `benchmarks/explain.py`.

The peers get the same forward models as `labdaq explain`, and its usable ways (which sensor, which variant). What they
do not get is its likelihood, its priors, its thresholds or its doubts: those are what is compared.
"""

from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path

import numpy as np
from scipy.optimize import least_squares

from analysis.cases import Case
from analysis.cases.model import Floats
from analysis.explain import scene
from analysis.explain.mechanisms.base import Mechanism, Term, predict
from analysis.explain.mechanisms.catalogue import CATALOGUE
from analysis.explain.readings import GONIOMETER, Readings
from analysis.explain.resimulate import OwnSimulation, simulator_of
from analysis.explain.scene import Scene

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
    return scene.scene_of(case, simulation(case), measured_only=measured_only)


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
        return Problem(self.scene.only(keep), factor)

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
