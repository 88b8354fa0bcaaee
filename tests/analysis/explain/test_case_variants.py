"""The case's own variants: the same simulation run again with one thing changed."""

from collections.abc import Callable, Collection
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from analysis.cases import Case
from analysis.explain import asked
from analysis.explain.apply import Model, apply_model
from analysis.explain.fit import MIDDLE, Fit, Fitter
from analysis.explain.hypothesis import Hypothesis
from analysis.explain.mechanisms.base import predict
from analysis.explain.mechanisms.catalogue import BY_ID
from analysis.explain.mechanisms.states import terms_of
from analysis.explain.readings import Readings
from analysis.explain.retrace import Simulator
from analysis.explain.scene import Scene
from analysis.explain.search import Search
from analysis.explain.thresholds import MISFIT_LIKE_A_LENS, MOST_MISFIT
from analysis.explain.variants import retraced_of
from analysis.photometry import Distribution
from analysis.photometry.lm63 import FileGeneration, render_lm63
from tests.analysis.explain import effects
from tests.analysis.explain.campaign import NONE, TESTS, Floats, Sky, columns, light, make_case, rows_of, sun_part
from tests.analysis.explain.test_mechanisms import term

ROWS = rows_of(TESTS)
BASE = light(ROWS)
GAMMA, C = np.arange(0.0, 90.1, 2.5), np.arange(0.0, 360.1, 5.0)
TURNED = "case's variants of rotation_deg, counter-clockwise"
AUREOLE = "case's variants of fraction, width_deg = 5"

Run = Callable[[Sky, Floats, Floats], Floats]
"""The sun part [cd] of a test as a variant has it, at gammas (1, G) and planes (P, 1) [deg]."""


def varied(
    folder: Path,
    *variants: tuple[str, dict[str, Any], Run, str],
    tests: tuple[Sky, ...] = TESTS,
    left: Collection[str] = (),
    simulator: Simulator | None = None,
    **change: Any,
) -> Scene:
    """A scene whose case brings variants: mechanism, setting, sun part, and the system that was run ("" for all).

    Tests that are ``left`` were run for none.
    """
    files, tables = {}, []
    for n, (mechanism, setting, run, system) in enumerate(variants):
        table: dict[str, Any] = {"mechanism": mechanism, "setting": setting, "simulated": {}}
        for t in tests:
            if system in ("", t.system) and t.id not in left:
                candela = run(t, GAMMA[None, :], C[:, None])
                candela[-1] = candela[0]
                keywords = {"TEST": "x", "TESTLAB": "x", "ISSUEDATE": "x", "MANUFAC": "x"}
                name = f"simulated/{n}-{t.id}.ies"
                made = Distribution(GAMMA, C, candela, keywords)
                files[name] = render_lm63(made, generation=FileGeneration.SIMULATED)
                table["simulated"][t.id] = {"sun": name, "sky": f"simulated/{t.id}-sky.ies"}
        tables.append(table)
    case = make_case(folder, flaws=NONE, tests=tests, change={"variant": tables, **change}, more=files)
    return Scene(Readings.of(case), retraced_of(case, simulator))


def times(factor: float) -> Run:
    """The sun part brighter or darker by a factor: not what any setting does, but easily known again."""
    return lambda t, gamma, c: factor * sun_part(t, gamma, c)


def turned(t: Sky, gamma: Floats, c: Floats) -> Floats:
    return sun_part(t, gamma, c - 20.0)


def wider(t: Sky, gamma: Floats, c: Floats) -> Floats:
    """A third of the beam from all about: its image fainter by a third, and as much again over the whole sphere."""
    image = sun_part(t, gamma, c)
    return np.asarray(image * 2.0 / 3.0 + 0.02 * image.max())


def turned_by_20(folder: Path) -> Scene:
    return varied(folder, ("lens-orientation", {"rotation_deg": 20.0}, turned, ""))


def sun(scene: Scene) -> Floats:
    """The sun part of each reading that the prediction has, (N,) [cd]."""
    return scene.readings.sun


def of_system(scene: Scene, name: str) -> Any:
    return np.array([scene.readings.case.tests[k].system == name for k in scene.readings.test])


