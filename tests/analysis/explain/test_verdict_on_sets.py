"""How sure a name is in all the sets that may be so: what is sure of either, of doubles, and of a further name."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.special import expit, logit

from analysis.explain.conclusion import Conclusion, temper
from analysis.explain.fit import MIDDLE, Fit, Fitter
from analysis.explain.hypothesis import Hypothesis
from analysis.explain.mechanisms.catalogue import BY_ID
from analysis.explain.mechanisms.sensors import Nonlinearity
from analysis.explain.mechanisms.states import terms_of
from analysis.explain.odds import FLATTENS, NEAR_OR_BLURRED, UNSEEN
from analysis.explain.readings import Readings
from analysis.explain.scene import Scene
from analysis.explain.search import Search
from analysis.explain.thresholds import DOUBTFUL, NO_DISC, RELIABLE, SURE, SURE_ALONE, SURE_BELOW
from analysis.explain.verdict import decide, first_of, name_the_sure, share_of, share_with_doubles, stand_out
from tests.analysis.explain import effects
from tests.analysis.explain.campaign import TESTS, light, make_case
from tests.analysis.explain.weighed import decided, hypothesis, law


@pytest.mark.parametrize(("bend", "odds"), [(-0.1, FLATTENS), (0.1, 0.0)])
def test_a_response_that_flattens_is_a_range_that_ends(
    arm: Scene, bend: float, odds: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of two that do alike the end of a range is likelier, unless the response grows steeper."""
    monkeypatch.setattr(Nonlinearity, "blurs", lambda *_: False)
    bent = next(t for t in terms_of(BY_ID["nonlinearity"], arm) if t.branch.label.endswith("bent"))
    curve = hypothesis(arm, 300.0, "nonlinearity")
    curve.fit.terms, curve.fit.theta = (bent,), np.array([bend])
    end = hypothesis(arm, 300.0, "saturation")
    end.fit.terms = (next(t for t in terms_of(BY_ID["saturation"], arm) if t.branch.label.endswith("clipped")),)
    for first, second, sure in ((end, curve, odds), (curve, end, -odds)):
        found = Conclusion(first, hypothesis(arm, 0.0), [first, second])
        decide(found, 1.0)
        assert found.probability[first.first] == pytest.approx(RELIABLE * expit(sure), abs=1e-6)
        beside = [replace(h, fit=replace(h.fit)) for h in (first, second)]
        assert share_of(found, beside[0], found.nothing, beside, 40.0) == pytest.approx(expit(sure), abs=1e-6)


def test_a_range_whose_end_is_not_seen_is_a_response_that_flattens(arm: Scene) -> None:
    """One law under two names, which other authors give it: told is either, however it is written down."""
    bent = next(t for t in terms_of(BY_ID["nonlinearity"], arm) if t.branch.label.endswith("less and less"))
    for way, alike in (("exponential", True), ("clipped", False)):
        curve, end = hypothesis(arm, 299.0, "nonlinearity"), hypothesis(arm, 300.0, "saturation")
        curve.fit.terms, curve.fit.theta = (bent,), np.array([-0.1])
        curve.fit.residual, end.fit.residual = np.sin(np.arange(50.0)), np.cos(np.arange(50.0))  # unlike by far
        end.fit.terms = (next(t for t in terms_of(BY_ID["saturation"], arm) if t.branch.label.endswith(way)),)
        nothing = hypothesis(arm, 0.0)
        nothing.fit.residual = np.ones(50)
        found = Conclusion(end, nothing, [end, curve])
        assert (found.doubles("saturation") == ("nonlinearity",)) is alike
        decide(found, 1.0)
        assert ("saturation" in found.either) is alike


def test_small_gains_are_compared_as_what_they_are() -> None:
    """What a form has wrong grows with what it does: beside 16 nats six count as one, not ten; beside 400 all fifty."""
    assert temper(16.0) == pytest.approx(5.6) and temper(400.0) == pytest.approx(50.0)
    assert temper(0.5) == temper(1.0) > 0.0


@pytest.mark.parametrize(
    ("p", "one", "verdict"), [(1e-9, False, "unexplained"), (1e-5, False, "no-mismatch"), (1e-9, True, "no-mismatch")]
)
def test_a_place_beyond_all_chance_is_something(arm: Scene, p: float, one: bool, verdict: str) -> None:
    nothing = hypothesis(arm, 0.0)
    found = Conclusion(nothing, nothing, [], one_instrument=one)
    stand_out(found, [0.02, p])
    assert found.verdict == verdict
    stand_out(found, [])
    assert found.verdict == verdict


