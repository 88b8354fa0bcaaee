"""Start the emulators that a station file asks for, and say how each is reached.

All of them observe one world at one clock. Their lines are pseudo-terminals and TCP ports, or memory where time is
virtual; the bytes on them are the same.
"""

import asyncio
import contextlib
from collections.abc import AsyncIterator, Callable, Coroutine
from dataclasses import dataclass, field
from typing import Any, Final, Protocol, runtime_checkable

import simulators.camera
import simulators.cl200
import simulators.goniophotometer
import simulators.ls110
from labdaq import equipment
from labdaq.clock import NS, Clock
from labdaq.errors import ConfigError, Problems
from labdaq.pipe import PipeEnd
from labdaq.station import Station
from simulators.line import MemoryPort, Port, Wire, open_pty, open_tcp
from simulators.world.observed import World

Serve = Callable[[Wire], Coroutine[Any, Any, None]]


TRANSIMPEDANCE_OHM: Final = 1.0e6
"""Of the emulated heads' amplifiers; the station file knows only the product with the heads' sensitivity. With the
usual 0.3 nA/lx that is 0.3 mV/lx: ±10 V reach to 33 klx, more than a skylight gives under any sun."""

AHEAD_S: Final = 600.0
"""How far ahead of the clock `traced_ahead` looks [s]."""

Alter = Callable[[equipment.AnyInstrument, Any], Any]
"""Given an instrument of the station and its emulator's options, returns the options to use: where something about an
instrument is concealed, e.g. a crooked arm, it goes in here."""


@dataclass
class Reached:
    """Where one emulator is reached: at a port that drivers know, or by dialling a line in memory."""

    port: str = ""
    dial: Callable[[], PipeEnd] | None = None


@dataclass
class Emulators:
    """The emulators of a station that run now.

    Attributes
    ----------
    reached
        Name in the station file to where the emulator is.
    parts
        Name to the emulator itself, for tests to spoil.
    """

    reached: dict[str, Reached] = field(default_factory=dict)
    parts: dict[str, Any] = field(default_factory=dict)


@contextlib.asynccontextmanager
async def emulators(
    station: Station, world: World, clock: Clock, *, memory: bool, raw: bool = False, alter: Alter | None = None
) -> AsyncIterator[Emulators]:
    """Run an emulator for each instrument of the station whose port says so, until the context ends.

    ``raw``: the camera is set to RAW pictures. ``alter`` changes the emulators' options. Raises `ConfigError` for what
    the emulators cannot imitate, and on leaving whatever went wrong inside an emulator.
    """
    _refuse_what_cannot_be(station, raw)
    running = Emulators()
    pacing = station.emulation is None or station.emulation.pacing
    async with contextlib.AsyncExitStack() as stack:
        for number, entry in enumerate(e for e in station.instrument if e.emulated):
            seed = (station.emulation.seed if station.emulation else 0) * 1000 + number
            options = _options(entry, station, raw=raw)
            options = alter(entry, options) if alter else options
            part, serve = _emulator(options, world, clock, seed, pacing=pacing)
            running.parts[entry.name] = part
            if memory:
                line = MemoryPort(serve, f"memory:{entry.name}")
                reached = Reached(line.endpoint, line.dial)
                port: Port = line
            elif isinstance(entry, equipment.Camera):
                port = await open_tcp(serve)
                reached = Reached(f"ptpip://{port.endpoint}")
            else:
                port = open_pty(serve)
                reached = Reached(port.endpoint)
            stack.push_async_callback(port.aclose)
            running.reached[entry.name] = reached
        yield running


@runtime_checkable
class Foresighted(Protocol):
    """A world that can work out beforehand what it will be asked for."""

    def prepare(self, first_utc_ns: int, last_utc_ns: int) -> None:
        """Do the work for the time between two instants; may be called in a thread."""
        ...


