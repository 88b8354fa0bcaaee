"""Something on the roof stands in the beam of a meter for a while each day, or sends more of it there.

A law outside the catalogue: a mast or a rail shades the head while the sun passes behind it, a pane opposite doubles
the sun. Two names of the catalogue can imitate it together, none can alone.
"""

import numpy as np

from analysis.cases.model import Floats
from analysis.explain.mechanisms.base import Branch, Mechanism, Stage
from analysis.explain.mechanisms.roof_meters import of_channel, roof_channels, why_no_sun
from analysis.explain.parameter import Parameter
from analysis.explain.scene import Light, Scene

_PLACES = 8


class Shaded(Mechanism):
    """The beam of one meter is weaker or stronger while the sun is near some azimuth."""

    id = "shaded beam"
    stage = Stage.ROOF_METERS
    leaves_out = "Something near the meter takes or adds sunlight while the sun stands in some direction."
    parameters = (Parameter("change", "1", "relative change of the beam at most", -1.0, 2.0, 0.2, (-0.2,)),)
    width = Parameter("width_deg", "deg", "how far to both sides of it (one sigma)", 1.5, 25.0, 5.0, (4.0, 10.0), 6.0)
    needs = "sun and sky parts apart; sun angles, or site and times"
    source = "beam (1 + s exp(-(azimuth - a)²/2w²))"
    tie_breaker = "look along the sun's way from the meter's head"
    kinds = ("roof",)

    def why_not(self, scene: Scene) -> str:
        """The sun's azimuth must be known, and a meter on the roof."""
        return why_no_sun(scene) if scene.on_the_roof else "no meter is read on the roof alone"

    def branches(self, scene: Scene) -> tuple[Branch, ...]:
        """Each meter."""
        return roof_channels(scene)

    def parameters_in(self, scene: Scene, branch: Branch) -> tuple[Parameter, ...]:
        """Where the sun goes past."""
        azimuth = scene.readings.sun_azimuth_at_deg[of_channel(scene, branch.value)]
        low, high = float(azimuth.min()), float(azimuth.max())
        at = np.quantile(azimuth, (np.arange(_PLACES) + 0.5) / _PLACES)
        middle, half = (low + high) / 2.0, max((high - low) / 2.0, 1.0)
        place = Parameter("azimuth_deg", "deg", "where the sun stands then", low, high, half, tuple(at), middle)
        return (*self.parameters, place, self.width)

    def illuminate(self, scene: Scene, light: Light, p: Floats, branch: Branch) -> None:
        """Change the meter's beam."""
        away = (scene.readings.sun_azimuth_at_deg - p[1] + 180.0) % 360.0 - 180.0
        beam = np.maximum(1.0 + p[0] * np.exp(-0.5 * (away / max(float(p[2]), 0.1)) ** 2), 0.0)
        light.sun_factor = np.where(of_channel(scene, branch.value), light.sun_factor * beam, light.sun_factor)
