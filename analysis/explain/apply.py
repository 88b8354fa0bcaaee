"""Apply what was found to other tests of the same station, with the fitted parameters and no new fit."""

import json
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from analysis.cases import Case
from analysis.cases.model import Floats
from analysis.explain.answer import FORMAT, records_with
from analysis.explain.found_lenses import FoundLenses, lenses_of
from analysis.explain.in_own_words import in_own_words
from analysis.explain.mechanisms.base import Mechanism, Term, predict
from analysis.explain.mechanisms.catalogue import BY_ID
from analysis.explain.mechanisms.states import in_its_state, terms_of
from analysis.explain.noise import USUAL
from analysis.explain.readings import Readings
from analysis.explain.retrace import Retraced, Simulator
from analysis.explain.scene import Scene, scene_of
from analysis.explain.shared_error import SharedError
from labdaq.errors import DataError

_SIMULATED = {
    "circumsolar-aureole",
    "lens-haze",
    "soiling",
    "lens-anisotropy",
    "lens-orientation",
    "wall-reflectance",
    "bounce-truncation",
    "wall-scatter",
    "near-field",
    "room-interreflection",  # in a room that is told, or supposed
}


@dataclass(frozen=True)
class Model:
    """What an explanation says of other cases: mechanisms as fitted, the simulation's shared error, and its lenses."""

    entries: tuple[dict[str, Any], ...] = ()
    shared: SharedError = field(default_factory=lambda: SharedError({}, {}))
    lenses: FoundLenses = field(default_factory=FoundLenses)

    @property
    def mechanisms(self) -> frozenset[str]:
        """Ids of those that act."""
        return frozenset(str(entry["id"]) for entry in self.entries)

    def without_shared_error(self) -> "Model":
        """The mechanisms alone."""
        return replace(self, shared=SharedError({}, {}))


def read_model(folder: Path) -> Model:
    """The fitted mechanisms of ``folder/explanation.json``; raises `DataError` if it is not an explanation.

    Where nothing is named, only the simulation's shared error is corrected.
    """
    path = folder / "explanation.json"
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise DataError(f"{path}: there is no such file", "give the folder that `labdaq explain --out` wrote") from None
    except OSError as error:
        raise DataError(f"{path}: cannot be read: {error.strerror}") from None
    except (json.JSONDecodeError, UnicodeDecodeError) as error:
        raise DataError(f"{path}: not valid JSON: {error}") from None
    if not _is_explanation(content):
        raise DataError(f"{path}: not an explanation that `labdaq explain` wrote")
    try:
        shared = SharedError.of(content["shared_error"])
        lenses = lenses_of(content.get("lenses", {}))  # those of earlier versions tell none
    except (KeyError, TypeError, ValueError, AttributeError):
        raise DataError(f"{path}: not an explanation that `labdaq explain` wrote") from None
    named = content["verdict"] in {"explained", "partly-explained"}
    return Model(tuple(content["model"]) if named else (), shared, lenses)


def _is_explanation(content: object) -> bool:
    """Whether the parts that a prediction reads are there and of their kinds."""
    if not isinstance(content, dict) or content.get("format") != FORMAT:
        return False
    model = content.get("model")
    return isinstance(content.get("verdict"), str) and isinstance(model, list) and all(_is_entry(e) for e in model)


def _is_entry(entry: object) -> bool:
    if not isinstance(entry, dict) or entry.get("id") not in BY_ID or not isinstance(entry.get("way"), str):
        return False
    numbers, facts = (entry.get("theta"), entry.get("sd")), entry.get("facts")
    if not all(isinstance(n, list) and all(isinstance(x, int | float) for x in n) for n in numbers):
        return False
    only = entry.get("only", [])
    if not isinstance(only, list) or not all(isinstance(name, str) for name in only):
        return False
    if not _is_elsewhere(entry.get("elsewhere")):
        return False
    sizes = {len(entry["theta"]), len(entry["sd"]), len(entry.get("names") or [])}
    return len(sizes) == 1 and isinstance(facts, dict) and all(isinstance(x, int | float) for x in facts.values())


def _is_elsewhere(told: object) -> bool:
    """Whether it is what `analysis.explain.elsewhere` tells, or nothing."""
    if told is None:
        return True
    if not isinstance(told, dict) or not isinstance(told.get("way"), str):
        return False
    theta, names = told.get("theta"), told.get("names")
    if not isinstance(theta, list) or not isinstance(names, list) or not len(theta) == len(names) == 1:
        return False
    return all(isinstance(x, int | float) for x in (*theta, told.get("share")))


