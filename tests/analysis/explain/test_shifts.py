"""Clocks that are off by more than a cloud takes to pass."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from analysis.explain.answer import answer
from analysis.explain.fit import MIDDLE, Fitter
from analysis.explain.form_error import form_error, locally_wrong
from analysis.explain.hypothesis import Hypothesis
from analysis.explain.mechanisms.catalogue import BY_ID
from analysis.explain.mechanisms.states import terms_of
from analysis.explain.mismatch import explain
from analysis.explain.moment_error import moment_error
from analysis.explain.readings import Readings
from analysis.explain.scene import Scene
from analysis.explain.search import Search
from analysis.explain.series import unrest
from analysis.explain.shifts import likely_shifts, saw_the_clouds
from tests.analysis.explain import test_roof_series as roof


@pytest.fixture(autouse=True)
def by_the_minute(monkeypatch: pytest.MonkeyPatch) -> None:
    """Forty readings a day, a minute apart."""
    monkeypatch.setattr(roof, "STEP_S", 60)


@pytest.mark.parametrize("late_s", [-310.0, 130.0, 400.0])
def test_ups_and_downs_tell_a_shift(tmp_path: Path, late_s: float) -> None:
    scene = Scene(Readings.of(roof.series(tmp_path / "case", late_s=late_s)))
    first = likely_shifts(scene, 75.0)[0]
    assert first == pytest.approx(late_s / 60.0, abs=0.4)


def test_nothing_is_likelier_than_no_shift_where_there_is_none(tmp_path: Path) -> None:
    scene = Scene(Readings.of(roof.series(tmp_path / "case")))
    assert likely_shifts(scene, 75.0).size == 0


@pytest.mark.parametrize(("late_s", "told"), [(1100.0, True), (1800.0, False)])
def test_a_short_overlap_tells_nothing(tmp_path: Path, late_s: float, told: bool) -> None:
    """Of forty minutes only shifts of less than twenty leave half."""
    shifts = likely_shifts(Scene(Readings.of(roof.series(tmp_path / "case", late_s=late_s))), 75.0)
    assert np.any(np.abs(shifts - late_s / 60.0) < 0.5) == told


def test_a_clock_is_found_beyond_what_a_slope_shows(tmp_path: Path) -> None:
    """Seven minutes, where each reading differs from the one before by a cloud: no scatter is left to tell it."""
    search = Search(Fitter(Scene(Readings.of(roof.series(tmp_path / "case", late_s=430.0, per_root_min=0.8)))))
    best = min(search.looks["clock-offset"], key=lambda fit: fit.objective)
    assert best.theta[0] == pytest.approx(430.0 / 60.0, abs=0.3)


def test_what_clouds_do_between_two_readings_does_not_hide_how_late_a_series_is(tmp_path: Path) -> None:
    content = answer(explain(roof.series(tmp_path / "case", late_s=430.0, per_root_min=0.8)))
    assert [m["id"] for m in content["mechanisms"]] == ["clock-offset"]
    told = content["mechanisms"][0]["parameters"]["offset_min"]
    assert abs(told["value"] - 430.0 / 60.0) < 2.0 * told["uncertainty"] < 2.5


def test_two_fits_are_alike_only_if_they_are_one(tmp_path: Path) -> None:
    """A clock stands in several ways among the singles: looking one up compares no arrays."""
    fitter = Fitter(Scene(Readings.of(roof.series(tmp_path / "case"))))
    (way, *_) = terms_of(BY_ID["clock-offset"], fitter.scene)
    one, other = (Hypothesis(fitter.fit((way,), np.array([60.0]), MIDDLE), 0.0) for _ in range(2))
    assert one in [one]
    assert one not in [other]


def test_readings_count_for_less_where_a_cloud_passes_between_two_instruments(tmp_path: Path) -> None:
    """Two seconds scatter by per cents there, which is nobody's fault."""
    late = roof.series(tmp_path / "late", late_s=2.0, per_root_min=1.2)
    assert answer(explain(late))["verdict"] == "no-mismatch"
    scene = Scene(Readings.of(late))
    restless = unrest(scene)
    told = 1.0 / np.sqrt(Fitter(scene).whitener(MIDDLE).squares(np.eye(len(restless))))
    wild, calm = (np.median(told[rows]) for rows in (restless > 0.2, restless < 0.05))
    assert wild > 0.2 * np.sqrt(2.0 / 60.0) > 2.0 * calm


def test_a_model_of_the_sky_is_no_instrument_that_reads_seconds_later(tmp_path: Path) -> None:
    beside_a_meter, beside_a_model = (
        Scene(Readings.of(roof.series(tmp_path / name, noise=noise)))
        for name, noise in (("meter", 0.003), ("sky", 0.0))
    )
    assert not np.any(moment_error(beside_a_model))
    restless = unrest(beside_a_meter)
    assert moment_error(beside_a_meter) == pytest.approx(restless * np.sqrt(2.0 / 60.0), rel=0.2)


def test_what_clouds_did_between_two_readings_is_not_known(tmp_path: Path) -> None:
    """Nothing is unknown at whole steps, and most halfway; of a bridge between known ends a quarter of a step."""
    scene = Scene(Readings.of(roof.series(tmp_path / "case", per_root_min=0.8)))
    (way,) = [t for t in terms_of(BY_ID["clock-offset"], scene) if t.branch.value == "series"]
    whole, halfway = (form_error(scene, (way,), np.array([minutes])) for minutes in (3.0, 3.5))
    assert len(halfway) == len(whole) + 1
    assert halfway[0].amplitude == pytest.approx(0.5)
    assert locally_wrong(scene, (way,), np.array([3.5])) == pytest.approx(0.5 * unrest(scene))


def test_nothing_stands_beside_a_clock_for_what_clouds_did_between_two_readings(tmp_path: Path) -> None:
    case = roof.series(tmp_path / "case", late_s=-260.0, per_root_min=1.5)
    fitter = Fitter(Scene(Readings.of(case)))
    (clock, *_) = [h for h in Search(fitter).singles() if h.ids == ("clock-offset",) and not h.wanders]
    plain = fitter.fit(clock.fit.terms, clock.fit.theta, MIDDLE)
    fitter.weigh([plain])
    assert clock.evidence > plain.log_evidence + 10.0
    assert [m["id"] for m in answer(explain(case))["mechanisms"]] == ["clock-offset"]


@pytest.mark.parametrize(("per_root_min", "ways"), [(0.8, 1), (0.0, 2)])
def test_whoever_saw_the_same_clouds_can_only_be_late_for_all_of_them(
    tmp_path: Path, per_root_min: float, ways: int
) -> None:
    """The sun alone would be later under a clear sky, or beside a model whose clouds are none of these."""
    scene = Scene(Readings.of(roof.series(tmp_path / "case", late_s=240.0, per_root_min=per_root_min)))
    assert len(terms_of(BY_ID["clock-offset"], scene)) == ways
    assert saw_the_clouds(scene, 75.0) == (ways == 1)


def test_clouds_of_another_day_are_not_the_same(tmp_path: Path) -> None:
    case = roof.series(tmp_path / "case", per_root_min=0.8)
    other = replace(case.records, measured=case.records.measured.reshape(3, -1)[[1, 2, 0]].ravel())
    scene = Scene(Readings.of(replace(case, records=other)))
    assert not saw_the_clouds(scene, 15.0)
