"""A goniophotometer's station during a campaign: what it would truly read, and what a simulation predicts."""

import math
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from labdaq.directions import vector
from simulators.hidden.arm import ArmFaults
from simulators.hidden.bench import Bench, Fields, Lit, Pattern, RoomFaults, Scan, fields, readings
from simulators.hidden.defects import answers, sky_change, sun_change, with_defect
from simulators.hidden.effects import Hidden, OpticsFaults
from simulators.hidden.light import Light, PerezLight, Sun
from simulators.hidden.light_faults import FaultedLight, SourceFaults
from simulators.hidden.maps import Field
from simulators.hidden.responses import Response
from simulators.hidden.ripple import Ripple
from simulators.hidden.room import Room
from simulators.hidden.tracer import Answer
from simulators.trial.campaign import Campaign, Test
from simulators.trial.dials import Dial
from simulators.trial.shelf import Shelf
from simulators.trial.stock import DESIGNS, Wanted

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Flaws:
    """What the simulation itself gets wrong; all neutral for a faithful one.

    Attributes
    ----------
    far
        It predicts the far field.
    max_bounces
        It stops after so many reflections on the wall; 0 never.
    isotropic
        Its lenses know no directions in their plane.
    turn_deg
        It has the lens patterns turned by this beyond the nominal orientation [deg].
    answer, room
        For variants: another wall or scattering; a room that is not black.
    """

    far: bool = False
    max_bounces: int = 0
    isotropic: bool = False
    turn_deg: float = 0.0
    answer: Answer = field(default_factory=Answer)
    room: Room | None = None


@dataclass(frozen=True)
class World:
    """What is concealed in the station, and in its simulation."""

    hidden: Hidden = field(default_factory=Hidden)
    flaws: Flaws = field(default_factory=Flaws)


GonioDial = Dial[World]
"""A cause concealed in a goniometer's station."""


@dataclass(frozen=True)
class _Still:
    """A light that stands still at one instant."""

    light: PerezLight
    at_ns: int

    def sun(self, utc_ns: int) -> Sun:
        return self.light.sun(self.at_ns)

    def diffuse(self, utc_ns: int) -> float:
        return self.light.diffuse(self.at_ns)

    def luminance(self, directions: Floats, utc_ns: int) -> Floats:
        return self.light.luminance(directions, self.at_ns)


