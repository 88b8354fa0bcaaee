"""``labdaq compare``: put a recording beside what simulations predict, as a case and as a report."""

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

if TYPE_CHECKING:
    from analysis.cases import Case
    from analysis.compare.draft import Draft
    from analysis.compare.metrics import Comparison

_PATH = click.Path(path_type=Path)


@dataclass(frozen=True, kw_only=True)
class _Files:
    """The options that name photometric files of a single test."""

    measured: Path | None
    simulated: Path | None
    sun: Path | None
    sky: Path | None
    rivals: tuple[tuple[str, Path], ...]
    test: str
    system: str | None
    distance_m: float | None
    noise_percent: float

    @property
    def predicted(self) -> dict[str, str]:
        """The files of the prediction by part, as a list of tests names them."""
        given = {"sun": self.sun, "sky": self.sky, "total": self.simulated}
        return {part: str(path) for part, path in given.items() if path is not None}


@click.command()
@click.argument("inputs", nargs=-1, type=_PATH)
@click.option("--table", "tables", multiple=True, type=_PATH, help="A CSV table, with --recipe; may be repeated.")
@click.option("--recipe", help="How tables become a case: a TOML file, or the name of a recipe that comes with labdaq.")
@click.option("--list", "listing", type=_PATH, help="A TOML list of tests with measured and simulated files.")
@click.option("--measured", type=_PATH, help="Measured .ies, or .csv of a goniometer's readings.")
@click.option("--simulated", type=_PATH, help="Simulated .ies, .ldt or candela table: sun and sky together.")
@click.option("--simulated-sun", "sun", type=_PATH, help="Simulated file: the sun part.")
@click.option("--simulated-sky", "sky", type=_PATH, help="Simulated file: the sky part.")
@click.option(
    "--rival",
    "rivals",
    multiple=True,
    type=(str, _PATH),
    metavar="NAME FILE",
    help="Another simulation for the report.",
)
@click.option("--test", default="test", show_default=True, help="Id of the test, with --measured.")
@click.option("--system", help="What hung in the roof, with --measured: top, box, tube.")
@click.option("--distance", "distance_m", type=float, help="Aperture to sensors [m], with --measured.")
@click.option(
    "--noise",
    "noise_percent",
    type=float,
    default=1.0,
    show_default=True,
    help="Noise of measured files [%, standard].",
)
@click.option("--out", type=_PATH, help="Folder of the case to write.")
@click.option("--replace", is_flag=True, help="Replace what is at --out.")
@click.option("--report", type=_PATH, help="Folder of the report to write: page, plots, CSV, JSON.")
@click.option("--variants", is_flag=True, help="Show the case's variants in the report as simulations of their own.")
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object.")
def command(
    inputs: tuple[Path, ...], tables: tuple[Path, ...], recipe: str | None, listing: Path | None, out: Path | None,
    replace: bool, report: Path | None, variants: bool, as_json: bool, **files: Any,
) -> None:  # fmt: skip
    """Compare recordings with simulations: write a case for `labdaq explain`, a report, or both.

    \b
    From tables:    labdaq compare --recipe greenwood-zenith --table greenwood-tests.csv --out CASE
    From files:     labdaq compare --measured M.ies --simulated-sun S.ies --simulated-sky K.ies --out CASE
                    labdaq compare --list TESTS.toml --out CASE
    From sessions:  labdaq compare SESSION... --out CASE  (predictions lie in SESSION/derived/simulated-*.ies,
                    or for a single session are given with --simulated...)
    Of a case:      labdaq compare CASE [OTHER_CASE...] --report DIR  (the same recording, other simulations)
    """
    given = _Files(**files)
    case, others, notes = _case(inputs, tables, recipe, listing, given, out, replace)
    if report is None and out is None:
        raise click.UsageError("say what to make: --out CASE, --report DIR, or both")
    told: dict[str, Any] = {"case": str(case.folder), "tests": len(case.tests), "records": len(case.records)}
    told["notes"] = list(notes)
    comparison = None
    if report is not None:
        from analysis.compare.metrics import compare
        from analysis.compare.page import write_report

        comparison = compare(case, others, variants=variants)
        told["report"] = str(write_report(comparison, report)[0])
    if as_json:
        click.echo(json.dumps(told, ensure_ascii=False))
        return
    click.echo(f"case    {told['case']}: {told['records']} records of {told['tests']} tests")
    for note in notes:
        click.echo(f"note    {note}")
    if comparison is not None:
        _tell(comparison)
        click.echo(f"report  {told['report']}")


