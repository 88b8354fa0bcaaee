"""Directions spread over the sphere."""

import numpy as np
import pytest

from labdaq import directions


@pytest.mark.parametrize("count", [40, 400, 3000])
def test_directions_lie_evenly_over_the_sphere(count: int) -> None:
    """Means are integrals: a third of x², y² and z² each, nothing of odd functions; and half of them lie above."""
    v = directions.evenly(count)
    assert np.linalg.norm(v, axis=1) == pytest.approx(1.0)
    assert np.mean(v**2, axis=0) == pytest.approx(1.0 / 3.0, abs=2.0 / count)
    assert np.mean(v, axis=0) == pytest.approx(0.0, abs=2.0 / count)
    assert np.all(v[: count // 2, 2] > 0.0) and np.all(v[count // 2 :, 2] < 0.0)
