"""Our own re-simulations: what each setting changes, as ratios to themselves."""

import numpy as np
import pytest

from analysis.explain import tracing
from analysis.explain.resimulate import Retracings, simulator_of
from analysis.explain.retrace import Path
from analysis.explain.settings import UNLIMITED
from tests.analysis.explain.campaign import TESTS, make_case

BOX, TUBE = 0, 1


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Retracings:
    """A box and a tube, each under one sky, with few rays."""
    case = make_case(tmp_path_factory.mktemp("case") / "case", tests=(TESTS[1], TESTS[5]))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(tracing, "RAYS", 8_000)
        patch.setattr(tracing, "MORE_RAYS", 20_000)
        simulator = simulator_of(case)
        assert simulator is not None
        return simulator.made


def _path(made: Retracings, mechanism: str, label: str) -> Path:
    (found,) = [p for p in made.paths[mechanism] if p.label == label]
    return found


def test_every_setting_of_a_box_and_a_tube_is_traced(made: Retracings) -> None:
    assert set(made.paths) == {
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


def test_the_parts_share_what_is_predicted(made: Retracings) -> None:
    assert np.all((made.sun_share > 0.0) & (made.sun_share < 1.0))


def test_a_pattern_as_square_as_a_pyramid_is_itself_after_a_quarter_turn(made: Retracings) -> None:
    path = _path(made, "lens-orientation", "own re-simulation")
    assert path.positions[-1] == 90.0
    assert np.all(path.sun[-1] == 1.0)
    assert np.std(path.sun[len(path.positions) // 2]) > 0.01, "half way the images lie elsewhere"
