"""The Konica Minolta CL-200 and CL-200A chroma meters, with one or several heads."""

from drivers.cl200.meter import LINE, ChromaMeter
from drivers.cl200.options import ChromaMeterOptions, Head

__all__ = ["LINE", "ChromaMeter", "ChromaMeterOptions", "Head"]
