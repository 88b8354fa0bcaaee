"""Make one case of the goniometer: draw a campaign, conceal something in it, and write what a laboratory would hold."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from simulators.hidden.effects import Hidden
from simulators.hidden.room import Room
from simulators.trial import campaign as campaigns
from simulators.trial import gonio_optics as optics
from simulators.trial import gonio_room as room
from simulators.trial import gonio_source as source
from simulators.trial.campaign import Campaign, Test
from simulators.trial.dials import relative, rms_change, setting_for
from simulators.trial.gonio_files import Written, case_files
from simulators.trial.made import Made, Order
from simulators.trial.shelf import Shelf
from simulators.trial.station import Flaws, GonioDial, Station, World
from simulators.trial.stock import DESIGNS, TURNED
from simulators.trial.truth import Concealed, Truth

Floats = NDArray[np.float64]
Maker = Callable[[np.random.Generator, Station], GonioDial | None]

INSIDE: Final[dict[str, Maker]] = {
    "sky-sun-ratio": source.sky_sun_ratio,
    "circumsolar-aureole": source.circumsolar_aureole,
    "cloud-drift": source.cloud_drift,
    "lens-haze": optics.lens_haze,
    "lens-anisotropy": optics.lens_anisotropy,
    "lens-orientation": optics.lens_orientation,
    "soiling": optics.soiling,
    "wall-reflectance": optics.wall_reflectance,
    "bounce-truncation": optics.bounce_truncation,
    "wall-scatter": optics.wall_scatter,
    "room-interreflection": room.room_interreflection,
    "stray-light": room.stray_light,
    "near-field": optics.near_field,
    "gamma-offset": room.gamma_offset,
    "c-offset": room.c_offset,
    "c-handedness": room.c_handedness,
    "channel-swap": room.channel_swap,
    "dark-offset": room.dark_offset,
    "nonlinearity": room.nonlinearity,
    "saturation": room.saturation,
    "cosine-response": room.cosine_response,
    "channel-gain": room.channel_gain,
    "clock-offset": source.clock_offset,
}
"""Catalogue ids that a goniometer's case can conceal."""

OUTSIDE: Final[dict[str, Maker]] = {
    "horizon-obstruction": source.skyline,
    "broken-cover": optics.broken_cover,
    "cable-shadow": room.cable_shadow,
    "specular-glint": room.glint,
    "bright-panel": room.bright_panel,
    "arm-sag": room.arm_sag,
    "aperture-offset": room.aperture_offset,
    "backlash": room.backlash,
    "temperature-drift": room.temperature_drift,
    "time-constant": room.sluggish_heads,
    "sensor-spectral-mismatch": room.blue_heads,
}
"""Physics that the catalogue does not have."""

EQUIVALENTS: Final[dict[tuple[str, str], tuple[str, ...]]] = {
    ("stray-light", "steady"): ("dark-offset",),
    ("dark-offset", ""): ("stray-light",),
}
"""By id and form: the same constant, whoever causes it."""
_CLOUDY = 1 / 3
"""Share of tests under broken cloud that a drifting cloud needs: fewer hardly show in all readings together."""


@dataclass(frozen=True)
class _Laid:
    """A dial laid over a world at a setting."""

    dial: GonioDial
    setting: float
    effect: float


def make(order: Order, shelf: Shelf) -> Made:
    """Make the case that was ordered; raises `ValueError` where an ordered cause has no place in any campaign."""
    rng = np.random.default_rng(order.seed)
    designs = order.designs or tuple(DESIGNS)
    for _ in range(12):
        wish = True if "near-field" in order.conceal else (bool(rng.random() < 0.2) or None)
        drawn = campaigns.draw(rng, far=wish, designs=designs, broken="cloud-drift" in order.conceal)
        if "lens-orientation" in order.conceal and not any(
            DESIGNS[d].round or d in TURNED for d in drawn.systems.values()
        ):
            continue
        cloudy = sum(t.sky == "partly-cloudy" for t in drawn.tests)
        if "cloud-drift" in order.conceal and cloudy < _CLOUDY * len(drawn.tests):
            continue
        if "backlash" in order.conceal and np.all(np.diff(drawn.planes_deg) > 0):
            continue
        station = Station(drawn, shelf, rng)
        laid = _lay(order, station, rng)
        if laid is not None:
            return _made(order, station, laid, rng)
    raise ValueError(f"no campaign could be drawn that conceals {', '.join(order.conceal)}")


def _lay(order: Order, station: Station, rng: np.random.Generator) -> list[_Laid] | None:
    """Turn every ordered dial to the strength wanted; None if this campaign has no place for one."""
    laid = []
    for name, wanted in zip(order.conceal, order.effects, strict=True):
        dial = (INSIDE.get(name) or OUTSIDE[name])(rng, station)
        if dial is None:
            return None
        setting, reached = setting_for(station, dial, wanted, World())
        if reached < 5e-4:
            return None
        laid.append(_Laid(dial, setting, reached))
    return laid


