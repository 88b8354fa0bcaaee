"""Planned campaigns: suns, skies and skylights that tell effects apart."""

from itertools import pairwise

import pytest

from labdaq.clock import NS, utc_ns_of
from labdaq.station import Emulation
from simulators.world.campaign import SITE, TEST_S, PlannedTest, campaign
from simulators.world.daylight import Daylight
from simulators.world.emulated import SUN_STEP_NS
from simulators.world.sunpath import SunPath


@pytest.fixture(scope="module", params=[0, *(pytest.param(seed, marks=pytest.mark.slow) for seed in (1, 2))])
def plan(request: pytest.FixtureRequest) -> tuple[PlannedTest, ...]:
    made = campaign(request.param)
    assert campaign(request.param) == made
    return made


def light(test: PlannedTest) -> Daylight:
    return Daylight(SunPath(SITE), test.sky, test.cloud_cover, test.seed)


def test_a_campaign_has_low_and_high_suns_and_both_skies(plan: tuple[PlannedTest, ...]) -> None:
    assert 8 <= len(plan) <= 10
    altitudes = [SunPath(SITE).angles(utc_ns_of(test.start))[0] for test in plan]
    assert 11.5 < min(altitudes) < 16.0
    assert 60.0 < max(altitudes) < 65.0
    azimuths = [SunPath(SITE).angles(utc_ns_of(test.start))[1] for test in plan]
    assert min(azimuths) < 110.0 and max(azimuths) > 250.0
    assert {test.sky for test in plan} == {"clear", "partly-cloudy"}
    systems = [test.system for test in plan]
    assert all(systems.count(s) >= 3 for s in ("box", "tube"))
    assert all(a.start < b.start for a, b in pairwise(plan))
    assert len({test.name for test in plan}) == len(plan)


def test_tests_fit_between_two_traced_suns(plan: tuple[PlannedTest, ...]) -> None:
    for test in plan:
        begin = utc_ns_of(test.start)
        assert begin // SUN_STEP_NS == (begin + TEST_S * NS) // SUN_STEP_NS


def test_the_sun_stands_free_while_a_test_lasts(plan: tuple[PlannedTest, ...]) -> None:
    """Behind a veil of optical depth 0.1 at most, and by the sun's own rising or setting."""
    for test in plan:
        beam = [light(test).sun(utc_ns_of(test.start) + k * 10 * NS).normal_lx for k in range(17)]
        assert min(beam) > 0.88 * max(beam)


def test_no_sky_is_brighter_than_the_roofs_meters_can_say(plan: tuple[PlannedTest, ...]) -> None:
    """With 5 % in hand, for a calibration factor that is wrong."""
    for test in plan:
        for k in range(0, TEST_S, 34):
            at = utc_ns_of(test.start) + k * NS
            sun = light(test).sun(at)
            assert sun.normal_lx * sun.direction[2] + light(test).diffuse(at) < 0.95 * 99_990.0


def test_a_plan_fits_a_station(plan: tuple[PlannedTest, ...]) -> None:
    for test in plan:
        laid = Emulation().model_copy(update=test.emulation())
        assert Emulation.model_validate(laid.model_dump()) == laid
