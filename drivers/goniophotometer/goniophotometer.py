"""The goniophotometer as one instrument: turn the arm to a C-plane, read its ten heads in lux."""

import math
from dataclasses import dataclass, field
from typing import Final

from drivers.exchange import Span, span
from drivers.goniophotometer.arm import Arm, ArmOptions
from drivers.goniophotometer.line import Line, LineOptions
from drivers.goniophotometer.module import CHANNELS, SATURATED_HIGH, SATURATED_LOW, AnalogModule, ModuleOptions
from drivers.transport import Transport
from labdaq.clock import Clock
from labdaq.errors import ConfigError, ConnectError, DeviceTimeout, Problems
from labdaq.reading import Flag, Instrument, Reading
from labdaq.units import Quantity, Unit

GAMMAS_DEG: Final = (0.0, 5.0, 15.0, 25.0, 35.0, 45.0, 55.0, 65.0, 75.0, 85.0)
"""Where the heads sit on the arm [deg]."""


@dataclass(frozen=True, slots=True)
class HeadOptions:
    """One illuminance head and its amplifier.

    Attributes
    ----------
    gamma_deg
        Where it sits on the arm [deg].
    unit, channel
        The analog module it is wired to, and the input, 0 to 7.
    lux_per_volt
        Sensitivity of head and amplifier [lx/V], from the calibration certificate.
    dark_v
        Voltage in the dark [V].
    uncertainty_relative
        Standard uncertainty of the sensitivity (with cosine and spectral mismatch, as far as the certificate has them).
    dark_uncertainty_v
        Standard uncertainty of the dark voltage, with noise [V].
    serial, calibration
        Declared.
    """

    gamma_deg: float
    unit: int
    channel: int
    lux_per_volt: float = 100.0 / 3.0
    dark_v: float = 0.0
    uncertainty_relative: float = 0.025
    dark_uncertainty_v: float = 0.0005
    serial: str = ""
    calibration: str = ""


def ten_heads(first_unit: int = 2, second_unit: int = 3) -> tuple[HeadOptions, ...]:
    """Return the usual wiring: gammas 0 to 65 on the first module, 75 and 85 on the second."""
    return tuple(
        HeadOptions(gamma, first_unit if i < CHANNELS else second_unit, i % CHANNELS)
        for i, gamma in enumerate(GAMMAS_DEG)
    )


@dataclass(frozen=True, slots=True)
class GoniophotometerOptions:
    """What the station file says about the goniophotometer.

    Attributes
    ----------
    channel
        First part of its readings' names: ``gonio.g45`` is the head at gamma 45.
    model, serial
        Declared.
    line, arm, modules, heads
        See `LineOptions`, `ArmOptions`, `ModuleOptions`, `HeadOptions`.
    """

    channel: str = "gonio"
    model: str = "goniophotometer"
    serial: str = ""
    line: LineOptions = field(default_factory=LineOptions)
    arm: ArmOptions = field(default_factory=ArmOptions)
    modules: tuple[ModuleOptions, ...] = (ModuleOptions(2), ModuleOptions(3))
    heads: tuple[HeadOptions, ...] = field(default_factory=ten_heads)

    def __post_init__(self) -> None:
        problems = Problems("goniophotometer")
        units = [self.arm.unit, *(module.unit for module in self.modules)]
        for unit in sorted({unit for unit in units if units.count(unit) > 1}):
            problems.add("modules", f"unit {unit} is given twice")
        places = [(head.unit, head.channel) for head in self.heads]
        gammas = [head.gamma_deg for head in self.heads]
        for head in self.heads:
            where = f"head at gamma {head.gamma_deg:g}"
            if head.unit not in units[1:]:
                problems.add(where, f"there is no analog module with unit {head.unit}")
            if not 0 <= head.channel < CHANNELS:
                problems.add(where, f"a module has channels 0 to {CHANNELS - 1}, not {head.channel}")
            if places.count((head.unit, head.channel)) > 1 or gammas.count(head.gamma_deg) > 1:
                problems.add(where, "this gamma or this channel is given twice")
        problems.raise_if_any(ConfigError)


