"""The density of a prismatic sheet's light in given directions, beside its traced samples."""

import numpy as np
import pytest
from numpy.typing import NDArray

from analysis.bsdf.prism import PrismSheet, Side, scatter_samples
from analysis.bsdf.prism_aim import aimed_many, shown_area

Floats = NDArray[np.float64]
SHEET = PrismSheet()


def density(d: Floats, directions: Floats, sheet: PrismSheet = SHEET, rays: int = 100_000) -> Floats:
    """Mean density [1/sr] towards directions (n, 3), all on one side, for light along d; sheet's frame, z up."""
    wanted = np.zeros((4, len(directions)), dtype=np.float32)
    wanted[:3] = (directions * np.array([1.0, 1.0, -1.0])).T  # z up becomes depth below the flat side
    wanted[3] = 1.0
    into = bool(wanted[2, 0] < 0.0)
    if into:  # as they are inside, before the flat side refracts them
        wanted[:2] /= sheet.index
        wanted[2] = -np.sqrt(1.0 - wanted[0] ** 2 - wanted[1] ** 2)
    found = np.zeros(len(directions))
    reach = np.zeros(len(directions), dtype=np.float32)
    aimed_many((d[0], d[1], -d[2]), rays, np.uint64(5), sheet.geometry(), into, wanted, reach, found)
    return found


def hemisphere(steps: int, up: float) -> tuple[Floats, Floats]:
    """Middles of cells in equal steps of angle, and their solid angles."""
    step = 0.5 * np.pi / steps
    theta, phi = (a.ravel() for a in np.meshgrid((np.arange(steps) + 0.5) * step, (np.arange(4 * steps) + 0.5) * step))
    directions = np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), up * np.cos(theta)], axis=1)
    return directions, np.sin(theta) * step**2


def light(side: Side, tilt_deg: float) -> Floats:
    t = np.radians(tilt_deg)
    return np.array([np.sin(t) * 0.8, np.sin(t) * 0.6, np.cos(t) if side == "prism" else -np.cos(t)])


@pytest.mark.parametrize(
    ("side", "tilt"),
    [
        pytest.param("prism", 0.0, marks=pytest.mark.slow),
        ("prism", 40.0),
        pytest.param("prism", 70.0, marks=pytest.mark.slow),
        pytest.param("flat", 0.0, marks=pytest.mark.slow),
        pytest.param("flat", 40.0, marks=pytest.mark.slow),
        ("flat", 70.0),
    ],
)
def test_density_adds_up_to_the_transmittance(side: Side, tilt: float) -> None:
    d = light(side, tilt)
    cells, solid = hemisphere(60, float(np.sign(d[2])))
    out, weight = scatter_samples(SHEET, side, d, 400_000, np.random.default_rng(1))
    expected = float(np.where(out[0, :, 2] * d[2] > 0.0, weight[0], 0.0).mean())
    # 20,000 rays: 0.3 % of the transmittance's own noise
    assert np.sum(density(d, cells, rays=20_000) * solid) == pytest.approx(expected, abs=0.012)


@pytest.mark.parametrize(("side", "leaves"), [("prism", 1.0), ("flat", 1.0), ("prism", -1.0)])
def test_density_is_what_samples_scatter(side: Side, leaves: float) -> None:
    """Means over caps of 2 degrees, through and (``leaves`` -1) back; a flat side's reflection has no density."""
    d = light(side, 55.0)
    rng = np.random.default_rng(2)
    out, weight = scatter_samples(SHEET, side, d, 1_000_000, rng)
    there = out[0][out[0, :, 2] * d[2] * leaves > 0.0]
    here = there[rng.integers(0, len(there), 6)]
    share = weight[0][out[0, :, 2] * d[2] * leaves > 0.0] / 1e6
    edge = np.cos(np.radians(2.0))
    k = np.arange(100)[:, None]
    for middle in here:
        inside = there @ middle > edge
        counted, number = share[inside].sum() / (2.0 * np.pi * (1.0 - edge)), inside.sum()
        if number < 400 or abs(middle[2]) < 0.1:
            continue
        u = np.cross(middle, [0.3, 0.5, 0.81])
        u /= np.linalg.norm(u)
        angle, turn = np.radians(2.0) * np.sqrt((k + 0.5) / len(k)), 2.399963 * k  # a sunflower's seeds
        across = np.cos(turn) * u + np.sin(turn) * np.cross(middle, u)
        cap = np.cos(angle) * middle + np.sin(angle) * across
        assert density(d, cap, rays=60_000).mean() == pytest.approx(counted, rel=4.0 * number**-0.5 + 0.03)


def test_density_is_reciprocal() -> None:
    """Helmholtz: density over the cosine of the way out is the same both ways."""
    one, two = light("prism", 30.0), np.array([0.3, -0.35, np.sqrt(1.0 - 0.09 - 0.1225)])
    there = density(one, two[None], rays=400_000)[0] / two[2]
    back = density(-two, -one[None], rays=400_000)[0] / one[2]
    assert there == pytest.approx(back, rel=0.05)


def test_area_that_a_rough_facet_shows() -> None:
    """Beside the mean over drawn slopes; grazing light sees the bits that turn towards it."""
    rng = np.random.default_rng(3)
    slopes = 0.07 * rng.normal(size=400_000)
    for cosine in (1.0, 0.3, 0.05, 0.0):
        sine = float(np.sqrt(1.0 - cosine**2))
        expected = np.maximum(0.0, cosine - slopes * sine).mean()
        assert shown_area(cosine, sine, 0.07) == pytest.approx(expected, abs=2e-4)
