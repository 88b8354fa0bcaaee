"""The camera on the roof: what it makes of the sky's luminance.

The camera may be the instrument under test (its readings are ``measured``) or the prediction that a luminance meter is
compared with (its values are ``simulated``); in the second case its errors are taken off the prediction.
"""

from abc import ABC, abstractmethod

import numpy as np
from numpy.typing import NDArray

from analysis.cases.model import Floats
from analysis.explain.mechanisms.base import Branch, Mechanism, Reported, Stage, Term, told
from analysis.explain.parameter import Parameter
from analysis.explain.scene import Scene
from analysis.explain.sky_shape import towards
from labdaq import directions

WHITE = 1e6 / 6191.0
BLUEST = 1e6 / 16000.0
"""Reciprocal colour temperatures [MK^-1] of cloud and of the deep blue of a clear sky."""

_SAME = 2e-3
"""Predictions that differ by less from what a camera reads (relative) are that reading."""


def cameras_side(scene: Scene) -> Floats:
    """Where the camera's errors are, (N,): 1 in a row's reading, -1 in its prediction, 0 in neither.

    The prediction of a luminance meter is taken for the camera's where no camera is among the channels, or where it is
    what the camera reads.
    """
    meters = scene.is_sky & ~scene.is_camera
    in_prediction = not np.any(scene.is_camera) or _camera_predicts(scene, meters)
    return np.where(scene.is_camera, 1.0, np.where(meters, -1.0 if in_prediction else 0.0, 0.0))


def _camera_predicts(scene: Scene, meters: NDArray[np.bool_]) -> bool:
    """Whether the predictions of most rows of luminance meters are what some camera's row of their test reads."""
    r = scene.readings
    found: list[bool] = []
    for k in np.unique(r.test[meters]):
        mine, read = (np.flatnonzero((r.test == k) & rows) for rows in (meters, scene.is_camera))
        off = np.abs(r.simulated[mine][:, None] / np.maximum(r.measured[read], 1e-9)[None, :] - 1.0)
        found += (off.min(axis=1, initial=np.inf) < _SAME).tolist()
    return bool(found) and float(np.mean(found)) > 0.5


def seen(scene: Scene, values: Floats, factor: Floats) -> Floats:
    """Multiply what the camera saw by ``factor`` (or divide, where the camera is the prediction)."""
    return np.asarray(values * np.maximum(factor, 1e-6) ** scene.remember(cameras_side))


def zenith_angle(scene: Scene) -> Floats:
    """Angle of each row's direction from the zenith, in right angles [0..1]; rows without a direction look up (0)."""
    gamma = scene.readings.gamma_deg
    return np.where(np.isnan(gamma), 0.0, np.abs(180.0 - np.nan_to_num(gamma, nan=180.0)) / 90.0)


class CameraMechanism(Mechanism):
    """Base: it needs luminance readings; some need more than one direction (``wide``).

    Some also need the sky ``between`` those directions, which follows from the sun's place.
    """

    stage = Stage.CAMERA
    kinds = ("sky",)
    wide = False
    between = False

    def why_not(self, scene: Scene) -> str:
        """Luminance readings, directions where the effect is one of direction, and the sun where the sky is guessed."""
        if not np.any(scene.is_sky):
            return "there is no luminance reading"
        if self.wide and np.ptp(zenith_angle(scene)[scene.is_sky]) < 0.2:
            return "all luminance readings look in about the same direction from the zenith"
        return why_no_shape(scene) if self.between else ""


class LooksElsewhere(CameraMechanism, ABC):
    """Base of laws by which a camera looks beside the direction it is thought to look in."""

    needs = "directions and the sun's place"
    wide = between = True
    form_error = 0.25  # between the directions of a picture the sky is only guessed

    @abstractmethod
    def true_directions(self, scene: Scene, p: Floats, branch: Branch) -> Floats:
        """Unit vectors (N, 3) of the directions that the camera really looks in."""

    def respond(self, scene: Scene, values: Floats, p: Floats, branch: Branch) -> Floats:
        """Read the sky where the camera really looks."""
        return seen(scene, values, np.exp(scene.sky_shape.beside(self.true_directions(scene, p, branch))))


