"""``labdaq mechanisms``: the catalogue of what a prediction may leave out."""

import json

import click


@click.command()
@click.option("--json", "as_json", is_flag=True, help="Print one JSON array.")
def command(as_json: bool) -> None:
    """List the mechanisms that `labdaq explain` knows: parameters, ranges, what each needs, and its source."""
    from analysis.explain.mechanisms.catalogue import CATALOGUE

    if as_json:
        click.echo(json.dumps([_entry(m) for m in CATALOGUE], ensure_ascii=False, indent=1))
        return
    for m in CATALOGUE:
        click.echo(f"{m.id}  ({m.stage.label})\n    {m.leaves_out}")
        for p in m.parameters:
            click.echo(f"    {p.name} [{p.unit}], {p.low:g} to {p.high:g}: {p.meaning}")
        click.echo(f"    needs: {m.needs}\n    source: {m.source}")


def _entry(m: object) -> dict[str, object]:
    from analysis.explain.mechanisms.base import Mechanism

    assert isinstance(m, Mechanism)
    return {
        "id": m.id,
        "stage": m.stage.label,
        "leaves_out": m.leaves_out,
        "parameters": [
            {"name": p.name, "unit": p.unit, "low": p.low, "high": p.high, "usual": p.sigma, "meaning": p.meaning}
            for p in m.parameters
        ],
        "needs": m.needs,
        "source": m.source,
        "tie_breaker": m.tie_breaker,
        "channels": list(m.kinds),
    }
