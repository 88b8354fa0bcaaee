"""What is looked for beside what was found, and when two names are told together."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.special import expit

import analysis.explain.conclude as conclusions
from analysis.explain import further
from analysis.explain.conclude import conclude
from analysis.explain.conclusion import Conclusion
from analysis.explain.families import CLOUD, SHUTTER
from analysis.explain.fit import Fitter
from analysis.explain.further import Beside, grow, wandering_beside
from analysis.explain.heldout import HeldOut
from analysis.explain.hypothesis import Hypothesis
from analysis.explain.mechanisms.base import Branch, Term
from analysis.explain.mechanisms.catalogue import BY_ID
from analysis.explain.mechanisms.states import terms_of
from analysis.explain.parameter import Parameter
from analysis.explain.scene import Scene
from analysis.explain.search import Search
from analysis.explain.thresholds import HOLDS_LAWS, RELIABLE, TEMPER_ONE
from analysis.explain.verdict import decide, no_better, share_with_doubles
from analysis.explain.wander import Wandering
from tests.analysis.explain.weighed import decided, hypothesis


def test_a_sun_without_any_disc_stands_in_no_seconds_way(arm: Scene, monkeypatch: pytest.MonkeyPatch) -> None:
    search = Search(Fitter(arm))
    name, nothing = hypothesis(arm, 500.0, "c-handedness"), hypothesis(arm, 0.0)
    both = [hypothesis(arm, gain, "c-handedness", m) for m, gain in (("circumsolar-aureole", 75.0), ("lens-haze", 70))]
    both[0].fit.terms = (both[0].fit.terms[0], replace(both[0].fit.terms[1], branch=Branch("halfway", "halfway")))
    monkeypatch.setattr(search, "beside", lambda *_: both)
    monkeypatch.setattr(search, "allowed", lambda *_: ())
    monkeypatch.setattr(search, "reweighed", lambda *_: 0.0)
    monkeypatch.setattr(search, "least_effect", lambda *_: 0.05)
    monkeypatch.setattr(further, "wandering_beside", lambda *_: [])
    for fraction, told in ((0.5, "circumsolar-aureole"), (1.0, "lens-haze")):
        one = len(both[0].fit.terms[0].parameters)
        both[0].fit.theta = np.array([0.0] * one + [fraction, 5.0])
        both[1].fit.theta = np.zeros(one + 1)
        found = Conclusion(name, nothing, [name])
        grow(search, found)
        assert {new for _, new in found.shares} == {told}


def test_conclude_weighs_a_picture_as_one_instrument(picture: Scene) -> None:
    assert conclude(Search(Fitter(picture))).nat == TEMPER_ONE


def test_a_random_function_gains_what_any_law_would(picture: Scene) -> None:
    """A wave over the logarithm of the luminance, which no law is: a share of what the function gains tells nothing."""
    r = picture.readings
    wave = 1.0 + 0.05 * np.sin(6.0 * np.log(r.simulated))
    search = Search(Fitter(Scene(replace(r, measured=r.simulated * wave))))
    nothing = search.nothing()
    found = Conclusion(nothing, nothing, [])
    (told,) = [h for h in wandering_beside(search, found, nothing, ()) if h.ids == ("exposure-error",)]
    whole = search.wandering(nothing, SHUTTER, ()).evidence - nothing.evidence
    assert told.evidence - nothing.evidence == pytest.approx((1.0 - HOLDS_LAWS) * whole)
    assert whole > 20.0


def test_nothing_is_sought_beside_a_cloud_that_would_not_be_named(arm: Scene, monkeypatch: pytest.MonkeyPatch) -> None:
    """A name that is second to it is likely first, and the cloud what that leaves."""
    search, nothing = Search(Fitter(arm), mechanisms=[], conjectures=()), hypothesis(arm, 0.0)
    name = hypothesis(arm, 46.0, "cosine-response")
    bases: list[str] = []
    monkeypatch.setattr(further, "_beside", lambda _, __, base: Beside(base, 0.0, []))
    monkeypatch.setattr(further, "_one_more", lambda _, __, beside: bases.append(beside.base.first))
    for gain, sought in ((39.0, {"cosine-response"}), (45.0, {"cosine-response", "cloud-drift"})):
        cloud = replace(hypothesis(arm, gain), wanders=(Wandering(CLOUD, 0.05, 25.0),))
        bases.clear()
        grow(search, Conclusion(name, nothing, [name, cloud], readings=1280))
        assert set(bases) == sought


def test_nothing_is_sought_beside_a_form_that_stands_in_and_would_not_be_named(
    arm: Scene, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It takes to itself whatever stands beside it, where that would be asked for more than it has."""
    search, nothing = Search(Fitter(arm), mechanisms=[], conjectures=()), hypothesis(arm, 0.0)
    name = hypothesis(arm, 80.0, "channel-gain")
    bases: list[str] = []
    monkeypatch.setattr(further, "_beside", lambda _, __, base: Beside(base, 0.0, []))
    monkeypatch.setattr(further, "_one_more", lambda _, __, beside: bases.append(beside.base.first))
    for stands_in, gain, sought in ((True, 70.0, False), (True, 95.0, True), (False, 70.0, True)):
        split = hypothesis(arm, gain, "sky-sun-ratio")
        split.fit.terms = (replace(split.fit.terms[0], branch=Branch("so", stands_in=stands_in)),)
        bases.clear()
        grow(search, Conclusion(name, nothing, sorted([split, name], key=lambda h: -h.evidence), readings=1280))
        assert ("sky-sun-ratio" in bases) == sought


