"""Obstructions around a skylight take away what geometry says, from rays of every kind and in both engines."""

import math
from pathlib import Path

import numpy as np
import pytest

from analysis.simulate.components import Aperture, Lens, Wall
from analysis.simulate.daylight import daylight
from analysis.simulate.obstruction import Obstruction, between
from analysis.simulate.radiance.contributions import contributions
from analysis.simulate.rays import entering
from analysis.simulate.raysets import on_cover
from analysis.simulate.source import skies, suns
from analysis.simulate.system import System, load, named
from analysis.simulate.tracer import Settings, trace
from labdaq.errors import ConfigError, DataError

NONE = Lens(kind="none")
SENSOR = System(
    name="sensor", aperture=Aperture(size_m=(0.01, 0.01)), well_depth_m=1e-6, rise_m=0.0, entry=NONE, exit=NONE,
    wall=Wall(reflectance=0.0),
)  # fmt: skip
"""A hole of 1 cm, through which flux over area is the illuminance of a point."""

ROOF = Obstruction(corner_m=(-1.0, -2.0, 1.0), along_m=(2.0, 0.0, 0.0), across_m=(0.0, 4.0, 0.0))
WALL = Obstruction(corner_m=(-30.0, 2.0, 0.0), along_m=(60.0, 0.0, 0.0), across_m=(0.0, 0.0, 2.0))
HIGH = Obstruction(corner_m=(-30.0, 2.0, 0.0), along_m=(60.0, 0.0, 0.0), across_m=(0.0, 0.0, 9.0))


def seen(system: System, rays: int = 400_000) -> tuple[float, float]:
    """Share of a uniform sky's illuminance that is left, and its standard uncertainty."""
    tally = trace(system, skies([lambda v: np.ones(v.shape[:-1])]), Settings(rays=rays, bounces=1))
    flux, error = tally.flux()
    whole = math.pi * system.aperture_area_m2
    return float(flux[0] / whole), float(error[0] / whole)


def corner_factor(a: float, b: float, h: float) -> float:
    """Form factor of a rectangle a x b at height h, from below its corner (Howell, catalogue C-11)."""
    x, y = a / h, b / h
    p, q = math.sqrt(1 + x * x), math.sqrt(1 + y * y)
    return (x / p * math.atan(y / p) + y / q * math.atan(x / q)) / (2 * math.pi)


def test_a_ceiling_takes_its_form_factor() -> None:
    share, error = seen(SENSOR.replace(obstructions=(ROOF,)))
    assert share == pytest.approx(1 - 4 * corner_factor(1.0, 2.0, 1.0), abs=4 * error + 2e-4)
    assert error < 0.002


def test_a_long_wall_takes_half_of_one_minus_cosine() -> None:
    """Of a uniform sky, a wall up to altitude h without ends hides (1 - cos h) / 2."""
    share, error = seen(SENSOR.replace(obstructions=(WALL,)))
    assert 1 - share == pytest.approx((1 - math.cos(math.radians(45))) / 2, abs=4 * error + 3e-4)  # ends: 2e-4


def test_overlapping_ones_count_once() -> None:
    one = seen(SENSOR.replace(obstructions=(ROOF,)))
    assert seen(SENSOR.replace(obstructions=(ROOF, ROOF))) == one
    above = Obstruction(corner_m=(-0.5, -0.5, 2.0), along_m=(1.0, 0.0, 0.0), across_m=(0.0, 1.0, 0.0))
    assert seen(SENSOR.replace(obstructions=(ROOF, above))) == one


def test_what_lies_below_the_cover_hides_nothing() -> None:
    below = Obstruction(corner_m=(-9.0, -9.0, -0.5), along_m=(18.0, 0.0, 0.0), across_m=(0.0, 18.0, 0.0))
    assert seen(SENSOR.replace(obstructions=(below,))) == seen(SENSOR)


@pytest.mark.parametrize(("azimuth", "lit"), [(0.0, False), (90.0, True), (180.0, True), (350.0, False)])
def test_a_sun_is_hidden_or_not_whatever_the_skylights_turn(azimuth: float, lit: bool) -> None:
    for turn in (0.0, 70.0):
        system = named("box").replace(obstructions=(HIGH,))
        tally = trace(system.replace(rotation_deg=turn), suns(40.0, azimuth), Settings(rays=4_000, bounces=1))
        free = trace(named("box").replace(rotation_deg=turn), suns(40.0, azimuth), Settings(rays=4_000, bounces=1))
        assert tally.balance.entering == (free.balance.entering if lit else 0.0)
        assert tally.flux()[0] == pytest.approx(free.flux()[0] if lit else 0.0, rel=1e-12)


