"""The chroma meter itself: hold, external mode, ranges and measuring. It knows the world, not the bytes."""

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from labdaq.clock import NS, Clock
from simulators.cl200 import colour
from simulators.cl200.heads import Head
from simulators.cl200.options import ChromaMeterOptions
from simulators.world.observed import World

Floats = NDArray[np.float64]

RANGE_ENDS_LX: Final = (99.9, 999.9, 9999.0, 99_990.0)
"""Upper ends of ranges 1 to 4. The maker does not publish them; these agree with the two readings whose range is
known (27.3 lx in range 1, 325.4 lx in range 2)."""

SHIFT_DOWN: Final = 0.8
"""A reading below this share of the next lower range's end is out of range."""

LOW_LIGHT_LX: Final = 5.0
"""Below it the chromaticity is marked inaccurate."""

HOLD_TAKES_S: Final = 0.3
"""From the hold command until hold is in force [s]. The maker tells readers to wait 0.5; a busy computer needs some."""

EXTERNAL_TAKES_S: Final = 0.17
"""From setting external mode until a trigger is obeyed [s]; the maker says 0.175 in one chapter, 0.5 in another."""

MEASURING_S: Final = 0.35
"""From the trigger's last byte until the reading is there [s]. Known readers ask exactly 0.5 s after they began to
write the trigger, which itself takes 15 ms on the line."""

