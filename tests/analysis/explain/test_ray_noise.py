"""The rays of the case's simulation scatter; variants that change nothing tell how, and gain nothing by it."""

from pathlib import Path
from typing import Any
from zlib import crc32

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

from analysis.explain.mechanisms.catalogue import BY_ID
from analysis.explain.ray_noise import USUAL, ray_noise
from tests.analysis.explain.campaign import Floats, Sky, sun_part
from tests.analysis.explain.test_case_variants import Run, times, turned, varied, wider

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


@pytest.mark.parametrize("run", [again("a"), sun_part])
def test_a_pattern_that_changes_nothing_but_rays_was_not_lacking(tmp_path: Path, run: Run) -> None:
    scene = varied(tmp_path / "c", ("lens-anisotropy", {"isotropic": False}, run, ""))
    assert scene.retraced is not None
    assert not scene.retraced.lacks
    assert scene.retraced.has == {"lens-anisotropy"}, "another pattern changes nothing: there was one"
    assert not scene.retraced.case_paths


@pytest.mark.parametrize(
    ("mechanism", "setting"), [("lens-anisotropy", {"isotropic": True}), ("near-field", {"field": "far"})]
)
@pytest.mark.parametrize(("run", "had"), [(again("a"), False), (sun_part, False), (wider, True)])
def test_what_takes_away_nothing_but_rays_was_not_there(
    tmp_path: Path, mechanism: str, setting: dict[str, Any], run: Run, had: bool
) -> None:
    scene = varied(tmp_path / "c", (mechanism, setting, run, ""), simulation={"field": "far"})
    assert scene.retraced is not None
    assert scene.retraced.has == ({mechanism} if had else set())
    assert not scene.retraced.case_paths


@pytest.mark.parametrize(("size", "idle"), [(0.006, True), (0.03, False)])
def test_rays_that_were_smoothed_are_still_rays_where_they_change_little(
    tmp_path: Path, size: float, idle: bool
) -> None:
    def smoothed(t: Sky, gamma: Floats, c: Floats) -> Floats:
        image = sun_part(t, gamma, c)
        grains = np.random.default_rng(crc32(t.id.encode())).normal(size=image.shape)
        wide = gaussian_filter(grains, 3.0, mode="wrap")
        return np.asarray(image * (1.0 + size * wide / wide.std()))

    scene = varied(tmp_path / "c", ("lens-anisotropy", {"isotropic": False}, smoothed, ""))
    assert scene.retraced is not None
    assert bool(scene.retraced.lacks) != idle


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


@pytest.mark.parametrize(("limit", "why"), [(0, "no variant"), (60, "another limit of bounces"), (100, "no variant")])
def test_half_of_a_variant_that_changes_nothing_is_no_way(tmp_path: Path, limit: int, why: str) -> None:
    """It would halve the variance of the prediction's rays; and where the limit was another one, nothing is missing."""
    runs = ("bounce-truncation", MORE, again("a"), ""), ("near-field", TRUE, again("b"), "")
    scene = varied(tmp_path / "c", *runs, simulation={"max_bounces": limit})
    assert why in BY_ID["bounce-truncation"].why_not(scene)
    assert scene.retraced is not None
    assert scene.retraced.has == {"near-field"} | ({"bounce-truncation"} if limit == 60 else set())


def test_a_variant_with_less_light_than_the_prediction_is_no_way(tmp_path: Path) -> None:
    """The real light has no limit."""
    fewer, more = ("bounce-truncation", {"max_bounces": 4}), ("bounce-truncation", {"max_bounces": 50})
    alone = varied(tmp_path / "alone", (*fewer, times(0.8), ""))
    beside = varied(tmp_path / "beside", (*fewer, times(0.8), ""), (*more, times(1.1), ""))
    limits = BY_ID["bounce-truncation"]
    assert limits.branches(alone) == ()
    assert {b.label.split(",")[0] for b in limits.branches(beside)} == {"case's variant max_bounces = 50"}
