"""``labdaq benchmark``: pack recordings and simulations for others, and verify such a pack."""

import json
from pathlib import Path

import click

_PATH = click.Path(path_type=Path)


@click.group("benchmark", short_help="Pack recordings and simulations for others; verify a pack.")
def command() -> None:
    """Pack recordings and simulations as an open benchmark, readable without labdaq; verify one."""


@command.command("export")
@click.argument("inputs", nargs=-1, required=True, type=_PATH)
@click.option("--out", required=True, type=_PATH, help="Folder to write.")
@click.option("--title", default="Daylight photometry benchmark", show_default=True)
@click.option("--licence", default="CC-BY-4.0", show_default=True, help="CC0-1.0, CC-BY-4.0, CC-BY-SA-4.0, ODbL-1.0.")
@click.option("--holder", default="", help="Who grants the licence.")
@click.option("--raw", is_flag=True, help="Also copy sessions as they were recorded, with all pictures.")
@click.option("--replace", is_flag=True, help="Replace what is at --out.")
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object.")
def export(
    inputs: tuple[Path, ...], out: Path, title: str, licence: str, holder: str, raw: bool, replace: bool, as_json: bool
) -> None:
    """Pack INPUTS: folders of cases and sessions, or folders that hold such folders."""
    from analysis.compare.benchmark import export_benchmark
    from analysis.compare.benchmark_texts import Licence

    pack = export_benchmark(inputs, out, licence=Licence(licence, holder), title=title, raw=raw, replace=replace)
    files = len(pack.content) + len(pack.copies)
    if as_json:
        click.echo(json.dumps({"benchmark": str(out), "tests": len(pack.tests), "files": files}))
    else:
        click.echo(f"benchmark {out}: {len(pack.tests)} tests in {files} files, licence {licence}")


@command.command("check")
@click.argument("folder", type=_PATH)
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object.")
def check(folder: Path, as_json: bool) -> None:
    """Verify the benchmark in FOLDER: its check sums, and that every file can be read."""
    from analysis.compare.benchmark_check import check_benchmark

    files = check_benchmark(folder)
    click.echo(
        json.dumps({"benchmark": str(folder), "files": files, "ok": True})
        if as_json
        else f"{folder}: {files} files, intact"
    )
