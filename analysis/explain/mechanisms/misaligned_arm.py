"""Physics beyond the catalogue: a goniometer's arm that is bent, has play, or turns about the wrong point or axis."""

import numpy as np

from analysis.cases.model import Floats
from analysis.explain.mechanisms.base import Branch, Mechanism, Stage
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
        return "" if scene.distance_m else "the case does not give the sensors' distance"

    def illuminate(self, scene: Scene, light: Light, p: Floats, branch: Branch) -> None:
        """Sample the fields in the directions in which the sensors really were."""
        assert scene.distance_m is not None
        shift = np.array([p[0], p[1], -p[2]]) / scene.distance_m
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
    in_time = True

    def why_not(self, scene: Scene) -> str:
        """The sense of turning must be known, and must change."""
        if missing := super().why_not(scene):
            return missing
        senses = scene.remember(_sense_of_turning)[scene.is_gonio]
        return "" if np.any(senses > 0) and np.any(senses < 0) else "the arm always turned the same way"

    def illuminate(self, scene: Scene, light: Light, p: Floats, branch: Branch) -> None:
        """Sample the fields where the arm really was."""
        light.c_deg = light.c_deg - 0.5 * p[0] * scene.remember(_sense_of_turning)
        light.moved = True


class SlippedArm(Mechanism):
    """From some plane of each scan on, the arm stands elsewhere than its scale says."""

    id = "slipped-arm"
    stage = Stage.GONIOMETER
    leaves_out = "The arm slips during a scan: from some plane on it stands elsewhere than its scale says."
    parameters = (
        Parameter("slip_deg", "deg", "true C minus the recorded one, afterwards", -20.0, 20.0, 5.0, (-8.0, 8.0)),
        Parameter(
            "after",
            "1",
            "share of the scan's planes before it",
            0.05,
            0.95,
            0.3,
            (0.15, 0.35, 0.5, 0.65, 0.85),
            centre=0.5,
        ),
    )
    needs = "times of the records"
    source = "I(gamma, C + d) after the same share of each scan"
    tie_breaker = "the first plane of each scan once more at its end"
    in_time = True

    def illuminate(self, scene: Scene, light: Light, p: Floats, branch: Branch) -> None:
        """Sample the fields where the arm stood; a plane in which it slipped counts for both."""
        before, planes = scene.remember(_planes_before)
        light.c_deg = light.c_deg + p[0] * np.clip(before - p[1] * planes + 1.0, 0.0, 1.0)
        light.moved = True


class TiltedAxis(Mechanism):
    """The arm turns about an axis that is not plumb, or the skylight does not hang level: the light lies tilted."""

    id = "tilted-axis"
    stage = Stage.GONIOMETER
    leaves_out = "The arm's axis is not plumb, or the skylight does not hang level."
    parameters = (
        Parameter("east_deg", "deg", "the light turned towards the east, at nadir", -8.0, 8.0, 1.0, (-1.0, 0.0, 1.0)),
        Parameter("north_deg", "deg", "the light turned towards the north, at nadir", -8.0, 8.0, 1.0, (-1.0, 0.0, 1.0)),
    )
    source = "rotation about a horizontal axis"
    tie_breaker = "a spirit level on the axis in four planes, and on the skylight's frame"

    def illuminate(self, scene: Scene, light: Light, p: Floats, branch: Branch) -> None:
        """Sample the fields in the directions that the sensors have for the skylight."""
        angle = float(np.hypot(p[0], p[1]))
        axis = np.array([-p[1], p[0], 0.0]) / max(angle, 1e-12)
        place = directions.rotated(directions.vector(light.gamma_deg, light.c_deg), axis, angle)
        gamma, light.c_deg = directions.gamma_c(place)
        light.gamma_deg = np.minimum(gamma, 90.0)
        light.moved = True


def _planes_before(scene: Scene) -> Floats:
    """How many planes the arm had been in before each reading's, in that test, and how many there are; shape (2, N)."""
    r = scene.readings
    found = np.zeros((2, len(r)))
    for k in np.unique(r.test[scene.is_gonio]):
        rows = np.flatnonzero((r.test == k) & scene.is_gonio)
        rows = rows[np.argsort(r.utc_ns[rows], kind="stable")]
        new = np.abs(np.diff(r.c_deg[rows], prepend=r.c_deg[rows[0]])) > 0.01
        found[0, rows] = np.cumsum(new)
        found[1, rows] = 1.0 + np.count_nonzero(new)
    return found


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
