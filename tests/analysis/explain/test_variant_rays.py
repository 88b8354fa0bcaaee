"""A variant that was traced with rays of its own: its change is kept, its rays and the prediction's are not."""

from pathlib import Path

import numpy as np
import pytest

from analysis.explain.fields import C_DEG, GAMMA_DEG
from analysis.explain.fit import Fitter
from analysis.explain.mechanisms.catalogue import BY_ID
from analysis.explain.ratios import plain_ratio
from analysis.explain.ray_noise import _along_gamma
from analysis.explain.sampler import Sampler
from analysis.explain.scene import Scene
from analysis.explain.search import Search
from analysis.explain.variant_rays import LEAST, NO_MORE, _smooth, scatter, scatter_around
from tests.analysis.explain.campaign import TESTS, Floats, Sky, sun_part
from tests.analysis.explain.test_case_variants import varied
from tests.analysis.explain.test_ray_noise import rays

LIGHT: Floats = np.asarray(sun_part(TESTS[0], GAMMA_DEG[None, :], C_DEG[:, None]))
BRIGHT = 0.01 * LIGHT.max() < LIGHT
DULLER: Floats = np.asarray(1.0 - 0.1 * np.sin(np.radians(GAMMA_DEG))[None, :] ** 2 * np.ones_like(LIGHT))
MOVED: Floats = plain_ratio(np.asarray(sun_part(TESTS[0], GAMMA_DEG[None, :], C_DEG[:, None] - 15.0)), LIGHT)
RAYS: Floats = 0.015 * np.random.default_rng(3).standard_normal(LIGHT.shape)


def _rms(values: Floats) -> float:
    return float(np.sqrt(np.mean(values[BRIGHT] ** 2)))


@pytest.mark.parametrize("change", [DULLER, MOVED], ids=["duller", "moved"])
def test_the_scatter_of_rays_is_told_from_what_a_setting_changes(change: Floats) -> None:
    """Third differences along gamma are of rays alone, where images are a few degrees wide."""
    assert scatter(np.log(change), BRIGHT, 1) < LEAST
    assert scatter(np.log(change) + RAYS, BRIGHT, 1) == pytest.approx(0.015, rel=0.15)


def test_a_smooth_change_keeps_its_size_and_loses_its_rays() -> None:
    made = _smooth(DULLER * np.exp(RAYS), LIGHT, 1)
    assert _rms(np.log(made / DULLER)) < _rms(RAYS) / 2.0


def test_images_that_move_are_blurred_no_more_than_rays_hide() -> None:
    made = _smooth(MOVED * np.exp(RAYS), LIGHT, 1)
    assert _rms(np.log(made / MOVED)) < NO_MORE * _rms(RAYS)
    assert np.corrcoef(np.log(made)[BRIGHT], np.log(MOVED)[BRIGHT])[0, 1] > 0.99


def test_without_rays_a_change_is_left_as_it_is() -> None:
    assert np.array_equal(_smooth(MOVED, LIGHT, 1), MOVED)
    assert np.array_equal(_smooth(np.ones_like(LIGHT), LIGHT, 1), np.ones_like(LIGHT))


def _with_its_own_rays(t: Sky, gamma: Floats, c: Floats) -> Floats:
    """Duller walls, traced with other rays than the prediction, whose own are missing here."""
    image = sun_part(t, gamma, c)
    rough = rays(t, "variant", image.shape) - rays(t, "baseline", image.shape)
    return np.asarray(image * (1.0 - 0.08 * np.sin(np.radians(gamma)) ** 2) * (1.0 + rough))


def _off_by_its_rays(folder: Path) -> Scene:
    """A recording that differs from its prediction by that one's rays alone."""
    scene = varied(folder, ("wall-reflectance", {"wall_reflectance": 0.9, "tests": 1.0}, _with_its_own_rays, ""))
    r = scene.readings
    grid = len(C_DEG) + 1, len(GAMMA_DEG)
    errors = np.stack([rays(t, "baseline", grid)[:-1] for t in TESTS])
    at = Sampler(r.test, r.gamma_deg, r.c_deg)(errors)
    object.__setattr__(r, "measured", r.measured - r.sun * at)
    return scene


def test_what_rays_a_variant_has_is_no_reason_for_its_name(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A little of the variant takes some of the prediction's rays out of the residual, as long as it has them."""
    gains = []
    for quiet in (True, False):
        if not quiet:
            monkeypatch.setattr("analysis.explain.variants.without_rays", lambda path, base, step: path)
        search = Search(Fitter(_off_by_its_rays(tmp_path / str(quiet))), mechanisms=[BY_ID["wall-reflectance"]])
        gains.append(search.singles()[0].evidence - search.nothing().evidence)
    assert gains[0] < 4.0
    assert gains[1] > 20.0


@pytest.mark.parametrize("stride", [9, 10, 13, 40])
def test_of_files_with_few_directions_nothing_is_told(stride: int) -> None:
    """Between gammas 22.5° apart rays are not told from images, and nothing is evened out."""
    assert (scatter(RAYS, BRIGHT, stride) == 0.0) == (3 * stride >= len(GAMMA_DEG))
    assert np.array_equal(_along_gamma(RAYS, BRIGHT, max(stride, 10)), RAYS)
    assert scatter_around(RAYS, BRIGHT, 72) == 0.0