def test_the_shadows_edge_divides_the_cover() -> None:
    """A sun at 45 degrees in the north, a wall 1 m high and 1 m north of the centre: the cover's north half is dark."""
    flat = SENSOR.replace(
        aperture=Aperture(size_m=(0.5, 0.5)),
        obstructions=(Obstruction((-9.0, 1.0, -1.0), (18.0, 0.0, 0.0), (0.0, 0.0, 2.0)),),
    )
    source = suns(45.0, 0.0, 1000.0, radius_deg=1e-6)
    entering_lm = trace(flat, source, Settings(rays=40_000, bounces=1)).balance.entering
    assert entering_lm == pytest.approx(0.5 * 0.25 * 1000.0 * math.sqrt(0.5), rel=2e-3)


def test_ray_sets_leave_out_what_is_hidden() -> None:
    light = daylight(40.0, 0.0, 60_000.0, 20_000.0)
    box = named("box").replace(rotation_deg=20.0)
    yard = box.replace(obstructions=(HIGH,))
    free, shaded = entering(box, light, 20_000), entering(yard, light, 20_000)
    south = free.directions[:, 1] > 0.0  # travels north: nothing in the south hides it
    assert shaded.flux_lm.sum() < 0.5 * free.flux_lm.sum()
    assert shaded.flux_lm[shaded.directions[:, 1] > 0.0].sum() == pytest.approx(free.flux_lm[south].sum(), rel=1e-12)
    far = free.points - 100.0 * free.directions
    kept = on_cover(yard, far, free.directions, free.flux_lm)
    assert kept.rays[:, 9].sum() == pytest.approx(shaded.flux_lm.sum(), rel=1e-9)
    near = on_cover(yard, free.points, free.directions, free.flux_lm)
    assert near.rays[:, 9].sum() == pytest.approx(free.flux_lm.sum(), rel=1e-9)  # they start behind it
    lid = Obstruction((-5.0, -5.0, 5.0), (10.0, 0.0, 0.0), (0.0, 10.0, 0.0))
    with pytest.raises(DataError, match="obstruction"):
        on_cover(box.replace(obstructions=(lid,)), [[0.0, 0.0, 9.0]], [[0.0, 0.0, -1.0]], [1.0])


def test_between_is_a_segment() -> None:
    a = np.array([[0.0, 0.0, 0.0]] * 4)
    b = np.array([[0.0, 0.0, 2.0], [0.0, 0.0, 0.5], [3.0, 0.0, 2.0], [1.0, 0.0, 0.0]])
    assert between([ROOF], a, b).tolist() == [True, False, False, False]


def test_radiance_meets_the_same_ones() -> None:
    hole = SENSOR.replace(aperture=Aperture(size_m=(0.6, 0.6)), obstructions=(ROOF,), rotation_deg=40.0)
    rng = np.random.default_rng(1)
    up = rng.normal(size=(4000, 3))
    up[:, 2] = np.abs(up[:, 2]) + 0.01  # grazing rays meet the hole's sides
    up /= np.linalg.norm(up, axis=1)[:, None]
    start = np.concatenate([rng.uniform(-0.2, 0.2, (4000, 2)), np.full((4000, 1), -1e-4)], axis=1)
    found = contributions(hole, [], 0.25, np.concatenate([start, up], axis=1), 1, lambda v: np.ones(v.shape[:-1]))
    hidden = between([ROOF], start, start + 100.0 * up)
    assert np.array_equal(found[:, 0] < 0.5, hidden)
    assert 0.2 < hidden.mean() < 0.8


def test_they_come_from_a_file_and_mistakes_are_named(tmp_path: Path) -> None:
    path = tmp_path / "yard.toml"
    text = 'base = "box"\n[[obstructions]]\ncorner_m = [-9, 4, 0]\nalong_m = [18, 0, 0]\nacross_m = [0, 0, 3]\n'
    path.write_text(text)
    assert load(path).obstructions == (Obstruction((-9.0, 4.0, 0.0), (18.0, 0.0, 0.0), (0.0, 0.0, 3.0)),)
    path.write_text(text.replace("[0, 0, 3]", "[2, 0, 0]"))
    with pytest.raises(ConfigError, match=r"(?s)obstructions\.0.*span an area"):
        load(path)
    with pytest.raises(ConfigError, match="wide_m"):
        named("box").with_settings({"obstructions": [{"wide_m": 3}]})
