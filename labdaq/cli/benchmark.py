"""``labdaq benchmark``: pack recordings and simulations for others, and verify such a pack."""

import json
from pathlib import Path
from typing import TYPE_CHECKING

import click

if TYPE_CHECKING:
    from analysis.compare.benchmark import Pack

_PATH = click.Path(path_type=Path)
_licence = click.option(
    "--licence", default="CC-BY-4.0", show_default=True, help="CC0-1.0, CC-BY-4.0, CC-BY-SA-4.0, ODbL-1.0."
)
_holder = click.option("--holder", default="", help="Who grants the licence.")
_raw = click.option("--raw", is_flag=True, help="Also copy sessions as they were recorded, with all pictures.")
_replace = click.option("--replace", is_flag=True, help="Replace what is at --out.")
_json = click.option("--json", "as_json", is_flag=True, help="Print one JSON object.")


def _tell(pack: "Pack", out: Path, licence: str, as_json: bool) -> None:
    files = len(pack.content) + len(pack.copies)
    if as_json:
        click.echo(json.dumps({"benchmark": str(out), "tests": len(pack.tests), "files": files}))
    else:
        click.echo(f"benchmark {out}: {len(pack.tests)} tests in {files} files, licence {licence}")


@click.group("benchmark", short_help="Pack recordings and simulations for others; verify a pack.")
def command() -> None:
    """Pack recordings and simulations as an open benchmark, readable without labdaq; verify one."""


@command.command("export")
@click.argument("inputs", nargs=-1, required=True, type=_PATH)
@click.option("--out", required=True, type=_PATH, help="Folder to write.")
@click.option("--title", default="Daylight photometry benchmark", show_default=True)
@_licence
@_holder
@_raw
@_replace
@_json
def export(
    inputs: tuple[Path, ...], out: Path, title: str, licence: str, holder: str, raw: bool, replace: bool, as_json: bool
) -> None:
    """Pack INPUTS: folders of cases and sessions, or folders that hold such folders."""
    from analysis.compare.benchmark import export_benchmark
    from analysis.compare.benchmark_texts import Licence

    pack = export_benchmark(inputs, out, licence=Licence(licence, holder), title=title, raw=raw, replace=replace)
    _tell(pack, out, licence, as_json)


@command.command("greenwood")
@click.option("--out", required=True, type=_PATH, help="Folder to write.")
@click.option("--tests", type=click.IntRange(1, 32), default=32, show_default=True, help="Take the first so many only.")
@click.option("--processes", type=click.IntRange(min=1), default=2, show_default=True, help="Tests taken at once.")
@_licence
@_holder
@_raw
@_replace
@_json
def greenwood(
    out: Path, tests: int, processes: int, licence: str, holder: str, raw: bool, replace: bool, as_json: bool
) -> None:
    """Take the Greenwood report's 32 tests on the emulated station, simulate them, and pack all of it.

    In virtual time, with the report's times, skylights and kinds of sky; nothing is concealed, and the room reflects
    what the built-in station says. Takes some eight minutes, and makes 40 MB.
    """
    from analysis.compare.benchmark_texts import Licence
    from labdaq.demo.greenwood import export as make

    pack = make(
        out,
        Licence(licence, holder),
        tests=tests,
        processes=processes,
        raw=raw,
        replace=replace,
        say=lambda text: click.echo(text, err=True),
    )
    _tell(pack, out, licence, as_json)


@command.command("check")
@click.argument("folder", type=_PATH)
@_json
def check(folder: Path, as_json: bool) -> None:
    """Verify the benchmark in FOLDER: its check sums, and that every file can be read."""
    from analysis.compare.benchmark_check import check_benchmark

    files = check_benchmark(folder)
    click.echo(
        json.dumps({"benchmark": str(folder), "files": files, "ok": True})
        if as_json
        else f"{folder}: {files} files, intact"
    )
