"""The camera on the roof: what it makes of the sky's luminance.

The camera may be the instrument under test (its readings are ``measured``) or the prediction that a luminance meter is
compared with (its values are ``simulated``); in the second case its errors are taken off the prediction.
"""

import numpy as np

from analysis.cases.model import Floats
from analysis.explain.mechanisms.base import Branch, Mechanism, Stage
from analysis.explain.parameter import Parameter
from analysis.explain.scene import Scene
from labdaq import directions


def camera_is_measured(scene: Scene) -> np.ndarray:
    """Rows whose reading comes from the camera; on the other luminance rows the prediction does; shape (N,)."""
    camera = np.array([c.kind == "camera" for c in scene.readings.case.channels])
    return np.asarray(camera[scene.readings.channel])


def _seen(scene: Scene, values: Floats, factor: Floats) -> Floats:
    """Multiply what the camera saw by ``factor`` (or divide, where the camera is the prediction)."""
    gain = np.where(camera_is_measured(scene), factor, 1.0 / np.maximum(factor, 1e-6))
    return np.where(scene.is_sky, values * gain, values)


def zenith_angle(scene: Scene) -> Floats:
    """Angle of each row's direction from the zenith, in right angles [0..1]; rows without a direction look up (0)."""
    gamma = scene.readings.gamma_deg
    return np.where(np.isnan(gamma), 0.0, np.abs(180.0 - np.nan_to_num(gamma, nan=180.0)) / 90.0)


class _CameraMechanism(Mechanism):
    """Base: it needs luminance readings; some need more than one direction."""

    stage = Stage.CAMERA
    kinds = ("sky",)
    wide = False

    def why_not(self, scene: Scene) -> str:
        """Luminance readings, and directions where the effect is one of direction."""
        if not np.any(scene.is_sky):
            return "there is no luminance reading"
        if self.wide and np.ptp(zenith_angle(scene)[scene.is_sky]) < 0.2:
            return "all luminance readings look in about the same direction from the zenith"
        return ""


class Vignetting(_CameraMechanism):
    """The fisheye's image darkens towards its rim."""

    id = "vignetting"
    leaves_out = "The fisheye's image darkens towards its rim, and this was not corrected."
    parameters = (
        Parameter("loss_at_rim", "1", "relative loss of luminance at 90° from the zenith", 0.0, 0.9, 0.25, (0.1, 0.3)),
    )
    source = "L (1 - v t²) or (1 - v t⁴), t the zenith angle over 90°; Goldman and Chen 2005; Inanici 2006"
    tie_breaker = "an integrating sphere, or a lamp photographed at many angles"
    wide = True

    def branches(self, scene: Scene) -> tuple[Branch, ...]:
        """An early or a late fall-off."""
        return (Branch("square law", 2.0), Branch("fourth-power law", 4.0))

    def respond(self, scene: Scene, values: Floats, p: Floats, branch: Branch) -> Floats:
        """Darken towards the rim."""
        return _seen(scene, values, 1.0 - p[0] * np.minimum(zenith_angle(scene), 1.2) ** branch.value)

    def statement(self, p: Floats, branch: Branch) -> str:
        """Say how much."""
        return f"The fisheye loses {p[0]:.0%} of the luminance at its rim ({branch.label}); this was not corrected."


class VeilingGlare(_CameraMechanism):
    """Light scattered in the lens lays a veil over the picture."""

    id = "veiling-glare"
    leaves_out = "Light scattered in the camera's lens lays a veil over the whole picture."
    parameters = (Parameter("veil", "1", "veil over the mean luminance of the sky", 0.0, 0.6, 0.06, (0.01, 0.05)),)
    source = "L + v <L>, <L> = diffuse illuminance / pi where it is known; Talvala et al. 2007; McCann and Rizzi 2007"
    tie_breaker = "a black target in the picture"

    def respond(self, scene: Scene, values: Floats, p: Floats, branch: Branch) -> Floats:
        """Add the veil (or take it off)."""
        sign = np.where(camera_is_measured(scene), 1.0, -1.0)
        return np.where(scene.is_sky, values + sign * p[0] * _mean_luminance(scene), values)

    def statement(self, p: Floats, branch: Branch) -> str:
        """Say how strong."""
        return f"A veil of {p[0]:.1%} of the sky's mean luminance lies over the picture (light scattered in the lens)."


