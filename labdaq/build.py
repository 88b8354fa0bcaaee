"""Build a station: a driver for each instrument, on its real port or on an emulator's line."""

import contextlib
from collections.abc import AsyncIterator
from typing import Final

import drivers.camera
import drivers.cl200
import drivers.goniophotometer
import drivers.ls110
from drivers import ports
from drivers.goniophotometer.codec import Framing
from drivers.serial_port import SerialSettings
from drivers.transport import PipeTransport, Transport
from labdaq import equipment
from labdaq.acquisition import Mount
from labdaq.adapters import BenchArm, BenchCamera
from labdaq.bench import Bench
from labdaq.clock import Clock
from labdaq.emulation import Alter, Emulators, Reached, emulators, traced_ahead
from labdaq.errors import ConfigError, Problems
from labdaq.ports import PortKind, port_kind
from labdaq.station import Station
from simulators.world.observed import World

COUNTS_PER_DEGREE: Final = 10_000 / 360.0


def mount(
    station: Station,
    clock: Clock,
    memory: bool,
    *,
    raw: bool = False,
    world: World | None = None,
    alter: Alter | None = None,
) -> Mount:
    """Make what builds the station's bench, with an emulator behind each port that says ``emulated``.

    ``memory``: emulators' lines are of memory, as virtual time needs them. ``raw``: the emulated camera is set to RAW
    pictures. ``world`` is what emulators observe, by default the one of the station's ``[emulation]``; ``alter``
    changes the emulators' options. Raises `ConfigError` when the station lacks an instrument that a test needs.
    """
    _refuse_what_is_missing(station)

    @contextlib.asynccontextmanager
    async def mounted() -> AsyncIterator[Bench]:
        if not any(e.emulated for e in station.instrument):
            yield bench_on(station, clock, Emulators())
            return
        from labdaq.worlds import world_of

        seen = world or world_of(station)
        async with contextlib.AsyncExitStack() as stack:
            if not memory:
                await stack.enter_async_context(traced_ahead(seen, clock))
            running = await stack.enter_async_context(
                emulators(station, seen, clock, memory=memory, raw=raw, alter=alter)
            )
            yield bench_on(station, clock, running)

    return mounted


def _refuse_what_is_missing(station: Station) -> None:
    problems = Problems(f"station '{station.name}'")
    for kind, needed in (
        ("camera", "exactly one"),
        ("goniophotometer", "exactly one"),
        ("ls110", "one"),
        ("cl200", "one"),
    ):
        count = len(station.of_kind(kind))
        if count == 0 or (count > 1 and needed == "exactly one"):
            problems.add("instrument", f"a test needs {needed} of kind {kind}, there are {count}")
    problems.raise_if_any(ConfigError, "correct the station file; docs/formats.md describes its instruments")


def bench_on(station: Station, clock: Clock, running: Emulators) -> Bench:
    """Make a driver for each of the station's instruments; nothing is opened yet."""
    luminance, chroma = [], []
    for entry in station.instrument:
        reached = running.reached.get(entry.name) or Reached(entry.port)
        match entry:
            case equipment.Ls110():
                luminance.append(_luminance_meter(entry, reached, clock))
            case equipment.Cl200():
                chroma.append(_chroma_meter(entry, reached, clock))
            case equipment.Camera():
                camera = _camera(entry, reached, clock)
            case equipment.Goniophotometer():
                arm = _goniophotometer(entry, station, reached, clock)
    return Bench(tuple(luminance), tuple(chroma), camera, arm)


def _line(name: str, reached: Reached, settings: SerialSettings) -> Transport:
    """The line to one instrument."""
    if reached.dial is not None:
        return PipeTransport(name, reached.dial(), reached.port)
    return ports.line(name, reached.port, settings)


def _luminance_meter(entry: equipment.Ls110, reached: Reached, clock: Clock) -> drivers.ls110.LuminanceMeter:
    options = drivers.ls110.LuminanceMeterOptions(
        channel=entry.channel, serial=entry.serial, calibration=entry.calibration, response=entry.response
    )
    return drivers.ls110.LuminanceMeter(entry.name, _line(entry.name, reached, drivers.ls110.LINE), clock, options)


def _chroma_meter(entry: equipment.Cl200, reached: Reached, clock: Clock) -> drivers.cl200.ChromaMeter:
    heads = tuple(
        drivers.cl200.Head(number, channel, calibration=entry.calibration) for channel, number in entry.heads.items()
    )
    options = drivers.cl200.ChromaMeterOptions(heads=heads, serial=entry.serial)
    return drivers.cl200.ChromaMeter(entry.name, _line(entry.name, reached, drivers.cl200.LINE), clock, options)


def _camera(entry: equipment.Camera, reached: Reached, clock: Clock) -> BenchCamera:
    options = drivers.camera.CameraOptions(serial=entry.serial, calibration=entry.calibration)
    if reached.dial is not None:
        commands, events = (PipeTransport(entry.name, reached.dial(), reached.port) for _ in range(2))
        return BenchCamera(drivers.camera.Camera(entry.name, drivers.camera.PtpIp(commands, events), clock, options))
    return BenchCamera(drivers.camera.Camera(entry.name, ports.camera_link(entry.name, reached.port), clock, options))


def _goniophotometer(entry: equipment.Goniophotometer, station: Station, reached: Reached, clock: Clock) -> BenchArm:
    settings = SerialSettings(entry.baud, 8, entry.parity, 1)
    over_tcp = reached.dial is None and port_kind(reached.port) is PortKind.TCP
    arm, geometry = entry, station.goniometer
    pairs = zip(geometry.gammas_deg, geometry.sensitivities_v_per_lx, geometry.darks_v, strict=True)
    options = drivers.goniophotometer.GoniophotometerOptions(
        channel="gonio",
        serial=arm.serial,
        line=drivers.goniophotometer.LineOptions(framing=Framing.TCP if over_tcp else Framing.RTU, settings=settings),
        arm=drivers.goniophotometer.ArmOptions(
            unit=arm.motor_unit,
            settle_s=arm.settle_s,
            tolerance_counts=max(1, round(arm.tolerance_deg * COUNTS_PER_DEGREE)),
        ),
        modules=tuple(drivers.goniophotometer.ModuleOptions(unit) for unit in arm.sensor_units),
        heads=tuple(
            drivers.goniophotometer.HeadOptions(
                gamma_deg=gamma_deg,
                unit=arm.sensor_units[k // 8],
                channel=k % 8,
                lux_per_volt=1.0 / sensitivity,
                dark_v=dark_v,
                calibration=arm.calibration,
            )
            for k, (gamma_deg, sensitivity, dark_v) in enumerate(pairs)
        ),
    )
    driver = drivers.goniophotometer.Goniophotometer(entry.name, _line(entry.name, reached, settings), clock, options)
    return BenchArm(driver, entry.park_c_deg)
