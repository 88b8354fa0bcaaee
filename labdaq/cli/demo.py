"""``labdaq demo``: the whole of it, from emulated instruments to a report that names what was concealed."""

import json
import secrets
from pathlib import Path

import click

from labdaq.cli.files import json_option


@click.command("demo", short_help="Watch the whole of it on the emulated station.")
@click.option("--seed", type=click.IntRange(min=0), help="Chooses what is concealed; drawn by lot when not given.")
@click.option(
    "--out", type=click.Path(path_type=Path), default=Path("labdaq-demo"), show_default=True, help="Folder for it all."
)
@click.option(
    "--rate",
    type=click.FloatRange(min=0, min_open=True, max=60),
    default=12.0,
    show_default=True,
    help="Pace of the first test: emulated seconds per real second.",
)
@click.option(
    "--tests",
    type=click.IntRange(min=2),
    default=8,
    show_default=True,
    help="Take no more tests than these (a campaign has 8 to 10); fewer explain less.",
)
@json_option
def command(seed: int | None, out: Path, rate: float, tests: int, as_json: bool) -> None:
    """Take tests on an emulated station in which one effect is concealed, and explain what they show.

    One test goes over the instruments' real wires at an accelerated pace, a campaign of further ones runs in virtual
    time. All are processed, simulated and compared; `labdaq explain` then gets the case, and nothing else. The last
    step opens the file in which the truth was written down. --out must be new, empty, or a former demo's folder.
    """
    from labdaq.demo.story import Plan, run

    chosen = secrets.randbelow(2**32) if seed is None else seed
    outcome = run(Plan(out, chosen, rate, tests))
    if as_json:
        click.echo(json.dumps({"seed": chosen, **outcome.facts()}))
        return
    for line in outcome.lines():
        click.echo(line)
    click.echo(f"again       labdaq demo --seed {chosen}")
    click.echo(f"\nopen {outcome.report.as_uri()}")
