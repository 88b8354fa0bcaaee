"""Light that the emulated skylights send into the dark room."""

from dataclasses import replace
from datetime import datetime

import numpy as np
import pytest

from labdaq.clock import NS, utc_ns_of
from simulators.hidden.maps import Field
from simulators.hidden.room import Room
from simulators.world.emulated import SUN_STEP_NS, EmulatedWorld, WorldOptions

UP = np.array([0.0, 0.0, 1.0])
GAMMAS = np.array([0.0, 5, 15, 25, 35, 45, 55, 65, 75, 85])
QUICK = WorldOptions(effort=0.05)
MORNING_NS = utc_ns_of(datetime.fromisoformat("2010-07-22T14:24:00+00:00"))


@pytest.fixture(scope="module")
def box() -> EmulatedWorld:
    return EmulatedWorld(QUICK)


@pytest.mark.parametrize(("system", "area_m2"), [("box", 0.6096**2), ("tube", np.pi * 0.1778**2), ("top", 0.6096**2)])
def test_a_skylight_gives_no_more_than_it_gets(system: str, area_m2: float) -> None:
    """Far-field flux over what falls on the opening; a raised cover catches more of a low sun than the opening does."""
    world = EmulatedWorld(replace(QUICK, system=system))  # type: ignore[arg-type]
    sun = world.sun(MORNING_NS)
    (sunlit,) = world.tracing.suns([world.daylight.path(MORNING_NS)])
    flux = sunlit.flux() if sunlit.values.shape[-1] == 60 else _flux(sunlit)
    height = np.sin(np.radians(sun.altitude_deg))
    assert 0.05 < flux / (area_m2 * height) < 1.0
    values, _ = world._sky_below(MORNING_NS)
    assert 0.1 < Field(values).flux() / (area_m2 * world.daylight.diffuse(MORNING_NS)) < 0.8


def _flux(field: Field) -> float:
    """Flux [lm] by summing intensity over directions."""
    gamma = np.radians(np.arange(0.5, 90.0, 1.0))
    c = np.radians(np.arange(0.0, 360.0, 3.0))
    g, a = np.meshgrid(gamma, c, indexing="ij")
    towards = np.stack([-np.sin(g) * np.sin(a), np.sin(g) * np.cos(a), -np.cos(g)], axis=-1)
    return float(np.sum(field.intensity(towards) * np.sin(g)) * np.radians(1.0) * np.radians(3.0))


def test_the_same_instant_gives_the_same_light(box: EmulatedWorld) -> None:
    again = EmulatedWorld(QUICK)
    again.prepare(MORNING_NS, MORNING_NS + 60 * NS)
    t = MORNING_NS + 41 * NS
    assert np.array_equal(box.room_illuminance(GAMMAS, 67.5, t), again.room_illuminance(GAMMAS, 67.5, t))


def test_light_is_kept_on_disk(monkeypatch: pytest.MonkeyPatch, tmp_path: object) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    few = replace(QUICK, effort=0.002)
    first = EmulatedWorld(few).room_illuminance(GAMMAS, 0.0, MORNING_NS)
    monkeypatch.setattr("simulators.world.tracing.trace", None)
    assert np.array_equal(EmulatedWorld(few).room_illuminance(GAMMAS, 0.0, MORNING_NS), first)


def test_light_moves_on_smoothly(box: EmulatedWorld) -> None:
    """Where one traced sun hands over to the next there is no step."""
    join = (MORNING_NS // SUN_STEP_NS + 1) * SUN_STEP_NS
    before, after = (box.room_illuminance(GAMMAS, 90.0, join + d) for d in (-NS // 100, NS // 100))
    assert after == pytest.approx(before, rel=1e-3)


def test_room_light_follows_the_sun_behind_a_cloud() -> None:
    world = EmulatedWorld(replace(QUICK, sky="partly-cloudy", cloud_cover=0.4, seed=3))
    moments = [MORNING_NS + 5 * NS * k for k in range(47)]
    beam = np.array([world.sun(t).normal_illuminance_lx for t in moments])
    lit = np.array([world.room_illuminance(GAMMAS, 270.0, t).sum() for t in moments])
    if np.ptp(beam) < 0.2 * beam.max():
        pytest.fail("the seed shows no cloud in these four minutes: choose another")
    assert np.corrcoef(beam, lit)[0, 1] > 0.95


def test_a_black_room_adds_nothing_and_a_grey_one_adds_most_far_out(box: EmulatedWorld) -> None:
    black = EmulatedWorld(replace(QUICK, room=Room()))
    share = box.room_illuminance(GAMMAS, 45.0, MORNING_NS) / black.room_illuminance(GAMMAS, 45.0, MORNING_NS) - 1.0
    assert np.all(share > 0.0)
    assert share[:5].max() < 0.01  # the report's room: a few tenths of a per cent below 35 degrees
    assert share[-1] > 0.02


def test_at_night_nothing_comes_through(box: EmulatedWorld) -> None:
    night = utc_ns_of(datetime.fromisoformat("2010-07-22T05:00:00+00:00"))
    assert np.all(box.room_illuminance(GAMMAS, 0.0, night) < 1e-2)
