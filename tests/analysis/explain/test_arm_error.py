"""An arm that hangs some millimetres off is usual; one that hangs centimetres off is told."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from analysis.explain import arm_error
from analysis.explain.arm_error import USUAL_M, arm_errors
from analysis.explain.fit import Fitter
from analysis.explain.mechanisms.misaligned_arm import OffCentre
from analysis.explain.readings import Readings
from analysis.explain.scene import Scene
from analysis.explain.search import Search
from analysis.explain.thresholds import UNNAMED_ALONE
from tests.analysis.explain.campaign import DISTANCE_M, TESTS, Floats, Rows, Truth, light, make_case, rows_of


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
    scene = Scene(Readings.of(make_case(tmp_path / "case", _hung(0.02, -0.02, 0.0), tests=TESTS[::2])))
    gains = []
    for usual_m in (1e-6, USUAL_M):
        monkeypatch.setattr(arm_error, "USUAL_M", usual_m)
        search = Search(Fitter(replace(scene, memory={})), mechanisms=[], conjectures=[OffCentre()])
        nothing = search.nothing()
        (law,) = search.beside(nothing, (), search.conjectures)
        gains.append(law.evidence - nothing.evidence)
    assert UNNAMED_ALONE < gains[1] < gains[0] - 15.0
