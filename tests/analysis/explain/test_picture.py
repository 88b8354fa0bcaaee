"""Pictures of the sky: what errs together in them, and what nobody has named."""

from pathlib import Path

import numpy as np
import pytest

from analysis.explain.alone import quieted
from analysis.explain.answer import answer
from analysis.explain.fit import Fitter
from analysis.explain.hypers import OF_THE_SKY, lattice_of
from analysis.explain.mismatch import explain
from analysis.explain.noise import blocks_of
from analysis.explain.pointing_error import pointing_errors, sky_steepness
from analysis.explain.readings import Readings
from analysis.explain.scene import Scene
from analysis.explain.search import Search
from analysis.explain.sky_error import USUAL, flat_field, of_a_model
from analysis.explain.sky_shape import towards
from tests.analysis.explain.campaign import Floats, Sky
from tests.analysis.explain.roof import SKY_TESTS, luminance, picture_points, sky_case, sun_distance, sun_of

ZENITH, ROUND = picture_points()


def seen(change: Floats, seed: int = 3, noise: float = 0.01) -> Floats:
    """What the camera reads with a relative ``change`` (160,), one per cent of gain a test, and noise."""
    rng = np.random.default_rng(seed)
    true = np.concatenate([luminance(t, ZENITH, ROUND) for t in SKY_TESTS])
    gain = np.repeat(1.0 + 0.01 * rng.normal(size=len(SKY_TESTS)), len(ZENITH))
    return np.asarray(true * (1.0 + change) * gain * (1.0 + noise * rng.normal(size=len(true))))


def test_each_picture_is_a_block_and_the_flat_field_is_shared(tmp_path: Path) -> None:
    scene = Scene(Readings.of(sky_case(tmp_path / "case")))
    assert [len(b.rows) for b in blocks_of(scene.readings)] == [len(ZENITH)] * len(SKY_TESTS)
    assert lattice_of(scene.readings) is OF_THE_SKY
    effects = flat_field(scene)
    covariance = effects @ effects.T
    assert np.sqrt(np.diag(covariance)) == pytest.approx(USUAL, rel=0.02)
    again = covariance[:40, 40:80] / USUAL**2
    assert np.diag(again) == pytest.approx(1.0, rel=0.05), "the same direction errs alike in another test"
    assert again[0, 25:40].max() < 0.6, "the rim errs by itself"


def test_noise_and_gains_of_tests_are_no_mismatch(tmp_path: Path) -> None:
    content = answer(explain(sky_case(tmp_path / "case", seen(np.zeros(160)))))
    assert content["verdict"] == "no-mismatch"


def test_a_small_fall_off_is_named_where_the_noise_is_small(tmp_path: Path) -> None:
    rim = np.tile((ZENITH / 90.0) ** 3, len(SKY_TESTS))
    (first,) = answer(explain(sky_case(tmp_path / "case", seen(-0.12 * rim))))["mechanisms"]
    assert first["id"] == "vignetting"
    told = first["parameters"]["loss_at_rim"]
    assert (
        abs(told["value"] - 0.12) < 2.5 * told["uncertainty"] + 0.03
    )  # the laws' rims differ, their fall-off does not


