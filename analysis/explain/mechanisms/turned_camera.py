"""A camera that stands turned or tilted on its plate: laws outside the catalogue that look much like a clock's offset.

A clock moves the sun along its arc, up in the morning and down in the afternoon, by more azimuth at noon than in the
evening; a turned camera turns every picture by the same angle.
"""

import numpy as np

from analysis.cases.model import Floats
from analysis.explain.mechanisms.base import Branch
from analysis.explain.mechanisms.camera import CameraMechanism, seen, why_no_shape
from analysis.explain.parameter import Parameter
from analysis.explain.scene import Scene
from analysis.explain.sky_shape import towards


class TurnedCamera(CameraMechanism):
    """The picture's north is not north."""

    id = "turned camera"
    leaves_out = "The camera stands turned: its north is not north."
    parameters = (Parameter("turn_deg", "deg", "clockwise, of its north", -60.0, 60.0, 4.0, (-8.0, -2.0, 2.0, 8.0)),)
    needs = "directions and the sun's place"
    source = "L(azimuth + d, zenith angle); the sky between the directions as in sky_shape"
    tie_breaker = "the bearing of a mark on the horizon in one picture"
    wide = True
    form_error = 0.25  # between the directions of a picture the sky is only guessed

    def why_not(self, scene: Scene) -> str:
        """The sky's shape between the directions follows from the sun's place."""
        return super().why_not(scene) or why_no_shape(scene)

    def respond(self, scene: Scene, values: Floats, p: Floats, branch: Branch) -> Floats:
        """Read the sky at the turned direction."""
        return seen(scene, values, np.exp(scene.sky_shape.beside(turned(towards(scene.readings), p[0]))))


class TiltedCamera(CameraMechanism):
    """The picture's zenith is not the zenith."""

    id = "tilted camera"
    leaves_out = "The camera is tilted: what it takes for the zenith is not the zenith."
    parameters = (
        Parameter("tilt_north_deg", "deg", "of the camera's axis towards north", -8.0, 8.0, 1.0, (-1.0, 0.0, 1.0)),
        Parameter("tilt_east_deg", "deg", "of the camera's axis towards east", -8.0, 8.0, 1.0, (-1.0, 0.0, 1.0)),
    )
    needs = "directions and the sun's place"
    source = "L(direction turned about a horizontal axis); the sky between the directions as in sky_shape"
    tie_breaker = "a spirit level on the lens, or the sun's place in pictures of one day"
    wide = True
    form_error = 0.25  # between the directions of a picture the sky is only guessed

    def why_not(self, scene: Scene) -> str:
        """The sky's shape between the directions follows from the sun's place."""
        return super().why_not(scene) or why_no_shape(scene)

    def respond(self, scene: Scene, values: Floats, p: Floats, branch: Branch) -> Floats:
        """Read the sky where the camera really looks."""
        moved = tilted(towards(scene.readings), p[0], p[1])
        return seen(scene, values, np.exp(scene.sky_shape.beside(moved)))


def tilted(v: Floats, north_deg: float, east_deg: float) -> Floats:
    """Directions (N, 3) of a camera whose axis leans towards north and east by small angles [deg]."""
    lean = np.radians(np.array([east_deg, north_deg, 0.0]))
    moved = v + np.outer(v[:, 2], lean) - np.outer(v @ lean, np.array([0.0, 0.0, 1.0]))
    return np.asarray(moved / np.linalg.norm(moved, axis=1, keepdims=True))


def turned(v: Floats, degrees: float) -> Floats:
    """Directions (N, 3) of a camera whose north lies clockwise of north by an angle [deg]."""
    a = np.radians(degrees)
    east, north = v[:, 0] * np.cos(a) + v[:, 1] * np.sin(a), v[:, 1] * np.cos(a) - v[:, 0] * np.sin(a)
    return np.stack([east, north, v[:, 2]], axis=1)
