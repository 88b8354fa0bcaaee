"""One tilt for tests 20 to 26 and sets 1 and 2 of the Greenwood roof meters, whenever the sets were taken?"""

from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

MOST_TILT_DEG: Final = 5.0
"""A head that leans more would have been seen."""
MOST_GAIN: Final = 0.04
"""Two meters, each within the maker's 2 %."""
_PM: Final = {"morning": -1.0, "afternoon": 1.0}


def tilt_lines(folder: Path) -> list[str]:
    """What is left of tests 20 to 26 and sets 1 and 2 under one tilt and one gain, by the half of day of the sets.

    A clear 22 July is assumed for the sets: their level then tells the sun's altitude (by the tests' own levels), and
    the half of the day its azimuth. First order in the tilt: beam share times cot(altitude) cos(azimuth - downhill).
    """
    from analysis.cases import read_case

    case = read_case(folder)
    ratio, level, share, altitude, azimuth = (dict[str, float]() for _ in range(5))
    for k, test in enumerate(case.tests):
        rows = case.records.where(case.records.test == k)
        ratio[test.id], level[test.id] = float((rows.measured / rows.simulated).mean()), float(rows.simulated.mean())
        if test.sun_altitude_deg is not None and test.sun_azimuth_deg is not None:
            altitude[test.id], azimuth[test.id] = test.sun_altitude_deg, test.sun_azimuth_deg
            share[test.id] = float((rows.sun / rows.simulated).mean())
    known = list(altitude)
    by_height = np.polyfit([level[t] for t in known], np.sin(np.radians([altitude[t] for t in known])), 1)
    mean_share = float(np.mean(list(share.values())))
    lines = [
        "| set 1 in the | set 2 in the | tilt [deg] | downhill azimuth [deg] | gain | left, rms [%] |",
        "|---|---|---|---|---|---|",
    ]
    for first, one in _PM.items():
        for second, two in _PM.items():
            rows_ = [(altitude[t], azimuth[t], share[t], ratio[t]) for t in known]
            for name, half in (("Set 1", one), ("Set 2", two)):
                height = float(np.degrees(np.arcsin(np.polyval(by_height, level[name]))))
                rows_.append((height, _azimuth(case, height, half), mean_share, ratio[name]))
            tilt, downhill, gain, left = _one_tilt(np.array(rows_))
            lines.append(f"| {first} | {second} | {tilt:.1f} | {downhill:.0f} | {gain:.3f} | {100 * left:.2f} |")
    return lines


def _azimuth(case: Any, altitude_deg: float, half: float) -> float:
    """The sun's azimuth [deg] at that altitude before (-1) or after (+1) noon of 22 July 2010."""
    from datetime import UTC, datetime

    from analysis.sky.sun import Site, sun_position
    from labdaq.clock import NS, utc_ns_of

    place = case.setup.site
    times = utc_ns_of(datetime(2010, 7, 22, 10, tzinfo=UTC)) + np.arange(0, 14 * 3600, 60) * NS
    seen = sun_position(times, Site(place.latitude_deg, place.longitude_deg, place.elevation_m))
    noon = int(np.argmax(seen.altitude_deg))
    mine = np.arange(len(times)) < noon if half < 0 else np.arange(len(times)) >= noon
    away = np.where(mine, np.abs(seen.altitude_deg - altitude_deg), np.inf)
    return float(seen.azimuth_deg[int(np.argmin(away))])


def _one_tilt(rows: Floats) -> tuple[float, float, float, float]:
    """Tilt up to `MOST_TILT_DEG` and its downhill azimuth [deg], gain within `MOST_GAIN`, and rms of what is left.

    For rows of altitude, azimuth [deg], beam share and ratio; each set counts as much as three and a half tests.
    """
    altitude, azimuth = np.radians(rows[:, 0]), np.radians(rows[:, 1])
    weight = np.where(np.arange(len(rows)) < len(rows) - 2, 1.0, (len(rows) - 2) / 2.0)
    best = (np.inf, 0.0, 0.0, 1.0)
    for tilt in np.linspace(0.0, MOST_TILT_DEG, 51):
        for downhill in np.arange(0.0, 360.0, 3.0):
            lean = rows[:, 2] / np.tan(altitude) * np.cos(azimuth - np.radians(downhill)) * np.radians(tilt)
            gain = float(np.clip(np.average(rows[:, 3] - lean, weights=weight), 1.0 - MOST_GAIN, 1.0 + MOST_GAIN))
            left = float(np.sqrt(np.average((rows[:, 3] - lean - gain) ** 2, weights=weight)))
            best = min(best, (left, float(tilt), float(downhill), gain))
    return best[1], best[2], best[3], best[0]