def test_a_share_of_a_double_is_told_once(arm: Scene) -> None:
    found = decided(arm, ("dark-offset", 60.0), ("stray-light", 59.0), ("cosine-response", 59.5))
    assert found.verdict == "unexplained"
    share_with_doubles(found)
    told = [ids for ids, _ in found.not_claimed]
    assert len(told) == len(set(told))


def test_of_a_doubtful_and_a_sure_name_the_sure_one_stays(arm: Scene) -> None:
    found = decided(arm, ("meter-cosine", 120.0), ("soiling", 350.0), ("cosine-response", 119.0))
    found.best = hypothesis(arm, 385.0, "meter-cosine", "soiling")
    found.considered = [(("nonlinearity", "soiling"), 380.0)]
    decide(found, 1.0)
    assert found.probability["meter-cosine"] < SURE
    assert name_the_sure(found)
    assert found.best.ids == ("soiling",)
    assert found.verdict == "partly-explained"
    assert SURE_ALONE < found.probability["soiling"] < RELIABLE


@pytest.mark.parametrize(("share", "stays"), [(0.62, True), (0.55, False)])
def test_a_further_name_need_not_be_surer_than_a_first_one(arm: Scene, share: float, stays: bool) -> None:
    found = decided(arm, ("soiling", 350.0), ("meter-cosine", 120.0))
    found.best = hypothesis(arm, 385.0, "soiling", "meter-cosine")
    found.shares[frozenset({"soiling"}), "meter-cosine"] = share
    decide(found, 1.0)
    assert found.probability["soiling"] >= DOUBTFUL > found.probability["meter-cosine"]
    assert (found.verdict == "explained") == stays
    assert name_the_sure(found) == (not stays)


def test_what_stood_in_the_first_names_place_stands_beside_the_sure_one(arm: Scene) -> None:
    """A turned arm beside dirt or beside haze: it is a rival of neither."""
    found = decided(arm, ("soiling", 185.0), ("lens-haze", 184.0), ("c-offset", 170.0))
    assert {("soiling", "lens-haze"), ("soiling", "c-offset")} == set(found.indistinguishable)
    found.considered = [(("soiling", "c-offset"), 330.0), (("lens-haze", "c-offset"), 329.0)]
    found.instead = []
    assert name_the_sure(found)
    assert found.best.ids == ("c-offset",)
    assert found.indistinguishable == [("soiling", "lens-haze")]


@pytest.mark.parametrize(("rival", "told"), [(365.0, "soiling"), (300.0, "meter-cosine")])
def test_a_surer_name_is_told_instead_of_one_that_is_a_little_likelier_than_not(
    arm: Scene, rival: float, told: str
) -> None:
    found = decided(arm, ("meter-cosine", 120.0), ("soiling", 350.0), ("cosine-response", 119.0))
    found.best = hypothesis(arm, 385.0, "meter-cosine", "soiling")
    found.considered = [(("nonlinearity", "soiling"), rival)]
    decide(found, 1.0)
    sure = found.probability["meter-cosine"]
    assert sure > SURE_BELOW
    assert name_the_sure(found) == (sure < DOUBTFUL)
    assert found.best.first == told


def test_no_name_is_sure_where_a_law_beyond_the_catalogue_does_better(arm: Scene) -> None:
    """An arm that sags, taken for an offset beside whatever else: both likely sets hold the offset, the law neither."""
    found = decided(arm, ("gamma-offset", 150.0), ("cosine-response", 54.0), law_alone=440.0)
    found.considered = [(("gamma-offset", "lens-orientation"), 266.0), (("gamma-offset", "cosine-response"), 250.0)]
    assert not name_the_sure(found)
    found.instead = [law(arm, 100.0)]
    assert name_the_sure(found)


