"""Dials for the goniometer's cases: the room, the arm, the heads."""

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from simulators.hidden.arm import ArmFaults
from simulators.hidden.bench import RoomFaults, Spot
from simulators.hidden.heads import HeadFaults
from simulators.hidden.room import Panel
from simulators.trial.dials import Parameters
from simulators.trial.station import GonioDial, Station, World


def with_room(change: Callable[[RoomFaults, float], RoomFaults]) -> Callable[[World, float], World]:
    """Make a dial's `apply` that changes the room."""
    return lambda world, x: replace(world, hidden=replace(world.hidden, room=change(world.hidden.room, x)))


def with_arm(change: Callable[[ArmFaults, float], ArmFaults]) -> Callable[[World, float], World]:
    """Make a dial's `apply` that changes the arm."""
    return lambda world, x: replace(world, hidden=replace(world.hidden, arm=change(world.hidden.arm, x)))


def with_heads(change: Callable[[HeadFaults, float], HeadFaults]) -> Callable[[World, float], World]:
    """Make a dial's `apply` that changes the heads."""
    return lambda world, x: replace(world, hidden=replace(world.hidden, heads=change(world.hidden.heads, x)))


def _sign(rng: np.random.Generator, plus: float = 0.5) -> float:
    return 1.0 if rng.random() < plus else -1.0


def _brightest_lx(station: Station) -> float:
    """Brightest reading of the campaign without anything concealed [lx]."""
    return max(float(r.max()) for r in station.read(World())) / station.campaign.distance_m**2


def _typical_lx(station: Station) -> float:
    values = np.concatenate(station.read(World())) / station.campaign.distance_m**2
    return float(np.exp(np.mean(np.log(np.maximum(values, 1e-3)))))


def room_interreflection(rng: np.random.Generator, station: Station) -> GonioDial:
    """Walls, floor and ceiling give light back."""
    floor, ceiling = float(rng.uniform(0.2, 1.2)), float(rng.choice([1.0, 1.0, 0.5]))

    def painted(r: RoomFaults, x: float) -> RoomFaults:
        return replace(r, room=replace(r.room, walls=0.3 * x, floor=0.3 * x * floor, ceiling=0.3 * x * ceiling))

    def report(x: float) -> Parameters:
        return {
            "wall_reflectance": (0.3 * x, "1"),
            "floor_reflectance": (0.3 * x * floor, "1"),
            "ceiling_reflectance": (0.3 * x * ceiling, "1"),
        }

    return GonioDial("room-interreflection", "room", with_room(painted), report)


def stray_light(rng: np.random.Generator, station: Station) -> GonioDial:
    """Light that does not come through the skylight: steady, or leaking in from outdoors."""
    typical = _typical_lx(station)
    if rng.random() < 0.5:
        most = 2.0 * typical
        area = station.campaign.distance_m**2

        def report(x: float) -> Parameters:
            return {"illuminance_lx": (most * x, "lx"), "intensity_cd": (most * x * area, "cd")}

        apply = with_room(lambda r, x: replace(r, stray_lx=most * x))
        return GonioDial("stray-light", "room", apply, report, notes={"form": "steady"})
    outdoors = float(np.mean([t.global_lx for t in station.campaign.tests]))
    most, towards = 3.0 * typical / outdoors, float(rng.uniform(0, 360))

    def leak(x: float) -> Parameters:
        return {"illuminance_lx": (0.5 * most * x * outdoors, "lx"), "leak": (most * x, "1"), "c_deg": (towards, "deg")}

    apply = with_room(lambda r, x: replace(r, leak=most * x, leak_c_deg=towards))
    return GonioDial("stray-light", "room", apply, leak, notes={"form": "leak"})


def gamma_offset(rng: np.random.Generator, station: Station) -> GonioDial:
    """The arm's vertical zero is off."""
    most = _sign(rng) * 4.0
    apply = with_arm(lambda a, x: replace(a, gamma_offset_deg=most * x))
    return GonioDial("gamma-offset", "goniometer", apply, lambda x: {"offset_deg": (most * x, "deg")})


