"""What repeated readings of one direction say of a source that changes.

The arm's lowest sensor looks at nadir in every half plane: sixteen readings of one direction in each test. What a lens,
a room or an arm does there is the same each time, so those readings tell a changing source from a shape that only
happens to be visited in the order of time. And a source that changes changes all the arm's sensors at once: what nadir
does alone is the simulation's, whose nadir may have sides.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag

from analysis.cases.model import Floats
from analysis.explain.fit import Fit
from analysis.explain.lens_error import SUN_S_PER_DEG
from analysis.explain.noise import USUAL, source_wander
from analysis.explain.readings import GONIOMETER
from analysis.explain.scene import Scene
from analysis.explain.thresholds import SHOWN
from analysis.explain.wander import Wandering

NADIR_DEG = 2.0
"""Directions closer to nadir than this are one direction."""
COMMON = 1.0
"""A relative error of all repeats of a test says nothing of a source that changes within it."""
_FEWEST = 6
_OVAL = 0.006
"""Relative change at nadir that is the same from opposite sides: of a sensor's head, or of a simulation whose lens is
wrong as if nadir had sides. (Another author's is, by 2 %; that was told as a cloud, which knows no sides.)"""
_OF_THE_ARM = 0.01
"""The same at each of the arm's angles in all tests: an arm that hangs beside its axis, a nadir that has sides. No
cloud comes at the same moment of every scan. (Another author's nadir is so where an aureole is hidden, by 1 %; that was
told as a cloud. Where nothing is left out other authors' are so by .2 to .3 %, mostly.)"""
_TESTS_OF_THE_ARM = 4
"""It takes so many tests to know."""
_RAMP_PER_DEG = 0.15
"""Relative change at nadir for a degree of the sun's way: the edge of a sun's image may pass."""
_SAME_DEG = 1.0
"""Angles of the arm that differ by less are one."""
_FAR_FROM_NADIR_DEG = 20.0
"""What the simulation has wrong at nadir reaches sensors closer to it, too."""
_ONE_MOMENT_S = 2.0
_SLOPES = np.linspace(0.3, 1.5, 25)
"""How much the other sensors change for a change at nadir, if the source does: of ten true clouds by six other authors
0.7 to 1.5, where little of their light is the sun's less."""
_LEAST_RELIABLE = 0.2
"""Where less of nadir's variance is more than noise, nothing is said of company."""
_NO_COMPANY = -1.5
_LEAST_SHARE = 0.02
"""Nadir tells such a share of what is expected of an effect of its size (of ten true clouds 0.04 and more), or shows it
by itself. (A true one that seemed to be of 17 %, since it leaned on other things, was told by 47 nats of 2540.)"""


@dataclass(frozen=True)
class Repeats:
    """What the repeats of a case say of a random effect.

    Attributes
    ----------
    gain
        Log odds [nats] of the repeats with the effect against without it.
    expected
        What ``gain`` would be on average, were the effect there.
    company
        Log odds [nats] that the arm's other sensors change at the moments when nadir does, against not at all.
    """

    gain: float
    expected: float
    company: float = 0.0

    @property
    def told(self) -> float:
        """Log odds [nats] of a source that changes, by nadir and the sensors that see it change at once."""
        return self.gain + self.company

    @property
    def alone(self) -> bool:
        """Whether nadir changes, and no other sensor at the same moments."""
        return self.company < _NO_COMPANY

    @property
    def contradict(self) -> bool:
        """Whether the effect should have shown in the repeats, and they hardly tell of it; or nadir changes alone.

        Little is asked: the scatter that is allowed for holds a part of what a small effect does there, and what leans
        on other things is larger than that.
        """
        hidden = self.expected > 3.0 and self.told < min(_LEAST_SHARE * self.expected, SHOWN)
        return hidden or self.alone


def repeats(scene: Scene, fit: Fit, wandering: Wandering) -> Repeats:
    """Ask the nadir readings of each test about a random function of time, beside what ``fit`` explains."""
    extra = wandering.extra(scene)
    repeated = _repeated(scene)
    if not repeated:
        return Repeats(0.0, 0.0)
    rows = np.concatenate(repeated)
    effects = extra.amplitude * extra.columns[rows]
    plain = block_diag(*(_plain(scene, fit, k) for k in repeated))
    added = effects @ effects.T
    common = [np.zeros(plain.shape), *_of_the_arm(scene, rows, len(repeated))]
    with_it, without = (
        np.logaddexp.reduce([_log_density(fit.residual[rows], steady + arm) for arm in common])
        for steady in (plain + added, plain)
    )
    ratio = np.linalg.slogdet(plain + added)[1] - np.linalg.slogdet(plain)[1]
    expected = 0.5 * float(np.trace(np.linalg.solve(plain, added)) - ratio)
    return Repeats(float(with_it - without), expected, company(scene, fit))


def _log_density(residual: Floats, covariance: Floats) -> float:
    """Log density [nats] of a residual (n,), up to a constant."""
    return -0.5 * float(residual @ np.linalg.solve(covariance, residual) + np.linalg.slogdet(covariance)[1])


def _of_the_arm(scene: Scene, rows: NDArray[np.int64], tests: int) -> list[Floats]:
    """Covariance (n, n) of what repeats at one angle may have wrong in all tests alike; none where tests are few."""
    if tests < _TESTS_OF_THE_ARM:
        return []
    turn = np.nan_to_num(scene.readings.c_deg[rows])
    alike = np.abs((turn[:, None] - turn + 180.0) % 360.0 - 180.0) < _SAME_DEG
    return [np.where(alike, _OF_THE_ARM**2, 0.0)]


def company(scene: Scene, fit: Fit) -> float:
    """Log odds [nats] that what ``fit`` leaves of the arm's other sensors goes with nadir, against not at all.

    Each test's scan is worth two independent moments: what a lens has wrong is smooth in C, which the arm goes through
    in the order of time. Noise at nadir hides a part of the slope.
    """
    pairs = [_pairs(scene, fit, rows) for rows in _repeated(scene)]
    pairs = [p for p in pairs if len(p) >= _FEWEST]
    if not pairs:
        return 0.0
    nadir, others, noise = np.concatenate([p - p.mean(axis=0) for p in pairs]).T
    noise = np.concatenate(pairs)[:, 2]
    reliable = 1.0 - float(np.sum(noise) / max(float(nadir @ nadir), 1e-30))
    if reliable < _LEAST_RELIABLE:
        return 0.0
    left = np.array([np.sum((others - reliable * slope * nadir) ** 2) for slope in _SLOPES])
    likelihoods = -len(pairs) * np.log(left / float(others @ others))
    return float(np.logaddexp.reduce(likelihoods) - np.log(len(_SLOPES)))


def _pairs(scene: Scene, fit: Fit, rows: NDArray[np.int64]) -> Floats:
    """What is left at nadir and, at the same moments, of sensors far from it (mean), and the variance of the noise at
    nadir; shape (n, 3)."""
    r = scene.readings
    far = scene.is_gonio & (r.test == r.test[rows[0]]) & (np.nan_to_num(r.gamma_deg) > _FAR_FROM_NADIR_DEG)
    others = np.flatnonzero(far)
    at_once = np.abs(r.utc_ns[others] - r.utc_ns[rows][:, None]) < _ONE_MOMENT_S * 1e9
    means = [fit.residual[others[now]].mean() if now.any() else np.nan for now in at_once]
    found = np.column_stack([fit.residual[rows], means, (r.noise[rows] / r.scale[rows]) ** 2])
    return np.asarray(found[np.isfinite(means)])


def _repeated(scene: Scene) -> list[NDArray[np.int64]]:
    """Rows of each test that look at nadir, where there are enough of them."""
    r = scene.readings
    nadir = scene.is_gonio & (np.nan_to_num(r.gamma_deg, nan=90.0) < NADIR_DEG)
    found = [np.flatnonzero(nadir & (r.test == k)) for k in np.unique(r.test)]
    return [rows for rows in found if len(rows) >= _FEWEST]


def _plain(scene: Scene, fit: Fit, rows: NDArray[np.int64]) -> Floats:
    """Covariance of repeats of one direction under a steady source: noise, any common error, one that is the same from
    opposite sides, the sun's own way, and what daylight usually wanders."""
    r, usual = scene.readings, USUAL[GONIOMETER]
    noise = (r.noise[rows] / r.scale[rows]) ** 2 + (fit.hyper.scatter * usual.scatter) ** 2
    way = _RAMP_PER_DEG * (r.utc_ns[rows] - r.utc_ns[rows].mean()) / 1e9 / SUN_S_PER_DEG
    wander = source_wander(r, rows)
    turn = np.radians(np.nan_to_num(r.c_deg[rows]))
    oval = _OVAL**2 * np.cos(2.0 * (turn[:, None] - turn))
    return np.asarray(np.diag(noise + 1e-8) + COMMON**2 + np.outer(way, way) + wander + oval)
