"""Dials for the goniometer's cases: lenses and wells, and what a simulation gets wrong of them."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from simulators.hidden.effects import OpticsFaults
from simulators.hidden.skylight import Defect
from simulators.hidden.store import LIMITS
from simulators.trial.dials import Parameters
from simulators.trial.station import Flaws, GonioDial, Station, World
from simulators.trial.stock import DESIGNS, TURNED


def with_optics(
    systems: tuple[str, ...], change: Callable[[OpticsFaults, float], OpticsFaults]
) -> Callable[[World, float], World]:
    """Make a dial's `apply` that changes the optics of some systems."""

    def apply(world: World, x: float) -> World:
        optics = dict(world.hidden.optics)
        for system in systems:
            optics[system] = change(optics.get(system, OpticsFaults()), x)
        return replace(world, hidden=replace(world.hidden, optics=tuple(sorted(optics.items()))))

    return apply


def with_flaws(change: Callable[[Flaws, float], Flaws]) -> Callable[[World, float], World]:
    """Make a dial's `apply` that changes what the simulation gets wrong."""
    return lambda world, x: replace(world, flaws=change(world.flaws, x))


def some(rng: np.random.Generator, names: list[str]) -> tuple[str, ...]:
    """All of the systems, or (two times in five) one."""
    if len(names) > 1 and rng.random() < 0.4:
        return (str(rng.choice(names)),)
    return tuple(names)


def used(station: Station) -> list[str]:
    """Systems that tests were taken with."""
    return sorted({test.system for test in station.campaign.tests})


def _specular(station: Station) -> list[str]:
    return [s for s in used(station) if DESIGNS[station.campaign.systems[s]].wall_finish == "specular"]


def lens_haze(rng: np.random.Generator, station: Station) -> GonioDial | None:
    """The sheets scatter a share of what passes; a dome can be hazed as well."""
    systems = some(rng, used(station))

    def haze(o: OpticsFaults, x: float) -> OpticsFaults:
        return replace(o, answer=replace(o.answer, haze=0.16 * x))

    return GonioDial(
        "lens-haze", "optics", with_optics(systems, haze), lambda x: {"haze": (0.16 * x, "1")}, systems=systems
    )


def soiling(rng: np.random.Generator, station: Station) -> GonioDial:
    """Dirt on the cover takes light, more at a slant."""
    systems = some(rng, used(station))

    def dirt(o: OpticsFaults, x: float) -> OpticsFaults:
        return replace(o, answer=replace(o.answer, soiling=0.8 * x))

    def report(x: float) -> Parameters:
        return {"optical_depth": (0.8 * x, "1"), "loss_at_normal": (1.0 - float(np.exp(-0.8 * x)), "1")}

    return GonioDial("soiling", "optics", with_optics(systems, dirt), report, systems=systems)


def lens_anisotropy(rng: np.random.Generator, station: Station) -> GonioDial:
    """The simulation's lenses know no directions in their plane; the real ones do, in part or wholly."""
    systems = tuple(used(station))

    def apply(world: World, x: float) -> World:
        world = with_optics(systems, lambda o, _: replace(o, aligned=x))(world, x)
        return replace(world, flaws=replace(world.flaws, isotropic=True))

    return GonioDial("lens-anisotropy", "optics", apply, lambda x: {"weight": (x, "1")}, systems=systems)


def lens_orientation(rng: np.random.Generator, station: Station) -> GonioDial | None:
    """The pattern is turned, or mirrored where the nominal pattern is turned itself."""
    campaign = station.campaign
    tubes = [s for s in used(station) if DESIGNS[campaign.systems[s]].round]
    turned = [s for s in used(station) if campaign.systems[s] in TURNED]
    if tubes and (not turned or rng.random() < 0.6):
        system = str(rng.choice(tubes))
        nominal = campaign.orientation_deg
        if nominal and rng.random() < 0.5:

            def mirror(o: OpticsFaults, x: float) -> OpticsFaults:
                return replace(o, turn_deg=-2.0 * nominal if x > 0.0 else 0.0)

            def mirrored(x: float) -> Parameters:
                return {"mirrored": (1.0, "1"), "rotation_deg": (_shortest(-2.0 * nominal), "deg")}

            apply = with_optics((system,), mirror)
            return GonioDial("lens-orientation", "optics", apply, mirrored, choices=(1.0,), systems=(system,))
        sign = float(rng.choice([-1.0, 1.0]))

        def turn(o: OpticsFaults, x: float) -> OpticsFaults:
            return replace(o, turn_deg=sign * 45.0 * x)

        def angle(x: float) -> Parameters:
            return {"rotation_deg": (sign * 45.0 * x, "deg")}

        return GonioDial("lens-orientation", "optics", with_optics((system,), turn), angle, systems=(system,))
    if not turned:
        return None
    system = str(rng.choice(turned))
    steps = TURNED[campaign.systems[system]]

    def step(x: float) -> float:
        return 0.0 if x <= 0.0 else steps[min(len(steps) - 1, int(x * len(steps)))]

    apply = with_optics((system,), lambda o, x: replace(o, turn_deg=step(x)))
    choices = tuple((k + 0.5) / len(steps) for k in range(len(steps)))
    return GonioDial(
        "lens-orientation", "optics", apply, lambda x: {"rotation_deg": (step(x), "deg")}, choices, (system,)
    )


