"""Densities of shifts, evened out, given a pattern, and stretched."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from analysis.cases.model import Floats
from analysis.explain.densities import STRETCH, even, fourfold, seen_by, stretched
from analysis.simulate.components import Lens
from analysis.simulate.lens_shift import SIDE, cells
from tests.analysis.explain.test_shift_lens import SKEWED, lobes

X, Y = np.meshgrid(cells(), cells(), indexing="ij")
ROUND = lobes((1.0, 0.0, 0.0), cells_wide=7.0).shifts


def square(shifts: tuple[float, ...]) -> Floats:
    return np.reshape(shifts, (SIDE, SIDE))


def widths(shifts: tuple[float, ...], axis_deg: float) -> tuple[float, float]:
    """Rms shifts along an axis and across it."""
    c, s = np.cos(np.radians(axis_deg)), np.sin(np.radians(axis_deg))
    share = square(shifts) / np.sum(shifts)
    return float(np.sqrt(np.sum(share * (c * X + s * Y) ** 2))), float(np.sqrt(np.sum(share * (c * Y - s * X) ** 2)))


@given(st.integers(0, 2**31))
def test_evened_out_a_density_is_the_same_to_all_sides_and_has_as_much(seed: int) -> None:
    shifts = tuple(np.random.default_rng(seed).random(SIDE**2).tolist())
    made = even(shifts)
    assert made.sum() == pytest.approx(np.sum(shifts))
    for same in (made[::-1], made[:, ::-1], made.T):
        assert np.array_equal(made, same)
    assert even(tuple(made.ravel().tolist())) == pytest.approx(made)


def test_a_pattern_of_four_has_on_each_ring_what_was_there() -> None:
    """And is itself after a quarter turn."""
    made = square(fourfold(SKEWED.shifts))
    assert even(fourfold(SKEWED.shifts))[::4, ::4] == pytest.approx(
        even(SKEWED.shifts)[::4, ::4], abs=0.05 * made.max()
    )
    assert np.rot90(made) == pytest.approx(made)
    along, diagonal = made[SIDE // 2 + 10, SIDE // 2], made[SIDE // 2 + 7, SIDE // 2 + 7]
    assert along > 20.0 * diagonal


@given(st.floats(0.0, 180.0))
def test_a_stretch_sends_light_further_along_and_less_far_across(axis_deg: float) -> None:
    was, made = widths(ROUND, axis_deg), widths(stretched(ROUND, axis_deg), axis_deg)
    assert made[0] / was[0] == pytest.approx(1.0 + STRETCH, rel=0.02)
    assert made[1] / was[1] == pytest.approx(1.0 / (1.0 + STRETCH), rel=0.02)
    assert np.sum(stretched(ROUND, axis_deg)) == pytest.approx(np.sum(ROUND), rel=0.02)


def test_a_lens_whose_pattern_is_turned_at_random_has_its_mean() -> None:
    turned = Lens(kind="shift", shifts=SKEWED.shifts, isotropic=True)
    assert seen_by(SKEWED) == SKEWED.shifts
    assert square(seen_by(turned)) == pytest.approx(even(SKEWED.shifts))
