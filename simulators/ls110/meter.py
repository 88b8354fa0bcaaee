"""The luminance meter itself: modes, memory and measuring. It knows the world, not the bytes."""

import math
from dataclasses import dataclass
from enum import Enum, auto

import numpy as np

from labdaq.clock import Clock
from labdaq.units import CD_M2_PER_FOOTLAMBERT
from simulators.ls110.optics import MeterOptics
from simulators.ls110.options import LuminanceMeterOptions
from simulators.world.observed import World


class Trouble(Exception):
    """Why the meter cannot give a value."""

    class Kind(Enum):
        """The meter's own errors."""

        PARAMETER = auto()
        RANGE_OVER = auto()
        MEMORY = auto()
        DISPLAY_OVER = auto()
        BATTERY = auto()

    def __init__(self, kind: Kind) -> None:
        super().__init__(kind.name)
        self.kind = kind


def four_digits(value: float, finest: float = 0.01) -> str:
    """The number on a four-digit display: at most four significant digits, no step below ``finest``."""
    step = finest
    while round(value / step) > 9999:
        step *= 10.0
    return f"{round(value / step) * step:.{max(0, -round(math.log10(step)))}f}"


@dataclass(frozen=True, slots=True)
class Held:
    """What the display holds after a measurement.

    Attributes
    ----------
    number
        The digits shown.
    unit
        ``c`` cd/m², ``f`` fL, ``%`` percent of the reference.
    calibration
        ``P`` preset, ``L`` user calibrated, ``K`` colour corrected, ``T`` both.
    peak
        Whether it is a peak reading.
    """

    number: str
    unit: str
    calibration: str
    peak: bool


