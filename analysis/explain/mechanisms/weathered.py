"""What weather does to a meter on the roof, beyond the catalogue: it warms, and is wet until the sun has dried it.

Both are functions of the time of day that a tilted or a cosine-false head can imitate; unlike those, they change sun
and sky alike, whatever the diffuse share of the day.
"""

import numpy as np

from analysis.cases.model import Floats
from analysis.explain.mechanisms.base import Branch, Mechanism, Stage
from analysis.explain.mechanisms.roof_meters import of_channel, roof_channels
from analysis.explain.parameter import Parameter
from analysis.explain.scene import Scene

_EACH = -1
_DAY_H = 24.0


class Warming(Mechanism):
    """A meter whose sensitivity follows the temperature, and that the time of day."""

    id = "warming meter"
    stage = Stage.SENSORS
    leaves_out = "The meter's sensitivity follows its temperature, which rises and falls with the day."
    parameters = (
        Parameter("change", "1", "relative change for half the day's swing", -0.5, 0.5, 0.1, (-0.1, 0.1)),
        Parameter("warmest_h", "h", "mean solar time when it is warmest", 11.5, 18.0, 1.5, (13.0, 15.0), centre=14.5),
        Parameter("right_at", "1", "where in the swing, from -1 to 1, the meter is right", -1.5, 1.5, 0.6, (0.0,)),
    )
    needs = "times and the site"
    source = "y (1 + a (cos(2π (t - t0) / 24 h) - c)); CIE/ISO 19476 alpha (temperature dependence)"
    tie_breaker = "a thermometer at the meter; the same light with the meter warm and cold"
    kinds = ("roof",)

    def why_not(self, scene: Scene) -> str:
        """A meter that is read on the roof alone, and its solar time."""
        if scene.kinds != ("roof",):
            return "no meter is read on the roof alone"
        known = scene.readings.has_times and scene.readings.case.setup.site is not None
        return "" if known else "neither times nor the site are given"

    def branches(self, scene: Scene) -> tuple[Branch, ...]:
        """Each meter."""
        return roof_channels(scene)

    def respond(self, scene: Scene, values: Floats, p: Floats, branch: Branch) -> Floats:
        """Scale the meter's readings by the time of day."""
        swing = np.cos(2.0 * np.pi * (scene.readings.solar_h - p[1]) / _DAY_H)
        mine = of_channel(scene, branch.value)
        return np.asarray(np.where(mine, values * np.maximum(1.0 + p[0] * (swing - p[2]), 0.0), values))


class Dew(Mechanism):
    """Dew or frost on a meter's head, until the sun has dried it."""

    id = "dew on a meter"
    stage = Stage.SENSORS
    leaves_out = "The meter was wet (dew, frost) in the morning, until the sun had dried it."
    parameters = (
        Parameter("change", "1", "relative change of the reading at sunrise", -0.8, 0.5, 0.2, (-0.2,)),
        Parameter("dry_deg", "deg", "the sun's altitude when two thirds are dry", 3.0, 45.0, 10.0, (8.0, 20.0), 15.0),
    )
    needs = "sun angles, or site and times"
    source = "y (1 + a exp(-altitude / dry)) before noon, in one test or in each"
    tie_breaker = "a look at the head in the morning, and a cloth"
    kinds = ("roof",)

    def why_not(self, scene: Scene) -> str:
        """The sun's place must be known, and a meter on the roof."""
        if scene.kinds != ("roof",):
            return "no meter is read on the roof alone"
        r = scene.readings
        unknown = np.any(np.isnan(r.sun_altitude_at_deg) | np.isnan(r.sun_azimuth_at_deg))
        return "neither sun angles nor site and times are given" if unknown else ""

    def branches(self, scene: Scene) -> tuple[Branch, ...]:
        """Each meter, in each test, or in one."""
        tests = scene.readings.case.tests
        ways = [(k, tests[k].id) for k in np.unique(scene.readings.test)]
        ways = [(_EACH, "each test"), *(ways if len(ways) > 1 else [])]
        return tuple(
            Branch(f"{head.label}, {name}", (head.value, int(k))) for head in roof_channels(scene) for k, name in ways
        )

    def respond(self, scene: Scene, values: Floats, p: Floats, branch: Branch) -> Floats:
        """Dim the meter's mornings."""
        channel, test = branch.value
        r = scene.readings
        morning = of_channel(scene, channel) & (np.sin(np.radians(r.sun_azimuth_at_deg)) > 0.0)
        if test != _EACH:
            morning &= r.test == test
        wet = np.exp(-np.maximum(r.sun_altitude_at_deg, 0.0) / max(float(p[1]), 0.1))
        return np.asarray(np.where(morning, values * np.maximum(1.0 + p[0] * wet, 0.0), values))
