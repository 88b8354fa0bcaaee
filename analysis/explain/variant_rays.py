"""A variant's change without the scatter of its rays.

A variant that was traced with rays of its own differs from the prediction by what its setting changes, and by both
simulations' rays. As a way in which something acts it would bring the prediction's rays with it, with the sign that
takes them out of the residual: a little of any such variant seems to explain much. (On another author's skylights, of
rays of 1.1 %, a wall and its scatter had 38 to 94 nats where they were as simulated.)

Rays differ from each direction of the file to the next; what a setting does to images a few degrees wide does not. So
both fields are blurred before their ratio is taken, as widely as takes away no more than the rays.
"""

from dataclasses import replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from analysis.cases.model import Floats
from analysis.explain.fields import GAMMA_DEG, Fields
from analysis.explain.geometry import blurred
from analysis.explain.retrace import Path

WIDTHS_DEG: Final = (12.0, 9.0, 6.5, 4.5, 3.0, 2.0)
"""Blurs that are tried (rms), the widest first."""
LEAST: Final = 0.002
"""Rays that scatter by less (rms of the logarithm) are left where they are."""
NO_MORE: Final = 1.15
"""What a blur takes away may be so many times the rays."""
_BRIGHT: Final = 0.01
"""Share of the brightest direction above which rays are counted."""
_THIRD: Final = np.array([1.0, -3.0, 3.0, -1.0])
_NORMAL: Final = 0.6745


def without_rays(path: Path, base: Fields, step_deg: float) -> Path:
    """The path with its ratios less the scatter of rays, where files have gammas ``step_deg`` [deg] apart."""
    stride = max(round(step_deg / float(GAMMA_DEG[1])), 1)
    sun, sky = path.sun.copy(), path.sky.copy()
    for ratio, light in ((sun, base.sun), (sky, base.sky)):
        for k in range(len(path.positions)):
            for test in np.flatnonzero(np.any(ratio[k] != 1.0, axis=(1, 2))):
                ratio[k, test] = _smooth(ratio[k, test], light[test], stride)
    return replace(path, sun=sun, sky=sky)


def _smooth(ratio: Floats, light: Floats, stride: int) -> Floats:
    """One ratio (P, G) of fields of one test, evened out over the widest blur that takes away no more than rays."""
    bright = light > _BRIGHT * float(light.max(initial=0.0))
    change = np.log(ratio)
    rays = scatter(change, bright, stride)
    if rays < LEAST:
        return ratio
    for width in WIDTHS_DEG:
        old, new = blurred(light[None], width)[0], blurred((light * ratio)[None], width)[0]
        even = np.divide(new, old, out=ratio.copy(), where=old > 0.0)
        if spread((change - np.log(np.maximum(even, 1e-3)))[bright]) < NO_MORE * rays:
            return np.asarray(even)
    return ratio


def scatter(change: Floats, bright: NDArray[np.bool_], stride: int) -> float:
    """Scatter of a logarithmic change (P, G) from one gamma of the file to the next, by its third differences."""
    if 3 * stride >= change.shape[1]:  # directions so far apart tell nothing of rays
        return 0.0
    steps = [change[:, stride * k : change.shape[1] - stride * (3 - k)] for k in range(4)]
    seen = np.all([bright[:, stride * k : change.shape[1] - stride * (3 - k)] for k in range(4)], axis=0)
    third = sum(f * s for f, s in zip(_THIRD, steps, strict=True))
    return spread(np.asarray(third)[seen]) / float(np.linalg.norm(_THIRD)) if np.any(seen) else 0.0


def scatter_around(change: Floats, bright: NDArray[np.bool_], stride: int) -> float:
    """The same from one of the file's planes to the next."""
    seen = np.all([np.roll(bright, -stride * k, axis=0) for k in range(4)], axis=0)
    third = sum(f * np.roll(change, -stride * k, axis=0) for k, f in enumerate(_THIRD))
    seen[:, 0] = False  # at nadir all planes are one direction
    return spread(np.asarray(third)[seen]) / float(np.linalg.norm(_THIRD)) if np.any(seen) else 0.0


def spread(values: Floats) -> float:
    """Standard deviation of values (n,) about their middle, by their median distance from it: few odd ones count."""
    return float(np.median(np.abs(values - np.median(values)))) / _NORMAL