def test_a_variant_of_the_case_is_reached_in_full(tmp_path: Path) -> None:
    """Half way along the case's own re-simulation lies half of its change; at its end, the variant itself."""
    scene = turned_by_20(tmp_path / "case")
    way = (term(scene, "lens-orientation", TURNED),)
    made = predict(scene, way, np.array([20.0]))
    exact = effects.part(ROWS, sun_part, ROWS.gamma_deg, ROWS.c_deg - 20.0) + effects._sky(ROWS)
    # between planes of 5° both images are read linearly (1 %); a ratio is limited where the image was 50 times weaker
    within = effects._sun(ROWS) > 0.02 * effects.part(ROWS, sun_part, ROWS.gamma_deg, ROWS.c_deg - 20.0)
    assert np.max(np.abs(made / exact - 1.0)[within]) < 0.02
    half = predict(scene, way, np.array([10.0]))
    assert half == pytest.approx((made + BASE) / 2.0, rel=1e-9)


@pytest.mark.parametrize(("variant", "least"), [(20.0, 4.0), (-10.0, -2.0), (90.0, 63.0)])
def test_half_a_small_turn_is_a_mixture_and_half_a_large_one_is_none(
    tmp_path: Path, variant: float, least: float
) -> None:
    """A mixture leaves more for others, as a form that is not quite right; the variant itself is the case's own."""
    scene = varied(tmp_path / "case", ("lens-orientation", {"rotation_deg": variant}, turned, ""))
    (way,) = (
        w for w in terms_of(BY_ID["lens-orientation"], scene) if w.branch.of_case and "only" not in w.branch.label
    )
    (turn,) = way.parameters
    assert (turn.low if variant > 0.0 else turn.high) == pytest.approx(least)
    nothing = Hypothesis(Fit((), np.zeros(0), np.zeros(0), np.zeros((0, 0))), 0.0)
    left = []
    for share in (0.5, 0.9, 1.0, 1.2):
        fit = Fit((way,), np.array([share * variant]), np.zeros(0), np.zeros((0, 1)))
        left.append(asked.misfit(Hypothesis(fit, 300.0), nothing))
    assert left[2] == left[3] <= MOST_MISFIT
    share = 0.0 if abs(variant) == 90.0 else MISFIT_LIKE_A_LENS
    assert left[:2] == pytest.approx([max(share * 300.0, left[2]), max(0.36 * share * 300.0, left[2])])


def test_small_turns_and_large_ones_are_paths_of_their_own(tmp_path: Path) -> None:
    """Between 20° and 90° lies no mixture of the two."""
    turns = [("lens-orientation", {"rotation_deg": turn}, turned, "") for turn in (20.0, 90.0, -30.0)]
    paths = varied(tmp_path / "case", *turns).retraced
    assert paths is not None
    reach = {path.label: (path.parameter.low, path.parameter.high) for path in paths.case_paths["lens-orientation"]}
    assert {label: at for label, at in reach.items() if "only" not in label} == {
        f"{TURNED}, by little": pytest.approx((4.0, 26.0)),  # of smaller ones to 2.2 times as far
        TURNED: pytest.approx((63.0, 117.0)),
        TURNED.replace("counter-", ""): pytest.approx((-39.0, -21.0)),
    }


def test_what_the_case_brings_is_applied_without_a_simulation(tmp_path: Path) -> None:
    class Busy:
        def __getattr__(self, name: str) -> Any:
            raise AssertionError(f"{name} was asked for")

    scene = turned_by_20(tmp_path / "case")
    case: Case = scene.readings.case
    entry = {"id": "lens-orientation", "way": TURNED, "names": ["rotation_deg"], "theta": [20.0], "sd": [1.0]}
    busy: Any = Busy()
    text = apply_model(Model((entry | {"facts": {}},)), case, busy)
    made = predict(scene, (term(scene, "lens-orientation", TURNED),), np.array([20.0]))
    assert columns(text, "corrected")[0] == pytest.approx(made, rel=1e-6)


def test_a_pattern_may_lie_turned_in_one_system_alone(tmp_path: Path) -> None:
    scene = turned_by_20(tmp_path / "case")
    box = of_system(scene, "box")
    whole, alone = (
        predict(scene, (term(scene, "lens-orientation", TURNED + note),), np.array([20.0]))
        for note in ("", ", box only")
    )
    assert alone[box] == pytest.approx(whole[box], rel=1e-12)
    assert alone[~box] == pytest.approx(BASE[~box], rel=1e-9)


