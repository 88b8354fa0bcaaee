"""Campaigns of the goniophotometer: where, when, under which skies, with which skylights, how carefully.

Every campaign is drawn anew: the report's own tests or others, sites between the tropics and the far north, four to
fourteen tests.
"""

import math
from dataclasses import dataclass, field
from datetime import UTC, datetime, timedelta

import numpy as np
from numpy.typing import NDArray

from labdaq.clock import NS, utc_ns_of
from simulators.hidden.light import PerezLight, Site, SunTable, clear_day, sun_angles
from simulators.trial import greenwood
from simulators.trial.stock import DESIGNS

Floats = NDArray[np.float64]

SITES: dict[str, Site] = {
    "Greenwood": greenwood.SITE,
    "Berkeley": Site(37.8716, -122.2727, 52.0),
    "Phoenix": Site(33.4484, -112.0740, 331.0),
    "Uppsala": Site(59.8586, 17.6389, 20.0),
    "Madrid": Site(40.4168, -3.7038, 660.0),
    "Nairobi": Site(-1.2864, 36.8172, 1660.0),
    "Sydney": Site(-33.8688, 151.2093, 40.0),
    "Tsukuba": Site(36.0835, 140.0764, 30.0),
}


@dataclass(frozen=True)
class Test:
    """One scan under one sky.

    Attributes
    ----------
    name, system, sky
        As in the case.
    start_ns, end_ns
        UTC [ns].
    light
        Sun and sky, as the station's record has them.
    altitude_deg, azimuth_deg
        The sun in the middle of the test [deg].
    times_ns : shape (p, g) of int
        Middle of every reading, by the room's clock (UTC) [ns].
    """

    name: str
    system: str
    sky: str
    start_ns: int
    end_ns: int
    light: PerezLight
    altitude_deg: float
    azimuth_deg: float
    times_ns: NDArray[np.int64]

    @property
    def middle_ns(self) -> int:
        """Middle of the test (UTC) [ns]."""
        return (self.start_ns + self.end_ns) // 2

    @property
    def global_lx(self) -> float:
        """Recorded global illuminance in the middle of the test [lx]."""
        sun = self.light.sun(self.middle_ns)
        return sun.normal_lx * float(sun.direction[2]) + self.light.diffuse(self.middle_ns)


@dataclass(frozen=True)
class Care:
    """How carefully was measured, and how well simulated: what is always there and never announced.

    Attributes
    ----------
    noise, floor_lx
        Relative standard deviation of a reading, and the part that does not shrink with it [lx].
    test_gain, sensor_gain
        Standard deviations of the factors per test and per sensor.
    system_ripple, test_ripple
        Rms of the smooth error of each lens's distribution, and of its change from test to test.
    moulded
        Share of the real lens that is as it left the mould, not as simulated.
    """

    noise: float = 0.01
    floor_lx: float = 0.05
    test_gain: float = 0.02
    sensor_gain: float = 0.01
    system_ripple: float = 0.02
    test_ripple: float = 0.01
    moulded: float = 0.3


@dataclass(frozen=True)
class Campaign:
    """A campaign; ``systems`` maps the names used in the case to `DESIGNS`."""

    site_name: str
    site: Site
    systems: dict[str, str]
    tests: tuple[Test, ...]
    gammas_deg: Floats
    planes_deg: Floats
    distance_m: float
    room_m: tuple[float, float, float]
    care: Care
    middle_only: bool
    orientation_deg: float = 0.0
    extras: dict[str, float] = field(default_factory=dict)


def draw(
    rng: np.random.Generator,
    far: bool | None = None,
    designs: tuple[str, ...] = tuple(DESIGNS),
    *,
    broken: bool = False,
) -> Campaign:
    """Draw a campaign; ``far`` asks for a large goniometer (True), a small one (False) or either.

    ``broken`` asks for clouds, but in the tests of the report, whose skies are what they were.
    """
    planes = _planes(rng)
    gammas = np.array([0.0, 5.0, 15.0, 25.0, 35.0, 45.0, 55.0, 65.0, 75.0, 85.0])
    if rng.random() < 0.1:
        gammas = np.arange(0.0, 90.0, 10.0)
    distance = 2.6 if rng.random() < 0.6 else float(rng.uniform(2.05, 3.4))
    if far:
        distance = float(np.exp(rng.uniform(math.log(3.0), math.log(15.0))))
    height = 5.486 if distance <= 2.65 else round(2.11 * distance, 3)
    systems = _systems(rng, designs)
    if rng.random() < 0.45 and set(systems) == {"top", "box", "tube"}:
        name, site = "Greenwood", greenwood.SITE
        tests = _report_tests(rng, planes, len(gammas))
    else:
        name = str(rng.choice(list(SITES)))
        site = SITES[name]
        tests = _other_tests(rng, site, tuple(systems), planes, len(gammas), broken)
    care = Care(
        noise=float(np.exp(rng.uniform(math.log(0.005), math.log(0.03)))),
        floor_lx=float(np.exp(rng.uniform(math.log(0.02), math.log(0.2)))),
        moulded=float(rng.uniform(0.1, 0.45)),
    )
    return Campaign(
        site_name=name,
        site=site,
        systems=systems,
        tests=tests,
        gammas_deg=gammas,
        planes_deg=planes,
        distance_m=distance,
        room_m=(height, height, height),
        care=care,
        middle_only=bool(rng.random() < 0.4),
        orientation_deg=float(rng.choice([0.0, 0.0, 15.0, 30.0])),
    )


def _planes(rng: np.random.Generator) -> Floats:
    """C-planes in the order visited: round and round, there and back, or coarser and finer."""
    count = int(rng.choice([16, 16, 16, 16, 16, 16, 12, 24]))
    planes = np.arange(count) * 360.0 / count
    if rng.random() < 0.25:
        planes = np.concatenate([planes[::2], planes[1::2][::-1]])
    return planes


