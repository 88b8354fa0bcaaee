"""How sure a name is: evidence against evidence, and what cannot be told apart is not claimed."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.special import expit, logit

import analysis.explain.conclude as conclusions
from analysis.explain import asked, likelier
from analysis.explain.conclude import _grow, _likeliest, _name_two_together, _wandering_beside, conclude
from analysis.explain.conclusion import Conclusion, Unnamed, of_another_lens, temper
from analysis.explain.families import CLOUD, SHUTTER, UNREST
from analysis.explain.fit import MIDDLE, Fit, Fitter
from analysis.explain.hypers import Hyper
from analysis.explain.hypothesis import Hypothesis
from analysis.explain.mechanisms.base import Branch, Term
from analysis.explain.mechanisms.catalogue import BY_ID
from analysis.explain.mechanisms.conjectures import CONJECTURES
from analysis.explain.mechanisms.sensors import Nonlinearity
from analysis.explain.mechanisms.states import terms_of
from analysis.explain.retrace import Path
from analysis.explain.scene import Scene
from analysis.explain.search import Search
from analysis.explain.thresholds import (
    AHEAD,
    DOUBTFUL,
    EVEN_LENS,
    FIRST_BY_LENS,
    FLATTENS,
    HOLDS_LAWS,
    LACKED,
    LACKED_ODDS,
    LEAST_EFFECT_FAR_AHEAD,
    LEAST_EFFECT_FIRST,
    LIKELIER,
    MISFIT_LENS,
    MISFIT_OF_TWO,
    MOST_MISFIT,
    NAME_FIRST_BELOW,
    NAME_FIRST_CLOUD,
    NAME_FIRST_FAR,
    NAME_FIRST_FREE,
    NAME_FIRST_LENS,
    NAME_SECOND_BELOW,
    NAME_SECOND_EXPOSURES,
    NAME_SECOND_LENS,
    NAME_SECOND_ONE,
    NAME_SECOND_RANDOM,
    NARROW_DEG,
    NEAR_OR_BLURRED,
    NEVER,
    NO_DISC,
    OF_CASE_ODDS,
    RELIABLE,
    ROOM_OR_LEAK,
    SURE,
    SURE_ALONE,
    SURE_BELOW,
    TEMPER,
    TEMPER_ONE,
    THIRD,
    TILTED_OR_LATE,
    UNSEEN,
    WRONG_LENS,
)
from analysis.explain.verdict import decide, first_of, name_the_sure, share_of, share_with_doubles, stand_out
from analysis.explain.wander import Wandering


def _hypothesis(scene: Scene, gain: float, *ids: str) -> Hypothesis:
    terms = tuple(terms_of(BY_ID[name], scene)[0] for name in ids)
    return Hypothesis(Fit(terms, np.zeros(0), np.zeros(0), np.zeros((0, 0)), hyper=MIDDLE), gain)


def _law(scene: Scene, gain: float) -> Unnamed:
    """A law outside the catalogue that gains so much in place of all names."""
    (mechanism,) = [m for m in CONJECTURES if m.id == "arm-sag"]
    return Unnamed("arm-sag", gain, 1.0, Term(mechanism, Branch(), mechanism.parameters))


def _decided(
    scene: Scene,
    *singles: tuple[str, float],
    left: float = 0.0,
    law_alone: float = -np.inf,
    considered: tuple[tuple[tuple[str, ...], float], ...] = (),
    hyper: Hyper = MIDDLE,
    unseen: tuple[str, ...] = (),
) -> Conclusion:
    """A conclusion that names the first single, with the evidence that each single gains."""
    found = [_hypothesis(scene, gain, name) for name, gain in singles]
    found[0].fit.hyper = hyper
    conclusion = Conclusion(found[0], _hypothesis(scene, 0.0), found, considered=list(considered))
    conclusion.unseen = frozenset(unseen)
    conclusion.instead = [_law(scene, law_alone)]
    conclusion.unnamed = [Unnamed("gamma", left, 0.1)]
    decide(conclusion, 1.0)
    return conclusion


def _on_another_lens(found: Conclusion, *, of_case: bool = False) -> None:
    """Let what is named have been traced, or come with the case."""
    (way,) = found.best.fit.terms
    one = np.ones((2, 1, 1, 1))
    turned = Path("own re-simulation", way.parameters[0], np.array([0.0, 30.0]), one, one, of_case=of_case)
    found.best.fit.terms = (replace(way, branch=Branch("own re-simulation", turned)),)


def test_a_name_far_ahead_is_sure(arm: Scene) -> None:
    found = _decided(arm, ("c-offset", 200.0), ("gamma-offset", 10.0))
    assert found.verdict == "explained"
    assert found.probability["c-offset"] == pytest.approx(RELIABLE, abs=0.01)
    assert found.indistinguishable == []


@pytest.mark.parametrize(
    ("way", "needed"), [("", NAME_FIRST_BELOW), (", from one response to another", NAME_FIRST_FREE)]
)
def test_a_form_with_many_numbers_must_gain_more(arm: Scene, way: str, needed: float) -> None:
    label = f"the goniometer's sensors{way}"
    term = next(t for t in terms_of(BY_ID["nonlinearity"], arm) if t.branch.label == label)
    no = np.zeros(0)
    h, nothing = Hypothesis(Fit((term,), no, no, no), 30.0), Hypothesis(Fit((), no, no, no), 0.0)
    assert asked.first(h, Conclusion(nothing, nothing, []), 1.0) == needed
    assert asked.first(h, Conclusion(nothing, nothing, [], one_instrument=True), 1.0) < NAME_FIRST_BELOW


@pytest.mark.parametrize(
    ("lens", "least"), [(0.5, NAME_FIRST_BELOW), (WRONG_LENS, NAME_FIRST_BELOW), (2.0, 2.0 * FIRST_BY_LENS)]
)
def test_beside_a_lens_that_is_far_wrong_a_first_name_must_gain_more(arm: Scene, lens: float, least: float) -> None:
    h, nothing = _hypothesis(arm, 30.0, "dark-offset"), _hypothesis(arm, 0.0)
    h.fit.hyper = Hyper(1.0, 1.0, lens)
    assert asked.first(h, Conclusion(nothing, nothing, []), 1.0) == pytest.approx(least)
    one_sensor = _hypothesis(arm, 30.0, "channel-gain")
    one_sensor.fit.hyper = h.fit.hyper
    assert asked.first(one_sensor, Conclusion(nothing, nothing, []), 1.0) == NAME_FIRST_BELOW
    alone = Conclusion(nothing, nothing, [], one_instrument=True)
    assert asked.first(h, alone, 1.0) < NAME_FIRST_BELOW


@pytest.mark.parametrize("name", ["clock-offset", "sky-sun-ratio"])
@pytest.mark.parametrize(("other", "ahead"), [(0.0, True), (10.0, True), (15.0, False)])
def test_what_no_lens_does_is_asked_no_more_beside_a_wrong_one(
    arm: Scene, name: str, other: float, ahead: bool
) -> None:
    """And told where what is left is rough, but not where something is left by evidence."""
    rough = Hyper(3.6, 1.0, 2.5)
    found = _decided(arm, (name, 45.0), ("lens-haze", other), hyper=rough)
    assert (asked.first(found.best, found, 1.0) == NAME_FIRST_LENS) == ahead
    assert found.verdict == ("partly-explained" if ahead else "unexplained")
    assert _decided(arm, (name, 45.0), ("lens-haze", other), hyper=rough, left=87.0).verdict == "unexplained"
    assert _decided(arm, ("soiling", 45.0), ("lens-haze", other), hyper=rough).verdict == "unexplained"


@pytest.mark.parametrize("more", [(), ("dark-offset",)])
def test_an_arm_that_points_a_little_elsewhere_is_no_name(arm: Scene, more: tuple[str, ...]) -> None:
    found = Conclusion(_hypothesis(arm, 0.0), _hypothesis(arm, 0.0), [])
    of_sets = {m: _hypothesis(arm, 30.0, *more, m) for m in ("gamma-offset", "c-offset", "soiling")}
    least = {m: asked.least_effect(h, found) for m, h in of_sets.items()}
    assert least["gamma-offset"] == least["c-offset"] > least["soiling"]
    alone = asked.least_effect(_hypothesis(arm, 30.0, "c-offset"), found)
    assert (least["c-offset"] > alone) == bool(more)


@pytest.mark.parametrize(("other", "ahead"), [(4.0, True), (40.0, False)])
def test_a_split_far_ahead_may_change_little(arm: Scene, other: float, ahead: bool) -> None:
    found = _decided(arm, ("sky-sun-ratio", 60.0), ("lens-haze", other))
    assert asked.least_effect(found.best, found) == (LEAST_EFFECT_FAR_AHEAD if ahead else LEAST_EFFECT_FIRST)


@pytest.mark.parametrize(("tilt_deg", "first"), [((6.0, -4.0), True), ((3.0, -12.0), False)])
def test_nobody_leaves_a_meter_tilted_by_more_than_is_seen(
    arm: Scene, tilt_deg: tuple[float, float], first: bool
) -> None:
    """And what nothing does hardly speaks against what may be."""
    tilted, late = _hypothesis(arm, 480.0, "meter-tilt"), _hypothesis(arm, 445.0, "clock-offset")
    tilted.fit.theta = np.array(tilt_deg)
    found = Conclusion(late, _hypothesis(arm, 0.0), [tilted, late])
    assert (asked.first(tilted, found, 1.0) < NEVER) == first
    decide(found, 1.0)
    assert (found.verdict == "explained") != first


@pytest.mark.parametrize(("bend", "least"), [(0.1, NAME_FIRST_FAR), (-0.1, NAME_FIRST_BELOW)])
def test_a_response_that_bends_upwards_looks_like_sharper_images(arm: Scene, bend: float, least: float) -> None:
    h, nothing = _hypothesis(arm, 50.0, "nonlinearity"), _hypothesis(arm, 0.0)
    way = next(t for t in terms_of(BY_ID["nonlinearity"], arm) if t.branch.value == ("goniometer", "bent"))
    h.fit.terms, h.fit.theta = (way,), np.array([bend])
    assert asked.first(h, Conclusion(nothing, nothing, []), 1.0) == least


@pytest.mark.parametrize(
    ("fraction", "width_deg", "narrow"),
    [(0.2, 3.0, True), (0.2, 6.0, False), (0.6, 2.2, True), (0.6, 4.0, False), (0.95, 4.0, True)],
)
def test_an_aureole_that_any_lens_may_make_must_gain_more(
    arm: Scene, fraction: float, width_deg: float, narrow: bool
) -> None:
    """What counts is how far it spreads the sun's light, and whether a disc is left; the case's own aureole is one."""
    h, nothing = _hypothesis(arm, 50.0, "circumsolar-aureole"), _hypothesis(arm, 0.0)
    h.fit.theta = np.array([fraction, width_deg])
    found = Conclusion(nothing, nothing, [])
    assert (fraction**0.5 * width_deg < NARROW_DEG or fraction > NO_DISC) == narrow
    assert asked.first(h, found, 1.0) == (NAME_FIRST_FAR if narrow else NAME_FIRST_LENS)
    assert (asked.more_as_rival(h, found) > 0.0) == narrow
    beside = asked.beside(h, nothing, found, "circumsolar-aureole", random=False)
    assert (beside >= NAME_FIRST_FAR) == narrow
    _on_another_lens(Conclusion(h, nothing, []), of_case=True)
    assert asked.first(h, found, 1.0) < NAME_FIRST_FAR


def test_a_sun_without_any_disc_is_never_named_and_no_rival(arm: Scene) -> None:
    """Unless the case itself brings one."""
    sun, other = _hypothesis(arm, 300.0, "circumsolar-aureole"), _hypothesis(arm, 300.0, "gamma-offset")
    nothing = _hypothesis(arm, 0.0)
    sun.fit.theta = np.array([1.0, 4.0])
    found = Conclusion(other, nothing, [sun, other])
    assert asked.first(sun, found, 1.0) == NEVER
    decide(found, 1.0)
    assert found.probability["gamma-offset"] > 0.94
    _on_another_lens(Conclusion(sun, nothing, []), of_case=True)
    assert asked.first(sun, found, 1.0) < NAME_FIRST_FAR


def test_a_sun_without_any_disc_stands_in_no_seconds_way(arm: Scene, monkeypatch: pytest.MonkeyPatch) -> None:
    search = Search(Fitter(arm))
    name, nothing = _hypothesis(arm, 500.0, "c-handedness"), _hypothesis(arm, 0.0)
    both = [_hypothesis(arm, gain, "c-handedness", m) for m, gain in (("circumsolar-aureole", 75.0), ("lens-haze", 70))]
    both[0].fit.terms = (both[0].fit.terms[0], replace(both[0].fit.terms[1], branch=Branch("halfway", "halfway")))
    monkeypatch.setattr(search, "beside", lambda *_: both)
    monkeypatch.setattr(search, "allowed", lambda *_: ())
    monkeypatch.setattr(search, "reweighed", lambda *_: 0.0)
    monkeypatch.setattr(search, "least_effect", lambda *_: 0.05)
    monkeypatch.setattr(conclusions, "_wandering_beside", lambda *_: [])
    for fraction, told in ((0.5, "circumsolar-aureole"), (1.0, "lens-haze")):
        one = len(both[0].fit.terms[0].parameters)
        both[0].fit.theta = np.array([0.0] * one + [fraction, 5.0])
        both[1].fit.theta = np.zeros(one + 1)
        found = Conclusion(name, nothing, [name])
        _grow(search, found)
        assert {new for _, new in found.shares} == {told}


@pytest.mark.parametrize(("lens", "least"), [(0.5, NAME_FIRST_BELOW), (1.0, NAME_FIRST_LENS)])
def test_what_looks_like_a_lens_is_asked_less_where_the_simulated_lens_is_right(
    arm: Scene, lens: float, least: float
) -> None:
    """Not what acts alike on all readings under one sun."""
    nothing = _hypothesis(arm, 0.0)
    for name, needed in (("lens-haze", least), ("sky-sun-ratio", NAME_FIRST_LENS)):
        h = _hypothesis(arm, 20.0, name)
        h.fit.hyper = Hyper(1.0, 1.0, lens)
        assert asked.first(h, Conclusion(nothing, nothing, []), 1.0) == needed


def test_two_that_do_alike_are_told_and_not_claimed(arm: Scene) -> None:
    found = _decided(arm, ("c-offset", 200.0), ("gamma-offset", 195.0), ("near-field", 20.0))
    assert found.verdict == "unexplained"
    assert found.probability["c-offset"] < SURE
    assert found.indistinguishable == [("c-offset", "gamma-offset")]
    assert found.alternatives[0][0] == ("gamma-offset",)
    assert found.probability["c-offset"] + sum(p for _, p in found.alternatives) <= 1.0


@pytest.mark.parametrize(("share", "verdict"), [(0.54, "partly-explained"), (0.95, "explained"), (1.0, "explained")])
def test_where_only_the_further_name_is_not_sure_the_rest_is_not_explained(
    arm: Scene, share: float, verdict: str
) -> None:
    """A range that ends and a response that bends do alike beside a clock: one of the two is there."""
    found = _decided(arm, ("clock-offset", 400.0), ("saturation", 20.0))
    found.shares = {(frozenset({"clock-offset"}), "saturation"): share, (frozenset({"saturation"}), "c-offset"): 0.1}
    decide(found, 1.0)
    assert found.verdict == verdict


def test_doubles_that_do_not_do_alike_are_rivals(arm: Scene) -> None:
    """A leak that follows the daylight is not a reading in the dark."""
    found = _decided(arm, ("stray-light", 200.0), ("dark-offset", 90.0))
    assert found.indistinguishable == []
    assert found.probability["stray-light"] < _decided(arm, ("stray-light", 200.0)).probability["stray-light"]


def test_a_meter_that_no_reading_shows_is_less_likely(arm: Scene) -> None:
    """Where there is no reading on the roof, its meters act on the arm by the split of sun and sky alone."""
    singles = ("sky-sun-ratio", 300.0), ("meter-gain", 270.0), ("c-offset", 10.0)
    seen, unseen = _decided(arm, *singles), _decided(arm, *singles, unseen=("meter-gain",))
    assert unseen.probability["sky-sun-ratio"] == pytest.approx(
        RELIABLE * float(expit(30.0 / temper(300.0) + UNSEEN)), abs=1e-6
    )
    assert seen.probability["sky-sun-ratio"] < unseen.probability["sky-sun-ratio"]
    alone = [_decided(arm, ("meter-tilt", 30.0), unseen=names).verdict for names in ((), ("meter-tilt",))]
    assert alone == ["explained", "unexplained"]


@pytest.mark.parametrize(("late", "told"), [(140.0, "clock-offset"), (90.0, "c-offset")])
def test_an_azimuth_that_half_looks_like_a_clock_is_one(arm: Scene, late: float, told: str) -> None:
    """An arm that is turned looks like no clock; a turn beside a clock is what that leaves."""
    singles = [_hypothesis(arm, 230.0, "c-offset"), _hypothesis(arm, late, "clock-offset")]
    nothing = _hypothesis(arm, 0.0)
    found = Conclusion(nothing, nothing, singles)
    found.best = first_of(singles, found)
    decide(found, 1.0)
    assert found.best.ids == (told,) and found.verdict == "explained"
    both = _hypothesis(arm, 300.0, told, "c-offset") if told != "c-offset" else _hypothesis(arm, 300.0, told, "soiling")
    asked_of_it = asked.beside(both, found.best, found, both.ids[-1], random=False, share=1.0)
    assert (asked_of_it >= NAME_FIRST_FAR) == (told == "clock-offset")


@pytest.mark.parametrize(("bend", "odds"), [(-0.1, FLATTENS), (0.1, 0.0)])
def test_a_response_that_flattens_is_a_range_that_ends(
    arm: Scene, bend: float, odds: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of two that do alike the end of a range is likelier, unless the response grows steeper."""
    monkeypatch.setattr(Nonlinearity, "blurs", lambda *_: False)
    bent = next(t for t in terms_of(BY_ID["nonlinearity"], arm) if t.branch.label.endswith("bent"))
    curve = _hypothesis(arm, 300.0, "nonlinearity")
    curve.fit.terms, curve.fit.theta = (bent,), np.array([bend])
    end = _hypothesis(arm, 300.0, "saturation")
    for first, second, sure in ((end, curve, odds), (curve, end, -odds)):
        found = Conclusion(first, _hypothesis(arm, 0.0), [first, second])
        decide(found, 1.0)
        assert found.probability[first.first] == pytest.approx(RELIABLE * expit(sure), abs=1e-6)
        beside = [replace(h, fit=replace(h.fit)) for h in (first, second)]
        assert share_of(found, beside[0], found.nothing, beside, 40.0) == pytest.approx(expit(sure), abs=1e-6)


