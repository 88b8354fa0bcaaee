"""How much evidence a name is asked for: more where much else could make the same of the readings."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.special import logit

from analysis.explain import asked, further
from analysis.explain.conclusion import Conclusion
from analysis.explain.families import CLOUD, SHUTTER
from analysis.explain.fit import MIDDLE, Fit, Fitter
from analysis.explain.further import Beside, _likeliest, name_two_together
from analysis.explain.hypers import Hyper
from analysis.explain.hypothesis import Hypothesis
from analysis.explain.mechanisms.base import Branch, Term
from analysis.explain.mechanisms.catalogue import BY_ID
from analysis.explain.mechanisms.lens import ANY_PATTERN
from analysis.explain.mechanisms.states import terms_of
from analysis.explain.odds import LACKED_ODDS
from analysis.explain.parameter import Parameter
from analysis.explain.retrace import Path
from analysis.explain.scene import Scene
from analysis.explain.search import Search
from analysis.explain.thresholds import (
    EACH_NUMBER,
    EVEN,
    EVEN_COSINE,
    FIRST_BY_LENS,
    HOLDS_LAWS,
    LACKED,
    LEAST_EFFECT_FAR_AHEAD,
    LEAST_EFFECT_FIRST,
    MISFIT_LENS,
    MISFIT_OF_TWO,
    MOST_MISFIT,
    NAME_FIRST_BELOW,
    NAME_FIRST_CLOUD,
    NAME_FIRST_FAR,
    NAME_FIRST_LENS,
    NAME_SECOND,
    NAME_SECOND_BELOW,
    NAME_SECOND_EXPOSURES,
    NAME_SECOND_LENS,
    NAME_SECOND_ONE,
    NAME_SECOND_RANDOM,
    NAME_SECOND_SPLIT,
    NAME_STRETCHED,
    NARROW_DEG,
    NEVER,
    NO_DISC,
    THIRD,
    WRONG_LENS,
)
from analysis.explain.told_form import of_another_lens
from analysis.explain.verdict import decide, first_of, share_of
from analysis.explain.wander import Wandering
from tests.analysis.explain.weighed import decided, hypothesis, on_another_lens


def test_a_form_with_many_numbers_must_gain_more(arm: Scene) -> None:
    """Offsets of ten sensors take what other forms leave; one does not, nor do laws of the arm that have as many."""
    fitter = Fitter(arm)
    counts = {}
    for t in terms_of(BY_ID["dark-offset"], arm):
        start = np.array([p.centre for p in t.parameters])
        fit = fitter.fit((t,), start, Hyper(1.0, 1.0, 1.0))
        fitter.weigh([fit], strides=(4,))
        counts[len(t.parameters)] = fit.log_evidence - fitter.density(fit, ())(fit.hyper)
    ten = next(t.parameters for t in terms_of(BY_ID["dark-offset"], arm) if len(t.parameters) == 10)
    assert counts[10] < counts[1] - 8.0 * EACH_NUMBER
    assert fitter._bending((Term(BY_ID["lens-anisotropy"], ANY_PATTERN, ten),)) == 0.0
    assert fitter._bending((Term(BY_ID["dark-offset"], Branch(), ten),)) == 10 * EACH_NUMBER


@pytest.mark.parametrize(
    ("lens", "least"), [(0.5, NAME_FIRST_BELOW), (WRONG_LENS, NAME_FIRST_BELOW), (2.0, 2.0 * FIRST_BY_LENS)]
)
def test_beside_a_lens_that_is_far_wrong_a_first_name_must_gain_more(arm: Scene, lens: float, least: float) -> None:
    h, nothing = hypothesis(arm, 30.0, "nonlinearity"), hypothesis(arm, 0.0)
    h.fit.hyper = Hyper(1.0, 1.0, lens)
    assert asked.first(h, Conclusion(nothing, nothing, []), 1.0) == pytest.approx(least)
    for offset in (hypothesis(arm, 30.0, "dark-offset"), hypothesis(arm, 30.0, "stray-light")):
        offset.fit.hyper = h.fit.hyper
        assert asked.first(offset, Conclusion(nothing, nothing, []), 1.0) == min(least, NAME_FIRST_LENS)
    from_a_side = next(t for t in terms_of(BY_ID["stray-light"], arm) if len(t.parameters) == 3)
    offset.fit.terms = (from_a_side,)
    assert asked.first(offset, Conclusion(nothing, nothing, []), 1.0) == pytest.approx(least)
    for one_sensor, least_of_it in ((_sensor(arm, 0), NAME_FIRST_LENS), (_sensor(arm, 4), NAME_FIRST_BELOW)):
        one_sensor.fit.hyper = h.fit.hyper
        assert asked.first(one_sensor, Conclusion(nothing, nothing, []), 1.0) == least_of_it
    walls, scatter = hypothesis(arm, 30.0, "soiling"), BY_ID["wall-scatter"]
    walls.fit.terms, walls.fit.hyper = (Term(scatter, Branch("so"), scatter.parameters),), h.fit.hyper
    assert asked.first(walls, Conclusion(nothing, nothing, []), 1.0) == NAME_FIRST_LENS
    alone = Conclusion(nothing, nothing, [], one_instrument=True)
    assert asked.first(h, alone, 1.0) < NAME_FIRST_BELOW


def test_beyond_an_arms_first_and_last_sensor_nothing_is_read(arm: Scene, picture: Scene) -> None:
    """A lens may be wrong there and seem to end between two sensors; a camera has no such ends."""
    ends = [t.branch.outermost for t in terms_of(BY_ID["channel-gain"], arm)]
    assert ends == [True, *[False] * 8, True]
    assert not any(t.branch.outermost for t in terms_of(BY_ID["channel-gain"], picture))


def _sensor(arm: Scene, k: int) -> Hypothesis:
    """The gain of an arm's k-th sensor, from nadir on."""
    h = hypothesis(arm, 30.0, "channel-gain")
    h.fit.terms = (terms_of(BY_ID["channel-gain"], arm)[k],)
    return h


