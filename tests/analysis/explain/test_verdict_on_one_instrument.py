"""How sure a name is where one instrument tells: a camera, or meters on a roof."""

from dataclasses import replace

import pytest
from scipy.special import expit

from analysis.explain.conclusion import Conclusion, Unnamed, temper
from analysis.explain.families import SHUTTER, UNREST
from analysis.explain.hypers import Hyper
from analysis.explain.hypothesis import Hypothesis
from analysis.explain.mechanisms.base import Branch, Term
from analysis.explain.mechanisms.conjectures import CONJECTURES
from analysis.explain.odds import COSINE_OR_BENT, TILTED_OR_LATE
from analysis.explain.scene import Scene
from analysis.explain.thresholds import EVEN_LENS, RELIABLE, SURE, TEMPER, TEMPER_ONE
from analysis.explain.verdict import decide, first_of
from analysis.explain.wander import Wandering
from tests.analysis.explain.weighed import decided, hypothesis, pair_and_rival


@pytest.mark.parametrize(("units", "told"), [(0.0, "meter-tilt"), (2.0, "meter-tilt"), (3.0, "clock-offset")])
def test_a_clock_that_is_hardly_ahead_of_a_tilted_meter_is_a_tilted_meter(roof: Scene, units: float, told: str) -> None:
    """On a roof; which is told decides how the other counts against it."""
    nats = temper(100.0, TEMPER_ONE)
    singles = [("clock-offset", 100.0), ("meter-tilt", 100.0 - units * nats), ("dark-offset", 30.0)]
    weighed = [hypothesis(roof, gain, name) for name, gain in singles]
    found = Conclusion(weighed[0], hypothesis(roof, 0.0), weighed, one_instrument=True, nat=TEMPER_ONE)
    found.best = first_of(weighed, found)
    assert found.best.ids == (told,)
    decide(found, 1.0)
    lead = units * nats / temper(found.best.evidence, TEMPER_ONE)
    ahead = TILTED_OR_LATE - lead if told == "meter-tilt" else lead - TILTED_OR_LATE
    assert found.probability[told] == pytest.approx(RELIABLE * float(expit(ahead)), abs=1e-6)
    found.one_instrument = False
    assert first_of(weighed, found).ids == ("clock-offset",)


@pytest.mark.parametrize("rival", ["nonlinearity", "dark-offset"])
@pytest.mark.parametrize(("lead", "told"), [(0.0, "meter-cosine"), (1.2, "meter-cosine"), (1.8, "rival")])
def test_what_grows_with_the_sun_is_a_cosine_error_unless_another_is_ahead(
    roof: Scene, rival: str, lead: float, told: str
) -> None:
    nats = temper(40.0, TEMPER_ONE)
    weighed = [hypothesis(roof, 40.0, rival), hypothesis(roof, 40.0 - lead * nats, "meter-cosine")]
    found = Conclusion(weighed[0], hypothesis(roof, 0.0), weighed, one_instrument=True, nat=TEMPER_ONE)
    found.best = first_of(weighed, found)
    assert found.best.ids == (rival if told == "rival" else told,)
    decide(found, 1.0)
    doubtful = abs(lead - COSINE_OR_BENT) < 0.5
    assert (found.verdict == "unexplained") == doubtful


def test_a_law_that_does_as_well_as_a_random_function_is_likely(picture: Scene) -> None:
    """A random function of level holds every law of level; its evidence is not that of another form."""
    law, rival = hypothesis(picture, 95.0, "nonlinearity"), hypothesis(picture, 90.0, "exposure-error")
    found = Conclusion(law, hypothesis(picture, 0.0), [law, rival], one_instrument=True)
    decide(found, 1.0)
    doubtful = found.probability["nonlinearity"]
    rival.wanders = (Wandering(SHUTTER, 0.05),)
    decide(found, 1.0)
    assert doubtful < SURE < found.probability["nonlinearity"]


def test_the_same_lead_counts_more_where_no_lens_was_simulated(picture: Scene) -> None:
    law, rival = hypothesis(picture, 84.0, "spectral-mismatch"), hypothesis(picture, 76.0, "nonlinearity")
    sure = []
    for nat in (TEMPER, TEMPER_ONE):
        found = Conclusion(law, hypothesis(picture, 0.0), [law, rival], one_instrument=True, nat=nat)
        decide(found, 1.0)
        sure.append(found.probability["spectral-mismatch"])
    assert sure[0] < SURE < sure[1]


