"""What a simulation gets wrong alike in all tests of a system, learned from the tests that were fitted.

Beside every mechanism, and where none is named, stand the smooth error of the simulated lens, its errors in the sun's
frame, and each sensor's gain. Their posterior means given the fitted tests (Gaussian-process regression; Rasmussen and
Williams 2006, ch. 2) hold for other tests of the same systems and sensors as well, and bring a prediction closer than
the mechanisms alone.
"""

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from scipy.interpolate import RegularGridInterpolator

from analysis.cases.model import Floats
from analysis.explain.fit import Extra, Fitter
from analysis.explain.hypers import Hyper
from analysis.explain.lens_error import lens_error_of_systems
from analysis.explain.nearness import nearness
from analysis.explain.noise import GAIN_OF_SENSORS, USUAL
from analysis.explain.ray_noise import evened_rays, own_rays
from analysis.explain.readings import GONIOMETER
from analysis.explain.scene import Scene
from labdaq import directions

GAMMA_DEG = np.arange(0.0, 90.1, 5.0)
C_DEG = np.arange(0.0, 360.0, 10.0)
MOST = 0.4
"""A lens's error in the sun's frame is taken off up to this relative size."""


@dataclass(frozen=True)
class SharedError:
    """Relative errors that tests share.

    Attributes
    ----------
    systems
        System's id to its error on `C_DEG` x `GAMMA_DEG`, shape (P, G).
    sensors
        Channel's id to its gain's error.
    lens
        System's id and kind of error of its lens (`analysis.explain.lens_error`) to its size, in usual ones.
    rays
        Share of what its files' directions scatter by about their neighbours that a prediction is better without.
    """

    systems: dict[str, Floats]
    sensors: dict[str, float]
    lens: dict[str, dict[str, float]] = field(default_factory=dict)
    rays: float = 0.0

    def at(self, scene: Scene) -> Floats:
        """Relative error of each row's prediction; shape (N,); zero for systems and sensors that were not fitted."""
        r = scene.readings
        found = np.array([self.sensors.get(c.id, 0.0) for c in r.case.channels])[r.channel]
        names = [t.system or "" for t in r.case.tests]
        for name, table in self.systems.items():
            rows = np.flatnonzero(np.array([n == name for n in names])[r.test] & (r.kind == GONIOMETER))
            found[rows] += _read(table, np.nan_to_num(r.gamma_deg[rows]), np.nan_to_num(r.c_deg[rows]))
        rays = self.rays * scene.remember_rows(evened_rays) if self.rays else 0.0
        return np.asarray(found + self._of_lens(scene) + rays)

    def _of_lens(self, scene: Scene) -> Floats:
        """What a lens has wrong in the sun's frame; on the flank of a sharp image no more than a bound is believed."""
        found = np.zeros(len(scene.readings))
        for (system, kind), effect in lens_error_of_systems(scene).items() if self.lens else ():
            found += self.lens.get(system, {}).get(kind, 0.0) * effect
        return np.clip(found, -MOST, MOST)

    def told(self) -> dict[str, Any]:
        """As JSON holds it."""
        return {
            "gamma_deg": GAMMA_DEG.tolist(),
            "c_deg": C_DEG.tolist(),
            "systems": {name: np.round(table, 5).tolist() for name, table in self.systems.items()},
            "sensors": {name: round(gain, 5) for name, gain in self.sensors.items()},
            "lens": {name: {kind: round(x, 4) for kind, x in sizes.items()} for name, sizes in self.lens.items()},
            "rays": round(self.rays, 4),
        }

    @classmethod
    def of(cls, told: dict[str, Any]) -> "SharedError":
        """From what `told` gave; raises `ValueError`, `KeyError` or `TypeError` where it is something else."""
        systems = {str(k): np.array(v, dtype=np.float64) for k, v in told["systems"].items()}
        if any(table.shape != (len(C_DEG), len(GAMMA_DEG)) for table in systems.values()):
            raise ValueError("a table of another grid")
        lens = {str(k): {str(kind): float(x) for kind, x in v.items()} for k, v in told["lens"].items()}
        sensors = {str(k): float(v) for k, v in told["sensors"].items()}
        return cls(systems, sensors, lens, float(told.get("rays", 0.0)))  # those of earlier versions tell none


def shared_error(fitter: Fitter, residual: Floats, hyper: Hyper, extra: tuple[Extra, ...] = ()) -> SharedError:
    """Posterior mean of what the tests share, given the residual (N,) of the accepted explanation."""
    r = fitter.scene.readings
    weights = fitter.whitener(hyper, extra).weights(residual)
    loud = np.abs(r.measured) / r.scale
    systems, sensors = {}, {}
    gamma, c = (x.ravel() for x in np.meshgrid(GAMMA_DEG, C_DEG))
    grid = directions.vector(gamma, c)
    usual = USUAL[GONIOMETER]
    for k in np.unique(r.system[r.test[r.kind == GONIOMETER]]) if GONIOMETER in r.kind else ():
        rows = np.flatnonzero((r.system[r.test] == k) & (r.kind == GONIOMETER))
        near = nearness(grid, directions.vector(r.gamma_deg[rows], r.c_deg[rows]), GONIOMETER)
        covariance = (hyper.shape * usual.shape) ** 2 * near + usual.level**2
        name = r.case.tests[r.test[rows[0]]].system or ""
        systems[name] = (covariance @ (loud * weights)[rows]).reshape(len(C_DEG), len(GAMMA_DEG))
    for channel in np.unique(r.channel[r.kind == GONIOMETER]):
        mine = r.channel == channel
        sensors[r.case.channels[channel].id] = GAIN_OF_SENSORS**2 * float((loud * weights)[mine].sum())
    lens: dict[str, dict[str, float]] = {}
    for (system, kind), effect in lens_error_of_systems(fitter.scene).items():
        lens.setdefault(system, {})[kind] = hyper.lens**2 * float(effect @ weights)
    return SharedError(systems, sensors, lens, float(np.sum(own_rays(fitter.scene).T @ weights)))


def _read(table: Floats, gamma_deg: Floats, c_deg: Floats) -> Floats:
    """Bilinear reading of a table (P, G), periodic in C."""
    closed = np.vstack([table, table[:1]])
    read = RegularGridInterpolator((np.append(C_DEG, 360.0), GAMMA_DEG), closed)
    return np.asarray(read((np.mod(c_deg, 360.0), np.clip(gamma_deg, GAMMA_DEG[0], GAMMA_DEG[-1]))))
