"""An explanation on another case: it acts in its own way and place, or says that it cannot."""

from pathlib import Path

import numpy as np
import pytest

from analysis.cases import read_case
from analysis.explain.answer import answer
from analysis.explain.apply import Model, apply_model
from analysis.explain.mismatch import explain
from labdaq.errors import DataError
from tests.analysis.explain import effects
from tests.analysis.explain.campaign import WITHHELD, Floats, columns, light, make_case, rows_of
from tests.analysis.explain.roof import ROOF_TESTS, beam_and_sky, roof_case, sun_of


def model(
    mechanism: str, way: str, names: list[str], theta: list[float], only: tuple[str, ...] = (), **facts: float
) -> Model:
    entry = {"id": mechanism, "way": way, "names": names, "theta": theta, "sd": [0.01] * len(theta), "facts": facts}
    return Model((entry | {"only": list(only)},))


def corrected(case_folder: Path, what: Model) -> Floats:
    return columns(apply_model(what, read_case(case_folder, need_measured=False)), "corrected")[0]


def test_a_sensor_of_another_name_is_not_mistaken_for_the_first(tmp_path: Path) -> None:
    make_case(tmp_path / "case", tests=WITHHELD, measured=False)
    what = model("channel-gain", "gonio.g45", ["error"], [0.1])
    rows = rows_of(WITHHELD)
    assert corrected(tmp_path / "case", what) == pytest.approx(
        light(rows) * np.where(rows.gamma_deg == 45.0, 1.1, 1.0), rel=1e-6
    )
    elsewhere = model("channel-gain", "other.g45", ["error"], [0.1])
    with pytest.raises(DataError, match=r"channel-gain \(other.g45\) cannot be applied"):
        corrected(tmp_path / "case", elsewhere)


def test_offsets_of_each_sensor_are_applied_to_tests_without_readings(tmp_path: Path) -> None:
    make_case(tmp_path / "case", tests=WITHHELD, measured=False)
    rows = rows_of(WITHHELD)
    sensors = [f"offset_gonio.g{g:02.0f}" for g in np.unique(rows.gamma_deg)]
    what = model("dark-offset", "each sensor its own", sensors, list(effects.OFFSETS))
    assert corrected(tmp_path / "case", what) == pytest.approx(effects.offsets(effects.OFFSETS)(rows), rel=1e-6)


def test_a_fitted_level_stays_that_of_the_fit(tmp_path: Path) -> None:
    make_case(tmp_path / "case", tests=WITHHELD, measured=False)
    what = model("nonlinearity", "the goniometer's sensors", ["p"], [0.1], level=500.0)
    bare = light(rows_of(WITHHELD))
    assert corrected(tmp_path / "case", what) == pytest.approx(500.0 * (bare / 500.0) ** 1.1, rel=1e-5)


def test_a_split_found_where_the_sun_shone_acts_where_it_shone_always(tmp_path: Path) -> None:
    make_case(tmp_path / "case", tests=WITHHELD, measured=False)
    some, every = (
        corrected(tmp_path / "case", model("sky-sun-ratio", way, ["diffuse_change"], [0.1]))
        for way in ("where the sun shone", "")
    )
    assert some == pytest.approx(every, rel=1e-9)
    assert not np.allclose(some, light(rows_of(WITHHELD)), rtol=1e-3)


def test_what_the_case_lacks_is_said(tmp_path: Path) -> None:
    make_case(tmp_path / "case", tests=WITHHELD, measured=False, change={"room": {"size_m": [5.5, 5.5, 2.0]}})
    what = model("room-interreflection", "", ["wall_reflectance", "floor_reflectance"], [0.1, 0.0])
    with pytest.raises(DataError, match="sensors are not inside the room"):
        corrected(tmp_path / "case", what)


def test_a_room_found_where_it_was_told_acts_where_it_is_supposed(tmp_path: Path) -> None:
    """The supposed one has the report's proportions, and the campaign's is the report's."""
    what = model("room-interreflection", "", ["wall_reflectance", "floor_reflectance"], [0.1, 0.02])
    make_case(tmp_path / "told", tests=WITHHELD, measured=False)
    make_case(tmp_path / "not told", tests=WITHHELD, measured=False, without=("room",))
    told, supposed = (corrected(tmp_path / name, what) for name in ("told", "not told"))
    assert not np.allclose(told, light(rows_of(WITHHELD)), rtol=1e-3)
    assert supposed == pytest.approx(told, rel=1e-3)


