"""The positioning half of a stepper drive: it moves the arm and knows what it has done, in counts, not registers."""

from dataclasses import dataclass
from enum import Enum, auto
from typing import Final

from labdaq.clock import Clock
from simulators.goniophotometer.arm import COUNTS_PER_REVOLUTION, Arm
from simulators.goniophotometer.motion import Leg, Profile, change_speed, move, stop

FAULT, ENABLED, RUNNING, COMMAND_DONE, PATH_DONE, HOMED = 0x01, 0x02, 0x04, 0x10, 0x20, 0x40
"""Bits of the motion status."""

LATENCY_NS: Final = 15 * 1_000_000
"""From accepting a trigger until the status shows it [ns]; until then it shows the previous movement's bits."""

SETTLE_NS: Final = 40 * 1_000_000
"""From the end of the commanded movement until the drive says it has arrived [ns]."""

QUICK_STOP_MS: Final = 50.0
"""Deceleration of a quick stop [ms per 1000 rpm]."""

JOG_RPM: Final = 2.0
JOG_LASTS_S: Final = 0.05

BACK_OFF_COUNTS: Final = 50
"""How far homing goes back from the mark before it comes to it slowly."""


class Phase(Enum):
    """How far the last order has come."""

    ACCEPTED = auto()
    RUNNING = auto()
    SETTLING = auto()
    DONE = auto()


@dataclass
class AxisFaults:
    """Ways for a drive to misbehave.

    Attributes
    ----------
    stuck_running
        The running bit never clears.
    stop_error_counts
        It stops this far from its target and yet says it has arrived.
    """

    stuck_running: bool = False
    stop_error_counts: int = 0


@dataclass(frozen=True, slots=True)
class Pace:
    """How fast to move: speed [rpm], acceleration and deceleration [ms per 1000 rpm]."""

    rpm: float
    acc_ms: float
    dec_ms: float

    @property
    def speed(self) -> float:
        """Speed [counts/s], at least 1 rpm's."""
        return counts_per_second(max(abs(self.rpm), 1.0))

    @property
    def rates(self) -> tuple[float, float]:
        """Acceleration and deceleration [counts/s²]."""
        return _rate(self.acc_ms), _rate(self.dec_ms)


@dataclass(frozen=True, slots=True)
class _Job:
    path: int
    ordered_ns: int
    before: int  # status bits shown until the latency is over
    homing: bool
    arrives: bool  # whether its end is a path's proper end


