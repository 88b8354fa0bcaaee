"""The prismatic sheet: laws of optics, and what the report's Appendix A saw."""

import math

import numpy as np
import pytest

from analysis.bsdf.prism import PrismSheet, prism_tracer, scatter_samples
from labdaq.errors import ConfigError

CLEAR = {"absorption_per_mm": 0.0, "slope_error_deg": 0.0}


def travel(theta_deg: float, phi_deg: float = 0.0) -> np.ndarray:
    t, p = math.radians(theta_deg), math.radians(phi_deg)
    return np.array([math.sin(t) * math.cos(p), math.sin(t) * math.sin(p), -math.cos(t)])


def totals(sheet: PrismSheet, side: str, theta_deg: float, phi_deg: float = 0.0, m: int = 40_000, seed: int = 1):
    """Transmittance and reflectance for one direction, with their standard errors."""
    out, w = scatter_samples(sheet, side, travel(theta_deg, phi_deg), m, np.random.default_rng(seed))
    through = (out[0, :, 2] < 0) == (side == "flat")
    parts = [np.where(through, w[0], 0.0), np.where(through, 0.0, w[0])]
    return [(p.mean(), p.std() / math.sqrt(m)) for p in parts]


def slab(theta_deg: float, index: float, thickness: float, absorption: float) -> tuple[float, float]:
    """Transmittance and reflectance of a plane slab, all inter-reflections (e.g. Duffie and Beckman, section 5.3)."""
    ci = math.cos(math.radians(theta_deg))
    ct = math.sqrt(1 - (1 - ci * ci) / index**2)
    a = math.exp(-absorption * thickness / ct)
    r = 0.5 * (((ci - index * ct) / (ci + index * ct)) ** 2 + ((ct - index * ci) / (ct + index * ci)) ** 2)
    return (1 - r) ** 2 * a / (1 - (r * a) ** 2), r * (1 + (1 - r) ** 2 * a * a / (1 - (r * a) ** 2))


@pytest.mark.parametrize("theta", [0, 40, 70, 85])
@pytest.mark.parametrize("side", ["flat", "prism"])
def test_without_prisms_it_is_the_fresnel_slab(theta: float, side: str) -> None:
    # rays carry no polarisation, so the formula is the one for the mean reflectance, not the mean of two slabs
    sheet = PrismSheet(slope_deg=0.0, slope_error_deg=0.0)
    for (value, error), exact in zip(totals(sheet, side, theta), slab(theta, 1.491, 3.0, 0.03), strict=True):
        assert abs(value - exact) < 5 * error


@pytest.mark.parametrize("side", ["flat", "prism"])
@pytest.mark.parametrize("slope_error", [0.0, 4.0, 12.0])
def test_a_clear_sheet_loses_nothing(side: str, slope_error: float) -> None:
    directions = np.array([travel(t, p) for t in (0, 20, 50, 80, 89) for p in (0, 33)])
    sheet = PrismSheet(absorption_per_mm=0.0, slope_error_deg=slope_error)
    out, w = scatter_samples(sheet, side, directions, 2000, np.random.default_rng(0))
    assert np.all(w == 1.0)
    assert np.abs(np.linalg.norm(out, axis=-1) - 1).max() < 1e-9


def test_a_45_degree_pyramid_lets_no_normal_light_through() -> None:
    """Report, A.1: total internal reflection at normal incidence, zero transmittance."""
    (t, _), (r, _) = totals(PrismSheet(slope_deg=45.0, **CLEAR), "flat", 0)
    assert (t, r) == (0.0, 1.0)


