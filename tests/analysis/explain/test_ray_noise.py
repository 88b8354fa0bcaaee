"""The rays of the case's simulation scatter; variants that change nothing tell how."""

from dataclasses import replace
from pathlib import Path
from zlib import crc32

import numpy as np
import pytest

from analysis.explain.fields import C_DEG, GAMMA_DEG, Fields
from analysis.explain.fit import Fitter
from analysis.explain.mechanisms.catalogue import BY_ID
from analysis.explain.ray_noise import USUAL, _evened, own_rays, ray_noise
from analysis.explain.sampler import Sampler
from analysis.explain.scene import Scene
from analysis.explain.search import Search
from analysis.explain.shared_error import SharedError, shared_error
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


def _scattered(folder: Path, sd: float) -> tuple[Scene, Floats]:
    """A case whose files and records hold rays that the recording does not; and by how much each record does."""
    scene = varied(folder)
    r, rng = scene.readings, np.random.default_rng(5)
    errors = sd * rng.standard_normal((len(r.case.tests), len(C_DEG), len(GAMMA_DEG)))
    errors[:, :, 0] = errors[:, :1, 0]
    noisy = Fields(scene.fields.sun * np.exp(errors), scene.fields.sky * np.exp(errors))
    at = Sampler(r.test, r.gamma_deg, r.c_deg)
    seen = at(noisy.total) / at(scene.fields.total)
    other = replace(r, simulated=r.simulated * seen, sun=r.sun * seen, sky=r.sky * seen)
    made = Scene(other)
    made.__dict__["fields"] = noisy
    return made, np.asarray(seen - 1.0)


def test_a_file_s_directions_tell_what_its_rays_have_wrong(tmp_path: Path) -> None:
    """Each against its neighbours in gamma: half of the variance; smooth images have none."""
    scene, errors = _scattered(tmp_path / "c", 0.012)
    r = scene.readings
    (effect,) = own_rays(scene).T
    inside = (r.gamma_deg > 2.0) & (r.gamma_deg < 80.0)
    assert np.corrcoef(effect[inside], -errors[inside])[0, 1] > 0.6
    assert own_rays(_scattered(tmp_path / "smooth", 0.0)[0]).shape[1] == 0


def test_what_evens_out_a_prediction_s_rays_gains_nothing_by_that(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A recording that differs by the prediction's rays alone: an arm that points between two directions has less."""
    scene, _ = _scattered(tmp_path / "c", 0.02)
    gains = []
    for knows in (True, False):
        if not knows:
            monkeypatch.setattr("analysis.explain.fit.own_rays", lambda scene: np.zeros((len(scene.readings), 0)))
        search = Search(Fitter(_again_begun(scene)), mechanisms=[BY_ID["gamma-offset"]], conjectures=())
        gains.append(search.singles()[0].evidence - search.nothing().evidence)
    assert gains[0] < 6.0 < gains[1]


def _again_begun(scene: Scene) -> Scene:
    """The same scene with nothing worked out yet."""
    other = replace(scene, memory={}, lit={}, of_rows={})
    other.__dict__["fields"] = scene.fields
    return other


def test_other_tests_are_predicted_without_the_rays_that_were_seen(tmp_path: Path) -> None:
    """What the fitted tests say of their files' rays holds for the same simulation's other files."""
    scene, errors = _scattered(tmp_path / "c", 0.02)
    fitter = Fitter(scene)
    nothing = Search(fitter, mechanisms=[], conjectures=()).nothing()
    shared = shared_error(fitter, nothing.fit.residual, nothing.fit.hyper)
    assert 0.2 < shared.rays < 1.2  # what a lens has wrong, as blurs of the same files, takes some of it
    told = SharedError.of(shared.told())
    assert told.rays == pytest.approx(shared.rays, abs=1e-3)
    inside = (scene.readings.gamma_deg > 2.0) & (scene.readings.gamma_deg < 80.0)
    left, without = (np.std((errors + x.at(scene))[inside]) for x in (told, replace(told, rays=0.0)))
    assert left < 0.85 * np.std(errors[inside])
    assert left < without
    assert SharedError.of({k: v for k, v in shared.told().items() if k != "rays"}).rays == 0.0


def test_sharp_images_are_no_rays() -> None:
    """Off parabolas through five directions, too, but neighbours alike."""
    rng = np.random.default_rng(2)
    gamma, c = np.meshgrid(GAMMA_DEG, C_DEG)
    images = 1.0 + 8.0 * np.exp(-0.5 * (((gamma - 31.0) / 3.5) ** 2 + ((c - 120.0) / 25.0) ** 2))
    images += 5.0 * np.exp(-0.5 * (((gamma - 52.0) / 3.5) ** 2 + ((c - 200.0) / 25.0) ** 2))
    rough = images * np.exp(0.01 * rng.standard_normal(images.shape))
    evened = [_evened(field[None], 1, 1)[0] for field in (images, rough)]
    assert np.array_equal(evened[0], images)
    off = [np.std(np.log(field / images)[:, 3:-3]) for field in (evened[1], rough)]
    assert off[0] < off[1]