@pytest.mark.parametrize("name", ["clock-offset", "sky-sun-ratio"])
@pytest.mark.parametrize(("other", "ahead"), [(0.0, True), (10.0, True), (15.0, False)])
def test_what_no_lens_does_is_asked_no_more_beside_a_wrong_one(
    arm: Scene, name: str, other: float, ahead: bool
) -> None:
    """And told where what is left is rough, but not where something is left by evidence."""
    rough = Hyper(3.6, 1.0, 2.5)
    found = decided(arm, (name, 45.0), ("lens-haze", other), hyper=rough)
    assert (asked.first(found.best, found, 1.0) == NAME_FIRST_LENS) == ahead
    assert found.verdict == ("partly-explained" if ahead else "unexplained")
    assert decided(arm, (name, 45.0), ("lens-haze", other), hyper=rough, left=87.0).verdict == "unexplained"
    assert decided(arm, ("soiling", 45.0), ("lens-haze", other), hyper=rough).verdict == "unexplained"


@pytest.mark.parametrize("more", [(), ("dark-offset",)])
def test_an_arm_that_points_a_little_elsewhere_is_no_name(arm: Scene, more: tuple[str, ...]) -> None:
    found = Conclusion(hypothesis(arm, 0.0), hypothesis(arm, 0.0), [])
    of_sets = {m: hypothesis(arm, 30.0, *more, m) for m in ("gamma-offset", "c-offset", "soiling")}
    least = {m: asked.least_effect(h, found) for m, h in of_sets.items()}
    assert least["gamma-offset"] == least["c-offset"] > least["soiling"]
    alone = asked.least_effect(hypothesis(arm, 30.0, "c-offset"), found)
    assert (least["c-offset"] > alone) == bool(more)


