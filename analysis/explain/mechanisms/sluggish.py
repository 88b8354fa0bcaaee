"""A meter that follows the light slowly: a law outside the catalogue that looks much like a clock's offset.

An offset moves the series; a slow meter also smooths it. Where clouds pass, the two can be told apart.
"""

import numpy as np

from analysis.cases.model import Floats
from analysis.explain.mechanisms.base import Branch, Mechanism, Stage
from analysis.explain.mechanisms.roof_meters import heads, of_channel
from analysis.explain.parameter import Parameter
from analysis.explain.scene import Scene
from analysis.explain.series import predicted_noise, quiet, series_of


class Sluggish(Mechanism):
    """The reading is the light of the last minutes, weighted by exp(-age / time constant)."""

    id = "sluggish response"
    stage = Stage.SENSORS
    leaves_out = "The meter follows the light slowly."
    parameters = (Parameter("lag_min", "min", "time constant", 0.0, 60.0, 4.0, (0.3, 1.5, 6.0)),)
    source = "first-order low pass of the predicted series, read as straight lines between its points"
    kinds = ("roof",)

    def why_not(self, scene: Scene) -> str:
        """A series of times."""
        if not scene.on_the_roof or not scene.readings.has_times:
            return "there is no series of times"
        return "" if series_of(scene) else "there is no series of times"

    def branches(self, scene: Scene) -> tuple[Branch, ...]:
        """Each meter, and all of them alike."""
        return heads(scene)

    def respond(self, scene: Scene, values: Floats, p: Floats, branch: Branch) -> Floats:
        """Low-pass each series of the meter."""
        if p[0] < 1e-6:
            return values
        made, mine = values.copy(), of_channel(scene, branch.value)
        noise = scene.remember(predicted_noise)
        for s in series_of(scene):
            if not mine[s.rows[0]]:
                continue
            steady = quiet(s.t, values[s.rows], noise[s.rows])
            made[s.rows] += low_passed(s.t, steady, float(p[0])) - steady
        return made


def low_passed(t: Floats, x: Floats, constant: float) -> Floats:
    """First-order low pass of straight lines through (t, x), both of shape (M,), M > 1.

    What it followed before the first reading is not recorded: that had the trend of the first time constant. (Between
    two readings a passing cloud is no trend.)
    """
    slope = np.diff(x) / np.maximum(np.diff(t), 1e-9)
    age = t - t[0]
    weight = np.exp(-age / max(constant, age[1], 1e-9))
    about = age - np.average(age, weights=weight)
    y = np.empty_like(x)
    y[0] = x[0] - constant * float(weight * about @ x) / max(float(weight * about @ about), 1e-9)
    for i, along in enumerate(slope):
        fade = np.exp(-(t[i + 1] - t[i]) / constant)
        y[i + 1] = x[i + 1] - along * constant + (y[i] - x[i] + along * constant) * fade
    return y
