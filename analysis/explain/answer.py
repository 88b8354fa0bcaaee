"""Write an explanation down: explanation.json (format ``labdaq-explanation/1``) and predictions.csv."""

import csv
import io
import json
from pathlib import Path
from typing import Any

import numpy as np

from analysis.cases.model import Floats
from analysis.cases.read import COLUMNS
from analysis.explain import found_lenses
from analysis.explain.conclusion import Unnamed
from analysis.explain.condense import condensed
from analysis.explain.elsewhere import elsewhere
from analysis.explain.fit import Fit
from analysis.explain.heldout import deviations, rms
from analysis.explain.locate import Mismatch
from analysis.explain.mechanisms.base import Term, predict
from analysis.explain.mismatch import Explanation
from analysis.explain.next_measurement import next_measurement
from analysis.explain.readings import Readings
from analysis.explain.scene import Scene
from labdaq.clock import utc_text
from labdaq.whole_file import write_whole_bytes

FORMAT = "labdaq-explanation/1"


def answer(e: Explanation) -> dict[str, Any]:
    """The contract's JSON object, with more keys of our own (docs/explaining.md)."""
    found = e.conclusion
    agrees = found.verdict == "no-mismatch"
    return {
        "format": FORMAT,
        "title": e.scene.readings.case.setup.title,
        "verdict": found.verdict,
        "findings": e.findings,
        "mismatch": [] if agrees else [_place(m) for m in e.mismatch],
        "noted": [_place(m) for m in e.mismatch] if agrees else [],
        "mechanisms": named(e),
        "either": either(e),
        "alternatives": [{"ids": list(ids), "probability": _round(p)} for ids, p in found.not_claimed],
        "indistinguishable": [list(pair) for pair in found.indistinguishable],
        "ruled_out": [{"id": k, "because": v} for k, v in found.ruled_out.items()],
        "not_tried": [{"id": k, "because": v} for k, v in e.not_tried.items()],
        "leftover": [] if agrees else [_place(m) for m in e.leftover],
        "unnamed": [_unnamed(u) for u in found.unnamed_told],
        "fit": _fit(e),
        "next_measurement": _next(e),
        "evidence": [
            {"ids": list(h.ids), "nats_over_nothing": _round(h.evidence - found.nothing.evidence)}
            for h in found.singles
        ],
        "shared_error": e.shared.told(),
        "lenses": _lenses(e),
        "model": [_model(e.scene, term, found.best.fit, k) for k, term in enumerate(found.best.fit.terms)],
    }


def named(e: Explanation) -> list[dict[str, Any]]:
    """The mechanisms that are claimed, surest first; not those whose doubles do as well (`either`)."""
    return [row for row in _of_the_best(e) if row["id"] not in e.conclusion.either]


def either(e: Explanation) -> list[dict[str, Any]]:
    """What was found and has several names that these readings cannot tell apart: its ids, told as one."""
    alike = e.conclusion.either
    rows = [({"ids": [row["id"], *alike[row["id"]]]}, row) for row in _of_the_best(e) if row["id"] in alike]
    return [{**ids, **{key: value for key, value in row.items() if key != "id"}} for ids, row in rows]


def found_in(content: dict[str, Any]) -> list[dict[str, Any]]:
    """What an answer tells as found: its mechanisms, and what is either of several under all its names."""
    return [*content["mechanisms"], *({**m, "id": "either " + " or ".join(m["ids"])} for m in content["either"])]


def _of_the_best(e: Explanation) -> list[dict[str, Any]]:
    """What is found: the first name, then further ones, surest first; nothing where the verdict names nothing."""
    found = e.conclusion
    if found.verdict in {"no-mismatch", "unexplained"}:
        return []
    rows = []
    fit = found.best.fit
    for k, term in enumerate(fit.terms):
        theta, sd = _of_term(fit, k)
        rows.append(
            {
                "id": term.mechanism.id,
                "probability": _round(found.probability.get(term.mechanism.id, 0.0)),
                "parameters": term.mechanism.report(theta, sd, term),
                "way": term.branch.label,
                "statement": term.mechanism.statement(theta, term.branch),
            }
        )
    for wandering in found.best.wanders:
        wander = wandering.wander
        if wander.mechanism is None or wander.name in fit.ids:
            continue
        sized = list(zip(wander.mechanism.parameters, wandering.told, strict=False))
        rows.append(
            {
                "id": wander.name,
                "probability": _round(found.probability.get(wander.name, 0.0)),
                "parameters": {
                    p.name: {"value": _round(x), "uncertainty": _round(u), "unit": p.unit} for p, (x, u) in sized
                },
                "way": wander.along,
                "statement": wander.mechanism.statement(np.array([x for _, (x, _) in sized]), _no_branch()),
            }
        )
    return sorted(rows, key=lambda row: (row["id"] != found.best.first, -float(row["probability"])))


def _no_branch() -> Any:
    from analysis.explain.mechanisms.base import Branch

    return Branch()


def _of_term(fit: Fit, k: int) -> tuple[np.ndarray, np.ndarray]:
    """Parameters and their standard deviations of the k-th term."""
    start = sum(len(t.parameters) for t in fit.terms[:k])
    stop = start + len(fit.terms[k].parameters)
    sd = np.sqrt(np.diag(fit.covariance)) if len(fit.covariance) else np.zeros(len(fit.theta))
    return fit.theta[start:stop], sd[start:stop]