@pytest.mark.parametrize(("units", "told"), [(0.0, "meter-tilt"), (2.0, "meter-tilt"), (3.0, "clock-offset")])
def test_a_clock_that_is_hardly_ahead_of_a_tilted_meter_is_a_tilted_meter(roof: Scene, units: float, told: str) -> None:
    """On a roof; which is told decides how the other counts against it."""
    nats = temper(100.0, TEMPER_ONE)
    singles = [("clock-offset", 100.0), ("meter-tilt", 100.0 - units * nats), ("dark-offset", 30.0)]
    weighed = [_hypothesis(roof, gain, name) for name, gain in singles]
    found = Conclusion(weighed[0], _hypothesis(roof, 0.0), weighed, one_instrument=True, nat=TEMPER_ONE)
    found.best = first_of(weighed, found)
    assert found.best.ids == (told,)
    decide(found, 1.0)
    lead = units * nats / temper(found.best.evidence, TEMPER_ONE)
    ahead = TILTED_OR_LATE - lead if told == "meter-tilt" else lead - TILTED_OR_LATE
    assert found.probability[told] == pytest.approx(RELIABLE * float(expit(ahead)), abs=1e-6)
    found.one_instrument = False
    assert first_of(weighed, found).ids == ("clock-offset",)


@pytest.mark.parametrize(("other", "odds"), [("soiling", OF_CASE_ODDS), ("cosine-response", 0.0)])
def test_a_change_that_the_case_brings_is_likelier_than_one_of_another_lens(
    arm: Scene, other: str, odds: float
) -> None:
    """Of two that do alike; a formula that knows nothing of the lens is as good."""
    own, rival = _hypothesis(arm, 300.0, "lens-haze"), _hypothesis(arm, 300.0, other)
    brought = Conclusion(own, _hypothesis(arm, 0.0), [own, rival])
    _on_another_lens(brought, of_case=True)
    own.fit.log_evidence, own.ways = 300.0, [own.fit]
    for first, sure in ((own, odds), (rival, -odds)):
        found = Conclusion(first, _hypothesis(arm, 0.0), [own, rival])
        decide(found, 1.0)
        assert found.probability[first.first] == pytest.approx(RELIABLE * expit(sure), abs=1e-6)


