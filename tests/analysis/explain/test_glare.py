"""Light that a camera's lens, or a luminance meter's, scatters."""

import dataclasses
from pathlib import Path

import numpy as np
import pytest

from analysis.cases import Case, write_case
from analysis.cases.model import CaseFile
from analysis.explain.answer import answer
from analysis.explain.mechanisms.camera import cameras_side
from analysis.explain.mismatch import explain
from analysis.explain.readings import Readings
from analysis.explain.scene import Scene
from tests.analysis.explain.campaign import Floats
from tests.analysis.explain.roof import SKY_TESTS, luminance, picture_points, sky_case, sun_distance
from tests.analysis.explain.test_mechanisms import acted

ZENITH, ROUND = picture_points()
FACING = np.array([(t.global_lx - t.diffuse_lx) / np.sin(np.radians(t.sun[0])) for t in SKY_TESTS])
"""Illuminance on a plane that faces the sun [lx]."""


def test_light_that_is_spread_evenly_gives_all_directions_the_mean_of_the_sky(picture: Scene) -> None:
    """The true mean is that of the invented sky; the explanation knows forty places of it."""
    r = picture.readings
    made = acted(picture, "veiling-glare", "spread evenly", 0.04)
    cosine, round_deg = (x.ravel() for x in np.meshgrid((np.arange(200) + 0.5) / 200, np.arange(180) * 2.0))
    for k, test in enumerate(SKY_TESTS):
        rows = r.test == k
        mean = float(luminance(test, np.degrees(np.arccos(cosine)), round_deg).mean())
        assert (made - 0.96 * r.simulated)[rows] == pytest.approx(0.04 * mean, rel=0.05)


def test_light_that_is_spread_about_leaves_what_is_bright_for_what_is_dark(picture: Scene) -> None:
    r = picture.readings
    change = acted(picture, "veiling-glare", "spread about", 0.2) - r.simulated
    for k in np.unique(r.test):
        rows = r.test == k
        assert change[rows][np.argmax(r.simulated[rows])] < 0.0 < change[rows][np.argmin(r.simulated[rows])]
        assert abs(change[rows].sum()) < 0.1 * np.abs(change[rows]).sum() + 0.02 * r.simulated[rows].sum()


def test_an_even_sky_stays_even_when_its_light_is_spread_about(picture: Scene) -> None:
    even = dataclasses.replace(picture.readings, simulated=np.full(len(picture.readings), 5000.0))
    assert acted(Scene(even), "veiling-glare", "spread about", 0.4) == pytest.approx(5000.0)


def about_the_sun() -> Floats:
    """Luminance (160,) [cd/m²] of the sun's light where all of it is spread with 1/(angle² + 10²) over a hemisphere."""
    angle = np.linspace(0.0, 90.0, 20_001)
    whole = 2.0 * np.pi * np.trapezoid(np.sin(np.radians(angle)) / (angle**2 + 100.0), np.radians(angle))
    away = [sun_distance(ZENITH, ROUND, *t.sun) for t in SKY_TESTS]
    return np.concatenate([e / (d**2 + 100.0) / whole for e, d in zip(FACING, away, strict=True)])


def test_the_suns_light_is_spread_with_that_of_the_sky(picture: Scene) -> None:
    evenly = acted(picture, "veiling-glare", "spread, the sun's too", 0.03, 1.0)
    sky = acted(picture, "veiling-glare", "spread evenly", 0.03)
    assert evenly - sky == pytest.approx(np.repeat(0.03 * FACING / (2.0 * np.pi), len(ZENITH)), rel=1e-6)
    about = acted(picture, "veiling-glare", "spread, the sun's too", 0.03, 0.0)
    sky = acted(picture, "veiling-glare", "spread about", 0.03)
    assert about - sky == pytest.approx(0.03 * about_the_sun(), rel=2e-3)


def test_glare_of_the_sun_is_named(tmp_path: Path) -> None:
    rng = np.random.default_rng(8)
    true = np.concatenate([luminance(t, ZENITH, ROUND) for t in SKY_TESTS])
    veil = 0.05 * (0.5 * about_the_sun() + 0.5 * np.repeat(FACING / (2.0 * np.pi), len(ZENITH)))
    gain = np.repeat(1.0 + 0.01 * rng.normal(size=len(SKY_TESTS)), len(ZENITH))
    read = (true + veil) * gain * (1.0 + 0.01 * rng.normal(size=len(true)))
    (first,) = answer(explain(sky_case(tmp_path / "case", read)))["mechanisms"]
    assert first["id"] == "veiling-glare"
    told = first["parameters"]["spread"]
    assert abs(told["value"] - 0.05) < 3.0 * told["uncertainty"]


def two_instruments(folder: Path, predicted_by_camera: bool) -> Case:
    """The pictures again with a luminance meter on the directions of the first; its prediction is theirs, or not."""
    case = sky_case(folder / "one")
    r = case.records
    first = r.test == 0
    more = {f.name: getattr(r, f.name)[first] for f in dataclasses.fields(r)}
    more["channel"] = np.ones(int(first.sum()), dtype=np.int64)
    more["simulated"] = r.measured[first] if predicted_by_camera else 1.03 * r.measured[first]
    both = dataclasses.replace(r, **{name: np.concatenate([getattr(r, name), values]) for name, values in more.items()})
    table = case.setup.model_dump(exclude_none=True)
    meter = {"id": "ls", "kind": "luminance-meter", "quantity": "luminance", "unit": "cd/m2"}
    table["channel"] = [*table["channel"], meter]
    return write_case(folder / "two", CaseFile.model_validate(table), both)


@pytest.mark.parametrize("predicted_by_camera", [True, False])
def test_a_meters_prediction_has_the_cameras_errors_only_where_it_is_the_camera(
    tmp_path: Path, predicted_by_camera: bool
) -> None:
    scene = Scene(Readings.of(two_instruments(tmp_path, predicted_by_camera)))
    meter = scene.readings.channel == 1
    assert np.all(cameras_side(scene)[~meter] == 1.0)
    assert np.all(cameras_side(scene)[meter] == (-1.0 if predicted_by_camera else 0.0))
    made = acted(scene, "veiling-glare", "spread evenly, in the meter", 0.05)
    assert np.array_equal(made[~meter], scene.readings.simulated[~meter]), "the camera is another instrument"
    darkest = meter & (scene.readings.simulated <= np.median(scene.readings.simulated[meter]))
    assert np.all(made[darkest] > scene.readings.simulated[darkest])


def test_where_no_camera_is_read_it_is_what_predicts(tmp_path: Path) -> None:
    scene = Scene(Readings.of(sky_case(tmp_path / "case", kind="luminance-meter")))
    assert np.all(cameras_side(scene) == -1.0)