def test_an_aureole_is_the_cases_own_variant_at_its_width(tmp_path: Path) -> None:
    """A third of the beam from 5° about makes the variant itself; two thirds, twice its change."""
    scene = varied(tmp_path / "case", ("circumsolar-aureole", {"fraction": 1 / 3, "width_deg": 5.0}, wider, ""))
    ways = [t.branch.label for t in terms_of(BY_ID["circumsolar-aureole"], scene)]
    assert ways == [f"{AUREOLE}", "images spread"]
    way = (term(scene, "circumsolar-aureole", AUREOLE),)
    change = predict(scene, way, np.array([1 / 3, 5.0])) - BASE
    # the images' tops lie between the nodes of the grid; where the image was next to nothing, a ratio is limited
    exact = np.array([0.02 * wider_top(t) for t in TESTS])[ROWS.test] - sun(scene) / 3.0
    within = sun(scene) > 0.02 * np.array([wider_top(t) for t in TESTS])[ROWS.test]
    assert change[within] == pytest.approx(exact[within], abs=0.02 * float(np.abs(exact).max()))
    assert predict(scene, way, np.array([2 / 3, 5.0])) - BASE == pytest.approx(2.0 * change, rel=1e-6, abs=1e-6)


def wider_top(t: Sky) -> float:
    return float(sun_part(t, GAMMA[None, :], C[:, None]).max())


def test_an_aureole_wider_than_the_variants_is_spread_farther(tmp_path: Path) -> None:
    scene = varied(tmp_path / "case", ("circumsolar-aureole", {"fraction": 1 / 3, "width_deg": 5.0}, wider, ""))
    way = (term(scene, "circumsolar-aureole", AUREOLE),)
    narrow, as_run, wide = (predict(scene, way, np.array([0.5, w])) for w in (3.0, 5.0, 9.0))
    brightest = int(np.argmax(sun(scene)))
    assert narrow[brightest] > as_run[brightest] > wide[brightest]


WALLS = ("wall-reflectance", {"wall_reflectance": 0.9}, times(0.8), "box")
TUBES = ("wall-reflectance", {"wall_reflectance": 0.93}, times(0.7), "tube")


def described(box: float, tube: float) -> list[dict[str, Any]]:
    """Both systems, with what the simulation took for their walls."""
    table = [("box", "box", box), ("tube", "tube", tube)]
    return [{"id": name, "kind": kind, "wall_reflectance": r} for name, kind, r in table]


def test_each_systems_walls_are_told_from_what_was_simulated_for_it(tmp_path: Path) -> None:
    """Not as a share of a change: of walls that were simulated at .95 and run again at .90, .93 lies between."""
    scene = varied(tmp_path / "case", WALLS, TUBES, system=described(0.95, 0.98))
    ways = {t.branch.label: t for t in terms_of(BY_ID["wall-reflectance"], scene)}
    of_box = ways["case's variants of wall_reflectance, box only"]
    assert of_box.parameters[0].name == "wall_reflectance"
    assert of_box.parameters[0].centre == 0.95
    made, box = predict(scene, (of_box,), np.array([0.9])), of_system(scene, "box")
    # the reader's files have fewer digits than a float
    assert made[box] == pytest.approx((BASE - 0.2 * sun(scene))[box], rel=1e-3)
    assert made[~box] == pytest.approx(BASE[~box], rel=1e-9)
    assert predict(scene, (of_box,), np.array([0.95])) == pytest.approx(BASE, rel=1e-9)


@pytest.mark.parametrize("share", [0.4, 1.0])
def test_a_share_of_a_variant_of_unlike_walls_is_a_reflectance_where_one_has_tests(
    tmp_path: Path, share: float
) -> None:
    """Both wells run again at .90; tests of the tube alone, whose wall was simulated at .98, know that as a setting."""
    darker = ("wall-reflectance", {"wall_reflectance": 0.90}, times(0.7), "")
    both = varied(tmp_path / "both", darker, system=described(0.95, 0.98))
    shared = term(both, "wall-reflectance", "case's variant wall_reflectance = 0.9")
    made = predict(both, (shared,), np.array([share]))[of_system(both, "tube")]
    entry = {"id": "wall-reflectance", "way": shared.branch.label, "names": ["weight"], "theta": [share], "sd": [0.1]}
    tube = tuple(t for t in TESTS if t.system == "tube")
    alone = varied(tmp_path / "tube", darker, tests=tube, system=described(0.95, 0.98))
    text = apply_model(Model((entry | {"facts": {}},)), alone.readings.case)
    # the reflectance goes by powers, the share by parts
    assert columns(text, "corrected")[0] == pytest.approx(made, rel=1e-6 if share == 1.0 else 0.02)
    assert np.min(made / BASE[of_system(both, "tube")]) < 1.0 - 0.25 * share


def test_walls_of_all_systems_may_be_off_alike(tmp_path: Path) -> None:
    scene = varied(tmp_path / "case", WALLS, TUBES, system=described(0.95, 0.98))
    alike = term(scene, "wall-reflectance", "case's variants of all walls")
    made, box = predict(scene, (alike,), np.array([-0.05])), of_system(scene, "box")
    assert made == pytest.approx(BASE - np.where(box, 0.2, 0.3) * sun(scene), rel=1e-3)


