"""A camera that maps the sky: zenith readings over days, or whole maps, beside a luminance meter or a model."""

import math
from dataclasses import dataclass, field
from datetime import UTC, datetime, timedelta

import numpy as np
from numpy.typing import NDArray

from labdaq.clock import NS
from labdaq.directions import angle_between, sky_vector
from simulators.hidden.camera import CameraFaults, Scene, photograph
from simulators.hidden.light import PerezLight, Site, SunTable, clear_day
from simulators.hidden.light_faults import Drift, FaultedLight, SourceFaults
from simulators.hidden.ripple import Ripple
from simulators.hidden.symmetry import IDENTITY, sky_nodes
from simulators.trial import greenwood
from simulators.trial.campaign import SITES, usable_minutes
from simulators.trial.dials import Dial

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class SkyTest:
    """One bracket of exposures, and the directions that are compared.

    Attributes
    ----------
    directions : shape (n, 3)
        Unit vectors towards the sky, as believed.
    altitudes_deg, azimuths_deg : shape (n,)
        The same as angles.
    overcast
        0 for a blue sky to 1 for a white one.
    """

    name: str
    sky: str
    start_ns: int
    light: PerezLight
    drift: Drift | None
    overcast: float
    directions: Floats
    altitudes_deg: Floats
    azimuths_deg: Floats

    @property
    def middle_ns(self) -> int:
        """Middle of the bracket (UTC) [ns]."""
        return self.start_ns + 20 * NS


@dataclass(frozen=True)
class SkyCampaign:
    """Brackets of one camera, and what they are compared with.

    Attributes
    ----------
    against_model
        The prediction is a sky model's, not a luminance meter's.
    noise, floor_cdm2
        Of a comparison.
    sky_ripple, test_gain
        How far the real sky is from the model (smooth, relative); how well exposures repeat from test to test.
    sees_sun
        No disc shades the lens.
    """

    site_name: str
    site: Site
    tests: tuple[SkyTest, ...]
    against_model: bool
    noise: float
    floor_cdm2: float
    sky_ripple: float
    test_gain: float
    sees_sun: bool


@dataclass(frozen=True)
class SkyWorld:
    """What is concealed in the camera.

    ``motion_s`` is how far apart in time camera and meter look, rms over the tests [s].
    """

    camera: CameraFaults = field(default_factory=CameraFaults)
    motion_s: float = 0.0


SkyDial = Dial[SkyWorld]


def draw(rng: np.random.Generator, broken: bool = False) -> SkyCampaign:
    """Draw zenith readings (12 to 40 tests of one to five directions) or maps (3 to 10 tests of 40 to 145)."""
    zenith = bool(rng.random() < 0.35)
    model = bool(rng.random() < 0.35) and not zenith
    if rng.random() < 0.4:
        name, site = "Greenwood", greenwood.SITE
        starts = [t.start_ns for t in greenwood.TESTS.values()]
    else:
        name = str(rng.choice(list(SITES)))
        site = SITES[name]
        starts = _starts(rng, site, 32)
    count = int(rng.integers(12, 33)) if zenith else int(rng.integers(3, 11))
    chosen = sorted(int(s) for s in rng.choice(starts, size=min(count, len(starts)), replace=False))
    table = SunTable(site, chosen[0], chosen[-1])
    turbidity = float(rng.uniform(2.3, 5.0))
    places = _places(rng, zenith)
    drawn = [_test(rng, f"S{k + 1:02d}", start, table, turbidity, places, broken) for k, start in enumerate(chosen)]
    tests = tuple(test for test in drawn if len(test.directions))  # at the zenith alone the sun may stand in the way
    return SkyCampaign(
        site_name=name,
        site=site,
        tests=tests,
        against_model=model,
        noise=float(np.exp(rng.uniform(math.log(0.006), math.log(0.025)))),
        floor_cdm2=10.0,
        sky_ripple=0.04 if model else 0.004,
        test_gain=0.01,
        sees_sun=bool(rng.random() < 0.4),
    )


def _starts(rng: np.random.Generator, site: Site, count: int) -> list[int]:
    """Moments on one to three days with the sun above 14 degrees (UTC) [ns]."""
    day = datetime(int(rng.integers(2009, 2026)), 1, 1, tzinfo=UTC) + timedelta(days=int(rng.integers(0, 365)))
    found: list[int] = []
    wanted = int(rng.choice([1, 2, 3]))
    while wanted:
        minutes = usable_minutes(site, day)
        if len(minutes):
            found += [int(m) for m in rng.choice(minutes, size=min(len(minutes), count), replace=False)]
            wanted -= 1
        day += timedelta(days=1 if len(minutes) else 20)
    return sorted(found)


