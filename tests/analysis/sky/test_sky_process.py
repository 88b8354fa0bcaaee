"""A whole test: raw exposures of a painted sky through a lens, roof readings, and the truth at the end."""

import json
from pathlib import Path

import numpy as np
import pytest

from analysis.hdr.fisheye import Lens
from analysis.hdr.merged import Exposure, Recipe
from analysis.sky.map import SkyMap
from analysis.sky.perez import PerezSky
from analysis.sky.process import Readings, SkyRecipe, SkyResult, SkyTest, process_sky
from analysis.sky.sun import GREENWOOD, distance_factor, sun_position
from labdaq.clock import NS
from labdaq.directions import sky_vector
from labdaq.errors import DataError
from tests.analysis.hdr.camera import picture_bracket, raw_bracket
from tests.analysis.hdr.dng_writer import XYZ_TO_CAMERA
from tests.analysis.sky.painted import rod_and_disc

START = 1_279_805_520 * NS  # 2010-07-22 13:32 UTC, the sun at 35°
TIMES = tuple(2.0 ** (-k) for k in range(16))
BEAM, DIFFUSE = 55_000.0, 17_000.0
LENS = Lens(
    300.0, 310.0, 285.0, 91.0, "polynomial", (1.06, -0.06), up_azimuth_deg=12.0, vignetting=(0.1, -0.35)
)  # fmt: skip


@pytest.fixture(scope="module")
def truth() -> tuple[PerezSky, SkyMap]:
    sun = sun_position(START, GREENWOOD)
    sky = PerezSky.from_illuminances(
        BEAM, DIFFUSE, float(sun.altitude_deg), float(sun.azimuth_deg), float(distance_factor(START))
    )
    return sky, SkyMap.from_function(sky.luminance, 256)


@pytest.fixture(scope="module")
def exposures(tmp_path_factory: pytest.TempPathFactory, truth: tuple[PerezSky, SkyMap]) -> list[Exposure]:
    rows, columns = np.mgrid[0:600, 0:620] + 0.5
    d = LENS.direction(rows, columns)
    sun = sky_vector(truth[0].sun_altitude_deg, truth[0].sun_azimuth_deg)
    open_sky = rod_and_disc(d, sun, 5.0, 1.0, 15.0)
    theta = np.degrees(np.arccos(np.clip(d[..., 2], -1.0, 1.0)))
    luminance = truth[0].luminance(d) * (0.02 + 0.98 * open_sky) * LENS.falloff(theta)
    luminance = np.where(theta < 90.0, luminance, 30.0)
    # what a D65-lit camera with that matrix records, 2 codes per second and cd/m² of green
    white = XYZ_TO_CAMERA @ np.array([0.95047, 1.0, 1.08883])
    colour = np.array([[0, 1], [1, 2]])[np.arange(600)[:, None] % 2, np.arange(620)[None, :] % 2]
    rate = 2.0 * luminance * (white / white[1])[colour]
    paths = raw_bracket(tmp_path_factory.mktemp("sky"), rate, TIMES)
    return [Exposure(p, t, when_s=8.0 * k) for k, (p, t) in enumerate(zip(paths, TIMES, strict=True))]


def readings(value: float, count: int = 16, drift: float = 0.0, sd: float = 0.01) -> Readings:
    values = value * (1.0 + drift * np.linspace(-0.5, 0.5, count))
    return Readings.of(START + NS * np.arange(count), values, sd * value)


def roof(truth: tuple[PerezSky, SkyMap], **changes: object) -> dict[str, object]:
    sky, flat = truth
    sun = sky_vector(sky.sun_altitude_deg, sky.sun_azimuth_deg)
    sine = float(sun[2])
    return {
        "utc_ns": START,
        "site": GREENWOOD,
        "global_": readings(flat.horizontal_illuminance() + BEAM * sine),
        "diffuse": readings(flat.horizontal_illuminance(~flat.near(sun, 5.0))),
        "zenith": readings(sky.zenith_luminance, sd=0.02),
        "lens": LENS,
        **changes,
    }


@pytest.fixture(scope="module")
def result(exposures: list[Exposure], truth: tuple[PerezSky, SkyMap]) -> SkyResult:
    return process_sky(SkyTest(exposures, **roof(truth)), SkyRecipe(pixels=256))  # type: ignore[arg-type]


def test_the_sky_and_the_sun_come_out(result: SkyResult, truth: tuple[PerezSky, SkyMap]) -> None:
    flat = truth[1]
    assert result.record["flags"] == []
    assert result.sky.horizontal_illuminance() == pytest.approx(flat.horizontal_illuminance(), rel=0.005)
    assert result.sun.normal_illuminance_lx == pytest.approx(BEAM, rel=0.01)
    high = flat.known & (result.sky.directions[..., 2] > np.sin(np.radians(3.0)))
    error = result.sky.luminance[high] / flat.luminance[high] - 1.0
    # noise of 0.5 % and less, interpolation over 0.3° pixels, the aureole's rim
    assert float(np.sqrt(np.mean(error**2))) < 0.02
    assert abs(float(np.median(error))) < 0.005
    # east is east: the map's brightest tenth lies round the sun
    assert abs(result.sky.illuminance([1, 0, 0]) / flat.illuminance([1, 0, 0]) - 1.0) < 0.01
    assert abs(result.sky.illuminance([0, 1, 0]) / flat.illuminance([0, 1, 0]) - 1.0) < 0.01