def _mean_luminance(scene: Scene) -> Floats:
    """Mean luminance of each row's sky [cd/m²], from the diffuse illuminance, else from the rows of the test."""
    r = scene.readings
    count = len(r.case.tests)
    rows = np.where(scene.is_sky, r.simulated, 0.0)
    n = np.maximum(np.bincount(r.test, weights=scene.is_sky.astype(float), minlength=count), 1.0)
    mean = np.bincount(r.test, weights=rows, minlength=count) / n
    return np.asarray(np.where(np.isfinite(r.diffuse_lx), r.diffuse_lx / np.pi, mean)[r.test])


class SpectralMismatch(_CameraMechanism):
    """Blue sky is not what the luminance weights were made for."""

    id = "spectral-mismatch"
    leaves_out = "The camera's luminance weights were not made for blue sky."
    parameters = (Parameter("error_on_blue", "1", "relative error on the bluest sky", -0.6, 0.6, 0.12, (-0.08, 0.08)),)
    needs = "the sky's class, or directions and the sun's place"
    source = "L (1 + m b), b the blueness: 1 in clear sky far from the sun, 0 in cloud; hdr.md section 5; Navarra 2022"
    tie_breaker = "a picture through a neutral and a blue filter, or a spectrometer at one place in the sky"

    def branches(self, scene: Scene) -> tuple[Branch, ...]:
        """Blueness by the sky's class, by the distance from the sun, or by both."""
        r = scene.readings
        classes = {t.sky for t in r.case.tests}
        ways = []
        if len(classes) > 1 and None not in classes:
            ways.append(Branch("by sky class", "class"))
        placed = ~np.isnan(r.gamma_deg[scene.is_sky])
        if np.all(placed) and not np.any(np.isnan(r.sun_altitude_at_deg[scene.is_sky])):
            ways.append(Branch("by distance from the sun", "angle"))
            if ways[0].value == "class":
                ways.append(Branch("by sky class and distance from the sun", "both"))
        return tuple(ways)

    def why_not(self, scene: Scene) -> str:
        """Something must tell blue from grey."""
        return super().why_not(scene) or (
            "" if self.branches(scene) else "nothing in the case tells blue sky from grey"
        )

    def respond(self, scene: Scene, values: Floats, p: Floats, branch: Branch) -> Floats:
        """Weight by the blueness."""
        return _seen(scene, values, 1.0 + p[0] * _blueness(scene, branch.value))

    def statement(self, p: Floats, branch: Branch) -> str:
        """Say how much."""
        return (
            f"The camera is wrong by {p[0]:+.1%} on the bluest sky ({branch.label}): its luminance "
            "weights do not fit blue light."
        )


def _blueness(scene: Scene, way: str) -> Floats:
    r = scene.readings
    of_class = {"clear": 1.0, "partly-cloudy": 0.5, "overcast": 0.0, None: 0.5}
    sky = np.array([of_class[t.sky] for t in r.case.tests])[r.test]
    if way == "class":
        return sky
    towards = directions.vector(np.nan_to_num(r.gamma_deg, nan=180.0), np.nan_to_num(r.c_deg))
    sun = directions.sky_vector(r.sun_altitude_at_deg, r.sun_azimuth_at_deg)
    away = 1.0 - np.exp(-directions.angle_between(towards, sun) / 30.0)
    return away * sky if way == "both" else away