IDENTITY_MATRIX: Final = ((1.0, 0.0, 0.1672), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
"""User calibration that changes nothing: rows give X, Y, Z from X2, Y, Z, and X = X2 + 0.1672 Z."""


@dataclass(frozen=True, slots=True)
class Measurement:
    """One measurement of one head.

    Attributes
    ----------
    xyz
        Tristimulus values, shape (3,); Y is the illuminance [lx]. To be thrown away when ``range`` is 0 or 6.
    error
        `` `` none, ``5`` over range, ``6`` low light, ``7`` no colour temperature, ``1``-``3`` hardware.
    range
        ``1``-``4``, ``0`` not determined, ``6`` out of range: trigger again.
    """

    xyz: Floats
    error: str
    range: str


class _HeadState:
    def __init__(self, head: Head) -> None:
        self.head = head
        self.range = 1
        self.external_since_ns: int | None = None
        self.triggered_ns: int | None = None  # a measurement that nobody has read yet
        self.obeyed = False
        self.last: Measurement | None = None
        self.matrix = [list(row) for row in IDENTITY_MATRIX]


class ChromaMeter:
    """A meter body with its heads.

    What the maker leaves open is decided so: a head in external mode shifts by one range per trigger; the number sent
    with range 6 is the end of the range it was in; a trigger sent before external mode is in force leaves the range
    undetermined.
    """

    def __init__(self, world: World, clock: Clock, options: ChromaMeterOptions, seed: int = 0) -> None:
        self.options = options
        self.battery_low = options.battery_low
        self.connected = False
        self._world = world
        self._clock = clock
        self._noise = np.random.default_rng([seed, 200])
        self._heads = {head.number: _HeadState(head) for head in options.heads}
        self._hold_since_ns: int | None = None
        self._powered_ns: int | None = None

    def switch_off_and_on(self) -> None:
        """Leave PC mode the only way there is; user calibrations stay."""
        self.connected = False
        self._hold_since_ns = None
        self._powered_ns = self._clock.mono_ns()
        for state in self._heads.values():
            state.external_since_ns = state.triggered_ns = state.last = None

    @property
    def awake(self) -> bool:
        """Whether the zero calibration after power-up is over."""
        if self._powered_ns is None:
            self._powered_ns = self._clock.mono_ns()
        return self._clock.mono_ns() - self._powered_ns >= self.options.zero_calibration_s * NS

    def has(self, number: int) -> bool:
        """Whether a head of that number is connected."""
        return number in self._heads

    def connect(self) -> None:
        """Enter PC mode."""
        self.connected = True

    def hold(self) -> None:
        """Stop the heads' free running; in force after `HOLD_TAKES_S`."""
        if self._hold_since_ns is None:
            for state in self._heads.values():
                state.last = self._free_running(state)
            self._hold_since_ns = self._clock.mono_ns()

    def set_external(self, number: int) -> str:
        """Make a head wait for triggers; return the error to report (``4``: not in hold)."""
        state = self._heads[number]
        if not self._lasting(self._hold_since_ns, HOLD_TAKES_S):
            return "4"
        if state.external_since_ns is None:
            state.external_since_ns = self._clock.mono_ns()
        return self._error(state, state.last.error if state.last else " ")

    def trigger(self) -> None:
        """Start a measurement on every head in external mode."""
        for state in self._heads.values():
            if state.external_since_ns is not None:
                self._settle(state)
                state.obeyed = self._lasting(state.external_since_ns, EXTERNAL_TAKES_S)
                state.triggered_ns = self._clock.mono_ns()

    def read(self, number: int) -> Measurement:
        """The last measurement of a head, or one with range 0 while there is none."""
        state = self._heads[number]
        if self._hold_since_ns is None:
            state.last = self._free_running(state)
        self._settle(state)
        last = state.last or Measurement(np.zeros(3), " ", "0")
        if state.triggered_ns is not None:
            last = Measurement(last.xyz, " ", "0")
        return Measurement(last.xyz, self._error(state, last.error), last.range)

    def matrix_row(self, number: int, row: int) -> list[float]:
        """One row (0-2) of a head's user-calibration matrix."""
        return self._heads[number].matrix[row]

    def set_matrix_row(self, number: int, row: int, values: list[float]) -> bool:
        """Write one row; ``False`` when a coefficient is out of range (not finite, or 100 and more)."""
        if not all(abs(value) < 100.0 for value in values):  # also false for NaN
            return False
        self._heads[number].matrix[row] = list(values)
        return True

    def user_calibrated(self, number: int, xyz: Floats) -> Floats:
        """Tristimulus values through a head's user-calibration matrix."""
        raw = np.array([xyz[0] - 0.1672 * xyz[2], xyz[1], xyz[2]])
        calibrated: Floats = np.asarray(self._heads[number].matrix) @ raw
        return calibrated

    def _lasting(self, since_ns: int | None, seconds: float) -> bool:
        return since_ns is not None and self._clock.mono_ns() - since_ns >= seconds * NS

    def _error(self, state: _HeadState, error: str) -> str:
        return state.head.error or error

    def _settle(self, state: _HeadState) -> None:
        """Finish a triggered measurement whose time is over; it saw the world in the middle of that time."""
        if not self._lasting(state.triggered_ns, MEASURING_S) or state.triggered_ns is None or not state.obeyed:
            return
        ago_ns = self._clock.mono_ns() - state.triggered_ns - round(MEASURING_S / 2 * NS)
        xyz = self._seen(state.head, self._clock.utc_ns() - ago_ns)
        state.triggered_ns = None
        end = RANGE_ENDS_LX[state.range - 1]
        shift = self._shift(state.range, float(xyz[1]))
        if shift:
            state.last = Measurement(xyz * (end / max(float(xyz[1]), 0.1)), self._judge(xyz), "6")
            state.range += shift
        else:
            state.last = Measurement(xyz, self._judge(xyz), str(state.range))

    def _shift(self, now: int, illuminance_lx: float) -> int:
        """By how many ranges a reading misses its range: -1, 0 or 1."""
        if now < 4 and illuminance_lx > RANGE_ENDS_LX[now - 1]:
            return 1
        if now > 1 and illuminance_lx < SHIFT_DOWN * RANGE_ENDS_LX[now - 2]:
            return -1
        return 0

    def _free_running(self, state: _HeadState) -> Measurement:
        """What the display shows without hold: the right range has long been found."""
        xyz = self._seen(state.head, self._clock.utc_ns())
        while shift := self._shift(state.range, float(xyz[1])):
            state.range += shift
        return Measurement(xyz, self._judge(xyz), str(state.range))

    def _judge(self, xyz: Floats) -> str:
        if xyz[1] > RANGE_ENDS_LX[-1] + 5.0:
            return "5"
        if xyz[1] < LOW_LIGHT_LX:
            return "6"
        return " " if colour.colour_temperature(colour.chromaticity(xyz)) else "7"

    def _seen(self, head: Head, utc_ns: int) -> Floats:
        """Tristimulus values (3,) of the light on a head, with the meter's noise."""
        beam, sky = head.response.illuminance(self._world, utc_ns)
        sun_altitude = self._world.sun(utc_ns).altitude_deg
        clean = colour.tristimulus(sky, colour.sky_chromaticity(sky / np.pi))
        clean = clean + colour.tristimulus(beam, colour.sun_chromaticity(sun_altitude))
        x, y = colour.chromaticity(clean)
        sx, sy, sv = self._noise.standard_normal(3)
        wobble = self.options.chromaticity_repeatability / 2
        level = max(0.0, (beam + sky) * (1.0 + self.options.repeatability / 2 * sv))
        return colour.tristimulus(level, (x + wobble * sx, y + wobble * sy))
