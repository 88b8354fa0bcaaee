"""Readings that stand alone are quieted, told, and hide nothing; those that a mechanism explains count as ever."""

from pathlib import Path

import numpy as np
import pytest

from analysis.explain.alone import QUIET, quieted
from analysis.explain.conclude import conclude
from analysis.explain.fit import Fitter
from analysis.explain.mechanisms.catalogue import BY_ID
from analysis.explain.readings import Readings
from analysis.explain.scene import Scene
from analysis.explain.search import Search
from tests.analysis.explain import effects
from tests.analysis.explain.campaign import TESTS, Floats, Rows, Truth, make_case

GLINTS = [201, 388, 612, 905]


def glints(truth: Truth) -> Truth:
    """Four readings of a recording show half as much again."""

    def seen(rows: Rows) -> Floats:
        values = truth(rows)
        values[GLINTS] *= 1.5
        return values

    return seen


def search_of(folder: Path, truth: Truth) -> Search:
    return Search(Fitter(Scene(Readings.of(make_case(folder, truth, tests=TESTS[:6])))))


def gain(scene: Scene, name: str) -> float:
    """Nats that one mechanism brings; the others are not asked."""
    search = Search(Fitter(scene), [BY_ID[name]], [])
    nothing = search.nothing().evidence
    return next(h.evidence for h in search.singles() if h.ids == (name,)) - nothing


@pytest.fixture(scope="module")
def loud(tmp_path_factory: pytest.TempPathFactory) -> Search:
    """An offset in the dark, and the glints."""
    return search_of(tmp_path_factory.mktemp("glints") / "case", glints(effects.offset(8.0)))


@pytest.fixture(scope="module")
def quiet(loud: Search) -> Search:
    return quieted(loud)


def test_a_few_wrong_readings_hide_no_mechanism(tmp_path: Path, loud: Search, quiet: Search) -> None:
    clean = gain(search_of(tmp_path / "clean", effects.offset(8.0)).scene, "dark-offset")
    assert quiet.scene.alone is not None
    assert np.flatnonzero(quiet.scene.alone).tolist() == GLINTS
    assert set(quiet.scene.alone[GLINTS]) == {QUIET}
    assert gain(quiet.scene, "dark-offset") > 0.8 * clean
    assert gain(loud.scene, "dark-offset") < 0.6 * clean
    found = conclude(quiet)
    assert found.verdict == "explained"
    assert found.best.ids == ("dark-offset",)
    assert any(u.single and u.gain > 50.0 for u in found.unnamed), "they are told"


def test_readings_that_a_mechanism_explains_are_not_quieted(tmp_path: Path) -> None:
    """28 of 960 readings are above the end of the range."""
    plain = search_of(tmp_path / "case", effects.cut(14_000.0))
    assert quieted(plain) is plain
    assert conclude(plain).best.ids == ("saturation",)


def test_where_nothing_stands_alone_the_search_is_the_same(tmp_path: Path, picture: Scene) -> None:
    plain = search_of(tmp_path / "case", effects.c_offset(4.0))
    assert quieted(plain) is plain
    camera = Search(Fitter(picture))
    assert quieted(camera) is camera


@pytest.mark.parametrize("rows", [slice(0, 300), slice(None)])
def test_a_part_of_a_scene_keeps_what_is_quieted(quiet: Search, rows: slice) -> None:
    scene = quiet.scene
    keep = np.zeros(len(scene.readings), dtype=bool)
    keep[rows] = True
    part = scene.only(keep)
    assert part.alone is not None
    assert scene.alone is not None
    assert np.array_equal(part.alone, scene.alone[rows])
    assert len(part.readings) == np.count_nonzero(keep)