def c_offset(rng: np.random.Generator, station: Station) -> GonioDial:
    """North is not where the arm thinks."""
    most = _sign(rng) * 15.0
    apply = with_arm(lambda a, x: replace(a, c_offset_deg=most * x))
    return GonioDial("c-offset", "goniometer", apply, lambda x: {"offset_deg": (most * x, "deg")})


def c_handedness(rng: np.random.Generator, station: Station) -> GonioDial:
    """The arm turns the other way round."""
    apply = with_arm(lambda a, x: replace(a, mirrored=x > 0.0))
    return GonioDial("c-handedness", "goniometer", apply, lambda x: {"mirrored": (1.0, "1")}, (1.0,))


def channel_swap(rng: np.random.Generator, station: Station) -> GonioDial:
    """Two sensors answer to each other's name."""
    n = len(station.campaign.gammas_deg)
    pairs = [(int(a), int(a + d)) for a in rng.permutation(n - 1)[:5] for d in (1,)]
    if n > 3:
        a, b = sorted(int(k) for k in rng.choice(n, size=2, replace=False))
        pairs.append((a, b))

    def pair(x: float) -> tuple[int, int]:
        return pairs[min(len(pairs) - 1, int(x * len(pairs)))]

    def report(x: float) -> Parameters:
        a, b = pair(x)
        g = station.campaign.gammas_deg
        return {"first_gamma_deg": (float(g[a]), "deg"), "second_gamma_deg": (float(g[b]), "deg")}

    apply = with_arm(lambda arm, x: replace(arm, swapped=pair(x) if x > 0.0 else None))
    choices = tuple((k + 0.5) / len(pairs) for k in range(len(pairs)))
    return GonioDial("channel-swap", "goniometer", apply, report, choices)


def dark_offset(rng: np.random.Generator, station: Station) -> GonioDial:
    """The electronics read something in the dark."""
    most = 2.0 * _typical_lx(station) if rng.random() < 0.7 else -0.3 * _typical_lx(station)
    area = station.campaign.distance_m**2

    def report(x: float) -> Parameters:
        return {"offset_lx": (most * x, "lx"), "offset_cd": (most * x * area, "cd")}

    return GonioDial("dark-offset", "sensors", with_heads(lambda h, x: replace(h, dark_lx=most * x)), report)


def nonlinearity(rng: np.random.Generator, station: Station) -> GonioDial:
    """The heads are not proportional: a power, a parabola, or gain steps."""
    form = str(rng.choice(["power", "power", "parabola", "ranges"]))
    most = _sign(rng) * {"power": 0.12, "parabola": 0.6, "ranges": 0.08}[form]
    reference = _brightest_lx(station) if form == "parabola" else _typical_lx(station)
    reference = _brightest_lx(station) if form == "ranges" else reference

    def bend(h: HeadFaults, x: float) -> HeadFaults:
        return replace(h, curve=most * x, curve_form=form, curve_reference_lx=reference)

    def report(x: float) -> Parameters:
        found = {"strength": (most * x, "1"), "reference_lx": (reference, "lx")}
        if form == "power":
            found["exponent"] = (1.0 + most * x, "1")
        return found

    return GonioDial("nonlinearity", "sensors", with_heads(bend), report, notes={"form": form})


def saturation(rng: np.random.Generator, station: Station) -> GonioDial:
    """The heads' range ends, gently or hard."""
    form = str(rng.choice(["soft", "exponential", "clip", "knee"]))
    brightest = _brightest_lx(station)
    area = station.campaign.distance_m**2

    def level(x: float) -> float:
        if x <= 0.0:
            return 0.0
        return brightest * (1.2 - 1.1 * x if form in ("clip", "knee") else 0.15 * x**-1.5)

    def report(x: float) -> Parameters:
        from simulators.hidden.heads import ended

        loss = 1.0 - float(ended(np.array([brightest]), level(x), form)[0]) / brightest
        return {"level_lx": (level(x), "lx"), "level_cd": (level(x) * area, "cd"), "loss_at_brightest": (loss, "1")}

    apply = with_heads(lambda h, x: replace(h, end_lx=level(x), end_form=form))
    return GonioDial("saturation", "sensors", apply, report, notes={"form": form})


