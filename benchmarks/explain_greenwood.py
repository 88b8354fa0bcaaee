"""What the Greenwood tables say of two instruments on the roof, told by labdaq's own commands.

`roof_meters` and `zenith` make a case of the tables (`labdaq compare --recipe`), explain it (`labdaq explain`), and
put the answer into words and tables. For the zenith they also do what needs no catalogue: each of a few one-line laws
is fitted to some tests and asked for the others, by test, by day and by sky. Whoever doubts the catalogue can begin
there.
"""

import csv
import json
import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any, Final

import numpy as np
from explain_tilt import tilt_lines
from numpy.typing import NDArray

from analysis.explain.answer import found_in

Floats = NDArray[np.float64]
HOME: Final = Path(__file__).resolve().parent.parent
ROOF_TABLES: Final = (
    "greenwood-tests.csv",
    "greenwood-meter-comparison-before-levelling.csv",
    "greenwood-meter-comparison-after-levelling.csv",
)
AS_GOOD_NATS: Final = 3.0
"""Rivals whose evidence is this near to the best count as fitting as well."""


def labdaq(*words: str | Path) -> None:
    """Run one labdaq command, shown as it is run."""
    print("$ labdaq", *words, flush=True)
    environment = {**os.environ, "PYTHONPATH": str(HOME), "OPENBLAS_NUM_THREADS": "1"}
    done = subprocess.run([sys.executable, "-m", "labdaq", *map(str, words)], check=False, env=environment)
    if done.returncode:
        sys.exit(f"labdaq {words[0]} ended with exit code {done.returncode}")


def explained(recipe: str, tables: list[Path], out: Path) -> dict[str, Any]:
    """Case and answer of a recipe's tables, under ``out``."""
    import shutil

    shutil.rmtree(out / "case", ignore_errors=True)
    labdaq("compare", "--recipe", recipe, *(w for table in tables for w in ("--table", table)), "--out", out / "case")
    labdaq("explain", out / "case", "--out", out / "answer")
    return dict(json.loads((out / "answer" / "explanation.json").read_text(encoding="utf-8")))


# what an answer says, as Markdown


def answer_lines(answer: dict[str, Any]) -> list[str]:
    """Verdict, names, rivals, places, leftovers and held-out errors."""
    lines = [f"Verdict: **{answer['verdict']}**.", ""]
    if answer["findings"]:
        lines += ["The record itself:", "", *(f"- {text}" for text in answer["findings"]), ""]
    lines += ["Where (p allows for looking everywhere):", ""]
    lines += [f"- {m['statement']} p = {m['p_value']:.1g}" for m in answer["mismatch"]] or ["- nowhere"]
    lines += ["", "What:", "", *(name_lines(answer) or ["- no mechanism is named"]), ""]
    lines += [*evidence_lines(answer), ""]
    if answer["leftover"]:
        lines += [
            "Left after that:",
            "",
            *(f"- {m['statement']} p = {m['p_value']:.1g}" for m in answer["leftover"]),
            "",
        ]
    if answer["unnamed"]:
        along = ", ".join(f"{u['along']} {u['nats']:+.1f} nats" for u in answer["unnamed"])
        lines += [f"Unnamed smooth structure beside the best names: {along}.", ""]
    lines += [*held_lines(answer), "", f"Next: {answer['next_measurement']['statement']}"]
    return lines


def name_lines(answer: dict[str, Any]) -> list[str]:
    """One line for each named mechanism, with its parameters, and for what is told as either of several."""
    lines = []
    for m in found_in(answer):
        values = ", ".join(
            f"{name} = {p['value']:.4g} ± {p['uncertainty']:.2g}{'' if p['unit'] == '1' else ' ' + p['unit']}"
            for name, p in m["parameters"].items()
            if not isinstance(p["value"], str)
        )
        lines.append(f"- `{m['id']}`, {100 * m['probability']:.0f} %: {m['statement']} ({m['way']}; {values})")
    return lines


