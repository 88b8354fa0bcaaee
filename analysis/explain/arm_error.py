"""How an arm usually hangs: with its centre some millimetres beside the aperture's.

So does a prediction of what it reads, whose opening is drawn to the millimetre and whose sharp images lie between the
directions of a table. In a thousand readings a few of them are worth tens of nats, and stand against whatever else
is true. An arm that is centimetres off is a conjecture (`analysis.explain.mechanisms.misaligned_arm`).
"""

from typing import Final

import numpy as np

from analysis.cases.model import Floats
from analysis.explain.mechanisms.base import Branch, Term, predict
from analysis.explain.mechanisms.misaligned_arm import OffCentre
from analysis.explain.scene import Scene

USUAL_M: Final = 0.0025
"""Usual error of its centre towards east, and towards north: what a plumb line leaves. (How far below the aperture it
turns is no such error: that looks like an offset in the dark.)"""


def arm_errors(scene: Scene) -> Floats:
    """Independent unit effects (N, 2) on the stretched scale; (N, 0) where no arm is described."""
    r, hung = scene.readings, OffCentre()
    if scene.goniometer is None or not np.any(scene.is_gonio):
        return np.zeros((len(r), 0))
    term = (Term(hung, Branch(), hung.parameters),)
    moved = [r.stretched(predict(scene, term, sign * USUAL_M * unit)) for unit in np.eye(3)[:2] for sign in (1.0, -1.0)]
    return np.stack([(moved[k] - moved[k + 1]) / 2.0 for k in (0, 2)], axis=1)
