"""The subdivision of the sky: it tiles the hemisphere, and numbers patches as Radiance does."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from analysis.sky.patches import reinhart
from labdaq.directions import sky_vector
from tests.analysis.radiance_tools import HOME, numbers, radiance


@pytest.mark.parametrize(("k", "count"), [(1, 145), (2, 577), (3, 1297), (4, 2305)])
def test_patches_tile_the_hemisphere(k: int, count: int) -> None:
    patches = reinhart(k)
    assert patches.count == count
    assert np.isclose(patches.solid_angle_sr.sum(), 2 * np.pi, rtol=1e-12)
    assert np.isclose(patches.projected_sr.sum(), np.pi, rtol=1e-12)
    np.testing.assert_array_equal(patches.index(patches.vectors), np.arange(count))


def test_tregenza_starts_north_and_goes_east() -> None:
    sky = reinhart(1)
    assert sky.index(sky_vector(6.0, 0.0)) == 0
    assert sky.index(sky_vector(6.0, 12.0)) == 1
    assert sky.index(sky_vector(6.0, 359.0)) == 0
    assert sky.index(sky_vector(18.0, 0.0)) == 30
    assert sky.index(sky_vector(90.0, 0.0)) == 144
    assert sky.index(sky_vector(-1.0, 0.0)) == -1


@given(altitude=st.floats(0.0, 90.0), azimuth=st.floats(0.0, 360.0), k=st.sampled_from([1, 2, 4]))
def test_every_direction_is_near_the_middle_of_its_patch(altitude: float, azimuth: float, k: int) -> None:
    patches = reinhart(k)
    i = int(patches.index(sky_vector(altitude, azimuth)))
    assert abs(patches.altitude_deg[i] - altitude) <= patches.row_height_deg / 2 + 1e-6
    turn = abs((patches.azimuth_deg[i] - azimuth + 180.0) % 360.0 - 180.0)
    row = np.searchsorted(np.cumsum(patches.row_size), i, side="right")
    assert turn <= 180.0 / patches.row_size[row] + 1e-6


@pytest.mark.parametrize("k", [1, 2, 4])
def test_numbers_are_radiances_less_one(k: int, tmp_path: Path) -> None:
    assert (HOME / "lib" / "reinhart.cal").exists()
    rng = np.random.default_rng(7)
    d = rng.normal(size=(4000, 3))
    d /= np.linalg.norm(d, axis=1)[:, None]
    given_ = "\n".join("\t".join(f"{x:.12g}" for x in row) for row in d).encode()
    set_up = f"MF={k};Dx=$1;Dy=$2;Dz=$3"
    printed = radiance("rcalc", "-e", set_up, "-f", "reinhart.cal", "-e", "$1=rbin", given=given_, folder=tmp_path)
    bins = numbers(printed)[:, 0]
    assert len(bins) == len(d)
    np.testing.assert_array_equal(reinhart(k).index(d) + 1, bins)