@pytest.mark.parametrize(
    ("readings", "lens", "little", "enough"),
    [(200, 1.5, 5.4, 12.0), (1000, 1.5, 27.0, 42.0), (1600, 4.0, 43.0, 60.0), (1000, 0.3, 5.0, 12.0)],
)
def test_of_one_instrument_little_evidence_is_no_name(
    picture: Scene, readings: int, lens: float, little: float, enough: float
) -> None:
    """Five nats in 200 readings are what any fault outside the catalogue may give to some name; more in more.

    But not where the prediction is right but for what is named.
    """
    verdicts = {}
    for gain in (little, enough):
        only = hypothesis(picture, gain, "vignetting")
        only.fit.hyper = Hyper(1.0, 1.0, lens)
        found = Conclusion(only, hypothesis(picture, 0.0), [only], one_instrument=True, nat=TEMPER_ONE)
        found.readings, found.pictures = readings, True
        decide(found, 1.0)
        verdicts[gain] = found.verdict
    assert verdicts == {little: "unexplained", enough: "explained"}


@pytest.mark.parametrize(
    ("name", "pictures", "gain", "verdict"),
    [
        ("vignetting", True, 33.0, "explained"),
        ("dark-offset", False, 33.0, "unexplained"),
        ("meter-cosine", False, 20.0, "explained"),
        ("meter-cosine", False, 12.0, "unexplained"),
    ],
)
def test_a_camera_or_a_cosine_error_needs_less_evidence_than_a_meters_other_faults(
    picture: Scene, roof: Scene, name: str, pictures: bool, gain: float, verdict: str
) -> None:
    only = hypothesis(picture if pictures else roof, gain, name)
    only.fit.hyper = Hyper(1.0, 1.0, EVEN_LENS)
    found = Conclusion(only, hypothesis(picture, 0.0), [only], one_instrument=True, pictures=pictures, nat=TEMPER_ONE)
    decide(found, 1.0)
    assert found.verdict == verdict


def test_of_names_in_a_set_each_must_be_sure(picture: Scene) -> None:
    """A random effect's name stands behind those of formulas, also where it came first and others could replace it."""
    shutter, rival = hypothesis(picture, 357.0, "exposure-error"), hypothesis(picture, 300.0, "nonlinearity")
    found = Conclusion(shutter, hypothesis(picture, 0.0), [rival, shutter], one_instrument=True, nat=TEMPER_ONE)
    found.best = hypothesis(picture, 420.0, "projection-error")
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


def test_who_imitates_a_sum_is_weighed_against_the_sum(picture: Scene) -> None:
    """If a further name was sought beside the imitator too, and none was found that does as well without the first."""
    found = pair_and_rival(picture, 110.0, 143.0, 200.0)
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
    found = decided(picture, ("vignetting", 100.0), ("nonlinearity", 40.0), left=60.0)
    alone = found.probability["vignetting"]
    found.considered = [(("nonlinearity", "exposure-error"), 95.0)]
    decide(found, 1.0)
    assert found.probability["vignetting"] < alone
    found.considered.append((("vignetting", "exposure-error"), 170.0))
    decide(found, 1.0)
    assert found.probability["vignetting"] > alone


def test_what_was_there_first_is_weighed_against_nothing(picture: Scene) -> None:
    """Two that are each sure beside the other may both be nothing: neither tells much alone."""
    weak, other = hypothesis(picture, 8.5, "channel-gain"), hypothesis(picture, 6.0, "vignetting")
    found = Conclusion(weak, hypothesis(picture, 0.0), [weak, other], one_instrument=True, nat=TEMPER_ONE)
    found.best = hypothesis(picture, 26.0, "channel-gain", "vignetting")
    found.best.added_to = "channel-gain"
    pair = frozenset({"channel-gain", "vignetting"})
    found.shares = {(pair - {name}, name): 0.9 for name in pair}
    decide(found, 1.0)
    assert found.probability["channel-gain"] < SURE < found.probability["vignetting"]
    assert found.verdict == "unexplained"


def test_exposures_explain_a_camera_and_a_cloud_an_arm_only_if_repeats_show_it(picture: Scene) -> None:
    for alone, shown, verdict in (
        (True, False, "explained"),
        (False, False, "partly-explained"),
        (False, True, "explained"),
    ):
        shutter = Hypothesis(hypothesis(picture, 0.0).fit, 200.0, (Wandering(SHUTTER, 0.05),))
        found = Conclusion(shutter, hypothesis(picture, 0.0), [shutter], one_instrument=alone)
        found.shown = set(shutter.ids) if shown else set()
        decide(found, 1.0)
        assert found.verdict == verdict


