"""``labdaq emulate``: run emulated instruments until told to stop."""

import asyncio
import json
import signal
import sys
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Final, Literal

import click
from click.core import ParameterSource

from labdaq.clock import Clock, ScaledClock, SystemClock, utc_ns_of
from labdaq.errors import ConfigError
from labdaq.station import Station

if TYPE_CHECKING:
    from simulators.options import EmulationOptions, LineTrouble
    from simulators.world.observed import World

_PROFILES: Final = ("coolpix5400", "coolpix5700", "generic")
_SERIAL: Final = ("ls110", "cl200_global", "cl200_diffuse", "goniophotometer_rtu")
_FAULTS: Final = ("drop", "truncate", "corrupt", "late", "garbage", "disconnect", "echo")


@dataclass(frozen=True)
class Wishes:
    """What the command line asked for."""

    pacing: bool
    rate: float
    start: datetime | None
    seed: int
    serial: Literal["pty", "tcp"]
    host: str
    camera_port: int
    modbus_port: int
    profile: str
    picture: Literal["jpeg", "raw", "raw+jpeg"] | None
    faults: tuple[str, ...]


@click.command("emulate", short_help="Run emulated instruments on real ports.")
@click.option(
    "--station",
    "station_file",
    type=click.Path(path_type=Path),
    help="Station file whose emulated instruments to run, with their set-up and their world.",
)
@click.option(
    "--json", "as_json", is_flag=True, help='Say where they are in one line: {"ready": true, "endpoints": ...}.'
)
@click.option(
    "--pacing/--no-pacing",
    default=None,
    help="Serial lines at the pace of their baud rate (the default), or as fast as they go.",
)
@click.option(
    "--rate", type=click.FloatRange(min=0, min_open=True), help="Emulated seconds per real second; 1 when not given."
)
@click.option(
    "--start",
    type=click.DateTime(["%Y-%m-%dT%H:%M:%SZ", "%Y-%m-%dT%H:%M:%S"]),
    metavar="UTC",
    help="UTC at which the emulated time starts, e.g. 2010-07-22T13:12:00Z; now, when not given.",
)
@click.option("--seed", type=click.IntRange(min=0), help="Of everything random.")
@click.option(
    "--serial", type=click.Choice(["pty", "tcp"]), default="pty", help="Where serial instruments are reached."
)
@click.option("--host", default="127.0.0.1", show_default=True, help="Address to listen on.")
@click.option(
    "--camera-port", type=click.IntRange(0, 65535), default=0, help="PTP/IP port (0: any; cameras use 15740)."
)
@click.option("--modbus-port", type=click.IntRange(0, 65535), default=0, help="Modbus TCP port (0: any).")
@click.option("--camera", "profile", type=click.Choice(_PROFILES), default="coolpix5700", help="Which camera.")
@click.option("--picture", type=click.Choice(["jpeg", "raw", "raw+jpeg"]), help="Files it makes; raw where it can.")
@click.option(
    "--fault",
    "faults",
    multiple=True,
    metavar="INSTRUMENT:FAULT[:TIMES]",
    help=f"Spoil the next replies (all, without TIMES) of a serial line. Faults: {', '.join(_FAULTS)}.",
)
@click.pass_context
def command(
    context: click.Context,
    station_file: Path | None,
    as_json: bool,
    pacing: bool | None,
    rate: float | None,
    start: datetime | None,
    seed: int | None,
    serial: Literal["pty", "tcp"],
    host: str,
    camera_port: int,
    modbus_port: int,
    profile: str,
    picture: Literal["jpeg", "raw", "raw+jpeg"] | None,
    faults: tuple[str, ...],
) -> None:
    """Run all instruments of a daylight laboratory, each speaking its true wire protocol, until SIGTERM or Ctrl-C.

    Any program can talk to them: the LS-110 luminance meter and the two CL-200A chroma meters on serial lines, the
    camera over PTP/IP (give gphoto2 the port twice: ptpip:127.0.0.1:PORT:PORT), the goniophotometer over Modbus RTU and
    Modbus TCP (units 1, 2, 3). They all observe the same sky, sun and skylight.
    """
    if station_file is not None:
        _refuse_with_station(context)
        station = station_as_wished(Station.load(station_file), pacing, rate, start, seed)
        asyncio.run(_emulate_station(station, picture in ("raw", "raw+jpeg"), as_json))
        return
    wishes = Wishes(
        pacing is not False,
        rate or 1.0,
        start,
        seed or 0,
        serial,
        host,
        camera_port,
        modbus_port,
        profile,
        picture,
        faults,
    )
    options = emulation_options(wishes)
    clock: Clock = SystemClock()
    if start is not None or wishes.rate != 1.0:
        begin_ns = utc_ns_of(start.replace(tzinfo=UTC)) if start else clock.utc_ns()
        clock = ScaledClock(begin_ns, wishes.rate)
    asyncio.run(_emulate(options, clock, as_json))


def _refuse_with_station(context: click.Context) -> None:
    """Say which options the station file decides."""
    given = [
        name
        for name in ("serial", "host", "camera_port", "modbus_port", "profile", "faults")
        if context.get_parameter_source(name) is ParameterSource.COMMANDLINE
    ]
    if given:
        named = [p.opts[0] for p in context.command.params if p.name in given]
        raise ConfigError(f"{', '.join(named)} cannot go with --station: the file says what there is", "leave them out")


