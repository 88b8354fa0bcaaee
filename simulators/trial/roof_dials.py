"""Dials for the roof's cases: how a meter stands, how it is calibrated, where its range ends."""

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Final

import numpy as np

from simulators.hidden.heads import HeadFaults, angular_response, ended
from simulators.hidden.meter import MeterFaults
from simulators.trial.dials import Parameters
from simulators.trial.roof import RoofDial, RoofStation, RoofWorld

Maker = Callable[[np.random.Generator, RoofStation], RoofDial]


def _meter(change: Callable[[MeterFaults, float], MeterFaults]) -> Callable[[RoofWorld, float], RoofWorld]:
    return lambda world, x: replace(world, meter=change(world.meter, x))


def _heads(change: Callable[[HeadFaults, float], HeadFaults]) -> Callable[[RoofWorld, float], RoofWorld]:
    return lambda world, x: replace(world, meter=replace(world.meter, heads=change(world.meter.heads, x)))


def _sign(rng: np.random.Generator, plus: float = 0.5) -> float:
    return 1.0 if rng.random() < plus else -1.0


def _brightest(station: RoofStation) -> float:
    return max(float((sun + sky).max()) for sun, sky in station.predict())


def tilt(rng: np.random.Generator, station: RoofStation) -> RoofDial:
    """The meter is not level."""
    towards = float(rng.uniform(0, 360))
    apply = _meter(lambda m, x: replace(m, tilt_deg=12.0 * x, tilt_azimuth_deg=towards))

    def report(x: float) -> Parameters:
        east, north = (12.0 * x * f(math.radians(towards)) for f in (math.sin, math.cos))
        return {
            "tilt_deg": (12.0 * x, "deg"),
            "azimuth_deg": (towards, "deg"),
            "tilt_east_deg": (east, "deg"),
            "tilt_north_deg": (north, "deg"),
        }

    return RoofDial("meter-tilt", "mounting", apply, report)


def gain(rng: np.random.Generator, station: RoofStation) -> RoofDial:
    """The calibration factor is wrong."""
    most = 0.25 * _sign(rng)
    apply = _meter(lambda m, x: replace(m, gain=1.0 + most * x))
    return RoofDial("meter-gain", "calibration", apply, lambda x: {"gain": (1.0 + most * x, "1")})


def cosine(rng: np.random.Generator, station: RoofStation) -> RoofDial:
    """The response is not the cosine."""
    form, most = str(rng.choice(["sine2", "quartic", "step"])), 0.3 * _sign(rng, 0.75)
    apply = _heads(lambda h, x: replace(h, response=most * x, response_form=form))

    def report(x: float) -> Parameters:
        at = {
            g: 1.0 - float(angular_response(np.array([math.cos(math.radians(g))]), most * x, form)[0]) for g in (60, 80)
        }
        return {"loss_at_60": (at[60], "1"), "loss_at_80": (at[80], "1")}

    return RoofDial("meter-cosine", "head", apply, report, notes={"form": form})


def range_limit(rng: np.random.Generator, station: RoofStation) -> RoofDial:
    """Near the end of its range the meter reads too little."""
    form, brightest = str(rng.choice(["clip", "knee", "soft", "exponential"])), _brightest(station)

    def level(x: float) -> float:
        if x <= 0.0:
            return 0.0
        return brightest * (1.25 - 0.8 * x if form in ("clip", "knee") else 0.8 * x**-1.5)

    def report(x: float) -> Parameters:
        loss = 1.0 - float(ended(np.array([brightest]), level(x), form)[0]) / brightest
        return {"limit_lx": (level(x), "lx"), "loss_at_brightest": (loss, "1")}

    apply = _heads(lambda h, x: replace(h, end_lx=level(x), end_form=form))
    return RoofDial("meter-range-limit", "range", apply, report, notes={"form": form})


def clock(rng: np.random.Generator, station: RoofStation) -> RoofDial:
    """The meter's logger is late or early."""
    most = 3600.0 * _sign(rng)
    apply = _meter(lambda m, x: replace(m, clock_s=most * x))

    def report(x: float) -> Parameters:
        return {"offset_s": (most * x, "s"), "offset_min": (most * x / 60.0, "min")}

    return RoofDial("clock-offset", "time", apply, report)


