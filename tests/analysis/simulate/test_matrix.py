"""The matrix against direct runs."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from analysis.photometry import Distribution
from analysis.simulate import matrix as matrices
from analysis.simulate.daylight import daylight
from analysis.simulate.matrix import SkylightMatrix, skylight_matrix
from analysis.simulate.source import skies
from analysis.simulate.system import System, named
from analysis.simulate.tracer import Settings, trace
from labdaq.errors import ConfigError


@pytest.fixture(scope="module")
def matrix() -> SkylightMatrix:
    return skylight_matrix(named("box"), rays_per_patch=1500, threads=1)


def test_any_sky_is_a_product(matrix: SkylightMatrix) -> None:
    """An overcast sky varies little within a patch, so product and direct run differ by statistics only."""
    sky = daylight(50.0, 100.0, 12_000.0, 12_000.0, "overcast").sky
    product = matrix.predict(matrix.patch_luminances(sky), "near")[:-1]
    direct = trace(named("box"), skies([sky]), Settings(rays=400_000)).intensity(
        matrix.gamma_deg[None, :], matrix.c_deg[:-1, None], "near"
    )
    bright = direct.candela[0] > 0.05 * direct.candela[0].max()
    ratio = product[bright] / direct.candela[0][bright]
    assert np.mean(ratio) == pytest.approx(1.0, abs=0.01)
    of_direct = np.sqrt(np.mean((direct.uncertainty[0][bright] / direct.candela[0][bright]) ** 2))
    assert np.std(ratio) < 1.6 * np.hypot(matrix.error[1], of_direct)


def test_it_is_linear_and_takes_many_skies(matrix: SkylightMatrix) -> None:
    rng = np.random.default_rng(3)
    skies_ = rng.uniform(1e3, 1e4, (3, matrix.patch_count))
    together = matrix.predict(skies_)
    assert together.shape == (3, len(matrix.c_deg), len(matrix.gamma_deg))
    assert np.allclose(together[0] + together[1], matrix.predict(skies_[0] + skies_[1]))
    assert np.array_equal(together[:, 0], together[:, -1])


def test_reflectance_and_bounces_stay_free(matrix: SkylightMatrix) -> None:
    even = np.ones(matrix.patch_count)

    def flux(**changes: float) -> float:
        return Distribution(matrix.gamma_deg, matrix.c_deg, matrix.predict(even, **changes)).flux()  # type: ignore[arg-type]

    as_is, dull, cut = flux(), flux(wall_reflectance=0.8), flux(max_bounces=0)
    assert cut < dull < as_is
    sky = skies([lambda v: np.ones(v.shape[:-1])])
    bright, dark = (
        trace(named("box").with_settings({"wall.reflectance": r}), sky, Settings(rays=200_000)).flux()[0][0]
        for r in (0.95, 0.8)
    )
    assert as_is == pytest.approx(bright, rel=0.01)
    assert dull / as_is == pytest.approx(dark / bright, rel=0.005)


def test_wrong_number_of_patches_is_refused(matrix: SkylightMatrix) -> None:
    with pytest.raises(ConfigError, match="577"):
        matrix.predict(np.ones(577))


@pytest.mark.parametrize("traced", [False, pytest.param(True, marks=pytest.mark.slow)])
def test_it_is_kept_and_read_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, matrix: SkylightMatrix, traced: bool
) -> None:
    """What is kept is traced, or (in less time) the other tests' matrix with a gain for each seed."""

    seeds = []

    def made(_: System, __: int, ___: int, settings: Settings, *____: object) -> dict[str, NDArray[Any]]:
        seeds.append(settings.seed)
        arrays = {name: getattr(matrix, name) for name in ("near", "error", "flux", "flux_error", "nadir_error")}
        return arrays | {"far": settings.seed * matrix.far}

    if not traced:
        monkeypatch.setattr(matrices, "_traced", made)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    open_box = named("box").with_settings({"entry.kind": "clear", "exit.kind": "none"})
    first = skylight_matrix(open_box, rays_per_patch=100, threads=1)
    kept = list((tmp_path / "labdaq" / "matrices").iterdir())
    assert len(kept) == 1
    again = skylight_matrix(open_box, rays_per_patch=100, threads=1)
    assert np.array_equal(first.far, again.far)
    kept[0].write_bytes(b"broken")  # a cache that cannot be read costs time, never the result
    assert np.array_equal(skylight_matrix(open_box, rays_per_patch=100, threads=1).far, first.far)
    assert not np.array_equal(skylight_matrix(open_box, rays_per_patch=100, seed=2, threads=1).far, first.far)
    assert traced or seeds == [1, 1, 2]  # the second time it was read
