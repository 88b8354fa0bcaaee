"""The goniophotometer: arm, ten heads, a drive and two analog modules, as three units on one line or behind TCP."""

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from labdaq.clock import Clock
from simulators.goniophotometer.analog import CHANNELS, AnalogModule
from simulators.goniophotometer.arm import COUNTS_PER_REVOLUTION, Arm, ArmResponse, straight_arm
from simulators.goniophotometer.axis import Axis
from simulators.goniophotometer.drive import Drive
from simulators.goniophotometer.rtu import RtuSlaves
from simulators.goniophotometer.sensors import GAMMAS_DEG, SensorChain, SensorResponse, faithful_sensors
from simulators.goniophotometer.slave import ModbusFaults, Slaves
from simulators.goniophotometer.tcp import TcpSlaves
from simulators.goniophotometer.units import Unit
from simulators.line import FaultBox, SerialFormat
from simulators.world.observed import World

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class GoniophotometerOptions:
    """How the goniophotometer is built and what is wrong with it.

    Attributes
    ----------
    gammas_deg
        Nominal gamma of each head [deg]; heads take the modules' channels in order, eight to a module.
    motor_unit, sensor_units
        Modbus unit numbers of the drive and of the analog modules.
    baud, parity, stop_bits
        The RS-485 line, 8 data bits; a pty cannot carry parity.
    power_up_c_deg
        Where the arm stands when the drive is switched on [deg]; the drive does not know.
    enabled
        Whether the motor is powered from the start.
    answers_bad_crc
        Whether the drive answers a corrupted frame with exception 08, as the vendor's does.
    conversion_s
        Time of one conversion of a module [s].
    wiring
        Which head (with its amplifier) is on each channel, in channel order; empty for straight wiring.
    chain
        Electrical side of the heads.
    arm
        Hook: how the arm carries the heads.
    sensors
        Hook: what the heads make of the light.
    """

    gammas_deg: tuple[float, ...] = GAMMAS_DEG
    motor_unit: int = 1
    sensor_units: tuple[int, ...] = (2, 3)
    baud: int = 115_200
    parity: str = "N"
    stop_bits: int = 1
    power_up_c_deg: float = 37.4
    enabled: bool = True
    answers_bad_crc: bool = True
    conversion_s: float = 0.1
    wiring: tuple[int, ...] = ()
    chain: SensorChain = field(default_factory=SensorChain)
    arm: ArmResponse = straight_arm
    sensors: SensorResponse = faithful_sensors

    def __post_init__(self) -> None:
        heads, modules = len(self.gammas_deg), len(self.sensor_units)
        if heads > modules * CHANNELS:
            raise ValueError(f"{modules} modules have {modules * CHANNELS} channels, too few for {heads} heads")
        if len({self.motor_unit, *self.sensor_units}) != modules + 1:
            raise ValueError(f"units need different numbers, not {self.motor_unit} and {self.sensor_units}")
        if self.wiring and sorted(self.wiring) != list(range(heads)):
            raise ValueError(f"the wiring must name each of the {heads} heads once, not {self.wiring}")


class Goniophotometer:
    """The whole instrument.

    Attributes
    ----------
    arm, axis, drive, modules
        Its parts, for tests to look at and to spoil.
    faults
        Faults of the units' answers, on whichever line.
    rtu, tcp
        The two ways in; give their ``serve`` to a port.
    """

    def __init__(
        self,
        world: World,
        clock: Clock,
        options: GoniophotometerOptions | None = None,
        seed: int = 0,
        *,
        line_faults: FaultBox | None = None,
        pacing: bool = True,
    ) -> None:
        self.options = options = options or GoniophotometerOptions()
        self._world = world
        start = options.power_up_c_deg * COUNTS_PER_REVOLUTION / 360.0
        self.arm = Arm(clock.mono_ns(), start)
        self.axis = Axis(self.arm, clock, enabled=options.enabled)
        self.drive = Drive(
            self.axis, answers_bad_crc=options.answers_bad_crc, turnaround_s=0.003 if options.baud > 57_600 else 0.025
        )
        self.modules = tuple(
            AnalogModule(
                self._terminals_from(CHANNELS * k),
                clock,
                np.random.default_rng([seed, 7017, k]),
                noise_v=options.chain.noise_v,
                unit_id=number,
                conversion_s=options.conversion_s,
            )
            for k, number in enumerate(options.sensor_units)
        )
        self.faults = ModbusFaults()
        units: dict[int, Unit] = {options.motor_unit: self.drive}
        units |= dict(zip(options.sensor_units, self.modules, strict=True))
        slaves = Slaves(units, self.faults)
        style = SerialFormat(options.baud, 8, options.parity, options.stop_bits)
        self.rtu = RtuSlaves(slaves, clock, style, line_faults, pacing=pacing)
        self.tcp = TcpSlaves(slaves, clock)

    def illuminance(self, utc_ns: int, mono_ns: int) -> Floats:
        """What each head responds to [lx, (n,)] at a time, through the hooks; in the order of the nominal gammas."""
        shaft_c = self.arm.c_deg(mono_ns)
        nominal = np.asarray(self.options.gammas_deg)
        gamma, c = self.options.arm(nominal, shaft_c, self.arm.approach(mono_ns))
        # an arm bent beyond nadir looks from the other side
        near = self._world.room_illuminance(np.abs(gamma), c, utc_ns)
        if np.any(gamma < 0):
            far = self._world.room_illuminance(np.abs(gamma), (c + 180.0) % 360.0, utc_ns)
            near = np.where(gamma < 0, far, near)
        return self.options.sensors(near, gamma, c)

    def _terminals_from(self, first: int) -> Callable[[int, int], Floats]:
        return lambda utc_ns, mono_ns: self._terminals(utc_ns, mono_ns)[first : first + CHANNELS]

    def _terminals(self, utc_ns: int, mono_ns: int) -> Floats:
        """Volts at all modules' inputs; those without a head are shorted."""
        from_heads = self.options.chain.volts(self.illuminance(utc_ns, mono_ns))
        volts = np.zeros(CHANNELS * len(self.modules))
        volts[: len(from_heads)] = from_heads[list(self.options.wiring)] if self.options.wiring else from_heads
        return volts
