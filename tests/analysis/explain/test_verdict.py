"""How sure a name is: evidence against evidence, and what cannot be told apart is not claimed."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.special import expit

from analysis.explain import likelier
from analysis.explain.conclusion import Conclusion, Unnamed, temper
from analysis.explain.families import CLOUD
from analysis.explain.further import _likeliest
from analysis.explain.hypers import Hyper
from analysis.explain.mechanisms.catalogue import BY_ID
from analysis.explain.mechanisms.states import terms_of
from analysis.explain.odds import LIKELIER, OF_CASE_ODDS, ROOM_OR_LEAK, UNSEEN
from analysis.explain.scene import Scene
from analysis.explain.thresholds import AHEAD, RELIABLE, SURE, SURE_BELOW
from analysis.explain.verdict import decide, first_of
from analysis.explain.wander import Wandering
from tests.analysis.explain.weighed import decided, hypothesis, on_another_lens


def test_a_name_far_ahead_is_sure(arm: Scene) -> None:
    found = decided(arm, ("c-offset", 200.0), ("gamma-offset", 10.0))
    assert found.verdict == "explained"
    assert found.probability["c-offset"] == pytest.approx(RELIABLE, abs=0.01)
    assert found.indistinguishable == []


def test_two_that_do_alike_are_told_and_not_claimed(arm: Scene) -> None:
    found = decided(arm, ("c-offset", 200.0), ("gamma-offset", 195.0), ("near-field", 20.0))
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
    found = decided(arm, ("clock-offset", 400.0), ("saturation", 20.0))
    found.shares = {(frozenset({"clock-offset"}), "saturation"): share, (frozenset({"saturation"}), "c-offset"): 0.1}
    decide(found, 1.0)
    assert found.verdict == verdict


def test_doubles_that_do_not_do_alike_are_rivals(arm: Scene) -> None:
    """A leak that follows the daylight is not a reading in the dark."""
    found = decided(arm, ("stray-light", 200.0), ("dark-offset", 90.0))
    assert found.indistinguishable == []
    assert found.probability["stray-light"] < decided(arm, ("stray-light", 200.0)).probability["stray-light"]


def test_a_meter_that_no_reading_shows_is_less_likely(arm: Scene) -> None:
    """Where there is no reading on the roof, its meters act on the arm by the split of sun and sky alone."""
    singles = ("sky-sun-ratio", 300.0), ("meter-gain", 270.0), ("c-offset", 10.0)
    seen, unseen = decided(arm, *singles), decided(arm, *singles, unseen=("meter-gain",))
    assert unseen.probability["sky-sun-ratio"] == pytest.approx(
        RELIABLE * float(expit(30.0 / temper(300.0) + UNSEEN)), abs=1e-6
    )
    assert seen.probability["sky-sun-ratio"] < unseen.probability["sky-sun-ratio"]
    alone = [decided(arm, ("meter-tilt", 30.0), unseen=names).verdict for names in ((), ("meter-tilt",))]
    assert alone == ["explained", "unexplained"]


@pytest.mark.parametrize(("other", "odds"), [("soiling", OF_CASE_ODDS), ("cosine-response", 0.0)])
def test_a_change_that_the_case_brings_is_likelier_than_one_of_another_lens(
    arm: Scene, other: str, odds: float
) -> None:
    """Of two that do alike; a formula that knows nothing of the lens is as good."""
    own, rival = hypothesis(arm, 300.0, "lens-haze"), hypothesis(arm, 300.0, other)
    brought = Conclusion(own, hypothesis(arm, 0.0), [own, rival])
    on_another_lens(brought, of_case=True)
    own.fit.log_evidence, own.ways = 300.0, [own.fit]
    for first, sure in ((own, odds), (rival, -odds)):
        found = Conclusion(first, hypothesis(arm, 0.0), [own, rival])
        decide(found, 1.0)
        assert found.probability[first.first] == pytest.approx(RELIABLE * expit(sure), abs=1e-6)


@pytest.mark.parametrize(("gain", "likelier"), [(250.0, True), (230.0, False)])
def test_a_change_that_the_case_brings_must_do_nearly_as_well_to_be_likelier(
    arm: Scene, gain: float, likelier: bool
) -> None:
    """Its form is the truth's own: were it true, it would take all there is."""
    first, brought = hypothesis(arm, 300.0, "soiling"), hypothesis(arm, gain, "lens-haze")
    found = Conclusion(brought, hypothesis(arm, 0.0), [first, brought])
    on_another_lens(found, of_case=True)
    brought.fit.log_evidence, brought.ways, found.best = gain, [brought.fit], first
    decide(found, 1.0)
    odds = (300.0 - gain) / found.temper(300.0) - likelier * OF_CASE_ODDS
    assert found.probability["soiling"] == pytest.approx(RELIABLE * expit(odds), abs=1e-6)


