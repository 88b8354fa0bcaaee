"""What must hold for the catalogue and for any parameters: neutral values, turns, mirrors, flux and energy."""

import itertools
import json
import tomllib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from analysis.cases import model
from analysis.explain.again import simulated_again
from analysis.explain.fields import C_DEG, GAMMA_DEG, solid_angle
from analysis.explain.fit import MIDDLE, Fitter
from analysis.explain.geometry import apply_operator, blurred
from analysis.explain.mechanisms.base import Mechanism, Stage, predict
from analysis.explain.mechanisms.catalogue import BY_ID, CATALOGUE
from analysis.explain.mechanisms.goniometer import _near_matrix
from analysis.explain.mechanisms.states import terms_of
from analysis.explain.readings import Readings
from analysis.explain.roomlight import DarkRoom, RoomLight, room_light
from analysis.explain.scene import Scene
from analysis.explain.variants import retraced_of
from analysis.simulate.room import Room, patches_of
from labdaq import directions
from labdaq.cli import cli
from tests.analysis.explain.campaign import DISTANCE_M, NONE, ROOM_M, Floats, make_case
from tests.analysis.explain.test_mechanisms import term

CONTRACT = {
    "sun and sky": "sky-sun-ratio circumsolar-aureole cloud-drift",
    "optics": "lens-haze lens-anisotropy lens-orientation soiling",
    "well": "wall-reflectance bounce-truncation wall-scatter",
    "room": "room-interreflection stray-light",
    "goniometer": "near-field gamma-offset c-offset c-handedness channel-swap",
    "sensors": "dark-offset nonlinearity saturation cosine-response channel-gain",
    "time": "clock-offset",
    "roof meters": "meter-tilt meter-gain meter-cosine meter-range-limit",
    "camera": "vignetting veiling-glare spectral-mismatch exposure-error projection-error",
}
NEUTRAL = {"circumsolar-aureole": (0.0, 6.0)}
"""Parameters that change nothing, where they are not all zero."""

FLOOR, CEILING = 4, 5
"""Numbers of surfaces, as `analysis.simulate.room` has them."""