class ExposureError(_CameraMechanism):
    """True shutter times differ from nominal ones: each stretch of the luminance scale has its own error."""

    id = "exposure-error"
    leaves_out = "The true shutter times differ from the nominal ones: the error jumps from one exposure to the next."
    parameters = (
        Parameter("sd", "1", "standard deviation of the error from frame to frame", 0.0, 0.4, 0.06, (0.02, 0.05, 0.1)),
        Parameter(
            "correlation_stops", "stops", "stretch of the scale that shares an error", 0.3, 4.0, 0.7, (1.0,), centre=1.0
        ),
    )
    source = "a random step per stop of luminance; nominal 1/60 against 1/64 s: 7 % (hdr.md section 3a)"
    tie_breaker = "the same bracket with exposures shifted by half a stop, or EXIF times"
    random = True

    def statement(self, p: Floats, branch: Branch) -> str:
        """Say how large."""
        return (
            f"The camera's error jumps by {p[0]:.1%} rms from one stretch of the luminance scale "
            "to the next: shutter times are not nominal."
        )


class ProjectionError(_CameraMechanism):
    """The lens maps angles otherwise than assumed."""

    id = "projection-error"
    leaves_out = "The lens is not the projection that was assumed: pixels look elsewhere than thought."
    parameters = (
        Parameter(
            "shift_deg",
            "deg",
            "largest error of the direction, outwards, half way to the rim",
            -12.0,
            12.0,
            2.5,
            (-2.0, 2.0),
        ),
    )
    source = (
        "true zenith angle = assumed + s sin(2 · zenith angle); equisolid taken for "
        "equidistant: 3.8° (hdr.md section 5)"
    )
    tie_breaker = "a picture of marks at known angles, or of the sun over a day"
    wide = True

    def respond(self, scene: Scene, values: Floats, p: Floats, branch: Branch) -> Floats:
        """Read the sky at the shifted direction, by its own slope."""
        shift = p[0] * np.sin(np.pi * np.minimum(zenith_angle(scene), 1.0))
        slope = scene.remember(_slope)
        return _seen(scene, values, np.exp(np.clip(slope * shift, -2.0, 2.0)))

    def statement(self, p: Floats, branch: Branch) -> str:
        """Say how far."""
        return (
            f"The lens maps directions up to {abs(p[0]):.1f}° "
            f"{'outwards' if p[0] > 0 else 'inwards'} of the assumed projection."
        )


def _slope(scene: Scene) -> Floats:
    """d ln(luminance) / d(zenith angle) [1/deg] of the prediction at each row, from its neighbours in the test."""
    r = scene.readings
    slope = np.zeros(len(r))
    theta = 90.0 * zenith_angle(scene)
    v = directions.vector(np.nan_to_num(r.gamma_deg, nan=180.0), np.nan_to_num(r.c_deg))
    log = np.log(np.maximum(r.simulated, 1e-9))
    for k in np.unique(r.test[scene.is_sky]):
        rows = np.flatnonzero((r.test == k) & scene.is_sky)
        if len(rows) < 6:
            continue
        away = np.degrees(np.arccos(np.clip(v[rows] @ v[rows].T, -1, 1)))
        reach = np.maximum(np.sort(away, axis=1)[:, min(6, len(rows) - 1)], 5.0)
        for i, row in enumerate(rows):
            w = np.exp(-0.5 * (away[i] / reach[i]) ** 2)
            tangent = _tangents(v[row])
            local = (v[rows] - v[row]) @ tangent.T * (180.0 / np.pi)
            a = np.column_stack([np.ones(len(rows)), local])
            fit = np.linalg.lstsq(a * w[:, None], log[rows] * w, rcond=None)[0]
            slope[row] = fit[1] if theta[row] > 1.0 else 0.0
    return slope


def _tangents(v: Floats) -> Floats:
    """Unit vectors along growing zenith angle and along azimuth at a direction; shape (2, 3)."""
    across = np.array([-v[1], v[0], 0.0])
    norm = np.linalg.norm(across)
    across = across / norm if norm > 1e-9 else np.array([1.0, 0.0, 0.0])
    outward = np.cross(across, v)
    if outward[2] > 0:
        outward = -outward
    return np.stack([outward / np.linalg.norm(outward), across])