class Goniophotometer:
    """Arm and heads on one line. It tells lux where its heads are; candela are somebody else's business.

    Parameters
    ----------
    name
        Its name in the station file.
    transport
        The line: a serial port for RTU, TCP for Modbus TCP; must fit ``options.line.framing``.
    clock
        What stamps readings and limits waiting.
    options
        See `GoniophotometerOptions`.
    """

    def __init__(
        self, name: str, transport: Transport, clock: Clock, options: GoniophotometerOptions | None = None
    ) -> None:
        self.options: Final = options or GoniophotometerOptions()
        self._name = name
        self._clock = clock
        self.line: Final = Line(name, transport, clock, self.options.line)
        self.arm: Final = Arm(self.line, self.options.arm)
        self.modules: Final = {o.unit: AnalogModule(self.line, o) for o in self.options.modules}

    def identity(self) -> Instrument:
        """Who it is: model and serial as declared, the modules' firmware as they say."""
        told = [f"unit {unit}: {m.module_name}/{m.firmware}" for unit, m in self.modules.items() if m.firmware]
        return Instrument(
            name=self._name,
            model=self.options.model,
            serial=self.options.serial,
            firmware=", ".join(told),
            port=self.line.port,
            calibration=", ".join(sorted({h.calibration for h in self.options.heads if h.calibration})),
        )

    async def connect(self) -> None:
        """Open the line, check the drive and set up the modules; the arm does not move.

        Raises `ConnectError` when the port cannot be had or a device does not answer, `RefusedError` when one
        cannot be used as it is.
        """
        await self.line.open()
        try:
            await self.arm.connect()
            for module in self.modules.values():
                await module.connect()
        except DeviceTimeout as error:
            raise ConnectError(
                "the device does not answer", place=error.place, exchange=error.exchange, hint=error.hint
            ) from error

    async def aclose(self) -> None:
        """Close the line; the arm stays where it is."""
        await self.line.aclose()

    async def home(self) -> None:
        """Find the arm's reference position if the drive does not know it; see `Arm.home`."""
        await self.arm.home()

    async def move_to(self, c_deg: float) -> float:
        """Turn to a C-plane [deg, 0 to 360] and return where the feedback says the arm is [deg]; see `Arm.move_to`."""
        return await self.arm.move_to(c_deg)

    async def read(self) -> list[Reading]:
        """Read all heads once; return their illuminance [lx] in the order of the options.

        ``at`` has ``gamma_deg``, ``c_deg`` (where the arm was sent; where it is, if it was sent nowhere) and
        ``c_feedback_deg`` (mean of the feedback before and after). An arm that was off its place by more than the
        tolerance before or after flags ``MOVED``. A converter at its end flags ``SATURATED``; at the upper end the
        value is a ``LOWER_BOUND``, at the lower end there is none. ``raw`` is the converter's word.

        E = (V - dark) · sensitivity. The standard uncertainty combines (GUM 5.1.2) that of the sensitivity, of the
        dark voltage, and of the converter's step (uniform within one step: step/√12).

        Raises `RefusedError` when a module was restarted, and the line's errors.
        """
        asked_again = self.line.retries
        before = await self.arm.position()
        codes: dict[int, tuple[int, ...]] = {}
        spans: dict[int, Span] = {}
        for unit, module in self.modules.items():
            began_ns = self._clock.mono_ns()
            codes[unit] = await module.read_codes()
            spans[unit] = span(self._clock, began_ns, self._clock.mono_ns())
        after = await self.arm.position()
        o = self.arm.options
        sent_to = self.arm.sent_to
        flags: tuple[Flag, ...] = (Flag.RETRIED,) if self.line.retries > asked_again else ()
        if sent_to is None or max(abs(before - sent_to), abs(after - sent_to)) > o.tolerance_counts:
            flags += (Flag.MOVED,)
        feedback_deg = (o.degrees_of(before) + o.degrees_of(after)) / 2.0
        c_deg = feedback_deg if sent_to is None else o.degrees_of(sent_to)
        where = {"c_deg": c_deg, "c_feedback_deg": feedback_deg}
        who = self.identity()
        return [
            self._reading(head, codes[head.unit][head.channel], spans[head.unit], who, where, flags)
            for head in self.options.heads
        ]

    async def dark_voltages(self, count: int = 8) -> dict[float, float]:
        """Return the mean voltage [V] of ``count`` readings of each head by gamma [deg]: in the dark, its offset."""
        sums = dict.fromkeys((head.gamma_deg for head in self.options.heads), 0.0)
        for _ in range(count):
            codes = {unit: await module.read_codes() for unit, module in self.modules.items()}
            for head in self.options.heads:
                sums[head.gamma_deg] += self.modules[head.unit].volts(codes[head.unit][head.channel])
        return {gamma: total / count for gamma, total in sums.items()}

    def _reading(
        self,
        head: HeadOptions,
        code: int,
        when: Span,
        who: Instrument,
        where: dict[str, float],
        flags: tuple[Flag, ...],
    ) -> Reading:
        module = self.modules[head.unit]
        value: float | None = (module.volts(code) - head.dark_v) * head.lux_per_volt
        step_v = module.options.volts_per_code / math.sqrt(12)
        uncertainty: float | None = math.hypot(
            head.uncertainty_relative * (value or 0.0),
            head.lux_per_volt * math.hypot(head.dark_uncertainty_v, step_v),
        )
        if code == SATURATED_HIGH:
            flags = (Flag.SATURATED, Flag.LOWER_BOUND, *flags)
        elif code == SATURATED_LOW:
            flags = (Flag.SATURATED, *flags)
            value = uncertainty = None
        return Reading(
            channel=f"{self.options.channel}.g{head.gamma_deg:g}",
            quantity=Quantity.ILLUMINANCE,
            value=value,
            unit=Unit.LUX,
            uncertainty=uncertainty,
            utc_ns=when.utc_ns,
            mono_ns=when.mono_ns,
            duration_s=when.duration_s,
            clock=self._clock.state(),
            instrument=who,
            flags=flags,
            raw=f"{code:04x}",
            at={"gamma_deg": head.gamma_deg, **where},
        )
