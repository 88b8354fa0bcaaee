"""The concealed optics against what physics says must be: energy, equilibrium, Fresnel, reciprocity."""

import math

import numpy as np
import pytest

from simulators.hidden.compiled import compiled
from simulators.hidden.draws import State, start, uniform
from simulators.hidden.lens import Lens, LensNumbers, through
from simulators.hidden.surfaces import clear_slab, fresnel, matt

RAYS = 400_000


@compiled
def _furnace(lens: LensNumbers, rays: int, state: State, leaving: np.ndarray) -> int:
    """Send even light into a sheet from both sides; count what leaves by side and cos² of its angle."""
    lost = 0
    start(state, 7, 1)
    for i in range(rays):
        dx, dy, dz = matt(state, 0.0, 0.0, 1.0 if i % 2 == 0 else -1.0)
        side, dx, dy, dz, weight = through(state, lens, dx, dy, dz, uniform(state), uniform(state))
        if side == 0:
            lost += 1
        else:
            leaving[0 if side < 0 else 1, min(9, int(dz * dz * 10.0))] += weight
    return lost


@compiled
def _one_way(lens: LensNumbers, rays: int, state: State, x: float, y: float, z: float, counts: np.ndarray) -> None:
    """Send a beam at a sheet; count by side what leaves, and the mean direction of what passes."""
    start(state, 3, 2)
    for _ in range(rays):
        side, dx, dy, _, weight = through(state, lens, x, y, z, uniform(state), uniform(state))
        counts[0 if side < 0 else 1] += weight
        counts[2] += weight * math.sqrt(dx * dx + dy * dy) if side < 0 else 0.0


@pytest.mark.parametrize(
    ("lens", "tolerance"),
    [
        # a box of a side holds 20,000 counts: 0.7 % standard deviation, so 3 % is over four of them
        (Lens(absorption_per_mm=0.0, blur_deg=0.0), 0.03),
        (Lens(absorption_per_mm=0.0, blur_deg=4.0), 0.03),
        (Lens(absorption_per_mm=0.0, blur_deg=0.0, slopes_deg=(40.0, 20.0, 30.0, 30.0)), 0.03),
        (Lens(kind="clear", absorption_per_mm=0.0), 0.03),
        # normals of ridges that are not built as ridges: equilibrium holds to a few per cent, energy exactly
        (Lens(absorption_per_mm=0.0, blur_deg=5.0, blur_power=0.8, rounded=0.1), 0.08),
    ],
)
def test_even_light_stays_even(lens: Lens, tolerance: float) -> None:
    leaving = np.zeros((2, 10))
    lost = _furnace(lens.numbers(), RAYS, np.zeros(2, dtype=np.uint64), leaving)
    assert lost <= 5
    assert leaving.sum() == pytest.approx(RAYS, rel=1e-4)
    assert leaving / (RAYS / 20) == pytest.approx(np.ones((2, 10)), abs=tolerance)


def test_a_clear_pane_is_fresnels() -> None:
    # n = 1.491 at normal incidence: r = ((n-1)/(n+1))² and T = (1-r)/(1+r) = 0.9252 (radiance.md section 4)
    assert clear_slab(1.0, 1.491) == pytest.approx(0.9252, abs=1e-4)
    assert fresnel(1.0, 1.0 / 1.491) == pytest.approx((0.491 / 2.491) ** 2)
    brewster = math.cos(math.atan(1.491))
    sine2 = (1.0 - brewster**2) / 1.491**2
    s = ((brewster - 1.491 * math.sqrt(1.0 - sine2)) / (brewster + 1.491 * math.sqrt(1.0 - sine2))) ** 2
    assert fresnel(brewster, 1.0 / 1.491) == pytest.approx(0.5 * s)  # the p part vanishes
    assert fresnel(0.3, 1.491) == 1.0  # beyond the critical angle


def test_light_through_a_prism_turns_by_snells_law() -> None:
    # from the prisms, straight down: facet of 27°, then the flat; sin of the exit angle by Snell twice
    slope = math.radians(27.0)
    inside = slope - math.asin(math.sin(slope) / 1.491)
    expected = 1.491 * math.sin(inside)
    counts = np.zeros(3)
    lens = Lens(blur_deg=0.0, absorption_per_mm=0.0).numbers()
    _one_way(lens, 50_000, np.zeros(2, dtype=np.uint64), 0.0, 0.0, -1.0, counts)
    assert counts[:2].sum() == pytest.approx(50_000)
    # a tenth goes other ways (reflected inside, or caught by the next pyramid)
    assert counts[2] / counts[0] == pytest.approx(expected, rel=0.1)


def test_two_way_transmission_is_reciprocal() -> None:
    # the share of even light that passes is the same from both sides of a lossless sheet
    counts = np.zeros((2, 2))
    lens = Lens(absorption_per_mm=0.0).numbers()
    state = np.zeros(2, dtype=np.uint64)
    for k, up in enumerate((1.0, -1.0)):
        _even_one_way(lens, RAYS, state, up, counts[k])
    assert counts[0, 1] / counts[0].sum() == pytest.approx(counts[1, 0] / counts[1].sum(), abs=0.004)


@compiled
def _even_one_way(lens: LensNumbers, rays: int, state: State, up: float, counts: np.ndarray) -> None:
    start(state, 11, 4)
    for _ in range(rays):
        dx, dy, dz = matt(state, 0.0, 0.0, up)
        side, dx, dy, dz, weight = through(state, lens, dx, dy, dz, uniform(state), uniform(state))
        counts[0 if side < 0 else 1] += weight


def test_a_seed_gives_the_same_numbers_and_rays_have_their_own() -> None:
    state = np.zeros(2, dtype=np.uint64)
    start(state, 5, 9)
    first = [uniform(state) for _ in range(1000)]
    start(state, 5, 9)
    assert [uniform(state) for _ in range(1000)] == first
    start(state, 5, 10)
    assert [uniform(state) for _ in range(1000)] != first
    assert min(first) > 0.0 and max(first) < 1.0
    assert np.mean(first) == pytest.approx(0.5, abs=0.05)
