"""A comparison as tables (CSV) and as one JSON object."""

import csv
import io
import json
import math
from collections.abc import Iterable, Sequence
from dataclasses import asdict
from typing import Any, Final

from analysis.compare.metrics import Comparison
from analysis.compare.peaks import Peak, PeakPair
from analysis.compare.plots import relative_difference
from analysis.compare.shape import Rings

FORMAT: Final = "labdaq-comparison-report/1"


def as_json(comparison: Comparison) -> dict[str, Any]:
    """Everything a comparison says, as plain values; what is unknown is null."""
    tests = []
    for t in comparison.tests:
        facts = t.test.model_dump(mode="json", exclude={"simulated"}, exclude_none=True)
        against = [
            {
                "simulation": name,
                **asdict(a.agreement),
                "rings": _rings(a.rings),
                "peaks": [_pair(p) for p in a.peaks],
            }
            for name, a in t.against.items()
        ]
        tests.append({**facts, "against": against})
    groups = [
        {**{k: v for k, v in asdict(g).items() if k != "rings"}, "rings": _rings(g.rings)} for g in comparison.groups
    ]
    channels = [{**asdict(c), "test": c.test.id} for c in comparison.channels]
    content = {
        "format": FORMAT,
        "title": comparison.case.setup.title,
        "simulations": [s.name for s in comparison.simulations],
        "tests": tests,
        "groups": groups,
        "channels": channels,
    }
    plain: dict[str, Any] = _plain(content)
    return plain


def json_text(content: dict[str, Any]) -> str:
    """JSON text that every reader takes (no NaN)."""
    return json.dumps(content, indent=1, ensure_ascii=False, allow_nan=False) + "\n"


def csv_files(comparison: Comparison) -> dict[str, str]:
    """Tables by file name: campaign, groups, rings, peaks, differences, channels; only those that have rows."""
    tables = {
        "campaign.csv": _campaign(comparison),
        "groups.csv": _groups(comparison),
        "rings.csv": _ring_rows(comparison),
        "peaks.csv": _peak_rows(comparison),
        "differences.csv": _difference_rows(comparison),
        "channels.csv": _channel_rows(comparison),
    }
    return {name: _csv(rows) for name, rows in tables.items() if len(rows) > 1}


def _campaign(comparison: Comparison) -> list[Sequence[object]]:
    rows: list[Sequence[object]] = []
    for t in comparison.tests:
        for name, a in t.against.items():
            facts = (t.test.id, t.test.system, t.test.sky, t.test.sun_altitude_deg, t.test.sun_azimuth_deg, name)
            rows.append((*facts, *asdict(a.agreement).values()))
            names = asdict(a.agreement)
    if not rows:
        return []
    return [("test", "system", "sky", "sun_altitude_deg", "sun_azimuth_deg", "simulation", *names), *rows]


def _groups(comparison: Comparison) -> list[Sequence[object]]:
    head = ("group", "simulation", "tests", "flux_ratio", "flux_ratio_scatter")
    rows: list[Sequence[object]] = [(*head, "shape_difference", "shape_difference_worst", "rms_percent")]
    for g in comparison.groups:
        shape = (g.shape_difference, g.shape_difference_worst, g.rms_percent)
        rows.append((g.label, g.simulation, len(g.tests), g.flux_ratio, g.flux_ratio_scatter, *shape))
    return rows


def _ring_rows(comparison: Comparison) -> list[Sequence[object]]:
    head = ("test", "simulation", "gamma_deg", "difference_percent", "uncertainty_percent", "lowest", "highest")
    rows: list[Sequence[object]] = [head]
    for t in comparison.tests:
        for name, a in t.against.items():
            r = a.rings
            rows += [
                (t.test.id, name, *values)
                for values in zip(r.gamma_deg, r.percent, r.uncertainty, r.lowest, r.highest, strict=True)
            ]
    return rows


def _peak_rows(comparison: Comparison) -> list[Sequence[object]]:
    sides = [f"{side}_{what}" for side in ("measured", "simulated") for what in ("gamma_deg", "c_deg", "candela")]
    rows: list[Sequence[object]] = [("test", "simulation", *sides, "apart_deg")]
    for t in comparison.tests:
        for name, a in t.against.items():
            for pair in a.peaks:
                rows.append((t.test.id, name, *_peak(pair.measured), *_peak(pair.simulated), pair.apart_deg))
    return rows


def _peak(peak: Peak | None) -> tuple[float | None, ...]:
    return (None, None, None) if peak is None else (peak.gamma_deg, peak.c_deg, peak.candela)


def _difference_rows(comparison: Comparison) -> list[Sequence[object]]:
    head = ("test", "simulation", "gamma_deg", "c_deg", "measured_cd", "uncertainty_cd", "simulated_cd")
    rows: list[Sequence[object]] = [(*head, "difference_percent")]
    for t in comparison.tests:
        scan = t.scan
        for name in t.against:
            values = scan.simulated[name]
            columns = (scan.gamma, scan.c, scan.measured, scan.uncertainty, values, relative_difference(scan, values))
            rows += [(t.test.id, name, *numbers) for numbers in zip(*columns, strict=True)]
    return rows


def _channel_rows(comparison: Comparison) -> list[Sequence[object]]:
    head = ("test", "channel", "unit", "simulation", "readings", "measured", "simulated", "ratio", "ratio_scatter")
    rows: list[Sequence[object]] = [head]
    for c in comparison.channels:
        rows.append((c.test.id, *(getattr(c, name) for name in head[1:])))
    return rows


def _csv(rows: Iterable[Sequence[object]]) -> str:
    out = io.StringIO()
    csv.writer(out, lineterminator="\n").writerows([_cell(v) for v in row] for row in rows)
    return out.getvalue()


def _cell(value: object) -> object:
    if value is None or (isinstance(value, float) and math.isnan(value)):
        return ""
    return f"{value:.7g}" if isinstance(value, float) else value


def _rings(r: Rings) -> list[dict[str, float]]:
    names = ("gamma_deg", "percent", "uncertainty", "lowest", "highest")
    columns = [getattr(r, name).tolist() for name in names]
    return [dict(zip(names, row, strict=True)) for row in zip(*columns, strict=True)]


def _pair(pair: PeakPair) -> dict[str, Any]:
    return {
        "measured": None if pair.measured is None else asdict(pair.measured),
        "simulated": None if pair.simulated is None else asdict(pair.simulated),
        "apart_deg": pair.apart_deg,
    }


def _plain(value: Any) -> Any:
    """Without NaN and tuples, which JSON does not have."""
    if isinstance(value, dict):
        return {k: _plain(v) for k, v in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(v) for v in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value