def evidence_lines(answer: dict[str, Any]) -> list[str]:
    """Evidence of single mechanisms, and which of them fit as well as the best."""
    ranked = sorted(answer["evidence"], key=lambda e: -e["nats_over_nothing"])
    lines = ["| mechanism alone | evidence over nothing [nats] |", "|---|---|"]
    lines += [f"| {' + '.join(e['ids'])} | {e['nats_over_nothing']:.1f} |" for e in ranked[:8]]
    if ranked:
        best = ranked[0]["nats_over_nothing"]
        rivals = [" + ".join(e["ids"]) for e in ranked[1:] if best - e["nats_over_nothing"] < AS_GOOD_NATS]
        lines += ["", f"As good as the best to {AS_GOOD_NATS:g} nats: {', '.join(rivals) or 'none'}."]
    if answer["indistinguishable"]:
        lines += ["Not told apart: " + "; ".join(" and ".join(pair) for pair in answer["indistinguishable"]) + "."]
    return lines


def held_lines(answer: dict[str, Any]) -> list[str]:
    """Deviations before, after, and on what was left out."""
    fit = answer["fit"]
    before, after = fit["before"]["rms_percent"], fit["after"]["rms_percent"]
    lines = [f"Deviation, rms: {before:.2f} % before, {after:.2f} % after."]
    held = fit.get("held_out")
    if held:
        before, after = held["before"]["rms_percent"], held["after"]["rms_percent"]
        lines[0] += f" {held['scheme']}: {before:.2f} % before, {after:.2f} % after."
    return lines


# the roof meters


def roof_meters(data: Path, out: Path) -> str:
    """Tables 5, 7 and 8: the Velux meter against the CLTC meter. Returns Markdown."""
    answer = explained("greenwood-roof-meters", [data / name for name in ROOF_TABLES], out)
    case = out / "case"
    parts = [ratio_table(case), ["One tilt and one gain for tests 20 to 26 and sets 1 and 2?"], tilt_lines(case)]
    return "\n".join([*(line for part in parts for line in (*part, "")), *answer_lines(answer)]) + "\n"


def ratio_table(folder: Path) -> list[str]:
    """Per test: how many readings, level, ratio of the two meters, and how it moved within the set."""
    from analysis.cases import read_case

    case = read_case(folder)
    lines = ["| test | readings | sun alt., az. [deg] | CLTC [fc] | Velux / CLTC | first to last reading |"]
    lines.append("|---|---|---|---|---|---|")
    for k, test in enumerate(case.tests):
        rows = case.records.where(case.records.test == k)
        ratio = rows.measured / rows.simulated
        known = test.sun_altitude_deg is not None
        sun = f"{test.sun_altitude_deg:.1f}, {test.sun_azimuth_deg:.1f}" if known else "time not recorded"
        moved = f"{100 * (ratio[-1] / ratio[0] - 1):+.2f} %" if len(ratio) > 1 else ""
        lines.append(
            f"| {test.id} | {len(ratio)} | {sun} | {rows.simulated.mean():.0f} | {ratio.mean():.4f} | {moved} |"
        )
    return lines


# the zenith


def zenith(data: Path, out: Path) -> str:
    """Tables 3 and 4: the LS-110 against the raw HDR picture at the zenith. Returns Markdown."""
    answer = explained("greenwood-zenith", [data / "greenwood-tests.csv"], out)
    table = zenith_table(data / "greenwood-tests.csv")
    return "\n".join([*law_lines(table), "", *answer_lines(answer)]) + "\n"


def zenith_table(path: Path) -> dict[str, Any]:
    """Columns of the 32 tests; luminances in cd/m², the sky's mean luminance from the shaded meter [cd/m²]."""
    with path.open(newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))

    def column(name: str) -> Floats:
        return np.array([float(row[name].strip("%") or "nan") for row in rows])

    return {
        "test": [f"T{row['test']}" for row in rows],
        "day": np.array([row["date"][-2:] for row in rows]),
        "sky": np.array(["partly cloudy" if row["sky"].startswith("Partly") else "clear" for row in rows]),
        "meter": column("ls110_zenith_cdm2"),
        "camera": column("hdr_zenith"),
        "cloud": column("cloud") / 100.0,
        "altitude": column("sun_alt_mid"),
        "mean": column("cltc_diffuse_fc") * 10.763910417 / np.pi,
    }