@pytest.mark.parametrize(("gain", "likelier"), [(250.0, True), (230.0, False)])
def test_a_change_that_the_case_brings_must_do_nearly_as_well_to_be_likelier(
    arm: Scene, gain: float, likelier: bool
) -> None:
    """Its form is the truth's own: were it true, it would take all there is."""
    first, brought = _hypothesis(arm, 300.0, "soiling"), _hypothesis(arm, gain, "lens-haze")
    found = Conclusion(brought, _hypothesis(arm, 0.0), [first, brought])
    _on_another_lens(found, of_case=True)
    brought.fit.log_evidence, brought.ways, found.best = gain, [brought.fit], first
    decide(found, 1.0)
    odds = (300.0 - gain) / found.temper(300.0) - likelier * OF_CASE_ODDS
    assert found.probability["soiling"] == pytest.approx(RELIABLE * expit(odds), abs=1e-6)


def test_a_random_effect_may_leave_more_than_a_law(arm: Scene) -> None:
    """How a cloud drifts is known by a few correlation times alone."""
    cloud = replace(_hypothesis(arm, 200.0), wanders=(Wandering(CLOUD, 0.05, 25.0),))
    verdicts = []
    for h in (_hypothesis(arm, 200.0, "c-offset"), cloud):
        found = Conclusion(h, _hypothesis(arm, 0.0), [h], shown={CLOUD.name})
        found.unnamed = [Unnamed("time since the test began", 35.0, 0.1)]
        decide(found, 1.0)
        verdicts.append(found.verdict)
    assert verdicts == ["partly-explained", "explained"]


@pytest.mark.parametrize(
    ("p", "one", "verdict"), [(1e-9, False, "unexplained"), (1e-5, False, "no-mismatch"), (1e-9, True, "no-mismatch")]
)
def test_a_place_beyond_all_chance_is_something(arm: Scene, p: float, one: bool, verdict: str) -> None:
    nothing = _hypothesis(arm, 0.0)
    found = Conclusion(nothing, nothing, [], one_instrument=one)
    stand_out(found, [0.02, p])
    assert found.verdict == verdict
    stand_out(found, [])
    assert found.verdict == verdict


def test_a_share_of_a_double_is_told_once(arm: Scene) -> None:
    found = _decided(arm, ("dark-offset", 60.0), ("stray-light", 59.0), ("cosine-response", 59.5))
    assert found.verdict == "unexplained"
    share_with_doubles(found)
    told = [ids for ids, _ in found.not_claimed]
    assert len(told) == len(set(told))


def test_of_a_doubtful_and_a_sure_name_the_sure_one_stays(arm: Scene) -> None:
    found = _decided(arm, ("meter-cosine", 120.0), ("soiling", 350.0), ("cosine-response", 119.0))
    found.best = _hypothesis(arm, 385.0, "meter-cosine", "soiling")
    found.considered = [(("nonlinearity", "soiling"), 380.0)]
    decide(found, 1.0)
    assert found.probability["meter-cosine"] < SURE
    assert name_the_sure(found)
    assert found.best.ids == ("soiling",)
    assert found.verdict == "partly-explained"
    assert SURE_ALONE < found.probability["soiling"] < RELIABLE


@pytest.mark.parametrize(("share", "stays"), [(0.62, True), (0.55, False)])
def test_a_further_name_need_not_be_surer_than_a_first_one(arm: Scene, share: float, stays: bool) -> None:
    found = _decided(arm, ("soiling", 350.0), ("meter-cosine", 120.0))
    found.best = _hypothesis(arm, 385.0, "soiling", "meter-cosine")
    found.shares[frozenset({"soiling"}), "meter-cosine"] = share
    decide(found, 1.0)
    assert found.probability["soiling"] >= DOUBTFUL > found.probability["meter-cosine"]
    assert (found.verdict == "explained") == stays
    assert name_the_sure(found) == (not stays)


def test_what_stood_in_the_first_names_place_stands_beside_the_sure_one(arm: Scene) -> None:
    """A turned arm beside dirt or beside haze: it is a rival of neither."""
    found = _decided(arm, ("soiling", 185.0), ("lens-haze", 184.0), ("c-offset", 170.0))
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
    found = _decided(arm, ("meter-cosine", 120.0), ("soiling", 350.0), ("cosine-response", 119.0))
    found.best = _hypothesis(arm, 385.0, "meter-cosine", "soiling")
    found.considered = [(("nonlinearity", "soiling"), rival)]
    decide(found, 1.0)
    sure = found.probability["meter-cosine"]
    assert sure > SURE_BELOW
    assert name_the_sure(found) == (sure < DOUBTFUL)
    assert found.best.first == told


def test_no_name_is_sure_where_a_law_beyond_the_catalogue_does_better(arm: Scene) -> None:
    """An arm that sags, taken for an offset beside whatever else: both likely sets hold the offset, the law neither."""
    found = _decided(arm, ("gamma-offset", 150.0), ("cosine-response", 54.0), law_alone=440.0)
    found.considered = [(("gamma-offset", "lens-orientation"), 266.0), (("gamma-offset", "cosine-response"), 250.0)]
    assert not name_the_sure(found)
    found.instead = [_law(arm, 100.0)]
    assert name_the_sure(found)


