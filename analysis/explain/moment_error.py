"""Two instruments never read at one moment.

They integrate for a second or two and stand some steps apart, and a cloud's edge reaches one before the other. Under
broken cloud their readings scatter by what the daylight does in that time; it is no clock's error.
"""

import numpy as np

from analysis.cases.model import Floats
from analysis.explain.scene import Scene
from analysis.explain.series import recorded, unrest

APART_MIN = 0.03
"""Usual time between what two instruments see [min]: two seconds. (Another author's second meters were all read so
much later than the first, which gained up to 187 nats under broken cloud.)"""


def moment_error(scene: Scene) -> Floats:
    """Relative standard deviation by which each reading beside a second instrument's errs for that; (N,).

    Zero without one. A series that wanders like a random walk has gone as far as the root of the time (`unrest`).
    """
    if not scene.on_the_roof or not scene.readings.has_times or not recorded(scene):
        return np.zeros(len(scene.readings))
    return np.where(scene.is_roof, unrest(scene) * np.sqrt(APART_MIN), 0.0)
