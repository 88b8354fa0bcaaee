"""The rays of the case's simulation scatter; variants that change nothing tell how."""

from pathlib import Path
from zlib import crc32

import numpy as np
import pytest

from analysis.explain.fit import Fitter
from analysis.explain.ray_noise import USUAL, ray_noise
from analysis.explain.search import Search
from tests.analysis.explain.campaign import Floats, Sky, sun_part
from tests.analysis.explain.test_case_variants import Run, turned, varied, wider

SD = 0.012


def rays(test: Sky, run: str, shape: tuple[int, ...]) -> Floats:
    """Relative errors of the rays of one run."""
    return SD * np.random.default_rng(crc32(f"{run} {test.id}".encode())).normal(size=shape)


def again(run: str, common: str = "baseline") -> Run:
    """The simulation that the case predicts with, with other rays: what its own had too much is missing here."""

    def seen(t: Sky, gamma: Floats, c: Floats) -> Floats:
        image = sun_part(t, gamma, c)
        return np.asarray(image * (1.0 + rays(t, run, image.shape) - rays(t, common, image.shape)))

    return seen


MORE, TRUE = {"max_bounces": 100}, {"distance_m": 2.6}


def test_runs_with_other_rays_tell_what_the_prediction_s_rays_have_wrong(tmp_path: Path) -> None:
    scene = varied(tmp_path / "c", ("bounce-truncation", MORE, again("a"), ""), ("near-field", TRUE, again("b"), ""))
    r, effects = scene.readings, ray_noise(scene)
    systems = {t.system for t in r.case.tests}
    assert effects.shape == (len(r), len(systems))
    assert np.all(np.count_nonzero(effects, axis=1) == 1), "each reading below its own system"
    share = np.sqrt(np.mean((r.sun / r.simulated) ** 2))  # the sky part's rays scatter nothing here
    assert np.std(effects.sum(axis=1)) == pytest.approx(USUAL * SD * np.sqrt(1.5) * share, rel=0.3)


def test_what_scatters_alone_or_changes_something_is_no_ray_noise(tmp_path: Path) -> None:
    one = varied(tmp_path / "one", ("bounce-truncation", MORE, again("a"), ""))
    apart = varied(
        tmp_path / "apart",
        ("bounce-truncation", MORE, again("a", "c"), ""),
        ("near-field", TRUE, again("b", "d"), ""),
    )
    smooth = varied(
        tmp_path / "smooth",
        ("lens-orientation", {"rotation_deg": 20.0}, turned, ""),
        ("circumsolar-aureole", {"fraction": 0.05, "width_deg": 5.0}, wider, ""),
    )
    told = varied(tmp_path / "told", ("bounce-truncation", MORE, again("a"), ""), ("near-field", TRUE, again("a"), ""))
    assert [ray_noise(scene).shape[1] for scene in (one, apart, smooth, told)] == [0, 0, 0, 0]


def test_the_rays_that_such_runs_show_are_no_scatter_of_the_readings(tmp_path: Path) -> None:
    """A recording that is off by the prediction's own rays alone is likelier with them than as scatter."""
    runs = ("bounce-truncation", MORE, again("a"), ""), ("near-field", TRUE, again("b"), "")
    scene = varied(tmp_path / "c", *runs)
    r = scene.readings
    object.__setattr__(r, "measured", r.measured * (1.0 + 0.7 * ray_noise(scene).sum(axis=1)))
    with_them = Search(Fitter(scene)).nothing().evidence
    scene.memory.clear()
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("analysis.explain.fit.ray_noise", lambda scene: np.zeros((len(scene.readings), 0)))
        assert with_them > 20.0 + Search(Fitter(scene)).nothing().evidence
