"""Random effects to try: the catalogue's (cloud, shutter), and unnamed structure along each coordinate.

An unnamed family says only along which coordinates something smooth is wrong. If it explains a recording
better than the named mechanisms do, then nobody has named the physics yet, and saying so is the right answer.
"""

import numpy as np

from analysis.cases.model import Floats
from analysis.explain import along, shift_pattern
from analysis.explain.mechanisms.catalogue import BY_ID
from analysis.explain.scene import Scene
from analysis.explain.series import unrest
from analysis.explain.shift_pattern import without_pattern
from analysis.explain.wander import Wander

CLOUD = Wander(
    "cloud-drift",
    "time within each test",
    (along.in_time, along.roughly_in_time),
    (0.008, 0.02, 0.05, 0.12, 0.3),
    (25.0, 60.0, 140.0),
    BY_ID["cloud-drift"],
)
"""A thin cloud dims the sun smoothly, the edges of others do so in steps of all sizes."""
SHUTTER = Wander(
    "exposure-error", "luminance level", (along.in_luminance,), (0.02, 0.05, 0.1), (1.0,), BY_ID["exposure-error"]
)

UNREST = Wander(
    "clock-offset",
    "time, under broken cloud",
    (along.in_broken_cloud,),
    (0.12, 0.25, 0.5, 1.0, 2.0),
    (1.0,),
    BY_ID["clock-offset"],
)
"""Two clocks that differ under broken cloud: what it did in the meantime is not known (amplitude: root of min)."""

PATTERN = Wander(
    "lens-anisotropy",
    "how far, and which way, a lens shifts the sun's light",
    (shift_pattern.effects,),
    (0.03, 0.06, 0.12, 0.25),
    (shift_pattern.RING,),
    BY_ID["lens-anisotropy"],
)
"""The pattern of a lens that was simulated without any: which it is nobody knows beforehand."""

_UNTOUCHED = 0.2
"""A scatter whose median is below this share of its standard deviation (a Gaussian: 0.67) is that of few readings."""

SCAN_ORDER = "time since the test began"
SIZES = (0.03, 0.10, 0.30)
"""Relative standard deviations of unnamed structure that are tried."""


def named_wanders(scene: Scene, tried: set[str]) -> tuple[Wander, ...]:
    """The catalogue's random effects that can be tried on this scene."""
    pattern = (PATTERN,) if "goniometer" in scene.kinds and scene.retraced and without_pattern(scene) else ()
    return tuple(x for x in (CLOUD, SHUTTER, *pattern) if x.name in tried)


def unnamed_wanders(scene: Scene) -> tuple[Wander, ...]:
    """Unnamed structure along the coordinates that this scene has."""
    r = scene.readings
    tests = len(np.unique(r.test))
    found = []
    if "goniometer" in scene.kinds:
        found += [
            Wander("factor by direction", "direction, fixed in the room", (along.in_direction,), SIZES, (10.0, 28.0)),
            Wander(
                "light by direction",
                "direction, fixed in the room, added",
                (along.added_in_direction,),
                SIZES,
                (10.0, 28.0),
            ),
            Wander("factor by gamma", "gamma", (along.in_gamma,), SIZES, (14.0,)),
            Wander("factor by level", "level of the reading", (along.in_level,), SIZES, (2.0,)),
        ]
    elif "sky" in scene.kinds:
        found.append(Wander("factor by level", "level of the reading", (along.in_level,), SIZES, (2.0,)))
        if np.any(~np.isnan(r.gamma_deg)) and np.nanmax(r.gamma_deg) - np.nanmin(r.gamma_deg) > 10:
            found.append(
                Wander("factor by direction", "direction in the picture", (along.in_direction,), SIZES, (12.0, 35.0))
            )
            if not np.any(np.isnan(r.sun_azimuth_at_deg)):
                found.append(
                    Wander(
                        "factor in the sun's frame",
                        "direction from the sun",
                        (along.in_suns_frame,),
                        SIZES,
                        (15.0, 40.0),
                    )
                )
    else:
        found.append(Wander("factor by level", "level of the reading", (along.in_level,), SIZES, (0.7,)))
        if r.has_times:
            found.append(Wander("factor by time of day", "the time of day", (along.in_time_of_day,), SIZES, (80.0,)))
    suns = np.isfinite(r.altitude_deg) & np.isfinite(r.azimuth_deg)
    if tests > 2 and np.all(suns) and r.has_parts:
        found.append(Wander("sun part by sun's place", "the sun's place", (along.in_sun,), SIZES, (12.0,)))
    if r.has_times and np.max(np.bincount(r.test)) >= 20:
        longest = max(float(np.ptp(r.utc_ns[r.test == k])) / 1e9 for k in np.unique(r.test))
        steps = (max(15.0, longest / 150.0),)  # a scan takes minutes, a series of a meter a day
        found.append(Wander("factor by scan order", SCAN_ORDER, (along.in_scan_order,), SIZES, steps))
    if r.has_times and tests > 3:
        lengths = (60.0,) if "goniometer" in scene.kinds else (60.0, 6000.0)  # a meter ages over days
        found.append(Wander("factor by hour", "time over the campaign", (along.in_hours,), SIZES, lengths))
    return tuple(found)


def evenly_restless(scene: Scene, residual: Floats, root_min: float) -> bool:
    """Whether a residual (N,) is as large as an offset of ``root_min``² minutes makes it wherever daylight is restless.

    A few shadows or spikes are as large in all as such a scatter, but leave most restless readings untouched.
    """
    expected = root_min * unrest(scene)
    noise = scene.readings.noise / scene.readings.scale
    rows = expected > 2.0 * noise
    return bool(np.count_nonzero(rows) >= 5 and np.median(np.abs(residual[rows]) / expected[rows]) > _UNTOUCHED)