class LuminanceMeter:
    """An LS-110 on its tripod.

    What the manual leaves open is decided so: the user-calibration reference scales readings by reference over the
    factory-calibrated value held when it was written; clearing the memory empties both references, sets the colour
    correction to 1 and selects the factory calibration; before the first measurement the display shows zero.
    """

    def __init__(self, world: World, clock: Clock, options: LuminanceMeterOptions, seed: int = 0) -> None:
        self.options = options
        self.remote_mode = options.remote_mode
        self._clock = clock
        self._optics = MeterOptics(
            world,
            altitude_deg=options.altitude_deg,
            azimuth_deg=options.azimuth_deg,
            field_deg=options.model.field_deg,
            response=options.response,
        )
        self._noise = np.random.default_rng([seed, 110])
        self._use_ccf = self._use_lumi = self._percent = self._slow = self._peak = False
        self._ccf, self._lumi_factor = 1.0, 0.0
        self._percent_reference = self._lumi_reference = 0.0
        self._luminance: float | None = None  # factory-calibrated, cd/m²
        self._held: Held | Trouble = Held(four_digits(0.0, options.model.finest), self.unit, "P", peak=False)

    @property
    def unit(self) -> str:
        """Letter of the unit switch: ``c`` or ``f``."""
        return "f" if self.options.footlamberts else "c"

    def set_mode(self, mode: int) -> None:
        """Set one of the modes 0-9; raises `Trouble` beyond."""
        match mode:
            case 0 | 1 | 2 | 3:
                self._use_ccf, self._use_lumi = mode in (1, 3), mode in (2, 3)
            case 4 | 5:
                self._percent = mode == 5
            case 6 | 7:
                self._slow = mode == 7
            case 8 | 9:
                self._peak = mode == 8
            case _:
                raise Trouble(Trouble.Kind.PARAMETER)

    async def measure(self) -> Held:
        """Take one measurement in the present mode, which takes the time it takes; raises `Trouble`."""
        if self.options.battery_exhausted:
            raise Trouble(Trouble.Kind.BATTERY)
        first = self._luminance is None
        integration_s = 0.4 if self._slow else 0.1
        total_s = float(self._noise.uniform(1.4, 1.6) if self._slow else self._noise.uniform(0.8, 1.0))
        await self._clock.sleep(integration_s / 2)
        seen = self._optics.luminance(self._clock.utc_ns())
        remaining_s = total_s - integration_s / 2
        if self._peak:
            for _ in range(3):
                await self._clock.sleep(remaining_s / 3)
                seen = max(seen, self._optics.luminance(self._clock.utc_ns()))
        else:
            await self._clock.sleep(remaining_s)
        noise = 1.0 + self.options.repeatability / 2 * float(self._noise.standard_normal())
        self._luminance = seen * noise
        if first and self.options.leaves_remote_mode_in_the_dark and self._luminance < 0.1:
            self.remote_mode = False
        try:
            self._held = self._shown(self._luminance)
        except Trouble as trouble:
            self._held = trouble
            raise
        return self._held

    def held(self) -> Held:
        """What the last measurement gave; raises its `Trouble` again if it failed."""
        if isinstance(self._held, Trouble):
            raise Trouble(self._held.kind)
        return self._held

    def clear(self) -> None:
        """Clear the memory."""
        self._ccf, self._lumi_factor = 1.0, 0.0
        self._percent_reference = self._lumi_reference = 0.0
        self._use_ccf = self._use_lumi = False

    def _shown(self, luminance: float) -> Held:
        model = self.options.model
        if luminance > (model.slow_limit_cd_m2 if self._slow else model.fast_limit_cd_m2) * (1 + 5e-5):
            raise Trouble(Trouble.Kind.RANGE_OVER)
        value = self._calibrated(luminance)
        if self._percent:
            if self._percent_reference <= 0:
                raise Trouble(Trouble.Kind.MEMORY)
            value *= 100.0 / self._percent_reference
        number = four_digits(value, model.finest)
        if float(number) > model.display_limit:
            raise Trouble(Trouble.Kind.DISPLAY_OVER)
        letter = {(False, False): "P", (False, True): "L", (True, False): "K", (True, True): "T"}
        calibration = letter[self._use_ccf, self._use_lumi]
        return Held(number, "%" if self._percent else self.unit, calibration, self._peak)

    def _calibrated(self, luminance: float) -> float:
        """In the meter's unit, with the calibrations in force."""
        if self._use_ccf:
            luminance *= self._ccf
        if self._use_lumi:
            if self._lumi_factor <= 0:
                raise Trouble(Trouble.Kind.MEMORY)
            luminance *= self._lumi_factor
        return luminance / CD_M2_PER_FOOTLAMBERT if self.options.footlamberts else luminance

    # --- memory ---

    @property
    def percent_reference(self) -> str:
        """The 100 % reference as displayed, in the meter's unit."""
        return four_digits(self._percent_reference, self.options.model.finest)

    def store_percent_reference(self, value: float | None = None) -> None:
        """Write the 100 % reference, or with ``None`` take the luminance measured last; raises `Trouble`."""
        if value is None:
            if self._luminance is None:
                raise Trouble(Trouble.Kind.MEMORY)
            value = self._calibrated(self._luminance)
        self._percent_reference = self._acceptable(value)

    @property
    def lumi_reference(self) -> str:
        """The user-calibration reference as displayed, in the meter's unit."""
        return four_digits(self._lumi_reference, self.options.model.finest)

    def store_lumi_reference(self, value: float) -> None:
        """Declare what the value measured last should have been; raises `Trouble`."""
        if not self._luminance:
            raise Trouble(Trouble.Kind.MEMORY)
        self._lumi_reference = self._acceptable(value)
        in_cd_m2 = self._lumi_reference * (CD_M2_PER_FOOTLAMBERT if self.options.footlamberts else 1.0)
        self._lumi_factor = in_cd_m2 / self._luminance

    @property
    def colour_correction(self) -> str:
        """The colour correction factor, ``n.nnn``."""
        return f"{self._ccf:.3f}"

    def store_colour_correction(self, value: float) -> None:
        """Write the colour correction factor, 0.001 to 9.999; raises `Trouble`."""
        if not 0.0005 <= value < 9.9995:
            raise Trouble(Trouble.Kind.PARAMETER)
        self._ccf = round(value, 3)

    def _acceptable(self, value: float) -> float:
        rounded = float(four_digits(value, self.options.model.finest))
        if not 0 < rounded <= self.options.model.display_limit:
            raise Trouble(Trouble.Kind.PARAMETER)
        return rounded
