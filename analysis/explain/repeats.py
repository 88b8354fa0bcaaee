"""What repeated readings of one direction say of a source that changes.

The arm's lowest sensor looks at nadir in every half plane: sixteen readings of one direction in each test. What a lens,
a room or an arm does there is the same each time, so those readings tell a changing source from a shape that only
happens to be visited in the order of time.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from analysis.cases.model import Floats
from analysis.explain.fit import Fit
from analysis.explain.lens_error import SUN_S_PER_DEG
from analysis.explain.noise import USUAL, source_wander
from analysis.explain.readings import GONIOMETER
from analysis.explain.scene import Scene
from analysis.explain.wander import Wandering

NADIR_DEG = 2.0
"""Directions closer to nadir than this are one direction."""
COMMON = 1.0
"""A relative error of all repeats of a test says nothing of a source that changes within it."""
_FEWEST = 6
_OVAL = 0.006
"""Relative change at nadir that is the same from opposite sides: of a sensor's head, or of a simulation whose lens is
wrong as if nadir had sides. (Another author's is, by 2 %; that was told as a cloud, which knows no sides.)"""
_RAMP_PER_DEG = 0.15
"""Relative change at nadir for a degree of the sun's way: the edge of a sun's image may pass."""


@dataclass(frozen=True)
class Repeats:
    """What the repeats of a case say of a random effect.

    Attributes
    ----------
    gain
        Log odds [nats] of the repeats with the effect against without it.
    expected
        What ``gain`` would be on average, were the effect there.
    """

    gain: float
    expected: float

    @property
    def contradict(self) -> bool:
        """Whether the effect should have shown in the repeats, and they are likelier without it.

        Less than nothing is asked: the scatter that is allowed for holds a part of what a small effect does there.
        """
        return self.expected > 3.0 and self.gain < 0.0


def repeats(scene: Scene, fit: Fit, wandering: Wandering) -> Repeats:
    """Ask the nadir readings of each test about a random function of time, beside what ``fit`` explains."""
    extra = wandering.extra(scene)
    effects = extra.amplitude * extra.columns
    gain = expected = 0.0
    for rows in _repeated(scene):
        plain = _plain(scene, fit, rows)
        with_it = plain + effects[rows] @ effects[rows].T
        inverse, inverse_with = np.linalg.inv(plain), np.linalg.inv(with_it)
        residual = fit.residual[rows]
        log_ratio = np.linalg.slogdet(with_it)[1] - np.linalg.slogdet(plain)[1]
        gain += 0.5 * float(residual @ (inverse - inverse_with) @ residual - log_ratio)
        expected += 0.5 * float(np.trace(inverse @ with_it) - len(rows) - log_ratio)
    return Repeats(gain, expected)


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
