"""The well: what its walls reflect, how they scatter, and how long a simulation followed the light between them."""

from dataclasses import replace
from typing import Final

import numpy as np

from analysis.cases.model import Floats
from analysis.explain.fields import solid_angle
from analysis.explain.mechanisms.base import Branch, Stage
from analysis.explain.mechanisms.retraced import Retraced
from analysis.explain.mirror_wells import cut_short, duller_walls, scattering_walls
from analysis.explain.parameter import Parameter
from analysis.explain.retrace import Path
from analysis.explain.scene import Scene

LIKE_LIMIT: Final = "like_max_bounces"
"""The fact of a way that tells by which limit a simulation would lack as much."""
_MOST: Final = 50.0
"""Beyond this the sun's light was none there, and a ratio to it tells nothing."""


class WallReflectance(Retraced):
    """The well's walls reflect more or less than assumed."""

    id = "wall-reflectance"
    stage = Stage.WELL
    leaves_out = "The well's walls reflect more or less than was simulated; it counts once per bounce."
    local_error = 0.3  # where light of many bounces leaves, the lens decides
    parameters = (Parameter("wall_reflectance", "1", "reflectance of the well", 0.3, 1.0, 0.03, (0.9,), centre=0.95),)
    needs = "a variant, or the systems' description"
    source = "sum over bounces R^n S_n; Swift and Smith 1995, Sol. Energy Mater. Sol. Cells 36"
    tie_breaker = "a reflectance measurement of the wall at grazing incidence, or a test with the sun low in the tube"

    def branches(self, scene: Scene) -> tuple[Branch, ...]:
        """As simulated again, and by the way that light leaves the well."""
        return (*super().branches(scene), *(Branch(path.label, path) for path in duller_walls(scene)))


class BounceTruncation(Retraced):
    """The ray tracer stopped after too few bounces."""

    id = "bounce-truncation"
    stage = Stage.WELL
    leaves_out = "The simulation stopped its rays after too few bounces; light that bounces often is missing."
    local_error = 0.3  # where light of many bounces leaves, the lens decides
    parameters = (
        Parameter(
            "max_bounces", "1", "wall bounces after which the simulation stopped", 1.0, 40.0, 12.0, (4.0,), centre=40.0
        ),
    )
    needs = "a variant, or the systems' description"
    source = "re-simulation without a limit; report chapters 7 to 9 (12, 20 and 50 bounces)"
    tie_breaker = "run the simulation again with a higher limit"

    def why_not(self, scene: Scene) -> str:
        """A limit that makes no difference cuts nothing."""
        if scene.retraced is not None and self.id in scene.retraced.has:
            return "no light is missing: another limit of bounces changes nothing, by the case's own variants"
        return super().why_not(scene)

    def branches(self, scene: Scene) -> tuple[Branch, ...]:
        """As simulated again, and by the way that light leaves the well.

        A variant that tells no limit of the prediction's has that with it by which as much would be missing, so that
        what it shows can be simulated for another case, which brings no variant.
        """
        ways = (*super().branches(scene), *(Branch(path.label, path) for path in cut_short(scene)))
        own = [b.value for b in ways if b.value.added and not b.value.of_case]
        if not own or scene.readings.case.setup.simulation.max_bounces:
            return ways
        return tuple(
            replace(b, facts={LIKE_LIMIT: _like_limit(scene, b.value, own[0])})
            if b.value.of_case and b.value.parameter.name == "weight"
            else b
            for b in ways
        )


def _like_limit(scene: Scene, variant: Path, own: Path) -> float:
    """The limit of bounces by which ours lacks as large a share of each test's flux as the variant adds."""
    fields, weight = scene.fields, solid_angle()

    def flux(light: Floats) -> Floats:
        return np.asarray(np.sum(light * weight, axis=(-2, -1)))

    there = np.maximum(flux(fields.sun + fields.sky), 1e-12)
    sun, sky = variant.change(float(variant.positions[-1]), fields)
    adds = flux(sun + sky) / there - 1.0
    lacks = flux(own.sun + own.sky) / there
    return float(own.positions[np.argmin(np.sum((lacks - adds)[:, np.abs(adds) > 1e-3] ** 2, axis=1))])


class WallScatter(Retraced):
    """The specular wall scatters a little."""

    like_a_lens = True
    local_error = 0.3  # by what lobe a wall scatters is not known

    id = "wall-scatter"
    stage = Stage.WELL
    leaves_out = "The specular wall scatters part of the light."
    parameters = (Parameter("scatter", "1", "share of each reflection that is diffuse", 0.0, 1.0, 0.15, (0.1,)),)
    needs = "a variant, or the systems' description"
    source = (
        "re-simulation; halfway to (1-f) S + f (B/D) K, light that goes on as the sky's does; report chapters 6 and 8 "
        "(foam core, tube wall)"
    )
    tie_breaker = "a scatter measurement of the wall"
    modelled_twice = True

    def branches(self, scene: Scene) -> tuple[Branch, ...]:
        """As simulated again; of diffuse shares also the mean of that and of light that goes on as the sky's does.

        And by the way that light leaves the well. Each errs in its own way, one by our lens, the other by its
        simplicity: another lens is nearer to their mean.
        """
        ways = super().branches(scene)
        traced = [b.value for b in ways if b.value.parameter.name == self.parameters[0].name and not b.value.of_case]
        halves = (_halfway_to_sky(scene, path) for path in traced) if scene.knows_split else ()
        leaving = (Branch(path.label, path) for path in scattering_walls(scene))
        return (*ways, *(Branch(path.label, path, stands_in=True) for path in halves), *leaving)


def _halfway_to_sky(scene: Scene, path: Path) -> Path:
    """The mean of a path of diffuse shares and of that share of the beam's light as the predicted sky part."""
    fields, diffuse = scene.fields, np.maximum(scene.readings.diffuse_lx, 1e-9)
    like_sky = (scene.beam_lx / diffuse)[:, None, None] * fields.sky
    over_sun = np.clip(np.divide(like_sky, fields.sun, out=np.ones_like(like_sky), where=fields.sun > 0.0), 0.0, _MOST)
    scattered = np.any(path.sun[-1] != 1.0, axis=(1, 2), keepdims=True)  # a system with such walls
    share = path.positions[:, None, None, None]
    sun = np.where(scattered, 0.5 * (path.sun + 1.0 + share * (over_sun - 1.0)), path.sun)
    sky = np.where(scattered, 0.5 * (path.sky + 1.0), path.sky)
    return replace(path, label=f"halfway to light from the sky: {path.label}", sun=sun, sky=sky)
