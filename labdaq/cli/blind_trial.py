"""``labdaq blind-trial``: conceal physics in many cases, let ``labdaq explain`` answer, and score every line."""

import json
import tempfile
from pathlib import Path

import click

from labdaq.errors import DataError

KINDS = ("goniometer", "roof", "camera")


@click.command(name="blind-trial")
@click.option("--n", "count", default=40, show_default=True, type=click.IntRange(1), help="Number of cases.")
@click.option("--seed", default=0, show_default=True, help="The same seed gives the same cases.")
@click.option("--out", type=click.Path(path_type=Path, file_okay=False), help="Folder for cases, answers and score.")
@click.option("--kinds", default=",".join(KINDS), show_default=True, help="Kinds of channel, with commas.")
@click.option("--contents", default="", help="Shares of contents, e.g. null=1,single=2 (null, single, pair, open).")
@click.option("--designs", default="", help="Skylights to make cases with, with commas; all of the stock by default.")
@click.option("--workers", default=1, show_default=True, type=click.IntRange(1), help="Cases at a time.")
@click.option("--limit", default=600.0, show_default=True, help="Longest time for one answer [s].")
@click.option("--rays", default=None, type=click.IntRange(1000), help="Rays per sun for skylights not traced yet.")
@click.option("--no-withheld", is_flag=True, help="Keep no tests back for `labdaq predict`.")
@click.option("--only-cases", is_flag=True, help="Write cases and truths under --out, and stop.")
@click.option("--resume", is_flag=True, help="Go on with the same trial under --out: ask only for what has no answer.")
@click.option("--score", "existing", is_flag=True, help="Score the answers that lie under --out already.")
@click.option("--json", "as_json", is_flag=True, help="Print the score as JSON.")
def command(
    count: int,
    seed: int,
    out: Path | None,
    kinds: str,
    contents: str,
    designs: str,
    workers: int,
    limit: float,
    rays: int | None,
    no_withheld: bool,
    only_cases: bool,
    resume: bool,
    existing: bool,
    as_json: bool,
) -> None:
    """Make cases with a concealed cause, run `labdaq explain` on each in a process that cannot know it, and score.

    Skylights' responses are traced once, in minutes each, and kept in the user's cache.

    Under --out: cases/, answers/, truth/ (written after each answer), trial.json, trial.txt.
    """
    from simulators.trial import trial
    from simulators.trial.plan import plan
    from simulators.trial.runner import Program

    chosen = tuple(kinds.split(","))
    if not set(chosen) <= set(KINDS):
        raise click.BadParameter(f"kinds are {', '.join(KINDS)}, not {kinds}", param_hint="--kinds")
    if out is None:
        if only_cases or resume or existing:
            raise click.UsageError("--only-cases, --resume and --score need --out")
        out = Path(tempfile.mkdtemp(prefix="labdaq-trial-"))
    shares = _shares(contents)
    about: dict[str, object] = {"n": count, "seed": seed, "kinds": list(chosen), "contents": shares, "designs": designs}
    if existing:
        if not (out / "truth").is_dir():
            raise DataError(f"{out}: no folder truth/ to score against", "give the --out of a trial")
        found = trial.existing(out)
    else:
        orders = plan(count, seed, chosen, shares, not no_withheld, _designs(designs))
        workshop = trial.Workshop(out.resolve(), Program(limit_s=limit, cache=out.resolve() / "cache"), workers, rays)
        if only_cases:
            for k, name in enumerate(trial.only_cases(orders, workshop)):
                click.echo(f"{k + 1}/{count} {name}", err=True)
            return
        left = trial.unanswered(orders, workshop.out) if resume else orders
        found = trial.existing(workshop.out, [order.name for order in orders if order not in left])
        for outcome in trial.outcomes(left, workshop):
            found.append(outcome)
            click.echo(
                f"{len(found)}/{count} {outcome.truth.case}: {outcome.verdict}, {outcome.seconds:.1f} s", err=True
            )
    text = trial.write_score(found, out, about)
    click.echo(json.dumps(json.loads((out / "trial.json").read_text()), indent=1) if as_json else text)
    click.echo(f"written to {out}", err=True)


def _designs(text: str) -> tuple[str, ...]:
    from simulators.trial.stock import DESIGNS

    named = tuple(text.split(",")) if text else ()
    if not set(named) <= set(DESIGNS):
        raise click.BadParameter(f"designs are {', '.join(DESIGNS)}, not {text}", param_hint="--designs")
    return named


def _shares(text: str) -> dict[str, float] | None:
    if not text:
        return None
    try:
        pairs = [word.split("=") for word in text.split(",")]
        shares = {name: float(value) for name, value in pairs}
    except ValueError as error:
        raise click.BadParameter(f"write shares like null=1,single=2, not {text}", param_hint="--contents") from error
    if not set(shares) <= {"null", "single", "pair", "open"} or sum(shares.values()) <= 0.0:
        raise click.BadParameter("contents are null, single, pair, open", param_hint="--contents")
    return shares