def test_beside_a_cloud_what_is_added_is_what_is_asked_for(arm: Scene) -> None:
    """A random effect stands behind formulas, whichever came first."""
    cloud = (Wandering(CLOUD, 0.05, 25.0),)
    base = replace(hypothesis(arm, 100.0), wanders=cloud)
    azimuth, offset = (replace(hypothesis(arm, 150.0, m), wanders=cloud, added=m) for m in ("c-offset", "dark-offset"))
    assert azimuth.ids == ("c-offset", CLOUD.name) and azimuth.last == "c-offset" and base.last == CLOUD.name
    found = Conclusion(base, hypothesis(arm, 0.0), [base])
    assert asked.least_effect(azimuth, found) > asked.least_effect(offset, found)


@pytest.mark.parametrize("name", ["sky-sun-ratio", "saturation"])
@pytest.mark.parametrize(("other", "ahead"), [(4.0, True), (40.0, False)])
def test_what_no_lens_does_may_change_little_if_far_ahead(arm: Scene, name: str, other: float, ahead: bool) -> None:
    found = decided(arm, (name, 60.0), ("lens-haze", other))
    assert asked.least_effect(found.best, found) == (LEAST_EFFECT_FAR_AHEAD if ahead else LEAST_EFFECT_FIRST)


@pytest.mark.parametrize(("name", "stretched"), [("weight", False), ("stretch", True)])
def test_a_stretched_lens_must_gain_more_first_and_beside(arm: Scene, name: str, stretched: bool) -> None:
    along = Parameter(name, "1", "of a lens", -0.7, 0.7, 0.15, (0.1,))
    term, no = Term(BY_ID["lens-anisotropy"], Branch("so"), (along,)), np.zeros(0)
    nothing = Hypothesis(Fit((), no, no, no, hyper=MIDDLE), 0.0)
    h = Hypothesis(Fit((term,), np.array([0.1]), no, no, hyper=MIDDLE), 50.0)
    found = Conclusion(nothing, nothing, [h])
    assert (asked.first(h, found, 1.0) == NAME_STRETCHED) == stretched
    beside = asked.beside(h, nothing, found, "lens-anisotropy", random=False)
    assert (beside >= NAME_STRETCHED) == stretched


@pytest.mark.parametrize(("tilt_deg", "first"), [((6.0, -4.0), True), ((3.0, -12.0), False)])
def test_nobody_leaves_a_meter_tilted_by_more_than_is_seen(
    arm: Scene, tilt_deg: tuple[float, float], first: bool
) -> None:
    """And what nothing does hardly speaks against what may be."""
    tilted, late = hypothesis(arm, 480.0, "meter-tilt"), hypothesis(arm, 445.0, "clock-offset")
    tilted.fit.theta = np.array(tilt_deg)
    found = Conclusion(late, hypothesis(arm, 0.0), [tilted, late])
    assert (asked.first(tilted, found, 1.0) < NEVER) == first
    decide(found, 1.0)
    assert (found.verdict == "explained") != first


@pytest.mark.parametrize(("bend", "least"), [(0.1, NAME_FIRST_FAR), (-0.1, NAME_FIRST_BELOW)])
def test_a_response_that_bends_upwards_looks_like_sharper_images(arm: Scene, bend: float, least: float) -> None:
    h, nothing = hypothesis(arm, 50.0, "nonlinearity"), hypothesis(arm, 0.0)
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
    h, nothing = hypothesis(arm, 50.0, "circumsolar-aureole"), hypothesis(arm, 0.0)
    h.fit.theta = np.array([fraction, width_deg])
    found = Conclusion(nothing, nothing, [])
    assert (fraction**0.5 * width_deg < NARROW_DEG or fraction > NO_DISC) == narrow
    assert asked.first(h, found, 1.0) == (NAME_FIRST_FAR if narrow else NAME_FIRST_LENS)
    assert (asked.more_as_rival(h, found) > 0.0) == narrow
    beside = asked.beside(h, nothing, found, "circumsolar-aureole", random=False)
    assert (beside >= NAME_FIRST_FAR) == narrow
    on_another_lens(Conclusion(h, nothing, []), of_case=True)
    assert asked.first(h, found, 1.0) < NAME_FIRST_FAR


