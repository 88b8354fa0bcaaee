"""The score of a trial as a table to read, and as JSON."""

import json
import math

from simulators.trial.outcome import Outcome
from simulators.trial.score import Line, failures, score


def table(lines: list[Line]) -> str:
    """Return the table as text."""
    rows = [("figure", "result", "95 % interval", "asked", "aim", "")]
    for line in lines:
        result, interval = _number(line), ""
        if line.rate is not None:
            low, high = line.rate.interval
            interval = f"{100 * low:.0f} to {100 * high:.0f} %" if line.rate.of else ""
        asked = "" if line.goal is None else _goal(line, line.goal)
        aim = "" if line.aim is None else _goal(line, line.aim)
        met = {None: "", True: "met", False: "MISSED"}[line.met]
        rows.append((line.name, result, interval, asked, aim, met))
    widths = [max(len(row[k]) for row in rows) for k in range(6)]
    return "\n".join("  ".join(cell.ljust(w) for cell, w in zip(row, widths, strict=True)).rstrip() for row in rows)


def _number(line: Line) -> str:
    if math.isnan(line.number):
        return "no case"
    if line.rate is not None:
        return f"{line.rate.hits}/{line.rate.of} = {100 * line.rate.value:.1f} %"
    return f"{line.number:.3g}"


def _goal(line: Line, value: float) -> str:
    text = f"{100 * value:.0f} %" if line.rate is not None else f"{value:g}"
    return f"<= {text}" if line.at_most else f">= {text}"


def confusion(outcomes: list[Outcome]) -> dict[str, dict[str, int]]:
    """Per concealed cause of the single cases: how often which first name was given."""
    found: dict[str, dict[str, int]] = {}
    for o in outcomes:
        if o.truth.content == "single":
            row = found.setdefault(o.truth.concealed[0].id, {})
            name = o.named[0][0] if o.named else "(nothing)"
            row[name] = row.get(name, 0) + 1
    return {k: dict(sorted(v.items(), key=lambda item: -item[1])) for k, v in sorted(found.items())}


def as_json(outcomes: list[Outcome], about: dict[str, object]) -> str:
    """Return ``trial.json``."""
    lines = score(outcomes)
    document = {
        "format": "labdaq-trial/1",
        "about": about,
        "table": [
            {
                "figure": line.name.strip(),
                "value": None if math.isnan(line.number) else line.number,
                "hits": line.rate.hits if line.rate else None,
                "of": line.rate.of if line.rate else None,
                "interval": list(line.rate.interval) if line.rate and line.rate.of else None,
                "asked": line.goal,
                "aim": line.aim,
                "met": line.met,
            }
            for line in lines
        ],
        "confusion": confusion(outcomes),
        "failures": failures(outcomes),
        "cases": [_case(o) for o in outcomes],
    }
    return json.dumps(document, indent=1) + "\n"


def _case(o: Outcome) -> dict[str, object]:
    return {
        "case": o.truth.case,
        "kind": o.truth.kind,
        "seed": o.truth.seed,
        "content": o.truth.content,
        "truth": [{"id": c.id, "effect_percent": c.effect_percent} for c in o.truth.concealed],
        "effect_percent": o.truth.effect_percent,
        "nuisance_percent": o.truth.nuisance_percent,
        "verdict": o.verdict,
        "named": [{"id": name, "probability": p} for name, p in o.named],
        "first": o.first,
        "both": o.both,
        "located": o.located,
        "intervals": [
            {"id": m, "parameter": p, "truth": t, "value": v, "uncertainty": u, "holds": held}
            for m, p, t, v, u, held in o.intervals
        ],
        "withheld_percent": None if o.withheld is None else {"before": o.withheld[0], "after": o.withheld[1]},
        "seconds": round(o.seconds, 2),
        "error": o.error or None,
    }


def story(outcomes: list[Outcome]) -> str:
    """Return table, confusions and failures as text."""
    parts = [table(score(outcomes)), "", "first names given, by what was concealed (single cases):"]
    for name, row in confusion(outcomes).items():
        parts.append(f"  {name}: " + ", ".join(f"{k} {n}" for k, n in row.items()))
    wrong = failures(outcomes)
    parts += ["", f"{len(wrong)} cases with something wrong:"]
    for f in wrong:
        truth = ", ".join(f["truth"]) if isinstance(f["truth"], list) and f["truth"] else "nothing"
        named = ", ".join(f["named"]) if isinstance(f["named"], list) and f["named"] else "nothing"
        reasons = "; ".join(f["wrong"]) if isinstance(f["wrong"], list) else ""
        parts.append(
            f"  {f['case']} seed {f['seed']} {f['kind']} {f['content']}: {truth} -> {f['verdict']}, {named}: {reasons}"
        )
    return "\n".join(parts) + "\n"
