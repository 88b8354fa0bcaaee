"""Random effects: their covariance along the coordinates they are functions of, and how sure their size is."""

import numpy as np
import pytest

from analysis.cases.model import Floats
from analysis.explain.along import cloud_share, in_time, loud, roughly_in_time, sun_share
from analysis.explain.families import CLOUD, SHUTTER
from analysis.explain.scene import Scene
from analysis.explain.wander import Wandering, likeliest


def _covariance(columns: Floats) -> Floats:
    return np.asarray(columns @ columns.T)


@pytest.mark.parametrize("seconds", [25.0, pytest.param(400.0, marks=pytest.mark.slow)])
def test_a_rough_function_of_time_forgets_by_the_root_of_what_a_smooth_one_does(arm: Scene, seconds: float) -> None:
    """Steps at all scales: covariance exp(-Δt / τ) within a test, none between tests."""
    t, test, share = arm.readings.utc_ns / 1e9, arm.readings.test, cloud_share(arm)
    apart = np.abs(t[:, None] - t[None, :])
    expected = np.where(test[:, None] == test[None, :], np.exp(-apart / seconds), 0.0) * np.outer(share, share)
    assert np.max(np.abs(_covariance(roughly_in_time(arm, seconds)) - expected)) < 0.1


def test_both_forms_have_unit_variance_where_the_cloud_is_all_there_is(arm: Scene) -> None:
    for form, within in ((in_time, 0.1), (roughly_in_time, 1e-4)):
        for seconds in CLOUD.lengths:
            variance = np.diag(_covariance(form(arm, seconds)))
            assert variance == pytest.approx(cloud_share(arm) ** 2, rel=within, abs=1e-3 * within)


def test_a_cloud_passes_under_the_skies_that_can_have_one(arm: Scene) -> None:
    """The sun's part under broken cloud, hardly any of it in a clear sky, all light under an overcast one."""
    skies = np.array([t.sky for t in arm.readings.case.tests])[arm.readings.test]
    for sky, expected in (("partly-cloudy", sun_share(arm)), ("overcast", loud(arm))):
        assert np.any(skies == sky)
        assert cloud_share(arm)[skies == sky] == pytest.approx(expected[skies == sky])
    assert 0.0 < cloud_share(arm)[skies == "clear"].max() < 0.2 * sun_share(arm)[skies == "clear"].max()


def _weights(where: dict[tuple[int, float, float], float]) -> Floats:
    return np.array([where.get((x.form, x.length, x.amplitude), 0.0) for x in CLOUD.sizes()])


def test_the_form_that_carries_most_is_told_at_its_mean_size() -> None:
    found = likeliest(CLOUD.sizes(), _weights({(1, 60.0, 0.02): 0.3, (1, 60.0, 0.05): 0.3, (0, 25.0, 0.12): 0.4}))
    assert found.form == 1
    assert found.length == pytest.approx(60.0)
    assert found.amplitude == pytest.approx(np.sqrt(0.02 * 0.05))


def test_sizes_that_do_as_well_widen_what_is_told() -> None:
    sure = likeliest(CLOUD.sizes(), _weights({(0, 60.0, 0.05): 1.0}))
    spread = likeliest(CLOUD.sizes(), _weights({(0, 25.0, 0.05): 0.5, (0, 140.0, 0.05): 0.5}))
    assert spread.log_sd[0] == pytest.approx(sure.log_sd[0])
    of_forms = likeliest(CLOUD.sizes(), _weights({(0, 60.0, 0.05): 0.6, (1, 140.0, 0.05): 0.4}))
    assert of_forms.length == pytest.approx(60.0)
    assert of_forms.log_sd[1] > 1.1 * sure.log_sd[1]
    assert spread.log_sd[1] ** 2 - sure.log_sd[1] ** 2 == pytest.approx(np.log(140.0 / 25.0) ** 2 / 4.0)


def test_a_size_that_was_not_varied_is_told_with_a_wide_berth() -> None:
    found = likeliest(SHUTTER.sizes(), np.array([0.0, 1.0, 0.0]))
    (_, (stops, uncertainty)) = found.told
    assert 0.4 < uncertainty / stops < 0.6


def test_what_is_told_has_the_moments_of_a_log_normal_quantity() -> None:
    drawn = 0.05 * np.exp(0.4 * np.random.default_rng(3).standard_normal(200_000))
    (value, uncertainty), _ = Wandering(CLOUD, 0.05, 60.0, log_sd=(0.4, 0.4)).told
    assert value == pytest.approx(drawn.mean(), rel=0.01)
    assert uncertainty == pytest.approx(drawn.std(), rel=0.02)