def test_nothing_is_sought_beside_what_no_physics_makes(arm: Scene, monkeypatch: pytest.MonkeyPatch) -> None:
    """A diffuse illuminance that is wrong by three fifths stands for something else, and so do its companions."""
    search, nothing = Search(Fitter(arm), mechanisms=[], conjectures=()), hypothesis(arm, 0.0)
    name, split = hypothesis(arm, 69.0, "dark-offset"), hypothesis(arm, 82.0, "sky-sun-ratio")
    bases: list[str] = []
    monkeypatch.setattr(further, "_beside", lambda _, __, base: Beside(base, 0.0, []))
    monkeypatch.setattr(further, "_one_more", lambda _, __, beside: bases.append(beside.base.first))
    for change, sought in ((0.6, {"dark-offset"}), (0.3, {"dark-offset", "sky-sun-ratio"})):
        split.fit.theta = np.array([change])
        bases.clear()
        grow(search, Conclusion(name, nothing, [split, name], readings=1280))
        assert set(bases) == sought


def beside_an_azimuth(arm: Scene, monkeypatch: pytest.MonkeyPatch, *gains: tuple[str, float]) -> Conclusion:
    """What is told where an arm's azimuth has 100 nats, and so much more is gained by what is added to it."""
    search, nothing = Search(Fitter(arm)), hypothesis(arm, 0.0)
    name = hypothesis(arm, 100.0, "c-offset")
    both = [hypothesis(arm, gain, "c-offset", m) for m, gain in gains]
    for h in both:
        h.fit.theta = np.zeros(len(h.fit.parameters))
    monkeypatch.setattr(search, "beside", lambda base, *_: both if base.ids == ("c-offset",) else [])
    monkeypatch.setattr(search, "allowed", lambda *_: ())
    monkeypatch.setattr(search, "reweighed", lambda *_: 0.0)
    monkeypatch.setattr(search, "least_effect", lambda *_: 0.05)
    monkeypatch.setattr(further, "wandering_beside", lambda *_: [])
    found = Conclusion(name, nothing, [name])
    grow(search, found)
    return found


def test_a_second_that_gains_too_little_says_not_that_others_would_do_as_well(
    arm: Scene, monkeypatch: pytest.MonkeyPatch
) -> None:
    found = beside_an_azimuth(arm, monkeypatch, ("gamma-offset", 5.0), ("cosine-response", 5.0))
    assert found.best.ids == ("c-offset",)
    assert found.shares == {(frozenset({"c-offset"}), "gamma-offset"): 1.0}


@pytest.mark.parametrize(
    ("third", "second", "ids", "told"),
    [
        (5.0, 58.0, ("c-offset", "gamma-offset"), True),
        (55.0, 58.0, ("c-offset",), False),
        (5.0, 7.0, ("c-offset", "gamma-offset"), False),
    ],
    ids=["two do as well", "three do as well", "one stands out"],
)
def test_what_two_do_alike_beside_a_name_is_told_as_either(
    arm: Scene, monkeypatch: pytest.MonkeyPatch, third: float, second: float, ids: tuple[str, ...], told: bool
) -> None:
    gains = ("gamma-offset", 60.0), ("cosine-response", second), ("stray-light", third)
    found = beside_an_azimuth(arm, monkeypatch, *gains)
    decide(found, 1.0)
    share_with_doubles(found)
    units = found.temper(60.0)
    assert found.best.ids == ids
    assert (found.either == {"gamma-offset": ("cosine-response",)}) == told
    if told:
        assert found.verdict == "explained"
        assert found.probability["gamma-offset"] == pytest.approx(RELIABLE * float(expit((60.0 - third) / units)))
        shares = {ids[-1]: p for ids, p in found.alternatives if len(ids) == 2}
        ratio = shares["cosine-response"] / shares["gamma-offset"]
        assert ratio == pytest.approx(float(np.exp((second - 60.0) / units)))
        assert sum(shares.values()) == pytest.approx(found.probability["gamma-offset"])