def test_a_random_effect_may_leave_more_than_a_law(arm: Scene) -> None:
    """How a cloud drifts is known by a few correlation times alone."""
    cloud = replace(hypothesis(arm, 200.0), wanders=(Wandering(CLOUD, 0.05, 25.0),))
    verdicts = []
    for h in (hypothesis(arm, 200.0, "c-offset"), cloud):
        found = Conclusion(h, hypothesis(arm, 0.0), [h], shown={CLOUD.name})
        found.unnamed = [Unnamed("time since the test began", 35.0, 0.1)]
        decide(found, 1.0)
        verdicts.append(found.verdict)
    assert verdicts == ["partly-explained", "explained"]


def test_the_same_lead_counts_less_where_more_is_explained(arm: Scene) -> None:
    """Forms are never quite right: twenty nats in fifty are a lead, in five thousand they are not."""
    weak, strong = (decided(arm, ("c-offset", g), ("gamma-offset", g - 20.0)) for g in (50.0, 5000.0))
    assert weak.probability["c-offset"] > SURE > strong.probability["c-offset"]
    assert temper(400.0) == pytest.approx(2.0 * temper(100.0))


def test_of_one_instrument_a_name_must_be_surer_than_below_a_skylight(arm: Scene) -> None:
    alike, ahead = (decided(arm, ("c-offset", 100.0), ("gamma-offset", rival)) for rival in (96.0, 88.0))
    assert alike.probability["c-offset"] < SURE_BELOW < ahead.probability["c-offset"] < SURE
    assert (alike.verdict, ahead.verdict) == ("unexplained", "explained")
    one = Conclusion(ahead.best, ahead.nothing, ahead.singles, one_instrument=True)
    decide(one, 1.0)
    assert one.verdict == "unexplained"


def test_a_change_of_the_lens_that_was_traced_takes_less_than_there_is(arm: Scene) -> None:
    """A smooth function of nobody's making holds all of it; a change that was traced on another lens does not."""
    found = decided(arm, ("lens-orientation", 106.0))
    found.instead = [Unnamed("direction", 252.0, 0.1)]
    decide(found, 1.0)
    assert found.verdict == "unexplained"
    on_another_lens(found)
    decide(found, 1.0)
    assert found.verdict == "explained"


def test_a_change_of_the_lens_that_was_traced_leaves_more(arm: Scene) -> None:
    found = decided(arm, ("lens-orientation", 1300.0), left=200.0)
    assert found.verdict == "partly-explained"
    on_another_lens(found)
    decide(found, 1.0)
    assert found.verdict == "explained"
    found.unnamed = [Unnamed("gamma", 500.0, 0.1)]
    decide(found, 1.0)
    assert found.verdict == "partly-explained"


@pytest.mark.parametrize("shown", [True, False])
def test_a_cloud_is_a_rival_only_if_repeats_show_it(arm: Scene, shown: bool) -> None:
    name, nothing = hypothesis(arm, 40.0, "cosine-response"), hypothesis(arm, 0.0)
    cloud = replace(hypothesis(arm, 39.0), wanders=(Wandering(CLOUD, 0.05, 25.0),))
    found = Conclusion(name, nothing, [name, cloud], shown={CLOUD.name} if shown else set())
    decide(found, 1.0)
    assert (found.probability["cosine-response"] < 0.6) == shown


def test_what_stands_in_the_place_of_a_name_in_a_set_is_weighed_as_it_is_alone(arm: Scene) -> None:
    """A room and a turned arm against a leak that follows the daylight and a turned arm."""
    room, leak = (hypothesis(arm, 200.0, name) for name in ("room-interreflection", "stray-light"))
    leak.fit.terms = tuple(t for t in terms_of(BY_ID["stray-light"], arm) if t.branch.facts)[:1]
    both = hypothesis(arm, 280.0, "room-interreflection", "gamma-offset")
    found = Conclusion(both, hypothesis(arm, 0.0), [room, leak])
    assert likelier.than(found, ("stray-light", "gamma-offset")) == likelier.than(found, ("stray-light",))
    assert likelier.than(found, ("stray-light", "gamma-offset")) == ROOM_OR_LEAK


