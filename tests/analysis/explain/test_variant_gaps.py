"""Tests that a case's variant does not cover: what our own simulation makes of them."""

import dataclasses
from pathlib import Path

import numpy as np
import pytest

from analysis.explain.retrace import Path as Along
from analysis.explain.scene import Scene
from tests.analysis.explain.campaign import TESTS
from tests.analysis.explain.test_case_variants import TURNED, turned, varied
from tests.analysis.explain.untraced import Turning

VARIANT = ("lens-orientation", {"rotation_deg": 20.0}, turned, "")
BOX = tuple(t.id for t in TESTS if t.system == "box")
LEFT = BOX[-1]


def _path(scene: Scene) -> Along:
    assert scene.retraced is not None
    return next(path for path in scene.retraced.case_paths["lens-orientation"] if path.label == TURNED)


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Along:
    """The variant where it covers all tests."""
    return _path(varied(tmp_path_factory.mktemp("whole") / "case", VARIANT))


def _with(folder: Path, *ours: Along) -> Along:
    return _path(varied(folder / "case", VARIANT, left={LEFT}, simulator=Turning(*ours)))


def _row(test: str) -> int:
    return [t.id for t in TESTS].index(test)


def _times(path: Along, factor: float) -> Along:
    """A path of ours that changes the sun part so many times as much."""
    sun = np.maximum(1.0 + factor * (path.sun - 1.0), 0.0)
    return dataclasses.replace(path, label="own re-simulation", of_case=False, sun=sun)


def test_a_test_without_variant_changes_as_ours_does_where_both_are_known(tmp_path: Path, whole: Along) -> None:
    made = _with(tmp_path, _times(whole, 1.0))
    assert made.sun == pytest.approx(whole.sun, rel=1e-6)
    assert made.sky == pytest.approx(whole.sky, rel=1e-6)


def test_of_a_change_twice_as_large_half_is_taken(tmp_path: Path, whole: Along) -> None:
    """About half: what is compared is the light, and the change of its logarithm is no straight line."""
    made = _with(tmp_path, _times(whole, 2.0))
    row = _row(LEFT)
    changed = np.abs(whole.sun[-1, row] - 1.0) > 0.2
    share = (made.sun[-1, row] - 1.0)[changed] / (np.maximum(2.0 * whole.sun[-1, row] - 1.0, 0.0) - 1.0)[changed]
    assert np.ptp(share) < 1e-6 and 0.4 < share[0] < 0.8
    others = [k for k in range(len(TESTS)) if k != row]
    assert made.sun[:, others] == pytest.approx(whole.sun[:, others], rel=1e-6)


def test_the_way_that_is_most_like_is_taken(tmp_path: Path, whole: Along) -> None:
    turned_back = dataclasses.replace(_times(whole, 1.0), sun=np.roll(whole.sun, 20, axis=2))
    for ways in ((turned_back, _times(whole, 1.0)), (_times(whole, 1.0), turned_back)):
        assert _with(tmp_path / f"{ways[0] is turned_back}", *ways).sun == pytest.approx(whole.sun, rel=1e-6)


def test_what_goes_the_other_way_says_nothing(tmp_path: Path, whole: Along) -> None:
    """A test that no variant covers stays as predicted where ours is unlike, or where there is none."""
    opposite = dataclasses.replace(_times(whole, 1.0), sun=1.0 / np.clip(whole.sun, 0.05, 20.0))
    for n, ways in enumerate(((opposite,), ())):
        made = _with(tmp_path / str(n), *ways)
        assert made.sun[-1, _row(LEFT)] == pytest.approx(1.0, abs=0.05)


def test_a_system_without_variant_stays_as_predicted(tmp_path: Path, whole: Along) -> None:
    scene = varied(tmp_path / "case", VARIANT, left=BOX, simulator=Turning(_times(whole, 1.0)))
    assert scene.retraced is not None
    (made,) = (path for path in scene.retraced.of_case() if path.label.startswith(TURNED))
    assert np.any(made.sun != 1.0), "the other system was run"
    rows = [_row(name) for name in BOX]
    assert np.all(made.sun[:, rows] == 1.0)


def test_nothing_is_simulated_where_all_tests_are_covered(tmp_path: Path) -> None:
    class Busy(Turning):
        def paths(self, mechanism: str) -> tuple[Along, ...]:
            raise AssertionError(f"paths of {mechanism} were asked for")

    varied(tmp_path / "case", VARIANT, simulator=Busy())
