"""What forms have wrong grows with what they change, and a form that is wrong in places is believed all the same."""

from dataclasses import replace

import numpy as np
import pytest

from analysis.explain import form_error as form_error_module
from analysis.explain.fit import MIDDLE, Fitter
from analysis.explain.form_error import form_error, locally_wrong
from analysis.explain.hypers import Hyper
from analysis.explain.hypothesis import Hypothesis
from analysis.explain.lens_error import lens_error_of_systems
from analysis.explain.mechanisms.base import Branch, Term, lit_by, predict
from analysis.explain.mechanisms.catalogue import BY_ID
from analysis.explain.parameter import Parameter
from analysis.explain.retrace import Path
from analysis.explain.scene import Scene
from analysis.explain.search import Search
from analysis.explain.thresholds import AS_IT_IS
from analysis.explain.told_form import traced
from tests.analysis.explain.test_mechanisms import term


def _variance(scene: Scene, way: Term, theta: float) -> tuple[np.ndarray, np.ndarray]:
    """Variance that is allowed for, and the squared change; shape (N,) each."""
    at, r = np.array([theta]), scene.readings
    change = r.stretched(predict(scene, (way,), at)) - r.stretched(predict(scene, (), np.zeros(0)))
    return sum(np.sum(e.columns**2, axis=1) for e in form_error(scene, (way,), at)), change**2


def test_without_a_mechanism_nothing_is_wrong(arm: Scene) -> None:
    assert form_error(arm, (), np.zeros(0)) == ()


def test_a_mechanism_that_changes_nothing_has_nothing_wrong(arm: Scene) -> None:
    assert np.all(_variance(arm, term(arm, "c-offset"), 0.0)[0] == 0.0)


@pytest.mark.parametrize(("mechanism", "theta"), [("c-offset", 5.0), ("gamma-offset", 2.0)])
def test_the_error_is_a_share_of_the_change(arm: Scene, mechanism: str, theta: float) -> None:
    way = term(arm, mechanism)
    variance, change = _variance(arm, way, theta)
    share = way.mechanism.form_error_in(arm) ** 2 + way.mechanism.local_error**2
    seen = change > 1e-8
    assert np.median(variance[seen] / change[seen]) == pytest.approx(share, rel=0.1)


def test_a_single_reading_may_miss_a_local_share_of_the_change(arm: Scene) -> None:
    offset, azimuth = term(arm, "dark-offset", "the goniometer's sensors"), term(arm, "c-offset")
    assert np.all(locally_wrong(arm, (offset,), np.array([40.0])) == 0.0)
    _, change = _variance(arm, azimuth, 5.0)
    one = locally_wrong(arm, (azimuth,), np.array([5.0]))
    assert one == pytest.approx(azimuth.mechanism.local_error * np.sqrt(change))
    both = locally_wrong(arm, (azimuth, offset), np.array([5.0, 0.0]))
    assert both == pytest.approx(one)


def test_near_sensors_see_edges_off_by_half_the_aperture(arm: Scene) -> None:
    widest = max(max(s.aperture.size_m or (s.aperture.diameter_m,)) for s in arm.readings.case.setup.system)
    seen = term(arm, "near-field", "closed form").mechanism.displaces_deg(arm)
    assert np.tan(np.radians(seen)) * 2.6 == pytest.approx(widest / 2.0)
    assert term(arm, "c-offset").mechanism.displaces_deg(arm) == 0.0


@pytest.mark.parametrize(
    ("mechanism", "way"), [("c-handedness", "zero in the north"), ("channel-swap", "gonio.g25 and gonio.g55")]
)
def test_a_lens_errs_where_it_was_seen(arm: Scene, mechanism: str, way: str) -> None:
    """By planes that run the other way round, on the other side; by exchanged sensors, at the other's angle."""
    turned = term(arm, mechanism, way)
    theta = np.zeros(len(turned.parameters))
    light = lit_by(arm, (turned,), theta)
    where = np.column_stack(
        [arm.readings.test, np.round(arm.readings.gamma_deg), np.round(arm.readings.c_deg % 360, 1)]
    )
    place = {tuple(key): k for k, key in enumerate(where.tolist())}
    seen = np.column_stack([where[:, 0], np.round(light.gamma_deg), np.round(light.c_deg % 360.0, 1)])
    there = [place[tuple(key)] for key in seen.tolist()]
    assert there != list(range(len(there)))
    (extra,) = [e for e in form_error(arm, (turned,), theta) if e.of_lens]
    here = np.stack(list(lens_error_of_systems(arm).values()), axis=1)
    assert extra.columns == pytest.approx(here[there], abs=0.05 * float(np.abs(here).max()))
    assert (extra.size(Hyper(1.0, 1.0, 2.0)), extra.size(MIDDLE)) == (2.0, 1.0)


def test_a_small_turn_leaves_a_lens_where_it_is(arm: Scene) -> None:
    assert not any(e.of_lens for e in form_error(arm, (term(arm, "c-offset"),), np.array([5.0])))


