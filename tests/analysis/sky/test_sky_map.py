"""The sky map: exact integrals, the right way up, and files other programs read."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from analysis.hdr.radiance_picture import SKY_VIEW
from analysis.sky.map import SkyMap
from analysis.sky.patches import reinhart
from analysis.sky.perez import PerezSky
from analysis.sky.pixels import directions_at, pixel_moments, places_of
from labdaq.directions import sky_vector, vector
from labdaq.errors import DataError
from tests.analysis.radiance_tools import numbers, radiance

PEREZ = PerezSky.from_illuminances(80_000.0, 20_000.0, 45.0, 95.0)


@pytest.mark.parametrize("n", [16, 33, 128, 500])
def test_a_uniform_sky_gives_pi_times_its_luminance(n: int) -> None:
    sky = SkyMap.of(np.full((n, n), 5000.0))
    assert sky.horizontal_illuminance() == pytest.approx(np.pi * 5000.0, rel=1e-12)
    assert sky.solid_angle_sr.sum() == pytest.approx(2 * np.pi, rel=1e-12)
    # a plane tilted by t sees pi (1 + cos t) / 2; pixels the plane cuts through cost (cell size)² / 8 or so
    for tilt in (30.0, 60.0, 90.0):
        normal = sky_vector(90.0 - tilt, 77.0)
        expected = np.pi * 5000.0 * (1 + np.cos(np.radians(tilt))) / 2
        assert sky.illuminance(normal) == pytest.approx(expected, rel=1.0 / n**2)


@given(n=st.integers(2, 40), i=st.integers(0, 39), j=st.integers(0, 39))
@settings(max_examples=40, deadline=None)
def test_a_pixels_moments_are_those_of_many_points_in_it(n: int, i: int, j: int) -> None:
    i, j = i % n, j % n
    m = 300
    part = (np.arange(m) + 0.5) / m
    d = directions_at(i + part[:, None], j + part[None, :], n)
    theta = np.arccos(d[..., 2])
    share = np.where(d[..., 2] > 0.0, np.sinc(theta / np.pi) * (np.pi / n / m) ** 2, 0.0)
    area, moment = pixel_moments(n)
    # points on the horizon's curve are counted whole or not at all: a strip of 1 / m of the pixel
    allowed = (np.pi / n) ** 2 * 2.0 / m if 0.0 < share.astype(bool).mean() < 1.0 else (np.pi / n) ** 2 * 1e-4
    assert area[i, j] == pytest.approx(share.sum(), abs=allowed)
    np.testing.assert_allclose(moment[i, j], np.sum(share[..., None] * d, axis=(0, 1)), atol=allowed)


@given(altitude=st.floats(0.0, 90.0), azimuth=st.floats(0.0, 360.0), n=st.integers(2, 2000))
def test_places_and_directions_are_inverse(altitude: float, azimuth: float, n: int) -> None:
    d = sky_vector(altitude, azimuth)
    row, column = places_of(d, n)
    np.testing.assert_allclose(directions_at(row, column, n), d, atol=1e-12)


def test_north_is_at_the_top_and_east_at_the_left() -> None:
    n = 101
    for azimuth, (row, column) in {0.0: (0, 50), 90.0: (50, 0), 180.0: (100, 50), 270.0: (50, 100)}.items():
        y, x = places_of(sky_vector(0.5, azimuth), n)
        assert (int(y), int(x)) == (row, column)
    # C runs the other way round than azimuth: C = 90 is west
    assert int(places_of(vector(90.5, 90.0), n)[1]) == 100


def test_radiances_own_view_has_the_same_pixels() -> None:
    n = 40
    rays = numbers(radiance("vwrays", "-fa", "-x", f"{n}", "-y", f"{n}", *SKY_VIEW.split()))
    d = rays[:, 3:].reshape(n, n, 3)
    inside = np.linalg.norm(d, axis=-1) > 0.5  # vwrays gives no direction outside the circle
    middle = np.arange(n) + 0.5
    ours = directions_at(middle[:, None], middle[None, :], n)
    assert inside.sum() > 0.75 * n * n
    np.testing.assert_allclose(ours[inside], d[inside], atol=2e-6)  # printed with six figures


def test_radiance_lights_the_same_side_of_the_picture(tmp_path: Path) -> None:
    # an eastern glow, rendered by rpict in our view: the left half of the picture must be bright, in the map too
    (tmp_path / "east.rad").write_text(
        "void brightfunc east\n2 bright east.cal\n0\n0\n\n"
        "east glow g\n0\n0\n4 1 1 1 0\n\ng source s\n0\n0\n4 0 0 1 180\n"
    )
    (tmp_path / "east.cal").write_text("bright = if(Dx, 10 * Dx, 0.1);\n")
    (tmp_path / "east.oct").write_bytes(radiance("oconv", "east.rad", folder=tmp_path))
    (tmp_path / "east.hdr").write_bytes(
        radiance(
            "rpict", *SKY_VIEW.split(), "-x", "64", "-y", "64", "-ab", "0", "-ps", "1", "east.oct", folder=tmp_path
        )
    )
    rendered = SkyMap.from_picture(tmp_path / "east.hdr")
    expected = SkyMap.from_function(lambda d: 179.0 * np.where(d[..., 0] > 0, 10 * d[..., 0], 0.1), 64)
    assert rendered.illuminance([1, 0, 0]) > 50 * rendered.illuminance([-1, 0, 0])
    # rpict leaves pixels on the horizon black when their middle is below it: about 1 % of this light
    assert rendered.illuminance([1, 0, 0]) == pytest.approx(expected.illuminance([1, 0, 0]), rel=2e-2)


@pytest.mark.parametrize("n", [64, 128, 512])
def test_a_perez_sky_keeps_its_illuminance_and_its_luminance(n: int) -> None:
    sky = SkyMap.from_function(PEREZ.luminance, n)
    # nine points a pixel: the cusp at the sun is what is left
    assert sky.horizontal_illuminance() == pytest.approx(20_000.0, rel=1.0 / n**2 * 3)
    rng = np.random.default_rng(1)
    d = rng.normal(size=(5000, 3))
    d[:, 2] = np.abs(d[:, 2])
    d /= np.linalg.norm(d, axis=1)[:, None]
    error = sky.at(d) / PEREZ.luminance(d) - 1.0
    assert np.sqrt(np.mean(error**2)) < 30.0 / n**2  # second order in the pixel's size


def test_luminance_at_the_horizon_below_it_and_in_a_hole() -> None:
    sky = SkyMap.of(np.full((64, 64), 7.0))
    ring = sky_vector(0.0, np.linspace(0.0, 360.0, 1000))
    ring[:, 2] = 0.0
    np.testing.assert_allclose(sky.at(ring), 7.0)
    assert sky.at(sky_vector(-0.1, 10.0)) == 0.0
    hole = sky.masked(sky.near([0, 0, 1], 10.0))
    assert np.isnan(hole.at([0.0, 0.0, 1.0]))
    filled = hole.filled(SkyMap.of(np.full((64, 64), 3.0)))
    assert filled.at([0.0, 0.0, 1.0]) == 3.0
    assert filled.known.sum() == sky.known.sum()


def test_masks_add_up() -> None:
    sky = SkyMap.from_function(PEREZ.luminance, 128)
    cap = sky.near(sky_vector(45.0, 95.0), 20.0)
    inside, outside = sky.horizontal_illuminance(cap), sky.masked(cap).horizontal_illuminance()
    assert inside + outside == pytest.approx(sky.horizontal_illuminance(), rel=1e-12)
    assert sky.solid_angle_sr[cap].sum() == pytest.approx(2 * np.pi * (1 - np.cos(np.radians(20.0))), rel=5e-3)


@pytest.mark.parametrize(("n", "k"), [(64, 1), (128, 4), (512, 4)])
def test_patch_means_are_those_of_the_sky(n: int, k: int) -> None:
    patches = reinhart(k)
    np.testing.assert_allclose(SkyMap.of(np.full((n, n), 4.0)).patch_means(patches), 4.0)
    # a luminance linear in the height over the horizon has patch means known in closed form
    means = SkyMap.from_function(lambda d: 1000.0 * d[..., 2], n).patch_means(patches)
    exact = 1000.0 * patches.projected_sr / patches.solid_angle_sr
    # patch edges lie within 1/16 pixel of where the sub-pixels put them, in rows of height 12 / k degrees
    np.testing.assert_allclose(means, exact, atol=1000.0 * 2.0 / n)
    sky = SkyMap.from_function(PEREZ.luminance, n)
    total = float(np.sum(sky.patch_means(patches) * patches.solid_angle_sr))
    assert total == pytest.approx(float(np.sum(sky.luminance * sky.solid_angle_sr)), rel=2e-3)


def test_the_master_comes_back_and_evalglare_reads_the_picture(tmp_path: Path) -> None:
    sky = SkyMap.from_function(PEREZ.luminance, 256, record={"made by": "Perez", "lx": 20_000.0})
    sky = sky.masked(sky.near([0, 0, 1], 5.0))
    sky.save(tmp_path / "map.npz")
    again = SkyMap.load(tmp_path / "map.npz")
    np.testing.assert_allclose(again.luminance, sky.luminance, rtol=6e-8)  # 32-bit floats
    np.testing.assert_array_equal(again.known, sky.known)
    assert again.record == sky.record
    sky.save_picture(tmp_path / "map.hdr")
    # evalglare sums pixel middles (1e-4 at this size) of 8-bit mantissas (unbiased)
    seen = float(
        radiance("evalglare", "-V", "map.hdr", folder=tmp_path, ends=1).split()[0]
    )  # it ends with 1 when all is well
    assert seen == pytest.approx(sky.horizontal_illuminance(), rel=3e-4)
    assert SkyMap.from_picture(tmp_path / "map.hdr").horizontal_illuminance() == pytest.approx(seen, rel=3e-4)
    assert sorted(p.name for p in tmp_path.iterdir()) == ["map.hdr", "map.npz"]


def test_what_is_no_map_is_refused(tmp_path: Path) -> None:
    with pytest.raises(DataError, match="square"):
        SkyMap(np.zeros((3, 4)), np.zeros((3, 4), dtype=bool))
    with pytest.raises(DataError, match="finite"):
        SkyMap.of(np.full((4, 4), np.nan))
    (tmp_path / "map.npz").write_bytes(b"PK\x03\x04 not quite")
    with pytest.raises(DataError, match=r"map\.npz"):
        SkyMap.load(tmp_path / "map.npz")