def test_a_sun_without_any_disc_is_never_named_and_no_rival(arm: Scene) -> None:
    """Unless the case itself brings one."""
    sun, other = hypothesis(arm, 300.0, "circumsolar-aureole"), hypothesis(arm, 300.0, "gamma-offset")
    nothing = hypothesis(arm, 0.0)
    sun.fit.theta = np.array([1.0, 4.0])
    found = Conclusion(other, nothing, [sun, other])
    assert asked.first(sun, found, 1.0) == NEVER
    decide(found, 1.0)
    assert found.probability["gamma-offset"] > 0.94
    on_another_lens(Conclusion(sun, nothing, []), of_case=True)
    assert asked.first(sun, found, 1.0) < NAME_FIRST_FAR


@pytest.mark.parametrize(("change", "never"), [(0.47, False), (-0.40, False), (0.54, True), (-0.52, True)])
def test_no_diffuse_illuminance_is_wrong_by_half(arm: Scene, change: float, never: bool) -> None:
    split = hypothesis(arm, 475.0, "sky-sun-ratio")
    split.fit.theta = np.array([change])
    found = Conclusion(split, hypothesis(arm, 0.0), [split])
    assert (asked.first(split, found, 1.0) == NEVER) == never


@pytest.mark.parametrize("first", ["lens-orientation", "lens-anisotropy"])
def test_a_pattern_that_was_not_known_does_not_lie_wrongly(arm: Scene, first: str) -> None:
    """Either of the two may stand beside anything else."""
    lens = {m: Term(BY_ID[m], Branch(), BY_ID[m].parameters) for m in ("lens-orientation", "lens-anisotropy")}
    base, other = hypothesis(arm, 1000.0), hypothesis(arm, 1000.0, "gamma-offset")
    base.fit.terms = (lens.pop(first),)
    (new,) = lens
    found = Conclusion(base, hypothesis(arm, 0.0), [base])
    for before, never in ((base, True), (other, False)):
        both = hypothesis(arm, 1100.0)
        both.fit.terms = (*before.fit.terms, lens[new])
        both.fit.theta = np.zeros(len(both.fit.parameters))
        assert (asked.beside(both, before, found, new, random=False) == NEVER) == never


@pytest.mark.parametrize(("lens", "least"), [(0.3, NAME_FIRST_BELOW), (0.6, NAME_FIRST_LENS)])
def test_what_looks_like_a_lens_is_asked_less_where_the_simulated_lens_is_right(
    arm: Scene, lens: float, least: float
) -> None:
    """Not what acts alike on all readings under one sun."""
    nothing = hypothesis(arm, 0.0)
    for name, needed in (("lens-haze", least), ("sky-sun-ratio", NAME_FIRST_LENS)):
        h = hypothesis(arm, 20.0, name)
        h.fit.hyper = Hyper(1.0, 1.0, lens)
        assert asked.first(h, Conclusion(nothing, nothing, []), 1.0) == needed


@pytest.mark.parametrize(("late", "told"), [(140.0, "clock-offset"), (90.0, "c-offset")])
def test_an_azimuth_that_half_looks_like_a_clock_is_one(arm: Scene, late: float, told: str) -> None:
    """An arm that is turned looks like no clock; a turn beside a clock is what that leaves."""
    singles = [hypothesis(arm, 230.0, "c-offset"), hypothesis(arm, late, "clock-offset")]
    nothing = hypothesis(arm, 0.0)
    found = Conclusion(nothing, nothing, singles)
    found.best = first_of(singles, found)
    decide(found, 1.0)
    assert found.best.ids == (told,) and found.verdict == "explained"
    both = hypothesis(arm, 300.0, told, "c-offset") if told != "c-offset" else hypothesis(arm, 300.0, told, "soiling")
    asked_of_it = asked.beside(both, found.best, found, both.ids[-1], random=False, share=1.0)
    assert (asked_of_it >= NAME_FIRST_FAR) == (told == "clock-offset")


