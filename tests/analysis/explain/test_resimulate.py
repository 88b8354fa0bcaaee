"""Our own re-simulations: what each setting changes, as ratios to themselves."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest

from analysis.explain import again, look, settings, tracing
from analysis.explain.apply import apply_model
from analysis.explain.asked import misfit
from analysis.explain.fields import GAMMA_DEG, Fields, solid_angle
from analysis.explain.fit import Fit
from analysis.explain.form_error import OF_CASE
from analysis.explain.found_lenses import lenses_of, told
from analysis.explain.geometry import blurred
from analysis.explain.hypothesis import Hypothesis
from analysis.explain.look import Likened
from analysis.explain.mechanisms.base import predict
from analysis.explain.mechanisms.catalogue import BY_ID, CATALOGUE
from analysis.explain.mechanisms.goniometer import BROUGHT
from analysis.explain.mechanisms.states import terms_of
from analysis.explain.parameter import Parameter
from analysis.explain.path_making import EVENED, EVENED_DEG
from analysis.explain.ratios import ratio
from analysis.explain.resimulate import OwnSimulation, Retracings, simulator_of
from analysis.explain.retrace import Path
from analysis.explain.scene import Scene, scene_of
from analysis.explain.settings import UNLIMITED
from analysis.explain.tracing import IMAGE_DEG, Tracing
from labdaq.errors import DataError
from tests.analysis.explain.campaign import TESTS, columns, make_case
from tests.analysis.explain.test_apply import model
from tests.analysis.explain.test_mechanisms import term
from tests.analysis.explain.test_shift_lens import SKEWED, system_with

BOX, TUBE = 0, 1
pytestmark = pytest.mark.timeout(300)  # where nothing is compiled yet, that takes most of it


@pytest.fixture(scope="module", autouse=True)
def few_rays() -> Iterator[None]:
    """Few rays and few moments; lens tables that are made in a second."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(tracing, "RAYS", 20_000)
        patch.setattr(tracing, "MORE_RAYS", 20_000)
        patch.setattr(tracing, "SAMPLES", 1_024)
        patch.setattr(look, "SAMPLES", 512)
        patch.setattr(settings, "MINUTES", (-15.0, 15.0))
        yield


@pytest.fixture(scope="module")
def simulated(tmp_path_factory: pytest.TempPathFactory, few_rays: None) -> OwnSimulation:
    """A box and a tube, each under one sky."""
    case = make_case(tmp_path_factory.mktemp("case") / "case", tests=(TESTS[1], TESTS[5]))
    simulator = simulator_of(case)
    assert simulator is not None
    assert simulator.made
    return simulator


@pytest.fixture(scope="module")
def made(simulated: OwnSimulation) -> Retracings:
    """All that was traced."""
    return simulated.made


@pytest.fixture(scope="module")
def scene(simulated: OwnSimulation) -> Scene:
    """The case with its re-simulations."""
    return scene_of(simulated.case, simulated)


@pytest.mark.slow
def test_only_what_is_asked_for_is_traced_and_comes_out_the_same(simulated: OwnSimulation, made: Retracings) -> None:
    """A prediction asks for the mechanisms that were found, and takes the time of those."""
    some = simulator_of(simulated.case, {"soiling", "gamma-offset"})
    assert some is not None
    assert set(some.made.paths) == {"soiling"}
    for mine, whole in zip(some.paths("soiling"), made.paths["soiling"], strict=True):
        assert (mine.label, mine.positions.tolist()) == (whole.label, whole.positions.tolist())
        assert np.array_equal(mine.sun, whole.sun) and np.array_equal(mine.sky, whole.sky)
    assert some.aureole(3.0) is None and some.near_field() is None and some.sky_part() is None
    spread = simulator_of(simulated.case, {"circumsolar-aureole"})
    assert spread is not None and not spread.made.paths
    assert np.array_equal(np.asarray(spread.aureole(3.0)), np.asarray(simulated.aureole(3.0)))


