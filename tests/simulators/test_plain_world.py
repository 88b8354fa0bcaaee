"""The plain world keeps the laws that any world must."""

import math
from datetime import datetime

import numpy as np
import pytest
from emulator_helpers import MORNING_NS

from labdaq import directions
from labdaq.clock import NS, utc_ns_of
from simulators.world.plain import PlainOptions, PlainWorld, build_world

UP = np.array([0.0, 0.0, 1.0])


@pytest.fixture(scope="module")
def world() -> PlainWorld:
    return build_world()


def hemisphere() -> tuple[np.ndarray, float]:
    rings, sectors = 300, 600
    z = (np.arange(rings) + 0.5) / rings
    turn = 2 * np.pi * (np.arange(sectors) + 0.5) / sectors
    z, turn = (a.ravel() for a in np.meshgrid(z, turn, indexing="ij"))
    across = np.sqrt(1 - z**2)
    return np.stack([across * np.cos(turn), across * np.sin(turn), z], axis=-1), 2 * np.pi / (rings * sectors)


def test_the_sun_is_where_nrel_has_it(world: PlainWorld) -> None:
    """Start of the report's test 18: 30.889 degrees without refraction, 0.03 with it; its azimuth 85.4."""
    sun = world.sun(MORNING_NS)
    assert sun.altitude_deg == pytest.approx(30.889 + 0.027, abs=0.003)
    assert sun.azimuth_deg == pytest.approx(85.39, abs=0.02)
    import pandas as pd
    import pvlib

    for seconds in (7, 15, 29):
        moment = pd.DatetimeIndex([pd.Timestamp(MORNING_NS + seconds * NS, tz="UTC")])
        exact = pvlib.solarposition.get_solarposition(moment, 34.2176, -82.1084, altitude=180.0)
        sun = world.sun(MORNING_NS + seconds * NS)
        assert sun.altitude_deg == pytest.approx(exact["apparent_elevation"].iloc[0], abs=1e-4)
        assert sun.azimuth_deg == pytest.approx(exact["azimuth"].iloc[0], abs=1e-4)


def test_illuminance_is_the_integral_of_luminance(world: PlainWorld) -> None:
    towards, solid_angle = hemisphere()
    luminance = world.sky_luminance(towards, MORNING_NS)
    sun = world.sun(MORNING_NS)
    towards_sun = directions.sky_vector(sun.altitude_deg, sun.azimuth_deg)
    angle = directions.angle_between(towards, towards_sun)
    for normal in (UP, directions.sky_vector(70.0, 30.0), directions.sky_vector(85.0, 265.0)):
        facing = np.clip(towards @ normal, 0.0, None)
        beam = sun.normal_illuminance_lx * max(0.0, float(normal @ towards_sun))
        total = float(np.sum(luminance * facing) * solid_angle) + beam
        assert world.roof_illuminance(normal, MORNING_NS) == pytest.approx(total, rel=2e-4)
        shaded = float(np.sum((luminance * facing)[angle > 5.0]) * solid_angle)
        # the disc's edge cuts cells of 0.4 degrees
        assert world.roof_illuminance(normal, MORNING_NS, 5.0) == pytest.approx(shaded, rel=2e-3)


def test_levels_are_those_of_the_ies_clear_sky(world: PlainWorld) -> None:
    sun = world.sun(MORNING_NS)
    sine = math.sin(math.radians(sun.altitude_deg))
    tiny = world.roof_illuminance(UP, MORNING_NS, 0.2665)
    assert tiny == pytest.approx(800 + 15_500 * math.sqrt(sine), rel=0.01)
    assert world.roof_illuminance(UP, MORNING_NS) == pytest.approx(tiny + sun.normal_illuminance_lx * sine, rel=1e-3)
    assert 70_000 < sun.normal_illuminance_lx < 95_000


def test_the_skylight_gives_out_what_it_lets_in(world: PlainWorld) -> None:
    """Flux of the candela distribution is transmittance times aperture times illuminance (high sun, lobe inside)."""
    noon = utc_ns_of(datetime.fromisoformat("2010-06-21T17:30:00+00:00"))
    gamma = np.radians(np.arange(0.25, 90, 0.5))
    flux = sum(
        float(np.sum(world.candela(np.degrees(gamma), c, noon) * np.sin(gamma))) * np.radians(0.5) * np.radians(3.0)
        for c in np.arange(0, 360, 3.0)
    )
    o = PlainOptions()
    assert flux == pytest.approx(o.transmittance * o.aperture_m2 * world.roof_illuminance(UP, noon), rel=2e-3)
    lux = world.room_illuminance(np.array([0.0, 45.0]), 90.0, noon)
    assert lux * 2.6**2 == pytest.approx(world.candela(np.array([0.0, 45.0]), 90.0, noon))


def test_the_lobe_lies_opposite_the_sun(world: PlainWorld) -> None:
    sun = world.sun(MORNING_NS)
    away = float(directions.c_of_azimuth(sun.azimuth_deg + 180.0))
    here, there = (world.candela(np.array([90 - sun.altitude_deg]), c, MORNING_NS)[0] for c in (away, away + 180.0))
    assert here > 3 * there


def test_night_is_dark(world: PlainWorld) -> None:
    midnight = utc_ns_of(datetime.fromisoformat("2010-07-22T05:00:00+00:00"))
    assert world.sun(midnight).normal_illuminance_lx == 0.0
    assert world.roof_illuminance(UP, midnight) < 1.0
    assert world.sky_luminance(np.array([[0.0, 0.0, 1.0], [0.0, 0.0, -1.0]]), MORNING_NS)[1] == 0.0