def cosine_response(rng: np.random.Generator, station: Station) -> GonioDial:
    """The heads' response differs from the cosine, or their axes droop away from the aperture."""
    if rng.random() < 0.3:
        # α = droop · γ; the reading falls as its cosine
        def report_droop(x: float) -> Parameters:
            loss = {g: 1.0 - math.cos(math.radians(0.45 * x * g)) for g in (60.0, 85.0)}
            return {"droop": (0.45 * x, "1"), "loss_at_60": (loss[60.0], "1"), "loss_at_85": (loss[85.0], "1")}

        apply = with_arm(lambda a, x: replace(a, aim_droop=0.45 * x))
        return GonioDial("cosine-response", "sensors", apply, report_droop, notes={"form": "droop"})
    form, sign = str(rng.choice(["sine2", "quartic", "step"])), _sign(rng, 0.75)
    tilt = float(rng.choice([1.0, 0.85]))

    def response(h: HeadFaults, x: float) -> HeadFaults:
        return replace(h, response=sign * 0.2 * x, response_form=form, corrected_tilt=tilt)

    def report(x: float) -> Parameters:
        from simulators.hidden.heads import angular_response

        losses = {}
        for g in (60.0, 85.0):
            cosine = np.array([math.cos(math.radians(tilt * g))])
            losses[g] = 1.0 - float(angular_response(cosine, sign * 0.2 * x, form)[0])
        return {"loss_at_60": (losses[60.0], "1"), "loss_at_85": (losses[85.0], "1")}

    return GonioDial("cosine-response", "sensors", with_heads(response), report, notes={"form": form})


def channel_gain(rng: np.random.Generator, station: Station) -> GonioDial:
    """One head's sensitivity is off."""
    head = int(rng.integers(len(station.campaign.gammas_deg)))
    most = 0.5 if rng.random() < 0.5 else -0.4
    gamma = float(station.campaign.gammas_deg[head])

    def report(x: float) -> Parameters:
        return {"gain": (1.0 + most * x, "1"), "gamma_deg": (gamma, "deg")}

    apply = with_heads(lambda h, x: replace(h, gains={**h.gains, head: 1.0 + most * x}))
    return GonioDial("channel-gain", "sensors", apply, report, notes={"channel": f"gonio.g{gamma:02.0f}"})


def cable_shadow(rng: np.random.Generator, station: Station) -> GonioDial:
    """A cable or shield hangs between aperture and sensors (outside the catalogue)."""
    gamma, c, width = float(rng.uniform(15, 75)), float(rng.uniform(0, 360)), float(rng.uniform(7, 16))
    apply = with_room(lambda r, x: replace(r, spots=(*r.spots, Spot(gamma, c, width, shade=0.95 * x))))

    def report(x: float) -> Parameters:
        return {"depth": (0.95 * x, "1"), "gamma_deg": (gamma, "deg"), "c_deg": (c, "deg"), "width_deg": (width, "deg")}

    return GonioDial("cable-shadow", "room", apply, report, inside=False)


