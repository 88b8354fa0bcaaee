"""Responses: kept, read, recovered."""

from pathlib import Path

import cv2
import numpy as np
import pytest

from analysis.hdr.recover import recover_response
from analysis.hdr.response import REFERENCE_CODE, Response
from analysis.hdr.times import read_times
from labdaq.errors import DataError
from tests.analysis.hdr.camera import LADDER, picture_codes, tone
from tests.analysis.recordings import recording


def samples(seed: int = 0, places: int = 20_000, times: tuple[float, ...] = LADDER) -> np.ndarray:
    rng = np.random.default_rng(seed)
    rate = 10 ** rng.uniform(-3.0, 3.5, (places, 1)) * np.array([0.8, 1.0, 1.3])
    return np.stack([picture_codes(rate, time, rng) for time in times])


def true_curve() -> np.ndarray:
    linear = np.linspace(0.0, 1.0, 400_001)
    return np.interp(np.arange(256) / 255.0, tone(linear), linear)


def test_a_known_curve_is_recovered() -> None:
    found = recover_response(samples(), LADDER)
    truth = true_curve()
    relative = found.curves / truth[None, :].clip(1e-9)
    relative /= relative[:, REFERENCE_CODE : REFERENCE_CODE + 1]
    # codes 12 to 245; below, a code is 5 % and more of the signal
    np.testing.assert_allclose(relative[:, 12:246], 1.0, atol=0.02)
    assert np.sqrt(np.mean((relative[:, 30:240] - 1.0) ** 2)) < 0.005
    assert found.residual is not None
    assert found.residual < 0.1


def test_times_and_curve_trade_a_power_which_a_frozen_response_would_not() -> None:
    # times off by a power bend the curve by it; this is why a response should be measured once and kept
    bent = recover_response(samples(), [t * 1.03**k for k, t in enumerate(LADDER)])
    truth = true_curve()
    slope = np.polyfit(np.log(truth[30:240]), np.log(bent.curves[1, 30:240]), 1)[0]
    # each stop is told as 1 - 0.0426 stops, and so is each doubling of the recovered signal
    assert slope == pytest.approx(1.0 - np.log2(1.03), abs=0.01)


def test_moved_places_do_not_bend_the_curve() -> None:
    codes = samples()
    rng = np.random.default_rng(5)
    for frame in codes:  # three in a hundred places show something else in each exposure
        moved = rng.random(frame.shape[0]) < 0.03
        frame[moved] = rng.integers(0, 256, (np.count_nonzero(moved), 3))
    found = recover_response(codes, LADDER)
    relative = found.curves[1] / true_curve().clip(1e-9)
    np.testing.assert_allclose((relative / relative[REFERENCE_CODE])[20:240], 1.0, atol=0.03)


def test_the_recovered_memorial_response_never_falls() -> None:
    # OpenCV's CalibrateDebevec falls from 3.74 to 3.53 near white on this stack (measured)
    folder = recording("memorial")
    times = read_times(folder / "shutter_times.txt")
    stack = np.stack([cv2.imread(str(p))[::3, ::3, ::-1].reshape(-1, 3) for p in sorted(folder.glob("*.png"))])
    found = recover_response(stack, times)
    assert np.all(np.diff(found.curves) > 0.0)


def test_nothing_in_common_is_said(tmp_path: Path) -> None:
    with pytest.raises(DataError, match="--response"):
        recover_response(np.zeros((2, 5000, 3), np.uint8), [1.0, 0.5])


def test_photospheres_polynomial_file(tmp_path: Path) -> None:
    real = Response.load(recording("fisheye-bracket/cal/Response_function.rsp"))
    assert real.curves[0, 255] == pytest.approx(1.0, abs=1e-5)
    # third order and up: 2.48363666666666 z^4 - 2.57911666666665 z^3 + ...
    z = 128 / 255
    expected = np.polyval([2.48363666666666, -2.57911666666665, 1.00832766666665, 0.0852399666666787, 0.001911033], z)
    assert real.curves[0, 128] == pytest.approx(expected, rel=1e-6)
    assert np.all(real.curves[:, 0] == 0.0)
    for text, complaint in (("4 1 2\n", "line 1"), ("1 1 0\n1 1 0\n", "3|three|one line"), ("1 -1 1\n", "grow")):
        (tmp_path / "bad.rsp").write_text(text)
        with pytest.raises(DataError, match=complaint):
            Response.load(tmp_path / "bad.rsp")


def test_a_kept_response_comes_back(tmp_path: Path) -> None:
    found = Response.srgb()
    found.save(tmp_path / "response.json")
    again = Response.load(tmp_path / "response.json")
    np.testing.assert_array_equal(again.curves, found.curves)
    with pytest.raises(DataError, match="16"):
        again.table(16)
    assert Response.linear().table(16).shape == (3, 65536)
    np.testing.assert_allclose(Response.srgb().table(16)[:, ::257], Response.srgb().curves, atol=1e-12)
    (tmp_path / "response.json").write_text('{"curves": [[1, 2]]}')
    with pytest.raises(DataError, match=r"response\.json"):
        Response.load(tmp_path / "response.json")
