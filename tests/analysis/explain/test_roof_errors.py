"""What every roof has wrong: heads that lean a little, and air that is not the air of the prediction."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from analysis.cases.model import Floats
from analysis.explain import air_error
from analysis.explain.air_error import OF_A_TEST, air_error_effects, air_mass, errors_of_all_days, gains_of_tests
from analysis.explain.answer import answer
from analysis.explain.mismatch import explain
from analysis.explain.mount_error import LEVEL_DEG, mount_errors
from analysis.explain.nearness import smooth_along
from analysis.explain.readings import Readings
from analysis.explain.scene import Scene
from analysis.explain.series import recorded
from tests.analysis.explain.roof import beam_and_sky, roof_case
from tests.analysis.explain.test_mechanisms import acted
from tests.analysis.explain.test_roof_series import series


def relative(scene: Scene, changed: Floats) -> Floats:
    """Change of each reading on the stretched scale."""
    r = scene.readings
    return np.asarray((changed - r.simulated) / np.hypot(r.simulated, r.floor) * np.abs(r.measured) / r.scale)


@pytest.mark.parametrize("whose", ["velux", "konica", "every roof meter"])
@pytest.mark.parametrize("towards", ["north", "east"])
def test_an_effect_is_the_beam_on_a_head_that_leans(roof: Scene, whose: str, towards: str) -> None:
    lean = (LEVEL_DEG, 0.0) if towards == "north" else (0.0, LEVEL_DEG)
    wanted = relative(roof, acted(roof, "meter-tilt", whose, *lean))
    effects = mount_errors(roof.readings)
    off = np.abs(effects - wanted[:, None]).max(axis=0)
    assert off.min() < 0.25 * np.abs(wanted).max(), "but for what little the sky's part changes"


def test_three_effects_of_each_head_and_of_what_was_predicted(roof: Scene) -> None:
    assert mount_errors(roof.readings).shape == (len(roof.readings), 9)


def test_an_arm_and_a_roof_without_parts_have_none(arm: Scene, roof: Scene) -> None:
    assert mount_errors(arm.readings).shape[1] == 0
    no_sun = replace(roof.readings, sun=np.full(len(roof.readings), np.nan))
    assert mount_errors(no_sun).shape[1] == 0


def test_the_air_of_a_single_day_is_allowed_for(roof: Scene) -> None:
    both = air_error_effects(roof)
    first = np.array([t.start.date() == roof.readings.case.tests[0].start.date() for t in roof.readings.case.tests])
    one = air_error_effects(roof.only(first[roof.readings.test]))
    assert 0 < one.shape[1] < both.shape[1]
    assert np.all(np.any(one != 0.0, axis=0))


def left_of(error: Floats, effects: Floats) -> float:
    """Share (rms) of an error that effects leave over, beside noise of a third of a per cent."""
    inner = effects.T @ effects + 0.003**2 * np.eye(effects.shape[1])
    return float(np.linalg.norm(error - effects @ np.linalg.solve(inner, effects.T @ error)) / np.linalg.norm(error))


@pytest.mark.parametrize(
    "wrong",
    [
        lambda height, level, azimuth: 0.02 * np.exp(-(((height - 25) / 14) ** 2)),
        lambda height, level, azimuth: 0.02 * level**2,
        lambda height, level, azimuth: 0.015 * np.sin(2.0 * np.radians(azimuth)),
    ],
    ids=["the sun's height", "the level", "the sun's azimuth"],
)
def test_what_is_wrong_alike_on_all_days_is_allowed_for(
    wrong: Callable[[Floats, Floats, Floats], Floats], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    scene = Scene(Readings.of(series(tmp_path / "case", per_root_min=1e-6)))
    monkeypatch.setattr(air_error, "recorded", lambda scene: False)
    r = scene.readings
    error = wrong(r.sun_altitude_at_deg, r.simulated / r.simulated.max(), r.sun_azimuth_at_deg)
    alike, by_day = errors_of_all_days(scene), air_error_effects(scene)
    with_them = left_of(error, np.concatenate([alike, by_day], axis=1))
    monkeypatch.setattr(air_error, "_AS_THE_DAYS", 0.0)
    assert with_them < 0.1 and with_them < 0.5 * left_of(error, air_error_effects(scene))


def test_a_second_instruments_heads_are_as_wrong_as_a_models(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """It stands in the same air, but reads with heads of its own."""
    scene = Scene(Readings.of(series(tmp_path / "case", per_root_min=1e-6)))
    of_a_recording, by_day = errors_of_all_days(scene), air_error_effects(scene)
    monkeypatch.setattr(air_error, "recorded", lambda scene: False)
    model = Scene(scene.readings)
    assert recorded(scene) and np.array_equal(errors_of_all_days(model), of_a_recording)
    assert np.linalg.norm(air_error_effects(model)) > 1.5 * np.linalg.norm(by_day)


def test_a_gain_of_a_test_is_the_same_in_all_meters(roof: Scene) -> None:
    r, effects = roof.readings, gains_of_tests(roof)
    assert effects.shape[1] == len(np.unique(r.test))
    for k, test in enumerate(np.unique(r.test)):
        rows = r.test == test
        assert np.allclose(effects[rows, k], OF_A_TEST * np.abs(r.measured[rows]) / r.scale[rows])
        assert not np.any(effects[~rows, k])
    assert len(np.unique(r.channel)) == 2
    one_meter = np.where(r.channel == 0, 0.01, 0.0)
    assert left_of(one_meter, effects) > 0.5, "a meter's own gain is none of all"


def test_a_second_instrument_is_no_model_of_the_sky(tmp_path: Path) -> None:
    """It has noise of its own, and stands in the same air; a model has none, and errs as its turbidity does."""
    scene = Scene(Readings.of(series(tmp_path / "case", per_root_min=1e-6)))
    r = scene.readings
    smooth = replace(r, simulated=(beam_and_sky(r.sun_altitude_at_deg)[0] + beam_and_sky(r.sun_altitude_at_deg)[1]))
    model = Scene(smooth)
    assert recorded(scene) and not recorded(model)
    days = Scene(Readings.of(series(tmp_path / "cloud")))
    assert recorded(days), "two days are clear"
    assert not recorded(days.only(days.readings.test == 1)), "under broken cloud nothing tells"
    first = r.utc_ns < r.utc_ns[0] + 43_200 * 10**9
    low = np.where(first, 0.03 * air_mass(r.sun_altitude_at_deg) * r.sun / r.simulated, 0.0)
    of_model, of_meter = (2.0 * air_error_effects(s) for s in (model, scene))  # days that differ by twice the usual
    assert left_of(low, of_model) < 0.4 * left_of(low, of_meter)


def test_azimuths_are_told_from_their_middle_across_north_too() -> None:
    seen = air_error._from_noon(np.array([350.0, 10.0, 30.0]))
    assert np.degrees(seen) == pytest.approx([-20.0, 0.0, 20.0], abs=0.2)


def test_what_is_wrong_alike_on_all_days_is_no_gain(roof: Scene) -> None:
    effects = errors_of_all_days(roof)
    for channel in (0, 1):
        rows = np.where(roof.readings.channel == channel, 1.0, 0.0)
        assert left_of(0.1 * rows, effects) > 0.999


@pytest.mark.slow
def test_a_gain_is_told_beside_all_this(roof: Scene, tmp_path: Path) -> None:
    rng, r = np.random.default_rng(5), roof.readings
    read = r.simulated * np.where(r.channel == 0, 1.08, 1.0) * (1.0 + 0.002 * rng.normal(size=len(r)))
    case = roof_case(tmp_path / "case", {"velux": read[r.channel == 0], "konica": read[r.channel == 1]})
    (found,) = answer(explain(case))["mechanisms"]
    assert found["id"] == "meter-gain"
    assert found["parameters"]["error"]["value"] == pytest.approx(0.08, abs=0.02)


def test_smooth_functions_have_unit_variance_and_go_together_nearby() -> None:
    x = np.linspace(-1.0, 3.0, 50)
    covariance = (functions := smooth_along(x, 0.6)) @ functions.T
    assert np.diag(covariance) == pytest.approx(1.0)
    assert covariance[0, 1] > 0.9 and covariance[0, 30] < 0.01
