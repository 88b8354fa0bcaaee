"""The arm: a Leadshine CS2RS closed-loop stepper drive (also sold as CL57RS, CLRS) on a Modbus line.

A move is one block of eight words, sent once. Whether it was obeyed is seen, not assumed: the drive must be
seen running, or to have moved, before its "done" counts, since right after the block that bit still tells of the move
before.
"""

import asyncio
from collections.abc import Awaitable
from contextlib import suppress
from dataclasses import dataclass
from typing import Final

from drivers.goniophotometer.codec import signed_pair, words_of
from drivers.goniophotometer.drive import (
    ABSOLUTE,
    ALARM,
    ALARMS,
    CONTROL,
    FEEDBACK,
    HOME,
    PATH_0,
    PULSES_PER_TURN,
    QUICK_STOP,
    RESET_ALARM,
    RUN_PATH_0,
    STATUS,
    TRIGGER,
    Status,
)
from drivers.goniophotometer.line import Line
from labdaq.clock import NS
from labdaq.errors import ConfigError, DeviceError, DeviceTimeout, Place, ProtocolError, RefusedError

_STANDSTILL_COUNTS: Final = 2
"""A closed-loop motor at rest hunts by a count or two; more is motion."""


@dataclass(frozen=True, slots=True)
class ArmOptions:
    """What the station file says about the arm.

    Attributes
    ----------
    unit
        The drive on the line.
    counts_per_turn
        Encoder counts for 360° of C; compared with the drive's own setting.
    direction
        +1 if counts grow with C, -1 if they fall.
    zero_counts
        Position at C = 0 after homing [counts].
    speed_rpm, ramp_ms
        Speed [1/min] and ramps [ms per 1000/min] of a move.
    backlash_counts
        Each target is approached from this far below [counts]; 0 approaches from either side.
    tolerance_counts, limit_counts
        Beyond the tolerance a reading is flagged ``MOVED``; beyond the limit `Arm.move_to` fails [counts].
    settle_s
        Wait after arriving, for the arm to stop swinging [s].
    poll_s, start_s, margin_s, home_s
        How often the state is read; longest wait for the first motion; what is granted to a move beyond its
        computed time; longest homing [s].
    """

    unit: int = 1
    counts_per_turn: int = 10_000
    direction: int = 1
    zero_counts: int = 0
    speed_rpm: int = 2
    ramp_ms: int = 20_000
    backlash_counts: int = 25
    tolerance_counts: int = 5
    limit_counts: int = 50
    settle_s: float = 0.5
    poll_s: float = 0.1
    start_s: float = 1.0
    margin_s: float = 5.0
    home_s: float = 120.0

    def __post_init__(self) -> None:
        if self.direction not in {1, -1}:
            raise ConfigError(f"the arm's direction is {self.direction}; it must be 1 or -1")
        if self.speed_rpm < 1 or self.counts_per_turn < 1:
            raise ConfigError("the arm's speed_rpm and counts_per_turn must be at least 1")

    def counts_of(self, c_deg: float) -> int:
        """Position [counts] of a C angle [deg]; 22.5° are exactly 625 counts of 10 000."""
        return self.zero_counts + self.direction * round(c_deg * self.counts_per_turn / 360.0)

    def degrees_of(self, counts: int) -> float:
        """C angle [deg] of a position [counts]."""
        return self.direction * (counts - self.zero_counts) * 360.0 / self.counts_per_turn


