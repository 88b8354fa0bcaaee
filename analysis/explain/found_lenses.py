"""The lenses that a case's predictions were found to have, told in its explanation and taken by `labdaq predict`.

Another case of the same station may show its lenses less well: of a system with a single test no density of shifts is
sought, and what was fitted along settings of a density would be read off prisms.
"""

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np

from analysis.explain.look import Likened
from analysis.simulate.lens_shift import SIDE
from analysis.simulate.system import System
from labdaq.errors import ConfigError

_FINEST = 99_999
"""A density's shares are told in whole numbers up to this."""
_OF_COVER = ("rise_m", "boot_height_m")
_LENSES = ("entry", "exit")


@dataclass(frozen=True)
class FoundLens:
    """Settings of a system that stand for its lenses, and the rest of `Likened`."""

    settings: dict[str, Any]
    spread_deg: float = 0.0
    even: bool = False
    alike: bool = False

    def of(self, system: System) -> Likened:
        """A system as its case describes it, with these lenses."""
        return Likened(system.with_settings(self.settings), self.spread_deg, self.even, self.alike)


@dataclass(frozen=True)
class FoundLenses:
    """The lenses of systems by id."""

    systems: dict[str, FoundLens] = field(default_factory=dict)

    def of(self, systems: Mapping[str, System]) -> dict[str, Likened]:
        """Those of ``systems`` whose lenses are known."""
        return {name: self.systems[name].of(system) for name, system in systems.items() if name in self.systems}


def told(likened: Mapping[str, Likened]) -> dict[str, Any]:
    """As JSON holds them: each system's lenses and cover; a density as rows of whole numbers."""
    return {name: _told(like) for name, like in likened.items()}


def _told(like: Likened) -> dict[str, Any]:
    settings = {name: getattr(like.system, name) for name in _OF_COVER}
    settings |= {place: _lens(asdict(getattr(like.system, place))) for place in _LENSES}
    return {
        "settings": settings,
        "spread_deg": float(like.spread_deg),
        "even": bool(like.even),
        "alike": bool(like.alike),
    }


def _lens(told: dict[str, Any]) -> dict[str, Any]:
    shifts = np.array(told.pop("shifts"))
    if not len(shifts):
        return told
    whole = np.rint(_FINEST * shifts / shifts.max()).astype(int).reshape(SIDE, SIDE)
    return {**told, "shifts": [" ".join(map(str, row)) for row in whole.tolist()]}


def lenses_of(told: Mapping[str, Any]) -> FoundLenses:
    """From what `told` gave; raises `ValueError`, `KeyError`, `TypeError` or `AttributeError` if it is something else.

    Whether the settings make a lens is tried on a system.
    """
    made = {}
    for name, one in told.items():
        settings = {key: float(one["settings"][key]) for key in _OF_COVER}
        lenses = {place: dict(one["settings"][place]) for place in _LENSES}
        for lens in lenses.values():
            lens["shifts"] = [float(x) for row in lens.get("shifts", ()) for x in row.split()]
        found = FoundLens(settings | lenses, float(one["spread_deg"]), bool(one["even"]), bool(one["alike"]))
        try:
            found.of(System())
        except ConfigError as error:
            raise ValueError(str(error)) from error
        made[str(name)] = found
    return FoundLenses(made)