class Axis:
    """The drive's position control.

    Attributes
    ----------
    alarm
        Alarm code in force; 0 when there is none.
    enabled
        Whether the motor is powered.
    reversed
        Whether counts rise with C falling.
    faults
        Misbehaviour that tests switch on.
    """

    def __init__(self, arm: Arm, clock: Clock, *, enabled: bool = True) -> None:
        self.arm = arm
        self.alarm = 0
        self.enabled = enabled
        self.reversed = False
        self.faults = AxisFaults()
        self._clock = clock
        self._homed = False
        self._job: _Job | None = None
        self._zero = arm.actual(clock.mono_ns())[0]  # after power-up the position starts at 0, wherever that is

    def power_cycle(self) -> None:
        """Forget position and homing; the arm stays where it is."""
        now = self._clock.mono_ns()
        here = self.arm.actual(now)[0]
        self.arm.displace(now, here)
        self._zero, self._homed, self._job, self.alarm, self.reversed = here, False, None, 0, False

    # --- what it shows ---

    @property
    def status(self) -> int:
        """The motion status bits."""
        self._finish_homing()
        bits = (FAULT if self.alarm else 0) | (ENABLED if self.enabled and not self.alarm else 0)
        bits |= HOMED if self._homed else 0
        if self._job is None:
            return bits | COMMAND_DONE | PATH_DONE
        phase = self.phase
        if phase is Phase.ACCEPTED:
            return bits | self._job.before
        if phase is Phase.RUNNING or self.faults.stuck_running:
            return bits | RUNNING
        if phase is Phase.SETTLING:
            return bits | RUNNING | COMMAND_DONE
        return bits | COMMAND_DONE | (PATH_DONE if self._job.arrives else 0)

    @property
    def phase(self) -> Phase:
        """How far the last order has come."""
        now = self._clock.mono_ns()
        if self._job is None:
            return Phase.DONE
        if now < self._job.ordered_ns + LATENCY_NS:
            return Phase.ACCEPTED
        end_ns = self.arm.profile.end_ns
        if now < end_ns:
            return Phase.RUNNING
        return Phase.SETTLING if now < end_ns + SETTLE_NS else Phase.DONE

    @property
    def path(self) -> int:
        """Number of the path ordered last."""
        return self._job.path if self._job else 0

    def commanded(self) -> tuple[int, float]:
        """Ordered position [counts] and speed [rpm]."""
        return self._shown(self.arm.commanded(self._clock.mono_ns()))

    def actual(self) -> tuple[int, float]:
        """The encoder's position [counts] and speed [rpm]."""
        return self._shown(self.arm.actual(self._clock.mono_ns()))

    def _shown(self, motion: tuple[float, float]) -> tuple[int, float]:
        self._finish_homing()
        position, velocity = motion
        return round(self._sign * (position - self._zero)), self._sign * velocity * 60.0 / COUNTS_PER_REVOLUTION

    @property
    def _sign(self) -> int:
        return -1 if self.reversed else 1

    # --- what it does ---

    def go(self, counts: int, pace: Pace, *, relative: bool, limits: tuple[int, int] | None, path: int) -> None:
        """Go to a position, or by a distance; beyond ``limits`` it stops there and the path stays incomplete."""
        if not self._able:
            return
        begin_ns, position, velocity = self._ahead()
        wanted = counts + (round(self._sign * (position - self._zero)) if relative else 0)
        allowed = max(limits[0], min(limits[1], wanted)) if limits else wanted
        target = self._zero + self._sign * (allowed + self.faults.stop_error_counts)
        self._order(
            begin_ns, move(position, velocity, target, pace.speed, *pace.rates), path=path, arrives=allowed == wanted
        )

    def spin(self, pace: Pace, path: int) -> None:
        """Turn at a speed until told otherwise."""
        if not self._able:
            return
        begin_ns, position, velocity = self._ahead()
        turn = self._sign * counts_per_second(pace.rpm)
        legs = change_speed(position, velocity, turn, *pace.rates)
        at = legs[-1].end[0] if legs else position
        self._order(begin_ns, [*legs, Leg(float("inf"), at, turn, 0.0)], path=path)

    def jog(self, direction: int) -> None:
        """Turn for 50 ms; asked again in time, turn on."""
        if not self._able:
            return
        now = self._clock.mono_ns()
        position, velocity = self.arm.commanded(now)
        turn, rate = self._sign * direction * counts_per_second(JOG_RPM), _rate(QUICK_STOP_MS)
        legs = change_speed(position, velocity, turn, rate, rate)
        at = legs[-1].end[0] if legs else position
        legs.append(Leg(JOG_LASTS_S, at, turn, 0.0))
        self._order(now, legs + stop(legs[-1].end[0], turn, rate), arrives=False)

    def quick_stop(self) -> None:
        """Come to rest as fast as may be; no path is completed by that."""
        now = self._clock.mono_ns()
        position, velocity = self.arm.commanded(now)
        if velocity or self.phase is Phase.ACCEPTED:
            self._order(now, stop(position, velocity, _rate(QUICK_STOP_MS)), path=self.path, arrives=False)

    def raise_alarm(self, code: int) -> None:
        """Stop and show an alarm until it is reset."""
        self.quick_stop()
        self.alarm = code

    def zero_here(self) -> None:
        """Call the present position 0; that is not homing."""
        self._zero = self.arm.actual(self._clock.mono_ns())[0]

    def home(self, forward: bool, fast: Pace, slow_rpm: float) -> None:
        """Search the mark at C = 0 fast, back off, and come to it again slowly; position 0 is there."""
        if not self._able:
            return
        begin_ns, position, velocity = self._ahead()
        legs = stop(position, velocity, _rate(QUICK_STOP_MS))
        position = legs[-1].end[0]
        way = self._sign * (1 if forward else -1)
        to_go = -position % COUNTS_PER_REVOLUTION if way > 0 else -(position % COUNTS_PER_REVOLUTION)
        mark = round(position + to_go)
        slow = Pace(slow_rpm, fast.acc_ms, fast.dec_ms)
        for target, pace in ((mark, fast), (mark - BACK_OFF_COUNTS * way, slow), (mark, slow)):
            legs += move(legs[-1].end[0], 0.0, target, pace.speed, *pace.rates)
        self._homed = False
        self._order(begin_ns, legs, homing=True)

    @property
    def _able(self) -> bool:
        return self.enabled and not self.alarm

    def _ahead(self) -> tuple[int, float, float]:
        """When an order given now takes effect, and where and how fast the arm will be then."""
        begin_ns = self._clock.mono_ns() + LATENCY_NS
        return (begin_ns, *self.arm.commanded(begin_ns))

    def _order(
        self, begin_ns: int, legs: list[Leg], *, path: int = 0, homing: bool = False, arrives: bool = True
    ) -> None:
        before = self.status & (RUNNING | COMMAND_DONE | PATH_DONE)
        self._job = _Job(path, self._clock.mono_ns(), before, homing, arrives)
        self.arm.order(Profile(begin_ns, tuple(legs)))

    def _finish_homing(self) -> None:
        if self._job is not None and self._job.homing and not self._homed and self.phase is Phase.DONE:
            self._zero = self.arm.commanded(self._clock.mono_ns())[0]
            self._homed = True


def counts_per_second(rpm: float) -> float:
    """Counts per second of a speed in rpm."""
    return rpm * COUNTS_PER_REVOLUTION / 60.0


def _rate(milliseconds: float) -> float:
    """Counts/s² of an acceleration given as milliseconds per 1000 rpm."""
    return counts_per_second(1000.0) / (max(milliseconds, 1.0) / 1e3)
