"""Sessions become skies and photometry: against a world known in closed form, and through others' readers."""

import hashlib
import os
import shutil
import signal
import subprocess
import sys
import threading
from pathlib import Path

import cv2
import numpy as np
import pytest

from analysis.photometry.lm63 import read_lm63
from analysis.process.camera import lens_of
from analysis.process.session import process_session
from analysis.sky.map import SkyMap
from labdaq.directions import angle_between, sky_vector
from labdaq.equipment import Camera
from labdaq.errors import DataError
from labdaq.records import TakenReading
from labdaq.seal import verify
from labdaq.session import Session
from tests.analysis.process.recorded import again, take_few, take_whole, world
from tests.analysis.radiance_tools import numbers, radiance

LUMENS_PER_WATT = 179.0  # of Radiance pictures, by convention


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The report's test, processed."""
    path = take_whole(tmp_path_factory.mktemp("sessions"))
    process_session(path)
    return path


@pytest.fixture(scope="module")
def few(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A short session, not processed."""
    return take_few(tmp_path_factory.mktemp("few"))


def recorded(path: Path) -> dict[str, str]:
    files = [p for p in sorted(path.rglob("*")) if p.is_file() and "derived" not in p.relative_to(path).parts]
    return {str(p.relative_to(path)): hashlib.sha256(p.read_bytes()).hexdigest() for p in files}


def account(path: Path) -> dict:  # type: ignore[type-arg]
    import json

    return json.loads((path / "derived" / "process.json").read_text())  # type: ignore[no-any-return]


def test_the_sky_is_the_worlds(whole: Path) -> None:
    told = account(whole)
    sky, sun = SkyMap.load(whole / "derived" / "sky.npz"), told["sky"]["sun"]
    utc_ns = int(np.datetime64(told["sky"]["utc"].rstrip("Z"), "ns").astype(np.int64))
    seen = world().sun(utc_ns)
    # the sun's place is computed twice from the same algorithm; interpolation in the world leaves 1e-4 degrees
    assert sun["altitude_deg"] == pytest.approx(seen.altitude_deg, abs=0.01)
    assert sun["azimuth_deg"] == pytest.approx(seen.azimuth_deg, abs=0.01)
    # both meters' readings carry up to 2 % (CL-200, expanded), the beam's share of which adds up to its own uncertainty
    assert abs(sun["normal_illuminance_lx"] - seen.normal_illuminance_lx) < 3 * sun["uncertainty_lx"]
    altitude, azimuth = np.meshgrid(np.arange(10.0, 90.0, 10.0), np.arange(0.0, 360.0, 15.0))
    there = sky_vector(altitude, azimuth)
    away = angle_between(there, sky_vector(seen.altitude_deg, seen.azimuth_deg)) > 12.0
    # the strip below the disc is filled in: the arm points at the eastern horizon
    away &= ~((np.abs(azimuth - seen.azimuth_deg) < 8.0) & (altitude < seen.altitude_deg + 1.0))
    ratio = sky.at(there)[away] / world().sky_luminance(there, utc_ns)[away]
    # one scale from a meter that is good to 2 %; single pixels of 8 bits to 3.7 % (the merge's own account)
    assert np.median(ratio) == pytest.approx(1.0, abs=0.02)
    assert np.max(np.abs(ratio / np.median(ratio) - 1.0)) < 4 * told["sky"]["noise_relative_sd"]
    assert abs(told["sky"]["zenith"]["deviation_in_sd"]) < 3
    assert told["sky"]["flags"] == []
    assert told["missing"] == []


def test_the_photometry_is_the_worlds(whole: Path) -> None:
    measured = read_lm63(whole / "derived" / "measured.ies").distribution
    told = account(whole)
    utc_ns = int(np.datetime64(told["sky"]["utc"].rstrip("Z"), "ns").astype(np.int64))
    gammas = measured.gamma_deg[:-1]
    assert measured.gamma_deg[-1] == 90.0
    assert measured.c_deg[-1] == 360.0
    for c, plane in zip(measured.c_deg, measured.candela, strict=True):
        expected = world().candela(gammas, float(c), utc_ns)
        # in two and a half minutes the sun moves half a degree: up to 3 % on the flank of a lobe of 15 degrees
        assert plane[:-1] == pytest.approx(expected, rel=0.05)
    middle = np.argmin(np.abs(measured.c_deg - 180.0))
    assert measured.candela[middle, :-1] == pytest.approx(world().candela(gammas, 180.0, utc_ns), rel=0.02)
    assert told["photometry"]["normalisation"][0] < 1.0 < told["photometry"]["normalisation"][1]


def test_others_read_the_photometry(whole: Path, tmp_path: Path) -> None:
    photompy = pytest.importorskip("photompy", reason="photompy is not installed")
    path = whole / "derived" / "measured.ies"
    ours = read_lm63(path)
    theirs = photompy.IESFile.read(path)
    assert theirs.photometry.values == pytest.approx(ours.distribution.candela, rel=1e-6, abs=1e-3)
    assert {"TEST", "TESTLAB", "ISSUEDATE", "MANUFAC", "NEARFIELD"} <= set(theirs.header.keywords)
    assert ours.oddities == ()
    shutil.copy(path, tmp_path / "lamp.ies")
    radiance("ies2rad", "-dm", "lamp.ies", folder=tmp_path)
    assert "brightdata" in (tmp_path / "lamp.rad").read_text()


def test_others_read_the_sky(whole: Path) -> None:
    path = whole / "derived" / "sky.hdr"
    sky = SkyMap.load(path.with_suffix(".npz"))
    picture = cv2.imread(str(path), cv2.IMREAD_UNCHANGED)
    assert picture.shape == (512, 512, 3)
    # eight bits of mantissa for the largest of three equal channels
    theirs = picture.mean(axis=2) * LUMENS_PER_WATT
    np.testing.assert_allclose(theirs[sky.known], sky.luminance[sky.known], rtol=0.01)
    assert b"-vta" in radiance("getinfo", path)
    listed = numbers(radiance("pvalue", "-h", "-H", "-b", "-d", path)).ravel()
    np.testing.assert_allclose(
        listed.reshape(512, 512)[sky.known] * LUMENS_PER_WATT, sky.luminance[sky.known], rtol=0.01
    )
    # the picture alone gives the illuminance again: zenith angle grows linearly with the radius, 180 degrees across
    rows, columns = np.mgrid[0:512, 0:512] + 0.5
    theta = np.hypot(rows - 256, columns - 256) / 256 * np.pi / 2
    solid = np.sinc(theta / np.pi) * (np.pi / 512) ** 2
    lux = np.sum(theirs * solid * np.cos(theta) * (theta < np.pi / 2))
    assert lux == pytest.approx(account(whole)["sky"]["calibration"]["diffuse_lx"], rel=0.01)


def test_the_record_is_not_touched(few: Path, tmp_path: Path) -> None:
    path = tmp_path / few.name
    shutil.copytree(few, path)
    before = recorded(path)
    process_session(path)
    assert recorded(path) == before
    found = verify(path)
    assert found.sealed
    assert found.problems == ()
    first = {p.name: p.read_bytes() for p in (path / "derived").iterdir()}
    (path / "derived" / "notes.txt").write_text("mine")
    (path / "derived" / "simulated.ies").write_text("of somebody else")
    (path / "derived" / "simulate.json").write_text('{"files": ["simulated-sun.ies"]}')
    (path / "derived" / "simulated-sun.ies").write_text("of a sky that was")
    process_session(path)
    now = {p.name: p.read_bytes() for p in (path / "derived").iterdir()}
    assert now.pop("notes.txt") == b"mine"
    assert now.pop("simulated.ies") == b"of somebody else"
    assert {name: data for name, data in now.items() if name != "sky.npz"} == {
        name: data for name, data in first.items() if name != "sky.npz"
    }


@pytest.mark.parametrize("after_s", [pytest.param(0.8, marks=pytest.mark.slow), 1.6])
def test_killed_and_done_again(few: Path, tmp_path: Path, after_s: float) -> None:
    path = tmp_path / few.name
    shutil.copytree(few, path)
    words = (
        "import sys, pathlib\n"
        "from analysis.process.session import process_session\n"
        "while True: process_session(pathlib.Path(sys.argv[1]))"
    )
    worker = subprocess.Popen(
        [sys.executable, "-c", words, str(path)], env={**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    )
    killer = threading.Timer(after_s, worker.send_signal, [signal.SIGKILL])
    killer.start()
    worker.wait()
    killer.join()
    derived = path / "derived"
    if derived.exists():  # then all of it
        assert {p.name for p in derived.iterdir()} == {*account(path)["files"], "process.json"}
        read_lm63(derived / "measured.ies")
    assert verify(path).problems == ()
    process_session(path)
    read_lm63(derived / "measured.ies")


@pytest.mark.parametrize("picture", ["jpeg", "raw"])
def test_a_truncated_picture_is_named(few: Path, tmp_path: Path, picture: str) -> None:
    path = tmp_path / "broken"
    shutil.copytree(few if picture == "jpeg" else take_few(tmp_path / "raw", "raw"), path)
    photo = path / Session.open(path).photos()[2].file
    photo.chmod(0o644)
    photo.write_bytes(photo.read_bytes()[: photo.stat().st_size * 2 // 3])
    with pytest.raises(DataError, match="truncated") as told:
        process_session(path)
    assert photo.name in told.value.message
    assert not (path / "derived").exists()


def test_another_picture_is_refused(few: Path, tmp_path: Path) -> None:
    path = tmp_path / "swapped"
    shutil.copytree(few, path)
    first, second = (path / photo.file for photo in Session.open(path).photos()[:2])
    first.chmod(0o644)
    first.write_bytes(second.read_bytes())
    with pytest.raises(DataError, match="is not what was recorded") as told:
        process_session(path)
    assert first.name in told.value.message


def test_raw_pictures_give_the_sky_as_well(tmp_path: Path) -> None:
    path = take_few(tmp_path, "raw")
    told = process_session(path)
    assert told["sky"]["merge"]["kind"] == "raw"
    # twelve linear bits: the map agrees with the meter at the zenith within both their uncertainties
    assert abs(told["sky"]["zenith"]["deviation_in_sd"]) < 3


def test_without_camera_there_is_photometry(few: Path, tmp_path: Path) -> None:
    path = again(few, tmp_path, lambda _: True)
    told = process_session(path)
    assert told["files"] == ["measured.ies"]
    assert told["missing"] == ["sky: no exposure of the camera"]
    assert told["sky"] is None


def test_without_arm_there_is_nothing_but_what_is_missing(few: Path, tmp_path: Path) -> None:
    def roof(body: object) -> bool:
        return isinstance(body, TakenReading) and not body.step.startswith("plane")

    with pytest.raises(DataError, match="no reading of the goniophotometer") as told:
        process_session(again(few, tmp_path, roof))
    assert "no exposure of the camera" in told.value.message


def test_half_a_scan_is_no_photometry(few: Path, tmp_path: Path) -> None:
    def half(body: object) -> bool:
        return isinstance(body, TakenReading) and body.step not in ("plane-02", "plane-03")

    with pytest.raises(DataError, match="the scan cannot be reduced"):
        process_session(again(few, tmp_path, half))


def test_where_the_lens_comes_from(whole: Path) -> None:
    from analysis.hdr.merged import Merged
    from analysis.process.camera import camera_of, merge_recipe, with_told_times

    session = Session.open(whole)
    from analysis.hdr.merge import merge

    picture: Merged = merge(with_told_times(session)[6:12], merge_recipe(camera_of(session.station)))
    known, flags = lens_of(camera_of(session.station), picture)
    assert flags == []
    # 96 % of 480 pixels across, at 91.5 degrees: the emulated lens
    assert (known.centre_row, known.centre_column) == (240.0, 320.0)
    assert known.radius_px == pytest.approx(230.4, abs=0.01)
    found, flags = lens_of(Camera(name="c", port="usb"), picture)
    assert flags == ["lens-assumed"]
    # its edge darkens, and is a tenth of sky beyond the horizon: a few pixels
    assert found.radius_px == pytest.approx(230.4, rel=0.03)
    flat = lens_of(Camera(name="c", port="usb", image_focal_px=100.0, lens={"projection": "equisolid"}), picture)[0]
    assert flat.radius_px == pytest.approx(200.0 * np.sin(np.pi / 4))
    # near the axis all projections of one focal length are alike
    assert flat.radius(1.0) == pytest.approx(np.radians(100.0), rel=1e-4)
