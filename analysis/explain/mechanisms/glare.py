"""Light that a camera's lens scatters: a veil over the picture, or light that is spread about in it."""

import numpy as np

from analysis.cases.model import Floats
from analysis.explain.mechanisms.base import Branch
from analysis.explain.mechanisms.camera import CameraMechanism, cameras_side, why_no_shape, zenith_angle
from analysis.explain.parameter import Parameter
from analysis.explain.scene import Scene
from analysis.explain.sky_shape import towards
from analysis.explain.sun_light import CORE_DEG, normal_beam, sun_about, sun_evenly
from labdaq import directions

_EVEN = Parameter("veil", "1", "share of the light that is spread evenly over the sky", 0.0, 0.6, 0.06, (0.01, 0.05))
_SPREAD = Parameter("spread", "1", "share of the light that is spread about", 0.0, 0.6, 0.12, (0.02, 0.1, 0.25))
_SUN = Parameter("spread", "1", "share of the light that is spread about", 0.0, 0.6, 0.04, (0.003, 0.02, 0.08))
_EVENLY = Parameter("evenly", "1", "share of it that goes everywhere alike", 0.0, 1.0, 0.3, (0.2, 0.8), centre=0.5)
_DIRECTIONS = 6
"""Fewer directions do not show a sky."""
_OVERHEAD = directions.evenly(3000)[:1500]
"""Directions over the whole sky."""


class VeilingGlare(CameraMechanism):
    """Light scattered in the lens lays a veil over the picture."""

    id = "veiling-glare"
    leaves_out = "Light scattered in the camera's lens lays a veil over the whole picture."
    parameters = (Parameter("veil", "1", "veil over the mean luminance of the sky", 0.0, 0.6, 0.06, (0.01, 0.05)),)
    source = (
        "L + v <L>, <L> = diffuse illuminance / pi where it is known; or (1-v) L + v (mean over the sky, even or "
        "weighted by 1/angle² after Stiles and Holladay), where no disc shades the camera with the sun's light spread "
        "likewise; Talvala et al. 2007; McCann and Rizzi 2007"
    )
    tie_breaker = "a black target in the picture"
    form_error = 0.25  # how far light is spread is told by no two lenses alike

    def branches(self, scene: Scene) -> tuple[Branch, ...]:
        """In the camera, or in the luminance meters themselves."""
        ways = [Branch(label, (which, "camera")) for label, which in _lights(scene).items()]
        if np.any(scene.is_sky & ~scene.is_camera):
            ways += [Branch(f"{w.label}, in the meter".removeprefix(", "), (w.value[0], "meter")) for w in ways]
        return tuple(ways)

    def parameters_in(self, scene: Scene, branch: Branch) -> tuple[Parameter, ...]:
        """Light that only goes elsewhere shows less; the sun's own is much."""
        alone = {"veil": self.parameters, "even": (_EVEN,), "spread": (_SPREAD,)}
        return alone.get(branch.value[0], (_SUN, _EVENLY))

    def respond(self, scene: Scene, values: Floats, p: Floats, branch: Branch) -> Floats:
        """Add the veil, or spread the light (or take it back)."""
        which, instrument = branch.value
        side = scene.remember(cameras_side) if instrument == "camera" else scene.is_sky & ~scene.is_camera
        lights = [scene.remember(light) for light in _LIGHT[which]]
        more = p[1] * lights[0] + (1.0 - p[1]) * lights[1] if len(lights) == 2 else lights[0]
        return np.asarray(values + side * p[0] * more)

    def statement(self, p: Floats, branch: Branch) -> str:
        """Say how strong."""
        which, instrument = branch.value
        scattered = "scattered in the camera's lens" if instrument == "camera" else "scattered in the luminance meter"
        told = {
            "veil": f"A veil of {p[0]:.1%} of the sky's mean luminance lies over the picture",
            "even": f"{p[0]:.1%} of the light is spread evenly over the sky",
            "spread": f"{p[0]:.1%} of the light is spread about",
            "sun": f"{p[0]:.1%} of the sun's light is spread over the sky",
            "sun and sky": f"{p[0]:.1%} of all light, the sun's too, is spread over the sky",
        }
        return f"{told[which]} ({scattered})."


def _lights(scene: Scene) -> dict[str, str]:
    """Which lights may be spread, by the way's label: where few directions were read a veil, and the sun's light.

    Else those of the sky, evenly or about, and of sun and sky together.
    """
    few = np.max(np.bincount(scene.readings.test[scene.is_sky])) < _DIRECTIONS
    sun = bool(np.any(scene.remember(normal_beam) > 0.0))
    if few or np.ptp(zenith_angle(scene)) < 0.2:
        return {"": "veil", "the sun's, spread": "sun"} if sun else {"": "veil"}
    if why_no_shape(scene):
        return {"": "veil", "spread about": "spread"}
    of_sky = {"spread evenly": "even", "spread about": "spread"}
    return {**of_sky, "spread, the sun's too": "sun and sky"} if sun else of_sky


def _spread(scene: Scene) -> Floats:
    """Mean predicted luminance of each row's test, weighted by 1/(angle² + core²), less its own [cd/m²]; (N,)."""
    r = scene.readings
    v = towards(r)
    made = np.zeros(len(r))
    for k in np.unique(r.test[scene.is_sky]):
        rows = np.flatnonzero((r.test == k) & scene.is_sky)
        angle = np.degrees(np.arccos(np.clip(v[rows] @ v[rows].T, -1.0, 1.0)))
        weight = 1.0 / (angle**2 + CORE_DEG**2)
        made[rows] = weight @ r.simulated[rows] / weight.sum(axis=1) - r.simulated[rows]
    return made


def _even(scene: Scene) -> Floats:
    """Mean luminance of each row's whole sky, bright places between the directions included, less its own [cd/m²]."""
    r = scene.readings
    made = np.zeros(len(r))
    for k in np.unique(r.test[scene.is_sky]):
        rows = (r.test == k) & scene.is_sky
        made[rows] = scene.sky_shape.luminance(int(k), _OVERHEAD).mean() - r.simulated[rows]
    return made


def _mean_luminance(scene: Scene) -> Floats:
    """Mean luminance of each row's sky [cd/m²], from the diffuse illuminance, else from the rows of the test."""
    r = scene.readings
    count = len(r.case.tests)
    rows = np.where(scene.is_sky, r.simulated, 0.0)
    n = np.maximum(np.bincount(r.test, weights=scene.is_sky.astype(float), minlength=count), 1.0)
    mean = np.bincount(r.test, weights=rows, minlength=count) / n
    return np.asarray(np.where(np.isfinite(r.diffuse_lx), r.diffuse_lx / np.pi, mean)[r.test])


def _sky_and_sun_evenly(scene: Scene) -> Floats:
    return scene.remember(_even) + scene.remember(sun_evenly)


def _sky_and_sun_about(scene: Scene) -> Floats:
    return scene.remember(_spread) + scene.remember(sun_about)


_LIGHT = {
    "veil": (_mean_luminance,),
    "even": (_even,),
    "spread": (_spread,),
    "sun": (sun_evenly, sun_about),
    "sun and sky": (_sky_and_sun_evenly, _sky_and_sun_about),
}
"""What is added to each row where all of the light is spread: as far as it goes everywhere, and about its source."""
