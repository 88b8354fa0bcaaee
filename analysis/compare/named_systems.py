"""What a case says about the report's three skylights, as simulations nominally assume them.

Sizes are those of the Greenwood field test (report, chapters 2 and 7); reflectances are nominal values.
"""

from collections.abc import Mapping
from typing import Any, Final

from analysis.cases.model import System

_TWO_FEET_M: Final = 0.6096
_SQUARE: Final = {"shape": "rectangle", "size_m": (_TWO_FEET_M, _TWO_FEET_M)}
_FACTS: Final[dict[str, dict[str, Any]]] = {
    "top": {
        "aperture": _SQUARE,
        "well_depth_m": _TWO_FEET_M,
        "wall_reflectance": 0.85,
        "wall_finish": "diffuse",
    },
    "box": {
        "aperture": _SQUARE,
        "well_depth_m": 0.61,
        "wall_reflectance": 0.95,
        "wall_finish": "specular",
    },
    "tube": {
        "aperture": {"shape": "disc", "diameter_m": 0.3556},
        "well_depth_m": 0.9144,
        "wall_reflectance": 0.98,
        "wall_finish": "specular",
    },
}

NAMED_SYSTEMS: Final[dict[str, System]] = {
    name: System.model_validate({"id": name, "kind": name, **facts, "lens": "prismatic"})
    for name, facts in _FACTS.items()
}
"""``top``, ``box`` and ``tube`` as ``[[system]]`` tables of a case."""


def case_system(name: str, simulated: Mapping[str, Any]) -> System:
    """A case's ``[[system]]`` of an `analysis.simulate.system.System`, taken apart as a dictionary."""
    shape = simulated["aperture"]["shape"]
    size = "size_m" if shape == "rectangle" else "diameter_m"
    sheets = [simulated[place]["kind"] for place in ("exit", "entry")]
    return System.model_validate(
        {
            "id": name,
            "kind": simulated["kind"],
            "aperture": {"shape": shape, size: simulated["aperture"][size]},
            "well_depth_m": simulated["well_depth_m"],
            "wall_reflectance": simulated["wall"]["reflectance"],
            "wall_finish": simulated["wall"]["finish"],
            "lens": next(kind for kind in ("prismatic", "bsdf", "diffusing", "clear", "none") if kind in sheets),
        }
    )
