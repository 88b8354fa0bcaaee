"""Readings of one channel through one test, in the order of time: where its series can be moved or smoothed.

A predicted series that is itself a recording (a second meter's) has noise of its own. Whatever averages neighbours
takes some of it off, and agrees better with any other recording for that alone: an offset of the clock by a step and a
half, say, gains a quarter of a nat per reading and means nothing. So what acts on a series acts on what is not its
noise, and its noise stays where it is.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from analysis.cases.model import Floats
from analysis.explain.scene import Scene

_WIDTH = 2.5
"""Width [steps] of the weights of a local parabola: it keeps a sixth of the variance of independent noise."""
_SURE = 3.0
"""Second differences are a cloud's so far as their mean square is above so many times that of noise;"""
_ENOUGH = 6.0
"""of fewer than so many there must be as many times more: two may be large by chance."""
_FEWEST = 8
_RECORDED = (4.5e-4, 0.013)
"""Relative noise of a recording. (Of two authors' 115 second instruments the quietest had 5.8e-4, four saw broken cloud
alone and had more than 1e-2; of their 75 models of the sky all but two, under cloud alone, had less than 3.8e-4. A
third author's second instruments had up to 1e-2.)"""
_CALM = (0.3, 0.385)
"""Such a share of differences is taken for noise alone, and that quantile of a Gaussian's absolute value."""
_UNEVEN = 0.5
"""Times between the readings of a series may differ by this share of the usual one."""


@dataclass(frozen=True)
class Series:
    """Rows of a scene, in the order of time: test, channel, and times ``t`` [min]; shapes (M,)."""

    test: int
    channel: int
    rows: NDArray[np.int64]
    t: Floats


def series_of(scene: Scene) -> list[Series]:
    """All series of more than two readings."""
    r = scene.readings
    pairs, counts = np.unique(np.stack([r.test, r.channel], axis=1), axis=0, return_counts=True)
    found = []
    for k, c in pairs[counts > 2]:
        rows = np.flatnonzero((r.test == k) & (r.channel == c))
        rows = rows[np.argsort(r.utc_ns[rows])]
        found.append(Series(int(k), int(c), rows, r.utc_ns[rows] / 6e10))
    return found


def looks_one_way(scene: Scene, channel: int) -> bool:
    """Whether an instrument looks in one direction all the time, or in none: then its readings are a series."""
    r = scene.readings
    mine = r.channel == channel
    ways = np.stack([r.gamma_deg[mine], r.c_deg[mine]])
    return bool(np.all(np.ptp(ways, axis=1) == 0.0) or np.all(np.isnan(ways)))


def step_min(scene: Scene) -> float:
    """Usual time between readings of a channel [min]."""
    return float(np.median(np.concatenate([np.diff(s.t) for s in series_of(scene)])))


def quiet(t: Floats, x: Floats, noise: Floats) -> Floats:
    """A series (M,) without its ``noise`` (M,): smooth where second differences are no larger than noise makes them."""
    if len(t) < 3:
        return x
    wild = np.diff(x, n=2) ** 2
    expected = 6.0 * noise[1:-1] ** 2  # of (1, -2, 1)
    near = np.exp(-0.5 * ((np.arange(len(t))[:, None] - np.arange(1, len(t) - 1)[None, :]) / _WIDTH) ** 2)
    sure = _SURE + np.maximum(_ENOUGH - near.sum(axis=1), 0.0)
    cloud = np.clip(1.0 - sure * (near @ expected) / np.maximum(near @ wild, 1e-30), 0.0, 1.0)
    return np.asarray(cloud * x + (1.0 - cloud) * (_parabolas(t) @ x))


def _parabolas(t: Floats) -> Floats:
    """What reads local parabolas at their own places, as a matrix (M, M) (Cleveland 1979, doi:10.2307/2286407)."""
    step = max(float(np.median(np.diff(t))), 1e-9)
    x = (t[None, :] - t[:, None]) / step
    near = np.exp(-0.5 * (x / _WIDTH) ** 2)
    powers = np.stack([np.ones_like(x), x, x**2])
    normal = np.einsum("im,aim,bim->iab", near, powers, powers) + 1e-9 * np.eye(3)
    first = np.linalg.solve(normal, np.broadcast_to(np.eye(3)[:, :1], (len(t), 3, 1)))[..., 0]
    return np.asarray(near * np.einsum("ia,aim->im", first, powers))


def recorded(scene: Scene) -> bool:
    """Whether what is predicted for the roof is a second instrument's recording: a model of the sky has no noise.

    Under broken cloud all day, or without times, nothing tells.
    """
    return _RECORDED[0] < _quietest(scene) < _RECORDED[1]


def predicted_noise(scene: Scene) -> Floats:
    """Standard deviation (N,) of the noise of what is predicted.

    Half of the variance of the readings' noise, which may be that of both; more where the prediction shows more in
    third differences, of which clouds may make two thirds.
    """
    r = scene.readings
    thirds = []
    for s in series_of(scene):
        step = np.diff(s.t)
        if len(s.rows) > 3 and scene.is_roof[s.rows[0]] and np.ptp(step) < _UNEVEN * np.median(step):
            thirds.append(np.abs(np.diff(np.log(np.maximum(r.simulated[s.rows], r.floor[s.rows])), n=3)))
    shown = float(np.quantile(np.concatenate(thirds), _CALM[0])) / _CALM[1] / np.sqrt(20.0) if thirds else 0.0
    own = shown * np.abs(r.simulated) if _RECORDED[0] < shown < _RECORDED[1] else np.zeros(len(r))
    return np.asarray(np.maximum(np.sqrt(0.5) * r.noise, np.where(scene.is_roof, own, 0.0)))


def _quietest(scene: Scene) -> float:
    """Relative noise of the quietest predicted series of a roof, beside local parabolas (median); infinite without."""
    r = scene.readings
    noises = []
    for s in series_of(scene) if r.has_times else []:
        if len(s.rows) >= _FEWEST and scene.is_roof[s.rows[0]]:
            level = np.log(np.maximum(r.simulated[s.rows], r.floor[s.rows]))
            noises.append(1.48 * float(np.median(np.abs(level - _parabolas(s.t) @ level))))
    return min(noises, default=np.inf)


def unrest(scene: Scene) -> Floats:
    """How fast the predicted daylight wanders under broken cloud: ln per root of a minute at each row; (N,).

    From the second differences of a series, which the sun's even way leaves near zero: for a random walk their mean
    square is twice that of the steps, and grows with the time between readings. Zero where there is no series.
    """
    r = scene.readings
    found = np.zeros(len(r))
    for s in series_of(scene):
        if len(s.rows) < 4:
            continue
        level = np.log(np.maximum(r.simulated[s.rows], r.floor[s.rows]))
        step = np.maximum(np.diff(s.t), 1e-3)
        rate = np.diff(level, n=2) ** 2 / (step[:-1] + step[1:])
        middle = np.arange(1, len(s.rows) - 1)
        near = np.exp(-0.5 * (np.arange(len(s.rows))[:, None] - middle[None, :]) ** 2)
        found[s.rows] = np.sqrt(near @ rate / near.sum(axis=1))
    return found
