"""An arm that hangs some millimetres off is usual; one that hangs centimetres off is told."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from analysis.cases import Case
from analysis.explain import arm_error
from analysis.explain.arm_error import SENSOR_DEG, USUAL_M, arm_errors, sensor_angle_errors
from analysis.explain.fit import Fitter
from analysis.explain.lens_error import HAZE, haze_errors, lens_error_of_systems
from analysis.explain.mechanisms.catalogue import BY_ID
from analysis.explain.mechanisms.misaligned_arm import OffCentre
from analysis.explain.readings import Readings
from analysis.explain.scene import Scene
from analysis.explain.search import Search
from analysis.explain.thresholds import NAME_FIRST_BELOW, UNNAMED_ALONE
from tests.analysis.explain.campaign import DISTANCE_M, TESTS, Floats, Rows, Truth, light, make_case, rows_of
from tests.analysis.explain.test_mechanisms import acted


def _hung(east_m: float, north_m: float, below_m: float) -> Truth:
    """What sensors read on an arm whose centre is not the aperture's: C is counted from north over west."""

    def truth(rows: Rows) -> Floats:
        g, c = np.radians(rows.gamma_deg), np.radians(rows.c_deg)
        east = -DISTANCE_M * np.sin(g) * np.sin(c) + east_m
        north = DISTANCE_M * np.sin(g) * np.cos(c) + north_m
        down = DISTANCE_M * np.cos(g) + below_m
        away = np.sqrt(east**2 + north**2 + down**2)
        gamma = np.minimum(np.degrees(np.arccos(down / away)), 90.0)
        return light(rows, gamma, np.degrees(np.arctan2(-east, north))) * (DISTANCE_M / away) ** 2

    return truth


def test_its_errors_are_those_of_an_arm_that_was_moved(arm: Scene) -> None:
    rows, r = rows_of(TESTS), arm.readings
    made = arm_errors(arm)
    low = rows.gamma_deg < 80.0  # nearer to the horizon fields are read between the nodes of a grid
    for k, unit in enumerate(np.eye(3)[:2]):
        exact = (r.stretched(_hung(*(0.01 * unit))(rows)) - r.stretched(light(rows))) * USUAL_M / 0.01
        assert np.abs(made[low, k] - exact[low]).max() < 0.15 * np.abs(exact[low]).max()
        assert np.corrcoef(made[low, k], exact[low])[0, 1] > 0.98


def test_a_roof_has_no_arm(roof: Scene) -> None:
    assert arm_errors(roof).shape == (len(roof.readings), 0)


@pytest.mark.parametrize(("off_m", "told"), [(0.003, False), (0.04, True)])
def test_only_an_arm_that_is_centimetres_off_is_told(off_m: float, told: bool, tmp_path: Path) -> None:
    case = make_case(tmp_path / "case", _hung(off_m, -off_m, 0.0), tests=TESTS[::2])
    search = Search(Fitter(Scene(Readings.of(case))), mechanisms=[], conjectures=[OffCentre()])
    nothing = search.nothing()
    laws = search.beside(nothing, (), search.conjectures)
    assert any(law.evidence - nothing.evidence > UNNAMED_ALONE for law in laws) == told
    if told:
        assert laws[0].fit.theta[:2] == pytest.approx([off_m, -off_m], abs=0.01)