def test_the_record_says_everything_and_is_json(result: SkyResult) -> None:
    text = json.dumps(result.record, allow_nan=False)
    record = json.loads(text)
    for part in ("merge", "lens", "disc", "filler", "calibration", "sun", "zenith", "readings", "noise_relative_sd"):
        assert part in record, part
    assert record["disc"]["radius_deg"] == pytest.approx(6.0, abs=0.5)
    assert abs(record["zenith"]["ratio_meter_to_map"] - 1.0) < 0.01
    assert abs(record["zenith"]["deviation_in_sd"]) < 2.0
    assert 0.0 < record["noise_relative_sd"] < 0.01
    assert len(record["merge"]["times_s"]) == 16


def test_what_was_seen_is_kept_apart_from_what_was_filled(result: SkyResult) -> None:
    hidden = ~result.seen.known & result.sky.known
    assert 300 < np.count_nonzero(hidden) < 2500
    assert np.all(result.sky.luminance[result.seen.known] == result.seen.luminance[result.seen.known])


def test_the_reports_recipe_moves_light_from_beam_to_sky(
    exposures: list[Exposure], truth: tuple[PerezSky, SkyMap], result: SkyResult
) -> None:
    recipe = SkyRecipe(pixels=128, filler="single", circumsolar=0.10, spread="sky")
    theirs = process_sky(SkyTest(exposures, **roof(truth)), recipe)  # type: ignore[arg-type]
    diffuse = theirs.record["calibration"]["diffuse_reading_lx"]
    assert theirs.sky.horizontal_illuminance() == pytest.approx(1.1 * diffuse, rel=1e-6)
    assert theirs.sun.normal_illuminance_lx < 0.98 * result.sun.normal_illuminance_lx
    # the whole map is raised by it, so the zenith meter sees it
    assert theirs.record["zenith"]["ratio_meter_to_map"] == pytest.approx(1.03 / 1.1, abs=0.015)


def test_an_unknown_lens_is_found_in_the_picture_and_said(
    exposures: list[Exposure], truth: tuple[PerezSky, SkyMap]
) -> None:
    found = process_sky(SkyTest(exposures, **roof(truth, lens=None)), SkyRecipe(pixels=128))  # type: ignore[arg-type]
    assert found.record["flags"][0] == "lens-assumed"
    lens = found.record["lens"]
    assert (lens["centre_row"], lens["centre_column"]) == pytest.approx((300.0, 310.0), abs=2.0)
    assert lens["radius_px"] == pytest.approx(float(LENS.radius(90.0)), rel=0.01)


def test_jpeg_pictures_do_as_well_within_their_means(truth: tuple[PerezSky, SkyMap], tmp_path: Path) -> None:
    lens = Lens(150.0, 150.0, 145.0)
    rows, columns = np.mgrid[0:300, 0:300] + 0.5
    d = lens.direction(rows, columns)
    sun = sky_vector(truth[0].sun_altitude_deg, truth[0].sun_azimuth_deg)
    luminance = truth[0].luminance(d) * (0.02 + 0.98 * rod_and_disc(d, sun, 5.0, 1.5, 15.0))
    luminance = np.where(d[..., 2] > 0.0, luminance, 20.0)
    rate = 2e-3 * luminance[..., None] * np.array([0.8, 1.0, 1.3])  # blue, as skies are
    times = tuple(2.0 ** (-k) for k in range(-3, 11))
    paths = picture_bracket(tmp_path, rate, times, suffix=".jpg")
    shots = [Exposure(p, t) for p, t in zip(paths, times, strict=True)]
    done = process_sky(SkyTest(shots, **roof(truth, lens=lens)), SkyRecipe(pixels=128))  # type: ignore[arg-type]
    assert not {"no-disc-found", "disc-off-sun", "sky-saturated", "zenith-disagrees"} & set(done.record["flags"])
    assert done.sky.horizontal_illuminance() == pytest.approx(truth[1].horizontal_illuminance(), rel=0.01)
    assert done.sun.normal_illuminance_lx == pytest.approx(BEAM, rel=0.02)
    seen = done.seen.known & (done.sky.directions[..., 2] > 0.1)
    error = done.sky.luminance[seen] / SkyMap.from_function(truth[0].luminance, 128).luminance[seen] - 1.0
    assert float(np.sqrt(np.mean(error**2))) < 0.04  # a recovered response, and JPEG


def test_a_changing_sky_and_a_dark_test_are_said(exposures: list[Exposure], truth: tuple[PerezSky, SkyMap]) -> None:
    words = roof(truth)
    unsteady = readings(40_000.0, drift=0.4)
    recipe = SkyRecipe(pixels=64, merge=Recipe(refine=False))
    flags = process_sky(SkyTest(exposures, **{**words, "global_": unsteady}), recipe).record["flags"]  # type: ignore[arg-type]
    assert "sky-unsteady" in flags
    night = {**words, "utc_ns": START - 9 * 3600 * NS}
    with pytest.raises(DataError, match="below the horizon"):
        process_sky(SkyTest(exposures, **night), recipe)  # type: ignore[arg-type]


def test_readings_must_be_numbers() -> None:
    with pytest.raises(DataError, match="finite"):
        Readings.of([1, 2], [1.0, float("nan")])
    with pytest.raises(DataError, match="readings"):
        Readings.of([], [])
    mean = Readings.of([1, 2, 3, 4], [98.0, 102.0, 98.0, 102.0], 1.0).mean
    assert mean.value == 100.0
    # scatter of the mean 4/sqrt(3)/2, and the meter's 1, which averaging does not lessen
    assert mean.uncertainty == pytest.approx(np.hypot(np.std([98, 102, 98, 102], ddof=1) / 2.0, 1.0))


def test_the_map_file_holds_the_record(result: SkyResult, tmp_path: Path) -> None:
    result.sky.save(tmp_path / "sky.npz")
    assert SkyMap.load(tmp_path / "sky.npz").record["recipe"]["sun"]["normal_illuminance_lx"] == pytest.approx(
        BEAM, rel=0.01
    )
