"""From an order to sessions on disk: check, connect, take the test as often as asked, close everything."""

from collections.abc import Callable, Sequence
from contextlib import AbstractAsyncContextManager
from pathlib import Path
from typing import Final

from labdaq.bench import Bench, close_all, connect_all
from labdaq.clock import NS, Clock
from labdaq.errors import RefusedError, RunError
from labdaq.headers import Order, certificates, make_header
from labdaq.instruments import Camera, place_of
from labdaq.reading import Instrument
from labdaq.recorder import Recorder, check_room
from labdaq.scheduler import Given, take_test
from labdaq.script import Script
from labdaq.steps import ClockGuard, Watch
from labdaq.stopping import Stop, StopAsked, carry_through

Mount = Callable[[], AbstractAsyncContextManager[Bench]]
"""Makes the bench, not yet connected, with the emulators it needs."""

THIRD_OF_A_STOP: Final = 2 ** (1 / 3)
"""How far a camera's shutter time may be from the one the script asks for; 1/64 s is 1/60 s, 1/90 s is not."""


async def acquire(order: Order, mount: Mount, clock: Clock, stop: Stop, watch: Watch, *, inline: bool) -> list[Path]:
    """Take the script's test ``repeats`` times; return the sessions' folders.

    ``inline`` keeps disk work in the event loop, as virtual time needs it. Raises what ended it early: `ClockError`,
    `StorageError` and `ConfigError` before anything moved, `DeviceError` or `RunError` in the test.
    """
    script, station = order.script, order.station
    ClockGuard(clock, station, script).check()
    certificates(station, order.station_file)
    check_room(order.sessions, len(script.exposures.times_s), script.exposures.photo_format)
    paths: list[Path] = []
    async with mount() as bench:
        try:
            instruments = await _connected(bench, clock, stop, script)
            exposures_s = shutter_times(bench.camera, script.exposures.times_s)
            given = Given(station, script, bench, exposures_s, clock, stop, watch)
            for number in range(script.repeats):
                if number:
                    await _pause(clock, stop, script)
                header = make_header(order, instruments, clock)
                recorder = Recorder.create(order.sessions, header, clock, inline=inline)
                paths.append(recorder.path)
                watch(header)
                try:
                    await take_test(given, recorder)
                finally:
                    await carry_through(recorder.close())
        finally:
            await carry_through(close_all(bench, clock))
    return paths


async def _connected(bench: Bench, clock: Clock, stop: Stop, script: Script) -> tuple[Instrument, ...]:
    try:
        return await stop.or_else(connect_all(bench, clock, script.limits.connect_s))
    except StopAsked:
        raise RunError(f"stopped by {stop.reason} while connecting; nothing was recorded") from None


async def _pause(clock: Clock, stop: Stop, script: Script) -> None:
    try:
        await stop.until(clock, clock.mono_ns() + round(script.pause_s * NS))
    except StopAsked:
        raise RunError(f"stopped by {stop.reason} between two tests of {script.test}") from None


def shutter_times(camera: Camera, wanted_s: Sequence[float]) -> tuple[float, ...]:
    """The camera's own shutter times nearest to those asked for [s].

    Raises `RefusedError` naming all that the camera does not have (within a third of a stop), or has only once.
    """
    own = sorted(camera.exposures_s)
    if not own:
        raise RefusedError(
            "this camera does not let its shutter time be set, so it cannot take a bracket",
            place=place_of(camera),
            hint="turn its mode dial to M; some cameras have no such control over PTP at all",
        )
    nearest = [min(own, key=lambda s: max(s / t, t / s)) for t in wanted_s]
    far = [t for t, s in zip(wanted_s, nearest, strict=True) if max(s / t, t / s) > THIRD_OF_A_STOP]
    far += [t for k, t in enumerate(wanted_s) if nearest[k] in nearest[:k] and t not in far]
    if far:
        raise RefusedError(
            f"this camera has no shutter times of its own for {', '.join(f'{t:g} s' for t in far)}",
            place=place_of(camera),
            hint=f"it has {', '.join(f'{s:g}' for s in own)} s; correct [exposures] times_s",
        )
    return tuple(nearest)
