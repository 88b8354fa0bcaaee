"""Dials for the goniometer's cases: sun and sky, clocks."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from simulators.hidden.light_faults import Drift, SourceFaults
from simulators.trial.dials import Parameters
from simulators.trial.station import GonioDial, Station, World


def with_source(change: Callable[[SourceFaults, float], SourceFaults]) -> Callable[[World, float], World]:
    """Make a dial's `apply` that changes the source."""

    def apply(world: World, x: float) -> World:
        return replace(world, hidden=replace(world.hidden, source=change(world.hidden.source, x)))

    return apply


def sky_sun_ratio(rng: np.random.Generator, station: Station) -> GonioDial:
    """The recorded diffuse is wrong by a factor, or the shading disc hid too much of the sky about the sun."""
    sign = 1.0 if rng.random() < 0.7 else -1.0
    if rng.random() < 0.35:

        def cone(s: SourceFaults, x: float) -> SourceFaults:
            return replace(s, disc_half_angle_deg=20.0 * x)

        def shares(x: float) -> Parameters:
            lights = [(t, cone(SourceFaults(), x).over(t.light)) for t in station.campaign.tests]
            shifts = [light._shift(t.middle_ns) for t, light in lights]
            return {"diffuse_shift": (float(np.mean(shifts)), "1"), "disc_half_angle_deg": (20.0 * x, "deg")}

        return GonioDial("sky-sun-ratio", "source", with_source(cone), shares, notes={"form": "shading disc"})

    def flat(s: SourceFaults, x: float) -> SourceFaults:
        return replace(s, diffuse_shift=s.diffuse_shift + sign * 0.4 * x)

    return GonioDial(
        "sky-sun-ratio",
        "source",
        with_source(flat),
        lambda x: {"diffuse_shift": (sign * 0.4 * x, "1")},
        notes={"form": "factor"},
    )


def circumsolar_aureole(rng: np.random.Generator, station: Station) -> GonioDial:
    """A share of the beam comes from about the sun."""
    scale, power = float(rng.uniform(1.5, 6.0)), float(rng.choice([1.0, 1.5, 2.0]))

    def halo(s: SourceFaults, x: float) -> SourceFaults:
        return replace(s, halo=0.6 * x, halo_deg=scale, halo_power=power)

    def report(x: float) -> Parameters:
        fine = np.linspace(0.0, 60.0, 6001)
        light = np.exp(-((fine / scale) ** power)) * np.sin(np.radians(fine))
        rms = float(np.sqrt(np.sum(light * fine**2) / np.sum(light)))
        return {"share": (0.6 * x, "1"), "rms_radius_deg": (rms, "deg"), "sigma_deg": (rms / 2**0.5, "deg")}

    return GonioDial("circumsolar-aureole", "source", with_source(halo), report, notes={"power": power})


def cloud_drift(rng: np.random.Generator, station: Station) -> GonioDial:
    """Thin cloud crosses the sun while the arm moves, in the tests whose sky was not clear."""
    crossing, wind, seed = float(rng.uniform(15, 90)), float(rng.uniform(0, 360)), int(rng.integers(1 << 30))
    cloudy = [t for t in station.campaign.tests if t.sky != "clear"]
    spans = tuple((t.start_ns, t.end_ns) for t in cloudy)

    def drift(s: SourceFaults, x: float) -> SourceFaults:
        return replace(s, drift=Drift(0.3 * x, crossing, wind, seed, spans) if x > 0.0 else None)

    def report(x: float) -> Parameters:
        rms = []
        for test in cloudy:
            light = drift(SourceFaults(), x).over(test.light)
            passed = np.array([light.transmission(int(t)) for t in test.times_ns[:, 0]])
            rms.append(np.std(passed / passed.mean()))
        return {"rms": (float(np.sqrt(np.mean(np.square(rms)))), "1"), "correlation_s": (crossing / 2.0, "s")}

    return GonioDial("cloud-drift", "source", with_source(drift), report)


def clock_offset(rng: np.random.Generator, station: Station) -> GonioDial:
    """The room's clock is late or early; sometimes by the hour of summer time."""
    sign = 1.0 if rng.random() < 0.5 else -1.0

    def late(s: SourceFaults, x: float) -> SourceFaults:
        return replace(s, clock_s=sign * 3600.0 * x)

    def report(x: float) -> Parameters:
        return {"offset_s": (sign * 3600.0 * x, "s"), "offset_min": (sign * 60.0 * x, "min")}

    whole = (1.0,) if rng.random() < 0.1 else ()
    return GonioDial("clock-offset", "time", with_source(late), report, choices=whole)


def skyline(rng: np.random.Generator, station: Station) -> GonioDial:
    """A building or a wood on the horizon (outside the catalogue)."""
    first, width = float(rng.uniform(0, 360)), float(rng.uniform(50, 140))
    share = float(rng.uniform(0.1, 0.4))

    def built(s: SourceFaults, x: float) -> SourceFaults:
        return replace(s, skyline=(first, first + width, 45.0 * x, share) if x > 0.0 else None)

    def report(x: float) -> Parameters:
        return {"altitude_deg": (45.0 * x, "deg"), "from_deg": (first, "deg"), "to_deg": (first + width, "deg")}

    return GonioDial("horizon-obstruction", "source", with_source(built), report, inside=False)