def test_a_name_that_is_doubtful_for_what_is_left_stays_where_likely_sets_explain_that(arm: Scene) -> None:
    """A bent response beside another split of sun and sky, or another meter's error: which of these is not told."""
    found = _decided(arm, ("nonlinearity", 110.0), ("meter-cosine", 90.0), ("sky-sun-ratio", 59.0), left=193.0)
    assert found.probability["nonlinearity"] < SURE
    assert not name_the_sure(found), "nothing says what else there is"
    found.considered = [(("nonlinearity", "sky-sun-ratio"), 338.0), (("nonlinearity", "meter-cosine"), 312.0)]
    decide(found, 1.0)
    assert name_the_sure(found)
    assert found.best.ids == ("nonlinearity",)
    assert found.verdict == "partly-explained"


def test_of_one_instrument_no_name_is_given_without_what_else_is_wrong_with_it(arm: Scene) -> None:
    found = _decided(arm, ("nonlinearity", 321.0), ("meter-tilt", 171.0), ("meter-cosine", 320.0))
    found.considered = [(("nonlinearity", "meter-tilt"), 643.0), (("meter-cosine", "meter-tilt"), 632.0)]
    decide(found, 1.0)
    found.one_instrument = True
    assert not name_the_sure(found)
    found.one_instrument = False
    assert name_the_sure(found)
    assert found.best.ids == ("meter-tilt",)


def test_no_name_is_sure_where_likely_sets_do_without_it(arm: Scene) -> None:
    found = _decided(arm, ("meter-cosine", 120.0), ("soiling", 350.0), ("cosine-response", 119.0))
    found.best = _hypothesis(arm, 385.0, "meter-cosine", "soiling")
    found.considered = [(("nonlinearity", "cosine-response"), 380.0)]
    decide(found, 1.0)
    assert not name_the_sure(found)


def test_a_law_that_does_as_well_as_a_random_function_is_likely(picture: Scene) -> None:
    """A random function of level holds every law of level; its evidence is not that of another form."""
    law, rival = _hypothesis(picture, 95.0, "nonlinearity"), _hypothesis(picture, 90.0, "exposure-error")
    found = Conclusion(law, _hypothesis(picture, 0.0), [law, rival], one_instrument=True)
    decide(found, 1.0)
    doubtful = found.probability["nonlinearity"]
    rival.wanders = (Wandering(SHUTTER, 0.05),)
    decide(found, 1.0)
    assert doubtful < SURE < found.probability["nonlinearity"]


def test_the_same_lead_counts_less_where_more_is_explained(arm: Scene) -> None:
    """Forms are never quite right: twenty nats in fifty are a lead, in five thousand they are not."""
    weak, strong = (_decided(arm, ("c-offset", g), ("gamma-offset", g - 20.0)) for g in (50.0, 5000.0))
    assert weak.probability["c-offset"] > SURE > strong.probability["c-offset"]
    assert temper(400.0) == pytest.approx(2.0 * temper(100.0))


def test_of_one_instrument_a_name_must_be_surer_than_below_a_skylight(arm: Scene) -> None:
    alike, ahead = (_decided(arm, ("c-offset", 100.0), ("gamma-offset", rival)) for rival in (93.0, 88.0))
    assert alike.probability["c-offset"] < SURE_BELOW < ahead.probability["c-offset"] < SURE
    assert (alike.verdict, ahead.verdict) == ("unexplained", "explained")
    one = Conclusion(ahead.best, ahead.nothing, ahead.singles, one_instrument=True)
    decide(one, 1.0)
    assert one.verdict == "unexplained"


def test_the_same_lead_counts_more_where_no_lens_was_simulated(picture: Scene) -> None:
    law, rival = _hypothesis(picture, 84.0, "spectral-mismatch"), _hypothesis(picture, 76.0, "nonlinearity")
    sure = []
    for nat in (TEMPER, TEMPER_ONE):
        found = Conclusion(law, _hypothesis(picture, 0.0), [law, rival], one_instrument=True, nat=nat)
        decide(found, 1.0)
        sure.append(found.probability["spectral-mismatch"])
    assert sure[0] < SURE < sure[1]


@pytest.mark.parametrize(
    ("readings", "lens", "little", "enough"),
    [(200, 1.5, 7.5, 15.0), (1000, 1.5, 35.0, 50.0), (1600, 4.0, 50.0, 75.0), (1000, 0.3, 7.0, 14.0)],
)
def test_of_one_instrument_little_evidence_is_no_name(
    picture: Scene, readings: int, lens: float, little: float, enough: float
) -> None:
    """Seven nats in 200 readings are what any fault outside the catalogue may give to some name; more in more.

    But not where the prediction is right but for what is named.
    """
    verdicts = {}
    for gain in (little, enough):
        only = _hypothesis(picture, gain, "vignetting")
        only.fit.hyper = Hyper(1.0, 1.0, lens)
        found = Conclusion(only, _hypothesis(picture, 0.0), [only], one_instrument=True, nat=TEMPER_ONE)
        found.readings = readings
        decide(found, 1.0)
        verdicts[gain] = found.verdict
    assert verdicts == {little: "unexplained", enough: "explained"}


@pytest.mark.parametrize(("pictures", "verdict"), [(True, "explained"), (False, "unexplained")])
def test_a_camera_needs_less_evidence_than_a_meter(picture: Scene, pictures: bool, verdict: str) -> None:
    only = _hypothesis(picture, 33.0, "vignetting")
    only.fit.hyper = Hyper(1.0, 1.0, EVEN_LENS)
    found = Conclusion(only, _hypothesis(picture, 0.0), [only], one_instrument=True, pictures=pictures, nat=TEMPER_ONE)
    decide(found, 1.0)
    assert found.verdict == verdict


def test_conclude_weighs_a_picture_as_one_instrument(picture: Scene) -> None:
    assert conclude(Search(Fitter(picture))).nat == TEMPER_ONE


def test_of_names_in_a_set_each_must_be_sure(picture: Scene) -> None:
    """A random effect's name stands behind those of formulas, also where it came first and others could replace it."""
    shutter, rival = _hypothesis(picture, 357.0, "exposure-error"), _hypothesis(picture, 300.0, "nonlinearity")
    found = Conclusion(shutter, _hypothesis(picture, 0.0), [rival, shutter], one_instrument=True, nat=TEMPER_ONE)
    found.best = _hypothesis(picture, 420.0, "projection-error")
    found.best.wanders, found.best.added_to = (Wandering(SHUTTER, 0.05),), "exposure-error"
    assert found.best.ids == ("projection-error", "exposure-error")
    found.shares = {(frozenset({"exposure-error"}), "projection-error"): 0.8}
    decide(found, 1.0)
    assert found.verdict == "explained"
    found.considered = [(("nonlinearity", "projection-error"), 424.0)]
    decide(found, 1.0)
    assert found.probability["projection-error"] == pytest.approx(0.8 * RELIABLE)
    assert found.probability["exposure-error"] < SURE
    assert found.verdict == "unexplained"


def _pair(picture: Scene, first: float, rival: float, both: float) -> Conclusion:
    """Vignetting, which came first, and a projection, each told beside a rival that imitates their sum."""
    single = _hypothesis(picture, first, "vignetting")
    singles = [_hypothesis(picture, rival, "nonlinearity"), single]
    found = Conclusion(single, _hypothesis(picture, 0.0), singles, one_instrument=True, nat=TEMPER_ONE)
    found.best = _hypothesis(picture, both, "vignetting", "projection-error")
    found.best.added_to = "vignetting"
    found.shares = {(frozenset({"vignetting"}), "projection-error"): 1.0}
    return found


def test_who_imitates_a_sum_is_weighed_against_the_sum(picture: Scene) -> None:
    """If a further name was sought beside the imitator too, and none was found that does as well without the first."""
    found = _pair(picture, 110.0, 143.0, 200.0)
    decide(found, 1.0)
    assert found.probability["vignetting"] < 0.05, "the imitator may have a second of its own"
    found.shares[frozenset({"nonlinearity"}), "projection-error"] = 1.0
    found.considered = [(("nonlinearity", "projection-error"), 140.0)]
    decide(found, 1.0)
    assert found.probability["vignetting"] == pytest.approx(RELIABLE, abs=0.01)
    found.considered = [(("nonlinearity", "projection-error"), 199.0)]
    decide(found, 1.0)
    assert found.probability["vignetting"] < SURE


