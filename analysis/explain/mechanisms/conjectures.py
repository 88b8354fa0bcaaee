"""Physics beyond the catalogue: never named as a cause, offered as a conjecture where structure is left unnamed.

They are laws that a leftover may follow (in angle, time, place of the arm). Where one of them fits better than every
catalogued mechanism, the cause is outside the catalogue, and the law says of what kind it may be.
"""

import numpy as np
from numpy.typing import NDArray

from analysis.cases.model import Floats
from analysis.explain.mechanisms.base import Branch, Mechanism, Stage
from analysis.explain.mechanisms.misaligned_camera import TiltedCamera, TurnedCamera
from analysis.explain.mechanisms.shaded import Shaded
from analysis.explain.mechanisms.sluggish import Sluggish
from analysis.explain.mechanisms.weathered import Dew, Warming
from analysis.explain.parameter import Parameter
from analysis.explain.scene import Light, Scene
from labdaq import directions


class ArmSag(Mechanism):
    """The arm bends under its weight, the more the further it reaches out."""

    id = "arm-sag"
    stage = Stage.GONIOMETER
    leaves_out = "The arm bends: its vertical angle is off by an amount that grows with gamma."
    parameters = (Parameter("sag_deg", "deg", "error of gamma at 90°", -4.0, 4.0, 1.0, (-1.0, 1.0)),)
    source = "I(gamma + d sin gamma, C)"
    tie_breaker = "a spirit level at several points of the arm"

    def illuminate(self, scene: Scene, light: Light, p: Floats, branch: Branch) -> None:
        """Sample the fields elsewhere."""
        light.gamma_deg = light.gamma_deg + p[0] * np.sin(np.radians(light.gamma_deg))
        light.moved = True


class OffCentre(Mechanism):
    """The arm does not turn about the aperture's centre."""

    id = "off-centre"
    stage = Stage.GONIOMETER
    leaves_out = "The arm does not turn about the centre of the aperture."
    parameters = (
        Parameter("east_m", "m", "arm's centre east of the aperture's", -0.3, 0.3, 0.03, (-0.03, 0.03)),
        Parameter("north_m", "m", "arm's centre north of the aperture's", -0.3, 0.3, 0.03, (-0.03, 0.03)),
        Parameter("below_m", "m", "arm's centre below the aperture", -0.3, 0.3, 0.03, (0.0,)),
    )
    source = "direction and inverse square from the true centre"
    tie_breaker = "a plumb line from the aperture's centre"

    def why_not(self, scene: Scene) -> str:
        """A shift in metres needs the arm's radius."""
        return "" if scene.goniometer else "the case does not describe the goniometer"

    def illuminate(self, scene: Scene, light: Light, p: Floats, branch: Branch) -> None:
        """Sample the fields in the directions in which the sensors really were."""
        assert scene.goniometer is not None
        shift = np.array([p[0], p[1], -p[2]]) / scene.goniometer.distance_m
        place = directions.vector(light.gamma_deg, light.c_deg) + shift
        gamma, light.c_deg = directions.gamma_c(place)
        light.gamma_deg = np.minimum(gamma, 90.0)
        light.moved = True
        nearer = 1.0 / np.sum(place**2, axis=1)
        light.sun_factor, light.sky_factor = light.sun_factor * nearer, light.sky_factor * nearer


class Backlash(Mechanism):
    """The arm's play: its plane is off by half of it, to the side that it comes from."""

    id = "backlash"
    stage = Stage.GONIOMETER
    leaves_out = "The arm has play: its horizontal angle lags behind, to the side that it came from."
    parameters = (Parameter("play_deg", "deg", "play of the horizontal axis", -8.0, 8.0, 1.5, (-1.5, 1.5)),)
    needs = "times of the records, and planes taken in both senses of turning"
    source = "I(gamma, C - d/2 in the sense of turning); hysteresis of a gear"
    tie_breaker = "the same plane reached from both sides"

    def why_not(self, scene: Scene) -> str:
        """The sense of turning must be known, and must change."""
        if not scene.readings.has_times:
            return "the records carry no time"
        senses = scene.remember(_sense_of_turning)[scene.is_gonio]
        return "" if np.any(senses > 0) and np.any(senses < 0) else "the arm always turned the same way"

    def illuminate(self, scene: Scene, light: Light, p: Floats, branch: Branch) -> None:
        """Sample the fields where the arm really was."""
        light.c_deg = light.c_deg - 0.5 * p[0] * scene.remember(_sense_of_turning)
        light.moved = True


class SlowSensors(Mechanism):
    """The sensors remember what they saw before."""

    id = "slow-sensors"
    stage = Stage.SENSORS
    leaves_out = "The sensors are slow: each reading holds a share of the one before."
    parameters = (Parameter("share", "1", "share of the reading before", 0.0, 0.6, 0.1, (0.05, 0.2)),)
    needs = "times of the records"
    source = "first-order lag: y_i + k (y_(i-1) - y_i)"
    tie_breaker = "a scan at half the speed"

    def why_not(self, scene: Scene) -> str:
        """The order of the readings must be known."""
        return "" if scene.readings.has_times else "the records carry no time"

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

    def why_not(self, scene: Scene) -> str:
        """A drift needs times."""
        return "" if scene.readings.has_times else "the records carry no time"

    def respond(self, scene: Scene, values: Floats, p: Floats, branch: Branch) -> Floats:
        """Scale by the drift."""
        return np.asarray(values * (1.0 + p[0] * scene.remember(_place_in_scan) * scene.is_gonio))


class TintedSensors(Mechanism):
    """The sensors see bluish skylight and yellowish sunlight with different sensitivities."""

    id = "tinted-sensors"
    stage = Stage.SENSORS
    leaves_out = "The sensors weigh skylight and sunlight differently, as their colour response is not the eye's."
    parameters = (Parameter("sky_gain", "1", "relative sensitivity to the sky part", -0.6, 1.0, 0.1, (-0.1, 0.1)),)
    needs = "sun and sky parts apart"
    source = "S + (1+t) K, alike in all tests; CIE/ISO 19476 f1' (spectral mismatch)"
    tie_breaker = "the same scan through a bluish and a yellowish filter"

    def why_not(self, scene: Scene) -> str:
        """The parts must be known apart."""
        return "" if scene.readings.has_parts else "the records do not give the sun and sky parts apart"

    def illuminate(self, scene: Scene, light: Light, p: Floats, branch: Branch) -> None:
        """Weigh the sky part."""
        light.sky_factor = light.sky_factor * (1.0 + p[0])


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


def _sense_of_turning(scene: Scene) -> Floats:
    """1 where the arm came to a plane with C growing, -1 where with C falling; shape (N,)."""
    r = scene.readings
    sense = np.zeros(len(r))
    for k in np.unique(r.test[scene.is_gonio]):
        rows = np.flatnonzero((r.test == k) & scene.is_gonio)
        rows = rows[np.argsort(r.utc_ns[rows], kind="stable")]
        step = np.diff(r.c_deg[rows], prepend=r.c_deg[rows[0]])
        step = np.where(np.abs(step) > 180.0, -step, step)  # over the north
        moved = np.where(np.abs(step) > 0.01, np.arange(len(step)), -1)
        last = np.maximum.accumulate(moved)
        first = moved[moved >= 0][:1]
        turned = np.where(last >= 0, last, first[0] if len(first) else 0)
        sense[rows] = np.sign(step[turned])
    return sense


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
    SlowSensors(),
    WarmingSensors(),
    TintedSensors(),
    Sluggish(),
    Shaded(),
    TurnedCamera(),
    TiltedCamera(),
    Warming(),
    Dew(),
)
