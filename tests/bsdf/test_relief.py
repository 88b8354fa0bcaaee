"""Rounded pyramids, dimples and scans: against the exact pyramids, and against what must be."""

import math

import numpy as np
import pytest

from analysis.bsdf.prism import PrismSheet, scatter_samples
from analysis.bsdf.relief import ReliefSheet, dimple_map, pyramid_map, rounded
from labdaq.errors import ConfigError

CLEAR = {"absorption_per_mm": 0.0}


def travel(theta_deg: float, phi_deg: float = 17.0) -> np.ndarray:
    t, p = math.radians(theta_deg), math.radians(phi_deg)
    return np.array([math.sin(t) * math.cos(p), math.sin(t) * math.sin(p), -math.cos(t)])


def totals(sheet: PrismSheet | ReliefSheet, side: str, theta_deg: float, m: int = 8000):
    """Transmittance, its standard error, and all that came out."""
    out, w = scatter_samples(sheet, side, travel(theta_deg), m, np.random.default_rng(1))
    through = np.where((out[0, :, 2] < 0) == (side == "flat"), w[0], 0.0)
    return through.mean(), through.std() / math.sqrt(m), w.mean()


@pytest.mark.parametrize("side", ["flat", "prism"])
@pytest.mark.parametrize("theta", [0, 35, 60])
def test_a_map_of_sharp_pyramids_is_the_exact_sheet(side: str, theta: float) -> None:
    sheet = PrismSheet()
    exact, error, _ = totals(sheet, side, theta, 40_000)
    mapped, error_map, _ = totals(sheet.relief(256), side, theta)
    # edges blunted over one of 256 samples take up about 1.5 % of the area
    assert abs(mapped - exact) < 4 * math.hypot(error, error_map) + 0.01


@pytest.mark.parametrize("side", ["flat", "prism"])
def test_a_clear_relief_loses_next_to_nothing(side: str) -> None:
    sheet = PrismSheet(
        peak_radius_mm=0.6,
        valley_radius_mm=0.4,
        dimple_radius_mm=1.5,
        dimple_depth_mm=0.3,
        slope_error_deg=2.0,
        **CLEAR,
    )
    for theta in (0, 50, 80):
        assert totals(sheet, side, theta, 4000)[2] > 0.999  # rays that graze the relief for ever are given up


def test_rounding_gives_an_undeviated_beam() -> None:
    """Report, A.1: a perfect pyramid has no straight ray; rounded peaks and valleys let some through."""
    sharp = PrismSheet(slope_error_deg=0.0, **CLEAR)
    soft = PrismSheet(slope_error_deg=0.0, peak_radius_mm=1.0, valley_radius_mm=1.0, **CLEAR)
    shares = []
    for sheet in (sharp, soft):
        out, w = scatter_samples(sheet, "flat", travel(0), 20_000, np.random.default_rng(2))
        straight = out[0, :, 2] < -math.cos(math.radians(3))
        shares.append(w[0, straight].sum() / w.sum())
    assert shares[0] == 0
    # deviation is about (index - 1) times the slope: within 3 degrees lie slopes up to 6.1 degrees, which a sphere of
    # radius r shows over a disc of r sin 6.1: peaks and valleys of 1 mm in a cell of 25 mm2 and along its edges
    assert 0.004 < shares[1] < 0.1
    # and the arms of the cross are still there
    out, _ = scatter_samples(soft, "flat", travel(0), 20_000, np.random.default_rng(3))
    d = out[0][(out[0, :, 2] < -0.9) & (out[0, :, 2] > -0.98)]
    phi = np.degrees(np.arctan2(d[:, 1], d[:, 0])) % 90
    assert (np.minimum(phi, 90 - phi) < 10).mean() > 0.7


def test_rounding_keeps_within_the_sharp_relief() -> None:
    sharp = pyramid_map(5.0, 27.0, 128)
    peaks = rounded(sharp, 5.0, 0.8, 0.0)
    valleys = rounded(sharp, 5.0, 0.0, 0.8)
    assert (peaks <= sharp + 1e-12).all()
    assert (valleys >= sharp - 1e-12).all()
    # a ball in a square pyramid of slope s touches the facets and ends r (1 / cos s - 1) below the peak
    lost = 0.8 * (1 / math.cos(math.radians(27)) - 1)
    assert sharp.max() - peaks.max() == pytest.approx(lost, abs=0.02)  # samples are 0.04 mm wide
    assert rounded(sharp, 5.0, 0.0, 0.0) is sharp


def test_a_dimple_is_a_cap() -> None:
    depth = dimple_map(5.0, 1.5, 0.3, 200)
    assert depth.max() == pytest.approx(0.3, abs=1e-4)
    volume = depth.sum() * (5 / 200) ** 2
    assert volume == pytest.approx(math.pi * 0.3 * (3 * 1.5**2 + 0.3**2) / 6, rel=0.01)
    assert not dimple_map(5.0, 1.5, 0.0, 50).any()


def test_a_flat_relief_is_a_slab() -> None:
    flat = ReliefSheet(
        index=1.491, absorption_per_mm=0.03, slope_error_deg=0.0, pitch_mm=5.0,
        prism_mm=np.full((16, 16), 3.0), flat_mm=np.zeros((16, 16)),
    )  # fmt: skip
    mapped, error, total = totals(flat, "flat", 50, 40_000)
    exact, error_exact, total_exact = totals(PrismSheet(slope_deg=0.0, slope_error_deg=0.0), "flat", 50, 40_000)
    assert abs(mapped - exact) < 4 * math.hypot(error, error_exact)
    assert total == pytest.approx(total_exact, abs=0.003)


def test_a_scan_can_be_any_shape() -> None:
    """A rippled sheet, as the report's tube lens has on its flat side."""
    axis = 2 * np.pi * (np.arange(64) + 0.5) / 64
    ripple = 0.05 * (1 + np.cos(axis))[:, None] * np.ones(64)
    sheet = ReliefSheet(
        index=1.491, absorption_per_mm=0.0, slope_error_deg=0.0, pitch_mm=5.0,
        prism_mm=pyramid_map(5.0, 27.0, 64) + 1.7, flat_mm=ripple,
    )  # fmt: skip
    out, w = scatter_samples(sheet, "flat", travel(0), 4000, np.random.default_rng(4))
    assert w.mean() > 0.999
    assert out[0, :, 0].std() > out[0, :, 1].std() * 1.01  # ripples along x spread the light along x


def test_what_cannot_be() -> None:
    with pytest.raises(ConfigError, match=r"(?s)peak_radius_mm.*dimple_radius_mm.*dimple_depth_mm"):
        PrismSheet(peak_radius_mm=3.0, dimple_radius_mm=2.8, dimple_depth_mm=3.5)
    maps = {"index": 1.5, "absorption_per_mm": 0.0, "slope_error_deg": 0.0, "pitch_mm": 5.0}
    with pytest.raises(ConfigError, match="below the flat side"):
        ReliefSheet(prism_mm=np.full((8, 8), 0.2), flat_mm=np.full((8, 8), 0.3), **maps)
    with pytest.raises(ConfigError, match="square"):
        ReliefSheet(prism_mm=np.ones((8, 7)), flat_mm=np.zeros((8, 7)), **maps)
    with pytest.raises(ConfigError, match="not finite"):
        ReliefSheet(prism_mm=np.full((8, 8), np.nan), flat_mm=np.zeros((8, 8)), **maps)