def glint(rng: np.random.Generator, station: Station) -> GonioDial:
    """A glossy rail mirrors the brightest light to some sensors (outside the catalogue)."""
    gamma, c, width = float(rng.uniform(50, 85)), float(rng.uniform(0, 360)), float(rng.uniform(8, 18))
    source = float(rng.choice([15.0, 25.0, 35.0, 45.0]))

    def shiny(r: RoomFaults, x: float) -> RoomFaults:
        spot = Spot(gamma, c, width, mirror=0.6 * x, from_gamma_deg=source, from_c_deg=(c + 180.0) % 360.0)
        return replace(r, spots=(*r.spots, spot))

    def report(x: float) -> Parameters:
        return {"share": (0.6 * x, "1"), "gamma_deg": (gamma, "deg"), "c_deg": (c, "deg"), "width_deg": (width, "deg")}

    return GonioDial("specular-glint", "room", with_room(shiny), report, inside=False)


def bright_panel(rng: np.random.Generator, station: Station) -> GonioDial:
    """Something white stands in one corner of the dark room (outside the catalogue)."""
    gamma, c, half = float(rng.uniform(30, 80)), float(rng.uniform(0, 360)), float(rng.uniform(10, 25))
    apply = with_room(
        lambda r, x: replace(r, room=replace(r.room, panel=Panel(gamma, c, half, 0.9 * x) if x > 0.0 else None))
    )

    def report(x: float) -> Parameters:
        return {"reflectance": (0.9 * x, "1"), "gamma_deg": (gamma, "deg"), "c_deg": (c, "deg")}

    return GonioDial("bright-panel", "room", apply, report, inside=False)


def arm_sag(rng: np.random.Generator, station: Station) -> GonioDial:
    """The arm bends under its weight (outside the catalogue)."""
    apply = with_arm(lambda a, x: replace(a, sag_deg=5.0 * x))
    return GonioDial("arm-sag", "goniometer", apply, lambda x: {"sag_deg": (5.0 * x, "deg")}, inside=False)


def aperture_offset(rng: np.random.Generator, station: Station) -> GonioDial:
    """The aperture is not where the arm's centre is (outside the catalogue)."""
    shift = rng.normal(size=3) * np.array([1.0, 1.0, 0.5])
    shift *= 0.2 / np.linalg.norm(shift)

    def moved(a: ArmFaults, x: float) -> ArmFaults:
        return replace(a, aperture_shift_m=(shift[0] * x, shift[1] * x, shift[2] * x))

    def report(x: float) -> Parameters:
        return {name: (float(v * x), "m") for name, v in zip(("east_m", "north_m", "up_m"), shift, strict=True)}

    return GonioDial("aperture-offset", "goniometer", with_arm(moved), report, inside=False)


def backlash(rng: np.random.Generator, station: Station) -> GonioDial:
    """The planes lag behind in the direction of travel (outside the catalogue; needs both directions)."""
    apply = with_arm(lambda a, x: replace(a, backlash_deg=12.0 * x))
    return GonioDial("backlash", "goniometer", apply, lambda x: {"lag_deg": (12.0 * x, "deg")}, inside=False)


def temperature_drift(rng: np.random.Generator, station: Station) -> GonioDial:
    """The heads warm up within every test's hours (outside the catalogue)."""
    most = _sign(rng) * 0.08
    apply = with_heads(lambda h, x: replace(h, warming_per_k=most * x, kelvin_per_hour=30.0))
    return GonioDial("temperature-drift", "sensors", apply, lambda x: {"per_k": (most * x, "1/K")}, inside=False)


def sluggish_heads(rng: np.random.Generator, station: Station) -> GonioDial:
    """Heads that are read in quick succession remember the one before (outside the catalogue)."""
    apply = with_heads(lambda h, x: replace(h, lag_s=0.35 * x))
    return GonioDial("time-constant", "sensors", apply, lambda x: {"lag_s": (0.35 * x, "s")}, inside=False)


def blue_heads(rng: np.random.Generator, station: Station) -> GonioDial:
    """Heads that see blue skylight stronger or weaker than sunlight (outside the catalogue)."""
    most = _sign(rng) * 0.4
    apply = with_heads(lambda h, x: replace(h, blue=most * x))
    return GonioDial("sensor-spectral-mismatch", "sensors", apply, lambda x: {"excess": (most * x, "1")}, inside=False)
