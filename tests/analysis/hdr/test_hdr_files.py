"""Reading exposures: exposure data, levels, and damaged files."""

from pathlib import Path

import cv2
import numpy as np
import pytest
import rawpy
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from analysis.hdr.exif import Exif, read_exif
from analysis.hdr.frames import read_frame
from analysis.hdr.times import LABELS_S, read_times, step_of
from labdaq.errors import DataError
from tests.analysis.hdr.camera import raw_codes
from tests.analysis.hdr.dng_writer import XYZ_TO_CAMERA, write_dng
from tests.analysis.recordings import recording


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> dict[str, bytes]:
    folder = tmp_path_factory.mktemp("files")
    rng = np.random.default_rng(0)
    write_dng(folder / "a.dng", raw_codes(10 ** rng.uniform(0, 3, (40, 60)), 1.0, rng), 1 / 60)
    picture = rng.integers(0, 255, (40, 60, 3)).astype(np.uint8)
    for name in ("a.jpg", "a.png", "a.tif"):
        assert cv2.imwrite(str(folder / name), picture)
    return {path.suffix: path.read_bytes() for path in folder.iterdir()}


def test_a_dng_comes_back_bit_for_bit_with_its_meaning(tmp_path: Path) -> None:
    rng = np.random.default_rng(1)
    codes = raw_codes(10 ** rng.uniform(0, 4, (64, 96)), 1.0, rng)
    write_dng(tmp_path / "a.dng", codes, 1 / 60, black=64, white=4095)
    frame = read_frame(tmp_path / "a.dng")
    np.testing.assert_array_equal(frame.codes, codes)
    assert frame.sensor is not None
    assert np.all(frame.sensor.black == 64)
    assert frame.sensor.white == 4095
    np.testing.assert_array_equal(frame.sensor.colours, [[0, 1], [1, 2]])
    np.testing.assert_allclose(frame.sensor.xyz_to_camera, XYZ_TO_CAMERA, atol=1e-6)
    exif = read_exif(tmp_path / "a.dng")
    assert exif.exposure_s == pytest.approx(1 / 60, rel=1e-6)
    assert (exif.f_number, exif.iso, exif.model) == (5.6, 100.0, "test camera")


def test_frames_are_not_brightened_each_by_its_own_maximum(tmp_path: Path) -> None:
    # LibRaw's developed pictures are: a frame with its maximum at 78 % of white comes out 29 % brighter (measured)
    flat = np.full((64, 64), 1000, np.uint16)
    bright = flat.copy()
    bright[0, 0] = 3200
    developed = []
    for name, codes in (("flat.dng", flat), ("bright.dng", bright)):
        write_dng(tmp_path / name, codes, 1.0)
        assert np.median(read_frame(tmp_path / name).codes) == 1000
        with rawpy.imread(str(tmp_path / name)) as raw:
            options = {"gamma": (1, 1), "no_auto_bright": True, "output_bps": 16, "use_camera_wb": False}
            developed.append(float(np.median(raw.postprocess(**options))))
    assert developed[1] > 1.2 * developed[0]  # the trap is still there, and not stepped into


@pytest.mark.parametrize("suffix", [".dng", ".jpg", ".png", ".tif"])
@given(share=st.floats(0.0, 0.985))
@settings(max_examples=25, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_a_truncated_file_is_one_clear_error(
    suffix: str, share: float, files: dict[str, bytes], tmp_path_factory: pytest.TempPathFactory
) -> None:
    whole = files[suffix]
    path = tmp_path_factory.getbasetemp() / f"cut{suffix}"
    path.write_bytes(whole[: int(len(whole) * share)])
    with pytest.raises(DataError, match=f"cut{suffix}") as caught:
        read_frame(path)
    assert "\n" not in caught.value.message


def test_foreign_and_absent_files_are_named(tmp_path: Path) -> None:
    (tmp_path / "note.dng").write_text("not a picture at all")
    (tmp_path / "note.jpg").write_text("neither")
    for name in ("note.dng", "note.jpg", "gone.png"):
        with pytest.raises(DataError, match=name):
            read_frame(tmp_path / name)
    assert read_exif(tmp_path / "note.dng") == Exif()


def test_the_real_canon_files_tell_their_times() -> None:
    folder = recording("fisheye-bracket") / "JPEG"
    exifs = [read_exif(path) for path in sorted(folder.glob("*.JPG"))]
    assert len(exifs) == 18
    assert [e.exposure_s for e in exifs[:3]] == [13.0, 6.0, 3.2]
    assert exifs[-1].exposure_s == 1 / 8000
    assert {(e.f_number, e.iso) for e in exifs} == {(5.6, 100.0)}
    # OpenCV finds the same block
    path = sorted(folder.glob("*.JPG"))[0]
    _, kinds, blocks = cv2.imreadWithMetadata(str(path), flags=cv2.IMREAD_REDUCED_COLOR_8)
    assert b"Canon EOS 5D Mark II" in bytes(np.asarray(blocks[list(kinds).index(0)]).ravel())


def test_the_real_dng_has_its_levels_and_matrix() -> None:
    frame = read_frame(recording("raw/colorchart.dng"))
    assert frame.sensor is not None
    assert (frame.sensor.white, frame.sensor.black[0, 0]) == (15000.0, 2056.0)
    assert frame.sensor.dark is not None
    assert abs(frame.sensor.dark - 2056.0) < 12.0  # the covered rim agrees with what the file says to 0.1 % of white
    assert frame.sensor.xyz_to_camera[0, 0] == pytest.approx(0.6461)


@pytest.mark.parametrize(
    ("label", "step"), [(1 / 60, 2.0**-6), (1 / 125, 2.0**-7), (15.0, 16.0), (0.3, 2 ** (-5 / 3)), (6.0, 2 ** (8 / 3))]
)
def test_labels_stand_for_exact_steps(label: float, step: float) -> None:
    assert step_of(label) == pytest.approx(step, rel=1e-12)


def test_every_label_is_within_7_percent_of_its_step_and_others_stay() -> None:
    for label in LABELS_S:
        assert abs(step_of(label) / label - 1.0) < 0.07
    for time in (0.0172, 1 / 64, 0.0111, 7.1):
        assert step_of(time) == pytest.approx(time, rel=0.011)


def test_a_times_file_is_read_whole_or_refused_whole(tmp_path: Path) -> None:
    path = tmp_path / "times.txt"
    path.write_text("32\n1/4 # quarter\n\n2.5e-4 s\n")
    assert read_times(path) == [32.0, 0.25, 2.5e-4]
    path.write_text("32\n-1\nfast\n1/0\n")
    with pytest.raises(DataError) as caught:
        read_times(path)
    for line in ("line 2", "line 3", "line 4"):
        assert line in str(caught.value)
    path.write_text("# nothing\n")
    with pytest.raises(DataError, match="no exposure time"):
        read_times(path)