def _base(order: Order, station: Station, rng: np.random.Generator) -> World:
    """What is there besides: sometimes a simulation that is right to be a far field's, or that has the room in it."""
    world = World()
    if "near-field" not in order.conceal and station.campaign.distance_m > 4.0:
        far = World(flaws=Flaws(far=True))
        near, distant = (station.outcome(w, simulated=True) for w in (world, far))
        if rms_change(distant, near, station.floor, free_gain=True) < 0.0025:
            world = far
    if rng.random() < 0.08 and not {"room-interreflection", "bright-panel"} & set(order.conceal):
        wall, floor = float(rng.uniform(0.03, 0.08)), float(rng.uniform(0.01, 0.05))
        lit = Room(size_m=station.campaign.room_m, walls=wall, floor=floor, ceiling=wall)
        hidden = replace(Hidden(), room=replace(Hidden().room, room=lit))
        world = replace(world, hidden=hidden, flaws=replace(world.flaws, room=lit))
    return world


def _made(order: Order, station: Station, laid: list[_Laid], rng: np.random.Generator) -> Made:
    base = _base(order, station, rng)
    world, sound = base, base
    for one in laid:
        world = one.dial.apply(world, one.setting)
        sound = one.dial.apply(sound, 0.0)
    clean, predicted = station.read(world), station.predict(world.flaws)
    plain = [sun + sky for sun, sky in predicted]
    honest = station.outcome(base, simulated=True)
    unspoilt = station.read(base)
    measured = _noisy(station, clean, rng)
    kept, withheld = _withhold(order, station.campaign, rng)
    files = case_files(station, world, Written(measured, predicted), kept, order, rng, measured_too=True)
    out_files = {}
    if withheld:
        out_files = case_files(station, world, Written(measured, predicted), withheld, order, rng, measured_too=False)
    per_record = _relative(station, world, sound)
    concealed = tuple(_told(station, one, base) for one in laid)
    total = 0.0
    if laid:
        total = float(np.sqrt(np.mean(np.concatenate(per_record) ** 2)))
    truth = Truth(
        case=order.name,
        kind="goniometer",
        seed=order.seed,
        content=order.content,
        concealed=concealed,
        effect_percent=100.0 * total,
        mismatch_percent=100.0 * rms_change(clean, plain, station.floor, free_gain=True),
        nuisance_percent=100.0 * rms_change(unspoilt, honest, station.floor, free_gain=True),
        free_gain=True,
        floor=station.floor,
        clean=tuple(np.concatenate([clean[k] for k in kept])),
        change=tuple(np.concatenate([per_record[k] for k in kept])),
        withheld_clean=tuple(np.concatenate([clean[k] for k in withheld])) if withheld else (),
        care={k: float(v) for k, v in vars(station.campaign.care).items()},
        notes={"site": station.campaign.site_name, "systems": dict(station.campaign.systems)},
    )
    return Made(order, files, out_files, truth)


def _relative(station: Station, world: World, sound: World) -> list[Floats]:
    """Relative change of every reading's mismatch by what is concealed, gain per test removed."""
    result = []
    on, off = ([station.outcome(w, simulated) for simulated in (False, True)] for w in (world, sound))
    for read, told, read0, told0 in zip(*on, *off, strict=True):
        difference = relative(read, read0, station.floor) - relative(told, told0, station.floor)
        result.append(difference - np.mean(difference))
    return result


def _told(station: Station, one: _Laid, base: World) -> Concealed:
    dial = one.dial
    on, off = (station.outcome(dial.apply(base, x), dial.on_simulation) for x in (one.setting, 0.0))
    same = EQUIVALENTS.get((dial.id, str(dial.notes.get("form", ""))), ())
    return Concealed(
        id=dial.id,
        stage=dial.stage,
        inside=dial.inside,
        effect_percent=100.0 * rms_change(on, off, station.floor, free_gain=True),
        raw_percent=100.0 * rms_change(on, off, station.floor, free_gain=False),
        parameters=dial.report(one.setting),
        systems=dial.systems,
        equivalents=same,
        notes=dict(dial.notes),
    )


def _noisy(station: Station, clean: list[Floats], rng: np.random.Generator) -> list[Floats]:
    """Readings as recorded [cd]: wandering gains of tests and sensors, and noise."""
    care, c = station.campaign.care, station.campaign
    sensors = 1.0 + care.sensor_gain * rng.normal(size=len(c.gammas_deg))
    measured = []
    for values in clean:
        gain = 1.0 + care.test_gain * rng.normal()
        level = values * gain * np.tile(sensors, len(c.planes_deg))
        measured.append(level + rng.normal(size=len(values)) * _sigma(station, level))
    return measured


def _sigma(station: Station, values: Floats) -> Floats:
    care = station.campaign.care
    return np.hypot(care.noise * values, care.floor_lx * station.campaign.distance_m**2)


def _withhold(order: Order, campaign: Campaign, rng: np.random.Generator) -> tuple[list[int], list[int]]:
    """Which tests go into the case, and which are kept back: never the last of a system."""
    everything = list(range(len(campaign.tests)))
    if not order.withhold or len(everything) < 6:
        return everything, []
    wanted = max(1, len(everything) // 5)
    back: list[int] = []
    for k in rng.permutation(everything):
        left = [_system(campaign.tests, i) for i in everything if i not in back and i != int(k)]
        if len(back) < wanted and left.count(_system(campaign.tests, int(k))) >= 2:
            back.append(int(k))
    return [k for k in everything if k not in back], sorted(back)


def _system(tests: tuple[Test, ...], index: int) -> str:
    return tests[index].system
