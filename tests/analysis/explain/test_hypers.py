"""The lattice of error sizes: the climb ends on the highest place, and the sum about it is the integral."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from analysis.explain.hypers import BELOW, ON_THE_ROOF, Hyper, Lattice

SIZES = st.floats(0.5, 2.0)
LENSES = st.floats(0.3, 1.5)  # with a neighbour on both sides of the nearest place: beyond the edge nothing is summed
WIDTHS = st.floats(0.35, 0.7)


def _steps(lattice: Lattice) -> np.ndarray:
    return np.array([np.log(axis[1] / axis[0]) for axis in lattice.axes if len(axis) > 1])


@given(SIZES, SIZES, LENSES, WIDTHS, st.floats(-300.0, 300.0))
def test_the_sum_about_the_top_is_the_integral(
    shape: float, scatter: float, lens: float, width: float, top: float
) -> None:
    """Of a Gaussian in the logarithms, whose integral is known; in units of the lattice's steps."""

    def density(h: Hyper) -> float:
        off = np.log([h.shape / shape, h.scatter / scatter, h.lens / lens]) / width
        return float(top - 0.5 * np.sum(off**2))

    found, value = BELOW.climb(density, Hyper(2.0, 1.2, 1.0))
    exact = top + np.sum(np.log(np.sqrt(2.0 * np.pi) * width / _steps(BELOW)))
    assert value == pytest.approx(exact, abs=0.02)
    for axis, size, true in zip(
        BELOW.axes, (found.shape, found.scatter, found.lens), (shape, scatter, lens), strict=True
    ):
        assert size == min(axis, key=lambda a: abs(np.log(a / true)))


def test_where_it_begins_does_not_matter() -> None:
    def density(h: Hyper) -> float:
        return -200.0 * float(np.log(h.shape / 0.9) ** 2 + np.log(h.scatter / 3.0) ** 2)

    ends = [ON_THE_ROOF.climb(density, Hyper(a, b)) for a in (0.3, 6.0) for b in (0.2, 6.0)]
    assert len({h for h, _ in ends}) == 1
    assert len({round(v, 9) for _, v in ends}) == 1


def test_a_density_that_rises_beyond_the_edge_ends_there() -> None:
    found, value = BELOW.climb(lambda h: 50.0 * float(np.log(h.lens)), Hyper(1.0, 1.0, 1.0))
    assert found.lens == BELOW.lens[-1]
    assert np.isfinite(value)