def station_as_wished(
    station: Station, pacing: bool | None, rate: float | None, start: datetime | None, seed: int | None
) -> Station:
    """The station with what the command line changes of its ``[emulation]``; raises `ConfigError` if it has none."""
    emulation = station.emulation
    if emulation is None or not any(e.emulated for e in station.instrument):
        raise ConfigError(
            f"station '{station.name}': no instrument is emulated",
            'give instruments port = "emulated", and the station an [emulation] table',
        )
    wished = {"pacing": pacing, "rate": rate, "start": start.replace(tzinfo=UTC) if start else None, "seed": seed}
    changed = emulation.model_copy(update={name: value for name, value in wished.items() if value is not None})
    return station.model_copy(update={"emulation": changed})


async def _emulate_station(station: Station, raw: bool, as_json: bool) -> None:
    """Run a station's emulators on real ports until a signal comes."""
    from labdaq.emulation import emulators, traced_ahead
    from labdaq.worlds import world_of

    assert station.emulation is not None
    start = station.emulation.start
    clock = ScaledClock(utc_ns_of(start) if start else SystemClock().utc_ns(), station.emulation.rate)
    world = world_of(station)
    async with traced_ahead(world, clock), emulators(station, world, clock, memory=False, raw=raw) as running:
        await _until_told({name: reached.port for name, reached in running.reached.items()}, world, clock, as_json)


async def _until_told(endpoints: dict[str, str], world: "World", clock: Clock, as_json: bool) -> None:
    """Say where the instruments are, then wait for SIGTERM or SIGINT."""
    stop = asyncio.Event()
    loop = asyncio.get_running_loop()
    for number in (signal.SIGTERM, signal.SIGINT):
        loop.add_signal_handler(number, stop.set)
    sun = world.sun(clock.utc_ns())  # also loads what the first question would wait for
    if as_json:
        _say(json.dumps({"ready": True, "endpoints": endpoints}))
    else:
        for name, endpoint in endpoints.items():
            _say(f"{name:20} {endpoint}")
        _say(f"the sun stands {sun.altitude_deg:.1f} degrees high; Ctrl-C stops")
    await stop.wait()


def emulation_options(wishes: Wishes) -> "EmulationOptions":
    """The emulated station that was asked for; raises `ConfigError` listing all that cannot be.

    This is the one place where a station is put together for this command.
    """
    from simulators.camera.options import CameraOptions
    from simulators.options import EmulationOptions

    mistakes = []
    camera = CameraOptions()
    try:
        picture = wishes.picture or ("jpeg" if wishes.profile == "coolpix5400" else "raw")
        camera = CameraOptions(profile=wishes.profile, picture=picture)
    except ValueError as error:
        mistakes.append(f"--picture: {error}")
    troubles = []
    for text in wishes.faults:
        try:
            troubles.append(_trouble(text))
        except ValueError as error:
            mistakes.append(f"--fault {text}: {error}")
    if mistakes:
        raise ConfigError("\n".join(mistakes), "labdaq emulate --help lists what there is")
    return EmulationOptions(
        pacing=wishes.pacing,
        seed=wishes.seed,
        serial=wishes.serial,
        host=wishes.host,
        camera_port=wishes.camera_port,
        modbus_port=wishes.modbus_port,
        camera=camera,
        troubles=tuple(troubles),
    )


def _trouble(text: str) -> "LineTrouble":
    """A fault as written on the command line; raises `ValueError`."""
    from simulators import line
    from simulators.options import LineTrouble

    kinds: dict[str, type[line.LineFault]] = {
        "drop": line.Drop,
        "truncate": line.Truncate,
        "corrupt": line.Corrupt,
        "late": line.Late,
        "garbage": line.Garbage,
        "disconnect": line.Disconnect,
        "echo": line.Echo,
    }
    instrument, _, rest = text.partition(":")
    kind, _, times = rest.partition(":")
    if kind not in kinds:
        raise ValueError(f"there is no fault '{kind}'")
    if times and not (times.isdecimal() and int(times) > 0):
        raise ValueError(f"'{times}' is not a number of replies")
    return LineTrouble(instrument, kinds[kind](), int(times) if times else None)


async def _emulate(options: "EmulationOptions", clock: Clock, as_json: bool) -> None:
    """Start, say where, wait for a signal, stop."""
    from labdaq.emulation import traced_ahead
    from simulators.station import EmulatedStation
    from simulators.world.emulated import EmulatedWorld

    world = EmulatedWorld()
    station = EmulatedStation(world, clock, options)
    try:
        await station.start()
    except OSError as error:
        raise ConfigError(f"cannot listen on {options.host}: {error.strerror}", "choose other ports, or 0") from error
    try:
        async with traced_ahead(world, clock):
            await _until_told(station.endpoints, world, clock, as_json)
    finally:
        await station.aclose()


def _say(text: str) -> None:
    """One line on stdout, at once; a reader that has left is no reason to stop."""
    try:
        click.echo(text)
        sys.stdout.flush()
    except BrokenPipeError:
        sys.stdout = sys.stderr
