"""An emulated goniophotometer: a motor arm and ten illuminance heads on Modbus RTU, and on Modbus TCP."""

from simulators.goniophotometer.arm import COUNTS_PER_REVOLUTION, ArmResponse, BentArm, straight_arm
from simulators.goniophotometer.bench import Goniophotometer, GoniophotometerOptions
from simulators.goniophotometer.drive import FOLLOWING_ERROR, OVER_CURRENT
from simulators.goniophotometer.sensors import ImperfectSensors, SensorChain, SensorResponse, faithful_sensors
from simulators.goniophotometer.slave import (
    ExceptionReply,
    LateReply,
    LostReply,
    ModbusFault,
    ModbusFaults,
    SilentUnit,
    WrongCrc,
)

__all__ = [
    "COUNTS_PER_REVOLUTION",
    "FOLLOWING_ERROR",
    "OVER_CURRENT",
    "ArmResponse",
    "BentArm",
    "ExceptionReply",
    "Goniophotometer",
    "GoniophotometerOptions",
    "ImperfectSensors",
    "LateReply",
    "LostReply",
    "ModbusFault",
    "ModbusFaults",
    "SensorChain",
    "SensorResponse",
    "SilentUnit",
    "WrongCrc",
    "faithful_sensors",
    "straight_arm",
]
