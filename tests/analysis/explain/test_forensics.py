"""The record as a record: each kind of mistake is told in a sentence, and a clean record gives none."""

import dataclasses
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from analysis.cases import Case
from analysis.explain.forensics import forensics
from analysis.explain.readings import Readings
from tests.analysis.explain.campaign import TESTS, Floats, Rows, light, make_case, rows_of
from tests.analysis.explain.roof import sky_case

Spoil = Callable[[Floats, Rows], Floats]


@pytest.fixture(scope="module")
def clean(tmp_path_factory: pytest.TempPathFactory) -> Case:
    return make_case(tmp_path_factory.mktemp("clean") / "case", files=False)


def _told(case: Case) -> str:
    return " | ".join(forensics(Readings.of(case)))


def _recorded(case: Case, spoil: Spoil) -> Case:
    measured = spoil(case.records.measured.copy(), rows_of(TESTS))
    return dataclasses.replace(case, records=dataclasses.replace(case.records, measured=measured))


def _stated(case: Case, **changed: Any) -> Case:
    """The case with facts of its first test changed."""
    first = case.tests[0].model_copy(update=changed)
    return dataclasses.replace(case, setup=case.setup.model_copy(update={"test": (first, *case.tests[1:])}))


def _without_the_brightest(values: Floats, rows: Rows) -> Floats:
    values[np.argsort(-light(rows))[:9]] = np.nan
    return values


def _without_some(values: Floats, rows: Rows) -> Floats:
    values[np.random.default_rng(3).choice(len(values), 200, replace=False)] = np.nan
    return values


def _second_as_first(values: Floats, rows: Rows) -> Floats:
    values[rows.test == 1] = values[rows.test == 0]
    return values


def _swapped(values: Floats, rows: Rows) -> Floats:
    first, other = rows.test == 0, rows.test == 4
    values[first], values[other] = values[other], values[first].copy()
    return values


MISTAKES: list[tuple[Spoil, str]] = [
    (_without_the_brightest, "None of the 9 readings predicted above"),
    (lambda y, rows: np.where(rows.gamma_deg == 45.0, 10.0 * np.round(y / 10.0), y), "gonio.g45 are multiples of 10"),
    (lambda y, rows: np.where(rows.gamma_deg == 45.0, 2.0 * np.round(y / 2.0), y), "means of five readings"),
    (lambda y, rows: np.where(rows.gamma_deg == 15.0, np.minimum(y, np.quantile(y, 0.9)), y), "the end of a range?"),
    (lambda y, rows: np.where(rows.gamma_deg == 25.0, y / 10.764, y), "lux for footcandles"),
    (lambda y, rows: np.where(rows.gamma_deg == 65.0, 17.0, y), "gonio.g65 shows 17 in 128 of 128 readings"),
    (lambda y, rows: np.where(np.arange(len(y)) == 7, -400.0, y), "1 readings are negative beyond their noise"),
    (_second_as_first, "Tests T1 and T2 hold the same readings to the last digit"),
    (_swapped, "The readings of test T1 fit the prediction of test T5"),
]


@pytest.mark.parametrize(("spoil", "sentence"), MISTAKES)
def test_each_mistake_of_a_recording_is_told(clean: Case, spoil: Spoil, sentence: str) -> None:
    assert sentence not in _told(clean)
    assert sentence in _told(_recorded(clean, spoil))


def test_a_clean_record_gives_no_finding(clean: Case) -> None:
    assert forensics(Readings.of(clean)) == []


def test_readings_that_are_missing_here_and_there_are_only_counted(clean: Case) -> None:
    told = _told(_recorded(clean, _without_some))
    assert "200 of 1280 readings are missing" in told
    assert "does the range end there" not in told


def test_a_picture_without_a_valid_exposure_here_and_there_is_told_and_left_out(tmp_path: Path) -> None:
    """Of a shadow, or a dead meter, more would be dark: that is not left out."""
    case = sky_case(tmp_path / "case")
    count = len(case.records)
    for dark, left in (([3], 1), ([3, 40], 2), (list(range(0, count, 10)), 0)):
        values = case.records.measured.copy()
        values[dark] = -1.0
        spoilt = dataclasses.replace(case, records=dataclasses.replace(case.records, measured=values))
        assert len(Readings.of(spoilt)) == count - left
        assert len(Readings.of(spoilt, measured_only=False)) == count
        assert (f"{left} readings are nothing" in _told(spoilt)) == bool(left)


def test_beyond_the_stated_range_nothing_is_missed(clean: Case) -> None:
    brightest = float(clean.records.simulated.max())
    stated = tuple(c.model_copy(update={"range_max": 0.9 * brightest}) for c in clean.channels)
    case = dataclasses.replace(clean, setup=clean.setup.model_copy(update={"channel": stated}))
    assert "does the range end there" not in _told(_recorded(case, _without_the_brightest))


def test_a_sun_that_does_not_follow_from_site_and_time_is_told(clean: Case) -> None:
    azimuth = clean.tests[0].sun_azimuth_deg
    assert azimuth is not None
    told = _told(_stated(clean, sun_azimuth_deg=azimuth + 15.0))
    assert "Test T1 states the sun at" in told
    assert "minutes" in told


def test_daylight_that_cannot_be_is_told(clean: Case) -> None:
    assert "diffuse illuminance" in _told(_stated(clean, diffuse_illuminance_lx=60_000.0, global_illuminance_lx=5e4))
    assert "is more than a sun at" in _told(_stated(clean, global_illuminance_lx=2e5))


def test_records_outside_their_test_and_above_their_range_are_told(clean: Case, tmp_path: Path) -> None:
    end = clean.tests[0].end
    assert end is not None
    assert "lie outside its start and end" in _told(_stated(clean, end=clean.tests[0].start))
    narrow = tuple(c.model_copy(update={"range_max": 500.0}) for c in clean.channels)
    case = dataclasses.replace(clean, setup=clean.setup.model_copy(update={"channel": narrow}))
    assert "lie above its range of 500" in _told(case)
