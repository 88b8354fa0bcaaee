"""Light that goes on as the sky's does stands for whatever spreads the sun's: it counts for less."""

from pathlib import Path

import pytest

from analysis.explain import search as searches
from analysis.explain.fit import Fitter
from analysis.explain.mechanisms.base import terms_of
from analysis.explain.mechanisms.catalogue import BY_ID
from analysis.explain.readings import Readings
from analysis.explain.scene import Scene
from analysis.explain.search import Search
from analysis.explain.thresholds import STANDS_IN
from tests.analysis.explain import effects
from tests.analysis.explain.campaign import TESTS, make_case


def test_dirt_that_scatters_stands_in(arm: Scene) -> None:
    for name in ("soiling", "lens-haze", "c-offset"):
        ways = [t.branch for t in terms_of(BY_ID[name], arm)]
        assert [w.label for w in ways if w.stands_in] == [w.label for w in ways if w.label.endswith("scattering")]


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
