"""Turning, mirroring, zonal flux, symmetry and handedness of distributions."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from analysis.photometry import Distribution
from analysis.photometry.sphere import (
    mirrored,
    resample,
    rms,
    rotated,
    rotation_matrix,
    solid_angle_weights,
    turned,
    zonal_lumens,
)
from analysis.photometry.symmetry import handedness, symmetry
from labdaq.directions import gamma_c, vector
from labdaq.errors import DataError


def lobes(seed: int = 1, top: float = 90.0, n_c: int = 48, n_g: int = 37) -> Distribution:
    """Three lobes at random places: no symmetry at all."""
    rng = np.random.default_rng(seed)
    gamma, c = np.linspace(0, top, n_g), np.arange(n_c) * 360.0 / n_c
    d = vector(gamma[None, :], c[:, None])
    table = 50 * np.cos(np.radians(gamma)).clip(0) + np.zeros((n_c, 1))
    for peak in (900, 500, 300):
        axis = vector(rng.uniform(15, 60), rng.uniform(0, 360))
        table = table + peak * np.exp(40 * (d @ axis - 1))
    return Distribution.closed(gamma, c, table)


@pytest.mark.parametrize("power", [0, 1, 3, 8])
def test_flux_of_a_cosine_power(power: int) -> None:
    gamma = np.linspace(0, 90, 181)
    d = Distribution(gamma, np.array([0, 360.0]), np.tile(np.cos(np.radians(gamma)).clip(0) ** power, (2, 1)))
    # a chord of half a degree under a curve: relative error of the order (pi/360)^2 (power + 1) / 12
    assert d.flux() == pytest.approx(2 * np.pi / (power + 1), rel=6e-5)


def test_zones_add_up_to_the_flux() -> None:
    d = lobes(top=180)
    assert zonal_lumens(d, np.arange(0, 181, 7.5)).sum() == pytest.approx(d.flux(), rel=1e-12)
    assert zonal_lumens(d, [0, 33.3, 180]).sum() == pytest.approx(d.flux(), rel=1e-12)
    even = Distribution(np.array([0, 180.0]), np.array([0, 360.0]), np.ones((2, 2)))
    assert zonal_lumens(even, [0, 60, 90, 180]) == pytest.approx(2 * np.pi * np.array([0.5, 0.5, 1.0]))
    with pytest.raises(DataError, match="zone edges"):
        zonal_lumens(d, [0, 30, 20])


def test_weights_are_the_flux() -> None:
    d = lobes()
    weights = solid_angle_weights(d.gamma_deg, d.c_deg)
    assert (weights * d.candela).sum() == pytest.approx(d.flux(), rel=1e-12)
    assert weights.sum() == pytest.approx(2 * np.pi)


@settings(max_examples=30, deadline=None)
@given(st.floats(-720, 720), st.integers(0, 100))
def test_turning_keeps_everything(angle: float, seed: int) -> None:
    d = lobes(seed)
    t = turned(d, angle)
    assert t.flux() == pytest.approx(d.flux(), rel=1e-9)
    gamma, c = np.meshgrid(np.linspace(1, 89, 12), d.c_deg[:-1])
    assert t.at(gamma, c + angle) == pytest.approx(d.at(gamma, c), rel=1e-6, abs=1e-6)
    back = turned(t, -angle)
    assert back.at(gamma, c) == pytest.approx(d.at(gamma, c), rel=1e-6, abs=1e-6)


def test_turning_is_counter_clockwise_from_above() -> None:
    d = lobes()
    up = rotation_matrix([0, 0, 1], 30.0)
    axis = vector(40, 77)
    gamma, c = gamma_c(up @ axis)
    assert turned(d, 30).at(gamma, c) == pytest.approx(d.at(40, 77))


def test_mirroring() -> None:
    d = lobes()
    for swap, image in (("east-west", -d.c_deg), ("north-south", 180 - d.c_deg)):
        m = mirrored(d, swap)
        assert m.at(35.0, image) == pytest.approx(d.at(35.0, d.c_deg))
        assert m.flux() == pytest.approx(d.flux(), rel=1e-12)
        assert mirrored(m, swap).candela == pytest.approx(d.candela)
    # C = 90 is west: exchanging east and west moves it to C = 270
    one = d.candela * 0
    one[12] = 1
    west = Distribution(d.gamma_deg, d.c_deg, one)
    assert west.at(45, 90) == 1
    assert mirrored(west, "east-west").at(45, 270) == 1
    assert mirrored(west, "north-south").at(45, 90) == 1


def test_rotation_about_any_axis() -> None:
    d = lobes(top=180, n_c=144, n_g=145)
    axis, angle = np.array([1.0, 2.0, -0.5]), 35.0
    r = rotated(d, axis, angle, np.linspace(0, 180, 145), np.linspace(0, 360, 145))
    matrix = rotation_matrix(axis, angle)
    assert matrix @ matrix.T == pytest.approx(np.eye(3), abs=1e-14)
    assert np.linalg.det(matrix) == pytest.approx(1)
    # lobes of exp(40 (cos - 1)) on a 1.25 x 2.5 degree grid, interpolated twice: curvature 40 x 900 cd / rad^2 times
    # (2.5 degrees)^2 / 8, twice, stays under 17 cd
    places = vector(np.array([20.0, 50, 80]), np.array([10.0, 200, 300]))
    assert np.abs(r.at(*gamma_c(places @ matrix.T)) - d.at(*gamma_c(places))).max() < 17
    assert r.flux() == pytest.approx(d.flux(), rel=2e-3)
    vertical = rotated(d, [0, 0, 3], 25.0, d.gamma_deg, d.c_deg)
    assert vertical.candela == pytest.approx(turned(d, 25).resampled(d.gamma_deg, d.c_deg).candela, rel=1e-9, abs=1e-6)
    with pytest.raises(DataError, match="axis"):
        rotated(d, [0, 0, 0], 10)


def test_resampling_can_keep_the_flux() -> None:
    d = lobes()
    coarse = np.array([0, 5, 15, 25, 35, 45, 55, 65, 75, 85, 90.0]), np.arange(0, 361, 22.5)
    assert abs(resample(d, *coarse).flux() / d.flux() - 1) > 1e-3
    assert resample(d, *coarse, keep_flux=True).flux() == pytest.approx(d.flux(), rel=1e-12)
    up = Distribution(np.array([100.0, 180]), np.array([0, 360.0]), np.ones((2, 2)))
    with pytest.raises(DataError, match="flux cannot be kept"):
        resample(up, [0, 90], [0, 360], keep_flux=True)


def test_symmetries_are_recognised() -> None:
    gamma, c = np.linspace(0, 90, 19), np.arange(0, 360, 5.0)
    ring = 100 * np.cos(np.radians(gamma))

    def of(wave: np.ndarray) -> Distribution:
        return Distribution.closed(gamma, c, ring * (1 + 0.3 * wave[:, None] * np.sin(np.radians(gamma))))

    angle = np.radians(c)
    assert symmetry(of(0 * angle)).name() == "rotational"
    assert symmetry(of(np.cos(2 * angle))).name() == "quadrant"
    assert symmetry(of(np.cos(angle))).name() == "bilateral about C 0-180"
    assert symmetry(of(np.cos(angle - np.radians(35)))).name() == "bilateral about C 35-215"
    assert symmetry(lobes()).name() == "none"
    half = symmetry(of(np.cos(2 * angle - 0.5)))
    assert half.half_turn == pytest.approx(0, abs=1e-12)
    assert half.quadrant > 0.01
    with pytest.raises(DataError, match="without light"):
        symmetry(of(0 * angle).scaled(0))


def test_a_deviation_is_the_distance_to_the_nearest_symmetric_distribution() -> None:
    d = lobes()
    image = mirrored(d, "east-west")
    middle = Distribution(d.gamma_deg, d.c_deg, (d.candela + image.candela) / 2)
    apart = Distribution(d.gamma_deg, d.c_deg, d.candela - middle.candela)
    # the deviation is summed on 2.5 degree planes, the weights here are exact for the surface
    assert symmetry(d).north_south == pytest.approx(rms(apart) / rms(d), rel=0.02)


@pytest.mark.parametrize(
    ("change", "verdict", "free"),
    [
        (lambda d: d, "same", "same"),
        (lambda d: mirrored(d, "east-west"), "mirrored east-west", "mirrored"),
        (lambda d: mirrored(d, "north-south"), "mirrored north-south", "mirrored"),
        (lambda d: turned(d, 180), "turned by 180", "same"),
        (lambda d: turned(d, 40), None, "same"),
    ],
)
def test_handedness(change, verdict, free) -> None:  # type: ignore[no-untyped-def]
    d = lobes(3)
    rng = np.random.default_rng(0)
    other = change(d).scaled(0.7)
    noisy = Distribution(
        other.gamma_deg, other.c_deg, other.candela * (1 + 0.03 * rng.standard_normal(other.candela.shape))
    )
    result = handedness(d, noisy)
    if verdict is not None:
        assert result.verdict() == verdict
    assert result.verdict_with_any_turn() == free
    if change(d).c_deg.size == d.c_deg.size and verdict is None:
        assert result.turn_same_deg == pytest.approx(320, abs=2.5)


def test_the_measured_turn_undoes_the_turn() -> None:
    d = lobes(5)
    result = handedness(d, turned(d, 40))
    assert turned(turned(d, 40), result.turn_same_deg).at(40, 100) == pytest.approx(float(d.at(40, 100)), rel=1e-6)
    assert result.best_same == pytest.approx(1)


def test_a_single_lobe_has_no_handedness_of_its_own() -> None:
    gamma, c = np.linspace(0, 90, 19), np.arange(0, 360, 5.0)
    table = (
        100 * np.cos(np.radians(gamma)) * (1 + 0.5 * np.cos(np.radians(c - 70))[:, None] * np.sin(np.radians(gamma)))
    )
    d = Distribution.closed(gamma, c, table)
    assert handedness(d, mirrored(d, "east-west")).verdict_with_any_turn() == "undecided"
    assert handedness(d, mirrored(d, "east-west")).verdict() == "mirrored east-west"


def test_nothing_to_compare() -> None:
    flat = Distribution(np.array([0.0, 90]), np.array([0, 360.0]), np.ones((2, 2)))
    with pytest.raises(DataError, match="no handedness"):
        handedness(flat, lobes())
    with pytest.raises(DataError, match="does not divide"):
        handedness(lobes(), lobes(), step_c_deg=7)