@pytest.mark.parametrize(
    ("meter_is", "least"), [("meter-gain", UNSEEN), ("meter-cosine", UNSEEN), ("meter-tilt", LIKELIER)]
)
@pytest.mark.parametrize(("times", "ahead"), [(0.5, False), (1.5, True)])
def test_a_meter_that_no_reading_shows_is_told_only_well_ahead_of_what_does_alike(
    arm: Scene, meter_is: str, least: float, times: float, ahead: bool
) -> None:
    """As a first name, and beside another."""
    told, base = meter_is if ahead else "sky-sun-ratio", "meter-gain" if meter_is == "meter-tilt" else "meter-tilt"
    nothing = hypothesis(arm, 0.0)
    meter = hypothesis(arm, 300.0, meter_is)
    split = hypothesis(arm, 300.0 - times * least * temper(300.0), "sky-sun-ratio")
    found = Conclusion(meter, nothing, [meter, split], unseen=frozenset({meter_is, base}))
    assert first_of([meter, split], found).ids == (told,)
    assert _likeliest(found, [meter, split], nothing, 0.0).ids == (told,)
    assert first_of([meter, split], Conclusion(meter, nothing, [meter, split])).ids == (meter_is,)
    both = [hypothesis(arm, h.evidence, base, *h.ids) for h in (meter, split)]
    assert _likeliest(found, both, hypothesis(arm, 100.0, base), 0.0).ids[-1] == told


@pytest.mark.parametrize(("way", "odds"), [("following the daylight", ROOM_OR_LEAK), ("constant", 0.0)])
def test_a_room_is_likelier_than_a_leak_that_follows_the_daylight(arm: Scene, way: str, odds: float) -> None:
    room, leak = (hypothesis(arm, 200.0, name) for name in ("room-interreflection", "stray-light"))
    leak.fit.terms = tuple(t for t in terms_of(BY_ID["stray-light"], arm) if t.branch.label == way)
    for first, sure in ((room, odds), (leak, -odds)):
        found = Conclusion(first, hypothesis(arm, 0.0), [room, leak])
        decide(found, 1.0)
        assert found.probability[first.first] == pytest.approx(RELIABLE * expit(sure), abs=1e-6)


def test_below_a_skylight_a_few_odd_readings_void_no_name(arm: Scene) -> None:
    """They are told as what is left; of one meter they speak against the name as anything does."""
    found = decided(arm, ("dark-offset", 37.0), ("room-interreflection", 17.0))
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


def test_a_double_is_no_rival(arm: Scene) -> None:
    found = decided(arm, ("dark-offset", 200.0), ("stray-light", 199.0))
    assert found.verdict == "explained"
    assert found.indistinguishable == [("dark-offset", "stray-light")]


@pytest.mark.parametrize(
    ("turned", "gain", "alike"), [(1.0, 199.0, True), (1.1, 199.0, True), (1.0, 194.0, False), (1.3, 199.0, False)]
)
def test_what_does_the_same_to_all_readings_is_a_double(arm: Scene, turned: float, gain: float, alike: bool) -> None:
    """Below a tube alone, lenses that are turned and an arm that is turned the other way."""
    nothing, azimuth = hypothesis(arm, 0.0), hypothesis(arm, 200.0, "c-offset")
    lenses = hypothesis(arm, gain, "lens-orientation")
    does = np.sin(np.arange(50.0))
    for h, size in ((nothing, 0.0), (azimuth, 1.0), (lenses, turned)):
        h.fit.residual = 3.0 - size * does
    found = Conclusion(azimuth, nothing, [azimuth, lenses])
    decide(found, 1.0)
    assert (found.either == {"c-offset": ("lens-orientation",)} and found.verdict == "explained") == alike
    if not alike:
        assert found.doubles("c-offset") == () and found.verdict == "unexplained"


def test_lenses_that_are_all_turned_below_several_wells_are_no_double_of_the_arm(arm: Scene) -> None:
    """They do the same; the arm is likelier, and is told alone."""
    nothing, azimuth = hypothesis(arm, 0.0), hypothesis(arm, 200.0, "c-offset")
    lenses = hypothesis(arm, 199.0, "lens-orientation")
    (every,) = (t for t in terms_of(BY_ID["lens-orientation"], arm) if t.branch.label == "turn of every lens")
    lenses.fit.terms = (every,)
    for h, size in ((nothing, 0.0), (azimuth, 1.0), (lenses, 1.0)):
        h.fit.residual = 3.0 - size * np.sin(np.arange(50.0))
    found = Conclusion(azimuth, nothing, [azimuth, lenses])
    assert found.doubles("c-offset") == ()
    decide(found, 1.0)
    assert found.either == {} and found.verdict == "explained"


