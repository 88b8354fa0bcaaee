"""Predictions and ray sets."""

import math

import numpy as np
import pytest

from analysis.simulate.components import Lens
from analysis.simulate.daylight import daylight
from analysis.simulate.predict import predict
from analysis.simulate.raysets import on_cover
from analysis.simulate.room import Room
from analysis.simulate.source import suns
from analysis.simulate.system import System, named
from analysis.simulate.tracer import Settings, trace
from labdaq.directions import sky_vector
from labdaq.errors import ConfigError, DataError


def test_precision_is_reached_and_honest() -> None:
    day = daylight(50.0, 130.0, 60_000.0, 20_000.0, "uniform")
    coarse = predict(named("box"), day, distance_m=2.6, precision=0.03, threads=1)
    assert coarse.near is not None
    assert coarse.near.worst_relative() < 0.045  # precision is that of the rays; smoothing adds to it
    other = predict(named("box"), day, distance_m=2.6, precision=0.03, seed=2, threads=1)
    assert other.near is not None
    a, b = coarse.near.total.candela, other.near.total.candela
    bright = a > 0.05 * a.max()
    stated = np.hypot(coarse.near.uncertainty, other.near.uncertainty)
    # two seeds scatter as stated: the mean square of n correlated normal values lies well within a factor of two, and
    # what the smoothing bends, which is stated too, is the same for both
    chi = float(np.mean(((a - b)[bright] / stated[bright]) ** 2))
    assert 0.25 < chi < 2.0


def test_parts_and_balance() -> None:
    day = daylight(30.0, 90.0, 50_000.0, 20_000.0, "uniform", "a test")
    made = predict(named("tube"), day, rays=30_000, threads=1)
    assert made.near is None
    assert np.allclose(made.far.total.candela, made.sun.candela + made.sky.candela)
    for part in ("sun", "sky"):
        assert made.facts[part]["out"] == pytest.approx(getattr(made, part).flux(), rel=0.03)
    with pytest.raises(ConfigError, match="no near field"):
        made.field("near")


def test_room_adds_light_everywhere() -> None:
    day = daylight(60.0, 90.0, 80_000.0, 20_000.0, "overcast")
    grid = {"gamma_deg": np.arange(0.0, 90.1, 10.0), "c_deg": np.arange(0.0, 360.1, 45.0)}
    dark, lit = (
        predict(named("top"), day, distance_m=2.6, room=room, rays=20_000, threads=1, **grid).field("near")
        for room in (None, Room(wall=0.2))
    )
    assert np.all(lit.sky.candela >= dark.sky.candela) and np.all(lit.sun.candela >= dark.sun.candela)
    with pytest.raises(ConfigError, match="distance"):
        predict(named("top"), day, room=Room(), rays=1000)


def rays_of_a_sun(
    system: System, altitude: float, azimuth: float, count: int
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Parallel rays through a disc of 1 m radius around the skylight, together 1 lx facing them."""
    rng = np.random.default_rng(8)
    toward = sky_vector(altitude, azimuth)
    side = np.cross(toward, [0.0, 0.0, 1.0])
    side /= np.linalg.norm(side)
    r, phi = np.sqrt(rng.random(count)), 2 * math.pi * rng.random(count)
    across = (r * np.cos(phi))[:, None] * side + (r * np.sin(phi))[:, None] * np.cross(side, toward)
    points = np.array([0.0, 0.0, system.well_depth_m + 0.1]) + across + 5.0 * toward
    return points, np.tile(-toward * 3.0, (count, 1)), np.full(count, math.pi / count)


@pytest.mark.parametrize("name", ["top", "box", "tube"])
def test_a_ray_set_does_what_the_sun_does(name: str) -> None:
    system = named(name).replace(rotation_deg=20.0)
    source = on_cover(system, *rays_of_a_sun(system, 40.0, 100.0, 400_000))
    given = trace(system, source, Settings())
    sun = trace(system, suns(40.0, 100.0, radius_deg=0.0), Settings(rays=200_000))
    # 400,000 rays on 3.1 m², some 50,000 of which meet the cover: 0.5 % of noise
    assert given.balance.entering == pytest.approx(sun.balance.entering, rel=0.02)
    assert given.flux()[0] == pytest.approx(sun.flux()[0], rel=0.02)
    gamma, c = np.array([20.0, 40.0, 60.0])[None, :], np.arange(0.0, 360.0, 45.0)[:, None]
    a, b = given.intensity(gamma, c), sun.intensity(gamma, c)
    assert np.all(np.abs(a.candela - b.candela) < 6 * np.hypot(a.uncertainty, b.uncertainty) + 0.03 * b.candela.max())


def test_rays_that_miss_or_make_no_sense() -> None:
    up = np.array([[0.0, 0.0, 1.0]])
    with pytest.raises(DataError, match="no ray"):
        on_cover(named("box"), 5.0 * up, up, np.ones(1))
    with pytest.raises(DataError, match="no ray"):
        on_cover(named("top"), np.array([[3.0, 0.0, 5.0]]), -up, np.ones(1))
    with pytest.raises(DataError, match="do not belong"):
        on_cover(named("box"), up, up, np.ones(2))
    with pytest.raises(DataError, match="undefined"):
        on_cover(named("box"), up, 0.0 * up, np.ones(1))


def test_stated_uncertainty_is_the_scatter() -> None:
    """Under an even overcast sky a round skylight sends the same in all C: their scatter is the stated uncertainty.

    Rays of a clear dome and a mirror tube are of very unlike worth. 1.4: five runs of 12 C-planes give a ratio to
    10 %, the choice of neighbourhoods adds up to 25 %. One noise [cd] for all gammas would be two thirds of
    what there is at 35°, and five times as much at 75°.
    """
    system = named("tube").replace(exit=Lens(kind="none"), boot_height_m=0.0)
    day = daylight(45.0, 100.0, 20_000.0, 20_000.0, "overcast")
    gamma, c = np.arange(25.0, 80.0, 10.0), np.arange(0.0, 361.0, 30.0)
    runs = [predict(system, day, rays=100_000, seed=k, gamma_deg=gamma, c_deg=c, threads=1).far for k in range(1, 6)]
    candela = np.stack([run.sky.candela[:-1] for run in runs])
    stated = np.stack([run.sky_uncertainty[:-1] for run in runs])
    ratio = np.sqrt(np.mean(((candela - candela.mean(axis=(0, 1))) / stated) ** 2, axis=(0, 1)))
    assert np.all(ratio > 0.7) and np.all(ratio < 1.4)
