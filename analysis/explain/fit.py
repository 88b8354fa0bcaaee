"""Fit a hypothesis and weigh its evidence.

A hypothesis is a set of mechanisms with priors on their parameters, which are fitted by Gauss-Newton steps in the
metric of the nuisance covariance; its evidence is Laplace's approximation about the fit (`evidence`), summed about its
best sizes of discrepancy.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np

from analysis.cases.model import Floats
from analysis.explain.air_error import air_error_effects, errors_of_all_days, gains_of_tests
from analysis.explain.arm_error import arm_errors, sensor_angle_errors
from analysis.explain.evidence import inside, laplace, precision_of
from analysis.explain.hypers import STRIDES, Hyper, lattice_of
from analysis.explain.lens_error import haze_errors, lens_error_effects
from analysis.explain.mechanisms.base import Term, predict
from analysis.explain.moment_error import moment_error
from analysis.explain.noise import Nuisance
from analysis.explain.parameter import Parameter
from analysis.explain.pointing_error import pointing_errors, steepness
from analysis.explain.prior import Prior
from analysis.explain.ray_noise import own_rays, ray_noise
from analysis.explain.scene import Scene
from analysis.explain.sky_error import sky_error_effects
from analysis.explain.thresholds import EACH_NUMBER, FEW_NUMBERS
from analysis.explain.whitening import Factored, Solved, Whitener


@dataclass(frozen=True, eq=False)
class Extra:
    """A random effect beyond the nuisances: ``amplitude`` times independent unit effects of ``columns`` (N, K).

    Those ``of_lens`` grow with `Hyper.lens`, too.
    """

    columns: Floats
    amplitude: float = 1.0
    of_lens: bool = False

    def size(self, hyper: Hyper) -> float:
        """The amplitude at some sizes."""
        return self.amplitude * (hyper.lens if self.of_lens else 1.0)


MIDDLE = Hyper(2.0, 1.2, 1.0)
"""Sizes at which starting points are compared, and fits begin."""
_KEPT = 48  # factored covariances; of two thousand readings each takes some 30 MB
_WHITENERS = 200  # of half a megabyte each
_STEPS = 12
_SMALL = 1e-3  # of a standard deviation: a step below it ends the fit


@dataclass(eq=False)
class Fit:
    """A fitted hypothesis.

    Attributes
    ----------
    terms
        Its mechanisms; empty for "nothing was left out".
    theta : shape (P,)
        Fitted parameters of all terms in a row.
    objective
        Misfit and prior together, twice the negative log density at the grid point of the fit.
    covariance : shape (P, P)
        Of the parameters, at the best grid point.
    residual : shape (N,)
        Reading minus model on the stretched scale.
    jacobian : shape (N, P)
        d model / d theta on the stretched scale.
    log_evidence
        Natural log of the probability of the readings, up to a constant of the case.
    hyper
        The grid point that carries most of the evidence.
    bending
        What its evidence counts for less for the many parameters of its forms [nats].
    spread : shape (P, P)
        Variance between ways of the same mechanism that the readings do not decide; ``None`` without them.
    """

    terms: tuple[Term, ...]
    theta: Floats
    residual: Floats
    jacobian: Floats
    objective: float = np.inf
    covariance: Floats = field(default_factory=lambda: np.zeros((0, 0)))
    log_evidence: float = -np.inf
    hyper: Hyper = MIDDLE
    spread: Floats | None = None
    bending: float = 0.0

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """All terms' parameters in a row."""
        return tuple(p for t in self.terms for p in t.parameters)

    @property
    def placed(self) -> list[tuple[Term, int]]:
        """Its terms, with the place of each one's first parameter."""
        ends = np.cumsum([len(t.parameters) for t in self.terms])
        return [(t, int(end) - len(t.parameters)) for t, end in zip(self.terms, ends, strict=True)]

    @property
    def ids(self) -> tuple[str, ...]:
        """Ids of its mechanisms."""
        return tuple(t.mechanism.id for t in self.terms)


def without(terms: tuple[Term, ...], theta: Floats, k: int) -> tuple[tuple[Term, ...], Floats]:
    """All terms but the k-th, with their parameters."""
    counts = [len(t.parameters) for t in terms]
    start = sum(counts[:k])
    return (*terms[:k], *terms[k + 1 :]), np.delete(theta, range(start, start + counts[k]))