def _path(made: Retracings, mechanism: str, label: str) -> Path:
    (found,) = [p for p in made.paths[mechanism] if p.label == label]
    return found


def test_every_setting_of_a_box_and_a_tube_is_traced(made: Retracings) -> None:
    assert set(made.paths) == {
        "lens-haze",
        "soiling",
        "lens-orientation",
        "lens-anisotropy",
        "wall-scatter",
        "wall-reflectance",
        "bounce-truncation",
        "clock-offset",
    }
    assert all(np.all(np.isfinite(p.sun)) and np.all(np.isfinite(p.sky)) for ps in made.paths.values() for p in ps)


def test_settings_as_described_change_nothing(made: Retracings) -> None:
    for mechanism, label, at in (
        ("lens-orientation", "own re-simulation", 0.0),
        ("wall-scatter", "diffuse share", 0.0),
        ("wall-reflectance", "all systems alike", 0.0),
        ("clock-offset", "own re-simulation", 0.0),
    ):
        path = _path(made, mechanism, label)
        k = int(np.flatnonzero(path.positions == at)[0])
        assert np.allclose(path.sun[k], 1.0, atol=1e-9)
        assert np.allclose(path.sky[k], 1.0, atol=1e-9)


def test_all_walls_alike_is_each_wall_where_it_stands(made: Retracings) -> None:
    together = _path(made, "wall-reflectance", "all systems alike")
    k = int(np.flatnonzero(together.positions == -0.08)[0])
    for system, test in (("box", BOX), ("tube", TUBE)):
        alone = _path(made, "wall-reflectance", system)
        centre = alone.parameter.centre
        m = int(np.argmin(np.abs(alone.positions - (centre - 0.08))))
        assert alone.positions[m] == pytest.approx(centre - 0.08)
        assert np.allclose(together.sun[k][test], alone.sun[m][test])
        assert np.allclose(together.sky[k][test], alone.sky[m][test])
        assert np.allclose(alone.sky[m][1 - test], 1.0), "the other system's wall is as it was"


@pytest.mark.parametrize(
    ("how", "turn_deg"), [(" along the diagonals", 45.0), (" turned by 27°", 27.0), (" turned by 63°", 63.0)]
)
def test_a_pattern_that_lies_otherwise_is_the_pattern_turned(made: Retracings, how: str, turn_deg: float) -> None:
    """What is lost beside it is the same, and so they differ by what such a turn does."""
    plain, across = (
        np.log(_path(made, "lens-anisotropy", f"a pattern{lies}, not its mean").sun[1]) for lies in ("", how)
    )
    turns = _path(made, "lens-orientation", "own re-simulation")
    turned = np.log(turns.sun[int(np.flatnonzero(turns.positions == turn_deg)[0])])
    assert np.std(turned) > 0.05
    assert np.corrcoef((across - plain).ravel(), turned.ravel())[0, 1] > 0.97


def test_dirt_on_a_flat_cover_takes_as_much_of_a_beam_everywhere(simulated: OwnSimulation, made: Retracings) -> None:
    """exp(-depth / sin h), wherever the light goes on to; under a cover that rises another share, as it comes so."""
    flat, rising = (_path(made, "soiling", way) for way in ("dirt on flat covers, traced", "dirt, traced"))
    others = set()
    for name, test in (("box", BOX), ("tube", TUBE)):
        height = np.sin(np.radians(simulated.case.tests[test].sun_altitude_deg))
        for lost, sun, aslant in zip(flat.positions[1:], flat.sun[1:], rising.sun[1:], strict=True):
            wanted = (1.0 - lost) ** (1.0 / height)
            assert np.quantile(sun[test], (0.05, 0.95)) == pytest.approx(wanted, rel=0.01)
            if abs(np.median(aslant[test]) / wanted - 1.0) > 0.005:
                others.add(name)
    assert np.all(flat.sun[0] == 1.0) and np.all(flat.sky[0] == 1.0)
    assert others == {name for name, like in made.systems.items() if like.system.rise_m > 0.0} != set()


