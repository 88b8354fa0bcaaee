"""One thing changed about a skylight: what a simulation may get wrong, as a setting of the system."""

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final

from analysis.simulate.components import Lens, Wall
from analysis.simulate.system import LENS_PLACES, System

LENS_KEYS: Final = ("mirrored", "isotropic", "haze", "slope_deg", "blur_deg", "absorption_per_mm", "refractive_index")
WALL_KEYS: Final = ("scatter_deg", "diffuse_fraction", "finish")
TALLY_KEYS: Final = ("wall_reflectance", "max_bounces")
"""Settings that need no new rays: a tally knows them."""


@dataclass(frozen=True)
class Change:
    """One thing that a simulation may get wrong, set to one value.

    Attributes
    ----------
    mechanism
        Id of the catalogue, or any label.
    setting
        What is changed. For the lenses (all prismatic ones, or those named by ``lenses``: "entry", "exit"):
        ``rotation_deg`` (added to the orientation), ``mirrored``, ``isotropic``, ``haze``, ``slope_deg``, ``blur_deg``,
        ``absorption_per_mm``, ``refractive_index``; ``soiling`` of the entry. For the well: ``wall_reflectance``,
        ``max_bounces``, ``scatter_deg``, ``diffuse_fraction``, ``finish``. For the sun: ``aureole_deg``. For the
        sensors: ``distance_m``. Any dotted name of `System` otherwise.
    """

    mechanism: str
    setting: Mapping[str, Any]


def changed(system: System, setting: Mapping[str, Any]) -> System:
    """The system with the optical part of a change's setting; see `Change`. Raises `ConfigError`."""
    rest = dict(setting)
    chosen = rest.pop("lenses", None)
    places = (chosen,) if chosen else lenses_of(system)
    dotted: dict[str, Any] = {}
    for key, value in rest.items():
        if key in ("aureole_deg", "distance_m", *TALLY_KEYS):
            continue
        if key == "rotation_deg":
            dotted |= {f"{p}.orientation_deg": getattr(system, p).orientation_deg + value for p in places}
        elif key == "soiling":
            dotted["entry.soiling"] = value
        elif key in LENS_KEYS:
            dotted |= {f"{p}.{key}": value for p in places}
        elif key in WALL_KEYS:
            dotted[f"wall.{key}"] = value
        else:
            dotted[key] = value
    return _plainest(system.with_settings(dotted)) if dotted else _plainest(system)


def lenses_of(system: System) -> tuple[str, ...]:
    """Where a system has lenses: its patterned sheets, or all its sheets if none of them is."""
    places = tuple(p for p in ("entry", "exit") if getattr(system, p).kind != "none")
    if any(getattr(system, p).kind in ("prismatic", "shift") for p in places):
        return tuple(p for p in places if p in LENS_PLACES.get(system.kind, places))
    return places


def _plainest(system: System) -> System:
    """The simplest description of the same physics, so that what is alike is traced once."""

    def lens(this: Lens) -> Lens:
        if this.kind in ("bsdf", "shift"):
            return this
        if this.kind != "prismatic":
            return dataclasses.replace(this, orientation_deg=0.0, mirrored=False, isotropic=False)
        turn = -this.orientation_deg if this.mirrored else this.orientation_deg  # pyramids have the square's symmetry
        return dataclasses.replace(this, mirrored=False, orientation_deg=0.0 if this.isotropic else turn % 90.0)

    def wall(this: Wall) -> Wall:
        return dataclasses.replace(this, scatter_deg=0.0, diffuse_fraction=0.0) if this.finish == "diffuse" else this

    return dataclasses.replace(
        system, entry=lens(system.entry), exit=lens(system.exit), wall=wall(system.wall), boot=wall(system.boot)
    )