class Fitter:
    """Fits hypotheses to one scene; keeps the factored covariances it has used."""

    def __init__(self, scene: Scene, nuisance: Nuisance | None = None) -> None:
        self.scene = scene
        effects = np.concatenate(
            [lens_error_effects(scene), sky_error_effects(scene), air_error_effects(scene)], axis=1
        )
        of_arms = pointing_errors, arm_errors, sensor_angle_errors, haze_errors, ray_noise, own_rays
        usual = np.concatenate([scene.remember(f) for f in (*of_arms, errors_of_all_days, gains_of_tests)], axis=1)
        alone = np.hypot(scene.remember(moment_error), 0.0 if scene.alone is None else scene.alone)
        self.nuisance = nuisance or Nuisance(scene.readings, effects, steepness(scene), alone, usual)
        self.lattice = lattice_of(scene.readings)
        self._seen = scene.readings.stretched(scene.readings.measured)
        self._factored: dict[tuple[float, float], Factored] = {}
        self._solved: dict[tuple[tuple[float, float], int], tuple[Floats, Solved]] = {}
        self._whiteners: dict[tuple[object, ...], Whitener] = {}  # with their effects, so that ids stay theirs

    def whitener(self, hyper: Hyper, extra: tuple[Extra, ...] = ()) -> Whitener:
        """The covariance at some sizes, with extra random effects."""
        factored = self._factored.pop(hyper.base, None) or self.nuisance.factored(hyper)
        self._factored[hyper.base] = factored  # the latest last
        while len(self._factored) > _KEPT:
            del self._factored[next(iter(self._factored))]
        parts = tuple((self._solve(hyper, factored, e.columns), e.size(hyper)) for e in extra)
        key = (hyper, *((id(solved), amplitude) for solved, amplitude in parts))
        made = self._whiteners.pop(key, None)
        if made is None or made.blocks is not factored.blocks:
            made = factored.whitener(hyper.lens, parts)
        self._whiteners[key] = made
        while len(self._whiteners) > _WHITENERS:
            del self._whiteners[next(iter(self._whiteners))]
        return made

    def forget(self) -> None:
        """Drop the factored covariances, some gigabytes where there are thousands of readings; they are made again."""
        self._factored.clear()
        self._solved.clear()
        self._whiteners.clear()

    def _solve(self, hyper: Hyper, factored: Factored, columns: Floats) -> Solved:
        """Solve an effect's columns once per factoring (they are tried at many amplitudes)."""
        key = (hyper.base, id(columns))
        if key not in self._solved:
            while len(self._solved) > 40:
                del self._solved[next(iter(self._solved))]
            solved = Solved(factored.blocks.solved(columns))
            self._solved[key] = (columns, solved)  # columns kept, so that the id stays theirs
        return self._solved[key][1]

    def residual(self, terms: tuple[Term, ...], theta: Floats) -> Floats:
        """Reading minus model on the stretched scale; shape (N,)."""
        r = self.scene.readings
        return self._seen - r.stretched(predict(self.scene, terms, theta))

    def jacobian(self, terms: tuple[Term, ...], theta: Floats, residual: Floats) -> Floats:
        """d model / d theta on the stretched scale by differences that stay inside the ranges; shape (N, P)."""
        parameters = [p for t in terms for p in t.parameters]
        columns = []
        for k, p in enumerate(parameters):
            step = 0.02 * p.width
            if theta[k] + step > p.high:
                step = -step
            moved = theta.copy()
            moved[k] += step
            columns.append((residual - self.residual(terms, moved)) / step)
        return np.stack(columns, axis=1) if columns else np.zeros((len(residual), 0))

    def fit(self, terms: tuple[Term, ...], start: Floats, hyper: Hyper, extra: tuple[Extra, ...] = ()) -> Fit:
        """Gauss-Newton from ``start`` at some sizes, with halved steps where the objective does not fall."""
        whitener = self.whitener(hyper, extra)
        parameters = tuple(p for t in terms for p in t.parameters)
        prior = Prior.of(parameters)
        theta = inside(np.asarray(start, dtype=np.float64), parameters)
        residual = self.residual(terms, theta)
        value = whitener.gram(residual[:, None])[0, 0] + prior.value(theta)
        jacobian = self.jacobian(terms, theta, residual)
        for _ in range(_STEPS if parameters else 0):
            gram = whitener.gram(np.column_stack([jacobian, residual]))
            precision = precision_of(gram, prior, theta)
            step = np.linalg.solve(precision, gram[:-1, -1] + prior.pull(theta))
            for halving in range(6):
                trial = inside(theta + step * 0.5**halving, parameters)
                trial_residual = self.residual(terms, trial)
                trial_value = whitener.gram(trial_residual[:, None])[0, 0] + prior.value(trial)
                if trial_value < value:
                    break
            else:
                break
            moved = np.abs(trial - theta) / np.sqrt(np.diag(np.linalg.inv(precision)))
            theta, residual = trial, trial_residual
            better, value = value - trial_value, trial_value
            jacobian = self.jacobian(terms, theta, residual)
            if np.all(moved < _SMALL * 30) or better < 0.02:
                break
        return Fit(terms, theta, residual, jacobian, objective=float(value), hyper=hyper)

    def scan_starts(self, term: Term, hyper: Hyper) -> list[tuple[float, Floats]]:
        """Objectives and starting points of one term alone, best first."""
        points = _starts(term) if np.any(self.scene.is_gonio) else self._scaled(term, hyper)
        residuals = np.stack([self.residual((term,), p) for p in points], axis=1)
        values = self.whitener(hyper).squares(residuals)
        prior = Prior.of(term.parameters)
        values += np.array([prior.value(p) for p in points])
        return [(float(values[k]), points[k]) for k in np.argsort(values)]

    def _scaled(self, term: Term, hyper: Hyper) -> Floats:
        """A term's starting points, and the same with the change that each makes scaled to what fits best."""
        points = _starts(term)
        nothing = self.residual((), np.zeros(0))
        moved = [nothing - self.residual((term,), p) for p in points]
        gram = self.whitener(hyper).gram(np.column_stack([nothing, *moved]))
        size = gram[0, 1:] / np.maximum(np.diag(gram)[1:], 1e-12)
        free = np.array([p.centre == 0.0 for p in term.parameters])  # others are lengths: they scale nothing
        scaled = np.where(free, points * np.clip(size, 0.0, 3.0)[:, None], points)
        return np.concatenate([points, [inside(p, term.parameters) for p in scaled]])

    def promises(
        self, ways: Sequence[Term], hyper: Hyper, beside: Fit, extra: tuple[Extra, ...] = ()
    ) -> list[tuple[float, Floats]]:
        """How far each of some terms more may lower the objective, and from which start.

        The change that a start makes is scaled to what fits best, as if the model were linear in it and in the
        parameters of the others: what a first mechanism took of the second's, it gives back.
        """
        points = [(k, p) for k, term in enumerate(ways) for p in _starts(term)]
        moved = [
            beside.residual - self.residual((*beside.terms, ways[k]), np.concatenate([beside.theta, p]))
            for k, p in points
        ]
        gram = self.whitener(hyper, extra).gram(np.column_stack([beside.residual, *moved, beside.jacobian]))
        n = 1 + len(points)
        prior = Prior.of(beside.parameters)
        given_back = np.linalg.solve(gram[n:, n:] + np.diag(prior.precision(beside.theta)), gram[n:, :n])
        left = gram[:n, :n] - gram[:n, n:] @ given_back
        onto, size = left[0, 1:], np.diag(left)[1:]
        scaled = np.where(onto > 0.0, onto**2 / np.maximum(size, 1e-12), 0.0)
        scales = np.array([len(p) > 0 for _, p in points])  # what has no parameter is there or is not
        drop = np.maximum(np.where(scales, scaled, -np.inf), 2.0 * gram[0, 1:n] - np.diag(gram)[1:n])
        best = [max((k for k, (way, _) in enumerate(points) if way == w), key=drop.item) for w in range(len(ways))]
        return [(float(drop[k]), points[k][1]) for k in best]

    def weigh(
        self,
        fits: list[Fit],
        extra: tuple[Extra, ...] = (),
        start: Hyper | None = None,
        strides: tuple[int, ...] = STRIDES,
    ) -> None:
        """Set evidence, covariance and best sizes of fits; the search for those begins at ``start`` (or the fit's)."""
        for f in fits:
            f.hyper, f.log_evidence = self.lattice.climb(self.density(f, extra), start or f.hyper, strides)
            f.bending = self._bending(f.terms)
            f.log_evidence -= f.bending
            f.covariance = posterior_covariance(self.whitener(f.hyper, extra), f)

    def taken_by_lens(self, fit: Fit) -> float:
        """By how much (rms, relative) what a fit leaves seems to be the lens's usual errors."""
        weights = self.whitener(fit.hyper).weights(fit.residual)
        return float(np.std(self.nuisance.of_lens(weights, fit.hyper)[self.scene.is_gonio]))

    def _bending(self, terms: tuple[Term, ...]) -> float:
        """What forms with many parameters count for less [nats]: they bend to a simulation's ripple."""
        free = (t for t in terms if t.mechanism.bends and len(t.parameters) > FEW_NUMBERS)
        return EACH_NUMBER * sum(len(t.parameters) for t in free) if np.any(self.scene.is_gonio) else 0.0

    def density(self, fit: Fit, extra: tuple[Extra, ...]) -> Callable[[Hyper], float]:
        """Log evidence of a fit at some sizes, their prior included."""
        columns = np.column_stack([fit.jacobian, fit.residual])
        white: dict[tuple[float, float], Solved] = {}

        def density(hyper: Hyper) -> float:
            whitener = self.whitener(hyper, extra)
            if hyper.base not in white:
                white[hyper.base] = Solved(whitener.solved(columns))
            gram = whitener.gram_of(white[hyper.base])
            return laplace(gram, whitener.log_det, fit.theta, fit.parameters) + hyper.log_weight

        return density


def _starts(term: Term) -> Floats:
    """All combinations of the parameters' starting values, (K, P); one empty row where there is no parameter."""
    grids = np.meshgrid(*[p.starts for p in term.parameters], indexing="ij")
    return np.stack([g.ravel() for g in grids], axis=1) if grids else np.zeros((1, 0))


def posterior_covariance(whitener: Whitener, fit: Fit) -> Floats:
    """Covariance (P, P) of the parameters at some sizes, prior included."""
    if not fit.parameters:
        return np.zeros((0, 0))
    gram = whitener.gram(np.column_stack([fit.jacobian, fit.residual]))
    return np.asarray(np.linalg.inv(precision_of(gram, Prior.of(fit.parameters), fit.theta)))
