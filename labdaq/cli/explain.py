"""``labdaq explain``: find the mismatch, name the physics, show the fit improve."""

import json
from pathlib import Path

import click


@click.command()
@click.argument("case", type=click.Path(path_type=Path))
@click.option(
    "--out",
    required=True,
    type=click.Path(path_type=Path, file_okay=False),
    help="Folder for the answer; made if need be.",
)
@click.option("--json", "as_json", is_flag=True, help="Print the answer as one JSON object.")
@click.option("--no-simulation", is_flag=True, help="Do not simulate what the case brings no variant for.")
def command(case: Path, out: Path, as_json: bool, no_simulation: bool) -> None:
    """Explain CASE: where the recording differs from the prediction, and which physics was left out.

    Writes explanation.json, predictions.csv, report.html and the plots to --out.
    """
    from analysis.cases import read_case
    from analysis.cases.suns import with_suns
    from analysis.explain.answer import answer, found_in, predictions_csv, write_json
    from analysis.explain.mismatch import explain
    from analysis.explain.plots import plots
    from analysis.explain.report import report
    from analysis.explain.resimulate import simulator_of
    from labdaq.whole_file import write_whole_bytes

    def say(step: str) -> None:
        if not as_json:
            click.echo(f"  {step} ...", err=True)

    recorded = with_suns(read_case(case))
    found = explain(recorded, None if no_simulation else simulator_of(recorded), say)
    content = answer(found)
    drawn = plots(found)
    out.mkdir(parents=True, exist_ok=True)
    for name, svg in drawn.items():
        write_whole_bytes(out / f"{name}.svg", svg.encode())
    write_whole_bytes(out / "report.html", report(found, content, drawn).encode())
    write_whole_bytes(out / "predictions.csv", predictions_csv(found).encode())
    write_json(out / "explanation.json", content)
    if as_json:
        click.echo(json.dumps(content, ensure_ascii=False))
        return
    click.echo(f"verdict: {content['verdict']}")
    for m in found_in(content):
        click.echo(f"  {m['id']} ({m['probability']:.0%}): {m['statement']}")