def _systems(rng: np.random.Generator, designs: tuple[str, ...]) -> dict[str, str]:
    """One to three systems of different kinds, each of some design."""
    count = int(rng.choice([1, 2, 3, 3, 3]))
    by_kind: dict[str, list[str]] = {}
    for name in designs:
        by_kind.setdefault(DESIGNS[name].kind, []).append(name)
    kinds = rng.permutation(sorted(by_kind))[:count]
    return {str(kind): str(rng.choice(by_kind[str(kind)])) for kind in sorted(kinds)}


def _times(start_ns: int, end_ns: int, planes: int, sensors: int) -> NDArray[np.int64]:
    """Middle of every reading: the arm moves, rests, then the sensors are read a quarter of a second apart."""
    per_plane = (end_ns - start_ns) / planes
    begin = start_ns + per_plane * (np.arange(planes) + 1.0) - 0.25 * NS * sensors
    return (begin[:, None] + 0.25 * NS * (np.arange(sensors)[None, :] + 0.5)).astype(np.int64)


def _report_tests(rng: np.random.Generator, planes: Floats, sensors: int) -> tuple[Test, ...]:
    """The twelve validation tests of the report, or another handful of its 32 (but not the one without sun)."""
    numbers = list(greenwood.VALIDATION)
    if rng.random() < 0.4:
        others = [n for n in greenwood.TESTS if n != 13]
        numbers = sorted(int(n) for n in rng.choice(others, size=int(rng.integers(6, 15)), replace=False))
    real = [greenwood.TESTS[n] for n in numbers]
    table = SunTable(greenwood.SITE, min(t.start_ns for t in real), max(t.end_ns for t in real))
    tests: list[Test] = []
    for t in real:
        middle = (t.start_ns + t.end_ns) // 2
        sun = table(middle)
        normal = (t.global_lx - t.diffuse_lx) / float(sun[2])
        light = PerezLight(table, middle, normal, t.diffuse_lx)
        times = _times(t.start_ns, t.end_ns, len(planes), sensors)
        tests.append(_test(f"T{t.number:02d}", t.system, t.sky, t.start_ns, t.end_ns, light, times))
    return tuple(tests)


def _other_tests(
    rng: np.random.Generator, site: Site, systems: tuple[str, ...], planes: Floats, sensors: int, broken: bool
) -> tuple[Test, ...]:
    """Tests on one or two days of some year, ``broken`` by clouds, when the sun is between 13 and 86 degrees high."""
    count = int(rng.integers(4, 15))
    day = datetime(int(rng.integers(2009, 2026)), 1, 1, tzinfo=UTC) + timedelta(days=int(rng.integers(0, 365)))
    days = [day] if rng.random() < 0.5 else [day, day + timedelta(days=int(rng.integers(1, 4)))]
    usable = [usable_minutes(site, d) for d in days]
    while not all(len(u) for u in usable):  # a day without enough sun: try a month later
        days = [d + timedelta(days=30) for d in days]
        usable = [usable_minutes(site, d) for d in days]
    starts = sorted(int(rng.choice(usable[int(rng.integers(len(days)))])) for _ in range(count))
    for k in range(1, count):
        starts[k] = max(starts[k], starts[k - 1] + 600 * NS)
    turbidity = float(rng.uniform(2.3, 5.5))
    cloudy = rng.random() < 0.45 or broken
    table = SunTable(site, starts[0], starts[-1] + 600 * NS)
    tests: list[Test] = []
    for k, start in enumerate(starts):
        end = start + int(rng.uniform(120, 240)) * NS
        middle = (start + end) // 2
        altitude = math.degrees(math.asin(table(middle)[2]))
        if not 12.0 < altitude < 87.0:
            continue
        normal, diffuse = clear_day(altitude, turbidity)
        sky = "clear"
        if cloudy and rng.random() < 0.5:
            sky = "partly-cloudy"
            normal, diffuse = normal * rng.uniform(0.7, 1.0), diffuse * rng.uniform(1.2, 2.0)
        if rng.random() < 0.06:
            sky, normal, diffuse = "overcast", 50.0, diffuse * rng.uniform(0.7, 1.6)
        light = PerezLight(table, middle, float(normal), float(diffuse))
        times = _times(start, end, len(planes), sensors)
        system = systems[int(rng.integers(len(systems)))] if k >= len(systems) else systems[k]
        tests.append(_test(f"T{len(tests) + 1:02d}", system, sky, start, end, light, times))
    return tuple(tests) if len(tests) >= 4 else _other_tests(rng, site, systems, planes, sensors, broken)


def usable_minutes(site: Site, day: datetime) -> NDArray[np.int64]:
    """Minutes of that solar day at which the sun is high enough and not in the zenith (UTC) [ns]."""
    noon = utc_ns_of(day) + round((12.0 - site.longitude_deg / 15.0) * 3600) * NS
    grid = noon + np.arange(-8 * 60, 8 * 60, 2) * 60 * NS
    altitude, _ = sun_angles(site, grid)
    return grid[(altitude > 14.0) & (altitude < 85.0)]


def _test(
    name: str, system: str, sky: str, start_ns: int, end_ns: int, light: PerezLight, times: NDArray[np.int64]
) -> Test:
    sun = light.sun((start_ns + end_ns) // 2).direction
    altitude = math.degrees(math.asin(sun[2]))
    azimuth = math.degrees(math.atan2(sun[0], sun[1])) % 360.0
    return Test(name, system, sky, start_ns, end_ns, light, altitude, azimuth, times)
