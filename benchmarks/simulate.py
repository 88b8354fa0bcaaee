"""How fast skylights are predicted: our tracer on one and two threads, matrices, variants, and Radiance beside.

    python3 benchmarks/simulate.py [tracer] [radiance] [matrix] [variants]

Prints rays per second, by the clock and per second of processor time (which other programs disturb less), each scored
as one sample where it leaves the last lens, and as the fan that predictions are made with; seconds for
1 % per direction at the goniophotometer's 145 directions; Radiance's seconds for the same error, extrapolated from a
run by error² times time; microseconds for a sky through a matrix; seconds for the variants of a case. Scatter tables of
the lenses are made, or read from the cache, before anything is timed.
"""

import sys
import time
from collections.abc import Callable
from dataclasses import replace
from typing import Final, TypeVar

import numpy as np

from analysis.simulate.changes import Change
from analysis.simulate.daylight import Daylight, daylight, sky_source, sun_source
from analysis.simulate.matrix import skylight_matrix
from analysis.simulate.predict import ARM_C_DEG, ARM_GAMMA_DEG, predict
from analysis.simulate.prediction import Engine, SunAndSky
from analysis.simulate.system import SYSTEMS
from analysis.simulate.tracer import Settings, trace
from analysis.simulate.variants import variants

T = TypeVar("T")
GAMMA: Final = ARM_GAMMA_DEG[:-1]
C: Final = ARM_C_DEG
DISTANCE_M: Final = 2.6
DAY: Final = daylight(50.0, 130.0, 80_000.0, 20_000.0, "perez")


def timed(function: Callable[[], T]) -> tuple[float, T]:
    """Seconds and result."""
    start = time.perf_counter()
    result = function()
    return time.perf_counter() - start, result


def relative(part: SunAndSky, which: str) -> float:
    """Root mean square relative uncertainty of sun or sky where it is above 5 % of its largest value."""
    candela, error = getattr(part, which).candela, getattr(part, f"{which}_uncertainty")
    bright = candela > 0.05 * candela.max()
    return float(np.sqrt(np.mean((error[bright] / candela[bright]) ** 2)))


def near(name: str, engine: Engine, **options: float) -> tuple[float, SunAndSky]:
    """One prediction at the sensors, and its seconds."""
    seconds, made = timed(
        lambda: predict(
            SYSTEMS[name],
            DAY,
            engine=engine,
            distance_m=DISTANCE_M,
            gamma_deg=GAMMA,
            c_deg=C,
            **options,  # type: ignore[arg-type]
        )
    )
    return seconds, made.field("near")


def tracer() -> None:
    """Rays per second, and time to 1 %."""
    for name, system in SYSTEMS.items():
        for source, what in ((sky_source([DAY]), "sky"), (sun_source([DAY]), "sun")):
            assert source is not None
            for threads, split in ((1, 1), (2, 1), (2, Settings.split)):
                use = Settings(rays=2_000_000, threads=threads, bounces=1, split=split)
                trace(system, source, replace(use, rays=8_000))
                busy = time.process_time()
                seconds, _ = timed(lambda s=source, u=use, m=system: trace(m, s, u))  # type: ignore[misc]
                busy = time.process_time() - busy
                rates = f"{2.0 / seconds:6.2f} Mrays/s, {2.0 / busy:6.2f} per CPU second"
                print(f"{name:5} {what}  {threads} thread(s), {split:2} sample(s) a ray at the last lens  {rates}")
        busy = time.process_time()
        seconds, part = near(name, "tracer", precision=0.01, threads=2)
        busy = time.process_time() - busy
        reached = ", ".join(f"{which} {100 * relative(part, which):.2f} %" for which in ("sun", "sky"))
        print(f"{name:5} to 1 % per direction  {seconds:6.1f} s, {busy:6.1f} CPU s  ({reached})")


def radiance() -> None:
    """Radiance's time for 1 %, beside ours."""
    for name in SYSTEMS:
        near(name, "radiance", precision=0.2)  # lens files are made
        for engine in ("tracer", "radiance"):
            options = {"rays": 1_000_000, "threads": 2} if engine == "tracer" else {"precision": 0.03}
            seconds, part = near(name, engine, **options)
            for which in ("sun", "sky"):
                error = relative(part, which)
                print(
                    f"{name:5} {engine:8} {which}  {seconds:5.1f} s with the other part, {100 * error:5.2f} %, "
                    f"so {seconds * (error / 0.01) ** 2:7.0f} s to 1 %"
                )


def matrix() -> None:
    """A matrix of 145 patches, and any sky through it."""
    for name, system in SYSTEMS.items():
        seconds, made = timed(lambda s=system: skylight_matrix(s))  # type: ignore[misc]
        patches = made.patch_luminances(DAY.sky)
        made.predict(patches)
        each, _ = timed(lambda m=made, p=patches: [m.predict(p) for _ in range(1000)])  # type: ignore[misc]
        print(f"{name:5} matrix in {seconds:.1f} s, even sky to {100 * made.error[0]:.2f} %, {1000 * each:.0f} us each")


def cases() -> None:
    """Variants of 12 tests and two systems."""
    tests = [_test(hour) for hour in np.linspace(-5.5, 5.5, 12)]
    changes = [
        *(Change("reflectance", {"wall_reflectance": value}) for value in (0.85, 0.9, 0.97)),
        *(Change("bounces", {"max_bounces": value}) for value in (5, 10)),
        *(Change("turned", {"rotation_deg": value}) for value in (15.0, 30.0, 45.0)),
        Change("mirrored", {"mirrored": True}),
        Change("isotropic", {"isotropic": True}),
        Change("haze", {"haze": 0.1}),
        Change("slope", {"slope_deg": 30.0}),
    ]
    for name in ("top", "box"):
        seconds, _ = timed(lambda n=name: variants(SYSTEMS[n], tests, changes, rays=100_000))  # type: ignore[misc]
        print(f"{name:5} 12 tests, baseline and {len(changes)} changes: {seconds:.1f} s")


def _test(hour: float) -> Daylight:
    altitude = 72.0 * np.cos(hour / 6.2 * np.pi / 2) + 3.0
    return daylight(altitude, 180.0 + 15.0 * hour, 1000.0 * altitude, 18_000.0 * altitude / 75.0, "perez")


if __name__ == "__main__":
    parts = {"tracer": tracer, "radiance": radiance, "matrix": matrix, "variants": cases}
    for wanted in sys.argv[1:] or parts:
        parts[wanted]()
