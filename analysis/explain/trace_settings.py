"""What is traced for a system, beside the system as described: the settings that change it, by mechanism."""

from collections.abc import Mapping
from typing import Any, Final

from analysis.explain.densities import densities, fourfold, seen_by
from analysis.explain.scattering import SCATTERERS, scattering
from analysis.simulate.changes import lenses_of
from analysis.simulate.system import System

Setting = tuple[tuple[str, float | str], ...]

TURNS_DEG: Final = (9.0, 27.0, 45.0, 63.0, 81.0)
"""Turns of a pattern that is itself after a quarter turn;"""
ANY_TURNS_DEG: Final = (-90.0, -54.0, -27.0, -9.0, 9.0, 27.0, 54.0, 90.0)
"""and of one that is not, beside half a turn and its mirror image."""
HALF_TURN: Final = ("rotation_deg", 180.0)
MIRRORED: Final = ("mirrored", True)
"""East and west exchanged; with half a turn, north and south."""
SCATTERER: Final = "scatterer"
"""Names a place whose lens scatters all light (`scattering`)."""
ISOTROPIC: Final = ("isotropic", True)
"""Where the prediction knows no pattern, this setting has one (`on_top`)."""
DIAGONAL: Final = ("rotation_deg", 45.0)
ASLANT: Final = (("rotation_deg", 27.0), ("rotation_deg", 63.0))
"""How else the pattern may lie that a prediction did not know."""
STRETCHED: Final = "stretched_deg"
"""Lenses that are densities of shifts send light further along such an axis, and less far across it,"""
STRETCH_OF: Final = "stretch"
"""by such a share,"""
STRETCH: Final = 0.25
"""which is this in what is traced."""
AXES_DEG: Final = (0.0, 22.5, 45.0, 67.5)
"""Axes that are tried; a stretch along the other four is a negative one,"""
TRACED_AXES_DEG: Final = (0.0, 45.0)
"""and one between these does what one along each does, in parts."""
DIFFUSE_SHARES: Final = (0.15,)
SCATTERS_DEG: Final = (5.0, 15.0)
AUREOLES_DEG: Final = (3.0, 8.0)
HAZES: Final[dict[str, tuple[str, ...]]] = {"both lenses": (), "entry lens": ("entry",), "exit lens": ("exit",)}
"""Where haze may be, and how a setting names it."""
HAZE: Final = 0.15
"""The share of the light that haze is traced with; its effect is nearly linear in it."""
DEPTHS: Final = (0.15, 0.6)
"""Optical depths of dirt on the cover."""
FLAT: Final = ("rise_m", 0.0)
"""A cover without any rise: a case does not tell whether there is a dome, and dirt on a pane is another matter."""

SETTINGS_OF: Final[dict[str, tuple[str, ...]]] = {
    "circumsolar-aureole": ("aureole_deg",),
    "lens-haze": ("haze", SCATTERER),
    "soiling": ("soiling", FLAT[0]),
    "lens-orientation": ("rotation_deg", "mirrored"),
    "lens-anisotropy": ("isotropic", "rotation_deg", STRETCHED),
    "wall-scatter": ("diffuse_fraction", "scatter_deg"),
}
"""Settings that are traced for a mechanism; those of other mechanisms need none but the systems as described."""


def haze(where: tuple[str, ...]) -> Setting:
    """The setting of haze in some lens, or in all."""
    return (("haze", HAZE), *(("lenses", place) for place in where))


def knows_no_pattern(system: System) -> bool:
    """Whether the system's lenses are as a simulation sees them that knows no directions in their plane."""
    return any(getattr(system, place).isotropic for place in lenses_of(system))


def any_pattern(system: System) -> bool:
    """Whether the system's lenses are densities of shifts that have a pattern, and nothing says that it is square."""
    return any(not getattr(system, place).isotropic for place in densities(system))


def scatterer(place: str, kind: str) -> Setting:
    """The setting of a lens that scatters all light."""
    return ((SCATTERER, place), ("scatters", kind))


def on_top(system: System, setting: Mapping[str, Any]) -> dict[str, Any]:
    """A setting as a change of the system: haze (in all lenses, or those it names) comes on top of theirs.

    And lenses whose pattern the prediction did not know get one, where others lose theirs.
    """
    rest = dict(setting)
    if "isotropic" in rest:
        rest["isotropic"] = not knows_no_pattern(system)
        if knows_no_pattern(system):
            rest |= {f"{p}.shifts": fourfold(getattr(system, p).shifts) for p in densities(system)}
    by, axis_deg = rest.pop(STRETCH_OF, STRETCH), rest.pop(STRETCHED, None)
    for p in densities(system) if axis_deg is not None else ():
        rest |= {f"{p}.shifts": seen_by(getattr(system, p)), f"{p}.isotropic": False}
        rest |= {f"{p}.stretch": by, f"{p}.stretch_axis_deg": axis_deg}
    if (place := rest.pop(SCATTERER, None)) is not None:
        rest[place] = scattering(getattr(system, place), rest.pop("scatters"))
    share, chosen = rest.pop("haze", None), rest.pop("lenses", None)
    places = () if share is None else (chosen,) if chosen else lenses_of(system)
    for place in ("entry", "exit"):
        more = share if place in places else rest.get(f"{place}.haze")
        if more is not None:
            own = getattr(system, place).haze
            rest[f"{place}.haze"] = own + (1.0 - own) * more
    return rest


def settings_of(system: System) -> list[Setting]:
    """What is traced for a system: only settings that change it."""
    made: list[Setting] = [(("aureole_deg", w),) for w in AUREOLES_DEG]
    lenses = [place for place in ("entry", "exit") if getattr(system, place).kind != "none"]
    made += [haze(where) for where in HAZES.values() if set(where) <= set(lenses) and (where or len(lenses) > 1)]
    if "entry" in lenses:
        made += [(("soiling", depth),) for depth in DEPTHS]
        if system.rise_m > 0.0:
            made += [(FLAT,), *((("soiling", depth), FLAT) for depth in DEPTHS)]
    made += [scatterer(place, kind) for place in densities(system) for kind in SCATTERERS]
    if densities(system):
        made += [((STRETCHED, axis),) for axis in TRACED_AXES_DEG]
    if any_pattern(system):
        made += [(ISOTROPIC,), (HALF_TURN,), (MIRRORED,), (MIRRORED, HALF_TURN)]
        made += [(("rotation_deg", t),) for t in ANY_TURNS_DEG]
    elif knows_no_pattern(system):
        made += [(ISOTROPIC,), *((ISOTROPIC, turn) for turn in (DIAGONAL, *ASLANT))]
    elif "prismatic" in (system.entry.kind, system.exit.kind):
        made += [(ISOTROPIC,), *((("rotation_deg", t),) for t in TURNS_DEG)]
    if system.wall.finish == "specular":
        made += [(("diffuse_fraction", s),) for s in DIFFUSE_SHARES]
        made += [(("scatter_deg", s),) for s in SCATTERS_DEG]
    return made