def test_a_change_that_the_case_brings_leaves_little_for_others(arm: Scene) -> None:
    """Its lens is the prediction's own: what is left beside it is not the change's fault."""
    left = []
    for of_case in (False, True):
        found = decided(arm, ("lens-orientation", 1000.0))
        on_another_lens(found, of_case=of_case)
        assert of_another_lens(found.best) is not of_case
        left.append(asked.misfit(found.best, found.nothing))
    assert left == [pytest.approx(MISFIT_LENS * 1000.0), pytest.approx(MOST_MISFIT)]
    assert MOST_MISFIT < MISFIT_LENS * 1000.0


def test_a_cloud_that_repeats_do_not_show_is_asked_for_more(arm: Scene) -> None:
    nothing = hypothesis(arm, 0.0)
    cloud = replace(nothing, wanders=(Wandering(CLOUD, 0.05, 25.0),))
    for few in (0.5, 1.0):  # planes follow each other in time in a short scan, too
        assert asked.first(cloud, Conclusion(nothing, nothing, []), few) == NAME_FIRST_CLOUD
        assert asked.first(cloud, Conclusion(nothing, nothing, [], shown={CLOUD.name}), few) < 0.5 * NAME_FIRST_CLOUD


@pytest.mark.parametrize(
    ("first", "second", "third", "together", "told"),
    [
        (40.0, 35.0, 30.0, 75.0, True),
        (40.0, 35.0, 30.0, 60.0, False),  # not enough for so wrong a lens
        (40.0, 60.0, 30.0, 70.0, False),  # the one gains too little beside the other
        (40.0, 35.0, 76.0, 75.0, False),  # another does as well alone
    ],
)
def test_two_that_gain_too_little_alone_may_be_told_together(
    arm: Scene, monkeypatch: pytest.MonkeyPatch, first: float, second: float, third: float, together: float, told: bool
) -> None:
    search, nothing = Search(Fitter(arm), mechanisms=[], conjectures=()), hypothesis(arm, 0.0)
    names = {"saturation": first, "cosine-response": second, "lens-haze": third}
    singles = [hypothesis(arm, gain, name) for name, gain in names.items()]
    both = hypothesis(arm, together, "saturation", "cosine-response")
    for h in (*singles, both):
        h.fit.hyper = Hyper(2.0, 1.0, 2.5)
    monkeypatch.setattr(further, "_beside", lambda _, __, base: Beside(base, 0.0, []))
    monkeypatch.setattr(further, "_one_more", lambda _, __, beside: (together - beside.base.evidence, both))
    found = Conclusion(nothing, nothing, singles)
    assert all(asked.first(h, found, 1.0) > h.evidence for h in singles[:2])
    name_two_together(search, found, 1.0)
    assert found.best.ids == (both.ids if told else ())


def test_a_clock_that_is_off_by_seconds_is_none(roof: Scene) -> None:
    off = hypothesis(roof, 100.0, "meter-gain", "clock-offset")
    for minutes, moment in ((0.03, True), (-0.09, True), (0.4, False)):
        theta = np.zeros(len(off.fit.parameters))
        theta[0], theta[-1] = 0.02, minutes
        assert asked.is_a_moment(replace(off, fit=replace(off.fit, theta=theta))) == moment