few = settings(max_examples=20, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
angles = st.floats(-180.0, 180.0)


# the catalogue


def test_the_catalogue_is_the_contracts() -> None:
    ids = [i for group in CONTRACT.values() for i in group.split()]
    assert len(ids) == 32
    assert sorted(BY_ID) == sorted(ids)
    assert len(CATALOGUE) == len(BY_ID), "an id is given twice"


@pytest.mark.parametrize("m", CATALOGUE, ids=lambda m: m.id)
def test_each_mechanism_says_what_it_is(m: Mechanism) -> None:
    stages = {i: stage for stage, group in CONTRACT.items() for i in group.split()}
    if m.id != "meter-range-limit":  # it is told among the roof's meters but acts last, where a range ends
        assert m.stage.label == stages[m.id]
    assert m.leaves_out.endswith(".")
    assert m.source
    assert m.needs
    assert set(m.kinds) <= {"goniometer", "roof", "sky"}
    assert m.parameters or m.id == "channel-swap", "a wire is swapped or it is not; all else has a size"
    for p in m.parameters:
        assert p.low < p.high
        assert p.low <= p.centre <= p.high
        assert p.sigma > 0
        assert p.starts
        assert all(p.low <= s <= p.high for s in p.starts)
        assert p.name
        assert p.unit
        assert p.meaning


def test_the_command_lists_the_whole_catalogue() -> None:
    told = json.loads(CliRunner().invoke(cli, ["mechanisms", "--json"]).stdout)
    assert [m["id"] for m in told] == [m.id for m in CATALOGUE]
    for m in told:
        assert isinstance(m["stage"], str)
        assert isinstance(m["source"], str)
        for p in m["parameters"]:
            assert {type(p[k]) for k in ("name", "unit", "meaning")} == {str}
            assert p["low"] < p["high"]
    plain = CliRunner().invoke(cli, ["mechanisms"]).stdout
    assert all(m.id in plain and m.source in plain for m in CATALOGUE)


@pytest.mark.parametrize("kind", ["arm", "roof", "picture"])
def test_a_light_that_was_kept_is_the_light_made_anew(kind: str, request: pytest.FixtureRequest) -> None:
    """Two mechanisms together, whichever was asked for before; the second is asked for twice, the first once."""
    scene: Scene = request.getfixturevalue(kind)
    usable = [m for m in CATALOGUE if set(m.kinds) & set(scene.kinds) and not m.random and not m.why_not(scene)]
    ways = [terms_of(m, scene)[0] for m in usable]
    for pair in itertools.pairwise(ways):
        for share in (0.3, 0.4):
            theta = [p.starts[0] for p in pair[0].parameters] + [share * p.starts[-1] for p in pair[1].parameters]
            kept = predict(scene, pair, np.array(theta))
            anew = predict(replace(scene, memory={}, lit={}, of_rows={}), pair, np.array(theta))
            assert kept == pytest.approx(anew, rel=1e-12), [way.mechanism.id for way in pair]


# neutral values, and ways that can be told apart


@pytest.mark.parametrize("kind", ["arm", "roof", "picture"])
def test_neutral_parameters_change_nothing(kind: str, request: pytest.FixtureRequest) -> None:
    scene: Scene = request.getfixturevalue(kind)
    for m in CATALOGUE:
        usable = set(m.kinds) & set(scene.kinds) and not m.random and not m.why_not(scene)
        if not usable or m.id in {"channel-swap", "c-handedness"}:  # these two have no neutral way
            continue
        for way in terms_of(m, scene):
            theta = np.array(NEUTRAL.get(m.id, [0.0] * len(way.parameters)))
            made = predict(scene, (way,), theta)
            assert made == pytest.approx(scene.readings.simulated, rel=1e-9), f"{m.id}, {way.branch.label}"


@pytest.mark.parametrize("kind", ["arm", "roof", "picture"])
def test_the_ways_of_a_mechanism_have_names_of_their_own(kind: str, request: pytest.FixtureRequest) -> None:
    """`labdaq predict` finds a way again by its name."""
    scene: Scene = request.getfixturevalue(kind)
    for m in CATALOGUE:
        if set(m.kinds) & set(scene.kinds) and not m.random and not m.why_not(scene):
            labels = [way.branch.label for way in terms_of(m, scene)]
            assert len(labels) == len(set(labels)), m.id


def test_what_cannot_be_tried_is_said(arm: Scene) -> None:
    for i in ("lens-anisotropy", "wall-reflectance", "bounce-truncation"):
        assert "variant" in BY_ID[i].why_not(arm)
    for i in ("lens-orientation", "clock-offset"):  # without a re-simulation, the sun's image is turned as a whole
        assert BY_ID[i].why_not(arm) == ""
    follows = "the image follows the sun"
    rings = f"{follows}, below tubes by the sun's height and azimuth"
    clocks = [follows, rings, f"{follows}, by the roof's clock", f"{rings}, by the roof's clock"]
    assert [b.label for b in BY_ID["clock-offset"].branches(arm)] == clocks
    turns = ["turn of the sun's image", "turn of all light of box", "turn of all light of tube", "turn of every lens"]
    assert [b.label for b in BY_ID["lens-orientation"].branches(arm)] == turns


# turns, mirrors, swaps


@few
@given(degrees=angles, turns=st.sampled_from([-360.0, 360.0]))
def test_a_whole_turn_is_nothing(arm: Scene, degrees: float, turns: float) -> None:
    offset = term(arm, "c-offset")
    here = predict(arm, (offset,), np.array([degrees]))
    assert predict(arm, (offset,), np.array([degrees + turns])) == pytest.approx(here, rel=1e-6)


@few
@given(zero=angles)
def test_mirrored_twice_is_nothing(arm: Scene, zero: float) -> None:
    for way in ("zero in the north", "zero in the south"):
        mirror = term(arm, "c-handedness", way)
        twice = predict(arm, (mirror, mirror), np.array([zero, zero]))
        assert twice == pytest.approx(arm.readings.simulated, rel=1e-6)


@few
@given(a=st.floats(-90.0, 90.0), b=st.floats(-90.0, 90.0))
def test_turns_add_up(arm: Scene, a: float, b: float) -> None:
    turn = term(arm, "c-offset")
    both = predict(arm, (turn, turn), np.array([a, b]))
    assert both == pytest.approx(predict(arm, (turn,), np.array([a + b])), rel=1e-6)


@few
@given(steps=st.integers(-8, 8))
def test_below_a_round_well_a_lens_that_is_turned_is_an_arm_turned_back(arm: Scene, steps: int) -> None:
    angle = 5.0 * steps  # where the light is read between directions of the grid, the two ways differ a little
    lens, offset = term(arm, "lens-orientation", "turn of all light of tube"), term(arm, "c-offset")
    turned, back = predict(arm, (lens,), np.array([angle])), predict(arm, (offset,), np.array([-angle]))
    tube = np.array([t.system == "tube" for t in arm.readings.case.tests])[arm.readings.test]
    assert turned[tube] == pytest.approx(back[tube], rel=1e-3)
    assert turned[~tube] == pytest.approx(arm.readings.simulated[~tube], rel=1e-9)


@pytest.mark.parametrize("angle", [-25.0, 3.0, 14.0])
def test_lenses_that_are_all_turned_do_below_each_well_what_it_does_there(tmp_path: Path, angle: float) -> None:
    table = tomllib.loads((make_case(tmp_path / "as it is").folder / "case.toml").read_text())
    systems = [s | {"lens": "prismatic", "kind": "top" if s["id"] == "box" else "tube"} for s in table["system"]]
    scene = Scene(Readings.of(make_case(tmp_path / "case", change={"system": systems})))
    ways = ("turn of every lens", "turn of all light of tube", "turn of the sun's image")
    every, tube, image = (predict(scene, (term(scene, "lens-orientation", w),), np.array([angle])) for w in ways)
    below = np.array([t.system == "tube" for t in scene.readings.case.tests])[scene.readings.test]
    assert every == pytest.approx(np.where(below, tube, image), rel=1e-6)


@pytest.mark.parametrize(
    ("lens", "kind", "ways"),
    [("prismatic", "top", 1), ("diffusing", "box", 0), ("clear", "box", 0), ("prismatic", "box", 2)],
)
def test_only_a_lens_with_a_pattern_can_lie_turned_below_a_long_well(
    tmp_path: Path, lens: str, kind: str, ways: int
) -> None:
    """A square one only beside another system: else that is an arm turned back."""
    table = tomllib.loads((make_case(tmp_path / "as it is").folder / "case.toml").read_text())
    systems = [s | {"lens": lens, "kind": "tube" if s["kind"] == "tube" else kind} for s in table["system"]]
    scene = Scene(Readings.of(make_case(tmp_path / "case", change={"system": systems})))
    labels = [b.label for b in BY_ID["lens-orientation"].branches(scene)]
    assert sum("all light" in label for label in labels) == ways


def test_all_light_of_the_only_square_well_is_not_turned(tmp_path: Path) -> None:
    table = tomllib.loads((make_case(tmp_path / "as it is").folder / "case.toml").read_text())
    systems = [s | {"lens": "prismatic", "kind": "box"} for s in table["system"]]
    tests = [t | {"system": systems[0]["id"]} for t in table["test"]]
    scene = Scene(Readings.of(make_case(tmp_path / "case", change={"system": systems, "test": tests})))
    assert not any("all light" in b.label for b in BY_ID["lens-orientation"].branches(scene))


def test_the_angle_of_all_light_is_the_least_that_the_lens_is_turned_by(arm: Scene) -> None:
    lens = BY_ID["lens-orientation"]
    ways = {b.label: lens.size_error_in(arm, b) for b in lens.branches(arm)}
    assert ways["turn of all light of tube"] > 0.5 > ways["turn of the sun's image"]


def test_swapped_twice_is_nothing(arm: Scene) -> None:
    """A recording whose labels are put right is the prediction; other channels never move."""
    r = arm.readings
    for one, other in ((25.0, 35.0), (0.0, 85.0)):
        made = predict(arm, (term(arm, "channel-swap", f"gonio.g{one:02.0f} and gonio.g{other:02.0f}"),), np.zeros(0))
        back = made.copy()
        for t in np.unique(r.test):
            for c in np.unique(r.c_deg):
                pair = [np.flatnonzero((r.test == t) & (r.c_deg == c) & (r.gamma_deg == g))[0] for g in (one, other)]
                back[pair] = made[pair[::-1]]
        assert back == pytest.approx(r.simulated, rel=0.01)  # planes lie between those of the grid
        untouched = ~np.isin(r.gamma_deg, (one, other))
        assert np.array_equal(made[untouched], r.simulated[untouched])


# flux


def flux(field: Floats) -> Floats:
    """Flux [lm] of fields (T, P, G)."""
    return np.asarray(np.sum(field * solid_angle(), axis=(1, 2)))


@few
@given(width=st.floats(2.0, 14.0))
def test_an_aureole_keeps_the_flux_and_lowers_the_peak(arm: Scene, width: float) -> None:
    sun = arm.fields.sun
    wide = blurred(sun, width)
    assert flux(wide) == pytest.approx(flux(sun), rel=1e-9)
    assert np.all(wide >= 0.0)
    assert np.all(wide.max(axis=(1, 2)) <= sun.max(axis=(1, 2)) * 1.001)


def test_one_cell_becomes_a_gaussian_about_itself_and_nothing_else() -> None:
    field = np.zeros((1, len(C_DEG), len(GAMMA_DEG)))
    at = 20, 12  # C 100°, gamma 30°
    field[0, *at] = 1.0
    wide = blurred(field, 9.0)[0]
    v = directions.vector(GAMMA_DEG[None, :], C_DEG[:, None])
    expected = np.exp((v @ v[at] - 1.0) / np.radians(9.0) ** 2)
    assert wide / wide[at] == pytest.approx(np.where(expected > 1e-3, expected, 0.0), rel=1e-9, abs=1e-12)
    assert np.count_nonzero(wide) == np.count_nonzero(expected > 1e-3)


def test_a_wider_aureole_is_flatter(arm: Scene) -> None:
    peaks = [blurred(arm.fields.sun[:1], w).max() for w in (2.0, 4.0, 8.0, 14.0)]
    assert all(a > b for a, b in itertools.pairwise(peaks))


@few
@given(haze=st.floats(0.0, 0.9))
def test_haze_at_the_exit_keeps_the_flux(arm: Scene, haze: float) -> None:
    light = arm.dark_light()
    term(arm, "lens-haze", "exit lens").illuminate(arm, light, np.array([haze]))
    assert flux(light.sun + light.sky) == pytest.approx(flux(arm.fields.total), rel=2e-3)  # the grid's Lambert law


@few
@given(change=st.floats(-0.5, 0.4))
def test_a_new_split_keeps_the_roofs_global_illuminance(roof: Scene, change: float) -> None:
    made = predict(roof, (term(roof, "sky-sun-ratio"),), np.array([change]))
    beam_left = roof.beam_lx > 0.5 * roof.readings.diffuse_lx  # where the sky cannot take all of the beam
    rows = beam_left[roof.readings.test]
    assert made[rows] == pytest.approx(roof.readings.simulated[rows], rel=1e-9)


def test_near_is_far_when_the_opening_is_small_or_the_arm_long(arm: Scene) -> None:
    field = arm.fields.total
    low = GAMMA_DEG < 75.0
    for size, distance in ((0.01, DISTANCE_M), (0.6, 260.0)):
        near = apply_operator(_near_matrix("rectangle", (size, size), distance), field)
        assert near[:, :, low] == pytest.approx(field[:, :, low], rel=2e-3)
    changes = [
        np.abs(apply_operator(_near_matrix("disc", (d,), DISTANCE_M), field) - field)[:, :, low].max()
        for d in (0.1, 0.3, 0.6)
    ]
    assert changes[0] < changes[1] < changes[2]


# the room


@pytest.fixture(scope="module")
def dark_room() -> RoomLight:
    return room_light(ROOM_M, DISTANCE_M, 60.0)


@pytest.fixture(scope="module")
def open_sensors() -> RoomLight:
    return room_light(ROOM_M, DISTANCE_M, 90.0)


def test_black_surfaces_send_nothing_back(arm: Scene, dark_room: RoomLight) -> None:
    assert np.all(dark_room.added(arm.fields.total, 0.0, 0.0) == 0.0)


@few
@given(wall=st.floats(1e-6, 1e-4), floor=st.floats(1e-6, 1e-4))
def test_little_reflectance_sends_back_in_proportion(
    arm: Scene, dark_room: RoomLight, wall: float, floor: float
) -> None:
    field = arm.fields.total[:2]
    parts = dark_room.added(field, wall, 0.0) + dark_room.added(field, 0.0, floor)
    size = float(parts.max())  # some sensors, shielded, see only what bounced twice
    assert np.abs(dark_room.added(field, wall, floor) - parts).max() < 1e-3 * size
    assert np.abs(dark_room.added(field, 2 * wall, 2 * floor) - 2 * parts).max() < 1e-3 * size


def _areas_m2() -> Floats:
    """Of the room's patches: all the same, for it is a cube."""
    assert len(set(ROOM_M)) == 1
    return np.full(len(patches_of(ROOM_M).surface), 6.0 * ROOM_M[0] ** 2 / len(patches_of(ROOM_M).surface))


def test_all_light_falls_on_floor_and_walls(arm: Scene, dark_room: RoomLight) -> None:
    """Below the ceiling there is nothing else; what the horizon's last degrees miss is below 2 %."""
    lit = dark_room.lit @ arm.fields.total.reshape(len(arm.fields.total), -1).T
    assert _areas_m2() @ lit == pytest.approx(flux(arm.fields.total), rel=0.02)
    assert np.all(lit[patches_of(ROOM_M).surface == CEILING] == 0.0)


def test_the_floors_share_of_a_lambertian_source_is_its_form_factor(dark_room: RoomLight) -> None:
    """Form factor from a small horizontal element to a parallel square centred below it (Howell, B-3, four times)."""
    lambert = np.broadcast_to(np.maximum(np.cos(np.radians(GAMMA_DEG)), 0.0), (len(C_DEG), len(GAMMA_DEG))) / np.pi
    a = ROOM_M[0] / 2.0 / ROOM_M[2]
    root = np.sqrt(1.0 + a * a)
    factor = 4.0 / (2.0 * np.pi) * 2.0 * (a / root) * np.arctan(a / root)
    on_floor = np.where(patches_of(ROOM_M).surface == FLOOR, _areas_m2(), 0.0)
    assert float(on_floor @ (dark_room.lit @ lambert.ravel())) == pytest.approx(factor, rel=0.01)


@few
@given(wall=st.floats(0.0, 0.6), floor=st.floats(0.0, 0.6))
def test_the_room_never_sends_back_more_than_it_got(
    arm: Scene, open_sensors: RoomLight, wall: float, floor: float
) -> None:
    """Through the sensors' shell, outwards, passes no more than all bounces of the most reflecting surface give."""
    most = max(wall, floor)
    back = flux(open_sensors.added(arm.fields.total, wall, floor))
    assert np.all(back >= 0.0)
    assert np.all(back <= flux(arm.fields.total) * most / (1.0 - most) + 1e-9)


@few
@given(grey=st.floats(0.01, 0.6))
def test_a_grey_room_takes_in_all_the_light_it_is_given(arm: Scene, dark_room: RoomLight, grey: float) -> None:
    """White furnace: what the surfaces absorb, all bounces together, is the aperture's flux."""
    lit = dark_room.lit @ arm.fields.total.reshape(len(arm.fields.total), -1).T
    sent = Room(ROOM_M, grey, grey, grey).exitance(lit)
    assert _areas_m2() @ (sent * (1.0 - grey) / grey) == pytest.approx(_areas_m2() @ lit, rel=5e-3)


@pytest.mark.parametrize(("size_m", "known"), [((4.0, 7.0, 5.0), True), ((7.0, 7.0, 2.4), False)])
def test_an_arm_that_reaches_beyond_the_walls_is_lit_by_what_is_before_them(
    arm: Scene, size_m: tuple[float, float, float], known: bool
) -> None:
    """Nobody reads there; a room lower than the arm is long is none."""
    setup = arm.readings.case.setup.model_copy(update={"room": model.Room(size_m=size_m)})
    assert (DarkRoom.of(setup) is not None) == known
    if known:
        lambert = np.ones((1, len(C_DEG), 1)) * np.maximum(np.cos(np.radians(GAMMA_DEG)), 0.0)
        added = room_light(size_m, DISTANCE_M, 60.0).added(lambert, 0.2, 0.1)
        assert np.all(np.isfinite(added))
        assert added[:, :, -1] == pytest.approx(added[:, :, -2])


def test_in_a_room_that_an_arm_reaches_out_of_the_loop_is_closed_all_the_same(tmp_path: Path) -> None:
    """The light is simulated again before the walls, as it was fitted."""
    change = {"simulation": {"field": "far"}, "room": {"size_m": (4.0, 7.0, 5.0)}}
    case = make_case(tmp_path / "case", flaws=NONE, change=change)
    scene = Scene(Readings.of(case), retraced_of(case))
    told, theta = term(scene, "room-interreflection", ""), np.array([0.2, 0.1])
    again = simulated_again(scene, (told,), theta)
    assert again is not None
    assert again.ids == ("room-interreflection",)
    fitted = predict(scene, (told,), theta)
    assert np.max(fitted / scene.readings.simulated) > 1.02
    assert again.predicted == pytest.approx(fitted, rel=0.02)


def test_shields_only_take_away(arm: Scene, dark_room: RoomLight, open_sensors: RoomLight) -> None:
    field = arm.fields.total
    assert np.all(dark_room.added(field, 0.1, 0.05) <= open_sensors.added(field, 0.1, 0.05) + 1e-9)


# the sensors


@few
@given(compression=st.floats(0.01, 25.0))
def test_a_range_that_ends_only_lowers_and_never_reorders(arm: Scene, compression: float) -> None:
    order = np.argsort(arm.readings.simulated)
    for form in ("gradual", "exponential", "clipped"):
        way = term(arm, "saturation", f"the goniometer's sensors, {form}")
        made = predict(arm, (way,), np.array([compression]))
        assert np.all(made <= arm.readings.simulated * (1 + 1e-12))
        assert np.all(np.diff(made[order]) >= -1e-9)
        assert made.max() <= arm.readings.simulated.max() / compression * (1 + 1e-9)


def test_a_range_that_ends_far_below_the_brightest_is_found(arm: Scene) -> None:
    """Sharp images are many times as bright as what a wrong range shows of them."""
    way = term(arm, "saturation", "the goniometer's sensors, rounded")
    read = replace(arm.readings, measured=predict(arm, (way,), np.array([9.0, 15.0])))
    fitter = Fitter(Scene(read, arm.retraced))
    fit = fitter.fit((way,), fitter.scan_starts(way, MIDDLE)[0][1], MIDDLE)
    assert fit.theta[0] == pytest.approx(9.0, rel=0.02)


@few
@given(exponent=st.floats(-0.3, 0.3))
def test_a_bent_response_is_straightened_by_its_inverse(arm: Scene, exponent: float) -> None:
    way = term(arm, "nonlinearity", "the goniometer's sensors")
    bent = predict(arm, (way,), np.array([exponent]))
    level = way.branch.facts["level"]
    assert level * (bent / level) ** (1 / (1 + exponent)) == pytest.approx(arm.readings.simulated, rel=1e-6)


def test_stages_follow_the_light() -> None:
    order = ("SUN_AND_SKY", "OPTICS", "WELL", "GONIOMETER", "ROOM", "SENSORS")
    values = [Stage[name].value for name in order]
    assert values == sorted(values)
