"""The command line: one module per command, imported only when it is used."""

import sys
from importlib import import_module
from typing import Final

import click

import labdaq
from labdaq.errors import LabdaqError
from labdaq.rooms import check_rooms

COMMANDS: Final[dict[str, str]] = {
    "demo": "Watch the whole of it on the emulated station.",
    "doctor": "Look at every instrument, the clock and the disk.",
    "emulate": "Run emulated instruments on real ports.",
    "run": "Take the test of a script.",
    "session": "List, show and verify recorded sessions.",
    "process": "Make a session's sky map and measured photometry.",
    "merge": "Merge a bracket of exposures into a luminance map.",
    "simulate": "Predict the photometry of a skylight.",
    "bsdf": "Look at, convert and make BSDF files.",
    "compare": "Put recordings beside simulations, as a case and as a report.",
    "explain": "Find where recording and simulation differ, and which physics was left out.",
    "predict": "Apply an explanation to other tests, with no new fit.",
    "mechanisms": "List what a prediction may leave out.",
    "blind-trial": "Conceal physics in many cases, and score what explain says about them.",
    "benchmark": "Pack recordings and simulations for others; verify a pack.",
}
"""Command name to the one line ``--help`` shows; the command lives in ``labdaq.cli.<name>`` as ``command``."""


class _LazyGroup(click.Group):
    """A group that knows its commands by name and imports the one it needs."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        return list(COMMANDS)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        if cmd_name not in COMMANDS:
            return None
        module = import_module(f"labdaq.cli.{cmd_name.replace('-', '_')}")
        command: click.Command = module.command
        return command

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        with formatter.section("Commands"):
            formatter.write_dl(list(COMMANDS.items()))


@click.group(cls=_LazyGroup, context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100})
@click.version_option(labdaq.__version__, prog_name="labdaq")
def cli() -> None:
    """Run a daylight laboratory: record, simulate, and explain where the two differ.

    Exit codes: 0 well; 1 a test was not finished; 64 wrong usage; 65 unreadable data; 69 an instrument failed;
    70 a bug or a broken engine; 74 the disk refused; 75 try later; 78 a configuration with mistakes.
    """


def main() -> None:
    """Entry point of the ``labdaq`` command: one clear error, a documented exit code, no traceback."""
    try:
        check_rooms()
        code = cli.main(standalone_mode=False)
        sys.exit(code if isinstance(code, int) else 0)
    except LabdaqError as error:
        click.echo(f"labdaq: {error}", err=True)
        sys.exit(error.exit_code)
    except click.exceptions.Abort:
        click.echo("labdaq: interrupted", err=True)
        sys.exit(1)
    except click.ClickException as error:
        error.show()
        sys.exit(64)
