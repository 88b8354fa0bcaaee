"""How an arm usually hangs, and its sensors on it: some millimetres beside where they are thought to be.

So does a prediction of what it reads, whose opening is drawn to the millimetre and whose sharp images lie between the
directions of a table. In a thousand readings a few of them are worth tens of nats, and stand against whatever else
is true. An arm that is centimetres off is a conjecture (`analysis.explain.mechanisms.misaligned_arm`).
"""

from typing import Final

import numpy as np

from analysis.cases.model import Floats
from analysis.explain.mechanisms.base import Branch, Term, predict
from analysis.explain.mechanisms.goniometer import GammaOffset
from analysis.explain.mechanisms.misaligned_arm import OffCentre
from analysis.explain.scene import Scene

USUAL_M: Final = 0.0025
"""Usual error of its centre towards east, and towards north: what a plumb line leaves. (How far below the aperture it
turns is no such error: that looks like an offset in the dark.)"""
SENSOR_DEG: Final = 0.12
"""Usual error of the angle of each sensor on the arm: 5 mm at 2.6 m. (Another author's were off by .12; an offset of
the whole arm by .27 had 51 and 163 nats for that where nothing was left out.)"""


def sensor_angle_errors(scene: Scene) -> Floats:
    """One unit effect (N, K) on the stretched scale for each sensor of an arm; (N, 0) without one."""
    r, off = scene.readings, GammaOffset()
    sensors = np.unique(r.channel[scene.is_gonio])
    if len(sensors) < 2:  # a lone sensor's angle is the arm's
        return np.zeros((len(r), 0))
    term = (Term(off, Branch(), off.parameters),)
    later, sooner = (r.stretched(predict(scene, term, np.array([x]))) for x in (SENSOR_DEG, -SENSOR_DEG))
    return np.where(r.channel[:, None] == sensors[None, :], ((later - sooner) / 2.0)[:, None], 0.0)


def arm_errors(scene: Scene) -> Floats:
    """Independent unit effects (N, 2) on the stretched scale; (N, 0) where its length is not known."""
    r, hung = scene.readings, OffCentre()
    if scene.distance_m is None or not np.any(scene.is_gonio):
        return np.zeros((len(r), 0))
    term = (Term(hung, Branch(), hung.parameters),)
    moved = [r.stretched(predict(scene, term, sign * USUAL_M * unit)) for unit in np.eye(3)[:2] for sign in (1.0, -1.0)]
    return np.stack([(moved[k] - moved[k + 1]) / 2.0 for k in (0, 2)], axis=1)