class Vignetting(CameraMechanism):
    """The fisheye's image darkens towards its rim."""

    id = "vignetting"
    leaves_out = "The fisheye's image darkens towards its rim, and this was not corrected."
    parameters = (
        Parameter("loss_at_rim", "1", "relative loss of luminance at 90° from the zenith", 0.0, 0.9, 0.25, (0.1, 0.3)),
    )
    source = "L (1 - v t^k), k = 2, 3 or 4, t the zenith angle over 90°; Goldman and Chen 2005; Inanici 2006"
    tie_breaker = "an integrating sphere, or a lamp photographed at many angles"
    wide = True

    def branches(self, scene: Scene) -> tuple[Branch, ...]:
        """An early or a late fall-off."""
        return (Branch("square law", 2.0), Branch("cube law", 3.0), Branch("fourth-power law", 4.0))

    def respond(self, scene: Scene, values: Floats, p: Floats, branch: Branch) -> Floats:
        """Darken towards the rim."""
        return seen(scene, values, 1.0 - p[0] * np.minimum(zenith_angle(scene), 1.2) ** branch.value)

    def statement(self, p: Floats, branch: Branch) -> str:
        """Say how much."""
        return f"The fisheye loses {p[0]:.0%} of the luminance at its rim ({branch.label}); this was not corrected."


class SpectralMismatch(CameraMechanism):
    """Blue sky is not what the luminance weights were made for."""

    id = "spectral-mismatch"
    leaves_out = "The camera's luminance weights were not made for blue sky."
    parameters = (Parameter("error_on_blue", "1", "relative error on the bluest sky", -0.6, 0.6, 0.12, (-0.08, 0.08)),)
    needs = "the sky's class, or directions and the sun's place"
    source = (
        "L (1 + m b), b the blueness: 0 in cloud, in clear sky linear in the reciprocal colour temperature, which goes "
        "as the log of the luminance (Chain et al. 2001, Energy and Buildings 33, 193-198; coefficients: Diakite-"
        "Kortlever and Knoop 2021, as in Radiance's perezlum_c.cal), or as the share of scattered blue; hdr.md 5"
    )
    tie_breaker = "a picture through a neutral and a blue filter, or a spectrometer at one place in the sky"
    form_error = 0.25  # neither a sky's spectra nor the camera's are known

    def branches(self, scene: Scene) -> tuple[Branch, ...]:
        """Blueness by the sky's class, by the luminance of each direction, or by the air's share in it."""
        r = scene.readings
        classes = {t.sky for t in r.case.tests}
        ways = []
        if len(classes) > 1 and None not in classes:
            ways.append(Branch("by sky class", "class"))
        placed = ~np.isnan(r.gamma_deg[scene.is_sky])
        if np.all(placed) and not np.any(np.isnan(r.sun_altitude_at_deg[scene.is_sky])):
            ways.append(Branch("by the luminance of each direction", "luminance"))
            if np.max(np.bincount(r.test[scene.is_sky])) >= 6:
                ways.append(Branch("by the share of scattered blue in each direction", "share"))
        return tuple(ways)

    def why_not(self, scene: Scene) -> str:
        """Something must tell blue from grey."""
        return super().why_not(scene) or (
            "" if self.branches(scene) else "nothing in the case tells blue sky from grey"
        )

    def respond(self, scene: Scene, values: Floats, p: Floats, branch: Branch) -> Floats:
        """Weight by the blueness."""
        return seen(scene, values, 1.0 + p[0] * _blueness(scene, branch.value))

    def statement(self, p: Floats, branch: Branch) -> str:
        """Say how much."""
        return (
            f"The camera is wrong by {p[0]:+.1%} on the bluest sky ({branch.label}): its luminance "
            "weights do not fit blue light."
        )


def _blueness(scene: Scene, way: str) -> Floats:
    clear = _clearness(scene)
    if way == "class":
        return clear
    return clear * (_blue_by_luminance(scene) if way == "luminance" else scene.remember(_blue_share))


def _blue_by_luminance(scene: Scene) -> Floats:
    """Blueness of clear sky by its luminance [cd/m²]: 0 as white as cloud (6191 K), 1 where it is 16,000 K; (N,).

    Reciprocal colour temperature in MK^-1; below 500 cd/m² no sky was measured.
    """
    luminance = np.maximum(scene.readings.simulated, 500.0)
    reciprocal = -180.956 + 78.648 * np.log10(luminance)
    return np.asarray(np.clip((WHITE - reciprocal) / (WHITE - BLUEST), 0.0, 1.2))


def _clearness(scene: Scene) -> Floats:
    """How much of each row's sky is open: by class, tempered by Perez' clearness where the illuminances are known."""
    r = scene.readings
    of_class = {"clear": 1.0, "partly-cloudy": 0.5, "overcast": 0.0, None: 0.5}
    by_class = np.array([of_class[t.sky] for t in r.case.tests])[r.test]
    height = np.sin(np.radians(np.maximum(r.altitude_deg, 5.0)))
    clearness = 1.0 + np.maximum(r.global_lx - r.diffuse_lx, 0.0) / height / np.maximum(r.diffuse_lx, 1.0)
    open_share = np.clip(np.log(clearness) / np.log(6.2), 0.0, 1.0)[r.test]
    return np.asarray(np.where(np.isfinite(open_share), np.sqrt(by_class * open_share), by_class))


