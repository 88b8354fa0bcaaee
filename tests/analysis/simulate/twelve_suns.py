"""Both engines under the suns of the report's twelve validation tests, in all directions of the arm.

    python3 -m tests.analysis.simulate.twelve_suns [SYSTEM ...] [TEST ...]

prints, for each test or these, with its own system or with each of these (`top box tube` are all 36 pairs), how
Radiance's sun and sky parts compare with the tracer's at 2.6 m: their fluxes, the deviation of single directions over
both engines' stated uncertainties, and the share of directions within two of them.
"""

import sys
from dataclasses import dataclass

import numpy as np

from analysis.simulate.daylight import Daylight, daylight
from analysis.simulate.predict import ARM_C_DEG, ARM_GAMMA_DEG, predict
from analysis.simulate.prediction import SunAndSky
from analysis.simulate.system import SYSTEMS
from analysis.sky.sun import Site, sun_position
from simulators.trial.greenwood import SITE, TESTS, VALIDATION

DISTANCE_M = 2.6
DARK = 0.05
"""Directions below this share of the part's brightest are left out."""


@dataclass(frozen=True)
class Agreement:
    """Of one part of one prediction: Radiance against the tracer."""

    flux: float
    """Radiance's over the tracer's, within gamma 85."""
    flux_uncertainty: float
    """Of that ratio, if errors of directions are independent."""
    deviation: float
    """Root mean square of the differences over both standard uncertainties."""
    within_two: float
    """Share of directions that differ by less than two of them."""
    stated: float
    """Root mean square of both relative uncertainties."""
    largest: float
    """The largest relative difference."""


def day_of(number: int) -> Daylight:
    """Sun and Perez sky of one of the report's tests, with its illuminances."""
    test = TESTS[number]
    site = Site(SITE.latitude_deg, SITE.longitude_deg, SITE.elevation_m)
    sun = sun_position((test.start_ns + test.end_ns) // 2, site)
    return daylight(float(sun.altitude_deg), float(sun.azimuth_deg), test.global_lx, test.diffuse_lx, "perez")


def compared(system: str, number: int, precision: float = 0.03) -> dict[str, Agreement]:
    """Both parts of one system under one test's daylight; Radiance is asked for ``precision``, the tracer for half."""
    ours, theirs = (
        predict(
            SYSTEMS[system],
            day_of(number),
            engine=engine,
            distance_m=DISTANCE_M,
            precision=asked,
            gamma_deg=ARM_GAMMA_DEG,
            c_deg=ARM_C_DEG,
        ).field("near")
        for engine, asked in (("tracer", precision / 2), ("radiance", precision))
    )
    return {part: agreement(ours, theirs, part) for part in ("sun", "sky")}


def agreement(ours: SunAndSky, theirs: SunAndSky, part: str) -> Agreement:
    """Directions that are not dark, each once."""
    once = np.s_[:-1, :-1]
    x, y = (getattr(field, part).candela[once] for field in (ours, theirs))
    error = np.hypot(*(getattr(field, f"{part}_uncertainty")[once] for field in (ours, theirs)))
    bright = x > DARK * x.max()
    bright[1:, 0] = False  # nadir
    off, relative = ((y - x) / error)[bright], (y / x - 1.0)[bright]
    weight = np.sin(np.radians(ARM_GAMMA_DEG[:-1]))
    flux = (x * weight).sum()
    return Agreement(
        flux=float((y * weight).sum() / flux),
        flux_uncertainty=float(np.sqrt(np.sum((error * weight) ** 2)) / flux),
        deviation=float(np.sqrt(np.mean(off**2))),
        within_two=float(np.mean(np.abs(off) < 2.0)),
        stated=float(np.sqrt(np.mean((error / x)[bright] ** 2))),
        largest=float(relative[np.argmax(np.abs(relative))]),
    )


def main() -> None:
    """Print a table."""
    tests = [int(word) for word in sys.argv[1:] if word.isdigit()]
    systems = [word for word in sys.argv[1:] if not word.isdigit()]
    print("system test  sun alt  part  flux (uncertainty)  off  within 2   stated  largest")
    for number in tests or VALIDATION:
        for system in systems or [TESTS[number].system]:
            for part, a in compared(system, number).items():
                altitude = day_of(number).sun_altitude_deg
                flux = f"{a.flux - 1.0:+7.1%} ({a.flux_uncertainty:5.1%})"
                off = f"{a.deviation:5.2f}  {a.within_two:9.0%}  {a.stated:7.1%}  {a.largest:+7.1%}"
                print(f"{system:6} {number:4}  {altitude:7.1f}  {part:4} {flux}  {off}", flush=True)


if __name__ == "__main__":
    main()