def test_a_blur_is_asked_for_more(arm: Scene) -> None:
    near, other = hypothesis(arm, 50.0, "near-field"), hypothesis(arm, 50.0, "c-offset")
    (term,) = near.fit.terms
    nothing = hypothesis(arm, 0.0)
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
    nothing, base, both = hypothesis(arm, 0.0), hypothesis(arm, 80.0, first), hypothesis(arm, 130.0, first, further)
    (_, form), given = both.fit.terms, Branch(brought=brought)
    terms = *base.fit.terms, replace(form, branch=given)
    theta = np.concatenate([[0.4, 6.0][: len(t.parameters)] for t in terms])  # of an aureole: no mere blur
    both = replace(both, fit=replace(both.fit, terms=terms, theta=theta))
    found = Conclusion(base, nothing, [base])
    assert (asked.beside(both, base, found, further, random=False) >= NAME_FIRST_FAR) == (left and not brought)


@pytest.mark.parametrize(("first", "further"), [("clock-offset", "meter-tilt"), ("meter-tilt", "clock-offset")])
def test_what_moves_a_roofs_day_to_one_side_is_not_both_a_clock_and_a_tilt(
    roof: Scene, first: str, further: str
) -> None:
    nothing, base = hypothesis(roof, 0.0), hypothesis(roof, 280.0, first)
    found = Conclusion(base, nothing, [base], one_instrument=True, readings=100)
    for new, least in ((further, NAME_FIRST_FAR), ("dark-offset", NAME_SECOND)):
        both = hypothesis(roof, 297.0, first, new)
        asked_for = asked.beside(both, base, found, new, random=False)
        assert least <= asked_for <= least + asked.misfit(base, nothing)


def test_what_looks_like_a_lens_beside_another_is_asked_less_where_the_case_brings_it(arm: Scene) -> None:
    least = []
    for of_case in (False, True):
        first, both = (hypothesis(arm, 100.0, *ids) for ids in (("c-offset",), ("c-offset", "lens-orientation")))
        path = Path("turned", both.fit.terms[1].parameters[0], np.zeros(2), *np.ones((2, 2, 1, 1, 1)), of_case=of_case)
        both.fit.terms = (both.fit.terms[0], replace(both.fit.terms[1], branch=Branch("turned", path)))
        found = Conclusion(first, hypothesis(arm, 0.0), [first])
        least.append(
            asked.beside(both, first, found, "lens-orientation", random=False) - asked.misfit(first, found.nothing)
        )
    assert least == [NAME_SECOND_LENS, NAME_SECOND_BELOW]


def test_a_single_sensor_beside_another_name_is_asked_less_and_what_follows_the_sun_more(arm: Scene) -> None:
    """What a lens has wrong does not end beside a sensor, and depends on where the sun stands."""
    first = hypothesis(arm, 100.0, "c-offset")
    found = Conclusion(first, hypothesis(arm, 0.0), [first])
    left, asked_for = asked.misfit(first, found.nothing), []
    for new in ("cosine-response", "sky-sun-ratio"):
        both = hypothesis(arm, 120.0, "c-offset", new)
        asked_for.append(asked.beside(both, first, found, new, random=False) - left)
    assert asked_for == [NAME_SECOND_BELOW, NAME_SECOND_LENS]
    of_arm = (asked.beside(_with_sensor(arm, k, first), first, found, "channel-gain", random=False) for k in (0, 4, 9))
    assert list(of_arm) == [NAME_SECOND_LENS + left, NAME_SECOND_ONE, NAME_SECOND_LENS + left]
    assert NAME_SECOND_ONE < NAME_SECOND_BELOW < NAME_SECOND_LENS


def test_a_single_sensor_as_a_third_name_is_asked_for_what_the_others_leave(arm: Scene) -> None:
    two = hypothesis(arm, 300.0, "c-offset", "lens-haze")
    found = Conclusion(two, hypothesis(arm, 0.0), [two])
    asked_for = asked.beside(_with_sensor(arm, 4, two), two, found, "channel-gain", random=False)
    assert asked_for == THIRD * NAME_SECOND_ONE + asked.misfit(two, found.nothing)