def test_what_a_doubtful_second_would_take_does_not_speak_against_the_first(picture: Scene) -> None:
    """Nor does a set without the first, beside a better one with it."""
    found = _decided(picture, ("vignetting", 100.0), ("nonlinearity", 40.0), left=60.0)
    alone = found.probability["vignetting"]
    found.considered = [(("nonlinearity", "exposure-error"), 95.0)]
    decide(found, 1.0)
    assert found.probability["vignetting"] < alone
    found.considered.append((("vignetting", "exposure-error"), 170.0))
    decide(found, 1.0)
    assert found.probability["vignetting"] > alone


def test_what_was_there_first_is_weighed_against_nothing(picture: Scene) -> None:
    """Two that are each sure beside the other may both be nothing: neither tells much alone."""
    weak, other = _hypothesis(picture, 8.5, "channel-gain"), _hypothesis(picture, 6.0, "vignetting")
    found = Conclusion(weak, _hypothesis(picture, 0.0), [weak, other], one_instrument=True, nat=TEMPER_ONE)
    found.best = _hypothesis(picture, 26.0, "channel-gain", "vignetting")
    found.best.added_to = "channel-gain"
    pair = frozenset({"channel-gain", "vignetting"})
    found.shares = {(pair - {name}, name): 0.9 for name in pair}
    decide(found, 1.0)
    assert found.probability["channel-gain"] < SURE < found.probability["vignetting"]
    assert found.verdict == "unexplained"


def test_a_random_function_gains_what_any_law_would(picture: Scene) -> None:
    """A wave over the logarithm of the luminance, which no law is: a share of what the function gains tells nothing."""
    r = picture.readings
    wave = 1.0 + 0.05 * np.sin(6.0 * np.log(r.simulated))
    search = Search(Fitter(Scene(replace(r, measured=r.simulated * wave))))
    nothing = search.nothing()
    found = Conclusion(nothing, nothing, [])
    (told,) = [h for h in _wandering_beside(search, found, nothing, ()) if h.ids == ("exposure-error",)]
    whole = search.wandering(nothing, SHUTTER, ()).evidence - nothing.evidence
    assert told.evidence - nothing.evidence == pytest.approx((1.0 - HOLDS_LAWS) * whole)
    assert whole > 20.0


def test_exposures_explain_a_camera_and_a_cloud_an_arm_only_if_repeats_show_it(picture: Scene) -> None:
    for alone, shown, verdict in (
        (True, False, "explained"),
        (False, False, "partly-explained"),
        (False, True, "explained"),
    ):
        shutter = Hypothesis(_hypothesis(picture, 0.0).fit, 200.0, (Wandering(SHUTTER, 0.05),))
        found = Conclusion(shutter, _hypothesis(picture, 0.0), [shutter], one_instrument=alone)
        found.shown = set(shutter.ids) if shown else set()
        decide(found, 1.0)
        assert found.verdict == verdict


def test_a_change_of_the_lens_that_was_traced_takes_less_than_there_is(arm: Scene) -> None:
    """A smooth function of nobody's making holds all of it; a change that was traced on another lens does not."""
    found = _decided(arm, ("lens-orientation", 106.0))
    found.instead = [Unnamed("direction", 252.0, 0.1)]
    decide(found, 1.0)
    assert found.verdict == "unexplained"
    _on_another_lens(found)
    decide(found, 1.0)
    assert found.verdict == "explained"


def test_a_change_of_the_lens_that_was_traced_leaves_more(arm: Scene) -> None:
    found = _decided(arm, ("lens-orientation", 1300.0), left=200.0)
    assert found.verdict == "partly-explained"
    _on_another_lens(found)
    decide(found, 1.0)
    assert found.verdict == "explained"
    found.unnamed = [Unnamed("gamma", 500.0, 0.1)]
    decide(found, 1.0)
    assert found.verdict == "partly-explained"


def test_a_change_that_the_case_brings_leaves_little_for_others(arm: Scene) -> None:
    """Its lens is the prediction's own: what is left beside it is not the change's fault."""
    left = []
    for of_case in (False, True):
        found = _decided(arm, ("lens-orientation", 1000.0))
        _on_another_lens(found, of_case=of_case)
        assert of_another_lens(found.best) is not of_case
        left.append(asked.misfit(found.best, found.nothing))
    assert left == [pytest.approx(MISFIT_LENS * 1000.0), pytest.approx(MOST_MISFIT)]
    assert MOST_MISFIT < MISFIT_LENS * 1000.0


def test_a_cloud_that_repeats_do_not_show_is_asked_for_more(arm: Scene) -> None:
    nothing = _hypothesis(arm, 0.0)
    cloud = replace(nothing, wanders=(Wandering(CLOUD, 0.05, 25.0),))
    for few in (0.5, 1.0):  # planes follow each other in time in a short scan, too
        assert asked.first(cloud, Conclusion(nothing, nothing, []), few) == NAME_FIRST_CLOUD
        assert asked.first(cloud, Conclusion(nothing, nothing, [], shown={CLOUD.name}), few) < 0.5 * NAME_FIRST_CLOUD


@pytest.mark.parametrize("shown", [True, False])
def test_a_cloud_is_a_rival_only_if_repeats_show_it(arm: Scene, shown: bool) -> None:
    name, nothing = _hypothesis(arm, 40.0, "cosine-response"), _hypothesis(arm, 0.0)
    cloud = replace(_hypothesis(arm, 39.0), wanders=(Wandering(CLOUD, 0.05, 25.0),))
    found = Conclusion(name, nothing, [name, cloud], shown={CLOUD.name} if shown else set())
    decide(found, 1.0)
    assert (found.probability["cosine-response"] < 0.6) == shown


def test_nothing_is_sought_beside_a_cloud_that_would_not_be_named(arm: Scene, monkeypatch: pytest.MonkeyPatch) -> None:
    """A name that is second to it is likely first, and the cloud what that leaves."""
    search, nothing = Search(Fitter(arm), mechanisms=[], conjectures=()), _hypothesis(arm, 0.0)
    name = _hypothesis(arm, 46.0, "cosine-response")
    bases: list[str] = []
    monkeypatch.setattr(conclusions, "_one_more", lambda _, __, base: bases.append(base.first))
    for gain, sought in ((39.0, {"cosine-response"}), (45.0, {"cosine-response", "cloud-drift"})):
        cloud = replace(_hypothesis(arm, gain), wanders=(Wandering(CLOUD, 0.05, 25.0),))
        bases.clear()
        _grow(search, Conclusion(name, nothing, [name, cloud], readings=1280))
        assert set(bases) == sought


@pytest.mark.parametrize(
    ("first", "second", "together", "told"),
    [
        (40.0, 35.0, 75.0, True),
        (40.0, 35.0, 60.0, False),  # not enough for so wrong a lens
        (40.0, 60.0, 70.0, False),  # the one gains too little beside the other
    ],
)
def test_two_that_gain_too_little_alone_may_be_told_together(
    arm: Scene, monkeypatch: pytest.MonkeyPatch, first: float, second: float, together: float, told: bool
) -> None:
    search, nothing = Search(Fitter(arm), mechanisms=[], conjectures=()), _hypothesis(arm, 0.0)
    singles = [_hypothesis(arm, first, "saturation"), _hypothesis(arm, second, "cosine-response")]
    both = _hypothesis(arm, together, "saturation", "cosine-response")
    for h in (*singles, both):
        h.fit.hyper = Hyper(2.0, 1.0, 2.5)
    monkeypatch.setattr(conclusions, "_one_more", lambda _, __, base: (together - base.evidence, both))
    found = Conclusion(nothing, nothing, singles)
    assert all(asked.first(h, found, 1.0) > h.evidence for h in singles)
    _name_two_together(search, found, 1.0)
    assert found.best.ids == (both.ids if told else ())


def test_what_stands_in_the_place_of_a_name_in_a_set_is_weighed_as_it_is_alone(arm: Scene) -> None:
    """A room and a turned arm against a leak that follows the daylight and a turned arm."""
    room, leak = (_hypothesis(arm, 200.0, name) for name in ("room-interreflection", "stray-light"))
    leak.fit.terms = tuple(t for t in terms_of(BY_ID["stray-light"], arm) if t.branch.facts)[:1]
    both = _hypothesis(arm, 280.0, "room-interreflection", "gamma-offset")
    found = Conclusion(both, _hypothesis(arm, 0.0), [room, leak])
    assert likelier.than(found, ("stray-light", "gamma-offset")) == likelier.than(found, ("stray-light",))
    assert likelier.than(found, ("stray-light", "gamma-offset")) == ROOM_OR_LEAK


