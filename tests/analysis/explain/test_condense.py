"""Long series of a roof meter are weighed as means of neighbours, and corrected reading by reading."""

import csv
import dataclasses
import io
from pathlib import Path

import numpy as np
import pytest

from analysis.explain import condense
from analysis.explain.answer import answer, predictions_csv
from analysis.explain.condense import condensed
from analysis.explain.mismatch import explain
from tests.analysis.explain.campaign import NONE, make_case
from tests.analysis.explain.roof import sky_case
from tests.analysis.explain.test_roof_series import series


def test_few_readings_are_weighed_one_by_one(tmp_path: Path) -> None:
    case = series(tmp_path)
    same, place = condensed(case)
    assert same is case
    assert np.array_equal(place, np.arange(len(case.records)))


def test_neighbours_of_one_test_are_averaged(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(condense, "MOST", 30)
    case = series(tmp_path)
    measured = case.records.measured.copy()
    measured[7] = np.nan
    shuffled = np.random.default_rng(2).permutation(len(measured))
    records = dataclasses.replace(case.records, measured=measured)
    records = type(records)(*(getattr(records, f.name)[shuffled] for f in dataclasses.fields(records)))
    fewer, place = condensed(dataclasses.replace(case, records=records))
    made = fewer.records
    assert len(made) == 30
    assert np.array_equal(place == -1, np.isnan(records.measured))
    for k in range(len(made)):
        rows = np.flatnonzero(place == k)
        assert np.ptp(records.test[rows]) == 0 and made.test[k] == records.test[rows[0]]
        assert len(rows) in {3, 4}
        assert made.utc_ns[k] == pytest.approx(records.utc_ns[rows].mean(), abs=1000)
        for name in ("measured", "simulated", "sun", "sky"):
            assert getattr(made, name)[k] == pytest.approx(getattr(records, name)[rows].mean(), rel=1e-12)
        assert made.uncertainty[k] == pytest.approx(np.linalg.norm(records.uncertainty[rows]) / len(rows), rel=1e-12)
        others = np.delete(records.utc_ns, rows)[np.delete(records.test, rows) == made.test[k]]
        inside = (others > records.utc_ns[rows].min()) & (others < records.utc_ns[rows].max())
        assert np.count_nonzero(inside) <= np.count_nonzero(np.isnan(records.measured)), "neighbours only"


def test_an_arm_is_never_averaged_nor_a_picture(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A picture's directions are read once in each test."""
    monkeypatch.setattr(condense, "MOST", 30)
    for case in (make_case(tmp_path / "case", flaws=NONE), sky_case(tmp_path / "sky")):
        assert condensed(case)[0] is case


def test_a_gain_is_found_in_means_and_taken_off_every_reading(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(condense, "MOST", 60)
    case = series(tmp_path / "case", per_root_min=0.05, gain=1.08)
    found = explain(case)
    content = answer(found)
    assert content["mechanisms"][0]["id"] == "meter-gain"
    assert content["fit"]["records"] == len(case.records)
    assert any("60 means of neighbours" in finding for finding in content["findings"])
    rows = list(csv.DictReader(io.StringIO(predictions_csv(found))))
    assert len(rows) == len(case.records)
    off = [float(row["corrected"]) / float(row["measured"]) - 1.0 for row in rows]
    assert np.sqrt(np.mean(np.square(off))) < 0.015
    assert all(0.0 < float(row["corrected_uncertainty"]) < 0.1 * float(row["corrected"]) for row in rows)
