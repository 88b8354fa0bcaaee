"""Take one test: one task per instrument, each on an absolute grid, and an end in good order whatever happens.

The procedure is that of the Greenwood report's chapter 3. Illuminance is read from before the first exposure to after
the last step; camera and luminance meter go through the exposures, while the arm goes through the C-planes. Deadlines
are absolute, so nothing drifts; a step that starts late says by how much. A fault of any instrument, a failing disk, a
refused clock, a time limit or the operator's wish ends all tasks, parks the arm, syncs and seals the session, and
raises one error.
"""

import asyncio
import itertools
from collections.abc import Sequence
from dataclasses import dataclass

from labdaq.bench import Bench
from labdaq.clock import NS, Clock
from labdaq.errors import LabdaqError, RunError, StorageError
from labdaq.instruments import ChromaMeter, LuminanceMeter, Photo, place_of
from labdaq.reading import Reading
from labdaq.recorder import Recorder
from labdaq.records import Ended
from labdaq.script import Script
from labdaq.station import Station
from labdaq.steps import ClockGuard, Steps, Watch
from labdaq.stopping import Stop, StopAsked, carry_through


@dataclass(frozen=True)
class Given:
    """What a test is taken with; ``bench`` is connected, ``exposures_s`` are shutter times the camera has [s]."""

    station: Station
    script: Script
    bench: Bench
    exposures_s: tuple[float, ...]
    clock: Clock
    stop: Stop
    watch: Watch


async def take_test(given: Given, recorder: Recorder) -> None:
    """Take the test into an open session, then end and seal the session in any case.

    Raises the first fault (`DeviceError`, `StorageError`, `ClockError`, `RunError`) after the arm was parked as well as
    it can be and the session was synced; cancellation is treated alike and goes on afterwards.
    """
    test = _Test(given, recorder)
    fault: BaseException | None = None
    try:
        await test.measure()
    except asyncio.CancelledError as error:
        fault = error
    except Exception as error:
        fault = test.steps.first_fault or _leaf(error)
    try:
        await carry_through(test.finish(fault))
    except StorageError as error:
        raise error from fault
    if fault is not None:
        raise fault


def _leaf(error: Exception) -> Exception:
    """The first error in a group of errors."""
    while isinstance(error, ExceptionGroup):
        error = error.exceptions[0]
    return error