def _with_sensor(arm: Scene, k: int, base: Hypothesis) -> Hypothesis:
    """What is there already, and the gain of an arm's k-th sensor."""
    both = hypothesis(arm, base.evidence + 20.0, *base.ids, "channel-gain")
    both.fit.terms = (*both.fit.terms[:-1], terms_of(BY_ID["channel-gain"], arm)[k])
    return both


@pytest.mark.parametrize(("new", "all_of_it"), [("cosine-response", False), ("lens-orientation", True)])
def test_what_a_form_leaves_counts_for_less_against_a_name_that_stands_out(
    arm: Scene, new: str, all_of_it: bool
) -> None:
    """Many could take what another lens has wrong; but that looks like a lens."""
    first, both = hypothesis(arm, 400.0, "lens-orientation"), hypothesis(arm, 450.0, "lens-orientation", new)
    if all_of_it:
        first, both = hypothesis(arm, 400.0, "c-offset"), hypothesis(arm, 450.0, "c-offset", new)
    found = Conclusion(first, hypothesis(arm, 0.0), [first])
    left = asked.misfit(first, found.nothing)
    shares = (0.5, found.sure_beside, 0.5 * (1.0 + found.sure_beside), 1.0)
    asked_for = [asked.beside(both, first, found, new, False, share) for share in shares]
    least = NAME_SECOND_LENS if all_of_it else NAME_SECOND_BELOW
    assert asked_for == pytest.approx([least + left * part for part in (1, 1, 1 if all_of_it else 0.5, all_of_it)])
    assert left > 1.0


def test_a_third_name_is_asked_for_more_than_a_second(arm: Scene) -> None:
    names = ("c-offset", "cosine-response")
    found = Conclusion(hypothesis(arm, 100.0, *names), hypothesis(arm, 0.0), [])
    asked_for = [
        asked.beside(
            hypothesis(arm, 130.0, *base, "dark-offset"), hypothesis(arm, 100.0, *base), found, new, False, 1.0
        )
        for base, new in ((names[:1], "dark-offset"), (names, "dark-offset"))
    ]
    assert asked_for == [NAME_SECOND_BELOW, THIRD * NAME_SECOND_BELOW]


def test_errors_of_the_exposures_hold_what_laws_of_the_level_leave(picture: Scene) -> None:
    """Beside a wrong projection they hold nothing; and an arm's random effect must gain more beside either."""
    nothing, least = hypothesis(picture, 0.0), {}
    for name in ("projection-error", "veiling-glare"):
        first = hypothesis(picture, 300.0, name)
        both = replace(first, wanders=(Wandering(SHUTTER, 0.05),))
        found = Conclusion(first, nothing, [first], one_instrument=True, pictures=True)
        least[name] = asked.beside(both, first, found, "exposure-error", random=True)
        arm = replace(found, pictures=False)
        assert asked.beside(both, first, arm, "exposure-error", random=True) > NAME_SECOND_RANDOM
    assert least["projection-error"] == NAME_SECOND_EXPOSURES
    assert least["veiling-glare"] == pytest.approx(NAME_SECOND_EXPOSURES + HOLDS_LAWS * 300.0)


def test_what_the_prediction_lacks_by_the_cases_account_is_likelier_and_asked_for_less(arm: Scene) -> None:
    """As the first name, beside a far wrong lens, and as a further name."""
    nothing, lacked = hypothesis(arm, 0.0), frozenset({"cosine-response"})
    lacking, dirt = hypothesis(arm, 35.0, "cosine-response"), hypothesis(arm, 40.0, "soiling")
    lacking.fit.hyper = Hyper(1.0, 1.0, 2.5)
    plain, told = (Conclusion(nothing, nothing, [dirt, lacking], lacked=names) for names in (frozenset[str](), lacked))
    assert asked.first(lacking, told, 1.0) == LACKED < asked.first(lacking, plain, 1.0)
    assert asked.least_effect(lacking, told) < asked.least_effect(lacking, plain)
    assert [first_of([dirt, lacking], f).ids for f in (plain, told)] == [dirt.ids, lacking.ids]
    assert [_likeliest(f, [dirt, lacking], nothing, 0.0).ids for f in (plain, told)] == [dirt.ids, lacking.ids]
    shares = [share_of(f, lacking, nothing, [dirt, lacking], 35.0) for f in (plain, told)]
    assert logit(shares[1]) == pytest.approx(logit(shares[0]) + LACKED_ODDS)
    rough = decided(arm, ("cosine-response", 45.0), hyper=Hyper(3.6, 1.0, 2.5))
    assert rough.verdict == "unexplained"
    rough.lacked = lacked
    decide(rough, 1.0)
    assert rough.verdict == "partly-explained", "however rough what is left"
    asked_beside = [asked.beside(lacking, nothing, f, "cosine-response", random=False) for f in (plain, told)]
    assert asked_beside[1] == LACKED < asked_beside[0]


