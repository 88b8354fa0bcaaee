"""An emulated Konica Minolta CL-200 or CL-200A chroma meter with one or more heads on its serial line."""

from simulators.cl200.heads import Head, HeadResponse, LevelHead
from simulators.cl200.meter import ChromaMeter, Measurement
from simulators.cl200.options import ChromaMeterOptions
from simulators.cl200.wire import STYLE, ChromaMeterWire

__all__ = [
    "STYLE",
    "ChromaMeter",
    "ChromaMeterOptions",
    "ChromaMeterWire",
    "Head",
    "HeadResponse",
    "LevelHead",
    "Measurement",
]