@pytest.mark.parametrize(("gain", "share"), [(5.0, 1.0), (60.0, 0.5)])
def test_a_second_that_gains_too_little_says_not_that_others_would_do_as_well(
    arm: Scene, monkeypatch: pytest.MonkeyPatch, gain: float, share: float
) -> None:
    search, nothing = Search(Fitter(arm)), _hypothesis(arm, 0.0)
    name = _hypothesis(arm, 100.0, "c-offset")
    both = [_hypothesis(arm, gain, "c-offset", m) for m in ("gamma-offset", "cosine-response")]
    for h in both:
        h.fit.theta = np.zeros(len(h.fit.parameters))
    monkeypatch.setattr(search, "beside", lambda *_: both)
    monkeypatch.setattr(search, "allowed", lambda *_: ())
    monkeypatch.setattr(search, "reweighed", lambda *_: 0.0)
    monkeypatch.setattr(search, "least_effect", lambda *_: 0.05)
    monkeypatch.setattr(conclusions, "_wandering_beside", lambda *_: [])
    found = Conclusion(name, nothing, [name])
    _grow(search, found)
    assert found.best is name
    assert found.shares == {(frozenset({"c-offset"}), "gamma-offset"): share}


def test_a_clock_that_is_off_by_seconds_is_none(roof: Scene) -> None:
    off = _hypothesis(roof, 100.0, "meter-gain", "clock-offset")
    for minutes, moment in ((0.03, True), (-0.09, True), (0.4, False)):
        theta = np.zeros(len(off.fit.parameters))
        theta[0], theta[-1] = 0.02, minutes
        assert asked.is_a_moment(replace(off, fit=replace(off.fit, theta=theta))) == moment


def test_a_blur_is_asked_for_more(arm: Scene) -> None:
    near, other = _hypothesis(arm, 50.0, "near-field"), _hypothesis(arm, 50.0, "c-offset")
    (term,) = near.fit.terms
    nothing = _hypothesis(arm, 0.0)
    for blurs in (True, False):
        seen = replace(term, branch=replace(term.branch, blurs=blurs))
        alone = replace(near, fit=replace(near.fit, terms=(seen,)))
        both = replace(near, fit=replace(near.fit, terms=(*other.fit.terms, seen)))
        found = Conclusion(other, nothing, [other])
        assert (asked.first(alone, found, 1.0) == NAME_FIRST_FAR) == blurs
        beside = Conclusion(other, nothing, [alone, other])
        decide(beside, 1.0)
        assert (beside.probability["c-offset"] > 0.8) == blurs, "as a rival, too"
        assert (asked.beside(both, other, found, "near-field", random=False) >= NAME_FIRST_FAR) == blurs


@pytest.mark.parametrize("brought", [False, True])
@pytest.mark.parametrize(
    ("first", "further", "left"),
    [
        ("circumsolar-aureole", "near-field", True),
        ("near-field", "circumsolar-aureole", True),
        ("soiling", "near-field", False),
    ],
)
def test_what_the_form_of_the_other_leaves_is_asked_for_more(
    arm: Scene, first: str, further: str, left: bool, brought: bool
) -> None:
    nothing, base, both = _hypothesis(arm, 0.0), _hypothesis(arm, 80.0, first), _hypothesis(arm, 130.0, first, further)
    (_, form), given = both.fit.terms, Branch(brought=brought)
    terms = *base.fit.terms, replace(form, branch=given)
    theta = np.concatenate([[0.4, 6.0][: len(t.parameters)] for t in terms])  # of an aureole: no mere blur
    both = replace(both, fit=replace(both.fit, terms=terms, theta=theta))
    found = Conclusion(base, nothing, [base])
    assert (asked.beside(both, base, found, further, random=False) >= NAME_FIRST_FAR) == (left and not brought)


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
    sun, near = _hypothesis(arm, 100.0, "circumsolar-aureole"), _hypothesis(arm, 0.0, "near-field")
    (term,) = near.fit.terms
    gain = 100.0 - units * temper(100.0)
    near.fit.terms, near.fit.log_evidence = (replace(term, branch=replace(term.branch, blurs=True)),), gain
    near = replace(near, evidence=gain)
    sun.fit.theta = np.array([fraction, 4.0])
    found = Conclusion(sun, _hypothesis(arm, 0.0), [sun, near])
    found.best = first_of([sun, near], found)
    assert found.best.ids == (told,)
    if fraction > NO_DISC:
        decide(found, 1.0)
        lead = units * temper(100.0) / found.temper(found.best.evidence)
        ahead = NEAR_OR_BLURRED - lead if told == "near-field" else lead - NEAR_OR_BLURRED
        assert found.probability[told] == pytest.approx(RELIABLE * float(expit(ahead)), abs=1e-6)


@pytest.mark.parametrize(
    ("meter_is", "least"), [("meter-gain", UNSEEN), ("meter-cosine", UNSEEN), ("meter-tilt", LIKELIER)]
)
@pytest.mark.parametrize(("times", "ahead"), [(0.5, False), (1.5, True)])
def test_a_meter_that_no_reading_shows_is_told_only_well_ahead_of_what_does_alike(
    arm: Scene, meter_is: str, least: float, times: float, ahead: bool
) -> None:
    """As a first name, and beside another."""
    told, base = meter_is if ahead else "sky-sun-ratio", "meter-gain" if meter_is == "meter-tilt" else "meter-tilt"
    nothing = _hypothesis(arm, 0.0)
    meter = _hypothesis(arm, 300.0, meter_is)
    split = _hypothesis(arm, 300.0 - times * least * temper(300.0), "sky-sun-ratio")
    found = Conclusion(meter, nothing, [meter, split], unseen=frozenset({meter_is, base}))
    assert first_of([meter, split], found).ids == (told,)
    assert _likeliest(found, [meter, split], nothing, 0.0).ids == (told,)
    assert first_of([meter, split], Conclusion(meter, nothing, [meter, split])).ids == (meter_is,)
    both = [_hypothesis(arm, h.evidence, base, *h.ids) for h in (meter, split)]
    assert _likeliest(found, both, _hypothesis(arm, 100.0, base), 0.0).ids[-1] == told


@pytest.mark.parametrize(("way", "odds"), [("following the daylight", ROOM_OR_LEAK), ("constant", 0.0)])
def test_a_room_is_likelier_than_a_leak_that_follows_the_daylight(arm: Scene, way: str, odds: float) -> None:
    room, leak = (_hypothesis(arm, 200.0, name) for name in ("room-interreflection", "stray-light"))
    leak.fit.terms = tuple(t for t in terms_of(BY_ID["stray-light"], arm) if t.branch.label == way)
    for first, sure in ((room, odds), (leak, -odds)):
        found = Conclusion(first, _hypothesis(arm, 0.0), [room, leak])
        decide(found, 1.0)
        assert found.probability[first.first] == pytest.approx(RELIABLE * expit(sure), abs=1e-6)


def test_what_looks_like_a_lens_beside_another_is_asked_less_where_the_case_brings_it(arm: Scene) -> None:
    least = []
    for of_case in (False, True):
        first, both = (_hypothesis(arm, 100.0, *ids) for ids in (("c-offset",), ("c-offset", "lens-orientation")))
        path = Path("turned", both.fit.terms[1].parameters[0], np.zeros(2), *np.ones((2, 2, 1, 1, 1)), of_case=of_case)
        both.fit.terms = (both.fit.terms[0], replace(both.fit.terms[1], branch=Branch("turned", path)))
        found = Conclusion(first, _hypothesis(arm, 0.0), [first])
        least.append(
            asked.beside(both, first, found, "lens-orientation", random=False) - asked.misfit(first, found.nothing)
        )
    assert least == [NAME_SECOND_LENS, NAME_SECOND_BELOW]


def test_a_single_sensor_beside_another_name_is_asked_less_and_what_follows_the_sun_more(arm: Scene) -> None:
    """What a lens has wrong does not end beside a sensor, and depends on where the sun stands."""
    first, asked_for = _hypothesis(arm, 100.0, "c-offset"), []
    for new in ("channel-gain", "cosine-response", "sky-sun-ratio"):
        both = _hypothesis(arm, 120.0, "c-offset", new)
        found = Conclusion(first, _hypothesis(arm, 0.0), [first])
        asked_for.append(asked.beside(both, first, found, new, random=False) - asked.misfit(first, found.nothing))
    assert asked_for == [NAME_SECOND_ONE, NAME_SECOND_BELOW, NAME_SECOND_LENS]
    assert NAME_SECOND_ONE < NAME_SECOND_BELOW < NAME_SECOND_LENS