def test_a_name_that_is_doubtful_for_what_is_left_stays_where_likely_sets_explain_that(arm: Scene) -> None:
    """A bent response beside another split of sun and sky, or another meter's error: which of these is not told."""
    found = decided(arm, ("nonlinearity", 110.0), ("meter-cosine", 90.0), ("sky-sun-ratio", 59.0), left=193.0)
    assert found.probability["nonlinearity"] < SURE
    assert not name_the_sure(found), "nothing says what else there is"
    found.considered = [(("nonlinearity", "sky-sun-ratio"), 338.0), (("nonlinearity", "meter-cosine"), 312.0)]
    decide(found, 1.0)
    assert name_the_sure(found)
    assert found.best.ids == ("nonlinearity",)
    assert found.verdict == "partly-explained"


def test_of_one_instrument_no_name_is_given_without_what_else_is_wrong_with_it(arm: Scene) -> None:
    found = decided(arm, ("nonlinearity", 321.0), ("meter-tilt", 171.0), ("meter-cosine", 320.0))
    found.considered = [(("nonlinearity", "meter-tilt"), 643.0), (("meter-cosine", "meter-tilt"), 632.0)]
    decide(found, 1.0)
    found.one_instrument = True
    assert not name_the_sure(found)
    found.one_instrument = False
    assert name_the_sure(found)
    assert found.best.ids == ("meter-tilt",)


def test_no_name_is_sure_where_likely_sets_do_without_it(arm: Scene) -> None:
    found = decided(arm, ("meter-cosine", 120.0), ("soiling", 350.0), ("cosine-response", 119.0))
    found.best = hypothesis(arm, 385.0, "meter-cosine", "soiling")
    found.considered = [(("nonlinearity", "cosine-response"), 380.0)]
    decide(found, 1.0)
    assert not name_the_sure(found)


@pytest.mark.parametrize(
    ("fraction", "units", "told"),
    [
        (0.95, 0.0, "near-field"),
        (0.95, 1.5, "near-field"),
        (0.95, 2.5, "circumsolar-aureole"),
        (0.6, 0.5, "circumsolar-aureole"),
    ],
)
def test_a_sun_without_a_disc_that_is_hardly_ahead_of_a_near_field_is_one(
    arm: Scene, fraction: float, units: float, told: str
) -> None:
    """Both are blurs, and neither is discounted beside the other for that."""
    sun, near = hypothesis(arm, 100.0, "circumsolar-aureole"), hypothesis(arm, 0.0, "near-field")
    (term,) = near.fit.terms
    gain = 100.0 - units * temper(100.0)
    near.fit.terms, near.fit.log_evidence = (replace(term, branch=replace(term.branch, blurs=True)),), gain
    near = replace(near, evidence=gain)
    sun.fit.theta = np.array([fraction, 4.0])
    found = Conclusion(sun, hypothesis(arm, 0.0), [sun, near])
    found.best = first_of([sun, near], found)
    assert found.best.ids == (told,)
    if fraction > NO_DISC:
        decide(found, 1.0)
        lead = units * temper(100.0) / found.temper(found.best.evidence)
        ahead = NEAR_OR_BLURRED - lead if told == "near-field" else lead - NEAR_OR_BLURRED
        assert found.probability[told] == pytest.approx(RELIABLE * float(expit(ahead)), abs=1e-6)


def test_a_further_name_of_a_meter_that_no_reading_shows_is_less_likely(arm: Scene) -> None:
    nothing = hypothesis(arm, 0.0)
    meter, dirt = (hypothesis(arm, gain, name) for gain, name in ((60.0, "meter-cosine"), (40.0, "soiling")))
    of_either = Conclusion(nothing, nothing, []), Conclusion(nothing, nothing, [], unseen=frozenset({"meter-cosine"}))
    seen, unseen = (share_of(found, meter, nothing, [meter, dirt], 60.0) for found in of_either)
    assert unseen == pytest.approx(expit(logit(seen) - UNSEEN))


def test_doubles_share_what_is_sure_of_either(arm: Scene) -> None:
    found = decided(arm, ("dark-offset", 200.0), ("stray-light", 199.0))
    of_either = found.probability["dark-offset"]
    share_with_doubles(found)
    shares = {ids[0]: p for ids, p in found.alternatives if len(ids) == 1}
    assert found.verdict == "explained"
    assert found.either == {"dark-offset": ("stray-light",)}
    assert shares["dark-offset"] == pytest.approx(of_either * expit(1.0))
    assert shares["dark-offset"] + shares["stray-light"] == pytest.approx(of_either)
    alone = decided(arm, ("dark-offset", 200.0), ("stray-light", 90.0))
    share_with_doubles(alone)
    assert alone.either == {}
    assert "dark-offset" not in {name for ids, _ in alone.alternatives for name in ids}