def test_doubles_that_act_together_are_two_names(arm: Scene) -> None:
    """Light from one side beside an offset in the dark: the readings told them apart."""
    both = hypothesis(arm, 300.0, "dark-offset", "stray-light")
    singles = [hypothesis(arm, 200.0, "dark-offset"), hypothesis(arm, 199.0, "stray-light")]
    found = Conclusion(both, hypothesis(arm, 0.0), singles)
    decide(found, 1.0)
    assert found.indistinguishable == [] and found.either == {}


def test_what_is_not_claimed_leads_the_alternatives(arm: Scene) -> None:
    found = decided(arm, ("c-offset", 200.0), ("gamma-offset", 195.0))
    assert found.verdict == "unexplained"
    assert [ids for ids, _ in found.not_claimed[:2]] == [("c-offset",), ("gamma-offset",)]
    claimed = decided(arm, ("c-offset", 200.0), ("gamma-offset", 10.0))
    assert ("c-offset",) not in [ids for ids, _ in claimed.not_claimed]


@pytest.mark.parametrize(("level", "verdict"), [(0.04, "no-mismatch"), (-0.08, "unexplained")])
def test_a_roof_meter_that_is_far_off_agrees_with_nothing(arm: Scene, level: float, verdict: str) -> None:
    nothing = hypothesis(arm, 0.0)
    for one_instrument, expected in ((True, verdict), (False, "no-mismatch")):
        found = Conclusion(nothing, nothing, [], one_instrument=one_instrument, level=level)
        decide(found, 1.0)
        assert found.verdict == expected


def test_what_is_left_and_sets_without_the_name_speak_against_it(arm: Scene) -> None:
    clear = decided(arm, ("c-offset", 100.0), ("gamma-offset", 40.0))
    left = decided(arm, ("c-offset", 100.0), ("gamma-offset", 40.0), left=15.0)
    pair = decided(
        arm, ("c-offset", 100.0), ("gamma-offset", 40.0), considered=((("gamma-offset", "near-field"), 98.0),)
    )
    law = decided(arm, ("c-offset", 100.0), ("gamma-offset", 40.0), law_alone=99.0)
    for doubtful in (left, pair, law):
        assert doubtful.probability["c-offset"] < clear.probability["c-offset"] - 0.02
    own = decided(arm, ("c-offset", 100.0), ("gamma-offset", 40.0), considered=((("c-offset", "near-field"), 98.0),))
    assert own.probability == clear.probability


def test_a_law_beyond_the_catalogue_is_less_likely_than_a_name_that_does_as_well(arm: Scene) -> None:
    as_well = decided(arm, ("gamma-offset", 280.0), law_alone=280.0)
    assert as_well.verdict == "explained"
    assert as_well.probability["gamma-offset"] == pytest.approx(RELIABLE * expit(LIKELIER))
    better = decided(arm, ("gamma-offset", 280.0), law_alone=280.0 + 2.0 * AHEAD * np.sqrt(280.0))
    assert better.verdict == "unexplained"
    for left, verdict in ((0.0, "explained"), (40.0, "partly-explained")):
        hardly = decided(arm, ("gamma-offset", 280.0), law_alone=280.0 + 0.5 * AHEAD * np.sqrt(280.0), left=left)
        assert hardly.verdict == verdict


def test_a_rough_rest_counts_beside_what_is_explained(arm: Scene) -> None:
    """More than simulations leave: beside a weak name nothing is claimed, beside a strong one something is left."""
    told = {gain: decided(arm, ("c-offset", gain), hyper=Hyper(6.0, 1.0)).verdict for gain in (60.0, 500.0, 5000.0)}
    assert told == {60.0: "unexplained", 500.0: "partly-explained", 5000.0: "explained"}


def test_where_another_lens_was_simulated_only_a_change_of_the_lens_is_told(arm: Scene) -> None:
    lens = Hyper(7.0, 1.0, 2.5)
    told = {name: decided(arm, (name, 400.0), hyper=lens).verdict for name in ("nonlinearity", "lens-orientation")}
    assert told == {"nonlinearity": "unexplained", "lens-orientation": "partly-explained"}
    assert decided(arm, ("nonlinearity", 400.0), hyper=Hyper(7.0, 1.0, 1.0)).verdict == "partly-explained"
    assert decided(arm, ("nonlinearity", 4000.0), hyper=lens).verdict == "explained"
    assert decided(arm, ("nonlinearity", 4000.0), left=300.0, hyper=lens).verdict == "partly-explained"


def test_what_a_strong_name_leaves_is_in_proportion(arm: Scene) -> None:
    assert decided(arm, ("c-offset", 500.0), left=60.0).verdict == "partly-explained"
    assert decided(arm, ("c-offset", 10_000.0), left=60.0).verdict == "explained"
