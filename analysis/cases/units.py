"""The units that readings of a case may be in, and what each is in the laboratory's own (lx, cd, cd/m²)."""

from typing import Final

from analysis.cases.model import UNITS
from labdaq.units import CD_M2_PER_FOOTLAMBERT, LUX_PER_FOOTCANDLE

IN_LAB_UNITS: Final[dict[str, float]] = {
    "cd": 1.0,
    "kcd": 1e3,
    "lx": 1.0,
    "klx": 1e3,
    "fc": LUX_PER_FOOTCANDLE,
    "cd/m2": 1.0,
    "cd/m²": 1.0,
    "kcd/m2": 1e3,
    "kcd/m²": 1e3,
    "fL": CD_M2_PER_FOOTLAMBERT,
}
"""One unit in lx, cd or cd/m²."""


def conversion(unit: str, to: str) -> float | None:
    """Factor from ``unit`` to ``to``; ``None`` when they are not units of the same quantity, or unknown."""
    for units in UNITS.values():
        if unit in units and to in units:
            return IN_LAB_UNITS[unit] / IN_LAB_UNITS[to]
    return None
