"""The goniophotometer: a motor drive and two analog modules for ten heads on one Modbus line (RTU or TCP)."""

from drivers.goniophotometer.arm import Arm, ArmOptions
from drivers.goniophotometer.codec import Framing
from drivers.goniophotometer.goniophotometer import Goniophotometer, GoniophotometerOptions, HeadOptions, ten_heads
from drivers.goniophotometer.line import RTU_SETTINGS, Line, LineOptions
from drivers.goniophotometer.module import AnalogModule, ModuleOptions

__all__ = [
    "RTU_SETTINGS",
    "AnalogModule",
    "Arm",
    "ArmOptions",
    "Framing",
    "Goniophotometer",
    "GoniophotometerOptions",
    "HeadOptions",
    "Line",
    "LineOptions",
    "ModuleOptions",
    "ten_heads",
]