Law = tuple[int, Callable[[Floats, dict[str, Any]], Floats]]
"""How many parameters, and ln(meter / camera) by them."""

LAWS: Final[dict[str, Law]] = {
    "no law: the camera is right": (0, lambda p, t: np.zeros(len(t["camera"]))),
    "one factor": (1, lambda p, t: np.full(len(t["camera"]), p[0])),
    "a factor for clear, one for partly cloudy skies": (
        2,
        lambda p, t: np.where(t["sky"] == "clear", p[0], p[1]),
    ),
    "a factor for up to 10 % of cloud cover, one for more": (
        2,
        lambda p, t: np.where(t["cloud"] < 0.125, p[0], p[1]),
    ),
    "a factor that goes with the cloud cover": (2, lambda p, t: p[0] + p[1] * t["cloud"]),
    "a power of the camera's luminance": (2, lambda p, t: p[0] + p[1] * np.log(t["camera"] / 8000.0)),
    "a factor that goes with the sun's altitude": (2, lambda p, t: p[0] + p[1] * (t["altitude"] - 50.0) / 20.0),
    "a factor that goes with zenith over mean luminance": (
        2,
        lambda p, t: p[0] + p[1] * np.log(t["camera"] / t["mean"]),
    ),
    "a factor, and a veil of the sky's mean luminance": (
        2,
        lambda p, t: p[0] + np.log(np.maximum(1.0 - p[1] * t["mean"] / t["camera"], 0.05)),
    ),
}


def fitted(law: Law, table: dict[str, Any], rows: NDArray[np.bool_]) -> Floats:
    """The law's parameters by a robust fit (Huber's loss, 5 %): a few tests deviate by half, for their own reasons."""
    from scipy.optimize import least_squares

    count, form = law
    if not count:
        return np.zeros(0)
    seen = np.log(table["meter"] / table["camera"])
    found = least_squares(lambda p: (seen - form(p, table))[rows], np.zeros(count), loss="huber", f_scale=0.05)
    return np.asarray(found.x)


def held_out(law: Law, table: dict[str, Any], group: NDArray[Any]) -> Floats | None:
    """ln(meter / camera) minus the law fitted to all other groups, for each test; ``None`` if those cannot tell it."""
    count, form = law
    left = np.log(table["meter"] / table["camera"])
    for name in np.unique(group):
        out = group == name
        slopes = [(form(0.01 * one, table) - form(0.0 * one, table))[~out] for one in np.eye(count)]
        if any(not np.any(slope) for slope in slopes):
            return None
        left[out] -= form(fitted(law, table, ~out), table)[out]
    return left


def law_lines(table: dict[str, Any]) -> list[str]:
    """A table of held-out errors of the laws: rms and median absolute deviation, per cent."""
    groups = {"test": np.array(table["test"]), "day": table["day"], "sky": table["sky"]}
    lines = [
        "| law for meter / camera | parameters | left-out test | left-out day | left-out sky |",
        "|---|---|---|---|---|",
    ]
    every = np.ones(len(table["camera"]), bool)
    for name, law in LAWS.items():
        values = ", ".join(f"{x:+.3f}" for x in fitted(law, table, every))
        cells = []
        for group in groups.values():
            left = held_out(law, table, group)
            if left is None:
                cells.append("cannot be told")
                continue
            cells.append(f"{100 * np.sqrt(np.mean(left**2)):.1f} % rms, {100 * np.median(np.abs(left)):.1f} % median")
        lines.append(f"| {name} | {values} | {' | '.join(cells)} |")
    left = np.log(table["meter"] / table["camera"])
    spread = {sky: 100 * np.exp(np.median(left[table["sky"] == sky])) for sky in ("clear", "partly cloudy")}
    lines += ["", "Median of meter / camera: " + ", ".join(f"{v:.0f} % ({k})" for k, v in spread.items()) + "."]
    return lines