def apply_model(model: Model, case: Case, simulator: Simulator | None = None) -> str:
    """The case's records with ``corrected`` and ``corrected_uncertainty``, as CSV text; ``measured`` is not looked at.

    A mechanism that acted on some systems only acts on those of them that are here. On the named mechanisms follows
    what the fitted tests say of the simulation's own error, for systems and sensors of the same names.

    Raises `DataError` when a mechanism cannot be applied because the case lacks what it needs.
    """
    scene = scene_of(case, simulator, measured_only=False)
    readings = scene.readings
    here = {t.system or "" for t in case.tests}
    entries = [in_own_words(e, scene) for e in model.entries if not e.get("only") or here & set(e["only"])]
    terms = tuple(_term(entry, scene) for entry in entries)
    theta = np.array([x for entry in entries for x in entry["theta"]])
    sd = np.array([x for entry in entries for x in entry["sd"]])
    corrected = predict(scene, terms, theta)
    variance = np.zeros(len(readings))
    for k in range(len(theta)):
        moved = theta.copy()
        moved[k] += 0.1 * sd[k]
        variance += ((predict(scene, terms, moved) - corrected) / 0.1) ** 2
    corrected = corrected * np.exp(model.shared.at(scene))
    variance += (_usual(readings) * corrected) ** 2
    return records_with(case, corrected / readings.unit_factor, np.sqrt(variance) / readings.unit_factor)


def _usual(readings: Readings) -> Floats:
    """Relative standard uncertainty of gain and shape that no explanation removes; shape (N,)."""
    size = {kind: np.sqrt(u.gain**2 + u.shape**2 + u.shape_of_test**2 + u.scatter**2) for kind, u in USUAL.items()}
    return np.array([size[str(k)] for k in readings.kind])


def _term(entry: dict[str, Any], scene: Scene) -> Term:
    mechanism, facts, share = BY_ID[entry["id"]], dict(entry["facts"]), float(entry.get("share", 1.0))
    if scene.retraced is not None and (brought := _of_label(entry, _brought(mechanism, scene, scene.retraced))):
        return replace(brought[0], branch=replace(brought[0].branch, facts=facts), share=share)
    because = mechanism.why_not(scene)
    ways = () if because else terms_of(mechanism, scene)
    if {"from_utc_s", "until_utc_s"} & set(facts):
        found = _in_state(entry, scene, ways)
    else:
        found = _of_label(entry, ways)
        if not found and mechanism.id in _SIMULATED:
            # a re-simulation is named after where it came from; the same setting of another origin serves as well
            found = _of_settings(entry, ways)
    if not found:
        raise DataError(
            f"{mechanism.id} ({entry['way']}) cannot be applied to this case: {because or 'it has no such way'}",
            "bring the variants, systems, channels or facts that the mechanism needs (labdaq mechanisms)",
        )
    branch = replace(found[0].branch, facts=facts)
    return replace(found[0], branch=branch, parameters=mechanism.parameters_in(scene, branch), share=share)


def _brought(mechanism: Mechanism, scene: Scene, retraced: Retraced) -> tuple[Term, ...]:
    """The ways for which the case itself brings what they need: nothing has to be simulated for them."""
    bare = replace(scene, retraced=replace(retraced, simulator=None))
    return () if mechanism.why_not(bare) else terms_of(mechanism, bare)


def _of_label(entry: dict[str, Any], ways: tuple[Term, ...]) -> list[Term]:
    """The way of that label; of one system's, that of all systems serves where there is no other system."""
    labels = [entry["way"]]
    for system in entry.get("only", []):
        labels += [entry["way"].removesuffix(f", {system} only"), entry["way"].replace(system, "every system", 1)]
    return next(([t] for label in labels for t in ways if t.branch.label == label), [])


def _of_settings(entry: dict[str, Any], ways: tuple[Term, ...]) -> list[Term]:
    """Ways with the same settings, of the same system first where one alone was changed."""
    found = [t for t in ways if [p.name for p in t.parameters] == entry["names"]]
    only = entry.get("only", [])
    return sorted(
        found, key=lambda t: not any(t.branch.label == n or t.branch.label.endswith(f", {n} only") for n in only)
    )


def _in_state(entry: dict[str, Any], scene: Scene, ways: tuple[Term, ...]) -> list[Term]:
    """A meter's state that began or ended at an instant: it acts in this case's tests on the same side of it."""
    if not scene.readings.has_times:
        raise DataError(
            f"{entry['id']} ({entry['way']}) cannot be applied to this case: its records carry no time",
            "give the records' times: the meter's state changed during the campaign",
        )
    whole = [t for t in ways if t.tests is None and entry["way"].startswith(f"{t.branch.label}, ")]
    return [in_its_state(t, scene, entry["way"], entry["facts"]) for t in whole]
