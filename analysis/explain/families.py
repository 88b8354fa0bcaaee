"""Random effects to try: the catalogue's (cloud, shutter), and unnamed structure along each coordinate.

An unnamed family says only along which coordinates something smooth is wrong. If it explains a recording
better than the named mechanisms do, then nobody has named the physics yet, and saying so is the right answer.
"""

import numpy as np
from scipy.special import gammaln

from analysis.cases.model import Floats
from analysis.explain import wander as w
from analysis.explain.fit import Fit
from analysis.explain.form_error import locally_wrong
from analysis.explain.lens_error import steepness
from analysis.explain.mechanisms.catalogue import BY_ID
from analysis.explain.scene import Scene
from analysis.explain.series import unrest
from analysis.explain.whitening import Whitener

CLOUD = w.Wander(
    "cloud-drift", "time within each test", w.in_time, (0.008, 0.02, 0.05, 0.12), (25.0, 60.0), BY_ID["cloud-drift"]
)
SHUTTER = w.Wander("exposure-error", "luminance level", w.in_level, (0.02, 0.05, 0.1), (1.0,), BY_ID["exposure-error"])

UNREST = w.Wander(
    "clock-offset",
    "time, under broken cloud",
    w.in_broken_cloud,
    (0.12, 0.25, 0.5, 1.0, 2.0),
    (1.0,),
    BY_ID["clock-offset"],
)
"""Two clocks that differ under broken cloud: what it did in the meantime is not known (amplitude: root of min)."""

_UNTOUCHED = 0.2
"""A scatter whose median is below this share of its standard deviation (a Gaussian: 0.67) is that of few readings."""

_SIZES = (0.03, 0.10, 0.30)
_ODD = 4.5
"""A reading this many standard deviations from what all others say of it is odd."""
_USUAL_ODD = 45.0
"""Evidence [nats] for odd readings that a lens's images make where nothing was left out."""
_EDGE_DEG = 0.7
"""By how much the edges of a lens's images may be misplaced [deg]."""
_FEW = 0.04
"""At most this share of the readings can be odd; more are a shape of their own."""


def named_wanders(scene: Scene, tried: set[str]) -> tuple[w.Wander, ...]:
    """The catalogue's random effects that can be tried on this scene."""
    return tuple(x for x in (CLOUD, SHUTTER) if x.name in tried)


def unnamed_wanders(scene: Scene) -> tuple[w.Wander, ...]:
    """Unnamed structure along the coordinates that this scene has."""
    r = scene.readings
    tests = len(np.unique(r.test))
    found = []
    if "goniometer" in scene.kinds:
        found += [
            w.Wander("factor by direction", "direction, fixed in the room", w.in_direction, _SIZES, (10.0, 28.0)),
            w.Wander(
                "light by direction", "direction, fixed in the room, added", w.added_in_direction, _SIZES, (10.0, 28.0)
            ),
            w.Wander("factor by gamma", "gamma", w.in_gamma, _SIZES, (14.0,)),
            w.Wander("factor by level", "level of the reading", w.in_level, _SIZES, (2.0,)),
        ]
    elif "sky" in scene.kinds:
        found.append(w.Wander("factor by level", "level of the reading", w.in_level, _SIZES, (2.0,)))
        if np.any(~np.isnan(r.gamma_deg)) and np.nanmax(r.gamma_deg) - np.nanmin(r.gamma_deg) > 10:
            found.append(
                w.Wander("factor by direction", "direction in the picture", w.in_direction, _SIZES, (12.0, 35.0))
            )
            if not np.any(np.isnan(r.sun_azimuth_at_deg)):
                found.append(
                    w.Wander(
                        "factor in the sun's frame", "direction from the sun", w.in_suns_frame, _SIZES, (15.0, 40.0)
                    )
                )
    else:
        found.append(w.Wander("factor by level", "level of the reading", w.in_level, _SIZES, (0.7,)))
        if r.has_times:
            found.append(w.Wander("factor by time of day", "the time of day", w.in_time_of_day, _SIZES, (80.0,)))
    suns = np.isfinite(r.altitude_deg) & np.isfinite(r.azimuth_deg)
    if tests > 2 and np.all(suns) and r.has_parts:
        found.append(w.Wander("sun part by sun's place", "the sun's place", w.in_sun, _SIZES, (12.0,)))
    if r.has_times and np.max(np.bincount(r.test)) >= 20:
        longest = max(float(np.ptp(r.utc_ns[r.test == k])) / 1e9 for k in np.unique(r.test))
        steps = (max(15.0, longest / 150.0),)  # a scan takes minutes, a series of a meter a day
        found.append(w.Wander("factor by scan order", "time since the test began", w.in_scan_order, _SIZES, steps))
    if r.has_times and tests > 3:
        lengths = (60.0,) if "goniometer" in scene.kinds else (60.0, 6000.0)  # a meter ages over days
        found.append(w.Wander("factor by hour", "time over the campaign", w.in_hours, _SIZES, lengths))
    return tuple(found)


def odd_readings(scene: Scene, fit: Fit, whitener: Whitener) -> tuple[w.Wander, float] | None:
    """Readings that stand alone (a glint, a spike, a shadow of something thin), as a random effect of their own.

    Returns the effect and the log of the number of ways in which so many readings could have been picked; ``None``
    where no reading stands alone.
    """
    count = len(scene.readings)
    inverse_root = whitener.whitened(np.eye(count))
    others_say = inverse_root.T @ whitener.whitened(fit.residual[:, None])[:, 0]
    precision = np.sum(inverse_root**2, axis=0)
    # where a lens's image is steep, a reading may be off by itself
    edges_deg = max([_EDGE_DEG, *(t.mechanism.displaces_deg(scene) for t in fit.terms)])
    edge = (edges_deg * steepness(scene)) ** 2 + locally_wrong(scene, fit.terms, fit.theta) ** 2
    alone = np.abs(others_say) / precision / np.sqrt(1.0 / precision + edge)
    odd = np.flatnonzero(alone > _ODD)
    if len(odd) == 0:
        return None
    odd = odd[np.argsort(-alone[odd])][: max(int(_FEW * count), 1)]
    columns = np.eye(count)[:, odd]
    ways = _USUAL_ODD + float(gammaln(count + 1) - gammaln(len(odd) + 1) - gammaln(count - len(odd) + 1))
    return w.Wander("odd readings", f"{len(odd)} readings that stand alone", lambda *_: columns, _SIZES, (1.0,)), ways


def evenly_restless(scene: Scene, residual: Floats, root_min: float) -> bool:
    """Whether a residual (N,) is as large as an offset of ``root_min``² minutes makes it wherever daylight is restless.

    A few shadows or spikes are as large in all as such a scatter, but leave most restless readings untouched.
    """
    expected = root_min * unrest(scene)
    noise = scene.readings.noise / scene.readings.scale
    rows = expected > 2.0 * noise
    return bool(np.count_nonzero(rows) >= 5 and np.median(np.abs(residual[rows]) / expected[rows]) > _UNTOUCHED)