def test_neither_of_two_is_told_where_one_is_asked_for_more_than_it_has(
    arm: Scene, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What looks like a lens is asked for more than an angle of the arm."""
    for other, gain, told in (("lens-haze", 14.0, False), ("cosine-response", 14.0, True), ("lens-haze", 40.0, True)):
        found = beside_an_azimuth(arm, monkeypatch, ("gamma-offset", gain + 0.5), (other, gain), ("soiling", 1.0))
        assert (found.best.open is not None) == told


@pytest.mark.parametrize(("effect", "named"), [(0.03, True), (0.008, False)])
def test_what_all_likely_sets_hold_is_named_if_it_changes_enough(
    arm: Scene, monkeypatch: pytest.MonkeyPatch, effect: float, named: bool
) -> None:
    """A near field at eight apertures, which a clock or an angle seemed to go with, changed a null by .8 %."""
    search = Search(Fitter(arm))
    found = decided(arm, ("meter-cosine", 120.0), ("soiling", 350.0), ("cosine-response", 119.0))
    found.best = hypothesis(arm, 385.0, "meter-cosine", "soiling")
    found.considered = [(("nonlinearity", "soiling"), 380.0)]
    decide(found, 1.0)
    monkeypatch.setattr(search, "least_effect", lambda *_: effect)
    monkeypatch.setattr(conclusions, "with_its_pattern", lambda _, best: best)
    monkeypatch.setattr(conclusions, "_look_for_unnamed", lambda *_: None)
    told = conclusions._only_the_sure(search, found)
    assert (told.best.ids == ("soiling",)) == named
    assert told.verdict == ("partly-explained" if named else "unexplained")


@pytest.mark.parametrize("pattern", [True, False])
@pytest.mark.parametrize("parameter", ["stretch", "weight"])
def test_a_stretched_lens_is_told_as_a_turned_one_or_that_where_a_pattern_was_predicted(
    arm: Scene, monkeypatch: pytest.MonkeyPatch, parameter: str, pattern: bool
) -> None:
    found = decided(arm, ("lens-anisotropy", 93.0), ("lens-orientation", 36.0), ("soiling", 5.0))
    assert found.either == {}
    mechanism = found.best.fit.terms[0].mechanism
    along = Parameter(parameter, "1", "of a lens", -0.7, 0.7, 0.15, (0.1,))
    found.best.fit.terms = (Term(mechanism, Branch("so"), (along,)),)
    monkeypatch.setattr(conclusions, "has_pattern", lambda _: pattern)
    found.alike = conclusions._not_told_apart(Search(Fitter(arm)), found.best)
    found.indistinguishable = []
    decide(found, 1.0)
    turned = parameter == "stretch" and pattern
    assert found.either == ({"lens-anisotropy": ("lens-orientation",)} if turned else {})
    assert found.verdict == "explained"


@pytest.mark.parametrize(("sharpness", "either"), [(4.0, True), (15.0, False)])
def test_a_range_that_ends_softly_may_be_a_bent_response(arm: Scene, sharpness: float, either: bool) -> None:
    found = decided(arm, ("saturation", 194.0), ("nonlinearity", 100.0), ("soiling", 5.0))
    rounded = next(t for t in terms_of(BY_ID["saturation"], arm) if t.branch.value[1] == "rounded")
    found.best.fit.terms, found.best.fit.theta = (rounded,), np.array([1.3, sharpness])
    found.alike = conclusions._not_told_apart(Search(Fitter(arm)), found.best)
    found.indistinguishable = []
    decide(found, 1.0)
    assert found.either == ({"saturation": ("nonlinearity",)} if either else {})


def test_a_set_counts_for_what_it_does_by_the_best_way_to_it(arm: Scene) -> None:
    """Each is weighed with what the form it was added to may have wrong; a base's own evidence is the common scale."""
    tilt, angle = hypothesis(arm, 32.0, "meter-tilt"), hypothesis(arm, 41.0, "gamma-offset")
    one_way = hypothesis(arm, 91.0, "meter-tilt", "gamma-offset")
    other_way = hypothesis(arm, 84.0, "gamma-offset", "meter-tilt")
    rival = hypothesis(arm, 86.0, "gamma-offset", "cosine-response")
    tried = further._by_any_way([Beside(tilt, 30.0, [one_way]), Beside(angle, 46.0, [rival, other_way])])
    assert [b.whole(h) for b in tried for h in b.candidates] == pytest.approx([93.0, 81.0, 93.0])
    assert other_way.evidence - 46.0 == pytest.approx(93.0 - 41.0)  # what it gains over the angle alone


@pytest.mark.parametrize("form", [0.0, 200.0])
@pytest.mark.parametrize(("gain", "told"), [(9.0, ("c-offset",)), (30.0, ("cosine-response", "c-offset"))])
def test_each_name_of_a_set_must_gain_beside_the_others(
    arm: Scene, monkeypatch: pytest.MonkeyPatch, gain: float, told: tuple[str, ...], form: float
) -> None:
    """That the strong one gains much beside the weak one tells nothing of that, nor does what forms' errors gain."""
    search, nothing = Search(Fitter(arm), mechanisms=[], conjectures=()), hypothesis(arm, 0.0)
    strong, weak = hypothesis(arm, 200.0, "c-offset"), hypothesis(arm, 90.0, "cosine-response")
    ways = {
        "c-offset": Beside(strong, 200.0 + form, [hypothesis(arm, 200.0 + form + gain, "c-offset", "cosine-response")]),
        "cosine-response": Beside(
            weak, 90.0 + form, [hypothesis(arm, 200.0 + form + gain, "cosine-response", "c-offset")]
        ),
    }
    for beside in ways.values():
        beside.candidates[0].added = next(iter(set(ways) - {beside.base.first}))
    # what is second to it beside the strong one would be asked for too much to be told
    rival = hypothesis(arm, 201.0 + form + gain, "c-offset", "sky-sun-ratio")
    rival.fit.terms = (rival.fit.terms[0], replace(rival.fit.terms[1], branch=Branch("so", stands_in=True)))
    rival.added = "sky-sun-ratio"
    ways["c-offset"].candidates.append(rival)
    monkeypatch.setattr(further, "_beside", lambda _, __, base: ways.get(base.first, Beside(base, 0.0, [])))
    monkeypatch.setattr(search, "least_effect", lambda *_: 0.05)
    found = Conclusion(strong, nothing, [strong, weak])
    grow(search, found)
    assert found.best.ids == told


def _outside(*after: float) -> HeldOut:
    """Tests that were off by 1, and what they are off by afterwards."""
    return HeldOut(
        "leave-one-test-out", 1.0, float(np.mean(after)), tuple((f"T{k}", 1.0, x) for k, x in enumerate(after))
    )


@pytest.mark.parametrize(
    ("after", "says"), [((1.2, 1.1, 0.9), True), ((1.2, 0.9, 0.9), False), ((1.1, 1.1, 0.5), False), ((1.3,), False)]
)
def test_what_predicts_left_out_tests_no_better_is_told_by_most_and_by_all(
    after: tuple[float, ...], says: bool
) -> None:
    assert no_better(_outside(*after)) == says
    assert not no_better(None)


@pytest.mark.parametrize("first_holds", [True, False])
def test_names_that_left_out_tests_do_not_bear_out_are_withdrawn(
    arm: Scene, monkeypatch: pytest.MonkeyPatch, first_holds: bool
) -> None:
    """The first name stays alone if the others were to blame; of one instrument nothing is withdrawn."""
    search, nothing = Search(Fitter(arm), mechanisms=[], conjectures=()), hypothesis(arm, 0.0)
    alone, both = hypothesis(arm, 90.0, "dark-offset"), hypothesis(arm, 120.0, "dark-offset", "gamma-offset")
    worse, better = _outside(1.3, 1.2), _outside(0.5, 0.6)

    def left_out(_: Search, h: Hypothesis) -> HeldOut:
        return better if h is nothing or (h is alone and first_holds) else worse

    monkeypatch.setattr(conclusions, "_left_out", left_out)
    monkeypatch.setattr(conclusions, "_look_for_unnamed", lambda *_: None)
    for one_instrument in (False, True):
        found = Conclusion(both, nothing, [alone], verdict="explained", one_instrument=one_instrument)
        found.probability = {"dark-offset": 0.9, "gamma-offset": 0.8}
        conclusions._what_others_bear_out(search, found)
        if one_instrument:
            assert (found.best, found.verdict) == (both, "explained")
        elif first_holds:
            assert (found.best, found.verdict, found.probability) == (alone, "partly-explained", {"dark-offset": 0.9})
        else:
            assert (found.verdict, found.outside) == ("unexplained", better)
        assert found.withdrawn == (not one_instrument and not first_holds)