def test_the_split_beam_cross() -> None:
    """Report, A.1: a perfect pyramid leaves no straight beam but four, along the directions of its facets."""
    out, w = scatter_samples(PrismSheet(**CLEAR), "flat", travel(0), 40_000, np.random.default_rng(2))
    d, w = out[0], w[0]
    straight = d[:, 2] < -math.cos(math.radians(2))
    assert not straight.any()
    # refraction at a facet of 27 degrees: asin(1.491 sin 27) - 27
    deviation = math.degrees(math.asin(1.491 * math.sin(math.radians(27)))) - 27
    theta = np.degrees(np.arccos(-d[:, 2]))
    first = np.abs(theta - deviation) < 1e-6
    # Fresnel at the flat side and at the facet, once each
    share = 0.0388834  # ((1.491 - 1) / (1.491 + 1))**2
    c_in, c_out = math.cos(math.radians(27)), math.cos(math.radians(27 + deviation))
    rs = ((1.491 * c_in - c_out) / (1.491 * c_in + c_out)) ** 2
    rp = ((1.491 * c_out - c_in) / (1.491 * c_out + c_in)) ** 2
    expected = (1 - ((1.491 - 1) / (1.491 + 1)) ** 2) * (1 - (rs + rp) / 2)
    assert share == pytest.approx(((1.491 - 1) / (1.491 + 1)) ** 2, rel=1e-3)
    assert first.mean() == pytest.approx(expected, abs=4 * math.sqrt(expected * (1 - expected) / 40_000))
    phi = np.degrees(np.arctan2(d[first, 1], d[first, 0])) % 360
    arms = np.bincount(np.round(phi / 90).astype(int) % 4, minlength=4)
    assert np.abs((phi + 45) % 90 - 45).max() < 1e-6  # only along x and y
    assert np.abs(arms / first.sum() - 0.25).max() < 0.015  # five standard errors of a quarter of 36 000


def test_the_cross_turns_with_the_sheet() -> None:
    rng = np.random.default_rng(3)
    for sheet, arm in (
        (PrismSheet(orientation_deg=20.0, **CLEAR), 20.0),
        (PrismSheet(orientation_deg=20.0, mirrored=True, **CLEAR), 70.0),
    ):
        out, _ = scatter_samples(sheet, "flat", travel(0), 2000, rng)
        d = out[0][out[0, :, 2] < -0.9]
        phi = np.degrees(np.arctan2(d[:, 1], d[:, 0])) % 90
        assert np.median(phi) == pytest.approx(arm, abs=1e-6)


def test_an_isotropic_sheet_has_no_arms() -> None:
    out, _ = scatter_samples(PrismSheet(isotropic=True, **CLEAR), "flat", travel(0), 20_000, np.random.default_rng(4))
    d = out[0][out[0, :, 2] < -0.9]
    phi = np.degrees(np.arctan2(d[:, 1], d[:, 0])) % 90
    counts = np.histogram(phi, bins=9, range=(0, 90))[0]
    chi2 = ((counts - counts.mean()) ** 2 / counts.mean()).sum()
    assert chi2 < 26.1  # 99.9 % point of chi-square with 8 degrees of freedom


def test_both_sides_transmit_the_same_diffuse_light() -> None:
    """Reciprocity: the bi-hemispherical transmittances of the two sides are equal, with absorption and blur too."""
    rng = np.random.default_rng(5)
    n = 60_000
    u, v = rng.random((2, n))
    cosine = np.sqrt(u)  # Lambertian
    sine, phi = np.sqrt(1 - u), 2 * np.pi * v
    directions = np.stack([sine * np.cos(phi), sine * np.sin(phi), cosine], axis=1)
    shares = []
    for side, sign in (("flat", -1), ("prism", 1)):
        out, w = scatter_samples(PrismSheet(), side, directions, 1, rng)
        part = np.where(out[:, 0, 2] * sign > 0, w[:, 0], 0.0)
        shares.append((part.mean(), part.std() / math.sqrt(n)))
    (a, ea), (b, eb) = shares
    assert abs(a - b) < 4 * math.hypot(ea, eb)