class Arm:
    """The arm on its line.

    Attributes
    ----------
    sent_to
        Where the arm was last sent and arrived [counts]; ``None`` before.
    """

    def __init__(self, line: Line, options: ArmOptions | None = None) -> None:
        self.options: Final = options or ArmOptions()
        self.sent_to: int | None = None
        self._line = line
        self._clock = line.clock

    @property
    def place(self) -> Place:
        """Where the drive is reached."""
        return self._line.place(self.options.unit)

    async def connect(self) -> None:
        """Check alarm, enabling and resolution of the drive; moves nothing.

        Raises `RefusedError` when the drive cannot move, and the line's errors.
        """
        self.sent_to = None
        status = await self.status()
        await self._refuse_fault(status)
        if Status.ENABLED not in status:
            raise self._refusal("the motor is not enabled", "check the enable input, or set Pr0.07 to 1")
        (pulses,) = await self._line.read_words(self.options.unit, PULSES_PER_TURN, 1)
        if pulses != self.options.counts_per_turn:
            raise self._refusal(
                f"the drive counts {pulses} a turn (Pr0.00), the station file says {self.options.counts_per_turn}",
                "set Pr0.00 in the drive, or counts_per_turn in the station file, to what is true",
            )

    async def status(self) -> Status:
        """Read the motion status."""
        (word,) = await self._line.read_words(self.options.unit, STATUS, 1)
        return Status(word)

    async def position(self) -> int:
        """Read the feedback position [counts]."""
        high, low = await self._line.read_words(self.options.unit, FEEDBACK, 2)
        return signed_pair(high, low)

    async def reset_alarm(self) -> None:
        """Reset the present alarm; the arm has to be homed afterwards if the drive lost its position."""
        await self._line.write_word(self.options.unit, CONTROL, RESET_ALARM)

    async def stop(self) -> None:
        """Stop quickly."""
        await self._line.write_word(self.options.unit, TRIGGER, QUICK_STOP)

    async def home(self) -> None:
        """Find the reference position, once per power-up; returns at once when the drive knows it.

        Raises `DeviceTimeout` after a quick stop when it takes too long, `RefusedError` for an alarm.
        """
        status = await self.status()
        await self._refuse_fault(status)
        if Status.HOMED in status:
            return
        self.sent_to = None
        await self._guarded(self._home(await self.position()))

    async def move_to(self, c_deg: float) -> float:
        """Turn to a C angle [deg, 0 to 360], settle, and return where the feedback says the arm is [deg].

        Raises `ConfigError` for another angle; `RefusedError` when not homed, for an alarm, or when the arm stopped
        farther away than the limit; `DeviceTimeout` after a quick stop when it does not start or arrive in time; and
        the line's errors.
        """
        if not 0.0 <= c_deg <= 360.0:
            raise ConfigError(f"the arm turns to C angles from 0 to 360 degrees, not to {c_deg:g}")
        o, target = self.options, self.options.counts_of(c_deg)
        status = await self.status()
        await self._refuse_fault(status)
        if Status.HOMED not in status:
            raise self._refusal("the arm was not homed since the drive was switched on", "home it first")
        at = await self.position()
        if self.sent_to != target or abs(at - target) > o.tolerance_counts:
            self.sent_to = None
            below = target - o.backlash_counts
            if o.backlash_counts and at > below + o.tolerance_counts:
                await self._guarded(self._go(at, below))
                at = await self.position()
            await self._guarded(self._go(at, target))
            await self._clock.sleep(o.settle_s)
            at = await self.position()
        if abs(at - target) > o.limit_counts:
            raise self._refusal(
                f"the arm stopped at {o.degrees_of(at):.2f} degrees instead of {o.degrees_of(target):.2f}",
                "look for what holds it, then home it",
            )
        self.sent_to = target
        return o.degrees_of(at)

    # One motion

    async def _guarded(self, motion: Awaitable[None]) -> None:
        """Run a motion; whatever ends it early (also a cancelled task) stops the arm."""
        try:
            await motion
        except (DeviceError, asyncio.CancelledError) as error:
            try:
                await self.stop()
            except DeviceError as unheard:
                if isinstance(error, DeviceError):
                    error.hint += "; the quick stop was not acknowledged: use the emergency stop if the arm moves"
                    error.add_note(str(unheard))
            raise

    async def _home(self, before: int) -> None:
        await self._send_once(self._line.write_word(self.options.unit, TRIGGER, HOME), before, None)
        began_ns = self._clock.mono_ns()
        while True:
            waited_s = self._since_s(began_ns)
            status = await self.status()
            await self._refuse_fault(status)
            if Status.HOMED in status and Status.RUNNING not in status:
                return
            self._within(self.options.home_s, waited_s, f"the arm found no reference position (status {status:#06x})")
            await self._clock.sleep(self.options.poll_s)

    async def _go(self, before: int, target: int) -> None:
        """Send one block and wait until the drive has moved and is done."""
        o = self.options
        block = [ABSOLUTE, *words_of(target), o.speed_rpm, o.ramp_ms, o.ramp_ms, 0, RUN_PATH_0]
        await self._send_once(self._line.write_words(o.unit, PATH_0, block), before, target)
        began_ns = self._clock.mono_ns()
        longest_s = o.margin_s + self._duration_s(target - before)
        moved = False
        while True:
            waited_s = self._since_s(began_ns)  # until this look; the look itself may take long on a bad line
            at = await self.position()  # before the status, which may be older than the first motion otherwise
            status = await self.status()
            await self._refuse_fault(status)
            running = Status.RUNNING in status
            moved = moved or running or abs(at - before) > _STANDSTILL_COUNTS
            near = abs(at - target) <= o.tolerance_counts
            done = not running and status & (Status.COMMAND_DONE | Status.PATH_DONE)
            if done and (moved or (near and waited_s > o.start_s)):  # near: there was nothing to move
                return
            if not moved and not near:
                self._within(o.start_s, waited_s, f"the arm did not start to move (status {status:#06x})")
            self._within(longest_s, waited_s, f"the arm did not arrive, it is at {o.degrees_of(at):.2f} degrees")
            await self._clock.sleep(o.poll_s)

    async def _send_once(self, sending: Awaitable[None], before: int, target: int | None) -> None:
        """Send a trigger; if it is not acknowledged, look whether it was obeyed instead of sending it again."""
        try:
            await sending
        except (DeviceTimeout, ProtocolError):
            with suppress(DeviceError):
                status, at = await self.status(), await self.position()
                near = target is not None and abs(at - target) <= self.options.tolerance_counts
                there = near or (target is None and Status.HOMED in status)  # it was not before
                if Status.RUNNING in status or abs(at - before) > _STANDSTILL_COUNTS or there:
                    return
            raise

    def _duration_s(self, counts: int) -> float:
        """Time of a move with its ramps [s]."""
        o = self.options
        ramps_s = 2 * o.ramp_ms / 1000 * o.speed_rpm / 1000
        return abs(counts) / o.counts_per_turn * 60.0 / o.speed_rpm + ramps_s

    def _since_s(self, began_ns: int) -> float:
        return (self._clock.mono_ns() - began_ns) / NS

    def _within(self, longest_s: float, waited_s: float, what: str) -> None:
        if waited_s > longest_s:
            raise DeviceTimeout(
                f"{what}, after {longest_s:.1f} s; it was stopped",
                place=self.place,
                hint="look for what holds it, check the drive's enabling, then home it",
            )

    async def _refuse_fault(self, status: Status) -> None:
        if Status.FAULT not in status:
            return
        (code,) = await self._line.read_words(self.options.unit, ALARM, 1)
        meaning = ALARMS.get(code, "see the drive's manual")
        raise self._refusal(f"alarm 0x{code:03X}: {meaning}", "remove the cause, reset the alarm, home the arm")

    def _refusal(self, what: str, hint: str) -> RefusedError:
        return RefusedError(what, place=self.place, hint=hint)
