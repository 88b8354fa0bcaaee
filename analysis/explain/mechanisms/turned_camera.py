"""A camera that stands turned on its plate: a law outside the catalogue that looks much like a clock's offset.

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
        v, turn = towards(scene.readings), np.radians(p[0])
        east = v[:, 0] * np.cos(turn) + v[:, 1] * np.sin(turn)
        north = v[:, 1] * np.cos(turn) - v[:, 0] * np.sin(turn)
        turned = np.stack([east, north, v[:, 2]], axis=1)
        return seen(scene, values, np.exp(scene.sky_shape.beside(turned)))
