"""Walls by the way that light leaves a well: how often it met them, and what they keep and scatter of it."""

from pathlib import Path

import numpy as np
import pytest

from analysis.cases.model import Aperture, System
from analysis.explain.fields import C_DEG, GAMMA_DEG, solid_angle
from analysis.explain.mirror_wells import cut_short, duller_walls, reflections, scattering_walls, wells, within
from analysis.explain.readings import Readings
from analysis.explain.scene import Scene
from tests.analysis.explain.campaign import NONE, TESTS, make_case

TUBE = System(
    id="tube", kind="tube", aperture=Aperture(shape="disc", diameter_m=0.5), well_depth_m=1.2, wall_finish="specular"
)
BOX = System(
    id="box",
    kind="box",
    aperture=Aperture(shape="rectangle", size_m=(0.6, 0.3)),
    well_depth_m=0.6,
    wall_finish="specular",
)


@pytest.fixture(scope="module")
def scene(tmp_path_factory: pytest.TempPathFactory) -> Scene:
    """The campaign with both wells described as mirrors."""
    return _scene(tmp_path_factory.mktemp("wells"), "specular")


def _scene(folder: Path, finish: str) -> Scene:
    walls = {"wall_finish": finish, "wall_reflectance": 0.95}
    systems = [
        {"id": "box", "kind": "box", "aperture": {"shape": "rectangle", "size_m": (0.6, 0.6)}, "well_depth_m": 0.6},
        {"id": "tube", "kind": "tube", "aperture": {"shape": "disc", "diameter_m": 0.36}, "well_depth_m": 1.2},
    ]
    return Scene(Readings.of(make_case(folder, flaws=NONE, change={"system": [s | walls for s in systems]})))


def _met(gamma_deg: float, radius: float = 0.25, count: int = 40_000) -> np.ndarray:
    """Bounces of rays that enter a tube 1.2 m deep anywhere: along a chord each meets its wall every so far."""
    rng = np.random.default_rng(3)
    towards = np.array([1.0, 0.0])
    at = radius * np.sqrt(rng.uniform(size=count))[:, None] * _unit(2.0 * np.pi * rng.uniform(size=count))
    beside = at[:, 1]  # of a ray that goes towards +x: its chords are all as long
    half = np.sqrt(radius**2 - beside**2)
    first = half - at @ towards
    sideways = 1.2 * np.tan(np.radians(gamma_deg))
    return np.where(sideways > first, 1.0 + np.floor((sideways - first) / (2.0 * half)), 0.0)


def _unit(turn: np.ndarray) -> np.ndarray:
    return np.stack([np.cos(turn), np.sin(turn)], axis=1)


@pytest.mark.parametrize("gamma_deg", [10.0, 40.0, 70.0])
def test_a_tube_is_met_as_often_as_rays_meet_it(gamma_deg: float) -> None:
    met = reflections(TUBE)
    assert met is not None
    at = int(np.argmin(np.abs(GAMMA_DEG - gamma_deg)))
    assert np.allclose(met[:, at], _met(float(GAMMA_DEG[at])).mean(), rtol=0.02)
    assert np.all(met[:, 0] == 0.0)


def test_a_box_is_met_by_the_distance_of_its_walls() -> None:
    """Towards north walls are 0.3 m apart, towards west 0.6 m."""
    met = reflections(BOX)
    assert met is not None
    at, north, west = (int(np.argmin(np.abs(a - x))) for a, x in ((GAMMA_DEG, 45.0), (C_DEG, 0.0), (C_DEG, 90.0)))
    sideways = 0.6 * np.tan(np.radians(GAMMA_DEG[at]))
    assert met[north, at] == pytest.approx(sideways / 0.3)
    assert met[west, at] == pytest.approx(sideways / 0.6)


def test_no_well_is_met_without_a_depth_or_an_opening() -> None:
    assert reflections(TUBE.model_copy(update={"well_depth_m": None})) is None
    assert reflections(BOX.model_copy(update={"aperture": None})) is None


