"""Physics beyond the catalogue: never named as a cause, offered as a conjecture where structure is left unnamed.

They are laws that a leftover may follow (in angle, time, place of the arm). Where one of them fits better than every
catalogued mechanism, the cause is outside the catalogue, and the law says of what kind it may be.
"""

import numpy as np
from numpy.typing import NDArray

from analysis.cases.model import Floats
from analysis.explain.mechanisms.base import Branch, Mechanism, Stage
from analysis.explain.mechanisms.misaligned_arm import ArmSag, Backlash, OffCentre, SlippedArm, TiltedAxis
from analysis.explain.mechanisms.misaligned_camera import TiltedCamera, TurnedCamera
from analysis.explain.mechanisms.past_the_lens import PastTheLens
from analysis.explain.mechanisms.shaded import Shaded
from analysis.explain.mechanisms.sluggish import Sluggish
from analysis.explain.mechanisms.weathered import Dew, Warming
from analysis.explain.parameter import Parameter
from analysis.explain.scene import Scene


class SlowSensors(Mechanism):
    """The sensors remember what they saw before."""

    id = "slow-sensors"
    stage = Stage.SENSORS
    leaves_out = "The sensors are slow: each reading holds a share of the one before."
    parameters = (Parameter("share", "1", "share of the reading before", 0.0, 0.6, 0.1, (0.05, 0.2)),)
    needs = "times of the records"
    source = "first-order lag: y_i + k (y_(i-1) - y_i)"
    tie_breaker = "a scan at half the speed"
    in_time = True

    def respond(self, scene: Scene, values: Floats, p: Floats, branch: Branch) -> Floats:
        """Mix in the reading before, of the same sensor in the same test."""
        before = scene.remember(_reading_before).astype(np.int64)
        return np.asarray(values + p[0] * (values[before] - values))


class WarmingSensors(Mechanism):
    """Sensors whose sensitivity follows a temperature, and so the time."""

    id = "warming-sensors"
    stage = Stage.SENSORS
    leaves_out = "The sensors' sensitivity drifts, as it does when they warm up."
    parameters = (
        Parameter(
            "per_scan", "1", "relative change from the beginning of a test to its end", -0.5, 0.5, 0.05, (-0.05, 0.05)
        ),
    )
    needs = "times of the records"
    source = "y (1 + b (t - middle) / duration)"
    tie_breaker = "a thermometer at the sensors, and a lamp read every minute"
    in_time = True

    def respond(self, scene: Scene, values: Floats, p: Floats, branch: Branch) -> Floats:
        """Scale by the drift."""
        return np.asarray(values * (1.0 + p[0] * scene.remember(_place_in_scan) * scene.is_gonio))


class Crosstalk(Mechanism):
    """Each sensor's reading holds a share of its neighbours'."""

    id = "crosstalk"
    stage = Stage.SENSORS
    leaves_out = "Each sensor's reading holds a share of its neighbours' readings."
    parameters = (Parameter("share", "1", "share of each neighbour's reading", 0.0, 0.3, 0.05, (0.02, 0.08)),)
    source = "y_i + a (y_(i-1) - y_i) + a (y_(i+1) - y_i), or the former alone, for sensors that are read in turn"
    tie_breaker = "one sensor covered at a time"

    def branches(self, scene: Scene) -> tuple[Branch, ...]:
        """Cables side by side; or a multiplexer that still holds what it read last."""
        return Branch("from both sides", (-1, 1)), Branch("from below", (-1,)), Branch("from above", (1,))

    def respond(self, scene: Scene, values: Floats, p: Floats, branch: Branch) -> Floats:
        """Mix in the neighbours along the arm, in the same plane."""
        found = values.copy()
        for side in branch.value:
            found += p[0] * (values[scene.remember(_neighbour, side).astype(np.int64)] - values)
        return found


def _neighbour(scene: Scene, side: int) -> Floats:
    """Index of the next sensor's reading, inwards (-1) or outwards (1) along the arm, or its own at the end; (N,)."""
    r = scene.readings
    found: NDArray[np.int64] = np.arange(len(r))
    rows = np.flatnonzero(scene.is_gonio)
    order = rows[np.lexsort((r.gamma_deg[rows], np.round(np.nan_to_num(r.c_deg[rows]), 3), r.test[rows]))]
    alike = (r.test[order[1:]] == r.test[order[:-1]]) & (np.abs(r.c_deg[order[1:]] - r.c_deg[order[:-1]]) < 1e-3)
    inner, outer = order[:-1][alike], order[1:][alike]
    if side < 0:
        found[outer] = inner
    else:
        found[inner] = outer
    return found.astype(np.float64)


def _reading_before(scene: Scene) -> Floats:
    """Index of the reading before each, of the same sensor in the same test (its own for the first); shape (N,)."""
    r = scene.readings
    before: NDArray[np.int64] = np.arange(len(r))
    for k in np.unique(r.test):
        for channel in np.unique(r.channel[r.test == k]):
            rows = np.flatnonzero((r.test == k) & (r.channel == channel))
            rows = rows[np.argsort(r.utc_ns[rows], kind="stable")]
            before[rows[1:]] = rows[:-1]
    return before.astype(np.float64)


def _place_in_scan(scene: Scene) -> Floats:
    """Time within each test, from -1/2 to 1/2; shape (N,)."""
    r = scene.readings
    place = np.zeros(len(r))
    for k in np.unique(r.test):
        rows = r.test == k
        t = (r.utc_ns[rows] - r.utc_ns[rows].min()) / 1e9
        place[rows] = t / max(float(t.max()), 1e-9) - 0.5
    return place


CONJECTURES: tuple[Mechanism, ...] = (
    ArmSag(),
    OffCentre(),
    Backlash(),
    SlippedArm(),
    TiltedAxis(),
    PastTheLens(),
    Crosstalk(),
    SlowSensors(),
    WarmingSensors(),
    Sluggish(),
    Shaded(),
    TurnedCamera(),
    TiltedCamera(),
    Warming(),
    Dew(),
)
