"""Directions spread over the sphere, and turned."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from labdaq import directions


@pytest.mark.parametrize("count", [40, 400, 3000])
def test_directions_lie_evenly_over_the_sphere(count: int) -> None:
    """Means are integrals: a third of x², y² and z² each, nothing of odd functions; and half of them lie above."""
    v = directions.evenly(count)
    assert np.linalg.norm(v, axis=1) == pytest.approx(1.0)
    assert np.mean(v**2, axis=0) == pytest.approx(1.0 / 3.0, abs=2.0 / count)
    assert np.mean(v, axis=0) == pytest.approx(0.0, abs=2.0 / count)
    assert np.all(v[: count // 2, 2] > 0.0) and np.all(v[count // 2 :, 2] < 0.0)


@given(st.floats(0.0, 90.0), st.floats(0.0, 359.0), st.floats(-180.0, 180.0))
def test_a_turn_about_the_axis_downwards_is_a_change_of_plane(gamma: float, c: float, turn: float) -> None:
    """C runs right-handed about the upward axis."""
    made = directions.rotated(directions.vector(gamma, c), np.array([0.0, 0.0, 1.0]), turn)
    assert made == pytest.approx(directions.vector(gamma, c + turn), abs=1e-12)


def test_many_turns_are_each_their_own() -> None:
    axes = np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
    made = directions.rotated(np.array([[0.0, 0.0, -1.0]] * 2), axes, np.array([90.0, -90.0]))
    assert made == pytest.approx(np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0]]), abs=1e-12)