def test_walls_that_are_no_mirrors_are_left_out(tmp_path: Path, scene: Scene, arm: Scene, roof: Scene) -> None:
    assert [w.name for w in wells(scene)] == ["box", "tube"]
    for other in (_scene(tmp_path, "diffuse"), arm, roof):
        assert wells(other) == []
        assert not [*duller_walls(other), *scattering_walls(other)]


def test_duller_walls_dim_what_leaves_aslant_below_their_well_alone(scene: Scene) -> None:
    for path, system in zip(duller_walls(scene), ("box", "tube"), strict=True):
        mine = np.array([t.system == system for t in TESTS])
        assert path.label.endswith(f", {system} only")
        assert np.all(path.sun[:, ~mine] == 1.0)
        same = path.positions == pytest.approx(0.95)
        assert np.allclose(path.sun[same], 1.0)
        dull = path.sky[int(np.argmax(path.positions >= 0.87)), mine].mean(axis=(0, 1))
        assert np.all(np.diff(dull[:-4]) < 1e-3), "more is lost the more it lies aslant"
        assert dull[0] - dull[-8] > 0.05


def test_walls_that_scatter_lose_no_light_and_even_it_out(scene: Scene) -> None:
    path = next(p for p in scattering_walls(scene) if p.label == "as light leaves")
    base = scene.fields.sky
    flux = np.sum(base * solid_angle(), axis=(1, 2))
    for k, share in enumerate(path.positions):
        made = base * path.sky[k]
        assert np.allclose(np.sum(made * solid_angle(), axis=(1, 2)), flux, rtol=0.01)
        if share == 0.0:
            assert np.allclose(path.sky[k], 1.0)
    all_of_it = base * path.sky[-1]
    straight_down = base[:, :, 0] * 1.0
    assert np.all(all_of_it[:, :, 0] > straight_down), "what goes straight down meets no wall, and gets of the rest"


@pytest.mark.parametrize("gamma_deg", [20.0, 50.0, 70.0])
@pytest.mark.parametrize("limit", [2, 5])
def test_what_a_limit_leaves_of_a_tubes_light(scene: Scene, gamma_deg: float, limit: int) -> None:
    (tube,) = (w for w in wells(scene) if w.name == "tube")
    at = int(np.argmin(np.abs(GAMMA_DEG - gamma_deg)))
    met = _met(float(GAMMA_DEG[at]), radius=0.18)
    for most, bound in ((limit, limit), (None, np.inf)):
        left = float(np.mean(np.where(met <= bound, 0.95**met, 0.0)))
        assert within(tube, most)[:, at] == pytest.approx(left, abs=0.015)


def test_light_that_was_cut_comes_back_by_the_way_it_leaves(scene: Scene) -> None:
    """None towards nadir, ever more of the light that leaves obliquely, and less under a higher limit."""
    ways = {p.label: p for p in cut_short(scene)}
    few, many = ways["as light leaves, after 6, tube only"], ways["as light leaves, after 24"]  # none of the box's
    tube = [k for k, t in enumerate(scene.readings.case.tests) if t.system == "tube"]
    others = [k for k in range(len(scene.readings.case.tests)) if k not in tube]
    for path in (few, many):
        assert np.all(path.sun[0] == 1.0) and np.all(path.sun[1][others] == 1.0)
        ratio = path.sun[1][tube[0], 0]
        assert ratio[0] == pytest.approx(1.0) and np.all(np.diff(ratio) >= -2e-3)
        assert np.array_equal(path.sun, path.sky)
    assert np.all(few.sun[1] >= many.sun[1] - 1e-9) and np.max(few.sun[1] - many.sun[1]) > 0.1


def test_a_limit_that_is_stated_is_the_one(tmp_path: Path) -> None:
    system = {"id": "tube", "kind": "tube", "aperture": {"shape": "disc", "diameter_m": 0.36}, "well_depth_m": 1.2}
    mirrors = [system | {"wall_finish": "specular", "wall_reflectance": 0.95}]
    case = make_case(tmp_path, flaws=NONE, change={"system": mirrors, "simulation": {"max_bounces": 9}})
    assert [p.label for p in cut_short(Scene(Readings.of(case)))] == ["as light leaves, after 9"]
