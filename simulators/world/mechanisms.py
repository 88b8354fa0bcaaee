"""What can be concealed in an emulated station: for each mechanism how strong, what it does, and how to say it.

Identifiers and units are the catalogue's. Strengths are such that readings of the goniophotometer, or what a simulation
predicts for them from the roof's readings, change by about 3 to 12 % (root mean square over a campaign).
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from simulators.hidden.arm import ArmFaults
from simulators.hidden.bench import RoomFaults
from simulators.hidden.effects import Hidden, OpticsFaults
from simulators.hidden.heads import HeadFaults, angular_response
from simulators.hidden.light_faults import Drift, SourceFaults
from simulators.hidden.room import Room
from simulators.hidden.tracer import Answer
from simulators.world.tracing import NOMINAL

Parameters = dict[str, float]
GAMMAS_DEG: Final = (0.0, 5.0, 15.0, 25.0, 35.0, 45.0, 55.0, 65.0, 75.0, 85.0)


@dataclass(frozen=True)
class Mechanism:
    """One mechanism that can be concealed.

    Attributes
    ----------
    stage
        Of the measuring chain, as in the catalogue.
    units
        Parameter to unit.
    draw
        Draws the parameters.
    hidden
        What they mean for the station with some systems.
    sentence
        What happened, for people; parameters are filled in.
    one_system
        Whether it befalls one skylight only.
    """

    stage: str
    units: dict[str, str]
    draw: Callable[[np.random.Generator], Parameters]
    hidden: Callable[[Parameters, tuple[str, ...]], Hidden]
    sentence: str
    one_system: bool = False


def _sign(rng: np.random.Generator) -> float:
    return -1.0 if rng.random() < 0.5 else 1.0


def _optics(faults: OpticsFaults, systems: tuple[str, ...]) -> Hidden:
    return Hidden(optics=tuple((system, faults) for system in systems))


def _walls(p: Parameters, systems: tuple[str, ...]) -> Hidden:
    return Hidden(
        optics=tuple(
            (s, OpticsFaults(answer=Answer(wall_reflectance=NOMINAL[s].wall_reflectance + p["change"])))
            for s in systems
        )
    )


def _cosine(rng: np.random.Generator) -> Parameters:
    loss = float(rng.uniform(0.10, 0.18))
    at_85 = 1.0 - float(angular_response(np.array([np.cos(np.radians(85.0))]), loss, "sine2")[0])
    return {"loss_at_60": loss, "loss_at_85": at_85}


def _gain(rng: np.random.Generator) -> Parameters:
    gain = 1.0 + _sign(rng) * float(rng.uniform(0.13, 0.28))
    return {"gain": gain, "gamma_deg": float(rng.choice(GAMMAS_DEG[1:8]))}


def _drifting(p: Parameters, systems: tuple[str, ...]) -> Hidden:
    drift = Drift(p["rms"], 2.0 * p["correlation_s"], p["wind_from_deg"], int(p["field"]))
    return Hidden(source=SourceFaults(drift=drift))


MECHANISMS: Final[dict[str, Mechanism]] = {
    "circumsolar-aureole": Mechanism(
        "sun and sky",
        {"share": "1", "sigma_deg": "deg"},
        lambda rng: {"share": float(rng.uniform(0.2, 0.4)), "sigma_deg": float(rng.uniform(3.0, 5.0))},
        lambda p, _: Hidden(
            source=SourceFaults(halo=p["share"], halo_deg=p["sigma_deg"] * 2.0**0.5, halo_power=2.0),
        ),
        "{share:.0%} of the sun's light came from a halo about it, {sigma_deg:.1f} degrees wide (standard deviation).",
    ),
    "sky-sun-ratio": Mechanism(
        "sun and sky",
        {"diffuse_shift": "1"},
        lambda rng: {"diffuse_shift": _sign(rng) * float(rng.uniform(0.2, 0.35))},
        lambda p, _: Hidden(source=SourceFaults(diffuse_shift=p["diffuse_shift"])),
        "The shaded meter was wrong: the sky's true illuminance was {diffuse_shift:+.0%} off what it read.",
    ),
    "cloud-drift": Mechanism(
        "sun and sky",
        {"rms": "1", "correlation_s": "s", "wind_from_deg": "deg", "field": "1"},
        lambda rng: {
            "rms": float(rng.uniform(0.07, 0.14)),
            "correlation_s": float(rng.uniform(10.0, 30.0)),
            "wind_from_deg": float(rng.uniform(0.0, 360.0)),
            "field": float(rng.integers(1 << 20)),
        },
        _drifting,
        "Thin cloud drifted past the sun while the arm moved: the beam changed by {rms:.0%} (rms).",
    ),
    "lens-haze": Mechanism(
        "optics",
        {"haze": "1"},
        lambda rng: {"haze": float(rng.uniform(0.006, 0.02))},
        lambda p, systems: _optics(OpticsFaults(answer=Answer(haze=p["haze"])), systems),
        "The lenses scattered {haze:.1%} of the light that passed them.",
    ),
    "soiling": Mechanism(
        "optics",
        {"optical_depth": "1"},
        lambda rng: {"optical_depth": float(rng.uniform(0.03, 0.07))},
        lambda p, systems: _optics(OpticsFaults(answer=Answer(soiling=p["optical_depth"])), systems),
        "Dirt on the cover, of optical depth {optical_depth:.3f}.",
    ),
    "lens-orientation": Mechanism(
        "optics",
        {"rotation_deg": "deg"},
        lambda rng: {"rotation_deg": _sign(rng) * float(rng.uniform(1.0, 2.5))},
        lambda p, systems: _optics(OpticsFaults(turn_deg=p["rotation_deg"]), systems),
        "The lens patterns were turned by {rotation_deg:+.1f} degrees, counter-clockwise seen from above.",
        one_system=True,
    ),
    "wall-reflectance": Mechanism(
        "well",
        {"change": "1"},
        lambda rng: {"change": -float(rng.uniform(0.02, 0.045))},
        _walls,
        "The wells' walls reflected {change:+.3f} against what was assumed.",
    ),
    "wall-scatter": Mechanism(
        "well",
        {"scattered_share": "1"},
        lambda rng: {"scattered_share": float(rng.uniform(0.015, 0.05))},
        lambda p, systems: _optics(OpticsFaults(answer=Answer(wall_scatter=p["scattered_share"])), systems),
        "The mirror walls scattered {scattered_share:.1%} of each reflection.",
    ),
    "room-interreflection": Mechanism(
        "room",
        {"wall_reflectance": "1", "floor_reflectance": "1", "ceiling_reflectance": "1"},
        lambda rng: {
            "wall_reflectance": (rho := float(rng.uniform(0.12, 0.25))),
            "floor_reflectance": rho * float(rng.uniform(0.4, 1.0)),
            "ceiling_reflectance": rho,
        },
        lambda p, _: Hidden(
            room=RoomFaults(
                room=Room(walls=p["wall_reflectance"], floor=p["floor_reflectance"], ceiling=p["ceiling_reflectance"])
            )
        ),
        "The dark room was not dark: its walls reflected {wall_reflectance:.0%}, its floor {floor_reflectance:.0%}.",
    ),
    "stray-light": Mechanism(
        "room",
        {"illuminance_lx": "lx"},
        lambda rng: {"illuminance_lx": float(rng.uniform(0.7, 2.4))},
        lambda p, _: Hidden(room=RoomFaults(stray_lx=p["illuminance_lx"])),
        "A light in the room gave {illuminance_lx:.1f} lx at each sensor.",
    ),
    "gamma-offset": Mechanism(
        "goniometer",
        {"offset_deg": "deg"},
        lambda rng: {"offset_deg": _sign(rng) * float(rng.uniform(0.3, 0.8))},
        lambda p, _: Hidden(arm=ArmFaults(gamma_offset_deg=p["offset_deg"])),
        "The sensors stood {offset_deg:+.1f} degrees off in gamma.",
    ),
    "c-offset": Mechanism(
        "goniometer",
        {"offset_deg": "deg"},
        lambda rng: {"offset_deg": _sign(rng) * float(rng.uniform(1.0, 2.5))},
        lambda p, _: Hidden(arm=ArmFaults(c_offset_deg=p["offset_deg"])),
        "The arm's north was {offset_deg:+.1f} degrees off in C.",
    ),
    "dark-offset": Mechanism(
        "sensors",
        {"offset_lx": "lx"},
        lambda rng: {"offset_lx": float(rng.uniform(0.7, 2.4))},
        lambda p, _: Hidden(heads=HeadFaults(dark_lx=p["offset_lx"])),
        "The sensors read {offset_lx:+.1f} lx in the dark.",
    ),
    "nonlinearity": Mechanism(
        "sensors",
        {"exponent": "1", "reference_lx": "lx"},
        lambda rng: {"exponent": 1.0 + _sign(rng) * float(rng.uniform(0.03, 0.06)), "reference_lx": 300.0},
        lambda p, _: Hidden(heads=HeadFaults(curve=p["exponent"] - 1.0, curve_reference_lx=p["reference_lx"])),
        "The sensors' readings went as light to the power of {exponent:.3f}, right at {reference_lx:.0f} lx.",
    ),
    "saturation": Mechanism(
        "sensors",
        {"level_lx": "lx"},
        lambda rng: {"level_lx": float(rng.uniform(5500.0, 15000.0))},
        lambda p, _: Hidden(heads=HeadFaults(end_lx=p["level_lx"], end_form="soft")),
        "The sensors' range ended gently: E / (1 + E / {level_lx:.0f} lx).",
    ),
    "cosine-response": Mechanism(
        "sensors",
        {"loss_at_60": "1", "loss_at_85": "1"},
        _cosine,
        lambda p, _: Hidden(heads=HeadFaults(response=p["loss_at_60"], response_form="sine2", corrected_tilt=1.0)),
        "The sensors, all facing down, lost {loss_at_60:.0%} against the cosine at 60 degrees.",
    ),
    "channel-gain": Mechanism(
        "sensors",
        {"gain": "1", "gamma_deg": "deg"},
        _gain,
        lambda p, _: Hidden(heads=HeadFaults(gains={GAMMAS_DEG.index(p["gamma_deg"]): p["gain"]})),
        "The sensor at {gamma_deg:.0f} degrees read {gain:.2f} times what was there.",
    ),
    "clock-offset": Mechanism(
        "time",
        {"offset_s": "s"},
        lambda rng: {"offset_s": _sign(rng) * float(rng.uniform(90.0, 240.0))},
        lambda p, _: Hidden(source=SourceFaults(clock_s=p["offset_s"])),
        "The room's clock was {offset_s:+.0f} s away from the roof's: it showed that much less than the true time.",
    ),
}
"""Mechanism of the catalogue to how it is concealed."""


def bare(hidden: Hidden) -> Hidden:
    """What of it the world itself applies: without arm, heads and the roof's meters."""
    source = replace(hidden.source, diffuse_shift=0.0)
    return replace(hidden, source=source, arm=ArmFaults(), heads=HeadFaults())