def test_a_state_acts_on_its_side_of_the_instant_in_tests_of_any_name(tmp_path: Path) -> None:
    roof_case(tmp_path / "case", {})
    total = sum(beam_and_sky(sun_of(ROOF_TESTS, 60.0)[0]))
    turned = ROOF_TESTS[11].start.timestamp()  # the second day's first
    second = np.arange(len(ROOF_TESTS)) >= 11
    for fact, acts in (("from_utc_s", second), ("until_utc_s", ~second)):
        way = "konica, from X7 on" if fact == "from_utc_s" else "konica, until before X7"
        made = corrected(tmp_path / "case", model("meter-gain", way, ["error"], [0.05], **{fact: turned}))
        assert made[: len(acts)] == pytest.approx(total, rel=1e-6)
        assert made[len(acts) :] == pytest.approx(total * np.where(acts, 1.05, 1.0), rel=1e-6)


def test_the_steepness_of_a_law_is_kept(tmp_path: Path) -> None:
    roof_case(tmp_path / "case", {})
    names = ["error_at_60deg", "steepness"]
    gentle, steep = (corrected(tmp_path / "case", model("meter-cosine", "velux", names, [0.1, k])) for k in (1.0, 2.5))
    low = sun_of(ROOF_TESTS, 60.0)[0] < 20.0
    assert np.all(steep[: len(low)][low] > gentle[: len(low)][low])


def test_dirt_on_one_system_stays_there(tmp_path: Path) -> None:
    """In a case of the other system alone it does nothing; in one of its own system alone it needs no name."""
    both = make_case(tmp_path / "both", tests=WITHHELD, measured=False)
    what = model("soiling", "box", ["loss"], [0.12], ("box",))
    made = columns(apply_model(what, both), "corrected")[0]
    box = np.array([t.system == "box" for t in WITHHELD])[rows_of(WITHHELD).test]
    for test, here in ((WITHHELD[0], box), (WITHHELD[1], ~box)):
        make_case(tmp_path / test.id, tests=(test,), measured=False)
        assert corrected(tmp_path / test.id, what) == pytest.approx(made[here], rel=1e-6)
    assert made[~box] == pytest.approx(light(rows_of(WITHHELD))[~box], rel=1e-6)
    assert np.all(made[box] < 0.95 * light(rows_of(WITHHELD))[box])


@pytest.mark.slow
def test_what_a_mechanism_changed_is_kept_with_it(tmp_path: Path) -> None:
    content = answer(explain(make_case(tmp_path / "case", effects.only("tube", effects.dirt(0.25)))))
    (entry,) = content["model"]
    assert entry["id"] == "soiling"
    assert entry["only"] == ["tube"]
    turned = answer(explain(make_case(tmp_path / "turned", effects.c_offset(6.0))))
    assert turned["model"][0]["only"] == []


def test_dirt_on_both_faces_is_applied_to_other_tests(tmp_path: Path) -> None:
    make_case(tmp_path / "case", tests=WITHHELD, measured=False)
    what = model("soiling", "every system, both faces", ["loss"], [0.03])
    exact = effects.dirt_below(0.03)(rows_of(WITHHELD))
    assert corrected(tmp_path / "case", what) == pytest.approx(exact, rel=0.01)


def test_a_mirroring_wall_is_applied_below_its_own_well(tmp_path: Path) -> None:
    """By the way that light leaves it: what leaves aslant has met the wall more often."""
    walls = {"wall_finish": "specular", "wall_reflectance": 0.95, "well_depth_m": 1.2}
    box = {"id": "box", "kind": "box", "aperture": {"shape": "rectangle", "size_m": (0.6, 0.6)}} | walls
    tube = {"id": "tube", "kind": "tube", "aperture": {"shape": "disc", "diameter_m": 0.36}} | walls
    make_case(tmp_path / "case", tests=WITHHELD, measured=False, change={"system": [box, tube]})
    what = model("wall-reflectance", "as light leaves, tube only", ["wall_reflectance"], [0.9], ("tube",))
    rows = rows_of(WITHHELD)
    change = corrected(tmp_path / "case", what) / light(rows)
    below = rows.test == 1
    assert change[~below] == pytest.approx(1.0)
    mean = [change[below & (rows.gamma_deg == g)].mean() for g in (0.0, 45.0, 75.0)]
    assert 1.0 > mean[0] > mean[1] > mean[2]
