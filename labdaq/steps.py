"""One step of one instrument: on time or flagged late, whole in the journal or told as a fault, never without end."""

import contextlib
import traceback
from collections.abc import Awaitable, Callable, Iterator, Sequence
from typing import TypeVar

import msgspec

from labdaq.bench import in_step
from labdaq.clock import NS, Clock
from labdaq.errors import ClockError, DeviceError, DeviceTimeout, LabdaqError, Place, RunError
from labdaq.instruments import Photo
from labdaq.reading import Flag, Reading
from labdaq.recorder import Recorder
from labdaq.records import ClockCheck, Fault, StepDone, StepMiss, StepStart, TakenReading
from labdaq.script import Script
from labdaq.station import Station

Taken = TypeVar("Taken", Reading, Photo)

Watch = Callable[[msgspec.Struct], None]
"""Is shown each journal entry's body once it is on disk."""

Action = Callable[[], Awaitable[Sequence[Reading | Photo]]]


class ClockGuard:
    """Judges the clock by what script and station ask of it."""

    def __init__(self, clock: Clock, station: Station, script: Script) -> None:
        self._clock = clock
        self._limit_s = script.clock.max_error_s or station.clock.max_error_s
        self._refuse = script.clock.require == "refuse"
        self._offset_ns: int | None = None
        self.good = False

    def check(self) -> ClockCheck:
        """Look at the clock; raises `ClockError` when the script refuses such a clock."""
        state = self._clock.state()
        bound = state.max_error_s
        self.good = state.synchronised and bound is not None and bound <= self._limit_s
        offset_ns = self._clock.utc_ns() - self._clock.mono_ns()
        stepped_s = 0.0 if self._offset_ns is None else (offset_ns - self._offset_ns) / NS
        self._offset_ns = offset_ns
        if self._refuse and not self.good and state.source == "system":
            why = "it is not synchronised" if not state.synchronised else f"it may be off by {bound} s"
            raise ClockError(
                f"the clock is not good enough for this script: {why} (allowed: {self._limit_s:g} s)",
                "start a time service (chrony) and wait for it, or let the script say [clock] require = 'flag'",
            )
        return ClockCheck(state=state, good=self.good, stepped_s=stepped_s)


class Steps:
    """Takes steps and keeps their record; remembers the first fault of a run."""

    def __init__(self, recorder: Recorder, clock: Clock, script: Script, guard: ClockGuard, watch: Watch) -> None:
        self.first_fault: LabdaqError | None = None
        self.fault_entry: Fault | None = None
        self.last_step = ""
        self._recorder = recorder
        self._clock = clock
        self._limits = script.limits
        self._guard = guard
        self._watch = watch

    async def take(
        self, place: Place, step: str, lateness_s: float, action: Action, limit_s: float | None = None
    ) -> None:
        """Let an instrument do ``action``, and put what it brings on disk before returning.

        Raises `DeviceError` naming instrument and step (`DeviceTimeout` when ``limit_s`` [s], by default the script's
        limit for steps, ends it), `StorageError`, or `RunError` for what no driver should raise.
        """
        with self.faults_of(place.instrument, step):
            began_ns = self._clock.mono_ns()
            start = StepStart(step=step, instrument=place.instrument, lateness_s=lateness_s)
            self._recorder.post(start)
            brought = await self._limited(place, action, limit_s or self._limits.step_s)
            shown: list[msgspec.Struct] = [start]
            for item in brought:
                if isinstance(item, Photo):
                    shown.append(await self._recorder.photo(self._flagged(item, lateness_s), step))
                else:
                    shown.append(TakenReading(step=step, reading=self._flagged(item, lateness_s)))
                    self._recorder.post(shown[-1])
            took_s = (self._clock.mono_ns() - began_ns) / NS
            shown.append(StepDone(step=step, instrument=place.instrument, took_s=took_s))
            self._recorder.post(shown[-1])
            await self._recorder.synced()
        self.last_step = step
        for body in shown:
            self._watch(body)

    def missed(self, place: Place, step: str, count: int) -> None:
        """Note that ``count`` ticks of a periodic reading went by."""
        miss = StepMiss(step=step, instrument=place.instrument, count=count)
        self._recorder.post(miss)
        self._watch(miss)

    async def check_clock(self) -> None:
        """Write the clock's state down; raises `ClockError` when the script refuses it."""
        with self.faults_of("", "clock"):
            check = self._guard.check()
            await self._recorder.journal.append(check)
        self._watch(check)

    @contextlib.contextmanager
    def faults_of(self, instrument: str, step: str) -> Iterator[None]:
        """Let errors say instrument and step; remember the first of the run and its journal entry."""
        try:
            yield
        except Exception as error:
            if isinstance(error, DeviceError):
                fault: LabdaqError = in_step(error, step)
            elif isinstance(error, LabdaqError):
                fault = error
            else:
                fault = RunError(f"{instrument}: unexpected {type(error).__name__}: {error}; in step {step}")
            if self.first_fault is None:
                trace = "" if fault is error else traceback.format_exc()
                self.first_fault = fault
                self.fault_entry = Fault(
                    instrument=instrument, step=step, error=type(error).__name__, message=fault.message, trace=trace
                )
            if fault is error:
                raise
            raise fault from error

    async def _limited(self, place: Place, action: Action, limit_s: float) -> Sequence[Reading | Photo]:
        try:
            async with self._clock.timeout(limit_s):
                return await action()
        except DeviceError:
            raise
        except TimeoutError as error:
            raise DeviceTimeout(
                f"did not finish within {limit_s:g} s",
                place=place,
                hint="check the instrument, or raise its time in [limits] of the script",
            ) from error

    def _flagged(self, item: Taken, lateness_s: float) -> Taken:
        doubts = []
        if lateness_s > self._limits.late_s:
            doubts.append(Flag.LATE)
        if not self._guard.good:
            doubts.append(Flag.UNSYNCHRONISED)
        new = tuple(flag for flag in doubts if flag not in item.flags)
        return msgspec.structs.replace(item, flags=item.flags + new) if new else item
