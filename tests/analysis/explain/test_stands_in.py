"""Light that goes on as the sky's does stands for whatever spreads the sun's: it counts for less."""

from pathlib import Path

import numpy as np
import pytest

from analysis.explain import asked
from analysis.explain import search as searches
from analysis.explain.conclusion import Conclusion
from analysis.explain.fit import MIDDLE, Fit, Fitter
from analysis.explain.hypothesis import Hypothesis
from analysis.explain.mechanisms.catalogue import BY_ID
from analysis.explain.mechanisms.states import terms_of
from analysis.explain.readings import Readings
from analysis.explain.scene import Scene
from analysis.explain.search import Search
from analysis.explain.thresholds import NAME_FIRST_FAR, NAME_STANDING_IN, STANDS_IN
from tests.analysis.explain import effects
from tests.analysis.explain.campaign import TESTS, make_case


def test_dirt_that_scatters_stands_in(arm: Scene) -> None:
    for name in ("soiling", "lens-haze", "c-offset"):
        ways = [t.branch for t in terms_of(BY_ID[name], arm)]
        assert [w.label for w in ways if w.stands_in] == [w.label for w in ways if w.label.endswith("scattering")]


def test_what_lets_most_of_what_it_takes_go_on_is_no_dirt(arm: Scene) -> None:
    """A haze does, and where the sun's light goes on as the sky's, another split of the two."""
    ways = [t for t in terms_of(BY_ID["soiling"], arm) if t.branch.stands_in]
    assert {p.high for t in ways for p in t.parameters if p.name == "scattered_on"} == {0.6}


@pytest.mark.parametrize(("loss", "seen"), [(0.3, False), (0.7, True)])
def test_nobody_overlooks_dirt_that_takes_most(arm: Scene, loss: float, seen: bool) -> None:
    for t in terms_of(BY_ID["soiling"], arm):
        p = np.array([loss, *[0.5] * (len(t.parameters) - 1)])
        assert t.mechanism.absurd(p, t.branch) == seen


def test_a_share_of_what_it_gains_counts_for_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Of dirt that scatters two thirds of its evidence are left, as a first name and beside others."""
    scene = Scene(Readings.of(make_case(tmp_path, effects.scattering_dirt(0.2, 0.5), tests=TESTS[::2])))
    search = Search(Fitter(scene), mechanisms=[BY_ID["soiling"]], conjectures=())
    (term,) = (t for t in search._terms["soiling"] if t.branch.label == "every system, scattering")
    search._terms = {"soiling": (term,)}
    nothing = search.nothing()
    (less,), (less_beside,) = search.singles(), search.beside(nothing, ())
    monkeypatch.setattr(searches, "STANDS_IN", 0.0)
    (whole,), (whole_beside,) = search.singles(), search.beside(nothing, ())
    for some, all_ in ((less, whole), (less_beside, whole_beside)):
        assert all_.evidence - nothing.evidence > 20.0
        left = (1.0 - STANDS_IN) * (all_.evidence - nothing.evidence)
        assert some.evidence - nothing.evidence == pytest.approx(left, rel=1e-6)


@pytest.mark.parametrize("stands_in", [True, False])
def test_what_stands_in_must_gain_more_first_and_beside(arm: Scene, stands_in: bool) -> None:
    ways = [t for t in terms_of(BY_ID["soiling"], arm) if t.branch.stands_in == stands_in]
    no = np.zeros(0)
    nothing = Hypothesis(Fit((), no, no, no, hyper=MIDDLE), 0.0)
    dirt = Hypothesis(Fit((ways[0],), np.full(len(ways[0].parameters), 0.1), no, no, hyper=MIDDLE), 80.0)
    found = Conclusion(nothing, nothing, [dirt])
    assert (asked.first(dirt, found, 1.0) == NAME_STANDING_IN) == stands_in
    beside = asked.beside(dirt, nothing, found, "soiling", random=False)
    assert beside >= NAME_STANDING_IN if stands_in else beside < NAME_FIRST_FAR
