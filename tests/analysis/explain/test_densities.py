"""Densities of shifts, evened out, and given a pattern."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from analysis.cases.model import Floats
from analysis.explain.densities import even, fourfold, is_oval, seen_by
from analysis.simulate.components import Lens
from analysis.simulate.lens_shift import SIDE, cells
from tests.analysis.explain.test_shift_lens import SKEWED


def square(shifts: tuple[float, ...]) -> Floats:
    return np.reshape(shifts, (SIDE, SIDE))


@given(st.integers(0, 2**31))
def test_evened_out_a_density_is_the_same_to_all_sides_and_has_as_much(seed: int) -> None:
    shifts = tuple(np.random.default_rng(seed).random(SIDE**2).tolist())
    made = even(shifts)
    assert made.sum() == pytest.approx(np.sum(shifts))
    for same in (made[::-1], made[:, ::-1], made.T):
        assert np.array_equal(made, same)
    np.testing.assert_allclose(even(tuple(made.ravel().tolist())), made, rtol=1e-6, atol=1e-12)


def test_a_pattern_of_four_has_on_each_ring_what_was_there() -> None:
    """And is itself after a quarter turn."""
    made = square(fourfold(SKEWED.shifts))
    assert even(fourfold(SKEWED.shifts))[::4, ::4] == pytest.approx(
        even(SKEWED.shifts)[::4, ::4], abs=0.05 * made.max()
    )
    assert np.rot90(made) == pytest.approx(made)
    along, diagonal = made[SIDE // 2 + 10, SIDE // 2], made[SIDE // 2 + 7, SIDE // 2 + 7]
    assert along > 20.0 * diagonal


def test_a_lens_whose_pattern_is_turned_at_random_has_its_mean() -> None:
    turned = Lens(kind="shift", shifts=SKEWED.shifts, isotropic=True)
    assert seen_by(SKEWED) == SKEWED.shifts
    assert square(seen_by(turned)) == pytest.approx(even(SKEWED.shifts))


@pytest.mark.parametrize(("wide", "long", "turn_deg", "oval"), [(0.3, 0.3, 0.0, False), (0.25, 0.4, 20.0, True)])
def test_a_lens_that_is_stretched_already_is_oval_however_it_lies(
    wide: float, long: float, turn_deg: float, oval: bool
) -> None:
    x, y = np.meshgrid(cells(), cells(), indexing="ij")
    c, s = np.cos(np.radians(turn_deg)), np.sin(np.radians(turn_deg))
    shifts = np.exp(-0.5 * (((c * x + s * y) / long) ** 2 + ((c * y - s * x) / wide) ** 2))
    assert is_oval(Lens(kind="shift", shifts=tuple(shifts.ravel().tolist()))) is oval
    round_ring = fourfold(tuple(shifts.ravel().tolist()))  # four sides are no oval
    assert not is_oval(Lens(kind="shift", shifts=round_ring))