@pytest.mark.parametrize("theta", [0, 50, 75])
def test_a_rough_surface_shows_the_slopes_that_face_the_ray(theta: float) -> None:
    """Visible normals: slopes p along the ray are met in proportion to cos + p sin, so their mean is s^2 tan."""
    from analysis.bsdf.optics import rough_normal

    sigma, state = 0.05, np.array([7], dtype=np.uint64)
    t = math.radians(theta)
    d = (math.sin(t), 0.0, -math.cos(t))
    n = 40_000
    normals = np.array([rough_normal(0.0, 0.0, 1.0, *d, sigma, state) for _ in range(n)])
    slopes = -normals[:, :2] / normals[:, 2:]
    # at 75 degrees cos is five standard deviations of the slope times sin: nothing is hidden
    expected = sigma**2 * math.tan(t)
    assert slopes[:, 0].mean() == pytest.approx(expected, abs=4 * sigma / math.sqrt(n))
    assert slopes[:, 1].mean() == pytest.approx(0, abs=4 * sigma / math.sqrt(n))
    # variance s^2 - mean^2 along, s^2 across; 0.3 % of the variance is cut off at four sigma
    assert slopes[:, 1].std() == pytest.approx(sigma, rel=0.02)
    assert slopes[:, 0].var() == pytest.approx(sigma**2 - expected**2, rel=0.03)
    np.testing.assert_allclose(np.linalg.norm(normals, axis=1), 1.0, rtol=1e-6)


def test_the_sheet_in_the_frame_of_a_bsdf() -> None:
    """x east, y south, z down: what turns counter-clockwise seen from above turns the other way there."""
    tracer = prism_tracer(PrismSheet(orientation_deg=20.0, **CLEAR))
    down = np.array([[0.0, 0.0, 1.0]])
    for side, sign in (("front", 1.0), ("back", -1.0)):
        out, _ = tracer(side, sign * down, 4000, np.random.default_rng(6))
        d = out[0][out[0, :, 2] * sign > 0.9]
        phi = np.degrees(np.arctan2(d[:, 1], d[:, 0])) % 90
        assert np.median(phi) == pytest.approx(70, abs=1e-6)


def test_rays_meet_the_facets_where_they_are() -> None:
    from analysis.bsdf.prism_trace import next_inside, next_outside

    sheet = PrismSheet()
    g = sheet.geometry()
    rise = math.tan(math.radians(27))
    for x, y, surface in ((0.7, 0.2, 1), (-1.9, 0.3, 2), (0.1, 2.2, 3), (0.4, -0.6, 4)):
        depth = 3.0 - rise * max(abs(x), abs(y))
        assert next_inside(x, y, 0.0, 0.0, 0.0, 1.0, g) == pytest.approx((x, y, depth, depth, surface))
        assert next_outside(x, y, 3.0, 0.0, 0.0, -1.0, g) == pytest.approx((x, y, depth, surface))
    # a ray that leaves its cell sideways below the valleys meets the next pyramid
    x, y, w, path, surface = next_inside(0.0, 0.1, 0.0, math.sin(1.2), 0.0, math.cos(1.2), g)
    travelled = path * math.sin(1.2)
    assert travelled > 2.5
    inside_cell = (travelled + 2.5) % 5.0 - 2.5
    assert (x, y) == pytest.approx((inside_cell, 0.1))
    assert w == pytest.approx(3.0 - rise * max(abs(inside_cell), 0.1))
    assert surface in (1, 2)
    # and one that goes down from the valley leaves
    assert next_outside(2.5, 2.5, 3.0 - sheet.height_mm, 0.0, 0.0, 1.0, g)[3] == 0


def test_same_seed_same_samples() -> None:
    a = scatter_samples(PrismSheet(), "flat", travel(30), 10, np.random.default_rng(9))
    b = scatter_samples(PrismSheet(), "flat", travel(30), 10, np.random.default_rng(9))
    c = scatter_samples(PrismSheet(), "flat", travel(30), 10, np.random.default_rng(8))
    assert np.array_equal(a[0], b[0])
    assert not np.array_equal(a[0], c[0])


def test_a_sheet_that_cannot_be() -> None:
    with pytest.raises(ConfigError) as caught:
        PrismSheet(index=0.9, thickness_mm=1.0, slope_error_deg=50.0)
    for word in ("index", "thickness_mm", "slope_error_deg"):
        assert word in str(caught.value)
