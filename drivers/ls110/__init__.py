"""The Konica Minolta LS-110 (and LS-100) luminance meter on its serial line."""

from drivers.ls110.meter import LINE, LuminanceMeter, LuminanceMeterOptions

__all__ = ["LINE", "LuminanceMeter", "LuminanceMeterOptions"]