def test_what_is_usual_takes_from_what_a_shift_gains(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    scene = Scene(Readings.of(make_case(tmp_path / "case", _hung(0.03, -0.03, 0.0), tests=TESTS[::2])))
    gains = []
    for usual_m in (1e-6, USUAL_M):
        monkeypatch.setattr(arm_error, "USUAL_M", usual_m)
        search = Search(Fitter(replace(scene, memory={})), mechanisms=[], conjectures=[OffCentre()])
        nothing = search.nothing()
        (law,) = search.beside(nothing, (), search.conjectures)
        gains.append(law.evidence - nothing.evidence)
    assert UNNAMED_ALONE < gains[1] < gains[0] - 15.0


def _turned_sensors(off_deg: dict[float, float]) -> Truth:
    """What sensors read that sit on the arm off their marks by so much, by their gamma."""

    def truth(rows: Rows) -> Floats:
        off = np.array([off_deg.get(float(g), 0.0) for g in rows.gamma_deg])
        return light(rows, rows.gamma_deg + off, rows.c_deg)

    return truth


def test_each_sensor_has_an_error_of_its_own(arm: Scene) -> None:
    """It is that of the arm's angle in this sensor's readings, and nothing in the others'."""
    r = arm.readings
    made = sensor_angle_errors(arm)
    sensors = np.unique(r.channel[arm.is_gonio])
    assert made.shape == (len(r), len(sensors))
    assert np.all((made != 0.0).sum(axis=1) <= 1)
    rows = rows_of(TESTS)
    exact = (r.stretched(light(rows, rows.gamma_deg + 0.5, rows.c_deg)) - r.stretched(light(rows))) * SENSOR_DEG / 0.5
    steep = (rows.gamma_deg > 20.0) & (rows.gamma_deg < 80.0)
    assert np.corrcoef(made.sum(axis=1)[steep], exact[steep])[0, 1] > 0.98


def test_a_roof_has_no_sensors_on_an_arm(roof: Scene) -> None:
    assert sensor_angle_errors(roof).shape == (len(roof.readings), 0)


def test_sensors_off_their_marks_are_no_arm_that_is_off(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Two that are four tenths of a degree off: that is not the arm's angle, which is half a degree off if all are."""
    few = _turned_sensors({75.0: 0.4, 85.0: 0.4})
    case = make_case(tmp_path / "few", few, tests=TESTS[::2])
    all_off = make_case(tmp_path / "all", lambda rows: light(rows, rows.gamma_deg + 0.5, rows.c_deg), tests=TESTS[::2])

    def gain(case: Case) -> float:
        search = Search(Fitter(Scene(Readings.of(case))), mechanisms=[BY_ID["gamma-offset"]], conjectures=[])
        return search.singles()[0].evidence - search.nothing().evidence

    assert gain(case) < NAME_FIRST_BELOW < gain(all_off)
    monkeypatch.setattr(arm_error, "SENSOR_DEG", 1e-6)
    assert gain(case) > NAME_FIRST_BELOW


def test_a_lens_whose_prisms_are_steeper_moves_all_images_outwards(arm: Scene) -> None:
    """As an arm's angle does, but of the sun's light alone, and in every system by itself."""
    r = arm.readings
    rows = rows_of(TESTS)
    moved = (r.stretched(light(rows, rows.gamma_deg - 0.5, rows.c_deg)) - r.stretched(light(rows))) / 0.5
    each = [effect for (_, kind), effect in lens_error_of_systems(arm).items() if kind == "outwards"]
    assert np.all(sum(effect != 0.0 for effect in each) <= 1)
    outwards = np.sum(each, axis=0)
    far = (rows.gamma_deg > 20.0) & (rows.gamma_deg < 80.0)
    assert np.corrcoef(outwards[far], (moved * r.sun / r.simulated)[far])[0, 1] > 0.95


def test_a_lens_that_is_a_little_dull_scatters_light_widely(arm: Scene) -> None:
    """As a haze of its exit does, below every system by itself."""
    r = arm.readings
    wanted = (acted(arm, "lens-haze", "exit lens", 0.01) - r.simulated) / np.hypot(r.simulated, r.floor)
    effects = haze_errors(arm)
    assert np.all(np.sum(effects != 0.0, axis=1) <= 1)
    for effect in effects.T:
        rows = (effect != 0.0) & (np.abs(r.measured) > 0.9 * r.scale)
        assert np.corrcoef(effect[rows], wanted[rows])[0, 1] > 0.99
        assert np.std(effect[effect != 0.0]) == pytest.approx(HAZE, rel=0.2)


def test_a_roof_has_no_lens_that_is_dull(roof: Scene) -> None:
    assert haze_errors(roof).shape == (len(roof.readings), 0)
