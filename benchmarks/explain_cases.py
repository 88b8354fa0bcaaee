"""Cases with a known truth, and how far a prediction is from it, for `benchmarks/explain.py`."""

import json
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from analysis.cases import read_case
from analysis.cases.model import Floats
from simulators.trial import truth as truths
from simulators.trial.truth import Concealed


@dataclass(frozen=True)
class Task:
    """A case with its truth."""

    folder: Path
    withheld: Path | None
    truth: truths.Truth


def tasks(folders: list[Path], count: int | None, kinds: set[str]) -> list[Task]:
    """The cases with a truth, at most ``count`` of them, evenly over the kinds of content."""
    cases, answers = (folders[0] / "cases", folders[0] / "truth") if len(folders) == 1 else folders
    found: dict[str, list[Task]] = {}
    for path in sorted(answers.glob("*.json")):
        folder = cases / path.stem
        if not folder.is_dir():
            continue
        truth = truth_of(path, folder)
        if truth.kind in kinds:
            withheld = cases / f"{path.stem}-withheld"
            task = Task(folder, withheld if withheld.is_dir() else None, truth)
            found.setdefault(truth.content, []).append(task)
    total = sum(len(group) for group in found.values())
    share = min(1.0, (count or total) / max(total, 1))
    return [task for group in found.values() for task in group[: max(1, round(share * len(group)))]]


def truth_of(path: Path, folder: Path) -> truths.Truth:
    """A truth of the trial's own format, or of another author's with the same main fields."""
    raw = json.loads(path.read_text(encoding="utf-8"))
    if raw.get("format") == truths.FORMAT:
        return truths.read(path)
    kind = {c.kind for c in read_case(folder).channels}
    gonio, roof = "goniometer" in kind, kind == {"illuminance-meter"}
    size = "effect_raw_percent" if roof else "effect_percent"  # on a roof a gain is the message, no nuisance
    concealed = tuple(
        Concealed(
            id=c["id"],
            stage="",
            inside=c["in_catalogue"],
            effect_percent=c[size] if size in c else c["effect_percent"],
            raw_percent=c.get("effect_raw_percent", c["effect_percent"]),
            parameters={k: (v["value"], v["unit"]) for k, v in c.get("parameters", {}).items()},
            equivalents=tuple(c.get("equivalents", ())),
        )
        for c in raw["hidden"]
    )
    clean = np.array(raw["clean"])
    return truths.Truth(
        case=path.stem,
        kind="goniometer" if gonio else "roof" if roof else "camera",
        seed=0,
        content=raw["content"],
        concealed=concealed,
        effect_percent=max((c.effect_percent for c in concealed), default=0.0),
        mismatch_percent=_number(raw.get("mismatch_percent")),
        nuisance_percent=_number(raw.get("nuisance_percent")),
        free_gain=not roof,
        floor=1e-3 * float(clean.max()),
        clean=tuple(clean.tolist()),
        change=tuple(raw["change"]),
    )


def _number(value: float | None) -> float:
    return float("nan") if value is None else float(value)


def error(values: Floats, clean: Floats, test: np.ndarray, truth: truths.Truth) -> float:
    """Rms relative error [%] of ``values`` on a scale that is logarithmic above the truth's floor, linear below.

    (A difference over the mean of both, as the trial takes it, cannot exceed 2: with a gain per test removed, a
    prediction that is wild everywhere would look perfect.)
    """
    relative = np.arcsinh(values / truth.floor) - np.arcsinh(clean / truth.floor)
    if truth.free_gain:
        for k in np.unique(test):
            relative[test == k] -= np.mean(relative[test == k])
    return float(100.0 * np.sqrt(np.mean(relative**2)))
