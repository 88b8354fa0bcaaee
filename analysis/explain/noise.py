"""What every explanation allows for before it calls anything physics: nuisances.

Readings scatter about the right model because of noise, test gains, sensor gains, and because no simulation
has quite the right lens: a smooth shape discrepancy on the sphere, partly the same in all tests of a system.
Neighbouring directions therefore err together; a method that takes them for independent is far too sure of itself
(Kennedy and O'Hagan 2001, J. R. Stat. Soc. B 63; Brynjarsdottir and O'Hagan 2014, Inverse Problems 30).

All amplitudes are relative to the reading. Three of them are not known: see `analysis.explain.hypers`.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import Final

import numpy as np
from numpy.typing import NDArray

from analysis.cases.model import Floats
from analysis.explain.hypers import Hyper
from analysis.explain.mount_error import mount_errors
from analysis.explain.nearness import by_direction, by_time, days_of
from analysis.explain.readings import GONIOMETER, ROOF, SKY, Readings
from analysis.explain.scale_error import scale_error
from analysis.explain.whitening import Blocks, Factored, Solved, Whitener

GAIN_OF_TESTS: Final = 0.03
GAIN_OF_SENSORS: Final = 0.009
GAIN_OF_METERS: Final = 0.006
SOURCE: Final = 0.006
SOURCE_S: Final = (40.0, 200.0)
"""Usual wander of daylight while an arm reads, and over what times [s]: no sky is clear or overcast altogether. (Of
two other authors' skies it was .4 to 1.8 %, and was called a cloud for 32 and 78 nats.)"""
POINTING_DEG: Final = 0.14
"""Usual error of direction from record to record: of the arm or a camera, and of the grid between whose nodes a
prediction lies."""


@dataclass(frozen=True)
class Usual:
    """Usual relative amplitudes for a kind of channel."""

    shape: float  # of a system's (or instrument's) discrepancy, shared by its tests
    shape_of_test: float  # of a test's own discrepancy
    scatter: float  # unexplained scatter from record to record
    gain: float  # of a test
    level: float  # of a system (transmittance) or an instrument (absolute scale)
    restless: float = (
        0.0  # further gain of a test, growing with the scatter: two instruments never look at the same time
    )
    wander: float = 0.0  # the same, growing with the shape: what wanders within a day does so from test to test


USUAL: Final = {
    GONIOMETER: Usual(0.018, 0.016, 0.005, GAIN_OF_TESTS, 0.04),
    ROOF: Usual(0.003, 0.002, 0.003, 0.002, 0.0, wander=0.003),
    SKY: Usual(0.0, 0.012, 0.005, 0.012, 0.0, 0.010),  # what tests have in common: see sky_error
}


@dataclass(frozen=True)
class Block:
    """Rows whose errors go together: a system's goniometer rows, a roof instrument's day, or one picture of the sky.

    Attributes
    ----------
    rows : shape (n,)
        Indices into the readings.
    near : shape (n, n)
        Correlation of the smooth discrepancy (of direction, or of time on the roof).
    """

    kind: str
    rows: NDArray[np.int64]
    readings: Readings
    near: Floats

    @cached_property
    def same_test(self) -> Floats:
        """1 where two rows belong to the same test; shape (n, n)."""
        test = self.readings.test[self.rows]
        return np.asarray(test[:, None] == test[None, :], dtype=np.float64)

    @cached_property
    def loud(self) -> Floats:
        """Products of reading over scale, which is below 1 where a reading drowns in noise; shape (n, n)."""
        r = self.readings
        loud = np.abs(r.measured[self.rows]) / r.scale[self.rows]
        return np.asarray(loud[:, None] * loud[None, :])

    @cached_property
    def shapes(self) -> Floats:
        """Covariance of the usual smooth discrepancy; shape (n, n)."""
        usual = USUAL[self.kind]
        return (usual.shape**2 + usual.shape_of_test**2 * self.same_test) * self.near * self.loud

    @cached_property
    def wandering(self) -> Floats:
        """Relative covariance of readings under a source that wanders (`source_wander`); shape (n, n)."""
        return source_wander(self.readings, self.rows)

    @cached_property
    def levels(self) -> Floats:
        """Covariance of the usual gains of tests and the level of all; shape (n, n)."""
        usual = USUAL[self.kind]
        return (usual.level**2 + usual.gain**2 * self.same_test) * self.loud


def source_wander(r: Readings, rows: NDArray[np.int64]) -> Floats:
    """Relative covariance (n, n) of daylight at the moments of some rows; zero without times."""
    if not r.has_times:
        return np.zeros((len(rows), len(rows)))
    t = r.utc_ns[rows] / 1e9
    apart2 = (t[:, None] - t[None, :]) ** 2
    return np.asarray(SOURCE**2 * np.mean([np.exp(-0.5 * apart2 / s**2) for s in SOURCE_S], axis=0))


def blocks_of(readings: Readings) -> tuple[Block, ...]:
    """Group rows: goniometer rows by system, roof meters' by channel and day, the sky's by channel and test."""
    r = readings
    part = np.where(r.kind == SKY, r.test, days_of(r))
    group = np.where(r.kind == GONIOMETER, r.system[r.test], 1_000_000 * (1 + r.channel) + part)
    made = []
    for g in np.unique(group):
        rows = np.flatnonzero(group == g)
        kind = str(r.kind[rows[0]])
        near = by_time(r, rows) if kind == ROOF else by_direction(r, rows)
        made.append(Block(kind, rows, r, near))
    return tuple(made)


class Nuisance:
    """The covariance of what every model leaves over, on the stretched scale.

    Parameters
    ----------
    lens_error : shape (N, K)
        Effects of the simulation's lens (`analysis.explain.lens_error`); they grow with `Hyper.lens`.
    steepness : shape (N,) [1/deg]
        Relative change of the prediction per degree: a steep place is scattered by errors of direction.
    alone : shape (N,)
        Relative standard deviations by which readings that stand alone err by themselves.
    further : shape (N, K)
        More effects, of the size that they usually have.
    """

    def __init__(
        self,
        readings: Readings,
        lens_error: Floats,
        steepness: Floats,
        alone: Floats | None = None,
        further: Floats | None = None,
    ) -> None:
        self.readings = readings
        self.blocks = blocks_of(readings)
        fixed = self._sensor_gains(), split_errors(readings), scale_error(readings), mount_errors(readings)
        self._gains = np.concatenate(fixed if further is None else (*fixed, further), axis=1)
        self._lens_error = lens_error
        self._jitter = POINTING_DEG * steepness
        self._alone = np.zeros(len(readings)) if alone is None else alone

    def _sensor_gains(self) -> Floats:
        """Columns (N, K): each sensor's or meter's gain, times its usual size."""
        r = self.readings
        loud = np.abs(r.measured) / r.scale
        columns = []
        for k in np.unique(r.channel):
            rows = r.channel == k
            size = GAIN_OF_SENSORS if r.kind[rows][0] == GONIOMETER else GAIN_OF_METERS
            columns.append(np.where(rows, size * loud, 0.0))
        return np.stack(columns, axis=1)

    def matrix(self, block: Block, hyper: Hyper) -> Floats:
        """Covariance (n, n) of one block."""
        usual, r = USUAL[block.kind], self.readings
        c = hyper.shape**2 * block.shapes + block.levels
        if usual.wander:
            c += (hyper.shape * usual.wander) ** 2 * block.same_test * block.loud
        if block.kind == GONIOMETER:
            c += block.wandering * block.loud
        if usual.restless:
            c += (hyper.scatter * usual.restless) ** 2 * block.same_test * block.loud
        noise = (r.noise[block.rows] / r.scale[block.rows]) ** 2 + self._alone[block.rows] ** 2
        scatter = usual.scatter**2 + self._jitter[block.rows] ** 2
        c[np.diag_indices_from(c)] += noise + hyper.scatter**2 * scatter + 1e-8
        return np.asarray(c)

    def of_lens(self, weights: Floats, hyper: Hyper) -> Floats:
        """What the lens seems to have wrong in each reading (N,), given the covariance's inverse times a residual."""
        return np.asarray(hyper.lens**2 * self._lens_error @ (self._lens_error.T @ weights))

    def factored(self, hyper: Hyper) -> Factored:
        """Factor the blocks for some sizes, and solve the nuisance effects by them; `Hyper.lens` does not matter."""
        factors = [np.asarray(np.linalg.cholesky(self.matrix(b, hyper))) for b in self.blocks]
        blocks = Blocks([b.rows for b in self.blocks], factors)
        return Factored(blocks, Solved(blocks.solved(self._gains)), Solved(blocks.solved(self._lens_error)))

    def whitener(self, hyper: Hyper) -> Whitener:
        """The covariance at some sizes."""
        return self.factored(hyper).whitener(hyper.lens)


def split_errors(r: Readings) -> Floats:
    """Effects (N, K) of a roof meter that was off in one test: it had the simulated beam too bright, or beam and sky.

    The simulation's beam is what a test's global reading has more than its diffuse one, so errors of both meters grow
    in it: by half where the sun is high and clear, threefold where it stands low in haze.
    """
    columns = [np.zeros((len(r), 0))]
    beam = r.global_lx - r.diffuse_lx
    relative = 1.0 / np.hypot(r.simulated, r.floor)
    loud = np.abs(r.measured) / r.scale
    for k in np.unique(r.test[r.kind == GONIOMETER]):
        if not beam[k] > 0.02 * r.diffuse_lx[k]:
            continue
        rows = (r.test == k) & (r.kind == GONIOMETER)
        sun, sky = (np.where(rows, np.nan_to_num(part) * relative, 0.0) for part in (r.sun, r.sky))
        parts = [r.global_lx[k] / beam[k] * sun, sky - r.diffuse_lx[k] / beam[k] * sun]
        columns.append(GAIN_OF_METERS * loud[:, None] * np.stack(parts, axis=1))
    return np.concatenate(columns, axis=1)
