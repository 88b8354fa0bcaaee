"""An emulated Konica Minolta LS-110 (or LS-100) luminance meter on its RS-232 line."""

from simulators.ls110.meter import Held, LuminanceMeter, Trouble, four_digits
from simulators.ls110.optics import LuminanceResponse, MeterOptics, faithful
from simulators.ls110.options import LS100, LS110, LuminanceMeterModel, LuminanceMeterOptions
from simulators.ls110.wire import STYLE, LuminanceMeterWire

__all__ = [
    "LS100",
    "LS110",
    "STYLE",
    "Held",
    "LuminanceMeter",
    "LuminanceMeterModel",
    "LuminanceMeterOptions",
    "LuminanceMeterWire",
    "LuminanceResponse",
    "MeterOptics",
    "Trouble",
    "faithful",
    "four_digits",
]