@pytest.mark.parametrize(
    ("rival", "third", "enough", "told"),
    [
        (26.0, 10.0, True, True),
        (26.0, 25.0, True, False),
        (26.0, 10.0, False, False),
        (8.0, 4.0, True, False),
    ],
    ids=["two do as well", "three do as well", "one has too little by itself", "one stands out"],
)
def test_what_two_do_alike_by_themselves_is_told_as_either(
    arm: Scene, rival: float, third: float, enough: bool, told: bool
) -> None:
    """A wall that reflects less than simulated had 26 nats, a limit of bounces 23."""
    found = decided(arm, ("cosine-response", 27.0), ("gamma-offset", rival), ("soiling", third))
    found.enough = frozenset({"cosine-response", "gamma-offset"} if enough else {"cosine-response"})
    found.indistinguishable = []
    decide(found, 1.0)
    share_with_doubles(found)
    assert (found.either == {"cosine-response": ("gamma-offset",)}) == told
    assert (found.verdict == "explained") == (told or rival == 8.0)
    if told:
        units = found.temper(27.0)
        of_either = RELIABLE * float(expit((27.0 - third) / units))
        assert found.probability["cosine-response"] == pytest.approx(of_either)
        shares = {ids[0]: p for ids, p in found.alternatives if ids in {("cosine-response",), ("gamma-offset",)}}
        assert shares["gamma-offset"] == pytest.approx(of_either * float(expit((rival - 27.0) / units)))


def test_a_second_name_is_as_sure_as_it_stands_out(arm: Scene) -> None:
    base = hypothesis(arm, 100.0, "c-offset")
    pairs = [hypothesis(arm, e, "c-offset", name) for name, e in (("dark-offset", 140.0), ("stray-light", 139.0))]
    rival = hypothesis(arm, 138.0, "c-offset", "near-field")
    found = Conclusion(base, base, [])
    assert share_of(found, pairs[0], base, pairs, 40.0) > 0.9
    assert share_of(found, pairs[0], base, [*pairs, rival], 40.0) == pytest.approx(0.53, abs=0.01)


@pytest.mark.parametrize(("way", "told"), [("turn of every lens", "c-offset"), ("turn of all light of tube", "")])
def test_an_arm_is_likelier_turned_than_all_lenses_below_long_wells(arm: Scene, way: str, told: str) -> None:
    """Light turns there as it does with the arm: that is one error, two lenses are two."""
    lens = next(t for t in terms_of(BY_ID["lens-orientation"], arm) if t.branch.label == way)
    rival = Hypothesis(Fit((lens,), np.zeros(1), np.zeros(0), np.zeros((0, 0)), hyper=MIDDLE), 198.0)
    nothing, singles = hypothesis(arm, 0.0), [hypothesis(arm, 200.0, "c-offset"), rival]
    found = Conclusion(nothing, nothing, singles)
    found.best = first_of(singles, found)
    decide(found, 1.0)
    assert found.best.first == "c-offset"
    assert (found.verdict == "explained") == bool(told)


@pytest.mark.parametrize(("taken", "verdict"), [(0.034, "no-mismatch"), (0.039, "unexplained")])
def test_more_than_a_lens_usually_has_wrong_is_something(arm: Scene, taken: float, verdict: str) -> None:
    nothing = hypothesis(arm, 0.0)
    found = Conclusion(nothing, nothing, [], taken_by_lens=taken)
    decide(found, 1.0)
    assert found.verdict == verdict


def test_what_a_lens_takes_is_that_of_the_suns_images(tmp_path: Path) -> None:
    """An aureole widens them, as a lens does that blurs; what else is usual is another nuisance's."""
    taken = []
    for k, truth in enumerate((light, effects.aureole(0.6, 9.0))):
        fitter = Fitter(Scene(Readings.of(make_case(tmp_path / str(k), truth, tests=TESTS[::2]))))
        taken.append(fitter.taken_by_lens(Search(fitter, mechanisms=[], conjectures=()).nothing().fit))
    assert taken[0] < 0.015
    assert taken[1] > 2.0 * taken[0]
