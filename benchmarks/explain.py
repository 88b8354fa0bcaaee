"""labdaq explain beside other ways to do the same, on the same cases with a known truth.

    python3 benchmarks/explain.py CASES TRUTHS [--methods labdaq,bic,...] [--cases N] [--kinds goniometer] [--out FILE]
    python3 benchmarks/explain.py TRIAL [...]             a folder that `labdaq blind-trial --out TRIAL` wrote

CASES holds case folders, and beside NAME perhaps NAME-withheld; TRUTHS holds NAME.json as `simulators.trial.truth` has
it, or at least with `content`, `hidden` (each with `id`, `in_catalogue`, `effect_percent`), `clean` and `change`.

| method | what it is |
|---|---|
| labdaq | `labdaq explain` and `labdaq predict` |
| bic | the catalogue's forms, independent errors of unknown size, forward selection by BIC of at most three |
| sindy | sparse regression (PySINDy) over the catalogue's signatures |
| gp | Gaussian-process discrepancy (scikit-learn); it corrects and names nothing |
| koh | the catalogue's forms calibrated beside that discrepancy, in the manner of Kennedy and O'Hagan |

The peers are no dependencies of labdaq: `pip install scikit-learn pysindy`. A method whose library is not there is left
out, and named. (LANL's SEPIA, the package for Kennedy and O'Hagan's method, is not on the package index.)

All see the same case, the same forward models and the same re-simulations; none sees the truth. Prints one line for
each case and method, and then the trial's own table (`simulators.trial.score`) with a column for each method; "-"
where a method cannot fill a line. Errors are rms, per cent, over the noise-free truth, a gain per test removed where
it is free. "Left-out tests" are predicted one by one by what was chosen on all tests and fitted to the others (for
all methods alike); withheld tests were never seen. Seconds are of the processor, all threads together, for finding
the answer; re-simulations are made once for all methods and have a line of their own, imports do not count. Takes a
minute or two for each case with all methods: run it on few cases, or overnight.
"""

import argparse
import importlib
import json
import os
import sys
import time
import traceback
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
os.environ.setdefault("OMP_NUM_THREADS", "1")
sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

import numpy as np
from explain_cases import Task, error, tasks

from analysis.cases import Case, read_case
from analysis.cases.model import Floats
from analysis.explain.readings import Readings
from simulators.trial.outcome import Outcome, judge, read_records
from simulators.trial.score import Line, score

METHODS: Final = {
    "labdaq": ("explain_labdaq", "Labdaq", ()),
    "bic": ("explain_search", "Bic", ()),
    "sindy": ("explain_sindy", "Sindy", ("pysindy",)),
    "gp": ("explain_gp", "Discrepancy", ("sklearn",)),
    "koh": ("explain_gp", "Calibrated", ("sklearn",)),
}
"""Method to its module, class, and the libraries it needs."""

LINES: Final = {
    "named first, effect >= 2.5 %": "names",
    "named first, effect 1.5 to 2.5 %": "names",
    "wrong names among all claims": "names",
    "  without the open cases": "names",
    "something named when there is nothing": "names",
    "  verdict other than no-mismatch": "verdict",
    "pairs, both named (each effect >= 1.5 %)": "names",
    "  at least one named": "names",
    "false second beside a single": "names",
    "open set flagged and located, effect >= 2.5 %": "open",
    "right explanation flagged all the same": "both",
    "95 % intervals that hold the truth": "intervals",
    "claims inside a declared pair": "pairs",
    "expected calibration error": "probability",
    "  made worse": "verdict",
    "no answer": "verdict",
}
"""Lines of the trial's table, and what a method must be able to say to fill them."""

SAYS: Final = {
    "labdaq": {"names", "verdict", "open", "both", "intervals", "pairs", "probability"},
    "bic": {"names", "verdict", "intervals", "probability"},
    "sindy": {"names", "verdict"},
    "gp": {"verdict", "open"},
    "koh": {"names", "verdict", "intervals", "probability"},
}


@dataclass(frozen=True)
class Result:
    """What one method made of one case; errors in per cent over the noise-free truth."""

    outcome: Outcome
    before: float = np.nan
    left_out: float = np.nan


def answered(name: str, task: Task) -> Result:
    """Let a method answer a case, and judge it."""
    module, kind, _ = METHODS[name]
    case = read_case(task.folder)
    method = getattr(importlib.import_module(module), kind)(case)
    began = time.process_time()
    try:
        said = method.find()
        seconds = time.process_time() - began
        r: Readings = method.problem.readings
        before = error(r.simulated / r.unit_factor, _clean(task)[r.row], r.test, task.truth)
        left_out = error(_each_left_out(method, r) / r.unit_factor, _clean(task)[r.row], r.test, task.truth)
        withheld = _withheld(method, task)
    except Exception as trouble:  # one method's failure is a result of the comparison
        traceback.print_exc()
        return Result(Outcome(task.truth, "failed", seconds=time.process_time() - began, error=repr(trouble)))
    records = read_records((task.folder / "records.csv").read_text(encoding="utf-8"))
    return Result(judge(task.truth, said, records, seconds, withheld), before, left_out)


def _clean(task: Task) -> Floats:
    return np.array(task.truth.clean)


def _each_left_out(method: Any, r: Readings) -> Floats:
    values = np.array(r.simulated)
    for k in np.unique(r.test):
        values[r.test == k] = method.left_out(r.test == k)
    return values


