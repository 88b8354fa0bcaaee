"""The merge against scenes whose truth is known: bias, variance, and every fault found in other programs."""

from pathlib import Path

import cv2
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from analysis.hdr.bracket import Crop
from analysis.hdr.flags import LOW_SIGNAL, MOVED, SATURATED, SINGLE
from analysis.hdr.luminance import camera_row
from analysis.hdr.merge import merge
from analysis.hdr.merged import Exposure, Merged, Recipe
from analysis.hdr.noise import Noise, estimate
from analysis.hdr.response import Response
from analysis.hdr.times import read_times
from labdaq.errors import DataError
from tests.analysis.hdr.camera import BLACK, LADDER, WHITE, picture_bracket, raw_bracket, raw_codes, tone
from tests.analysis.hdr.dng_writer import XYZ_TO_CAMERA, write_dng
from tests.analysis.recordings import recording

KNOWN = Noise(2.0**2 + 1.0 / 12.0, 1.0 / 2.5, 0.0)
"""The test camera's noise: read-out and rounding, photons."""


def scene(height: int = 240, width: int = 320, decades: tuple[float, float] = (0.0, 4.2), seed: int = 1) -> np.ndarray:
    """Rates (codes per second) spread evenly over decades, the same over each cell of the mosaic."""
    rng = np.random.default_rng(seed)
    cells = 10 ** rng.uniform(*decades, (height // 2, width // 2))
    return np.repeat(np.repeat(cells, 2, axis=0), 2, axis=1)


def weights() -> np.ndarray:
    row = camera_row(XYZ_TO_CAMERA)
    assert row is not None
    return np.array(row)


@pytest.fixture(scope="module")
def bracket(tmp_path_factory: pytest.TempPathFactory) -> tuple[list[Path], np.ndarray]:
    rate = scene()
    return raw_bracket(tmp_path_factory.mktemp("raw"), rate), rate[::2, ::2]


def exposures(paths: list[Path], times: tuple[float, ...] | None = LADDER) -> list[Exposure]:
    return [Exposure(p, None if times is None else t) for p, t in zip(paths, times or LADDER, strict=True)]


def test_no_bias_in_any_decade(bracket: tuple[list[Path], np.ndarray]) -> None:
    paths, rate = bracket
    done = merge(exposures(paths), Recipe(refine=False))
    truth = rate * weights().sum()
    assert done.pixel_step == 2
    relative = done.signal / truth
    times = np.array(LADDER)[:, None, None]
    open_ = rate * times < 0.8 * (WHITE - BLACK)
    oracle = 1.0 / np.sum(np.where(open_, times**2 / KNOWN.variance(rate * times), 0.0), axis=0)
    oracle *= weights()[0] ** 2 + weights()[1] ** 2 / 2.0 + weights()[2] ** 2
    for decade in (0, 1, 2, 3):
        here = (rate >= 10.0**decade) & (rate < 10.0 ** (decade + 1))
        sd_of_mean = float(np.sqrt(np.mean(oracle[here] / truth[here] ** 2) / here.sum()))
        assert abs(float(relative[here].mean()) - 1.0) < max(5.0 * sd_of_mean, 5e-4)
        # as precise as one who knows rate and noise beforehand; 1 / sqrt(2 n) of 4600 cells is 1 %
        ideal = float(np.sqrt(np.mean(oracle[here] / truth[here] ** 2)))
        assert float(np.std(relative[here])) < 1.04 * ideal


def test_the_variance_is_the_variance(bracket: tuple[list[Path], np.ndarray]) -> None:
    paths, rate = bracket
    for noise in (KNOWN, None):  # told, and learnt from the bracket
        done = merge(exposures(paths), Recipe(refine=False, noise=noise))
        pull = (done.signal - rate * weights().sum()) / np.sqrt(done.variance)
        # standard error of a standard deviation of n values: 1 / sqrt(2 n) = 0.5 % for 19,200 cells
        assert float(np.mean(pull)) == pytest.approx(0.0, abs=0.04)
        assert float(np.std(pull)) == pytest.approx(1.0, abs=0.02 if noise else 0.04)
        share = float(np.mean(np.abs(pull) < 1.96))
        assert share == pytest.approx(0.95, abs=0.01)


def test_the_noise_is_learnt(bracket: tuple[list[Path], np.ndarray]) -> None:
    found = merge(exposures(bracket[0]), Recipe(refine=False)).record["noise"][0]
    assert found["s2"] == pytest.approx(KNOWN.s2, rel=0.05)
    assert found["g"] == pytest.approx(KNOWN.g, rel=0.05)
    assert found["k"] < 2e-5
    assert not found["assumed"]


def test_shutter_labels_cost_five_percent_unless_the_bracket_corrects_them(tmp_path: Path) -> None:
    labels = (
        8.0,
        4.0,
        2.0,
        1.0,
        0.5,
        0.25,
        0.125,
        1 / 15,
        1 / 30,
        1 / 60,
        1 / 125,
        1 / 250,
        1 / 500,
        1e-3,
        5e-4,
        2.5e-4,
    )
    rate = scene(decades=(1.0, 6.0))
    paths = raw_bracket(tmp_path, rate, LADDER, labels)
    truth = rate[::2, ::2] * weights().sum()

    def tilt(done: Merged) -> float:
        """Bright over dark, which the unobservable level does not touch."""
        relative, here = done.signal / truth, rate[::2, ::2]
        return (
            float(np.mean(relative[(here > 3e4) & (here < 2e5)]) / np.mean(relative[(here > 30.0) & (here < 300.0)]))
            - 1.0
        )

    assert tilt(merge(exposures(paths, None), Recipe(snap=False, refine=False))) < -0.03
    assert abs(tilt(merge(exposures(paths, None), Recipe(snap=False, refine=True)))) < 0.003
    assert abs(tilt(merge(exposures(paths, None), Recipe()))) < 0.002  # labels read as steps, then refined
    assert abs(tilt(merge(exposures(paths, None), Recipe(refine=False)))) < 0.001


@pytest.mark.parametrize("honest", [True, False])
def test_the_exposures_say_whether_labels_are_meant_literally(honest: bool, tmp_path: Path) -> None:
    labels = (
        8.0,
        4.0,
        2.0,
        1.0,
        0.5,
        0.25,
        0.125,
        1 / 15,
        1 / 30,
        1 / 60,
        1 / 125,
        1 / 250,
        1 / 500,
        1e-3,
        5e-4,
        2.5e-4,
    )
    rate = scene(decades=(1.0, 6.0))
    done = merge(exposures(raw_bracket(tmp_path, rate, labels if honest else LADDER, labels), None))
    read = done.record["times_read"]
    assert read["as"] == ("as told" if honest else "exact steps")
    assert min(read["misfit_ln"].values()) < 0.3 * max(read["misfit_ln"].values())


def test_a_bright_thing_that_moved_does_not_shift_a_time(tmp_path: Path) -> None:
    # the rim of a shading disc follows the sun: few places, but more light than all others
    rng = np.random.default_rng(6)
    dark, paths = np.full((64, 64), 300.0), []
    for k, time in enumerate(LADDER[:8]):
        rate = dark.copy()
        rate[2 * k : 2 * k + 2] = 6000.0
        paths.append(tmp_path / f"{k}.dng")
        write_dng(paths[-1], raw_codes(rate, time, rng), time)
    found = np.array(merge(exposures(paths, LADDER[:8])).record["times_s"])
    error = np.log(found / np.array(LADDER[:8]))
    assert np.max(np.abs(error - error.mean())) < 0.004


def test_jitter_of_the_shutter_is_measured(tmp_path: Path) -> None:
    rng = np.random.default_rng(4)
    true = tuple(float(t * np.exp(rng.normal(0.0, 0.01))) for t in LADDER)
    paths = raw_bracket(tmp_path, scene(decades=(0.0, 5.6)), true, LADDER)
    record = merge(exposures(paths, None)).record
    error = np.log(np.array(record["times_s"]) / true)
    error -= error.mean()
    assert float(np.std(np.log(np.array(LADDER) / true))) > 0.005
    assert float(np.std(error)) < 5e-4  # 0.05 %, from 1 %
    assert np.max(np.abs(error)) < 4.0 * max(record["refined"]["relative_sd_percent"]) / 100.0


def test_a_pixel_clipped_everywhere_is_its_lower_bound_and_says_so(tmp_path: Path) -> None:
    # others return 510 where the bound is 4080, or 0: the sun's aureole gets dimmer than its rim
    rate = np.full((64, 64), 100.0)
    rate[4:8, 4:8] = 1e9
    done = merge(exposures(raw_bracket(tmp_path, rate)), Recipe(noise=KNOWN, refine=False))
    clipped = np.zeros((32, 32), dtype=bool)
    clipped[2:4, 2:4] = True
    np.testing.assert_array_equal(done.flags & SATURATED > 0, clipped)
    bound = (WHITE - BLACK) / LADDER[-1] * weights().sum()
    np.testing.assert_allclose(done.signal[clipped], bound, rtol=1e-5)
    assert np.all(np.isinf(done.variance[clipped]))
    assert np.all(np.isfinite(done.variance[~clipped]))
    assert done.record["flagged"]["saturated"] == 4


def test_a_rising_brightness_is_never_merged_into_a_falling_one(tmp_path: Path) -> None:
    # through every transition from one exposure to the next and into clipping
    rate = np.repeat(np.geomspace(1.0, 1e8, 600)[None, :], 64, axis=0)
    done = merge(exposures(raw_bracket(tmp_path, rate)), Recipe(noise=KNOWN, refine=False))
    line = done.signal.mean(axis=0)
    step = np.diff(np.log(line[20:]))
    # each pixel is 6 % brighter than the one before; noise of the mean of 32 cells is below 1 %
    assert np.all(step[: np.argmax(line[20:] > 0.94 * line.max())] > 0.0)
    assert np.all(np.diff(line) > -0.02 * line[:-1])


def test_flags_of_faint_single_and_moved_places(tmp_path: Path) -> None:
    rng = np.random.default_rng(9)
    still, gone = np.full((32, 32), 400.0), np.full((32, 32), 400.0)
    gone[:8] = 4000.0  # a cloud's edge passes between the exposures
    still[24:] = gone[24:] = 0.02  # next to nothing
    paths = []
    for k, time in enumerate(LADDER[2:10]):
        paths.append(tmp_path / f"{k}.dng")
        write_dng(paths[-1], raw_codes(gone if k >= 5 else still, time, rng), time)
    done = merge([Exposure(p) for p in paths], Recipe(noise=KNOWN, refine=False))
    assert np.all(done.flags[:4] & MOVED)
    assert not np.any(done.flags[5:12] & MOVED)
    assert np.mean(done.flags[12:] & LOW_SIGNAL > 0) > 0.9
    assert not np.any(done.flags[5:12] & (SATURATED | SINGLE | LOW_SIGNAL))
    alone = merge([Exposure(paths[0]), Exposure(paths[-1])], Recipe(noise=KNOWN, refine=False))
    # 2 s and 1/64 s: the shorter one adds 1 % of the information
    assert np.all(alone.flags[5:12] & SINGLE)


def test_worth_and_time_tell_where_a_pixel_came_from(tmp_path: Path) -> None:
    rate = np.full((64, 64), 1000.0)
    paths = raw_bracket(tmp_path, rate, (1.0, 1.0, 1.0, 1.0))
    done = merge(
        [Exposure(p, 1.0, when_s=100.0 + 10.0 * k) for k, p in enumerate(paths)], Recipe(noise=KNOWN, refine=False)
    )
    np.testing.assert_allclose(done.worth, 4.0, rtol=0.05)  # four equal exposures
    np.testing.assert_allclose(done.mean_time, 15.0, atol=1.0)  # since the first one's middle
    unlike = merge(exposures(raw_bracket(tmp_path, rate)), Recipe(noise=KNOWN, refine=False))
    # exposures of 2 s and below serve; halving times weigh 1/2, 1/4 ...: (sum w)² / sum w² = 3 at most
    assert 2.5 < float(unlike.worth.mean()) < 3.1


@given(order=st.permutations(range(6)))
@settings(max_examples=4, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_the_order_of_the_files_does_not_matter(order: list[int], bracket: tuple[list[Path], np.ndarray]) -> None:
    chosen = bracket[0][3:9]
    times = LADDER[3:9]
    straight = merge([Exposure(p, t, when_s=float(k)) for k, (p, t) in enumerate(zip(chosen, times, strict=True))])
    turned = merge([Exposure(chosen[i], times[i], when_s=float(i)) for i in order])
    np.testing.assert_array_equal(straight.signal, turned.signal)
    np.testing.assert_array_equal(straight.mean_time, turned.mean_time)


def test_groups_that_fit_into_memory_give_the_same_picture(bracket: tuple[list[Path], np.ndarray]) -> None:
    whole = merge(exposures(bracket[0]))
    # 16 exposures of 150 kB; 1.7 MB with the running sums leaves room for one or a few
    for megabytes in (0.5, 1.9):
        parts = merge(exposures(bracket[0]), Recipe(memory_mb=megabytes))
        np.testing.assert_array_equal(whole.signal, parts.signal)
        np.testing.assert_array_equal(whole.variance, parts.variance)
        np.testing.assert_array_equal(whole.flags, parts.flags)


def test_the_compiled_loop_and_plain_numpy_agree(bracket: tuple[list[Path], np.ndarray], tmp_path: Path) -> None:
    rng = np.random.default_rng(2)
    rate = 10 ** rng.uniform(1.0, 4.0, (64, 64))
    codes = np.stack([raw_codes(rate, t, rng) for t in LADDER])
    paths = []
    for k, frame in enumerate(codes):
        paths.append(tmp_path / f"{k}.dng")
        write_dng(paths[-1], frame, LADDER[k], pattern=b"\1\1\1\1", matrix=None)  # a sensor without colour filters
    done = merge(exposures(paths), Recipe(noise=KNOWN, refine=False))
    assert done.pixel_step == 1
    signals = (codes - float(BLACK)).reshape(16, -1)
    x = estimate(signals, np.array(LADDER), KNOWN, 0.95 * (WHITE - BLACK)).reshape(64, 64)
    # weights from a running estimate and from a finished one differ in second order of the noise
    assert float(np.median(np.abs(done.signal / x - 1.0))) < 2e-4
    assert float(np.max(np.abs(done.signal / x - 1.0))) < 0.02


def test_a_crop_is_the_part_it_says(bracket: tuple[list[Path], np.ndarray]) -> None:
    recipe = Recipe(noise=KNOWN, refine=False)
    whole = merge(exposures(bracket[0]), recipe)
    part = merge(exposures(bracket[0]), Recipe(noise=KNOWN, refine=False, crop=Crop(20, 40, 60, 100)))
    np.testing.assert_allclose(part.signal, whole.signal[10:40, 20:70], rtol=1e-6)  # vector and scalar code round apart
    with pytest.raises(DataError, match="does not lie"):
        merge(exposures(bracket[0]), Recipe(crop=Crop(200, 0, 60, 100)))


# pictures


def colours(height: int = 120, width: int = 160, seed: int = 3) -> np.ndarray:
    rng = np.random.default_rng(seed)
    grey = 10 ** rng.uniform(-2.5, 3.2, (height // 4, width // 4, 1))
    return np.repeat(np.repeat(grey, 4, axis=0), 4, axis=1) * np.array([0.85, 1.0, 1.25])


def frozen() -> Response:
    linear = np.linspace(0.0, 1.0, 400_001)
    curve = np.interp(np.arange(256) / 255.0, tone(linear), linear)
    return Response(np.tile(curve, (3, 1)), "file", "the test camera's own curve")


@pytest.mark.parametrize(("suffix", "limit"), [(".png", 0.005), (".jpg", 0.02)])
@pytest.mark.parametrize("known", [True, False])
def test_pictures_through_a_known_and_a_recovered_response(
    suffix: str, limit: float, known: bool, tmp_path: Path
) -> None:
    rate = colours()
    paths = picture_bracket(tmp_path, rate, suffix=suffix)
    done = merge(exposures(paths), Recipe(response=frozen() if known else None, keep_channels=True))
    assert done.channels is not None
    truth = rate @ np.array([0.2126, 0.7152, 0.0722])
    relative = done.signal / truth
    relative /= float(np.median(relative))  # a recovered response has no level
    inner = np.zeros((120, 160), dtype=bool)
    inner[1:-1:4, 1:-1:4] = inner[2:-1:4, 2:-1:4] = True  # JPEG smears the edges of the blocks
    for low, high in ((-1.0, 0.0), (0.0, 1.0), (1.0, 2.0), (2.0, 3.0)):
        here = inner & (truth >= 10.0**low) & (truth < 10.0**high)
        assert abs(float(np.median(relative[here])) - 1.0) < limit + (0.0 if known else 0.01)
    colour = done.channels[0] / done.channels[2]
    # JPEG keeps colour at half the resolution; a recovered curve ties the channels at code 128
    assert float(np.median(colour[inner])) == pytest.approx(0.85 / 1.25, rel=0.01 if suffix == ".png" else 0.04)


def test_a_long_exposures_ringing_near_white_does_not_take_over(tmp_path: Path) -> None:
    # t²-weighted merges give 10 to 46 % rms there: codes 250 to 254 of a frame 1000 times longer
    rate = np.full((64, 64, 3), 2.0)
    rate[:, 32:] = 2000.0
    paths = picture_bracket(tmp_path, rate, suffix=".jpg")
    done = merge(exposures(paths), Recipe(response=frozen()))
    assert float(np.median(np.abs(done.signal[:, :20] / 2.0 - 1.0))) < 0.02
    assert float(np.max(np.abs(done.signal[:, 44:] / 2000.0 - 1.0))) < 0.05


def test_a_white_picture_is_a_bound_and_no_number_is_infinite(tmp_path: Path) -> None:
    rate = np.full((8, 8, 3), 1e9)
    rate[:, :4] = 1.0
    done = merge(exposures(picture_bracket(tmp_path, rate)), Recipe(response=frozen()))
    np.testing.assert_allclose(done.signal[:, 4:], 1.0 / LADDER[-1], rtol=1e-4)
    assert np.all(done.flags[:, 4:] & SATURATED)
    assert np.all(np.isfinite(done.signal))
    assert np.all(done.signal[:, 4:] > done.signal[:, :4].max())


def test_sixteen_bits_are_merged_as_sixteen_bits(tmp_path: Path) -> None:
    # others take them for 8 bits, silently wrong by a thousandth
    rng = np.random.default_rng(0)
    rate = 10 ** rng.uniform(-1.0, 2.0, (40, 40, 1)) * np.array([0.9, 1.0, 1.1])
    paths = []
    for k, time in enumerate(LADDER):
        paths.append(tmp_path / f"{k}.png")
        codes = np.rint(65535.0 * np.clip(rate * time, 0.0, 1.0)).astype(np.uint16)
        assert cv2.imwrite(str(paths[-1]), codes[..., ::-1])
    done = merge(exposures(paths), Recipe(luminance_row=(0.0, 1.0, 0.0)))
    np.testing.assert_allclose(done.signal, rate[..., 1], rtol=2e-3)
    assert float(np.median(np.abs(done.signal / rate[..., 1] - 1.0))) < 1e-4


def test_the_memorial_stack() -> None:
    folder = recording("memorial")
    times = read_times(folder / "shutter_times.txt")
    files = sorted(folder.glob("*.png"))
    done = merge([Exposure(p, t) for p, t in zip(files, times, strict=True)], Recipe(keep_channels=True))
    assert done.signal.shape == (768, 512)
    assert np.all(np.isfinite(done.signal))
    # the nave's windows are 10,000 to 100,000 times brighter than its darkest corners
    low, high = np.quantile(done.signal, [0.005, 0.9995])
    assert 3e3 < high / low < 3e5
    # a merge must reproduce its own exposures; these scans do not lie quite on each other (4 to 10 % at edges)
    assert done.channels is not None
    assert done.response is not None
    for place, limit in ((2, 0.04), (4, 0.06)):
        codes = cv2.imread(str(files[place]))[..., 1]
        seen = done.response.curves[1][codes] / times[place]
        fair = (codes > 40) & (codes < 220)
        off = np.log(done.channels[1][fair] / seen[fair])
        assert abs(float(np.median(off))) < 0.04
        assert float(np.median(np.abs(off))) < limit


def test_all_mistakes_come_in_one_error(tmp_path: Path, bracket: tuple[list[Path], np.ndarray]) -> None:
    good = bracket[0][0]
    rng = np.random.default_rng(0)
    write_dng(tmp_path / "small.dng", raw_codes(np.full((64, 64), 5.0), 1.0, rng), 1.0)
    write_dng(tmp_path / "open.dng", raw_codes(scene(), 1.0, rng), 1.0, f_number=2.8)
    (tmp_path / "cut.dng").write_bytes(good.read_bytes()[:5000])
    assert cv2.imwrite(str(tmp_path / "picture.png"), np.zeros((240, 320, 3), np.uint8))
    chosen = [
        good,
        tmp_path / "small.dng",
        tmp_path / "open.dng",
        tmp_path / "cut.dng",
        tmp_path / "picture.png",
        bracket[0][1],
    ]
    with pytest.raises(DataError) as caught:
        merge([Exposure(p, t) for p, t in zip(chosen, [8.0, 1.0, 1.0, 1.0, None, -4.0], strict=True)])
    text = str(caught.value)
    for part in (
        "small.dng: 64 x 64",
        "open.dng: its aperture",
        "cut.dng: the file is truncated",
        "picture.png",
        "-4 s",
    ):
        assert part in text, text
    assert "does not tell its exposure time" in text
    assert text.count("\n") == 6  # a line for each mistake after the first one


def test_one_exposure_is_no_bracket(bracket: tuple[list[Path], np.ndarray]) -> None:
    with pytest.raises(DataError, match="at least two"):
        merge([Exposure(bracket[0][0])])
