"""Radiance pictures: read by Radiance's own tools as they were meant, and the other way round."""

from pathlib import Path

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from analysis.hdr.radiance_picture import (
    SKY_VIEW,
    decode_rgbe,
    encode_rgbe,
    read_picture,
    write_luminance,
    write_rgb,
)
from labdaq.errors import DataError
from tests.analysis.radiance_tools import numbers, radiance
from tests.analysis.recordings import recording


@given(arrays.arrays(np.float64, (5, 3), elements=st.floats(0.0, 1e9)))
@settings(max_examples=200)
def test_codes_are_within_half_a_step(rgb: np.ndarray) -> None:
    again = decode_rgbe(encode_rgbe(rgb))
    brightest = rgb.max(axis=-1, keepdims=True)
    step = np.where(brightest > 1e-31, np.exp2(np.floor(np.log2(np.maximum(brightest, 1e-300))) + 1.0 - 8.0), 1e-31)
    assert np.all(np.abs(again - rgb) <= step / 2.0 * (1.0 + 1e-12))


def test_luminance_arrives_in_radiance_without_bias(tmp_path: Path) -> None:
    rng = np.random.default_rng(0)
    luminance = 10 ** rng.uniform(-2.0, 6.0, (50, 70))
    write_luminance(tmp_path / "a.hdr", luminance, view=SKY_VIEW, comments=("MADE_BY= a test",))
    # pvalue's brightness is in W/sr/m², by its own weights; 179 lm/W
    printed = numbers(radiance("pvalue", "-h", "-H", "-b", "-d", "a.hdr", folder=tmp_path))[:, -1]
    seen = printed.reshape(50, 70) * 179.0
    error = seen / luminance - 1.0
    assert np.max(np.abs(error)) < 0.0045  # half a step of 1/128, and the four figures pvalue prints
    assert abs(float(np.mean(error))) < 3e-4  # rounding to the nearest m / 256 would make this 0.28 %
    again = read_picture(tmp_path / "a.hdr")
    np.testing.assert_allclose(again.luminance, seen, rtol=2e-3)
    assert again.view == SKY_VIEW
    assert "MADE_BY= a test" in again.header
    assert radiance("getinfo", "-d", "a.hdr", folder=tmp_path).split()[-4:] == [b"-Y", b"50", b"+X", b"70"]
    # OpenCV reads it too, with its own idea of a mantissa
    assert np.max(np.abs(cv2.imread(str(tmp_path / "a.hdr"), -1)[..., 1] * 179.0 / luminance - 1.0)) < 0.008


def test_colour_goes_through_radiances_tools(tmp_path: Path) -> None:
    rng = np.random.default_rng(1)
    rgb = 10 ** rng.uniform(-1.0, 2.0, (16, 24, 3))
    write_rgb(tmp_path / "a.hdr", rgb)
    # pcomb decodes and writes run length codes; its copy must read the same
    (tmp_path / "b.hdr").write_bytes(radiance("pcomb", "-o", "a.hdr", folder=tmp_path))
    ours, theirs = read_picture(tmp_path / "a.hdr").rgb, read_picture(tmp_path / "b.hdr").rgb
    np.testing.assert_allclose(ours, theirs, rtol=1e-12)


def test_the_exposure_is_divided_out(tmp_path: Path) -> None:
    write_luminance(tmp_path / "a.hdr", np.full((16, 16), 1000.0))
    (tmp_path / "b.hdr").write_bytes(
        radiance("pfilt", "-1", "-e", "4", "-x", "16", "-y", "16", "a.hdr", folder=tmp_path)
    )
    text = (tmp_path / "b.hdr").read_bytes()
    assert b"EXPOSURE=" in text
    assert float(read_picture(tmp_path / "b.hdr").luminance.mean()) == pytest.approx(1000.0, rel=0.01)


def test_a_real_picture_of_another_pipeline() -> None:
    picture = read_picture(recording("fisheye-bracket/pipeline-output-1000x1000.hdr"))
    assert picture.rgb.shape == (1000, 1000, 3)
    assert picture.view == "-vta -vv 180 -vh 180"
    assert float(np.max(picture.luminance)) > 1e4


@pytest.mark.parametrize(
    ("change", "complaint"),
    [
        (lambda data: data[: len(data) // 2], "cut short"),
        (lambda data: data.replace(b"#?RADIANCE", b"P6 no such"), "Radiance"),
        (lambda data: data.replace(b"rgbe", b"xyze"), "FORMAT"),
        (lambda data: data.replace(b"-Y 16 +X 24", b"+X 24 -Y 16"), "resolution"),
    ],
)
def test_damaged_pictures_are_refused(change: object, complaint: str, tmp_path: Path) -> None:
    assert callable(change)
    write_luminance(tmp_path / "a.hdr", np.full((16, 24), 10.0))
    (tmp_path / "a.hdr").write_bytes(change((tmp_path / "a.hdr").read_bytes()))
    with pytest.raises(DataError, match=complaint):
        read_picture(tmp_path / "a.hdr")


@given(data=st.binary(max_size=300))
@settings(max_examples=150, deadline=None)
def test_garbage_after_a_good_header_is_an_error_or_a_picture(
    data: bytes, tmp_path_factory: pytest.TempPathFactory
) -> None:
    path = tmp_path_factory.getbasetemp() / "garbage.hdr"
    path.write_bytes(b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 4 +X 16\n" + data)
    try:
        picture = read_picture(path)
    except DataError:
        return
    assert picture.rgb.shape == (4, 16, 3)


def test_nothing_is_written_when_a_value_is_no_number(tmp_path: Path) -> None:
    bad = np.ones((4, 4))
    bad[1, 1] = np.nan
    with pytest.raises(DataError, match="finite"):
        write_luminance(tmp_path / "a.hdr", bad)
    assert not list(tmp_path.iterdir())