@pytest.mark.parametrize(("new", "all_of_it"), [("cosine-response", False), ("lens-orientation", True)])
def test_what_a_form_leaves_counts_for_less_against_a_name_that_stands_out(
    arm: Scene, new: str, all_of_it: bool
) -> None:
    """Many could take what another lens has wrong; but that looks like a lens."""
    first, both = _hypothesis(arm, 400.0, "lens-orientation"), _hypothesis(arm, 450.0, "lens-orientation", new)
    if all_of_it:
        first, both = _hypothesis(arm, 400.0, "c-offset"), _hypothesis(arm, 450.0, "c-offset", new)
    found = Conclusion(first, _hypothesis(arm, 0.0), [first])
    left = asked.misfit(first, found.nothing)
    shares = (0.5, found.sure_beside, 0.5 * (1.0 + found.sure_beside), 1.0)
    asked_for = [asked.beside(both, first, found, new, False, share) for share in shares]
    least = NAME_SECOND_LENS if all_of_it else NAME_SECOND_BELOW
    assert asked_for == pytest.approx([least + left * part for part in (1, 1, 1 if all_of_it else 0.5, all_of_it)])
    assert left > 1.0


def test_a_third_name_is_asked_for_more_than_a_second(arm: Scene) -> None:
    names = ("c-offset", "cosine-response")
    found = Conclusion(_hypothesis(arm, 100.0, *names), _hypothesis(arm, 0.0), [])
    asked_for = [
        asked.beside(
            _hypothesis(arm, 130.0, *base, "dark-offset"), _hypothesis(arm, 100.0, *base), found, new, False, 1.0
        )
        for base, new in ((names[:1], "dark-offset"), (names, "dark-offset"))
    ]
    assert asked_for == [NAME_SECOND_BELOW, THIRD * NAME_SECOND_BELOW]


def test_errors_of_the_exposures_hold_what_laws_of_the_level_leave(picture: Scene) -> None:
    """Beside a wrong projection they hold nothing; and an arm's random effect must gain more beside either."""
    nothing, least = _hypothesis(picture, 0.0), {}
    for name in ("projection-error", "veiling-glare"):
        first = _hypothesis(picture, 300.0, name)
        both = replace(first, wanders=(Wandering(SHUTTER, 0.05),))
        found = Conclusion(first, nothing, [first], one_instrument=True, pictures=True)
        least[name] = asked.beside(both, first, found, "exposure-error", random=True)
        arm = replace(found, pictures=False)
        assert asked.beside(both, first, arm, "exposure-error", random=True) > NAME_SECOND_RANDOM
    assert least["projection-error"] == NAME_SECOND_EXPOSURES
    assert least["veiling-glare"] == pytest.approx(NAME_SECOND_EXPOSURES + HOLDS_LAWS * 300.0)


def test_below_a_skylight_a_few_odd_readings_void_no_name(arm: Scene) -> None:
    """They are told as what is left; of one meter they speak against the name as anything does."""
    found = _decided(arm, ("dark-offset", 37.0), ("room-interreflection", 17.0))
    found.unnamed = [Unnamed("4 readings that stand alone", 140.0, 0.1, single=True)]
    decide(found, 1.0)
    assert found.verdict == "explained"
    assert found.rivals_of_names(found.unnamed) == []
    meter = replace(found, one_instrument=True)
    decide(meter, 1.0)
    assert meter.verdict == "unexplained"
    smooth = replace(found, unnamed=[Unnamed("gamma", 140.0, 0.1)])
    decide(smooth, 1.0)
    assert smooth.verdict == "unexplained"


def test_structure_that_nobody_names_counts_more_of_one_instrument(picture: Scene) -> None:
    """Its forms are formulas; below a skylight a simulated lens leaves as much."""
    verdicts = {}
    for one_instrument in (True, False):
        nothing = _hypothesis(picture, 0.0)
        found = Conclusion(nothing, nothing, [], one_instrument=one_instrument)
        found.unnamed = [Unnamed("direction in the picture", 20.0, 0.03)]
        decide(found, 1.0)
        verdicts[one_instrument] = found.verdict
    assert verdicts == {True: "unexplained", False: "no-mismatch"}


def test_a_slow_meter_is_as_likely_as_a_late_clock(roof: Scene) -> None:
    """And the scatter under cloud that tells a clock is there beside a slow meter, too."""
    (slow,) = [m for m in CONJECTURES if m.id == "sluggish response"]
    law = Unnamed(slow.id, 505.0, 1.0, Term(slow, Branch(), slow.parameters))
    plain = _hypothesis(roof, 507.0, "clock-offset")
    scattered = replace(_hypothesis(roof, 950.0, "clock-offset"), wanders=(Wandering(UNREST, 0.5),))

    def named(law: Unnamed) -> bool:
        found = Conclusion(scattered, _hypothesis(roof, 0.0), [scattered, plain], one_instrument=True, nat=TEMPER_ONE)
        found.instead = [law]
        decide(found, 1.0)
        return found.verdict == "explained"

    assert not named(law)
    assert named(replace(law, gain=440.0))
    assert named(replace(law, along="warming meter")), "other laws have no such scatter"


def test_a_double_is_no_rival(arm: Scene) -> None:
    found = _decided(arm, ("dark-offset", 200.0), ("stray-light", 199.0))
    assert found.verdict == "explained"
    assert found.indistinguishable == [("dark-offset", "stray-light")]


def test_doubles_that_act_together_are_two_names(arm: Scene) -> None:
    """Light from one side beside an offset in the dark: the readings told them apart."""
    both = _hypothesis(arm, 300.0, "dark-offset", "stray-light")
    singles = [_hypothesis(arm, 200.0, "dark-offset"), _hypothesis(arm, 199.0, "stray-light")]
    found = Conclusion(both, _hypothesis(arm, 0.0), singles)
    decide(found, 1.0)
    assert found.indistinguishable == [] and found.either == {}


def test_a_further_name_of_a_meter_that_no_reading_shows_is_less_likely(arm: Scene) -> None:
    nothing = _hypothesis(arm, 0.0)
    meter, dirt = (_hypothesis(arm, gain, name) for gain, name in ((60.0, "meter-cosine"), (40.0, "soiling")))
    of_either = Conclusion(nothing, nothing, []), Conclusion(nothing, nothing, [], unseen=frozenset({"meter-cosine"}))
    seen, unseen = (share_of(found, meter, nothing, [meter, dirt], 60.0) for found in of_either)
    assert unseen == pytest.approx(expit(logit(seen) - UNSEEN))


def test_what_the_prediction_lacks_by_the_cases_account_is_likelier_and_asked_for_less(arm: Scene) -> None:
    """As the first name, beside a far wrong lens, and as a further name."""
    nothing, lacked = _hypothesis(arm, 0.0), frozenset({"cosine-response"})
    lacking, dirt = _hypothesis(arm, 35.0, "cosine-response"), _hypothesis(arm, 40.0, "soiling")
    lacking.fit.hyper = Hyper(1.0, 1.0, 2.5)
    plain, told = (Conclusion(nothing, nothing, [dirt, lacking], lacked=names) for names in (frozenset[str](), lacked))
    assert asked.first(lacking, told, 1.0) == LACKED < asked.first(lacking, plain, 1.0)
    assert asked.least_effect(lacking, told) < asked.least_effect(lacking, plain)
    assert [first_of([dirt, lacking], f).ids for f in (plain, told)] == [dirt.ids, lacking.ids]
    assert [_likeliest(f, [dirt, lacking], nothing, 0.0).ids for f in (plain, told)] == [dirt.ids, lacking.ids]
    shares = [share_of(f, lacking, nothing, [dirt, lacking], 35.0) for f in (plain, told)]
    assert logit(shares[1]) == pytest.approx(logit(shares[0]) + LACKED_ODDS)
    rough = _decided(arm, ("cosine-response", 45.0), hyper=Hyper(3.6, 1.0, 2.5))
    assert rough.verdict == "unexplained"
    rough.lacked = lacked
    decide(rough, 1.0)
    assert rough.verdict == "partly-explained", "however rough what is left"
    asked_beside = [asked.beside(lacking, nothing, f, "cosine-response", random=False) for f in (plain, told)]
    assert asked_beside[1] == LACKED < asked_beside[0]


def test_doubles_share_what_is_sure_of_either(arm: Scene) -> None:
    found = _decided(arm, ("dark-offset", 200.0), ("stray-light", 199.0))
    of_either = found.probability["dark-offset"]
    share_with_doubles(found)
    shares = {ids[0]: p for ids, p in found.alternatives if len(ids) == 1}
    assert found.verdict == "explained"
    assert found.either == {"dark-offset": ("stray-light",)}
    assert shares["dark-offset"] == pytest.approx(of_either * expit(1.0))
    assert shares["dark-offset"] + shares["stray-light"] == pytest.approx(of_either)
    alone = _decided(arm, ("dark-offset", 200.0), ("stray-light", 90.0))
    share_with_doubles(alone)
    assert alone.either == {}
    assert "dark-offset" not in {name for ids, _ in alone.alternatives for name in ids}