def test_clouds_that_moved_in_one_picture_hide_nothing_in_the_others(tmp_path: Path) -> None:
    rim = -0.12 * np.tile((ZENITH / 90.0) ** 3, len(SKY_TESTS))
    rng = np.random.default_rng(8)
    clouds = np.where(np.repeat(np.arange(4), 40) == 2, 0.25 * rng.normal(size=160), 0.0)
    calm, cloudy = (
        Search(Fitter(Scene(Readings.of(sky_case(tmp_path / name, seen(rim + moved))))))
        for name, moved in (("calm", np.zeros(160)), ("cloudy", clouds))
    )
    quiet = quieted(cloudy)
    assert quieted(calm).scene.alone is None
    assert quiet.scene.alone is not None
    assert np.unique(np.flatnonzero(quiet.scene.alone) // 40).tolist() == [2]
    assert np.median(quiet.scene.alone[80:120]) == pytest.approx(0.25, rel=0.4)
    gains = [
        next(h.evidence for h in search.singles() if h.ids == ("vignetting",)) - search.nothing().evidence
        for search in (calm, cloudy, quiet)
    ]
    assert gains[1] < 0.5 * gains[0] < gains[2]


def test_what_turns_with_the_sun_and_has_no_name_gets_none(tmp_path: Path) -> None:
    """A patch opposite to the sun, a ghost of it: located in the sun's frame, called by no name of the catalogue."""
    ghost = [
        0.8 * np.exp(-((sun_distance(ZENITH, ROUND, t.sun[0], t.sun[1] + 180.0) / 22.0) ** 2)) for t in SKY_TESTS[:3]
    ]
    content = answer(explain(sky_case(tmp_path / "case", seen(np.concatenate([*ghost, np.zeros(40)])))))
    assert content["verdict"] in {"unexplained", "partly-explained"}
    assert content["mismatch"], "it is located"


def test_a_camera_that_stands_turned_is_no_clock(tmp_path: Path) -> None:
    """All pictures turned by one angle: a law beyond the catalogue, which does better than another time."""
    turned = [luminance(t, ZENITH, ROUND + 9.0) / luminance(t, ZENITH, ROUND) - 1.0 for t in SKY_TESTS]
    content = answer(explain(sky_case(tmp_path / "case", seen(np.concatenate(turned)))))
    assert content["verdict"] == "unexplained" and not content["mechanisms"]
    law = max((u for u in content["unnamed"] if "conjecture" in u), key=lambda u: float(u["nats"]))
    assert law["along"] == "turned camera" and law["nats"] > 10.0
    assert law["size"] == pytest.approx(9.0, abs=3.0), "clockwise"


def test_a_sky_model_that_is_smoothly_wrong_is_no_mismatch(tmp_path: Path) -> None:
    """By two per cent, with the angle from the sun, and with the height: no fall-off, no law of the level."""
    away = np.concatenate([sun_distance(ZENITH, ROUND, *t.sun) for t in SKY_TESTS])
    wrong = 0.03 * np.exp(-away / 30.0) - 0.02 * np.tile((ZENITH / 90.0) ** 2, len(SKY_TESTS))
    content = answer(explain(sky_case(tmp_path / "case", seen(wrong, noise=0.003))))
    assert content["verdict"] == "no-mismatch"


def test_what_a_model_has_wrong_is_no_gain(tmp_path: Path) -> None:
    effects = of_a_model(Scene(Readings.of(sky_case(tmp_path / "case"))))
    assert np.abs(effects.mean(axis=0)).max() < 1e-4 < np.abs(effects).max()


def test_what_a_model_misses_about_the_sun_is_allowed_for(tmp_path: Path) -> None:
    """Light about the sun in proportion to its own, as a lens spreads it: nearly all of it lies in the effects."""
    scene = Scene(Readings.of(sky_case(tmp_path / "case")))
    away = np.concatenate([sun_distance(ZENITH, ROUND, *t.sun) for t in SKY_TESTS])
    facing = [(t.global_lx - t.diffuse_lx) / np.sin(np.radians(t.sun[0])) for t in SKY_TESTS]
    error = np.repeat(facing, len(ZENITH)) / (away**2 + 100.0) / scene.readings.simulated
    error *= 0.002 / np.sqrt(np.mean(error**2))
    error -= error.mean()
    effects = of_a_model(scene)
    inner = effects.T @ effects + 1e-4**2 * np.eye(effects.shape[1])
    left = error - effects @ np.linalg.solve(inner, effects.T @ error)
    assert np.linalg.norm(left) < 0.02 * np.linalg.norm(error)


def tilted(degrees: float, test: Sky) -> Floats:
    """Relative change of the luminances where the camera's axis leans north by an angle, by rotated vectors."""
    zenith, azimuth, lean = np.radians(ZENITH), np.radians(ROUND), np.radians(degrees)
    east, north, up = np.sin(zenith) * np.sin(azimuth), np.sin(zenith) * np.cos(azimuth), np.cos(zenith)
    north, up = north * np.cos(lean) + up * np.sin(lean), up * np.cos(lean) - north * np.sin(lean)
    seen_zenith, seen_azimuth = np.degrees(np.arccos(up)), np.degrees(np.arctan2(east, north))
    return np.asarray(luminance(test, seen_zenith, seen_azimuth) / luminance(test, ZENITH, ROUND) - 1.0)


def test_a_tilted_camera_has_no_other_projection(tmp_path: Path) -> None:
    """Five degrees off the zenith: a law beyond the catalogue."""
    change = np.concatenate([tilted(5.0, t) for t in SKY_TESTS])
    content = answer(explain(sky_case(tmp_path / "case", seen(change))))
    assert content["verdict"] == "unexplained" and not content["mechanisms"]
    law = max((u for u in content["unnamed"] if "conjecture" in u), key=lambda u: float(u["nats"]))
    assert law["along"] == "tilted camera"
    assert law["size"] == pytest.approx(5.0, abs=1.5), "towards north"


def test_pointing_is_what_a_lean_changes(tmp_path: Path) -> None:
    effects = pointing_errors(Scene(Readings.of(sky_case(tmp_path / "case"))))
    wanted = np.concatenate([tilted(0.15, t) for t in SKY_TESTS])
    assert np.corrcoef(effects[:, 0], wanted)[0, 1] > 0.9
    assert np.linalg.norm(effects[:, 0]) == pytest.approx(np.linalg.norm(wanted), rel=0.25)


def test_a_clock_is_no_turned_camera(tmp_path: Path) -> None:
    later = []
    for test in SKY_TESTS:
        altitude, azimuth = (float(a[0]) for a in sun_of((test,), 80.0 + 25.0 * 60.0))
        away = sun_distance(ZENITH, ROUND, altitude, azimuth), sun_distance(ZENITH, ROUND, *test.sun)
        glow = 0.0 if test.sky == "overcast" else 3.0
        base = 0.7 + 0.4 * (ZENITH / 90.0) ** 2
        later.append((base + glow * np.exp(-away[0] / 25.0)) / (base + glow * np.exp(-away[1] / 25.0)) - 1.0)
    content = answer(explain(sky_case(tmp_path / "case", seen(np.concatenate(later)))))
    assert [m["id"] for m in content["mechanisms"]] == ["clock-offset"]


@pytest.mark.parametrize(("test", "verdict"), [(2, "no-mismatch"), (0, "unexplained")])
def test_a_few_odd_readings_tell_nothing_under_broken_cloud(tmp_path: Path, test: int, verdict: str) -> None:
    """There a cloud's edge may lie between two instruments; in a clear sky they are something."""
    odd = np.zeros(160)
    odd[40 * test + np.array([8, 17, 25, 36])] = 0.8, -0.5, 0.6, -0.5
    assert SKY_TESTS[test].sky == ("partly-cloudy" if verdict == "no-mismatch" else "clear")
    assert answer(explain(sky_case(tmp_path / "case", seen(odd))))["verdict"] == verdict


def test_steep_places_of_a_sky_scatter_by_errors_of_direction(tmp_path: Path) -> None:
    """As much as the sky changes in a degree, by great circles: along and across the meridian of each direction."""
    scene = Scene(Readings.of(sky_case(tmp_path / "case")))
    r, v = scene.readings, towards(scene.readings)
    up = np.array([0.0, 0.0, 1.0]) - v[:, 2:] * v
    up /= np.maximum(np.linalg.norm(up, axis=1, keepdims=True), 1e-9)
    step = np.tan(np.radians(0.5))
    ways = [
        (v + step * side) / np.linalg.norm(v + step * side, axis=1, keepdims=True) for side in (up, np.cross(up, v))
    ]
    slope = np.hypot(*(scene.sky_shape.beside(w) for w in ways)) / 0.5 * np.abs(r.measured) / r.scale
    inside = v[:, 2] < 0.99
    assert sky_steepness(scene)[inside] == pytest.approx(slope[inside], rel=0.06, abs=5e-4)
