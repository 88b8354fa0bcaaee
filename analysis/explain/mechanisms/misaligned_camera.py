"""A camera that stands turned or tilted on its plate: laws outside the catalogue that look much like a clock's offset.

A clock moves the sun along its arc, up in the morning and down in the afternoon, by more azimuth at noon than in the
evening; a turned camera turns every picture by the same angle.
"""

from analysis.cases.model import Floats
from analysis.explain.mechanisms.base import Branch
from analysis.explain.mechanisms.camera import LooksElsewhere
from analysis.explain.parameter import Parameter
from analysis.explain.scene import Scene
from analysis.explain.sky_shape import tilted, towards, turned


class TurnedCamera(LooksElsewhere):
    """The picture's north is not north."""

    id = "turned camera"
    leaves_out = "The camera stands turned: its north is not north."
    parameters = (Parameter("turn_deg", "deg", "clockwise, of its north", -60.0, 60.0, 4.0, (-8.0, -2.0, 2.0, 8.0)),)
    source = "L(azimuth + d, zenith angle); the sky between the directions as in sky_shape"
    tie_breaker = "the bearing of a mark on the horizon in one picture"

    def true_directions(self, scene: Scene, p: Floats, branch: Branch) -> Floats:
        """Turned about the zenith."""
        return turned(towards(scene.readings), p[0])


class TiltedCamera(LooksElsewhere):
    """The picture's zenith is not the zenith."""

    id = "tilted camera"
    leaves_out = "The camera is tilted: what it takes for the zenith is not the zenith."
    parameters = (
        Parameter("tilt_north_deg", "deg", "of the camera's axis towards north", -8.0, 8.0, 1.0, (-1.0, 0.0, 1.0)),
        Parameter("tilt_east_deg", "deg", "of the camera's axis towards east", -8.0, 8.0, 1.0, (-1.0, 0.0, 1.0)),
    )
    source = "L(direction turned about a horizontal axis); the sky between the directions as in sky_shape"
    tie_breaker = "a spirit level on the lens, or the sun's place in pictures of one day"

    def true_directions(self, scene: Scene, p: Floats, branch: Branch) -> Floats:
        """Tilted with the camera's axis."""
        return tilted(towards(scene.readings), p[0], p[1])
