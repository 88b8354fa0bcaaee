"""What commands have in common: find station, script and sessions, and the folders of what they write."""

from importlib.resources import files
from pathlib import Path
from typing import Final

import click

from labdaq.errors import ConfigError, StorageError
from labdaq.headers import Order
from labdaq.script import Script
from labdaq.station import Station

EXAMPLES: Final = "labdaq/examples"

station_option = click.option(
    "--station", "station_file", type=click.Path(path_type=Path), help="Station file; without it, the emulated station."
)
json_option = click.option("--json", "as_json", is_flag=True, help="One JSON object a line on stdout, nothing else.")


def read_station(file: Path | None) -> Station:
    """The station in a file, or the built-in emulated one."""
    return Station.built_in() if file is None else Station.load(file)


def sessions_folder(station: Station, file: Path | None, given: Path | None) -> Path:
    """Where sessions go: as told on the command line, else as the station says (relative to its file)."""
    if given is not None:
        return given
    return (file.parent if file else Path()) / station.sessions


def check_folder(out: Path) -> None:
    """Refuse a file to write whose folder is not there: commands ask this before they work."""
    if not out.parent.is_dir():
        raise StorageError(f"{out}: there is no folder {out.parent}", "make it first")


def find_script(name: str) -> Path:
    """A script's file; a bare name that is no file is looked for among the examples that come with labdaq."""
    path = Path(name)
    if path.exists() or path.suffix or len(path.parts) > 1:
        return path
    example = Path(str(files("labdaq").joinpath("examples", f"{name}.toml")))
    if example.exists():
        return example
    known = sorted(p.stem for p in example.parent.glob("*.toml") if not p.stem.startswith("station"))
    raise ConfigError(f"{name}: there is no such file, and no such example; examples are {', '.join(known)}")


def make_order(script: str, station_file: Path | None, sessions: Path | None) -> Order:
    """Read script and station; raises one `ConfigError` with the mistakes of both."""
    mistakes: list[ConfigError] = []
    read_script: Script | None = None
    station: Station | None = None
    try:
        script_file = find_script(script)
        read_script = Script.load(script_file)
    except ConfigError as error:
        mistakes.append(error)
    try:
        station = read_station(station_file)
    except ConfigError as error:
        mistakes.append(error)
    if station is None or read_script is None:
        raise ConfigError("\n".join(m.message for m in mistakes), mistakes[0].hint)
    folder = sessions_folder(station, station_file, sessions)
    return Order(station, read_script, folder, station_file, script_file)