def test_two_names_leave_more_for_a_third_than_one_for_a_second(arm: Scene) -> None:
    one, two = (hypothesis(arm, 5000.0, *ids) for ids in (("c-handedness",), ("c-handedness", "gamma-offset")))
    nothing = hypothesis(arm, 0.0)
    assert asked.misfit(two, nothing) == pytest.approx(MISFIT_OF_TWO * 5000.0)
    assert asked.misfit(one, nothing) < asked.misfit(two, nothing)


def test_what_a_clock_leaves_is_no_azimuth_whichever_came_first(arm: Scene) -> None:
    """Another author's clock was told with one of 36 nats over it alone, found with the azimuth as the base."""
    clock, turned = hypothesis(arm, 137.0, "clock-offset"), hypothesis(arm, 75.0, "c-offset")
    found = Conclusion(clock, hypothesis(arm, 0.0), [clock, turned])
    assert asked.mistaken(turned, "clock-offset", 173.0, found)
    assert not asked.mistaken(turned, "clock-offset", 137.0 + NAME_FIRST_FAR, found)
    assert not asked.mistaken(hypothesis(arm, 75.0, "dark-offset"), "clock-offset", 173.0, found)


def test_a_wrong_split_beside_another_name_must_gain_much_on_a_roof(roof: Scene) -> None:
    late, nothing = hypothesis(roof, 300.0, "clock-offset"), hypothesis(roof, 0.0)
    found = Conclusion(late, nothing, [late], one_instrument=True, readings=100)
    left = asked.misfit(late, nothing)
    for new, least in (("sky-sun-ratio", NAME_SECOND_SPLIT), ("dark-offset", NAME_SECOND)):
        both = hypothesis(roof, 340.0, "clock-offset", new)
        assert least <= asked.beside(both, late, found, new, random=False) <= least + left


@pytest.mark.parametrize(("readings", "lens", "times"), [(2000, 1.5, 2.0), (2000, 0.75, 1.0), (100, 1.5, 0.0)])
def test_on_one_instrument_a_further_name_must_gain_what_makes_a_first_as_likely_wrong_as_right(
    roof: Scene, readings: int, lens: float, times: float
) -> None:
    """Where readings are many and the prediction is wrong; a cosine error less. Below a skylight nothing adds up."""
    late, nothing = hypothesis(roof, 300.0, "clock-offset"), hypothesis(roof, 0.0)
    found = Conclusion(late, nothing, [late], one_instrument=True, readings=readings)
    left = asked.misfit(late, nothing)
    for new, even in (("dark-offset", EVEN), ("meter-cosine", EVEN_COSINE)):
        both = hypothesis(roof, 340.0, "clock-offset", new)
        both.fit.hyper = Hyper(1.0, 1.0, lens)
        least = max(NAME_SECOND, times * even)
        assert least <= asked.beside(both, late, found, new, random=False) <= least + left
        found.one_instrument = False
        assert asked.beside(both, late, found, new, random=False) < NAME_SECOND_LENS + left + 1e-9
        found.one_instrument = True
