"""A campaign of tests to take with an emulated station, as an operator would plan it.

Site and month are those of the Greenwood laboratory, July 2010. Suns are spread from low to high, mornings and
afternoons, with two skylights in turn, under clear skies and under broken cloud. Under broken cloud the operator waits
until the sun stands in a gap.
"""

import math
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from typing import Any, Final, Literal

import numpy as np

from labdaq.clock import NS, utc_ns_of
from simulators.hidden.light import Site
from simulators.world.daylight import Daylight
from simulators.world.emulated import SUN_STEP_NS
from simulators.world.sunpath import SunPath

SITE: Final = Site(34.2176, -82.1084, 180.0)
LOWEST_DEG: Final = 12.0
HIGHEST_DEG: Final = 64.0
"""Above this the roof's global meter may stand at the end of its range (99 990 lx), under broken cloud and with what
may be concealed in it: such a test has no sky."""
TEST_S: Final = 170

System = Literal["top", "box", "tube"]
Sky = Literal["clear", "partly-cloudy", "overcast"]


@dataclass(frozen=True)
class PlannedTest:
    """One test to take.

    Attributes
    ----------
    name
        ``T01``, ``T02``...
    start
        UTC.
    system, sky, cloud_cover, seed
        As in a station's ``[emulation]``.
    """

    name: str
    start: datetime
    system: System
    sky: Sky
    cloud_cover: float
    seed: int

    def emulation(self) -> dict[str, Any]:
        """What to lay over a station's ``[emulation]``."""
        return {
            "start": self.start,
            "system": self.system,
            "sky": self.sky,
            "cloud_cover": self.cloud_cover,
            "seed": self.seed,
        }


def campaign(seed: int, systems: tuple[System, ...] = ("box", "tube")) -> tuple[PlannedTest, ...]:
    """Plan 8 to 10 tests in the order they are taken; the same seed gives the same plan."""
    rng = np.random.default_rng([seed, 2010])
    count = int(rng.integers(8, 11))
    day = datetime(2010, 7, int(rng.integers(10, 25)), tzinfo=UTC)
    path = SunPath(SITE)
    # in equal steps of the sun's height, each half the day in turn
    height = np.linspace(math.sin(math.radians(LOWEST_DEG + 0.5)), math.sin(math.radians(HIGHEST_DEG - 1.5)), count)
    altitudes = np.degrees(np.arcsin(height))
    afternoon = np.arange(count) % 4 >= 2
    turn = int(rng.integers(len(systems)))
    cloudy = np.zeros(count, dtype=bool)
    cloudy[rng.permutation(np.arange(1, count))[: max(2, count // 3)]] = True
    found = []
    for k in range(count):
        sky: Sky = "partly-cloudy" if cloudy[k] else "clear"
        cover = round(float(rng.uniform(0.15, 0.35)), 2) if cloudy[k] else 0.0
        system = systems[(k + turn) % len(systems)]
        about_ns = _when(path, day, float(altitudes[k]), bool(afternoon[k]))
        start_ns, clouds = _start(path, sky, cover, 1000 * seed + 20 * k + 1, about_ns)
        start = datetime(1970, 1, 1, tzinfo=UTC) + timedelta(seconds=start_ns // NS)
        found.append((start, system, sky, cover, clouds))
    found.sort(key=lambda test: test[0])
    return tuple(PlannedTest(f"T{k + 1:02d}", *test) for k, test in enumerate(found))


def _when(path: SunPath, day: datetime, altitude_deg: float, afternoon: bool) -> int:
    """UTC [ns] at which the sun stands so high before or after noon, on a whole step of traced suns."""
    noon = utc_ns_of(day) + round((12.0 - SITE.longitude_deg / 15.0) * 3600) * NS // SUN_STEP_NS * SUN_STEP_NS
    steps = [noon + k * SUN_STEP_NS for k in (range(0, 110) if afternoon else range(0, -110, -1))]
    return min(steps, key=lambda t: abs(path.angles(t)[0] - altitude_deg))


def _start(path: SunPath, sky: Sky, cover: float, seed: int, about_ns: int) -> tuple[int, int]:
    """Start, and clouds, of a test near a time: the sun is to stay free of cloud as long as the test lasts.

    The operator waits for a gap up to a quarter of an hour; where none comes, on another day with other clouds.
    """
    if cover == 0.0:
        return about_ns + 30 * NS, seed
    best, found = math.inf, (about_ns, seed)
    for day in range(12):
        clouds = Daylight(path, sky, cover, seed + day).clouds
        for k in (0, -1, 1, -2, 2, -3, 3):
            start = about_ns + k * SUN_STEP_NS + 30 * NS
            towards = path(start)[None]
            veil = max(float(clouds.thickness(towards, t)[0]) for t in range(start, start + TEST_S * NS, 5 * NS))
            if veil < best:
                best, found = veil, (start, seed + day)
            if best < 0.02:
                return found
    return found
