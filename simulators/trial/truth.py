"""The truth about a case: what was concealed, how strongly, and what the readings would be without noise."""

import json
from dataclasses import dataclass, field
from pathlib import Path

from simulators.trial.dials import Parameters
from simulators.trial.files import write_text

FORMAT = "labdaq-trial-truth/1"


@dataclass(frozen=True)
class Concealed:
    """One concealed cause.

    Attributes
    ----------
    id, stage, inside
        Its name, its stage, and whether the catalogue has it.
    effect_percent, raw_percent
        Rms change of the noise-free readings, with and without a free gain per test removed.
    parameters
        Name to value and unit.
    systems
        Systems it concerns; empty for all.
    equivalents
        Other ids that are physically the same in this case.
    where
        For physics outside the catalogue: rough place of its effect, e.g. ``{"gamma_deg": [60, 85]}``.
    """

    id: str
    stage: str
    inside: bool
    effect_percent: float
    raw_percent: float
    parameters: Parameters
    systems: tuple[str, ...] = ()
    equivalents: tuple[str, ...] = ()
    where: dict[str, object] = field(default_factory=dict)
    notes: dict[str, object] = field(default_factory=dict)


@dataclass(frozen=True)
class Truth:
    """The truth about one case.

    Attributes
    ----------
    case, kind, seed
        Name of the case, kind of its channels, and the seed it was made with.
    content
        ``null``, ``single``, ``pair`` or ``open``.
    concealed
        The causes.
    effect_percent
        Rms change by all of them together.
    mismatch_percent
        Rms difference of the noise-free readings from the prediction, gain per test removed where it is free.
    nuisance_percent
        The same without anything concealed: the ripple that a perfect explanation would be left with.
    free_gain
        Whether a gain per test is free in this kind of case.
    clean
        Noise-free readings in the order of the case's records.
    change
        Relative change of each of them that is due to what is concealed, gain per test removed where it is free.
    withheld_clean
        The same for the withheld tests; empty if there are none.
    """

    case: str
    kind: str
    seed: int
    content: str
    concealed: tuple[Concealed, ...]
    effect_percent: float
    mismatch_percent: float
    nuisance_percent: float
    free_gain: bool
    floor: float
    clean: tuple[float, ...]
    change: tuple[float, ...] = ()
    withheld_clean: tuple[float, ...] = ()
    care: dict[str, float] = field(default_factory=dict)
    notes: dict[str, object] = field(default_factory=dict)


def write(truth: Truth, path: Path) -> None:
    """Write a truth as JSON."""
    write_text(path, json.dumps(as_json(truth), indent=1) + "\n")


def as_json(truth: Truth) -> dict[str, object]:
    """The truth as plain values."""
    return {
        "format": FORMAT,
        "case": truth.case,
        "kind": truth.kind,
        "seed": truth.seed,
        "content": truth.content,
        "hidden": [
            {
                "id": c.id,
                "stage": c.stage,
                "in_catalogue": c.inside,
                "effect_percent": round(c.effect_percent, 4),
                "effect_without_free_gain_percent": round(c.raw_percent, 4),
                "parameters": {k: {"value": v, "unit": u} for k, (v, u) in c.parameters.items()},
                "systems": list(c.systems),
                "equivalents": list(c.equivalents),
                "where": c.where,
                "notes": c.notes,
            }
            for c in truth.concealed
        ],
        "effect_percent": round(truth.effect_percent, 4),
        "mismatch_percent": round(truth.mismatch_percent, 4),
        "nuisance_percent": round(truth.nuisance_percent, 4),
        "free_gain_per_test": truth.free_gain,
        "floor": truth.floor,
        "care": truth.care,
        "notes": truth.notes,
        "clean": [float(f"{x:.7g}") for x in truth.clean],
        "change": [float(f"{x:.4g}") for x in truth.change],
        "withheld_clean": [float(f"{x:.7g}") for x in truth.withheld_clean],
    }


def read(path: Path) -> Truth:
    """Read a truth that `write` wrote."""
    raw = json.loads(path.read_text(encoding="utf-8"))
    if raw.get("format") != FORMAT:
        from labdaq.errors import DataError

        raise DataError(f"{path}: format is {raw.get('format')!r}, not {FORMAT!r}")
    concealed = tuple(
        Concealed(
            id=c["id"],
            stage=c["stage"],
            inside=c["in_catalogue"],
            effect_percent=c["effect_percent"],
            raw_percent=c["effect_without_free_gain_percent"],
            parameters={k: (v["value"], v["unit"]) for k, v in c["parameters"].items()},
            systems=tuple(c["systems"]),
            equivalents=tuple(c["equivalents"]),
            where=c["where"],
            notes=c["notes"],
        )
        for c in raw["hidden"]
    )
    return Truth(
        case=raw["case"],
        kind=raw["kind"],
        seed=raw["seed"],
        content=raw["content"],
        concealed=concealed,
        effect_percent=raw["effect_percent"],
        mismatch_percent=raw["mismatch_percent"],
        nuisance_percent=raw["nuisance_percent"],
        free_gain=raw["free_gain_per_test"],
        floor=raw["floor"],
        clean=tuple(raw["clean"]),
        change=tuple(raw["change"]),
        withheld_clean=tuple(raw["withheld_clean"]),
        care=raw["care"],
        notes=raw["notes"],
    )