def _blue_share(scene: Scene) -> Floats:
    """Share of scattered blue light in each row's luminance, over that in the bluest; (N,).

    Air scatters as 1 + cos² of the angle from the sun; what a direction holds beyond that is haze or cloud, and white.
    The air's own luminance is taken from the darkest tenth of the test's directions.
    """
    r = scene.readings
    sun = directions.sky_vector(r.sun_altitude_at_deg, r.sun_azimuth_at_deg)
    air = 1.0 + np.cos(np.radians(directions.angle_between(towards(scene.readings), sun))) ** 2
    ratio = air / np.maximum(r.simulated, 1e-9)
    share = np.ones(len(r))
    for k in np.unique(r.test[scene.is_sky]):
        rows = (r.test == k) & scene.is_sky
        share[rows] = np.minimum(ratio[rows] / np.quantile(ratio[rows], 0.9), 1.2)
    return share


class ExposureError(CameraMechanism):
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

    def why_not(self, scene: Scene) -> str:
        """Luminances, of which some may be a camera's: beside illuminances it must be named."""
        if scene.on_the_roof and not np.any(scene.is_camera):
            return "there is no camera among the channels"
        return super().why_not(scene)

    def statement(self, p: Floats, branch: Branch) -> str:
        """Say how large."""
        return (
            f"The camera's error jumps by {p[0]:.1%} rms from one stretch of the luminance scale "
            "to the next: shutter times are not nominal."
        )


class ProjectionError(LooksElsewhere):
    """The lens maps angles otherwise than assumed."""

    id = "projection-error"
    leaves_out = "The lens is not the projection that was assumed: pixels look elsewhere than thought."
    parameters = (
        Parameter("shift_deg", "deg", "largest error of the direction, outwards", -12.0, 12.0, 2.0, (-1.0, 1.0)),
    )
    source = (
        "true zenith angle = assumed + s sin(2 · zenith angle), or + s t, or + s t^3; equisolid taken for equidistant: "
        "3.8° (hdr.md section 5); Kannala and Brandt 2006, IEEE TPAMI 28 (odd powers)"
    )
    tie_breaker = "a picture of marks at known angles, or of the sun over a day"

    def branches(self, scene: Scene) -> tuple[Branch, ...]:
        """An error that is largest half way to the rim, or one that grows to the rim, evenly or mostly there.

        (Another author's camera had the cube: of what the even growth left there, 85 nats were taken for glare.)
        """
        return (Branch("", "half way"), Branch("growing to the rim", "rim"), Branch("at the rim", "cube"))

    def true_directions(self, scene: Scene, p: Floats, branch: Branch) -> Floats:
        """Shifted outwards from the zenith."""
        v = towards(scene.readings)
        t = np.minimum(zenith_angle(scene), 1.0)
        shift = p[0] * _outwards(t, branch)
        outward = np.stack([v[:, 0], v[:, 1], 0.0 * t], axis=1)
        outward = outward - np.sum(outward * v, axis=1, keepdims=True) * v
        size = np.maximum(np.linalg.norm(outward, axis=1, keepdims=True), 1e-6)
        moved = v + np.radians(shift)[:, None] * outward / size
        return np.asarray(moved / np.linalg.norm(moved, axis=1, keepdims=True))

    def statement(self, p: Floats, branch: Branch) -> str:
        """Say how far."""
        return (
            f"The lens maps directions up to {abs(p[0]):.1f}° "
            f"{'outwards' if p[0] > 0 else 'inwards'} of the assumed projection."
        )

    def report(self, p: Floats, sd: Floats, term: Term) -> Reported:
        """With the shift 60° from the zenith, which tells forms alike."""
        share = float(_outwards(np.array(60.0 / 90.0), term.branch))
        at_60 = told(float(p[0]) * share, float(sd[0]) * share, "deg")
        return super().report(p, sd, term) | {"shift_at_60_deg": at_60}


def _outwards(t: Floats, branch: Branch) -> Floats:
    """How far from the zenith, over the largest shift, directions are shifted that are ``t`` right angles from it."""
    made: Floats = {"half way": np.sin(np.pi * t), "rim": t, "cube": t**3}[branch.value]
    return made


def why_no_shape(scene: Scene) -> str:
    """Why the sky between the directions is not known; empty where it is."""
    r = scene.readings
    if np.any(np.isnan(r.sun_altitude_at_deg[scene.is_sky]) | np.isnan(r.sun_azimuth_at_deg[scene.is_sky])):
        return "neither sun angles nor site and times are given"
    return ""