@contextlib.asynccontextmanager
async def traced_ahead(world: object, clock: Clock) -> AsyncIterator[None]:
    """While the context lasts, let a world trace its light some minutes before instruments ask for it.

    Tracing takes seconds, and real ports must be answered in time. It is done in a thread; what the first minute needs
    is done before the context begins. Not for virtual time.
    """
    if not isinstance(world, Foresighted):
        yield
        return

    async def ahead() -> None:
        while True:
            await clock.sleep(AHEAD_S / 10.0)
            await look(AHEAD_S)

    async def look(seconds: float) -> None:
        now_ns = clock.utc_ns()
        await asyncio.to_thread(world.prepare, now_ns, now_ns + round(seconds * NS))

    await look(AHEAD_S / 10.0)
    task = asyncio.create_task(ahead())
    try:
        yield
    finally:
        task.cancel()
        with contextlib.suppress(asyncio.CancelledError):
            await task


def _options(entry: equipment.AnyInstrument, station: Station, *, raw: bool) -> Any:
    """How the emulator of an instrument is set up, as the station has it."""
    disc_deg = station.shading_disc.half_angle_deg
    match entry:
        case equipment.Ls110():
            return simulators.ls110.LuminanceMeterOptions()
        case equipment.Cl200():
            heads = tuple(
                simulators.cl200.Head(number, simulators.cl200.LevelHead(disc_deg if channel in entry.shaded else 0.0))
                for channel, number in entry.heads.items()
            )
            return simulators.cl200.ChromaMeterOptions(heads=heads)
        case equipment.Camera():
            optics = simulators.camera.Optics(disc=simulators.camera.ShadingDisc(half_angle_deg=disc_deg))
            return simulators.camera.CameraOptions(
                profile=entry.profile, picture="raw" if raw else "jpeg", optics=optics
            )
        case equipment.Goniophotometer():
            return _arm(entry, station)


def _emulator(options: Any, world: World, clock: Clock, seed: int, *, pacing: bool) -> tuple[Any, Serve]:
    """One emulator, and its end of any line."""
    match options:
        case simulators.ls110.LuminanceMeterOptions():
            spot = simulators.ls110.LuminanceMeter(world, clock, options, seed)
            return spot, simulators.ls110.LuminanceMeterWire(spot, clock, pacing=pacing).serve
        case simulators.cl200.ChromaMeterOptions():
            chroma = simulators.cl200.ChromaMeter(world, clock, options, seed)
            return chroma, simulators.cl200.ChromaMeterWire(chroma, clock, pacing=pacing).serve
        case simulators.camera.CameraOptions():
            camera = simulators.camera.Camera(world, clock, options, seed)
            return camera, simulators.camera.PtpIpFront(camera, clock).serve
        case simulators.goniophotometer.GoniophotometerOptions():
            arm = simulators.goniophotometer.Goniophotometer(world, clock, options, seed, pacing=pacing)
            return arm, arm.rtu.serve
    raise TypeError(f"no emulator takes {type(options).__name__}")


def _arm(entry: equipment.Goniophotometer, station: Station) -> simulators.goniophotometer.GoniophotometerOptions:
    """An arm whose heads are as the station's certificates have them."""
    geometry = station.goniometer
    return simulators.goniophotometer.GoniophotometerOptions(
        gammas_deg=geometry.gammas_deg,
        motor_unit=entry.motor_unit,
        sensor_units=entry.sensor_units,
        baud=entry.baud,
        parity=entry.parity,
        chain=simulators.goniophotometer.SensorChain(
            sensitivity_a_per_lx=tuple(s / TRANSIMPEDANCE_OHM for s in geometry.sensitivities_v_per_lx),
            transimpedance_ohm=TRANSIMPEDANCE_OHM,
            offset_v=geometry.darks_v,
        ),
    )


def _refuse_what_cannot_be(station: Station, raw: bool) -> None:
    problems = Problems(f"station '{station.name}'")
    for entry in (e for e in station.instrument if e.emulated):
        if isinstance(entry, equipment.Camera) and raw and entry.profile == "coolpix5400":
            problems.add(f"instrument[{entry.name}]", "an emulated coolpix5400 has no RAW pictures")
    problems.raise_if_any(ConfigError)