def test_structure_that_nobody_names_counts_more_of_one_instrument(picture: Scene) -> None:
    """Its forms are formulas; below a skylight a simulated lens leaves as much."""
    verdicts = {}
    for one_instrument in (True, False):
        nothing = hypothesis(picture, 0.0)
        found = Conclusion(nothing, nothing, [], one_instrument=one_instrument)
        found.unnamed = [Unnamed("direction in the picture", 20.0, 0.03)]
        decide(found, 1.0)
        verdicts[one_instrument] = found.verdict
    assert verdicts == {True: "unexplained", False: "no-mismatch"}


def test_a_slow_meter_is_as_likely_as_a_late_clock(roof: Scene) -> None:
    """And the scatter under cloud that tells a clock is there beside a slow meter, too."""
    (slow,) = [m for m in CONJECTURES if m.id == "sluggish response"]
    law = Unnamed(slow.id, 505.0, 1.0, Term(slow, Branch(), slow.parameters))
    plain = hypothesis(roof, 507.0, "clock-offset")
    scattered = replace(hypothesis(roof, 950.0, "clock-offset"), wanders=(Wandering(UNREST, 0.5),))

    def named(law: Unnamed) -> bool:
        found = Conclusion(scattered, hypothesis(roof, 0.0), [scattered, plain], one_instrument=True, nat=TEMPER_ONE)
        found.instead = [law]
        decide(found, 1.0)
        return found.verdict == "explained"

    assert not named(law)
    assert named(replace(law, gain=440.0))
    assert named(replace(law, along="warming meter")), "other laws have no such scatter"


def test_of_one_instrument_three_names_are_too_many(picture: Scene) -> None:
    """Whoever needs three laws for one camera has mostly found another law."""
    ids = ("vignetting", "spectral-mismatch", "nonlinearity")
    for count, verdict in ((2, "explained"), (3, "unexplained")):
        both = hypothesis(picture, 900.0, *ids[:count])
        singles = [hypothesis(picture, gain, name) for name, gain in zip(ids, (500.0, 300.0, 200.0), strict=True)]
        found = Conclusion(both, hypothesis(picture, 0.0), singles, one_instrument=True, nat=TEMPER_ONE)
        decide(found, 1.0)
        assert found.verdict == verdict
        assert (found.not_claimed[0] == (ids, min(found.probability.values()))) == (count == 3)


@pytest.mark.parametrize(
    ("hyper", "verdict"),
    [
        (Hyper(1.5, 2.9, 1.6), "no-mismatch"),
        (Hyper(3.1, 1.0, 1.0), "unexplained"),
        (Hyper(1.0, 3.6, 1.0), "unexplained"),
        (Hyper(1.0, 1.0, 2.5), "no-mismatch"),
    ],
)
def test_where_nothing_is_named_a_rough_rest_says_that_something_is_there(
    arm: Scene, picture: Scene, hyper: Hyper, verdict: str
) -> None:
    for scene, expected in ((arm, verdict), (picture, "no-mismatch")):
        nothing = hypothesis(scene, 0.0)
        nothing.fit.hyper = hyper
        found = Conclusion(nothing, nothing, [], one_instrument=scene is picture)
        decide(found, 1.0)
        assert found.verdict == expected


def test_of_one_instrument_only_a_large_shape_error_says_so(picture: Scene) -> None:
    """A glare on a meter had been a clock of 30 nats; where nothing was left out, no shape error was so large."""
    for shape, nothing_named, named in ((4.2, "no-mismatch", "explained"), (5.0, "unexplained", "unexplained")):
        nothing = hypothesis(picture, 0.0)
        nothing.fit.hyper = Hyper(shape, 1.0)
        found = Conclusion(nothing, nothing, [], one_instrument=True)
        decide(found, 1.0)
        assert found.verdict == nothing_named
        first = hypothesis(picture, 70.0, "vignetting")
        first.fit.hyper = Hyper(shape, 1.0)
        found = Conclusion(first, hypothesis(picture, 0.0), [first], one_instrument=True, nat=TEMPER_ONE)
        decide(found, 1.0)
        assert found.verdict == named
