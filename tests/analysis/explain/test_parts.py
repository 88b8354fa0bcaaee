"""Where a case gives only the sum of sun and sky, our own simulation tells them apart."""

from pathlib import Path

import numpy as np
import pytest

from analysis.explain.mismatch import explain
from analysis.explain.readings import Readings
from analysis.explain.scene import Scene, scene_of
from tests.analysis.explain import effects
from tests.analysis.explain.campaign import make_case
from tests.analysis.explain.untraced import Untraced


@pytest.fixture
def own(tmp_path: Path) -> Untraced:
    return Untraced(Scene(Readings.of(make_case(tmp_path / "given"))).fields.sky)


def test_the_parts_come_back(tmp_path: Path, own: Untraced) -> None:
    whole = make_case(tmp_path / "whole", parts=False, files=False)
    assert not Scene(Readings.of(whole)).readings.has_parts
    scene, given = scene_of(whole, own), Readings.of(make_case(tmp_path / "given", files=False))
    assert scene.readings.has_parts
    assert scene.readings.sun + scene.readings.sky == pytest.approx(scene.readings.simulated)
    assert np.sqrt(np.mean((scene.readings.sun - given.sun) ** 2)) < 0.03 * np.sqrt(np.mean(given.sun**2))


def test_parts_that_are_given_stay(tmp_path: Path, own: Untraced) -> None:
    case = make_case(tmp_path / "case")
    scene = scene_of(case, Untraced(0.5 * own.sky))
    assert scene.sky_part is None
    assert np.array_equal(scene.readings.sun, Readings.of(case).sun)


def test_files_tell_the_parts_of_sums(tmp_path: Path, own: Untraced) -> None:
    """No simulation is asked: what the files give apart is the prediction's own."""
    given = Readings.of(make_case(tmp_path / "given"))
    case = make_case(tmp_path / "case", parts=False)
    assert not Readings.of(case).has_parts
    scene = scene_of(case, Untraced(0.5 * own.sky))
    r = scene.readings
    assert r.has_parts and scene.sky_part is None
    assert r.sun + r.sky == pytest.approx(r.simulated)
    assert np.sqrt(np.mean((r.sun - given.sun) ** 2)) < 0.01 * np.sqrt(np.mean(given.sun**2))
    assert np.sqrt(np.mean((r.sky - given.sky) ** 2)) < 0.01 * np.sqrt(np.mean(given.sky**2))


def test_a_system_that_cannot_be_traced_stays_whole(tmp_path: Path, own: Untraced) -> None:
    case = make_case(tmp_path / "case", parts=False, files=False)
    own.sky[0] = np.nan
    assert not scene_of(case, own).readings.has_parts


@pytest.mark.slow
def test_the_split_of_the_daylight_is_found_in_sums(tmp_path: Path, own: Untraced) -> None:
    case = make_case(tmp_path / "case", effects.split(0.3), parts=False, files=False)
    blind, told = explain(case), explain(case, own)
    assert any("sky-sun-ratio" in str(entry) for entry in blind.not_tried)
    assert told.conclusion.best.ids == ("sky-sun-ratio",)
    assert any("our own simulation split them" in finding for finding in told.findings)
