"""Light that gets past the lens unbent: through a crack, a gap along the frame, a patch without prisms.

A law outside the catalogue. It goes on where the sun's light travels, which a lens that bends light leaves dark; drops
of water or scratches throw a ring about that direction instead.
"""

from typing import Final

import numpy as np

from analysis.cases.model import Floats
from analysis.explain.fields import solid_angle
from analysis.explain.mechanisms.base import Branch, Mechanism, Stage
from analysis.explain.parameter import Parameter
from analysis.explain.scene import Scene
from labdaq import directions

_NARROWEST_DEG, _WIDEST_DEG = 1.5, 15.0
_WIDEST_RING_DEG: Final = 60.0


class PastTheLens(Mechanism):
    """A share of the sun's light goes on in the direction of its travel, or in a ring about that."""

    id = "light past the lens"
    stage = Stage.OPTICS
    leaves_out = "Some of the sun's light gets past the lens unbent: a crack, a gap, a patch without prisms."
    parameters = (
        Parameter("share", "1", "share of the sun's light in the room", 0.0, 0.5, 0.03, (0.003, 0.02)),
        Parameter("width_deg", "deg", "rms width", _NARROWEST_DEG, _WIDEST_DEG, 3.0, (2.5, 6.0), centre=4.0),
    )
    radius = Parameter(
        "radius_deg", "deg", "radius of the ring", 5.0, _WIDEST_RING_DEG, 15.0, (12.0, 22.0, 30.0, 42.0), centre=22.0
    )
    needs = "the sun part apart, and where the sun stood in every test"
    source = "I + s Phi_sun L(angle from the sun's travel), L a Gaussian lobe or ring that holds all of the share"
    tie_breaker = "look at the sun through the skylight from where the arm reads too much"

    def why_not(self, scene: Scene) -> str:
        """The sun's light must be known, and its travel; through a clear lens all of it goes on unbent."""
        if any(system.lens == "clear" for system in scene.readings.case.setup.system):
            return "a clear lens lets all light go on"
        return "" if scene.knows_image else "the sun's part, or where the sun stood, is not given for every test"

    def branches(self, scene: Scene) -> tuple[Branch, ...]:
        """Straight on, or in a ring."""
        return Branch("straight on"), Branch("in a ring", "ring")

    def parameters_in(self, scene: Scene, branch: Branch) -> tuple[Parameter, ...]:
        """A ring has a radius."""
        return (*self.parameters, self.radius) if branch.value else self.parameters

    def respond(self, scene: Scene, values: Floats, p: Floats, branch: Branch) -> Floats:
        """Add the light to the arm's rows."""
        away, flux = scene.remember(_from_the_suns_travel), scene.remember(_suns_flux)
        radius = float(p[2]) if branch.value else 0.0
        added = p[0] * flux[scene.readings.test] * lobe(away, float(p[1]), radius)
        return np.asarray(values + np.where(scene.is_gonio, added, 0.0))

    def statement(self, p: Floats, branch: Branch) -> str:
        """Say how much, and how widely."""
        where = f"in a ring of {p[2]:.0f}° about the sun's travel" if branch.value else "unbent"
        return f"Light that is {p[0]:.2%} of the sun's in the room gets past the lens, {where} (± {p[1]:.0f}°)."


def lobe(away_deg: Floats, width_deg: float, radius_deg: float) -> Floats:
    """Share of the light per solid angle [1/sr] at angles (N,) from the middle of a Gaussian ring; shape (N,)."""
    at = np.radians(np.linspace(0.0, 180.0, 1801))
    profile = _ring(at, np.radians(width_deg), np.radians(radius_deg))
    whole = 2.0 * np.pi * np.trapezoid(profile * np.sin(at), at)
    return _ring(np.radians(away_deg), np.radians(width_deg), np.radians(radius_deg)) / whole


def _ring(at: Floats, width: float, radius: float) -> Floats:
    return np.asarray(np.exp(-0.5 * ((at - radius) / width) ** 2))


def _from_the_suns_travel(scene: Scene) -> Floats:
    """Angle [deg] of each reading's direction from that of the sun's travel; shape (N,)."""
    r = scene.readings
    look = directions.vector(np.nan_to_num(r.gamma_deg), np.nan_to_num(r.c_deg))
    return directions.angle_between(look, -scene.sun_vectors[r.test])


def _suns_flux(scene: Scene) -> Floats:
    """Luminous flux [lm] of the sun part into the room in each test; shape (T,)."""
    return np.asarray(np.sum(scene.fields.sun * solid_angle(), axis=(1, 2)))
