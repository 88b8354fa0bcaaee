"""``labdaq predict``: apply an explanation to other tests, with no new fit."""

from pathlib import Path

import click


@click.command()
@click.argument("explanation", type=click.Path(path_type=Path))
@click.argument("case", type=click.Path(path_type=Path))
@click.option("--out", required=True, type=click.Path(path_type=Path, dir_okay=False), help="CSV file to write.")
def command(explanation: Path, case: Path, out: Path) -> None:
    """Apply what `labdaq explain` found (folder EXPLANATION) to another CASE of the same station.

    Writes the case's records with `corrected` and `corrected_uncertainty`. Nothing is fitted; `measured` may be empty.
    """
    from analysis.cases import read_case
    from analysis.explain.apply import apply_model, read_model
    from analysis.explain.resimulate import simulator_of
    from labdaq.whole_file import write_whole_bytes

    other = read_case(case, need_measured=False)
    text = apply_model(read_model(explanation), other, simulator_of(other))
    write_whole_bytes(out, text.encode())
    click.echo(f"wrote {out}")
