"""The dark room below: light that reaches the sensors without coming straight from the aperture."""

from functools import lru_cache

import numpy as np

from analysis.cases.model import USUAL_ARM_M, Floats
from analysis.explain.mechanisms.base import Branch, Mechanism, Stage
from analysis.explain.mechanisms.retraced import Retraced
from analysis.explain.parameter import Parameter
from analysis.explain.roomlight import DarkRoom, RoomLight, room_light
from analysis.explain.scene import Light, Scene

_SUPPOSED = "its size is supposed, as the report's beside the arm"
_OF_UNKNOWN_SIZE = 0.5
"""Relative uncertainty of a reflectance in a room whose size is only supposed."""


@lru_cache(maxsize=8)
def _light_of(room: DarkRoom) -> RoomLight:
    return room_light(room.size_m, room.distance_m, room.half_angle_deg)


class RoomInterreflection(Retraced):
    """Floor and walls send back a little of what falls on them."""

    id = "room-interreflection"
    stage = Stage.ROOM
    leaves_out = "Light bounced off the room's walls and floor reaches the sensors; the simulation had a black room."
    parameters = (
        Parameter("wall_reflectance", "1", "diffuse reflectance of the walls", 0.0, 0.6, 0.06, (0.04,)),
        Parameter("floor_reflectance", "1", "diffuse reflectance of the floor", 0.0, 0.6, 0.06, (0.02,)),
    )
    needs = "room, goniometer (where they are not told, the report's proportions are supposed)"
    source = "all bounces between matt surfaces (radiosity; Baum et al. 1989), ceiling as walls; report ch. 9, App. B"
    tie_breaker = "a scan with the skylight covered (the room's light vanishes with it), or a white card on the floor"

    form_error = Mechanism.form_error

    def why_not(self, scene: Scene) -> str:
        """The bounce needs sensors inside the room, or a variant."""
        return super().why_not(scene) if self.branches(scene) else "the arm's sensors are not inside the room"

    def branches(self, scene: Scene) -> tuple[Branch, ...]:
        """In closed form, and as the case's own variants have it.

        Where neither a room is told nor a variant brought, one is supposed: what it does would else be told as a leak.
        (A room of 4.6 % gained 85 nats as such.)
        """
        room, brought = DarkRoom.of(scene.readings.case.setup), super().branches(scene)
        closed = (Branch(_SUPPOSED if room.supposed else ""),) if room and not (room.supposed and brought) else ()
        return (*closed, *brought)

    def size_error_in(self, scene: Scene, branch: Branch) -> float:
        """A reflectance is as uncertain as the square of the room's size."""
        return _OF_UNKNOWN_SIZE if branch.label == _SUPPOSED else super().size_error_in(scene, branch)

    def parameters_in(self, scene: Scene, branch: Branch) -> tuple[Parameter, ...]:
        """The closed form has both reflectances."""
        return super().parameters_in(scene, branch) if branch.value else self.parameters

    def illuminate(self, scene: Scene, light: Light, p: Floats, branch: Branch) -> None:
        """Add the room's light, lit by the fields as changed so far."""
        if branch.value:
            super().illuminate(scene, light, p, branch)
            return
        room = DarkRoom.of(scene.readings.case.setup)
        assert room is not None
        sun, sky = light.factor_of_tests(scene.readings.test, len(light.sun))
        field = sun[:, None, None] * light.sun + sky[:, None, None] * light.sky
        light.added = light.added + _light_of(room).added(field, float(p[0]), float(p[1]))

    def statement(self, p: Floats, branch: Branch) -> str:
        """Say which reflectances."""
        if branch.value:
            return super().statement(p, branch)
        return (
            f"Light bounced off the room's walls (reflectance {p[0]:.3f}) and floor ({p[1]:.3f}) reaches the sensors; "
            f"the simulation had a black room{f' ({branch.label})' if branch.label else ''}."
        )


_FROM_ONE_SIDE = ", from one side"
_OF_UNKNOWN_DISTANCE = 0.5
"""Relative uncertainty of an illuminance whose sensors' distance is only supposed: arms differ by a quarter."""


class StrayLight(Mechanism):
    """Light in the room that is not the skylight's: constant, or a leak that follows the daylight outside."""

    id = "stray-light"
    stage = Stage.ROOM
    leaves_out = "A light that is not the skylight's falls on the sensors."
    parameters = (
        Parameter(
            "illuminance_lx",
            "lx",
            "stray illuminance at the sensors (leak: at the mean daylight)",
            0.0,
            1e4,
            15.0,
            (2.0, 10.0),
        ),
    )
    side = Parameter(
        "from_c_deg",
        "deg",
        "C where the light is strongest",
        -180.0,
        540.0,
        105.0,
        (0.0, 90.0, 180.0, 270.0),
        centre=180.0,
        direction=True,
    )
    share = Parameter(
        "one_sided", "1", "share of the light that comes from that side", 0.0, 1.0, 0.5, (0.6,), centre=0.5
    )
    needs = "goniometer (its distance; else 2.6 m are taken, and the illuminance is as uncertain)"
    source = (
        "I_add = d² E_stray, constant or proportional to the global illuminance; a share s of it from one side, a lamp "
        "or a door, to first order E_stray (1 + s sin(gamma) cos(C - C_side))"
    )
    tie_breaker = "a scan with the skylight covered"

    def size_error_in(self, scene: Scene, branch: Branch) -> float:
        """The distance turns lux into candela, by its square."""
        return super().size_error_in(scene, branch) if scene.distance_m else _OF_UNKNOWN_DISTANCE

    def branches(self, scene: Scene) -> tuple[Branch, ...]:
        """Constant, or (with global illuminances) following the daylight; evenly, or from one side."""
        outside = scene.readings.global_lx
        known = bool(np.all(np.isfinite(outside)))
        facts = {"mean_global_lx": float(outside.mean())} if known else {}
        ways: dict[str, dict[str, float]] = {"constant": {}} | ({"following the daylight": facts} if known else {})
        return tuple(
            Branch(label + where, where, facts) for label, facts in ways.items() for where in ("", _FROM_ONE_SIDE)
        )

    def parameters_in(self, scene: Scene, branch: Branch) -> tuple[Parameter, ...]:
        """A light on one side has a direction."""
        return (*self.parameters, self.side, self.share) if branch.value else self.parameters

    def respond(self, scene: Scene, values: Floats, p: Floats, branch: Branch) -> Floats:
        """Add the stray light to the goniometer's rows."""
        added = np.full(len(values), (scene.distance_m or USUAL_ARM_M) ** 2 * p[0])
        if branch.facts:
            outside = scene.readings.global_lx / branch.facts["mean_global_lx"]
            added = added * outside[scene.readings.test]
        if branch.value:
            gamma, c = np.radians(scene.readings.gamma_deg), np.radians(scene.readings.c_deg - p[1])
            added = added * (1.0 + p[2] * np.sin(gamma) * np.cos(c))
        return values + np.where(scene.is_gonio, added, 0.0)

    def statement(self, p: Floats, branch: Branch) -> str:
        """Say how much."""
        kind = "a leak, proportional to the daylight outside, of on average" if branch.facts else "a constant"
        side = f", strongest at C {p[1] % 360.0:.0f}°" if branch.value else ""
        return f"A light that is not the skylight's reaches the sensors: {kind} {p[0]:.2f} lx{side}."