def _withheld(method: Any, task: Task) -> tuple[float, float] | None:
    """Error on the withheld tests before and after."""
    if task.withheld is None or not task.truth.withheld_clean:
        return None
    case: Case = read_case(task.withheld, need_measured=False)
    r, clean = Readings.of(case, measured_only=False), np.array(task.truth.withheld_clean)
    values = method.elsewhere(case) / r.unit_factor
    return error(r.simulated / r.unit_factor, clean, r.test, task.truth), error(values, clean, r.test, task.truth)


# the table


def figures(name: str, results: list[Result], tracing: list[float]) -> Iterator[tuple[str, str]]:
    """Lines of the table for one method."""
    lines = {line.name: line for line in score([r.outcome for r in results])}
    for line, needs in LINES.items():
        if line in lines:
            yield line, _text(lines[line]) if needs in SAYS[name] else "-"
    changed = [r for r in results if r.outcome.truth.content != "null" and r.outcome.truth.effect_percent >= 1.5]
    nulls = [r for r in results if r.outcome.truth.content == "null"]
    for what, group in (("effect >= 1.5 %", changed), ("nothing concealed", nulls)):
        yield f"left-out tests, {what}: before -> after [%]", _pairs([(r.before, r.left_out) for r in group])
        yield f"withheld tests, {what}: before -> after [%]", _pairs([r.outcome.withheld for r in group])
        ripple = [r.outcome.truth.nuisance_percent for r in group]
        yield f"  what ripple alone leaves, {what} [%]", f"{np.median(ripple):.2f}" if ripple else ""
    seconds = [r.outcome.seconds for r in results]
    yield "processor seconds a case: median, longest", f"{np.median(seconds):.1f}, {max(seconds):.1f}"
    yield "  and re-simulation", f"{np.median(tracing):.1f}, {max(tracing):.1f}" if name != "gp" else "-"


def _text(line: Line) -> str:
    if line.rate is not None:
        return f"{line.rate.hits}/{line.rate.of}" + (f" = {100 * line.rate.value:.0f} %" if line.rate.of else "")
    return "-" if np.isnan(line.number) else f"{line.number:.2g}"


def _pairs(pairs: list[tuple[float, float] | None]) -> str:
    """Medians of what was before and after, and of the change."""
    have = np.array([p for p in pairs if p is not None and np.all(np.isfinite(p))])
    if not len(have):
        return "no case"
    change = np.median(have[:, 1] / have[:, 0]) - 1.0
    return f"{np.median(have[:, 0]):.2f} -> {np.median(have[:, 1]):.2f} ({100 * change:+.0f} %)"


def table(results: dict[str, list[Result]], tracing: list[float]) -> str:
    """The table as text, a column for each method; ``tracing`` are the seconds that re-simulating took."""
    columns = {name: dict(figures(name, found, tracing)) for name, found in results.items()}
    rows = [["", *columns]]
    for line in next(iter(columns.values())):
        rows.append([line, *(column[line] for column in columns.values())])
    widths = [max(len(row[k]) for row in rows) for k in range(len(rows[0]))]
    return "\n".join("  ".join(cell.ljust(w) for cell, w in zip(row, widths, strict=True)).rstrip() for row in rows)


def told(name: str, result: Result) -> str:
    """One line on one answer."""
    o = result.outcome
    truth = ", ".join(f"{c.id} {c.effect_percent:.1f} %" for c in o.truth.concealed) or "nothing"
    says = ", ".join(f"{n} ({p:.2f})" for n, p in o.named) or "no name"
    held = "" if o.withheld is None else f", withheld {o.withheld[0]:.2f} -> {o.withheld[1]:.2f} %"
    return (
        f"{o.truth.case} [{truth}] {name}: {o.verdict}, {says}; "
        f"left-out {result.before:.2f} -> {result.left_out:.2f} %{held}; {o.seconds:.1f} s"
    )


def main() -> None:
    """Run the comparison."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folders", nargs="+", type=Path, metavar="FOLDER")
    parser.add_argument("--methods", default=",".join(METHODS))
    parser.add_argument("--cases", type=int, help="at most about so many, evenly over nulls, singles, pairs and open")
    parser.add_argument("--kinds", default="goniometer")
    parser.add_argument("--out", type=Path, help="write all answers as JSON")
    options = parser.parse_args()
    results: dict[str, list[Result]] = {}
    for name in options.methods.split(","):
        absent = [lib for lib in METHODS[name][2] if importlib.util.find_spec(lib) is None]
        if absent:
            print(f"{name}: left out, {', '.join(absent)} is not installed")
        else:
            results[name] = []
    chosen = tasks(options.folders, options.cases, set(options.kinds.split(",")))
    print(f"{len(chosen)} cases", flush=True)
    tracing = []
    for task in chosen:
        began = time.process_time()
        importlib.import_module("explain_forms").simulation(read_case(task.folder))
        tracing.append(time.process_time() - began)
        for name, found in results.items():
            found.append(answered(name, task))
            print(told(name, found[-1]), flush=True)
    text = table(results, tracing)
    print(f"\n{text}")
    if options.out:
        told_ = {name: [_plain(r) for r in found] for name, found in results.items()}
        options.out.write_text(json.dumps({"table": text, "answers": told_}, indent=1) + "\n", encoding="utf-8")


def _plain(r: Result) -> dict[str, Any]:
    o = r.outcome
    return {
        "case": o.truth.case,
        "content": o.truth.content,
        "truth": [[c.id, c.effect_percent] for c in o.truth.concealed],
        "verdict": o.verdict,
        "named": o.named,
        "first": o.first,
        "left_out": [r.before, r.left_out],
        "withheld": o.withheld,
        "seconds": o.seconds,
        "error": o.error,
    }


if __name__ == "__main__":
    main()