def test_what_was_found_on_flat_covers_is_simulated_again_on_them(
    scene: Scene, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(again, "RAYS", 20_000)
    deviates = {}
    for way in ("dirt on flat covers, traced", "dirt, traced"):
        told, loss = (term(scene, "soiling", way),), np.array([1.0 - np.exp(-0.6)])
        found = again.simulated_again(scene, told, loss)
        assert found is not None and found.ids == ("soiling",)
        flat = predict(scene, (term(scene, "soiling", "dirt on flat covers, traced"),), loss)
        deviates[way] = float(np.sqrt(np.mean(np.log(found.predicted / flat) ** 2)))
    assert deviates["dirt on flat covers, traced"] < 0.5 * deviates["dirt, traced"], deviates


def test_haze_that_goes_on_forwards_is_simulated_again(
    simulated: OwnSimulation, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of lenses that are densities of shifts."""
    monkeypatch.setattr(again, "RAYS", 20_000)
    dense = lenses_of(told({kind: Likened(system_with(kind, SKEWED)) for kind in ("box", "tube")}))
    scene = scene_of(simulated.case, simulator_of(simulated.case, {"lens-haze"}, dense))
    for way in ("scattered forwards, traced", "scattered more widely, traced"):
        hazy, share = (term(scene, "lens-haze", way),), np.array([0.15])
        found = again.simulated_again(scene, hazy, share)
        assert found is not None and found.ids == ("lens-haze",)
        fitted, simulated = (
            np.log(x / scene.readings.simulated) for x in (predict(scene, hazy, share), found.predicted)
        )
        assert np.std(fitted) > 0.05
        assert np.std(simulated - fitted) < 0.4 * np.std(fitted)


def test_a_stretched_lens_is_simulated_again(simulated: OwnSimulation, monkeypatch: pytest.MonkeyPatch) -> None:
    """As far as it was found to be, and along the same axis."""
    monkeypatch.setattr(again, "RAYS", 20_000)
    dense = lenses_of(told({kind: Likened(system_with(kind, SKEWED)) for kind in ("box", "tube")}))
    scene = scene_of(simulated.case, simulator_of(simulated.case, {"lens-anisotropy"}, dense))
    by = np.array([0.3])
    long, aslant = ((term(scene, "lens-anisotropy", f"stretched along {axis}°"),) for axis in ("0.0", "45.0"))
    found = again.simulated_again(scene, long, by)
    assert found is not None and found.ids == ("lens-anisotropy",)
    light = (found.predicted, predict(scene, long, by), predict(scene, aslant, by))
    stretched, fitted, other = (np.log(x / scene.readings.simulated) for x in light)
    assert np.std(stretched) == pytest.approx(np.std(fitted), rel=0.3)
    assert np.corrcoef(stretched, fitted)[0, 1] > 0.9
    assert np.corrcoef(stretched, other)[0, 1] < 0.6


def test_of_light_that_is_spread_a_share_is_mixed_with_the_rest(made: Retracings) -> None:
    """A share of 1 is what walls do that spread all of it."""
    some, wide = (_path(made, "wall-scatter", label) for label in ("some light spread", "wide reflections"))
    assert some.positions.tolist() == [0.0, 1.0] and wide.positions[-1] == 15.0
    assert np.array_equal(some.sun[1], wide.sun[-1]) and np.array_equal(some.sky[1], wide.sky[-1])
    base = Fields(np.ones_like(some.sun[0]), np.ones_like(some.sky[0]))
    sun, _ = some.change(0.2, base)
    assert np.allclose(sun, 0.8 + 0.2 * wide.sun[-1])


def test_darker_walls_take_light(made: Retracings) -> None:
    path = _path(made, "wall-reflectance", "all systems alike")
    flux = path.sky.mean(axis=(2, 3))  # (settings, tests)
    assert np.all(np.diff(flux, axis=0) > 0.0)


def test_what_a_bounce_limit_cuts_grows_less_with_the_limit(made: Retracings) -> None:
    path = _path(made, "bounce-truncation", "own re-simulation")
    assert path.added
    lost = path.sky.sum(axis=(2, 3))  # (limits, tests) [cd]
    assert np.all(np.diff(lost, axis=0) <= 1e-6 * lost[0])
    assert path.positions[-1] == UNLIMITED
    assert np.all(lost[-1] == 0.0)
    assert np.all(lost[0] > 0.0)


def test_a_limit_as_a_ratio_brings_back_as_much_as_it_cut(simulated: OwnSimulation, made: Retracings) -> None:
    lacking = _path(made, "bounce-truncation", "own re-simulation")
    systems = {n: like.system for n, like in made.systems.items()}
    traced = Tracing(simulated.case, systems, spread_deg={n: like.spread_deg for n, like in made.systems.items()})
    lit = {n: traced.as_predicted(run.baseline) for n, run in traced.precise.items()}
    whole = traced.wide(traced.spread(lit), 0.0)[1]
    for label in ("ratio to what was left", f"ratio to what was left{EVENED}"):
        path = _path(made, "bounce-truncation", label)
        assert path.positions[-1] == UNLIMITED
        assert np.all(path.sky[-1] == 1.0)
        k = int(np.flatnonzero(path.positions == 4.0)[0])
        again = (whole - lacking.sky[k]) * path.sky[k]
        share = np.sum(again * solid_angle(), axis=(1, 2)) / np.sum(whole * solid_angle(), axis=(1, 2))
        assert np.allclose(share, 1.0, atol=0.03)
        assert np.all(path.sky[k].mean(axis=(1, 2)) > 1.01)


def test_of_a_sum_the_sky_takes_its_share(simulated: OwnSimulation, scene: Scene) -> None:
    told, given = simulated.made.sky_part, scene.fields
    for test in (BOX, TUBE):
        share, wanted = (np.sum(sky[test] * solid_angle()) for sky in (told, given.sky))
        # the case's numbers are a formula of no lens and no well that can be traced: only the size can be right
        assert share == pytest.approx(wanted, rel=0.4)


def test_a_sum_of_our_own_comes_apart(simulated: OwnSimulation) -> None:
    traced = Tracing(simulated.case, simulated.systems)
    parts = {name: traced.as_predicted(traced.plain(name, 2_000).baseline) for name in traced.days}
    sun, sky = traced.spread(parts)
    assert traced.sky_part(1.2 * (sun + sky), 2_000) == pytest.approx(1.2 * sky)


def test_a_pattern_as_square_as_a_pyramid_is_itself_after_a_quarter_turn(made: Retracings) -> None:
    path = _path(made, "lens-orientation", "own re-simulation")
    assert path.positions[-1] == 90.0
    assert np.all(path.sun[-1] == 1.0)
    assert np.std(path.sun[len(path.positions) // 2]) > 0.01, "half way the images lie elsewhere"


def test_a_black_wall_is_left_as_it_is(simulated: OwnSimulation) -> None:
    """No bounce tells what it would reflect; those of the other systems are told."""
    systems = dict(simulated.systems)
    systems["box"] = systems["box"].with_settings({"wall.reflectance": 0.0})
    labels = {path.label for path in settings.paths_of(Tracing(simulated.case, systems))["wall-reflectance"]}
    assert {label for label in labels if EVENED not in label} == {"tube"}


# ratios


@pytest.mark.parametrize("width", [*EVENED_DEG, IMAGE_DEG])
def test_a_factor_is_a_factor_however_much_is_evened_out(simulated: OwnSimulation, scene: Scene, width: float) -> None:
    traced = Tracing(simulated.case, simulated.systems)
    sun, sky = scene.fields.sun, scene.fields.sky
    traced.__dict__["base"] = sun, sky
    made = traced.over_base((0.8 * sun, 1.1 * sky), width)
    assert made[0] == pytest.approx(0.8, rel=1e-6)
    assert made[1] == pytest.approx(1.1, rel=1e-6)


def test_an_image_that_moved_shows_less_the_more_is_evened_out(simulated: OwnSimulation, scene: Scene) -> None:
    traced = Tracing(simulated.case, simulated.systems)
    traced.__dict__["base"] = scene.fields.sun, scene.fields.sky
    moved = np.roll(scene.fields.sun, 1, axis=1), scene.fields.sky
    sizes = [float(np.std(np.log(traced.over_base(moved, width)[0]))) for width in (2.0, *EVENED_DEG)]
    assert sizes[0] > sizes[1] > sizes[2] > 0.0


def test_each_path_is_there_evened_out_too(made: Retracings) -> None:
    for mechanism in ("lens-haze", "lens-orientation", "wall-reflectance", "clock-offset"):
        labels = {path.label for path in made.paths[mechanism]}
        sharp = {label for label in labels if EVENED not in label}
        assert {label.replace(EVENED, "") for label in labels - sharp} == sharp


def test_where_it_is_dark_beside_a_peak_a_ratio_stays_what_it_is() -> None:
    old = np.full((1, 72, len(GAMMA_DEG)), 100.0) * np.cos(np.radians(GAMMA_DEG - 0.1))
    old[0, 10:12, 8:10] = 1e5  # a sharp image of the sun
    assert ratio(0.8 * old, old) == pytest.approx(0.8, rel=1e-6)


def test_a_direction_without_rays_changes_as_its_gamma_does() -> None:
    old = np.full((1, 72, len(GAMMA_DEG)), 100.0)
    new = old * np.linspace(1.0, 0.5, len(GAMMA_DEG))
    expected = new[0, 20] / old[0, 20]
    old[0, 3], new[0, 3] = 0.0, 0.5  # a few rays of one run alone
    drawn = ratio(new, old)[0, 3, :]
    assert np.all((drawn > expected) & (drawn < expected + 0.15)), "half a per cent of its gamma adds a tenth"
    old[0, 3], new[0, 3] = 0.0, 0.0
    assert ratio(new, old)[0, 3, :] == pytest.approx(expected, rel=0.04)


# what mechanisms make of them


def test_each_system_is_blurred_as_its_own_lens_spreads_light(simulated: OwnSimulation, scene: Scene) -> None:
    traced = Tracing(simulated.case, simulated.systems, spread_deg={"box": 9.0})
    sun, sky = traced.wide((scene.fields.sun, scene.fields.sky), 4.5)
    for name, width in (("box", float(np.hypot(9.0, 4.5))), ("tube", 4.5)):
        rows = [k for k, _ in traced.days[name]]
        assert sun[rows] == pytest.approx(blurred(scene.fields.sun[rows], width))
        assert sky[rows] == pytest.approx(blurred(scene.fields.sky[rows], width))
    plain = traced.wide((scene.fields.sun, scene.fields.sky), 0.0)[0]
    rows = [k for k, _ in traced.days["tube"]]
    assert plain[rows] == pytest.approx(scene.fields.sun[rows])


def test_haze_on_the_cover_is_no_formula_where_it_can_be_traced(scene: Scene) -> None:
    """Light that goes on like the sky's is also what an aureole makes, or a wall that scatters."""
    (found,) = (m for m in CATALOGUE if m.id == "lens-haze")
    labels = {b.label for b in found.branches(scene)}
    assert "entry lens, traced" in labels and "entry lens" not in labels
    assert "entry lens" in {b.label for b in found.branches(replace(scene, retraced=None))}


def test_images_spread_are_no_aureole_where_the_lens_can_be_traced_under_one(scene: Scene) -> None:
    """They are also what a lens makes that scatters more than the one simulated."""
    (aureole,) = (m for m in CATALOGUE if m.id == "circumsolar-aureole")
    assert [b.label for b in aureole.branches(scene)] == ["simulated again", "halfway to images spread"]
    assert [b.label for b in aureole.branches(replace(scene, retraced=None))] == ["images spread"]


def test_an_aureole_as_narrow_as_the_disc_changes_nothing(scene: Scene, simulated: OwnSimulation) -> None:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(simulated, "aureole", lambda width_deg: np.ones_like(scene.fields.sun))
        made = predict(scene, (term(scene, "circumsolar-aureole", "simulated again"),), np.array([0.6, 5.0]))
    assert made == pytest.approx(scene.readings.simulated, rel=1e-9)


def test_an_aureole_is_a_share_of_the_suns_light_spread_as_it_was_traced(scene: Scene, made: Retracings) -> None:
    light = scene.dark_light()
    width = tracing.AUREOLES_DEG[0]
    term(scene, "circumsolar-aureole", "simulated again").illuminate(scene, light, np.array([0.6, width]))
    assert light.sun == pytest.approx(scene.fields.sun * (0.4 + 0.6 * made.aureoles[1]))
    assert light.sky is scene.fields.sky


def test_a_near_field_halfway_is_the_mean_of_both_ways(scene: Scene) -> None:
    lights = {}
    for way in ("closed form", "traced", "halfway"):
        lights[way] = scene.dark_light()
        term(scene, "near-field", way).illuminate(scene, lights[way], np.array([1.0]))
    for part in ("sun", "sky"):
        ends = [getattr(lights[way], part) for way in ("closed form", "traced")]
        assert np.max(np.abs(ends[0] - ends[1])) > 0.0
        assert getattr(lights["halfway"], part) == pytest.approx((ends[0] + ends[1]) / 2.0)


def test_a_near_field_that_the_case_brings_is_its_own(scene: Scene) -> None:
    """The form is the prediction's own then, needs no other beside it, and leaves less for others."""
    ways = {t.branch.label: t for t in terms_of(BY_ID["near-field"], scene)}
    assert not any(t.branch.of_case for t in ways.values())
    assert scene.retraced is not None
    weight = Parameter("weight", "1", "share", 0.0, 1.0, 1.0, (1.0,))
    path = Path("near", weight, np.array([0.0, 1.0]), *np.ones((2, 2, *scene.fields.sun.shape)), of_case=True)
    brought = replace(scene, retraced=replace(scene.retraced, case_paths={"near-field": (path,)}))
    (own,) = terms_of(BY_ID["near-field"], brought)
    assert own.branch.label == BROUGHT and own.branch.of_case and not own.branch.blurs
    nothing = Hypothesis(Fit((), *np.zeros((3, 0))), 0.0)
    left = [misfit(Hypothesis(Fit((t,), *np.zeros((3, 0))), 100.0), nothing) for t in (own, ways["closed form"])]
    assert left[0] == pytest.approx(OF_CASE**2 * 100.0) and left[1] > left[0]


def test_a_near_field_beyond_six_apertures_is_hardly_more_than_a_blur(scene: Scene) -> None:
    case = scene.readings.case
    assert case.setup.goniometer is not None
    for distance, blurs in ((2.6, False), (4.5, True)):  # the largest opening is 0.61 m wide
        arm = case.setup.goniometer.model_copy(update={"distance_m": distance})
        setup = case.setup.model_copy(update={"goniometer": arm})
        far = replace(scene, readings=replace(scene.readings, case=replace(case, setup=setup)))
        assert {t.branch.blurs for t in terms_of(BY_ID["near-field"], far)} == {blurs}


@pytest.mark.parametrize("only", [(), ("tube",)])
def test_a_limit_that_a_variant_showed_is_simulated_where_the_case_has_none(
    simulated: OwnSimulation, only: tuple[str, ...]
) -> None:
    """Three bounces were simulated, as this case states as well; what a case does not state cannot be applied."""
    setup = simulated.case.setup
    stated = setup.simulation.model_copy(update={"max_bounces": 3})
    case = replace(simulated.case, setup=setup.model_copy(update={"simulation": stated}))
    shown = model("bounce-truncation", "case's variant max_bounces = 60", ["weight"], [0.9], only)
    own = model("bounce-truncation", f"own re-simulation{', tube only' if only else ''}", ["max_bounces"], [3.0], only)
    found, expected = (columns(apply_model(what, case, simulated), "corrected")[0] for what in (shown, own))
    assert found == pytest.approx(expected)
    assert np.max(found / case.records.simulated) > 1.1
    with pytest.raises(DataError, match="has no such way"):
        apply_model(shown, simulated.case, simulated)
    like = model("bounce-truncation", "case's variant max_bounces = 60", ["weight"], [0.9], only, like_max_bounces=3.0)
    assert columns(apply_model(like, simulated.case, simulated), "corrected")[0] == pytest.approx(expected)


@pytest.mark.parametrize("limit", [2.0, 4.0, 8.0])
def test_a_variant_tells_by_which_limit_as_much_would_be_missing(scene: Scene, made: Retracings, limit: float) -> None:
    """A tenth of it elsewhere than ours has it, and where the prediction's limit is not told."""
    own, fields = _path(made, "bounce-truncation", "own re-simulation"), scene.fields
    k = int(np.flatnonzero(own.positions == limit)[0])
    one, weight = np.ones_like(fields.sun), Parameter("weight", "1", "", 0.0, 1.5, 0.2, (1.0,), centre=1.0)
    sun, sky = (
        1.0 + (0.9 * lost + 0.1 * lost.mean()) / np.maximum(light, 1e-9)
        for lost, light in ((own.sun[k], fields.sun), (own.sky[k], fields.sky))
    )
    shown = Path(
        "case's variant max_bounces = 60",
        weight,
        np.array([0.0, 1.0]),
        np.stack([one, sun]),
        np.stack([one, sky]),
        of_case=True,
    )
    assert scene.retraced is not None
    brought = replace(scene, retraced=replace(scene.retraced, case_paths={"bounce-truncation": (shown,)}))
    (way,) = [t for t in terms_of(BY_ID["bounce-truncation"], brought) if t.branch.of_case]
    assert way.branch.facts == {"like_max_bounces": limit}
    assert all(not t.branch.facts for t in terms_of(BY_ID["bounce-truncation"], scene))


def test_a_share_that_walls_scatter_is_one_by_the_variant_s_name_too(simulated: OwnSimulation) -> None:
    shown = model(
        "wall-scatter", "case's variants of scattered_share, tube only", ["scattered_share"], [0.1], ("tube",)
    )
    own = model("wall-scatter", "diffuse share, tube only", ["scatter"], [0.1], ("tube",))
    found, expected = (columns(apply_model(what, simulated.case, simulated), "corrected")[0] for what in (shown, own))
    assert found == pytest.approx(expected)
    assert np.max(np.abs(found / simulated.case.records.simulated - 1.0)) > 0.02


@pytest.mark.parametrize("table", [None, {"distance_m": None}])
def test_an_arm_of_unknown_length_is_explained_as_far_as_that_goes(scene: Scene, table: dict[str, None] | None) -> None:
    """Its systems are simulated again at the usual distance; lux and the room's reflectances are as uncertain."""
    case = scene.readings.case
    assert case.setup.goniometer is not None
    arm = None if table is None else case.setup.goniometer.model_copy(update=table)
    unknown = replace(case, setup=case.setup.model_copy(update={"goniometer": arm}))
    seen = replace(scene, readings=replace(scene.readings, case=unknown))
    assert simulator_of(unknown) is not None
    assert seen.distance_m is None
    stray, room = BY_ID["stray-light"], BY_ID["room-interreflection"]
    (way, *_), (supposed,), (told,) = terms_of(stray, seen), terms_of(room, seen), terms_of(room, scene)
    assert stray.size_error_in(seen, way.branch) == 0.5 > stray.size_error_in(scene, way.branch)
    assert room.size_error_in(seen, supposed.branch) == 0.5 > room.size_error_in(scene, told.branch)
    fields = seen.dark_light()
    assert np.all(np.isfinite(predict(seen, (way,), np.array([2.0])))) and np.any(fields.sun > 0.0)


def test_a_near_field_is_traced_in_one_system_alone_too(scene: Scene) -> None:
    """There as traced, in the others in closed form."""
    names = [t.system for t in scene.readings.case.tests]
    ways = {t.branch.label: t for t in terms_of(BY_ID["near-field"], scene)}
    assert set(ways) == {
        "closed form",
        *(w + o for w in ("traced", "halfway") for o in ("", ", box only", ", tube only")),
    }
    lights = {way: scene.dark_light() for way in ("closed form", "traced", "traced, box only")}
    for way, light in lights.items():
        ways[way].mechanism.illuminate(scene, light, np.array([1.0]), ways[way].branch)
    for k, name in enumerate(names):
        like = "traced" if name == "box" else "closed form"
        assert lights["traced, box only"].sun[k] == pytest.approx(lights[like].sun[k])
        assert np.max(np.abs(lights["traced"].sun[k] - lights["closed form"].sun[k])) > 0.0


def test_walls_that_scatter_halfway_are_the_mean_of_the_traced_and_of_light_from_the_sky(
    scene: Scene, made: Retracings
) -> None:
    traced = next(p for p in made.paths["wall-scatter"] if p.parameter.name == "scatter")
    lights = {}
    for way in (traced.label, f"halfway to light from the sky: {traced.label}"):
        lights[way] = scene.dark_light()
        term(scene, "wall-scatter", way).illuminate(scene, lights[way], np.array([0.1]))
    stand_in = {w: term(scene, "wall-scatter", w).branch.stands_in for w in lights}
    assert list(stand_in.values()) == [False, True], "light that goes on as the sky's does counts for less"
    before, (again, halfway) = scene.fields.sun, (light.sun for light in lights.values())
    simple = 2.0 * halfway - again  # the other end of the mean
    per_lux = scene.beam_lx / scene.readings.diffuse_lx
    smooth = 0.9 * before + 0.1 * per_lux[:, None, None] * scene.fields.sky
    seen = (before > 0.0) & (smooth < 5.0 * before) & np.any(again != before, axis=(1, 2), keepdims=True)
    assert np.any(seen)
    assert simple[seen] == pytest.approx(smooth[seen])


@pytest.mark.parametrize(
    ("mechanism", "label", "at"),
    [("wall-reflectance", "tube", 0.9), ("wall-scatter", "diffuse share", 0.15), ("clock-offset", "", 15.0)],
)
def test_a_mechanism_does_what_was_traced(
    scene: Scene, made: Retracings, mechanism: str, label: str, at: float
) -> None:
    path = made.paths[mechanism][0] if not label else _path(made, mechanism, label)
    sun, sky = path.change(at, scene.fields)
    light = scene.dark_light()
    term(scene, mechanism, label).illuminate(scene, light, np.array([at]))
    assert light.sun == pytest.approx(sun)
    if mechanism != "clock-offset":  # the sky's light is as it was measured
        assert light.sky == pytest.approx(sky)


def test_one_clock_moves_all_suns(scene: Scene, made: Retracings, monkeypatch: pytest.MonkeyPatch) -> None:
    assert not any("only" in p.label for p in made.paths["clock-offset"])
    assert any("only" in p.label for p in made.paths["lens-haze"])
    together = _path(made, "clock-offset", "own re-simulation")
    assert all(np.std(together.sun[-1][test]) > 0.01 for test in (BOX, TUBE))
    monkeypatch.setattr(again, "RAYS", 2_000)
    told = term(scene, "clock-offset", "")
    found = again.simulated_again(scene, (told,), np.array([15.0]))
    assert found is not None
    change = found.predicted / scene.readings.simulated
    assert all(np.std(change[scene.readings.test == test]) > 0.01 for test in (BOX, TUBE))
    by_the_roof = again.simulated_again(scene, (term(scene, "clock-offset", "by the roof's clock"),), np.array([15.0]))
    assert by_the_roof is not None
    assert not np.allclose(by_the_roof.predicted, found.predicted, rtol=0.01), "illuminances are of another sun"
