"""Illuminance meters on a roof for some days: two side by side, or one against a model of the sky."""

import math
from dataclasses import dataclass, field
from datetime import UTC, datetime, timedelta

import numpy as np
from numpy.typing import NDArray

from labdaq.clock import NS, utc_ns_of
from simulators.hidden.light import PerezLight, Site, SunTable, clear_day, sun_angles
from simulators.hidden.light_faults import Drift, SourceFaults
from simulators.hidden.meter import MeterFaults, SkySeries, read_meter
from simulators.hidden.ripple import Ripple
from simulators.trial.campaign import SITES
from simulators.trial.dials import Dial

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class RoofTest:
    """One stretch of readings.

    Attributes
    ----------
    name, sky
        As in the case.
    times_ns : shape (n,) of int
        UTC of the readings, by the meter's clock [ns].
    light
        Sun and sky, as they are.
    drift
        Broken cloud, as both instruments see it; ``None`` for none.
    """

    name: str
    sky: str
    times_ns: NDArray[np.int64]
    light: PerezLight
    drift: Drift | None


@dataclass(frozen=True)
class RoofCampaign:
    """Readings of one meter, and what it is compared with.

    Attributes
    ----------
    against_model
        The prediction is a model's, not a second meter's.
    noise, floor_lx, resolution_lx
        Of the readings.
    model_ripple
        Rms error of the model, smooth over the sun's place and from day to day.
    range_max_lx
        Where the meter's range ends by its manual; ``None`` if unknown.
    """

    site_name: str
    site: Site
    tests: tuple[RoofTest, ...]
    against_model: bool
    noise: float
    floor_lx: float
    resolution_lx: float
    model_ripple: float
    range_max_lx: float | None
    albedo: float
    extras: dict[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class RoofWorld:
    """What is concealed in the meter, and in the source record."""

    meter: MeterFaults = field(default_factory=MeterFaults)


RoofDial = Dial[RoofWorld]


def draw(rng: np.random.Generator) -> RoofCampaign:
    """Draw a campaign of one to four days, readings a quarter of a minute to ten minutes apart."""
    name = str(rng.choice(list(SITES)))
    site = SITES[name]
    days = int(rng.choice([1, 2, 2, 3, 3, 4]))
    step_s = float(rng.choice([15.0, 60.0, 120.0, 300.0, 600.0]))
    first = datetime(int(rng.integers(2009, 2026)), 1, 1, tzinfo=UTC) + timedelta(days=int(rng.integers(0, 365)))
    tests: list[RoofTest] = []
    day = first
    while len({t.name[:2] for t in tests}) < days:
        tests += _day_tests(rng, site, day, step_s, number=1 + (day - first).days)
        day += timedelta(days=1)
        if (day - first).days > 60:
            day += timedelta(days=90)  # polar winter
    model = bool(rng.random() < 0.4)
    return RoofCampaign(
        site_name=name,
        site=site,
        tests=tuple(tests),
        against_model=model,
        noise=float(np.exp(rng.uniform(math.log(0.001), math.log(0.006)))) * (2.0 if model else 1.0),
        floor_lx=float(rng.choice([5.0, 20.0, 50.0])),
        resolution_lx=float(rng.choice([1.0, 10.7639, 107.639])),
        model_ripple=0.006 if model else 0.0025,
        range_max_lx=float(rng.choice([107_639.0, 150_000.0, 299_900.0])) if rng.random() < 0.4 else None,
        albedo=float(rng.uniform(0.08, 0.3)),
    )


def _day_tests(rng: np.random.Generator, site: Site, day: datetime, step_s: float, number: int) -> list[RoofTest]:
    """One to three stretches of a day with the sun above 8 degrees, 20 to 90 readings each."""
    noon = utc_ns_of(day) + round((12.0 - site.longitude_deg / 15.0) * 3600) * NS
    grid = noon + np.arange(-9 * 60, 9 * 60, 5) * 60 * NS
    altitude, _ = sun_angles(site, grid)
    usable = grid[altitude > 8.0]
    if len(usable) < 24:
        return []
    table = SunTable(site, int(usable[0]), int(usable[-1]))
    parts = int(rng.choice([1, 2, 3]))
    edges = np.linspace(int(usable[0]), int(usable[-1]), parts + 1)
    turbidity = float(rng.uniform(2.3, 5.0))
    tests = []
    for k in range(parts):
        room = edges[k + 1] - edges[k]
        count = int(min(rng.integers(20, 90), room / (step_s * NS)))
        if count < 12:
            continue
        start = int(edges[k] + rng.uniform(0.0, 1.0) * (room - count * step_s * NS))
        times = start + (np.arange(count) * step_s * NS).astype(np.int64)
        middle = int(times[count // 2])
        normal, diffuse = clear_day(math.degrees(math.asin(table(middle)[2])), turbidity)
        sky, drift = "clear", None
        if rng.random() < 0.3:
            sky = "partly-cloudy"
            drift = Drift(float(rng.uniform(0.05, 0.3)), float(rng.uniform(60, 400)), seed=int(rng.integers(1 << 30)))
            diffuse *= float(rng.uniform(1.2, 1.8))
        if rng.random() < 0.08:
            sky, drift, normal, diffuse = "overcast", None, 100.0, diffuse * float(rng.uniform(0.6, 1.6))
        light = PerezLight(table, middle, normal, diffuse)
        tests.append(RoofTest(f"D{number}{'abc'[k]}", sky, times, light, drift))
    return tests


class RoofStation:
    """The roof under any `RoofWorld`."""

    def __init__(self, campaign: RoofCampaign, rng: np.random.Generator) -> None:
        self.campaign = campaign
        self._series: dict[tuple[str, float], SkySeries] = {}
        # what the response to the sun's place is not known to: of the model, or of the reference meter
        self._ripple = Ripple(rng, campaign.model_ripple, 40.0, 180.0)
        self._daily = {t.name: float(rng.normal(0.0, 0.5 * campaign.model_ripple)) for t in campaign.tests}

    @property
    def floor(self) -> float:
        """Floor of the readings [lx]."""
        return self.campaign.floor_lx

    @property
    def free_gain(self) -> bool:
        """A meter's calibration holds for days: no gain is free."""
        return False

    def outcome(self, world: RoofWorld, simulated: bool) -> list[Floats]:
        """Noise-free readings of every test [lx], or what is predicted for them."""
        return [sun + sky for sun, sky in self.predict()] if simulated else self.read(world)

    def read(self, world: RoofWorld) -> list[Floats]:
        """Noise-free readings [lx] of every test."""
        c = self.campaign
        found = []
        for test in c.tests:
            series = self._looked(test, world.meter.clock_s)
            value = read_meter(series, world.meter, c.site.longitude_deg, c.albedo)
            found.append(value * np.exp(self._ripple(series.sun) + self._daily[test.name]))
        return found

    def predict(self) -> list[tuple[Floats, Floats]]:
        """Sun and sky part [lx] that the other instrument, or the model, gives for every reading."""
        return [self._looked(test, 0.0).parts() for test in self.campaign.tests]

    def _looked(self, test: RoofTest, clock_s: float) -> SkySeries:
        key = (test.name, clock_s)
        if key not in self._series:
            if len(self._series) > 200:
                self._series.clear()
            light = SourceFaults(drift=test.drift).over(test.light)
            self._series[key] = SkySeries(light, test.times_ns + round(clock_s * NS))
        return self._series[key]
