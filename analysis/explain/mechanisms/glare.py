"""Light that a camera's lens scatters: a veil over the picture, or light that is spread about in it."""

import numpy as np
from numpy.typing import NDArray

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
        ways = _ways(scene)
        if not np.any(_is_meter(scene)):
            return ways
        own = (Branch(f"{way.label}{', ' if way.label else ''}in the meter", ("own", *way.value)) for way in ways)
        return (*ways, *own)

    def parameters_in(self, scene: Scene, branch: Branch) -> tuple[Parameter, ...]:
        """Light that only goes elsewhere shows less; the sun's own is much."""
        alone = {"veil": self.parameters, "even": (_EVEN,), "spread": (_SPREAD,)}
        return alone.get(branch.value[-1], (_SUN, _EVENLY))

    def respond(self, scene: Scene, values: Floats, p: Floats, branch: Branch) -> Floats:
        """Add the veil, or spread the light (or take it back)."""
        side = _is_meter(scene) if branch.value[0] == "own" else scene.remember(cameras_side)
        lights = [scene.remember(light) for light in _LIGHT[branch.value[-1]]]
        more = p[1] * lights[0] + (1.0 - p[1]) * lights[1] if len(lights) == 2 else lights[0]
        return np.asarray(values + side * p[0] * more)

    def statement(self, p: Floats, branch: Branch) -> str:
        """Say how strong."""
        if branch.value[-1] != "veil":
            return f"{p[0]:.1%} of the light is {branch.label} over the picture (scattered in the lens)."
        return f"A veil of {p[0]:.1%} of the sky's mean luminance lies over the picture (light scattered in the lens)."


def _is_meter(scene: Scene) -> NDArray[np.bool_]:
    """Rows of luminance meters (N,)."""
    r = scene.readings
    return np.asarray(scene.is_sky & np.array([c.kind != "camera" for c in r.case.channels])[r.channel])


def _ways(scene: Scene) -> tuple[Branch, ...]:
    """A veil; where many directions were read, light spread evenly over the sky, or about; the sun's own too."""
    veil = Branch("", ("veil",))
    few = np.max(np.bincount(scene.readings.test[scene.is_sky])) < _DIRECTIONS
    sun = bool(np.any(scene.remember(normal_beam) > 0.0))
    if few or np.ptp(zenith_angle(scene)) < 0.2:
        return (veil, Branch("the sun's, spread", ("sun",))) if sun else (veil,)
    about = Branch("spread about", ("spread",))
    if why_no_shape(scene):
        return veil, about
    if not sun:
        return Branch("spread evenly", ("even",)), about
    return (
        Branch("spread evenly", ("even",)),
        about,
        Branch("spread, the sun's too", ("sun and sky",)),
    )


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
