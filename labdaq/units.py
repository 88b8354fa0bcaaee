"""Units and quantities of the measuring chain.

Inside the program there is one unit per quantity: lx, cd, cd/m², degrees, metres, seconds. Other units exist only
at the edges (an instrument's display, a table typed from a report) and are converted there with `to_lab_unit`.
"""

from enum import StrEnum
from typing import Final


class Unit(StrEnum):
    """A unit as it is written in journals, tables and reports."""

    LUX = "lx"
    FOOTCANDLE = "fc"
    CANDELA = "cd"
    CANDELA_PER_M2 = "cd/m2"
    FOOTLAMBERT = "fL"
    PERCENT = "%"
    DEGREE = "deg"
    KELVIN = "K"
    SECOND = "s"
    VOLT = "V"
    COUNT = "count"
    ONE = "1"


class Quantity(StrEnum):
    """What a reading is a reading of."""

    ILLUMINANCE = "illuminance"
    LUMINANCE = "luminance"
    LUMINOUS_INTENSITY = "luminous_intensity"
    CHROMATICITY_X = "chromaticity_x"
    CHROMATICITY_Y = "chromaticity_y"
    COLOUR_TEMPERATURE = "colour_temperature"
    ANGLE = "angle"
    VOLTAGE = "voltage"
    EXPOSURE = "exposure"


LUX_PER_FOOTCANDLE: Final = 10.763910416709722
"""1 fc = 1 lm/ft², and 1 ft = 0.3048 m exactly."""

CD_M2_PER_FOOTLAMBERT: Final = 3.4262590996353905
"""1 fL = 1/π cd/ft²."""

_TO_LAB: Final[dict[Unit, tuple[Unit, float]]] = {
    Unit.FOOTCANDLE: (Unit.LUX, LUX_PER_FOOTCANDLE),
    Unit.FOOTLAMBERT: (Unit.CANDELA_PER_M2, CD_M2_PER_FOOTLAMBERT),
}


def to_lab_unit(value: float, unit: Unit) -> tuple[float, Unit]:
    """Return ``value`` in the laboratory's own unit for that quantity (fc to lx, fL to cd/m²)."""
    target, factor = _TO_LAB.get(unit, (unit, 1.0))
    return value * factor, target
