"""``labdaq predict``: apply an explanation to other tests, with no new fit."""

from pathlib import Path

import click


@click.command()
@click.argument("explanation", type=click.Path(path_type=Path))
@click.argument("case", type=click.Path(path_type=Path))
@click.option("--out", required=True, type=click.Path(path_type=Path, dir_okay=False), help="CSV file to write.")
@click.option("--mechanisms-only", is_flag=True, help="Leave the simulation's own error in the prediction.")
def command(explanation: Path, case: Path, out: Path, mechanisms_only: bool) -> None:
    """Apply what `labdaq explain` found (folder EXPLANATION) to another CASE of the same station.

    Writes the case's records with `corrected` and `corrected_uncertainty`. Nothing is fitted; `measured` may be empty.
    Where mechanisms are named, what the fitted tests say of the simulation's own error is taken off as well.
    """
    from analysis.cases import read_case
    from analysis.cases.suns import with_suns
    from analysis.explain.apply import apply_model, read_model
    from analysis.explain.resimulate import simulator_of
    from labdaq.whole_file import write_whole_bytes

    other = with_suns(read_case(case, need_measured=False))
    model = read_model(explanation)
    if mechanisms_only:
        model = model.without_shared_error()
    text = apply_model(model, other, simulator_of(other, model.mechanisms, model.lenses))
    write_whole_bytes(out, text.encode())
    click.echo(f"wrote {out}")