def _shortest(degrees: float) -> float:
    """The same turn of a square pattern, between -45 and 45 degrees."""
    return (degrees + 45.0) % 90.0 - 45.0


def wall_reflectance(rng: np.random.Generator, station: Station) -> GonioDial:
    """The wall of the well or tube reflects less, seldom more, than was assumed."""
    systems = some(rng, used(station))
    nominal = {s: DESIGNS[station.campaign.systems[s]].wall_reflectance for s in systems}
    up = rng.random() < 0.25

    def value(system: str, x: float) -> float:
        span = min(0.03, 0.995 - nominal[system]) if up else -0.14
        return nominal[system] + span * x

    def rewalled(system: str) -> Callable[[OpticsFaults, float], OpticsFaults]:
        return lambda o, x: replace(o, answer=replace(o.answer, wall_reflectance=value(system, x)))

    def apply(world: World, x: float) -> World:
        for system in systems:
            world = with_optics((system,), rewalled(system))(world, x)
        return world

    def report(x: float) -> Parameters:
        found = {f"wall_reflectance[{s}]": (value(s, x), "1") for s in systems}
        found["change"] = (value(systems[0], x) - nominal[systems[0]], "1")
        found["wall_reflectance"] = (value(systems[0], x), "1")
        return found

    return GonioDial("wall-reflectance", "well", apply, report, systems=systems)


def bounce_truncation(rng: np.random.Generator, station: Station) -> GonioDial:
    """The simulation follows light for a limited number of reflections on the wall."""

    def limit(x: float) -> int:
        return 0 if x <= 0.0 else LIMITS[min(len(LIMITS) - 1, int(x * len(LIMITS)))]

    apply = with_flaws(lambda f, x: replace(f, max_bounces=limit(x)))
    choices = tuple((k + 0.5) / len(LIMITS) for k in range(len(LIMITS)))
    return GonioDial(
        "bounce-truncation",
        "well",
        apply,
        lambda x: {"max_bounces": (float(limit(x)), "1")},
        choices,
        on_simulation=True,
    )


def wall_scatter(rng: np.random.Generator, station: Station) -> GonioDial | None:
    """A share of the reflections on a specular wall scatters."""
    names = _specular(station)
    if not names:
        return None
    systems = some(rng, names)

    def scatter(o: OpticsFaults, x: float) -> OpticsFaults:
        return replace(o, answer=replace(o.answer, wall_scatter=0.16 * x))

    return GonioDial(
        "wall-scatter",
        "well",
        with_optics(systems, scatter),
        lambda x: {"scattered_share": (0.16 * x, "1")},
        systems=systems,
    )


def near_field(rng: np.random.Generator, station: Station) -> GonioDial:
    """The simulation predicts the far field; the campaign's distance decides how much that matters."""
    apply = with_flaws(lambda f, x: replace(f, far=x > 0.0))
    distance = station.campaign.distance_m
    return GonioDial(
        "near-field",
        "goniometer",
        apply,
        lambda x: {"weight": (1.0, "1"), "distance_m": (distance, "m")},
        (1.0,),
        on_simulation=True,
    )


def broken_cover(rng: np.random.Generator, station: Station) -> GonioDial:
    """A sector of the cover is dirty or fogged, or a strip of wall is missing (outside the catalogue)."""
    systems = some(rng, used(station))
    kind = str(rng.choice(["dirt-wedge", "fogged-sector", "well-gap"]))
    start = float(rng.uniform(0, 360))
    defect = Defect(sector_deg=(start, start + float(rng.uniform(60, 150))))
    if kind == "well-gap":
        depth = min(DESIGNS[station.campaign.systems[s]].depth_m for s in systems)
        low = float(rng.uniform(0.2, 0.6)) * depth
        defect = Defect(gap_m=(low, low + 0.25 * depth), gap_azimuth_deg=float(rng.choice([0.0, 90.0, 180.0, 270.0])))

    def broken(o: OpticsFaults, x: float) -> OpticsFaults:
        return replace(o, defect=defect, defect_share=x, fogged=kind == "fogged-sector")

    apply = with_optics(systems, broken)
    return GonioDial(kind, "optics", apply, lambda x: {"share": (x, "1")}, systems=systems, inside=False)
