"""How a whole station is emulated: one frozen value."""

from dataclasses import dataclass, field
from typing import Literal

from simulators.camera.options import CameraOptions
from simulators.cl200 import ChromaMeterOptions, Head, LevelHead
from simulators.goniophotometer import GoniophotometerOptions, SensorChain
from simulators.line import LineFault
from simulators.ls110 import LuminanceMeterOptions

SERIAL = ("ls110", "cl200_global", "cl200_diffuse", "goniophotometer_rtu")
"""Instruments on serial lines."""

INSTRUMENTS = (*SERIAL[:3], "camera_ptpip", "goniophotometer_rtu", "goniophotometer_tcp")
"""Names of the endpoints, in the order they are shown."""


@dataclass(frozen=True, slots=True)
class LineTrouble:
    """A fault that is on a serial line from the start.

    Attributes
    ----------
    instrument
        One of `SERIAL`.
    fault
        What is wrong.
    times
        How many replies it spoils; ``None`` for all.
    skip
        How many good replies come first.
    """

    instrument: str
    fault: LineFault
    times: int | None = 1
    skip: int = 0

    def __post_init__(self) -> None:
        if self.instrument not in SERIAL:
            raise ValueError(f"'{self.instrument}' has no serial line; those with one are {', '.join(SERIAL)}")


@dataclass(frozen=True, slots=True)
class EmulationOptions:
    """The emulated station.

    Attributes
    ----------
    pacing
        Whether serial lines run at the pace of their baud rate.
    seed
        Of everything random.
    serial
        Where serial instruments are reached: on pseudo-terminals (``pty``) or on TCP ports (``tcp``).
    host, camera_port, modbus_port
        Where the network instruments listen; port 0 is any free one.
    ls110, cl200_global, cl200_diffuse, camera, goniophotometer
        The instruments; the diffuse meter's head is under a disc of 5 degrees half angle. The
        goniophotometer's amplifiers give 0.3 mV/lx, so that a skylight in full sun does not saturate them.
    troubles
        Faults on serial lines from the start.
    """

    pacing: bool = True
    seed: int = 0
    serial: Literal["pty", "tcp"] = "pty"
    host: str = "127.0.0.1"
    camera_port: int = 0
    modbus_port: int = 0
    ls110: LuminanceMeterOptions = field(default_factory=LuminanceMeterOptions)
    cl200_global: ChromaMeterOptions = field(default_factory=ChromaMeterOptions)
    cl200_diffuse: ChromaMeterOptions = field(
        default_factory=lambda: ChromaMeterOptions(heads=(Head(0, LevelHead(shaded_half_angle_deg=5.0)),))
    )
    camera: CameraOptions = field(default_factory=CameraOptions)
    goniophotometer: GoniophotometerOptions = field(
        default_factory=lambda: GoniophotometerOptions(chain=SensorChain(transimpedance_ohm=1.0e6))
    )
    troubles: tuple[LineTrouble, ...] = ()