@pytest.mark.parametrize("seed", [5, 6, 8])
def test_a_form_that_is_locally_wrong_is_believed_and_keeps_its_size(arm: Scene, seed: int) -> None:
    """An arm turned by 6°; in each direction the turn changes half as much, or half as much again, as it should.

    Taken for exact, the form must call all of that scatter.
    """
    way, true = term(arm, "c-offset"), np.array([6.0])
    r = arm.readings
    base, turned = predict(arm, (), np.zeros(0)), predict(arm, (way,), true)
    directions = len(base) // len(np.unique(r.test))
    off = 1.0 + 0.5 * np.random.default_rng(seed).choice([-1.0, 1.0], directions)[np.arange(len(base)) % directions]
    fitter = Fitter(arm)
    fitter._seen = r.stretched(base + off * (turned - base))
    plain = fitter.fit((way,), np.array([1.0]), MIDDLE)
    fitter.weigh([plain])
    found = Search(fitter, (), ())._allowing_for_form(plain)
    assert found.log_evidence > plain.log_evidence + 200.0
    assert found.hyper.scatter < 0.7 * plain.hyper.scatter
    assert found.theta[0] == pytest.approx(6.0, abs=0.5)


def test_a_change_that_tells_nothing_is_no_reason_for_its_error(arm: Scene) -> None:
    """Scatter where an arm's turn would show, but of no sign: a name that owes all to its error is not given."""
    way = term(arm, "c-offset")
    r = arm.readings
    base, turned = predict(arm, (), np.zeros(0)), predict(arm, (way,), np.array([6.0]))
    either = np.random.default_rng(6).choice([-1.0, 1.0], len(base))
    fitter = Fitter(arm)
    fitter._seen = r.stretched(base + 0.5 * either * (turned - base))
    plain = fitter.fit((way,), np.array([1.0]), MIDDLE)
    fitter.weigh([plain])
    assert Search(fitter, (), ())._allowing_for_form(plain) is plain


def test_the_best_way_of_each_sort_is_allowed_what_its_form_has_wrong(
    arm: Scene, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A clock's ways by the room's clock and by the roof's are two sorts; worse ways of either stay as they are."""
    image = "the image follows the sun"
    fitter = Fitter(arm)
    plain = [
        fitter.fit((term(arm, "clock-offset", label),), np.array([5.0]), MIDDLE)
        for label in (image, f"{image}, by the roof's clock", image)
    ]
    for fit, gain in zip(plain, (30.0, 50.0, 20.0), strict=True):
        fit.theta, fit.log_evidence = np.array([5.0]), gain
    search = Search(fitter, (), ())
    seen = []
    monkeypatch.setattr(search, "_allowing_for_form", lambda fit: seen.append(fit) or fit)
    assert search._allowing_for_forms(plain, 0.0) == plain
    assert [id(f) for f in seen] == [id(plain[0]), id(plain[1])]
    assert search._allowing_for_forms(plain, 60.0) == plain and len(seen) == 2, "what gains too little is not asked"


@pytest.mark.parametrize(("mechanism", "brighter"), [("lens-orientation", 0.3), ("wall-scatter", 0.3)])
def test_what_was_traced_on_a_lens_hardly_unlike_is_wrong_by_less_where_the_lens_decides(
    arm: Scene, mechanism: str, brighter: float
) -> None:
    """By what lobe a wall scatters is told by no lens."""
    sun, sky = np.ones((2, *arm.fields.sun.shape)), np.ones((2, *arm.fields.sky.shape))
    sun[1] += brighter
    share = Parameter("share", "1", "of a change", 0.0, 1.0, 0.2, (1.0,))
    path = Path("traced", share, np.array([0.0, 1.0]), sun, sky)
    plain, alike = (
        Term(BY_ID[mechanism], Branch(value=replace(path, alike=is_alike)), (share,)) for is_alike in (False, True)
    )
    (far, change), (near, _) = _variance(arm, plain, 1.0), _variance(arm, alike, 1.0)
    seen = change > 1e-8
    less = np.median(near[seen] / far[seen])
    shares = form_error_module._shares(arm, plain), form_error_module._shares(arm, alike)
    assert less == pytest.approx(sum(x**2 for x in shares[1]) / sum(x**2 for x in shares[0]), rel=0.1)
    assert less < 0.7 if mechanism == "lens-orientation" else less == pytest.approx(1.0)
    assert traced(plain) and not traced(alike)


@pytest.mark.parametrize(("off", "allowed"), [(0.0, False), (0.5, True)])
def test_a_form_that_is_right_everywhere_is_allowed_no_error_beside_it(arm: Scene, off: float, allowed: bool) -> None:
    """An arm turned by 12°, exactly, and one where each direction changes half as much, or half as much again."""
    way, r = term(arm, "c-offset"), arm.readings
    base, turned = predict(arm, (), np.zeros(0)), predict(arm, (way,), np.array([12.0]))
    directions = len(base) // len(np.unique(r.test))
    sign = np.random.default_rng(5).choice([-1.0, 1.0], directions)[np.arange(len(base)) % directions]
    fitter = Fitter(arm)
    fitter._seen = r.stretched(base + (1.0 + off * sign) * (turned - base))
    fit = fitter.fit((way,), np.array([6.0]), MIDDLE)
    fitter.weigh([fit])
    search = Search(fitter, (), ())
    assert bool(search.allowed(Hypothesis(fit, fit.log_evidence))) == allowed
    if not allowed:
        without_it = search.reweighed(Hypothesis(fit, fit.log_evidence), search.forms_wrong(fit))
        assert without_it < fit.log_evidence - AS_IT_IS
