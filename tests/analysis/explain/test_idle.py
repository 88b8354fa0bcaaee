"""Variants that change nothing but rays are no way in which anything acts, and say what the prediction has."""

from pathlib import Path
from typing import Any
from zlib import crc32

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

from analysis.explain.mechanisms.catalogue import BY_ID
from tests.analysis.explain.campaign import Floats, Sky, sun_part
from tests.analysis.explain.test_case_variants import Run, described, times, varied, wider
from tests.analysis.explain.test_ray_noise import MORE, TRUE, again


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


@pytest.mark.parametrize(("run", "alike"), [(times(0.9), True), (again("a"), False)])
def test_walls_are_changed_alike_only_where_each_run_changes_something(tmp_path: Path, run: Run, alike: bool) -> None:
    box = ("wall-reflectance", {"wall_reflectance": 0.85}, times(0.9), "box")
    scene = varied(
        tmp_path / "c", box, ("wall-reflectance", {"wall_reflectance": 0.9}, run, "tube"), system=described(0.95, 0.98)
    )
    assert scene.retraced is not None
    labels = [path.label for path in scene.retraced.case_paths["wall-reflectance"]]
    assert ("case's variants of all walls" in labels) == alike
