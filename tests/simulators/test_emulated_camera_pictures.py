"""What the emulated camera photographs: geometry, radiometry, noise, files that others can read."""

import io
import math
from dataclasses import replace
from fractions import Fraction

import cv2
import numpy as np
import pytest
import rawpy
from emulator_helpers import MORNING_NS, UniformWorld
from PIL import Image

from labdaq import directions
from simulators.camera import FisheyeLens, Optics, Sensor, ShadingDisc, luminance_picture, saturation_luminance, view
from simulators.camera.darkroom import Shot, develop, expose, metered_seconds
from simulators.camera.files import ExposureData, srgb_tone
from simulators.camera.shutters import COOLPIX, THIRD_STOPS
from simulators.world.observed import SunSeen

DATA = ExposureData("NIKON", "E5700", "2010:07:22 13:12:00", Fraction(1, 60), Fraction(4), 100, False, Fraction(28, 5))
PLAIN = Optics(lens=FisheyeLens(vignetting=()), disc=None, sensor=Sensor(read_noise=0.0, full_well=1e12))


def shot(seconds: float = 1 / 60, formats: tuple[str, ...] = ("dng",), number: int = 1, size: int = 480) -> Shot:
    return Shot(number, MORNING_NS, seconds, size * 4 // 3, size, formats, DATA)


class Gradient(UniformWorld):
    """Bright towards the north, dim towards the south, different east and west."""

    def sky_luminance(self, towards: np.ndarray, utc_ns: int) -> np.ndarray:
        east, north, up = np.moveaxis(np.asarray(towards), -1, 0)
        return np.where(up > 0, 3000.0 + 2000.0 * north + 500.0 * east, 0.0)


# --- geometry ---


def test_pixels_cover_the_lenss_solid_angle() -> None:
    seen = view(FisheyeLens(), 640, 480)
    # 183 degrees: 2π (1 - cos 91.5°); the ragged rim of 166 000 pixels leaves 2e-4
    assert seen.solid_angle.sum() == pytest.approx(2 * np.pi * (1 - np.cos(np.radians(91.5))), rel=1e-3)
    bent = view(FisheyeLens(projection=lambda r: r + 0.05 * r * (1 - r**2)), 640, 480)
    assert bent.solid_angle.sum() == pytest.approx(2 * np.pi * (1 - np.cos(np.radians(91.5))), rel=2e-3)


def test_north_is_up_and_west_is_right() -> None:
    seen = view(FisheyeLens(), 640, 480)
    inside = np.argwhere(seen.inside)
    for c, row, column in ((0.0, 80, 320), (90.0, 240, 480), (180.0, 400, 320), (270.0, 240, 160)):
        nearest = int(np.argmin(np.hypot(inside[:, 0] - row, inside[:, 1] - column)))
        _, seen_c = directions.gamma_c(seen.towards[nearest])
        assert np.cos(np.radians(float(seen_c) - c)) > 0.9999
    turned = view(FisheyeLens(rotation_deg=90.0), 640, 480)
    nearest = int(np.argmin(np.hypot(inside[:, 0] - 80, inside[:, 1] - 320)))
    assert (
        turned.towards[nearest] @ directions.sky_vector(90 - 159.5 / 230.4 * 91.5, 90.0) > 0.9999
    )  # the top looks east


def test_the_projection_is_equidistant() -> None:
    seen = view(FisheyeLens(), 640, 480)
    gamma, _ = directions.gamma_c(seen.towards)
    rows, columns = np.nonzero(seen.inside)
    radius = np.hypot(columns - 319.5, rows - 239.5)
    assert (180.0 - gamma) / radius == pytest.approx(np.full(len(radius), 91.5 / (0.96 * 240)), rel=1e-9)


def test_the_circle_lies_inside_the_frame() -> None:
    picture = luminance_picture(UniformWorld(), 0, PLAIN, 640, 480)
    border = np.concatenate([picture[0], picture[-1], picture[:, 0], picture[:, -1]])
    assert not border.any()


def test_the_disc_hides_the_sun_and_follows_it() -> None:
    world = UniformWorld(beam=70_000.0)
    optics = replace(PLAIN, disc=ShadingDisc(reflectance=0.0))
    for altitude, azimuth in ((30.0, 90.0), (70.0, 200.0), (50.0, 355.0)):
        world.altitude, world.azimuth = altitude, azimuth
        picture = luminance_picture(world, 0, optics, 640, 480)
        seen = view(optics.lens, 640, 480)
        angle = directions.angle_between(seen.towards, directions.sky_vector(altitude, azimuth))
        values = picture[seen.inside]
        assert values.max() == pytest.approx(3000.0)  # no ray of the sun
        assert not values[angle < 4.9].any()
        gamma, c = directions.gamma_c(seen.towards)
        aside = np.abs((c - (360 - azimuth) + 180) % 360 - 180)
        on_arm = (gamma < 90 + altitude) & (gamma > 91) & (aside < 0.4)
        assert on_arm.any()
        assert not values[on_arm].any()
        elsewhere = (angle > 6) & (aside > 20) & (gamma > 91)
        assert values[elsewhere].min() == pytest.approx(3000.0)


def test_a_bare_sun_keeps_its_illuminance() -> None:
    world = UniformWorld(sky=0.0, beam=70_000.0, altitude=63.0)
    seen = view(PLAIN.lens, 640, 480)
    picture = luminance_picture(world, 0, PLAIN, 640, 480)[seen.inside]
    assert float(np.sum(picture * seen.solid_angle)) == pytest.approx(70_000.0, rel=1e-9)
    assert np.count_nonzero(picture) < 12


# --- radiometry ---


def test_illuminance_of_a_uniform_sky_is_pi_times_its_luminance() -> None:
    seen = view(PLAIN.lens, 640, 480)
    picture = luminance_picture(UniformWorld(sky=3000.0), 0, PLAIN, 640, 480)[seen.inside]
    illuminance = float(np.sum(picture * seen.towards[:, 2] * seen.solid_angle))
    assert illuminance == pytest.approx(3000.0 * math.pi, rel=1e-3)  # midpoint rule on 0.4° pixels


def test_exposure_follows_iso_12232() -> None:
    """A luminance of half saturation comes to half the range, whatever combination of time, aperture and ISO."""
    sensor = PLAIN.sensor
    noise = np.random.default_rng(0)
    for seconds, f_number, iso in ((1 / 60, 4.0, 100), (1 / 15, 8.0, 100), (1 / 240, 4.0, 400)):
        half = saturation_luminance(seconds, f_number, iso) / 2
        assert half == pytest.approx(saturation_luminance(1 / 60, 4.0, 100) / 2)
        numbers = sensor.expose(np.full((4, 4), half), seconds, f_number, iso, noise)
        assert numbers == pytest.approx(np.full((4, 4), 64 + (4095 - 64) / 2), abs=1)
    assert saturation_luminance(1 / 4000, 4.0, 100) == pytest.approx(76_800.0)


def test_noise_is_photons_and_readout() -> None:
    sensor = Sensor(full_well=9000.0, read_noise=5.0)
    gain = 9000.0 / (4095 - 64)  # electrons per number
    for share in (0.0, 0.05, 0.5):
        light = np.full((400, 400), share * saturation_luminance(1.0, 4.0, 100))
        numbers = sensor.expose(light, 1.0, 4.0, 100, np.random.default_rng(1)).astype(float)
        expected = (share * 9000.0 + 25.0) / gain**2 + 1 / 12
        assert numbers.var() == pytest.approx(expected, rel=0.02)  # 160 000 samples know it to 0.35 %
        assert numbers.mean() == pytest.approx(64 + share * (4095 - 64), abs=0.15)


def test_the_sensor_clips_at_white_and_keeps_black() -> None:
    exposed = expose(UniformWorld(sky=1e6), PLAIN, shot(1.0), seed=0)
    assert exposed.max() == 4095
    assert exposed[0, 0] == 64
    assert set(np.unique(exposed)) == {64, 4095}


def test_vignetting_and_veil() -> None:
    optics = replace(PLAIN, lens=FisheyeLens(vignetting=(-0.1, 0.0, -0.2), veil=0.02))
    seen = view(optics.lens, 640, 480)
    picture = luminance_picture(UniformWorld(sky=1000.0), 0, optics, 640, 480)
    up = seen.towards[:, 2] > 0
    r = np.degrees(np.arccos(seen.towards[:, 2])) / 91.5
    mean = picture[seen.inside].mean() / 1.02
    assert picture[0, 0] == pytest.approx(0.02 * mean)
    assert picture[seen.inside][up] == pytest.approx((1000 * (1 - 0.1 * r**2 - 0.2 * r**6))[up] + 0.02 * mean)


def test_a_bracket_merges_to_the_worlds_luminance() -> None:
    """Sixteen DNGs as the camera makes them, vignetting undone: the sky comes out, pixel by pixel."""
    world = Gradient(beam=60_000.0, altitude=40.0)
    optics = Optics()
    total, weight = np.zeros((480, 640)), np.zeros((480, 640))
    for number, shutter in enumerate(COOLPIX, 1):
        seconds = float(shutter.nominal_s)
        (file,) = develop(world, optics, shot(seconds, number=number), seed=3)
        with rawpy.imread(io.BytesIO(file.data)) as raw:
            numbers = raw.raw_image.astype(float)
        good = numbers < 0.9 * 4095
        total += np.where(good, numbers - 64, 0.0)
        weight += np.where(good, seconds, 0.0)
    scale = 78.0 * 4.0**2 / (0.65 * 100) / (4095 - 64)  # luminance of one number in one second, ISO 12232
    merged = total / weight * scale
    seen = view(optics.lens, 640, 480)
    sun = directions.sky_vector(40.0, 120.0)
    sky = (seen.towards[:, 2] > 0.1) & (directions.angle_between(seen.towards, sun) > 6)
    _, c = directions.gamma_c(seen.towards)
    sky &= np.abs((c - 240 + 180) % 360 - 180) > 10  # beside the arm
    ratio = (merged[seen.inside] / seen.transmission)[sky] / world.sky_luminance(seen.towards, 0)[sky]
    # photon noise of a pixel is about 1 %, of the mean of 130 000 of them nothing
    assert ratio.mean() == pytest.approx(1.0, abs=2e-4)
    assert ratio.std() < 0.02
    assert abs(ratio[seen.towards[sky][:, 1] > 0.5].mean() - ratio[seen.towards[sky][:, 1] < -0.5].mean()) < 1e-3


def test_colour_response_acts_on_the_right_pixels() -> None:
    def bluish(towards: np.ndarray, luminance: np.ndarray, sun: SunSeen) -> np.ndarray:
        return np.array([0.8, 1.0, 1.5])[:, None] * np.ones(len(luminance))

    light = expose(UniformWorld(sky=1000.0), replace(PLAIN, colour=bluish), shot(1 / 250), 0).astype(float) - 64
    red, green, blue = light[240, 320], light[240, 321], light[241, 321]
    assert red / green == pytest.approx(0.8, abs=0.005)
    assert blue / green == pytest.approx(1.5, abs=0.005)


def test_the_meter_aims_at_eighteen_percent() -> None:
    seconds = metered_seconds(UniformWorld(sky=3000.0), 0, PLAIN, 4.0, 100)
    assert 0.18 * saturation_luminance(seconds, 4.0, 100) == pytest.approx(3000.0 * (90 / 91.5) ** 2, rel=0.01)


# --- files ---


def test_a_dng_is_read_back_bit_for_bit() -> None:
    world, optics = Gradient(beam=60_000.0), Optics()
    (file,) = develop(world, optics, shot(), seed=7)
    with rawpy.imread(io.BytesIO(file.data)) as raw:
        assert np.array_equal(raw.raw_image, expose(world, optics, shot(), seed=7))
        assert raw.black_level_per_channel == [64] * 4
        assert raw.white_level == 4095
        assert raw.color_desc == b"RGBG"
        assert raw.raw_pattern.tolist() == [[0, 1], [3, 2]]
        assert raw.other.shutter_speed == pytest.approx(1 / 60)
        assert raw.other.aperture == pytest.approx(4.0)
        assert raw.other.iso_speed == 100
        linear = raw.postprocess(
            gamma=(1, 1), no_auto_bright=True, adjust_maximum_thr=0.0, user_wb=[1, 1, 1, 1],
            output_color=rawpy.ColorSpace.raw, output_bps=16,
        )  # fmt: skip
    centre = linear[200:280, 280:360].astype(float)
    assert centre[..., 0].mean() == pytest.approx(centre[..., 2].mean(), rel=0.01)  # grey stays grey


@pytest.mark.parametrize("kind", ["jpeg:95", "tiff", "dng"])
def test_exif_is_exact(kind: str) -> None:
    data = replace(DATA, nominal_s=Fraction(1, 15), f_number=Fraction(280, 100), iso=400)
    (file,) = develop(UniformWorld(), Optics(), replace(shot(formats=(kind,)), data=data), seed=1)
    if kind == "dng":  # Pillow reads its tags, not its picture
        tags = Image.Exif()
        tags.load(file.data)
    else:
        with Image.open(io.BytesIO(file.data)) as picture:
            tags = picture.getexif()
            assert picture.size == (640, 480)
    exif = tags.get_ifd(0x8769)
    assert (exif[0x829A].numerator, exif[0x829A].denominator) == (1, 15)
    assert Fraction(exif[0x829D].numerator, exif[0x829D].denominator) == Fraction(14, 5)
    assert exif[0x8827] == 400
    assert exif[0x9003] == tags[0x0132] == "2010:07:22 13:12:00"
    assert (tags[0x010F], tags[0x0110]) == ("NIKON", "E5700")


def test_the_jpegs_tone_curve_is_the_documented_one() -> None:
    world = Gradient()
    (file,) = develop(world, PLAIN, shot(1 / 250, ("jpeg:100",)), seed=1)
    picture = cv2.imdecode(np.frombuffer(file.data, np.uint8), cv2.IMREAD_COLOR)
    linear = (expose(world, PLAIN, shot(1 / 250), seed=1).astype(float) - 64) / (4095 - 64)
    patch = np.s_[100:380, 200:440]
    expected = 255 * srgb_tone(linear)[patch]
    assert picture[patch][..., 1] == pytest.approx(expected, abs=3.0)  # demosaicing and JPEG rounding
    assert float(np.mean(picture[patch][..., 1] - expected)) == pytest.approx(0.0, abs=0.2)


def test_a_tiff_and_a_jpeg_show_the_same_picture() -> None:
    tiff_file, jpeg_file = develop(Gradient(), PLAIN, shot(1 / 250, ("tiff", "jpeg:100")), seed=1)
    lossless = cv2.imdecode(np.frombuffer(tiff_file.data, np.uint8), cv2.IMREAD_COLOR)
    lossy = cv2.imdecode(np.frombuffer(jpeg_file.data, np.uint8), cv2.IMREAD_COLOR)
    assert lossless.shape == (480, 640, 3)
    assert float(np.abs(lossless.astype(float) - lossy).mean()) < 1.0
    small = cv2.imdecode(np.frombuffer(jpeg_file.thumbnail, np.uint8), cv2.IMREAD_COLOR)
    assert small.shape == (120, 160, 3)


def test_the_same_shot_and_seed_give_the_same_bytes() -> None:
    first, again, other_seed, other_number = (
        develop(Gradient(), Optics(), shot(formats=("jpeg:95", "dng"), number=n), seed=s)
        for n, s in ((1, 1), (1, 1), (1, 2), (2, 1))
    )
    assert [f.data for f in first] == [f.data for f in again]
    assert first[1].data != other_seed[1].data
    assert first[1].data != other_number[1].data


def test_shutter_names_codes_and_ladder() -> None:
    assert [s.code for s in COOLPIX] == [
        80_000, 40_000, 20_000, 10_000, 5000, 2500, 1250, 662, 333, 167, 80, 40, 20, 10, 5, 2,
    ]  # fmt: skip
    assert COOLPIX[-1].nominal_s == Fraction(1, 4000)
    assert COOLPIX[-1].ladder_s == 1 / 4096
    for shutter in (*COOLPIX, *THIRD_STOPS):
        assert shutter.ladder_s == pytest.approx(float(shutter.nominal_s), rel=0.07)
    for shutter in THIRD_STOPS:
        assert shutter.code <= shutter.nominal_s * 10_000 < shutter.code + 1  # truncated
