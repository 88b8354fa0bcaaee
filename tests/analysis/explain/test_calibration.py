"""What is told is as probable as names like it proved to be, and tells the rest apart."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from analysis.explain.calibration import state, stated
from analysis.explain.conclusion import Conclusion
from analysis.explain.fit import Fit
from analysis.explain.hypothesis import Hypothesis
from analysis.explain.thresholds import RELIABLE

CLAIMS = {(0.572, 3, 6), (0.665, 4, 6), (0.759, 15, 15), (0.86, 34, 35), (0.939, 85, 87)}
"""What decided, and how many of such claims were right: blind, on five other authors' cases (docs/trials.md)."""


def concluded(verdict: str, **probability: float) -> Conclusion:
    nothing = Hypothesis(Fit((), np.zeros(0), np.zeros(0), np.zeros((0, 0))), 0.0)
    found = Conclusion(nothing, nothing, [], verdict=verdict)
    found.probability = probability
    found.alternatives = [(("soiling",), 0.1), (("lens-haze",), 0.05)]
    return found


@given(st.floats(0.0, RELIABLE), st.floats(0.0, RELIABLE))
def test_the_surer_of_two_is_told_as_the_surer(one: float, other: float) -> None:
    assert 0.0 <= stated(one) < 1.0
    assert (stated(one) <= stated(other)) == (one <= other) or stated(one) == pytest.approx(stated(other))


def test_it_is_nearer_to_how_often_claims_were_right() -> None:
    def loss(told: float, right: int, made: int) -> float:
        return -float(right * np.log(told) + (made - right) * np.log(1.0 - told))

    sharper, plain = (sum(loss(how(p), *n) for p, *n in CLAIMS) for how in (stated, float))
    assert sharper < plain - 3.0


def test_what_a_name_gains_the_others_lose() -> None:
    found = concluded("explained", saturation=0.8)
    state(found)
    assert found.probability["saturation"] == stated(0.8) > 0.85
    told = sum(p for _, p in found.alternatives)
    assert told == pytest.approx(0.15 * (1.0 - stated(0.8)) / 0.2)
    assert found.probability["saturation"] + told < 1.0


@pytest.mark.parametrize("verdict", ["no-mismatch", "unexplained"])
def test_where_nothing_is_named_nothing_changes(verdict: str) -> None:
    found = concluded(verdict, saturation=0.4)
    state(found)
    assert found.probability == {"saturation": 0.4}
    assert found.alternatives == concluded(verdict).alternatives
