"""``labdaq run``: take the tests of a script."""

import sys
from pathlib import Path

import click

from labdaq.cli.files import json_option, make_order, station_option
from labdaq.errors import LabdaqError


@click.command("run", short_help="Take the test of a script.")
@click.argument("script")
@station_option
@click.option("--sessions", type=click.Path(path_type=Path), help="Folder for the sessions, instead of the station's.")
@json_option
@click.option(
    "--time",
    "pace",
    type=click.Choice(["real", "virtual"]),
    default="real",
    help="Virtual time needs emulated instruments; a test of 150 s takes about a second.",
)
@click.option("--rate", type=click.FloatRange(min=0, min_open=True), help="Emulated seconds per real second.")
def command(
    script: str, station_file: Path | None, sessions: Path | None, as_json: bool, pace: str, rate: float | None
) -> None:
    """Take the test of SCRIPT: a file, or the name of an example that comes with labdaq (greenwood-test, short-test).

    The test is as the Greenwood report describes it: exposures of the sky with a zenith reading at each, global and
    diffuse illuminance throughout, the arm through all C-planes. Each test becomes a session on disk. Ctrl-C lets the
    steps under way end, parks the arm and seals the session; a second Ctrl-C does not wait for the steps.
    """
    from labdaq.build import mount
    from labdaq.cli.watching import bars, emit, json_lines, plain_lines
    from labdaq.runs import run

    order = make_order(script, station_file, sessions)
    if not as_json:
        with (bars if sys.stderr.isatty() else plain_lines)(order) as watch:
            paths = run(order, mount, virtual=pace == "virtual", rate=rate, watch=watch)
        for path in paths:
            click.echo(path)
        return
    started: list[str] = []
    code, message = 0, ""
    try:
        run(order, mount, virtual=pace == "virtual", rate=rate, watch=json_lines(order, started))
    except LabdaqError as error:
        code, message = error.exit_code, error.message
        raise
    finally:
        emit({"event": "result", "exit_code": code, "sessions": started, "error": message})