def _places(rng: np.random.Generator, zenith: bool) -> tuple[Floats, Floats]:
    """Altitudes and azimuths [deg] that are compared: zenith and a few, or rings like Tregenza's."""
    if zenith:
        altitude, azimuth = [90.0], [0.0]
        for _ in range(int(rng.choice([0, 0, 2, 4]))):
            altitude.append(float(rng.choice([30.0, 45.0, 60.0])))
            azimuth.append(float(rng.choice([0.0, 90.0, 180.0, 270.0])))
        return np.array(altitude), np.array(azimuth)
    rings = [(6, 30), (18, 30), (30, 24), (42, 24), (54, 18), (66, 12), (78, 6), (90, 1)]
    both = np.array([(a, 360.0 * k / n) for a, n in rings for k in range(n)])
    if rng.random() < 0.5:
        both = both[np.sort(rng.choice(len(both), size=int(rng.integers(40, 100)), replace=False))]
    return both[:, 0], both[:, 1]


def _test(
    rng: np.random.Generator,
    name: str,
    start: int,
    table: SunTable,
    turbidity: float,
    places: tuple[Floats, Floats],
    broken: bool,
) -> SkyTest:
    sun = table(start)
    normal, diffuse = clear_day(math.degrees(math.asin(sun[2])), turbidity)
    sky, overcast, drift = "clear", float(rng.uniform(0.0, 0.15)), None
    draw_ = rng.random()
    if draw_ < 0.3 or broken:
        sky, overcast = "partly-cloudy", float(rng.uniform(0.3, 0.7))
        drift = Drift(float(rng.uniform(0.05, 0.25)), float(rng.uniform(60, 400)), seed=int(rng.integers(1 << 30)))
        diffuse *= float(rng.uniform(1.2, 1.9))
    elif draw_ < 0.42:
        sky, overcast, normal = "overcast", 1.0, 100.0
        diffuse *= float(rng.uniform(0.6, 1.8))
    altitude, azimuth = places
    directions = sky_vector(altitude, azimuth)
    far = angle_between(directions, sun) > 8.0
    light = PerezLight(table, start, normal, diffuse)
    return SkyTest(name, sky, start, light, drift, overcast, directions[far], altitude[far], azimuth[far])


class SkyStation:
    """The camera under any `SkyWorld`."""

    def __init__(self, campaign: SkyCampaign, rng: np.random.Generator) -> None:
        self.campaign = campaign
        self._common = Ripple(rng, 0.5 * campaign.sky_ripple, 30.0, 150.0)
        self._own = {t.name: Ripple(rng, campaign.sky_ripple, 30.0, 150.0) for t in campaign.tests}
        self._late = {t.name: float(rng.normal()) for t in campaign.tests}
        self._scenes: dict[tuple[str, float], Scene] = {}

    @property
    def floor(self) -> float:
        """Floor of the readings [cd/m²]."""
        return self.campaign.floor_cdm2

    @property
    def free_gain(self) -> bool:
        """The camera's scale holds for all its brackets: no gain is free."""
        return False

    def outcome(self, world: SkyWorld, simulated: bool) -> list[Floats]:
        """Noise-free readings of every test [cd/m²], or what is predicted for them."""
        return self.predict() if simulated else self.read(world)

    def read(self, world: SkyWorld) -> list[Floats]:
        """Noise-free luminances [cd/m²] that the camera reports."""
        found = []
        for test in self.campaign.tests:
            late = world.camera.clock_s + world.motion_s * self._late[test.name]
            scene = self._scene(test, late)
            found.append(photograph(test.directions, scene, world.camera))
        return found

    def predict(self) -> list[Floats]:
        """Luminances [cd/m²] that the other instrument, or the model, gives."""
        found = []
        for test in self.campaign.tests:
            light = self._light(test)
            value = light.luminance(test.directions, test.middle_ns)
            if not self.campaign.against_model:
                value = value * np.exp(self._own[test.name](test.directions) + self._common(test.directions))
            found.append(value)
        return found

    def _light(self, test: SkyTest) -> FaultedLight:
        return SourceFaults(drift=test.drift).over(test.light)

    def _scene(self, test: SkyTest, late_s: float) -> Scene:
        key = (test.name, late_s)
        if key in self._scenes:
            return self._scenes[key]
        if len(self._scenes) > 400:
            self._scenes.clear()
        light, at = self._light(test), test.middle_ns + round(late_s * NS)
        own, common = self._own[test.name], self._common
        # an instrument beside it is not exactly where, and not exactly what, the camera is: half of the ripple
        share = 1.0 if self.campaign.against_model else 2.0

        def look(directions: Floats) -> Floats:
            return light.luminance(directions, at) * np.exp(share * (own(directions) + common(directions)))

        nodes = sky_nodes(39, (IDENTITY,))
        sun = light.sun(at)
        scene = Scene(nodes, look(nodes.directions), look, sun.direction, sun.normal_lx, test.overcast)
        self._scenes[key] = scene
        return scene