class Station:
    """Takes the scans of a campaign under any `World`, and predicts them.

    Parameters
    ----------
    campaign, shelf
        What is measured, and where skylights' responses come from.
    rng
        Draws the smooth errors of lenses and tests.
    """

    def __init__(self, campaign: Campaign, shelf: Shelf, rng: np.random.Generator) -> None:
        self.campaign = campaign
        self._shelf = shelf
        care = campaign.care
        self._system_ripples = {name: Ripple(rng, care.system_ripple, 25.0, 120.0) for name in campaign.systems}
        self._test_ripples = {test.name: Ripple(rng, care.test_ripple, 25.0, 120.0) for test in campaign.tests}
        self._responses: dict[object, Response] = {}
        self._fields: dict[object, Fields] = {}
        self._benches: dict[object, Bench] = {}
        self._changes: dict[object, Floats] = {}

    def scan(self, test: Test) -> Scan:
        """The scan of a test."""
        c = self.campaign
        return Scan(c.gammas_deg, c.planes_deg, test.times_ns, c.distance_m)

    @property
    def floor(self) -> float:
        """Floor of the readings [cd]."""
        return self.campaign.care.floor_lx * self.campaign.distance_m**2

    @property
    def free_gain(self) -> bool:
        """Every test has a gain of its own: the daylight between roof and room is known to a few per cent."""
        return True

    def outcome(self, world: World, simulated: bool) -> list[Floats]:
        """Noise-free readings of every test [cd], or what the simulation predicts for them."""
        return [sun + sky for sun, sky in self.predict(world.flaws)] if simulated else self.read(world)

    def read(self, world: World) -> list[Floats]:
        """Read every test without noise and wandering gains [cd], shape (p * g,) each."""
        return [self.read_one(world, test) for test in self.campaign.tests]

    def read_one(self, world: World, test: Test) -> Floats:
        """Read one test without noise and wandering gains [cd], shape (p * g,)."""
        hidden = world.hidden
        light = hidden.source.over(test.light)
        bench = self._bench(hidden.room, hidden.arm)
        scan = self.scan(test)
        lit = self._lit(world, test, light, bench, scan)
        stray = bench.stray(light, scan)
        values = readings(lit, stray, bench.sensors(scan), scan, hidden.heads)
        if self.campaign.middle_only:  # the reduction takes off the daylight's change, as the roof recorded it
            values = values * self._daylight(test)
        return values * self.campaign.distance_m**2

    def _lit(self, world: World, test: Test, light: FaultedLight, bench: Bench, scan: Scan) -> Lit:
        optics = world.hidden.optics_of(test.system)
        response = self.true_response(test.system, optics)
        below = self._fields_of(("true", optics), response, test, light)
        if optics.defect_share:
            below = self._broken(below, optics, test)
        return bench.light(below, light, scan, self.pattern(test))

    def _broken(self, below: Fields, optics: OpticsFaults, test: Test) -> Fields:
        """Apply a defect: both parts in proportion to what they lose when it is complete."""
        design = self.campaign.systems[test.system]
        gap = optics.defect.gap_m != (0.0, 0.0)
        skylight = with_defect(DESIGNS[design], optics.defect, optics.fogged)
        pair = answers(optics.fogged, gap)
        what = (design, optics.defect, optics.fogged)
        if (*what, test.name) not in self._changes:
            sun = test.light.sun(test.middle_ns).direction
            self._changes[(*what, test.name)] = sun_change(skylight, pair, sun, 1)
        if what not in self._changes:
            self._changes[what] = sky_change(skylight, pair, 1)
        suns, skies = (
            tuple(Field(f.values * (1.0 + optics.defect_share * change), f.turn_deg) for f in group)
            for group, change in ((below.suns, self._changes[(*what, test.name)]), (below.skies, self._changes[what]))
        )
        return replace(below, suns=(suns[0], suns[1]), skies=skies)

    def predict(self, flaws: Flaws) -> list[tuple[Floats, Floats]]:
        """Predict every test: sun part and sky part [cd], shape (p * g,) each."""
        result = []
        for test in self.campaign.tests:
            below, light = self._predicted_fields(flaws, test)
            bench = self._bench(RoomFaults(flaws.room or Room()), ArmFaults())
            lit = bench.light(below, light, self.scan(test), far=flaws.far)
            total = lit.sun + lit.sky
            share = np.divide(lit.sun, total, out=np.zeros_like(total), where=total > 0.0)
            area = self.campaign.distance_m**2
            result.append(((lit.sun + share * lit.room) * area, (lit.sky + (1.0 - share) * lit.room) * area))
        return result

    def predicted_maps(self, flaws: Flaws, test: Test, gammas: Floats, planes: Floats) -> tuple[Floats, Floats]:
        """Predicted sun and sky part over a grid in the middle of the test [cd], (p, g) each; without a room."""
        below, light = self._predicted_fields(flaws, test)
        directions = vector(gammas[None, :], planes[:, None])
        reach = math.inf if flaws.far else self.campaign.distance_m
        level = light.sun(test.middle_ns).normal_lx
        sun = 0.5 * level * sum((f.intensity(directions, reach) for f in below.suns), start=np.zeros(1))
        sky = sum((f.intensity(directions, reach) for f in below.skies), start=np.zeros(1)) / len(below.skies)
        return np.asarray(sun), np.asarray(sky)

    def pattern(self, test: Test) -> Pattern:
        """The smooth errors that are always there."""
        system, own = self._system_ripples[test.system], self._test_ripples[test.name]
        return lambda directions: system(directions) + own(directions)

    def _predicted_fields(self, flaws: Flaws, test: Test) -> tuple[Fields, FaultedLight]:
        base: Light = _Still(test.light, test.middle_ns) if self.campaign.middle_only else test.light
        light = SourceFaults().over(base)
        response = self.predicted_response(test.system, flaws)
        what = ("predicted", flaws.isotropic, flaws.turn_deg, flaws.max_bounces, flaws.answer)
        return self._fields_of(what, response, test, light), light

    def _fields_of(self, what: object, response: Response, test: Test, light: FaultedLight) -> Fields:
        key = (what, test.name, light.faults)
        if key not in self._fields:
            if len(self._fields) > 600:
                self._fields.clear()
            times = test.times_ns
            self._fields[key] = fields(response, light, int(times.min()), int(times.max()))
        return self._fields[key]

    def _daylight(self, test: Test) -> Floats:
        """Global illuminance in the middle of the test over that at each record, shape (p * g,)."""
        ends = []
        times = test.times_ns.ravel()
        for t in (int(times.min()), int(times.max())):
            sun = test.light.sun(t)
            ends.append(sun.normal_lx * float(sun.direction[2]) + test.light.diffuse(t))
        along = (times - times.min()) / max(1, int(times.max() - times.min()))
        return np.asarray(test.global_lx / ((1.0 - along) * ends[0] + along * ends[1]))

    def _bench(self, room: RoomFaults, arm: ArmFaults) -> Bench:
        room = replace(room, room=replace(room.room, size_m=self.campaign.room_m))
        key = (room, arm)
        if key not in self._benches:
            if len(self._benches) > 40:
                self._benches.clear()
            self._benches[key] = Bench(room, arm)
        return self._benches[key]

    def _kept(self, key: object, make: object) -> Response:
        if key not in self._responses:
            if len(self._responses) > 30:
                self._responses.clear()
            assert callable(make)
            self._responses[key] = make()
        return self._responses[key]

    def true_response(self, system: str, optics: OpticsFaults) -> Response:
        """Response of the skylight that hangs there."""

        def make() -> Response:
            design = self.campaign.systems[system]
            turn = optics.turn_deg
            found = self._turned(design, turn, moulded=False)
            found = found.blended(self._turned(design, turn, moulded=True), self.campaign.care.moulded)
            if optics.aligned < 1.0:
                found = found.blended(self._shelf(Wanted(design, isotropic=True)), 1.0 - optics.aligned)
            return found.with_answer(optics.answer)

        return self._kept(("true", system, optics), make)

    def predicted_response(self, system: str, flaws: Flaws) -> Response:
        """Response of the skylight as it is simulated."""

        def make() -> Response:
            design = self.campaign.systems[system]
            answer = replace(flaws.answer, max_bounces=flaws.max_bounces)
            found = self._turned(design, flaws.turn_deg, moulded=False)
            if flaws.isotropic:  # its answers are those of the same rays' walls and lenses, in proportion
                found = replace(found, base=self._shelf(Wanted(design, isotropic=True)).base)
            return found.with_answer(answer)

        return self._kept(("predicted", system, replace(flaws, far=False, room=None)), make)

    def _turned(self, design: str, turn_deg: float, moulded: bool) -> Response:
        """Response with the pattern turned: a tube turns as a whole, others are traced turned."""
        if DESIGNS[design].round:
            return self._shelf(Wanted(design, moulded)).turned(turn_deg + self.campaign.orientation_deg)
        return self._shelf(Wanted(design, moulded, turned_deg=turn_deg))
