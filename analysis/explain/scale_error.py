"""A scale between all that an arm read and its prediction: of units, of a calibration, of the whole lens.

So far off is no level of a simulation. What physics of the catalogue there is beside it is told by its shape; taken for
physics, a third of the light is dirt, and a hundred nats for it.
"""

from typing import Final

import numpy as np

from analysis.cases.model import Floats
from analysis.explain.readings import GONIOMETER, Readings

LEAST: Final = 0.4
"""Where all readings together are off by more than this (natural logarithm of the ratio), that is a scale."""


def scale_of(r: Readings) -> float:
    """Logarithm of measured over predicted, the median of all goniometer rows; 0 where that is no scale."""
    rows = (r.kind == GONIOMETER) & (r.measured > 0.0) & (r.simulated > 0.0)
    off = float(np.median(np.log(r.measured[rows] / r.simulated[rows]))) if np.any(rows) else 0.0
    return off if abs(off) > LEAST else 0.0


def scale_error(r: Readings) -> Floats:
    """Effect (N, 1) of such a scale on the stretched scale of readings, as large as it is; (N, 0) without one."""
    off = scale_of(r)
    if off == 0.0:
        return np.zeros((len(r), 0))
    return np.asarray(np.where(r.kind == GONIOMETER, off * np.abs(r.measured) / r.scale, 0.0)[:, None])