def curve(rng: np.random.Generator, station: RoofStation) -> RoofDial:
    """The meter is not proportional."""
    form = str(rng.choice(["power", "parabola", "ranges"]))
    most = _sign(rng) * {"power": 0.25, "parabola": 0.4, "ranges": 0.12}[form]
    brightest = _brightest(station)
    reference = 30_000.0 if form == "power" else brightest

    def bend(h: HeadFaults, x: float) -> HeadFaults:
        return replace(h, curve=most * x, curve_form=form, curve_reference_lx=reference)

    def report(x: float) -> Parameters:
        found = {"strength": (most * x, "1"), "reference_lx": (reference, "lx")}
        return {**found, "exponent": (1.0 + most * x, "1")} if form == "power" else found

    return RoofDial("nonlinearity", "electronics", _heads(bend), report, notes={"form": form})


def dark(rng: np.random.Generator, station: RoofStation) -> RoofDial:
    """The meter reads something in the dark."""
    typical = float(np.median(np.concatenate([s + k for s, k in station.predict()])))
    most = typical * (0.3 if rng.random() < 0.7 else -0.2)
    apply = _heads(lambda h, x: replace(h, dark_lx=most * x))
    return RoofDial("dark-offset", "electronics", apply, lambda x: {"offset_lx": (most * x, "lx")})


def warming(rng: np.random.Generator, station: RoofStation) -> RoofDial:
    """The reading follows the temperature of the day (outside the catalogue)."""
    most = 0.03 * _sign(rng)
    apply = _meter(lambda m, x: replace(m, kelvin_amplitude=9.0, per_k=most * x))
    return RoofDial("temperature-drift", "electronics", apply, lambda x: {"per_k": (most * x, "1/K")}, inside=False)


def mast(rng: np.random.Generator, station: RoofStation) -> RoofDial:
    """A mast's shadow passes over the meter (outside the catalogue)."""
    azimuths = np.concatenate(
        [np.degrees(np.arctan2(*_suns(station, t).T[:2])) % 360.0 for t in station.campaign.tests]
    )
    middle = float(rng.choice(azimuths))

    def shade(m: MeterFaults, x: float) -> MeterFaults:
        return replace(m, shadow=(middle - 15.0 * x, middle + 15.0 * x, 88.0) if x > 0.0 else (0.0, 0.0, 0.0))

    def report(x: float) -> Parameters:
        return {"azimuth_deg": (middle, "deg"), "width_deg": (30.0 * x, "deg")}

    return RoofDial("mast-shadow", "mounting", _meter(shade), report, (0.05, 0.1, 0.2, 0.4, 0.7, 1.0), inside=False)


def _suns(station: RoofStation, test: object) -> np.ndarray[tuple[int, ...], np.dtype[np.float64]]:
    from simulators.trial.roof import RoofTest

    assert isinstance(test, RoofTest)
    return np.array([test.light.sun(int(t)).direction for t in test.times_ns])


def facade(rng: np.random.Generator, station: RoofStation) -> RoofDial:
    """A glazed wall throws sunlight at the meter (outside the catalogue)."""
    test = station.campaign.tests[int(rng.integers(len(station.campaign.tests)))]
    sun = _suns(station, test)[len(test.times_ns) // 2]
    stands = (math.degrees(math.atan2(sun[0], sun[1])) + 180.0 + float(rng.uniform(-25, 25))) % 360.0
    apply = _meter(lambda m, x: replace(m, facade=(0.9 * x, stands)))

    def report(x: float) -> Parameters:
        return {"share": (0.9 * x, "1"), "azimuth_deg": (stands, "deg")}

    return RoofDial("wall-reflection", "mounting", apply, report, inside=False)


def dew(rng: np.random.Generator, station: RoofStation) -> RoofDial:
    """Dew on the dome until it dries (outside the catalogue)."""
    until = float(rng.uniform(1200, 7200))
    apply = _meter(lambda m, x: replace(m, dew=0.8 * x, dew_until_s=until))
    return RoofDial("dew", "head", apply, lambda x: {"share": (0.8 * x, "1"), "until_s": (until, "s")}, inside=False)


def sluggish(rng: np.random.Generator, station: RoofStation) -> RoofDial:
    """The meter averages over minutes (outside the catalogue)."""
    apply = _heads(lambda h, x: replace(h, lag_s=2400.0 * x))
    return RoofDial("sluggish-meter", "electronics", apply, lambda x: {"lag_s": (2400.0 * x, "s")}, inside=False)


INSIDE: Final[dict[str, Maker]] = {
    "meter-tilt": tilt,
    "meter-gain": gain,
    "meter-cosine": cosine,
    "meter-range-limit": range_limit,
    "clock-offset": clock,
    "nonlinearity": curve,
    "dark-offset": dark,
}
OUTSIDE: Final[dict[str, Maker]] = {
    "temperature-drift": warming,
    "mast-shadow": mast,
    "wall-reflection": facade,
    "dew": dew,
    "sluggish-meter": sluggish,
}
