"""Priors: as a Gaussian in the middle, with tails, and of volume one."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

from analysis.explain.parameter import Parameter
from analysis.explain.prior import Prior

ONE = Prior.of((Parameter("haze", "1", "a share", -9.0, 9.0, 0.3, (0.1,), centre=0.2),))


@given(x=st.floats(-60.0, 60.0))
def test_it_is_students_t_of_four_degrees_of_freedom(x: float) -> None:
    exact = stats.t(df=4, loc=0.2, scale=0.3 * np.sqrt(5 / 4)).logpdf(x)
    made = ONE.log_density - 0.5 * np.log(2 * np.pi) - 0.5 * ONE.value(np.array([x]))
    assert made == pytest.approx(exact, abs=1e-9)


@given(x=st.floats(-5.0, 5.0))
def test_it_pulls_as_its_density_falls(x: float) -> None:
    up, down = (ONE.value(np.array([x + d])) for d in (1e-5, -1e-5))
    assert ONE.pull(np.array([x]))[0] == pytest.approx(-0.5 * (up - down) / 2e-5, abs=1e-4)


def test_what_is_usual_costs_as_much_as_a_gaussian_and_what_is_unusual_less() -> None:
    half, six = (0.5 * ONE.value(np.array([0.2 + k * 0.3])) for k in (0.5, 6.0))
    assert half == pytest.approx(0.5**3, rel=0.05)
    assert six == pytest.approx(5.3, abs=0.1)