def _case(
    inputs: tuple[Path, ...],
    tables: tuple[Path, ...],
    recipe: str | None,
    listing: Path | None,
    files: _Files,
    out: Path | None,
    replace: bool,
) -> tuple["Case", Sequence["Case"], Sequence[str]]:
    """The case that is asked for, written where it is new; other cases beside it; notes."""
    from analysis.cases import read_case

    ways = {"INPUTS": bool(inputs), "--table/--recipe": bool(tables or recipe), "--list": listing is not None}
    ways["--measured"] = files.measured is not None
    chosen = [way for way, taken in ways.items() if taken]
    if len(chosen) != 1:
        detail = f"not {' and '.join(chosen)} together" if chosen else "see --help"
        raise click.UsageError(f"give one source: cases or sessions, --table, --list, or --measured; {detail}")
    if (files.predicted or files.rivals) and not (inputs or files.measured):
        raise click.UsageError("--simulated... and --rival belong to --measured, or to a session")
    if inputs and not any((path / "session.json").is_file() for path in inputs):
        if out is not None:
            raise click.UsageError("these are cases already; --out is for making one of sessions, files or tables")
        first, *others = (read_case(path) for path in inputs)
        return first, others, ()
    if out is None:
        raise click.UsageError("--out CASE is needed: the folder of the case to write")
    draft = _draft(inputs, tables, recipe, listing, files)
    return draft.write(out, replace=replace), (), draft.notes


def _draft(
    inputs: tuple[Path, ...], tables: tuple[Path, ...], recipe: str | None, listing: Path | None, files: _Files
) -> "Draft":
    if inputs:
        from analysis.compare.from_sessions import case_from_sessions
        from analysis.compare.simulated_session import told_simulation, with_predictions

        predicted = with_predictions(inputs, {k: Path(v) for k, v in files.predicted.items()})
        simulation, systems = (None, []) if files.predicted else told_simulation(inputs)
        return case_from_sessions(predicted, simulation=simulation, systems=systems)
    if tables or recipe:
        from analysis.compare.from_tables import case_from_tables
        from analysis.compare.recipe import find_recipe

        if not (tables and recipe):
            raise click.UsageError("--table and --recipe go together")
        return case_from_tables(find_recipe(recipe), tables)
    from analysis.compare.from_files import case_from_files
    from analysis.compare.listing import Listing, read_listing
    from labdaq.config import check

    if listing is not None:
        return case_from_files(read_listing(listing), listing.parent)
    test = {"id": files.test, "system": files.system, "measured": str(files.measured), "simulated": files.predicted}
    table: dict[str, Any] = {
        "format": "labdaq-comparison/1",
        "noise": {"percent": files.noise_percent},
        "test": [{k: v for k, v in test.items() if v is not None}],
        "rival": [{"name": name, "simulated": {files.test: {"total": str(path)}}} for name, path in files.rivals],
    }
    if files.distance_m is not None:
        table["goniometer"] = {"distance_m": files.distance_m}
    return case_from_files(check(table, Listing, "the options"))


def _tell(comparison: "Comparison") -> None:
    """One line for each simulation, and one for each other channel."""
    for g in comparison.groups:
        if g.label == "all tests":
            click.echo(
                f"{g.simulation}: flux {g.flux_ratio:.3f} of the recording's, shape difference "
                f"{g.shape_difference:.3f} (worst {g.shape_difference_worst:.3f}), rms {g.rms_percent:.1f} %, "
                f"{len(g.tests)} tests"
            )
    for channel in dict.fromkeys(c.channel for c in comparison.channels):
        for one in comparison.simulations:
            ratios = [c.ratio for c in comparison.channels if c.channel == channel and c.simulation == one.name]
            if ratios:
                click.echo(
                    f"{one.name}: {channel} {sum(ratios) / len(ratios):.3f} of the recording's "
                    f"({min(ratios):.3f} to {max(ratios):.3f} in {len(ratios)} tests)"
                )
