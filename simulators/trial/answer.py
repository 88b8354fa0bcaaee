"""Read an explanation as the contract has it (``labdaq-explanation/1``), as far as a score needs it."""

import json
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

from labdaq.errors import DataError

VERDICTS: Final = ("no-mismatch", "explained", "partly-explained", "unexplained")


@dataclass(frozen=True)
class Named:
    """One mechanism of an answer: its probability, and parameters as (value, standard uncertainty)."""

    id: str
    probability: float
    parameters: dict[str, tuple[float, float]] = field(default_factory=dict)


@dataclass(frozen=True)
class Either:
    """A cause with several names that the answer says are one in this case, and how probable it is that it is one."""

    ids: frozenset[str]
    probability: float


@dataclass(frozen=True)
class Place:
    """Where a mismatch was found; ``None`` means everywhere along that coordinate."""

    channels: tuple[str, ...] | None = None
    gamma_deg: tuple[float, float] | None = None
    c_deg: tuple[float, float] | None = None
    tests: tuple[str, ...] | None = None
    when: tuple[str, str] | None = None


@dataclass(frozen=True)
class Answer:
    """An explanation.

    Attributes
    ----------
    verdict
        One of `VERDICTS`.
    mechanisms
        What was named, in the answer's order.
    alternatives
        Sets of ids with their probability.
    indistinguishable
        Groups of ids that the answer says cannot be told apart.
    places
        Where it found mismatch.
    either
        What was found and is not named, since its names cannot be told apart.
    """

    verdict: str
    mechanisms: tuple[Named, ...] = ()
    alternatives: tuple[tuple[tuple[str, ...], float], ...] = ()
    indistinguishable: tuple[frozenset[str], ...] = ()
    places: tuple[Place, ...] = ()
    either: tuple[Either, ...] = ()


def read_answer(path: Path) -> Answer:
    """Read ``explanation.json``; raises `DataError` naming the file and the field that breaks the contract."""
    try:
        raw = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise DataError(f"{path}: {error}") from error
    try:
        return _parsed(raw)
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise DataError(f"{path}: not an explanation: {type(error).__name__}: {error}") from error


def _parsed(raw: dict[str, Any]) -> Answer:
    if raw["format"] != "labdaq-explanation/1":
        raise ValueError(f"format is {raw['format']!r}")
    if raw["verdict"] not in VERDICTS:
        raise ValueError(f"verdict is {raw['verdict']!r}")
    return Answer(
        verdict=raw["verdict"],
        mechanisms=tuple(_named(m) for m in raw.get("mechanisms", [])),
        alternatives=tuple((tuple(a["ids"]), float(a["probability"])) for a in raw.get("alternatives", [])),
        indistinguishable=tuple(frozenset(group) for group in raw.get("indistinguishable", [])),
        places=tuple(_place(m.get("where") or {}) for m in raw.get("mismatch", [])),
        either=tuple(Either(frozenset(m["ids"]), float(m["probability"])) for m in raw.get("either", [])),
    )


def _named(raw: dict[str, Any]) -> Named:
    parameters = {}
    for name, p in (raw.get("parameters") or {}).items():
        if p.get("value") is None or isinstance(p["value"], (str, bool)) or p.get("uncertainty") is None:
            continue
        parameters[name] = (float(p["value"]), float(p["uncertainty"]))
    return Named(str(raw["id"]), float(raw["probability"]), parameters)


def _place(raw: dict[str, Any]) -> Place:
    def two(name: str) -> tuple[float, float] | None:
        value = raw.get(name)
        return None if value is None else (float(value[0]), float(value[1]))

    when = raw.get("when")
    return Place(
        channels=tuple(raw["channels"]) if raw.get("channels") is not None else None,
        gamma_deg=two("gamma_deg"),
        c_deg=two("c_deg"),
        tests=tuple(raw["tests"]) if raw.get("tests") is not None else None,
        when=(str(when[0]), str(when[1])) if isinstance(when, list) and len(when) == 2 else None,
    )