class _Test:
    def __init__(self, given: Given, recorder: Recorder) -> None:
        self.given = given
        self.recorder = recorder
        guard = ClockGuard(given.clock, given.station, given.script)
        self.steps = Steps(recorder, given.clock, given.script, guard, given.watch)
        self._scans_over = asyncio.Event()
        self._parked = False

    async def measure(self) -> None:
        """Everything up to the parked arm; raises whatever ended it early, perhaps in groups."""
        await self.steps.check_clock()
        async with asyncio.TaskGroup() as group:
            impatience = group.create_task(self._impatience())
            for part in (self._home, self._in_time):
                if not self.given.stop.requested:
                    await part()
            impatience.cancel()
        if self.given.stop.requested:
            raise self._interrupted()
        await self._park_in_order()
        await self.steps.check_clock()

    async def _in_time(self) -> None:
        script, clock = self.given.script, self.given.clock
        try:
            async with clock.timeout(script.limits.test_s):
                await self._all_instruments(clock.mono_ns())
        except TimeoutError as error:
            raise RunError(
                f"test {script.test} took longer than {script.limits.test_s:g} s; last finished step: "
                f"{self.steps.last_step or 'none'}",
                "see the steps' lateness with `labdaq session show`, or raise [limits] test_s",
            ) from error

    async def _all_instruments(self, start_ns: int) -> None:
        bench, script = self.given.bench, self.given.script
        scans_ns = start_ns + round(script.illuminance.period_s * NS)
        async with asyncio.TaskGroup() as throughout:
            clock_watch = throughout.create_task(self._watch_clock(start_ns))
            for meter in bench.chroma:
                throughout.create_task(self._illuminance(meter, start_ns), name=meter.identity().name)
            async with asyncio.TaskGroup() as scans:
                scans.create_task(self._exposures(scans_ns), name=bench.camera.identity().name)
                scans.create_task(self._planes(scans_ns), name=bench.goniophotometer.identity().name)
                for spot in bench.luminance:
                    scans.create_task(self._zenith(spot, scans_ns), name=spot.identity().name)
            self._scans_over.set()
            clock_watch.cancel()

    async def _exposures(self, start_ns: int) -> None:
        camera, exposures = self.given.bench.camera, self.given.script.exposures
        raw = exposures.photo_format == "raw"
        for k, exposure_s in enumerate(self.given.exposures_s):
            due_ns = start_ns + round(k * exposures.period_s * NS)

            async def capture(exposure_s: float = exposure_s) -> Sequence[Photo]:
                return await camera.capture(exposure_s, raw)

            try:
                lateness_s = await self.given.stop.until(self.given.clock, due_ns)
            except StopAsked:
                return
            await self.steps.take(place_of(camera), f"exposure-{k:02d}", lateness_s, capture)

    async def _zenith(self, meter: LuminanceMeter, start_ns: int) -> None:
        exposures = self.given.script.exposures

        async def read() -> Sequence[Reading]:
            return [await meter.read() for _ in range(exposures.zenith_readings)]

        for k in range(len(exposures.times_s) if exposures.zenith_readings else 0):
            try:
                lateness_s = await self.given.stop.until(
                    self.given.clock, start_ns + round(k * exposures.period_s * NS)
                )
            except StopAsked:
                return
            await self.steps.take(place_of(meter), f"zenith-{k:02d}", lateness_s, read)

    async def _planes(self, start_ns: int) -> None:
        arm, scan = self.given.bench.goniophotometer, self.given.script.scan
        for k, c_deg in enumerate(scan.c_planes_deg):
            due_ns = start_ns + round(k * scan.period_s * NS) if scan.period_s or k == 0 else self.given.clock.mono_ns()

            async def read_plane(c_deg: float = c_deg) -> Sequence[Reading]:
                await arm.move_to(c_deg)
                return [reading for _ in range(scan.repeats) for reading in await arm.read()]

            try:
                lateness_s = await self.given.stop.until(self.given.clock, due_ns)
            except StopAsked:
                return
            await self.steps.take(place_of(arm), f"plane-{k:02d}", lateness_s, read_plane)

    async def _illuminance(self, meter: ChromaMeter, start_ns: int) -> None:
        """Read on every tick until the scans are over, and once more; ticks that pass meanwhile count as missed."""
        period_ns = round(self.given.script.illuminance.period_s * NS)
        tick = 0
        for number in itertools.count():
            try:
                lateness_s = await self.given.stop.until(self.given.clock, start_ns + tick * period_ns)
            except StopAsked:
                return
            last = self._scans_over.is_set()
            step = f"illuminance-{number:03d}"
            await self.steps.take(place_of(meter), step, lateness_s, meter.measure)
            if last:
                return
            coming = -((start_ns - self.given.clock.mono_ns()) // period_ns)  # the first tick that is not over yet
            if coming > tick + 1:
                self.steps.missed(place_of(meter), step, coming - tick - 1)
            tick = max(tick + 1, coming)

    async def _watch_clock(self, start_ns: int) -> None:
        period_ns = round(self.given.station.clock.check_every_s * NS)
        for tick in itertools.count(1):
            try:
                await self.given.stop.until(self.given.clock, start_ns + tick * period_ns)
            except StopAsked:
                return
            await self.steps.check_clock()

    async def _impatience(self) -> None:
        await self.given.stop.patience_is_over(self.given.clock, self.given.script.limits.grace_s)
        raise self._interrupted()

    def _interrupted(self) -> RunError:
        return RunError(
            f"test {self.given.script.test} was stopped by {self.given.stop.reason}; last finished step: "
            f"{self.steps.last_step or 'none'}",
            f"what was recorded is in {self.recorder.path}",
        )

    async def _home(self) -> None:
        arm = self.given.bench.goniophotometer

        async def home() -> Sequence[Reading]:
            await arm.home()
            return ()

        await self.steps.take(place_of(arm), "home", 0.0, home, limit_s=self.given.script.limits.home_s)

    async def _park_in_order(self) -> None:
        arm = self.given.bench.goniophotometer

        async def park() -> Sequence[Reading]:
            await arm.park()
            self._parked = True
            return ()

        await self.steps.take(place_of(arm), "park", 0.0, park, limit_s=self.given.script.limits.park_s)

    async def finish(self, fault: BaseException | None) -> None:
        """Park the arm if that was not done, and end the session; raises `StorageError` when the disk refuses."""
        arm = "parked" if self._parked else await self._park_anyway()
        if arm != "parked" and isinstance(fault, LabdaqError):
            fault.message = f"{fault.message}; the arm is NOT parked: {arm}"
        outcome = "finished" if fault is None else "failed"
        if self.given.stop.requested or isinstance(fault, asyncio.CancelledError):
            outcome = "interrupted" if self.steps.first_fault is None else outcome
        if isinstance(fault, StorageError):
            return  # the journal has ended already
        if self.steps.fault_entry is not None:
            self.recorder.post(self.steps.fault_entry)
            self.given.watch(self.steps.fault_entry)
        reason = fault.message if isinstance(fault, LabdaqError) else type(fault).__name__ if fault else ""
        end = Ended(outcome=outcome, reason=reason, arm=arm)
        await self.recorder.seal(end, self.given.clock.utc_ns())
        self.given.watch(end)

    async def _park_anyway(self) -> str:
        """Stop and park an arm in an unknown state; return ``parked``, or why it is not."""
        arm, clock, limit_s = self.given.bench.goniophotometer, self.given.clock, self.given.script.limits.park_s
        why = ""
        for action in (arm.stop, arm.park, arm.park):  # a late answer to what was cancelled may spoil the first attempt
            try:
                async with clock.timeout(limit_s):
                    await action()
            except Exception as error:
                why = str(error) or f"no end within {limit_s:g} s"
            else:
                if action == arm.park:
                    return "parked"
        return why