def test_what_was_run_for_each_system_apart_is_also_one_run(tmp_path: Path) -> None:
    haze = [("lens-haze", {"haze": 0.2}, times(f), system) for f, system in ((0.8, "box"), (0.7, "tube"))]
    scene = varied(tmp_path / "case", *haze)
    box = of_system(scene, "box")
    label = "case's variants of haze"
    whole, *alone = (
        predict(scene, (term(scene, "lens-haze", label + note),), np.array([0.2])) - BASE
        for note in ("", ", box only", ", tube only")
    )
    assert whole == pytest.approx(-np.where(box, 0.2, 0.3) * sun(scene), rel=1e-3)
    assert whole == pytest.approx(sum(alone), rel=1e-9, abs=1e-6)


@pytest.mark.parametrize(
    ("mechanism", "setting", "most"),
    [
        ("lens-orientation", {"mirrored": True}, 1.5),
        ("lens-anisotropy", {"isotropic": False}, 1.5),
        ("soiling", {"depth": 0.1, "scattered": 0.5}, 4.0),
        ("wall-reflectance", {"wall_reflectance": 0.9}, 4.0),  # of walls that were simulated with different ones
    ],
)
def test_of_what_has_no_scale_a_share_is_told(
    tmp_path: Path, mechanism: str, setting: dict[str, Any], most: float
) -> None:
    """About the whole of what is there or is not; any amount of what may be stronger than it was run."""
    run = (mechanism, setting, times(0.9), "")
    scene = varied(tmp_path / "case", run, system=described(0.95, 0.98))
    way = next(t for t in terms_of(BY_ID[mechanism], scene) if t.branch.label.startswith("case's variant "))
    assert (way.parameters[0].name, way.parameters[0].high) == ("weight", most)
    assert predict(scene, (way,), np.array([1.4])) == pytest.approx(BASE - 0.14 * sun(scene), rel=1e-3)
    assert not way.mechanism.absurd(np.array([1.0]), way.branch)


@pytest.mark.parametrize("weight", [0.08, 0.3, 1.0])
def test_a_lens_with_part_of_its_pattern_is_found(tmp_path: Path, weight: float) -> None:
    """A tenth of what a whole pattern changes is plain to see, and is no whole one."""
    scene = varied(tmp_path / "case", ("lens-anisotropy", {"isotropic": False}, turned, ""))
    (way,) = [t for t in terms_of(BY_ID["lens-anisotropy"], scene) if t.branch.label.endswith("isotropic = False")]
    made = Scene(replace(scene.readings, measured=predict(scene, (way,), np.array([weight]))), scene.retraced)
    fitter = Fitter(made)
    starts = fitter.scan_starts(way, MIDDLE)
    fit = fitter.fit((way,), starts[0][1], MIDDLE)
    assert fit.theta == pytest.approx([weight], abs=0.02)
    fitter.weigh([fit, nothing := fitter.fit((), np.zeros(0), MIDDLE)])
    assert fit.log_evidence > nothing.log_evidence + 20.0


@pytest.mark.parametrize(
    ("mechanism", "setting", "had_it"),
    [
        ("lens-anisotropy", {"isotropic": True}, True),
        ("lens-anisotropy", {"anisotropic": False}, True),
        ("lens-anisotropy", {"isotropic": False}, False),
        ("near-field", {"field": "far"}, True),
        ("near-field", {"field": "near"}, False),
    ],
)
def test_a_variant_that_takes_something_away_says_that_it_was_there(
    tmp_path: Path, mechanism: str, setting: dict[str, Any], had_it: bool
) -> None:
    scene = varied(tmp_path / "case", (mechanism, setting, times(0.9), ""), simulation={"field": "far"})
    assert ("own variants" in BY_ID[mechanism].why_not(scene)) == had_it


@pytest.mark.parametrize(
    ("mechanism", "setting", "limit", "lacks"),
    [
        ("lens-anisotropy", {"isotropic": False}, 0, True),
        ("lens-anisotropy", {"anisotropic": True}, 0, True),
        ("lens-anisotropy", {"isotropic": True}, 0, False),
        ("bounce-truncation", {"max_bounces": 60}, 4, True),
        ("bounce-truncation", {"max_bounces": 0}, 4, True),  # none
        ("bounce-truncation", {"max_bounces": 4}, 60, False),
        ("bounce-truncation", {"max_bounces": 60}, 0, False),  # how many there were is not told
        ("wall-scatter", {"scattered_share": 0.1}, 0, False),
    ],
)
def test_a_variant_with_what_the_prediction_lacks_says_so(
    tmp_path: Path, mechanism: str, setting: dict[str, Any], limit: int, lacks: bool
) -> None:
    scene = varied(tmp_path / "case", (mechanism, setting, times(1.1), ""), simulation={"max_bounces": limit})
    assert scene.retraced is not None
    assert scene.retraced.lacks == ({mechanism} if lacks else set())