def test_of_one_instrument_three_names_are_too_many(picture: Scene) -> None:
    """Whoever needs three laws for one camera has mostly found another law."""
    ids = ("vignetting", "spectral-mismatch", "nonlinearity")
    for count, verdict in ((2, "explained"), (3, "unexplained")):
        both = _hypothesis(picture, 900.0, *ids[:count])
        singles = [_hypothesis(picture, gain, name) for name, gain in zip(ids, (500.0, 300.0, 200.0), strict=True)]
        found = Conclusion(both, _hypothesis(picture, 0.0), singles, one_instrument=True, nat=TEMPER_ONE)
        decide(found, 1.0)
        assert found.verdict == verdict
        assert (found.not_claimed[0] == (ids, min(found.probability.values()))) == (count == 3)


def test_what_is_not_claimed_leads_the_alternatives(arm: Scene) -> None:
    found = _decided(arm, ("c-offset", 200.0), ("gamma-offset", 195.0))
    assert found.verdict == "unexplained"
    assert [ids for ids, _ in found.not_claimed[:2]] == [("c-offset",), ("gamma-offset",)]
    claimed = _decided(arm, ("c-offset", 200.0), ("gamma-offset", 10.0))
    assert ("c-offset",) not in [ids for ids, _ in claimed.not_claimed]


@pytest.mark.parametrize(("level", "verdict"), [(0.04, "no-mismatch"), (-0.08, "unexplained")])
def test_a_roof_meter_that_is_far_off_agrees_with_nothing(arm: Scene, level: float, verdict: str) -> None:
    nothing = _hypothesis(arm, 0.0)
    for one_instrument, expected in ((True, verdict), (False, "no-mismatch")):
        found = Conclusion(nothing, nothing, [], one_instrument=one_instrument, level=level)
        decide(found, 1.0)
        assert found.verdict == expected


def test_what_is_left_and_sets_without_the_name_speak_against_it(arm: Scene) -> None:
    clear = _decided(arm, ("c-offset", 100.0), ("gamma-offset", 40.0))
    left = _decided(arm, ("c-offset", 100.0), ("gamma-offset", 40.0), left=15.0)
    pair = _decided(
        arm, ("c-offset", 100.0), ("gamma-offset", 40.0), considered=((("gamma-offset", "near-field"), 98.0),)
    )
    law = _decided(arm, ("c-offset", 100.0), ("gamma-offset", 40.0), law_alone=99.0)
    for doubtful in (left, pair, law):
        assert doubtful.probability["c-offset"] < clear.probability["c-offset"] - 0.02
    own = _decided(arm, ("c-offset", 100.0), ("gamma-offset", 40.0), considered=((("c-offset", "near-field"), 98.0),))
    assert own.probability == clear.probability


def test_a_law_beyond_the_catalogue_is_less_likely_than_a_name_that_does_as_well(arm: Scene) -> None:
    as_well = _decided(arm, ("gamma-offset", 280.0), law_alone=280.0)
    assert as_well.verdict == "explained"
    assert as_well.probability["gamma-offset"] == pytest.approx(RELIABLE * expit(LIKELIER))
    better = _decided(arm, ("gamma-offset", 280.0), law_alone=280.0 + 2.0 * AHEAD * np.sqrt(280.0))
    assert better.verdict == "unexplained"
    for left, verdict in ((0.0, "explained"), (40.0, "partly-explained")):
        hardly = _decided(arm, ("gamma-offset", 280.0), law_alone=280.0 + 0.5 * AHEAD * np.sqrt(280.0), left=left)
        assert hardly.verdict == verdict


def test_a_second_name_is_as_sure_as_it_stands_out(arm: Scene) -> None:
    base = _hypothesis(arm, 100.0, "c-offset")
    pairs = [_hypothesis(arm, e, "c-offset", name) for name, e in (("dark-offset", 140.0), ("stray-light", 139.0))]
    rival = _hypothesis(arm, 138.0, "c-offset", "near-field")
    found = Conclusion(base, base, [])
    assert share_of(found, pairs[0], base, pairs, 40.0) > 0.9
    assert share_of(found, pairs[0], base, [*pairs, rival], 40.0) == pytest.approx(0.53, abs=0.01)


def test_a_rough_rest_counts_beside_what_is_explained(arm: Scene) -> None:
    """More than simulations leave: beside a weak name nothing is claimed, beside a strong one something is left."""
    told = {gain: _decided(arm, ("c-offset", gain), hyper=Hyper(6.0, 1.0)).verdict for gain in (60.0, 500.0, 5000.0)}
    assert told == {60.0: "unexplained", 500.0: "partly-explained", 5000.0: "explained"}


def test_where_another_lens_was_simulated_only_a_change_of_the_lens_is_told(arm: Scene) -> None:
    lens = Hyper(7.0, 1.0, 2.5)
    told = {name: _decided(arm, (name, 400.0), hyper=lens).verdict for name in ("nonlinearity", "lens-orientation")}
    assert told == {"nonlinearity": "unexplained", "lens-orientation": "partly-explained"}
    assert _decided(arm, ("nonlinearity", 400.0), hyper=Hyper(7.0, 1.0, 1.0)).verdict == "partly-explained"
    assert _decided(arm, ("nonlinearity", 4000.0), hyper=lens).verdict == "explained"
    assert _decided(arm, ("nonlinearity", 4000.0), left=300.0, hyper=lens).verdict == "partly-explained"


def test_two_names_leave_more_for_a_third_than_one_for_a_second(arm: Scene) -> None:
    one, two = (_hypothesis(arm, 5000.0, *ids) for ids in (("c-handedness",), ("c-handedness", "gamma-offset")))
    nothing = _hypothesis(arm, 0.0)
    assert asked.misfit(two, nothing) == pytest.approx(MISFIT_OF_TWO * 5000.0)
    assert asked.misfit(one, nothing) < asked.misfit(two, nothing)


@pytest.mark.parametrize(
    ("hyper", "verdict"),
    [
        (Hyper(2.9, 2.9, 1.6), "no-mismatch"),
        (Hyper(3.1, 1.0, 1.0), "unexplained"),
        (Hyper(1.0, 3.6, 1.0), "unexplained"),
        (Hyper(1.0, 1.0, 2.5), "no-mismatch"),
    ],
)
def test_where_nothing_is_named_a_rough_rest_says_that_something_is_there(
    arm: Scene, picture: Scene, hyper: Hyper, verdict: str
) -> None:
    for scene, expected in ((arm, verdict), (picture, "no-mismatch")):
        nothing = _hypothesis(scene, 0.0)
        nothing.fit.hyper = hyper
        found = Conclusion(nothing, nothing, [], one_instrument=scene is picture)
        decide(found, 1.0)
        assert found.verdict == expected


def test_of_one_instrument_only_a_large_shape_error_says_so(picture: Scene) -> None:
    """A glare on a meter had been a clock of 30 nats; where nothing was left out, no shape error was so large."""
    for shape, nothing_named, named in ((4.2, "no-mismatch", "explained"), (5.0, "unexplained", "unexplained")):
        nothing = _hypothesis(picture, 0.0)
        nothing.fit.hyper = Hyper(shape, 1.0)
        found = Conclusion(nothing, nothing, [], one_instrument=True)
        decide(found, 1.0)
        assert found.verdict == nothing_named
        first = _hypothesis(picture, 70.0, "vignetting")
        first.fit.hyper = Hyper(shape, 1.0)
        found = Conclusion(first, _hypothesis(picture, 0.0), [first], one_instrument=True, nat=TEMPER_ONE)
        decide(found, 1.0)
        assert found.verdict == named


def test_what_a_strong_name_leaves_is_in_proportion(arm: Scene) -> None:
    assert _decided(arm, ("c-offset", 500.0), left=60.0).verdict == "partly-explained"
    assert _decided(arm, ("c-offset", 10_000.0), left=60.0).verdict == "explained"


@pytest.mark.parametrize(("way", "told"), [("turn of every lens", "c-offset"), ("turn of all light of tube", "")])
def test_an_arm_is_likelier_turned_than_all_lenses_below_long_wells(arm: Scene, way: str, told: str) -> None:
    """Light turns there as it does with the arm: that is one error, two lenses are two."""
    lens = next(t for t in terms_of(BY_ID["lens-orientation"], arm) if t.branch.label == way)
    rival = Hypothesis(Fit((lens,), np.zeros(1), np.zeros(0), np.zeros((0, 0)), hyper=MIDDLE), 198.0)
    nothing, singles = _hypothesis(arm, 0.0), [_hypothesis(arm, 200.0, "c-offset"), rival]
    found = Conclusion(nothing, nothing, singles)
    found.best = first_of(singles, found)
    decide(found, 1.0)
    assert found.best.first == "c-offset"
    assert (found.verdict == "explained") == bool(told)