def _model(scene: Scene, term: Term, fit: Fit, k: int) -> dict[str, Any]:
    """What `labdaq predict` needs to apply a mechanism elsewhere."""
    theta, sd = _of_term(fit, k)
    only = _systems_changed(scene, term, theta)
    ours = elsewhere(scene, fit, k)
    return {
        **({"elsewhere": ours} if ours else {}),
        "id": term.mechanism.id,
        "way": term.branch.label,
        "facts": term.branch.facts,
        "theta": [float(x) for x in theta],
        "sd": [float(x) for x in sd],
        "names": [p.name for p in term.parameters],
        "only": only,
    }


def _lenses(e: Explanation) -> dict[str, Any]:
    """The lenses that our own re-simulations had, where something is named that other tests may need them for."""
    retraced = e.scene.retraced
    if retraced is None or retraced.simulator is None or not e.conclusion.best.fit.terms:
        return {}
    return found_lenses.told(retraced.simulator.traced_systems())


def _systems_changed(scene: Scene, term: Term, theta: Floats) -> list[str]:
    """The systems whose tests a mechanism changes; empty where it changes all of them."""
    r = scene.readings
    systems = np.array([t.system or "" for t in r.case.tests])[r.test]
    change = np.abs(predict(scene, (term,), theta) - r.simulated) > 1e-9 * r.scale
    touched = set(systems[change].tolist())
    return sorted(touched) if touched < set(systems.tolist()) else []


def _place(m: Mismatch) -> dict[str, Any]:
    told = {
        "where": m.region.where,
        "size_percent": _round(100 * m.share),
        "p_value": float(f"{m.p_value:.2g}"),
        "statement": m.statement,
    }
    return told | ({"holds": _round(m.holds), "rms_percent": _round(100 * m.rms)} if m.holds else {})


def _unnamed(u: Unnamed) -> dict[str, Any]:
    told = {"along": u.along, "nats": _round(u.gain), "size": _round(u.size)}
    return told if u.conjecture is None else {**told, "conjecture": u.conjecture.mechanism.leaves_out}


def _fit(e: Explanation) -> dict[str, Any]:
    fit: dict[str, Any] = {
        "records": len(e.whole.records) if e.whole is not e.scene.readings.case else len(e.scene.readings),
        "before": {"rms_percent": _round(100 * e.before), "chi2_per_dof": _round(e.chi2_before)},
        "after": {"rms_percent": _round(100 * e.after), "chi2_per_dof": _round(e.chi2_after)},
    }
    if e.again is not None:
        left = rms(deviations(e.scene.readings, e.again.predicted))
        fit["simulated_again"] = {"with": list(e.again.ids), "rms_percent": _round(100 * left)}
    fit["held_out"] = None
    if e.held_out is not None:
        fit["held_out"] = {
            "scheme": e.held_out.scheme,
            "before": {"rms_percent": _round(100 * e.held_out.before)},
            "after": {"rms_percent": _round(100 * e.held_out.after)},
            "after_with_shared_error": {"rms_percent": _round(100 * e.held_out.with_shared_error)},
            "groups": [
                {"left_out": n, "before": _round(100 * b), "after": _round(100 * a)} for n, b, a in e.held_out.groups
            ],
        }
    return fit


def _next(e: Explanation) -> dict[str, Any]:
    """Which reading would best separate the leading explanations, and by how much."""
    found = next_measurement(e.scene, e.conclusion)
    return {
        "statement": found.statement,
        "would_separate": found.would_separate,
        "nats_per_test": [{"like": test, "nats": _round(nats, 3)} for test, nats in found.nats_per_test],
    }


def _round(x: float, digits: int = 5) -> float:
    return float(f"{x:.{digits}g}")


def predictions_csv(e: Explanation) -> str:
    """records.csv with ``corrected`` and ``corrected_uncertainty`` (empty where there is no reading)."""
    r, best = e.scene.readings, e.conclusion.kept.fit
    corrected, sd = e.corrected, e.corrected_sd
    if e.whole is not r.case:
        relative = np.full(len(r.case.records), np.nan)
        relative[r.row] = sd / np.maximum(np.abs(corrected), 1e-12)
        scene = Scene(Readings.of(e.whole))
        r, (_, place) = scene.readings, condensed(e.whole)
        corrected = predict(scene, best.terms, best.theta)
        sd = corrected * relative[place[r.row]]
    columns = np.full((2, len(r.case.records)), np.nan)
    columns[:, r.row] = corrected / r.unit_factor, sd / r.unit_factor
    return records_with(r.case, *columns)


def records_with(case: Any, corrected: np.ndarray, sd: np.ndarray) -> str:
    """A case's records with ``corrected`` and ``corrected_uncertainty`` [the channel's unit], as CSV text."""
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow([*COLUMNS, "corrected", "corrected_uncertainty"])
    records = case.records
    for i in range(len(records)):
        row = [
            case.tests[records.test[i]].id,
            utc_text(int(records.utc_ns[i])) if records.utc_ns[i] >= 0 else "",
            case.channels[records.channel[i]].id,
        ]
        columns = (
            records.gamma_deg,
            records.c_deg,
            records.measured,
            records.uncertainty,
            records.simulated,
            records.sun,
            records.sky,
            corrected,
            sd,
        )
        row += ["" if np.isnan(column[i]) else f"{column[i]:.8g}" for column in columns]
        writer.writerow(row)
    return out.getvalue()


def write_json(path: Path, content: dict[str, Any]) -> None:
    """Write JSON whole or not at all."""
    text = json.dumps(content, indent=1, ensure_ascii=False, allow_nan=False) + "\n"
    write_whole_bytes(path, text.encode())