def test_where_one_variant_takes_a_pattern_and_one_gives_more_of_it_the_second_is_tried(tmp_path: Path) -> None:
    """The prediction had a part of it; the one that takes it away is no physics that was left out."""
    pattern, more, less = BY_ID["lens-anisotropy"], times(0.9), times(1.1)
    runs = ("lens-anisotropy", {"isotropic": False}, more, ""), ("lens-anisotropy", {"isotropic": True}, less, "")
    scene = varied(tmp_path / "case", *runs)
    assert not pattern.why_not(scene)
    labels = {b.label for b in pattern.branches(scene)}
    assert "case's variant isotropic = False" in labels
    assert not any("isotropic = True" in label for label in labels)


def test_a_clock_may_be_off_the_other_way_than_the_variant(tmp_path: Path) -> None:
    scene = varied(tmp_path / "case", ("clock-offset", {"offset_min": 10.0}, times(0.9), ""))
    (way, by_the_roof) = [t for t in terms_of(BY_ID["clock-offset"], scene) if "image" not in t.branch.label]
    assert by_the_roof.branch.value is way.branch.value
    assert way.parameters[0].low < -10.0
    made = predict(scene, (way,), np.array([-5.0]))
    assert made == pytest.approx(BASE + 0.05 * sun(scene), rel=1e-3)


def test_a_room_that_the_case_brings_counts_beside_the_closed_form(tmp_path: Path) -> None:
    brought = ("room-interreflection", {"wall_reflectance": 0.1}, times(1.1), "")
    scene = varied(tmp_path / "case", brought, system=described(0.95, 0.98))
    closed, own = terms_of(BY_ID["room-interreflection"], scene)
    assert (closed.branch.label, own.branch.label) == ("", "case's variants of wall_reflectance")
    assert predict(scene, (own,), np.array([0.05])) == pytest.approx(BASE + 0.05 * sun(scene), rel=1e-3)
    unknown = varied(tmp_path / "unknown", brought, room=None)
    assert [t.branch.label for t in terms_of(BY_ID["room-interreflection"], unknown)] == [own.branch.label]


def test_a_room_that_nothing_tells_of_is_supposed_and_its_reflectance_less_certain(tmp_path: Path) -> None:
    room = BY_ID["room-interreflection"]
    told, unknown = varied(tmp_path / "told"), varied(tmp_path / "unknown", room=None)
    (way,), (supposed,) = room.branches(told), room.branches(unknown)
    assert room.size_error_in(unknown, supposed) > 2.0 * room.size_error_in(told, way)
    assert "supposed" in room.statement(np.array([0.04, 0.02]), supposed)
    assert "supposed" not in room.statement(np.array([0.04, 0.02]), way)


def test_the_cases_own_way_is_always_weighed(tmp_path: Path) -> None:
    """Also where many others look better at first: here it throws the images elsewhere, and nothing is missing."""
    elsewhere = [("lens-haze", {"haze": 0.2}, lambda t, gamma, c: sun_part(t, gamma, c - 150.0), "")]
    for variants, brought in (([], 0), (elsewhere, 1)):
        search = Search(Fitter(varied(tmp_path / str(brought), *variants)), [BY_ID["lens-haze"]], [])
        ways = search.looks["lens-haze"]
        assert sum(fit.terms[0].branch.of_case for fit in ways) == brought
        assert len(ways) == 3 + brought


def test_what_a_variant_told_goes_on_in_a_case_that_brings_none(tmp_path: Path) -> None:
    case = make_case(tmp_path / "case", flaws=NONE)
    entry = {"id": "circumsolar-aureole", "way": AUREOLE, "names": ["fraction", "width_deg"]}
    text = apply_model(Model((entry | {"theta": [0.3, 5.0], "sd": [0.01, 0.5], "facts": {}},)), case)
    scene = Scene(Readings.of(case), retraced_of(case))
    made = predict(scene, (term(scene, "circumsolar-aureole", "images spread"),), np.array([0.3, 5.0]))
    assert columns(text, "corrected")[0] == pytest.approx(made, rel=1e-6)
    assert np.max(np.abs(made / BASE - 1.0)) > 0.05
