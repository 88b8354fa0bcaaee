"""Random functions of time, level, direction and the sun's place: independent unit effects on a scene's rows."""

from collections.abc import Callable
from functools import partial

import numpy as np

from analysis.cases.model import Floats
from analysis.explain.scene import Scene
from analysis.explain.series import unrest
from labdaq import directions

_PER_TIME = 5.0
"""Nodes of a rough function of time in each of its times."""
_RESTLESS_ROWS = 250
_CLOUD_IN_CLEAR = 0.12
"""What passes the sun in a test that was called clear, over what passes under broken cloud: thin veils at most."""


def sun_share(scene: Scene) -> Floats:
    """Share of the sun part in each row's prediction, times how far the reading stands above the floor; shape (N,)."""
    r = scene.readings
    total = np.maximum(np.abs(r.simulated), 1e-12)
    share = np.where(np.isfinite(r.sun), r.sun, total) / total
    return np.asarray(np.clip(share, 0.0, 1.0) * loud(scene))


def loud(scene: Scene) -> Floats:
    """Reading over scale: 1 well above the floor, 0 in the dark; shape (N,)."""
    return np.asarray(np.abs(scene.readings.measured) / scene.readings.scale)


def cloud_share(scene: Scene) -> Floats:
    """Share of each row's prediction that a passing cloud changes, as far as the test's sky has clouds; shape (N,).

    The sun part under broken cloud; all light where the sky is overcast, and the cloud itself is the source.
    """
    r = scene.readings
    skies = np.array([test.sky or "" for test in r.case.tests])[r.test]
    broken = sun_share(scene) * np.where(skies == "clear", _CLOUD_IN_CLEAR, 1.0)
    return np.where(skies == "overcast", loud(scene), broken)


def in_time(scene: Scene, seconds: float) -> Floats:
    """The source's brightness as a smooth random function of time within each test."""
    return _within_tests(scene, partial(_smoothly, seconds=seconds))


def roughly_in_time(scene: Scene, seconds: float) -> Floats:
    """The same with steps at all scales, as the edges of clouds make them: covariance exp(-|Δt| / ``seconds``)."""
    return _within_tests(scene, partial(_roughly, seconds=seconds))


def _within_tests(scene: Scene, made: Callable[[Floats], Floats]) -> Floats:
    """Effects on the source that know nothing from test to test; ``made`` gives those (n, K) at times (n,) [s]."""
    r = scene.readings
    t = r.utc_ns / 1e9
    parts = []
    for k in np.unique(r.test):
        rows = r.test == k
        effects = made(t[rows])
        part = np.zeros((len(r), effects.shape[1]))
        part[rows] = effects
        parts.append(part)
    return np.concatenate(parts, axis=1) * cloud_share(scene)[:, None]


def _smoothly(t: Floats, seconds: float) -> Floats:
    """Effects (n, K) of a smooth function of time at ``t`` (n,) [s]."""
    times, which = np.unique(t, return_inverse=True)
    if (times[-1] - times[0]) / (0.7 * seconds) + 2 < len(times):
        return smooth(t, np.arange(times[0] - seconds / 2, times[-1] + seconds, 0.7 * seconds), seconds)
    # fewer readings than nodes: their own covariance is the smaller thing
    near = np.exp(-(((times[:, None] - times[None, :]) / seconds) ** 2))
    return np.asarray(np.linalg.cholesky(near + 1e-6 * np.eye(len(times)))[which])


def _roughly(t: Floats, seconds: float) -> Floats:
    """Effects (n, K) of a rough function of time at ``t`` (n,) [s]."""
    times, which = np.unique(t, return_inverse=True)
    nodes = np.arange(times[0], times[-1] + 2.0 * seconds / _PER_TIME, seconds / _PER_TIME)
    at = times if len(times) <= len(nodes) else nodes
    root = np.linalg.cholesky(np.exp(-np.abs(at[:, None] - at[None, :]) / seconds) + 1e-6 * np.eye(len(at)))
    return np.asarray(root[which] if at is times else _between(t, nodes, root))


def _between(t: Floats, nodes: Floats, values: Floats) -> Floats:
    """``values`` (M, K) at evenly spaced ``nodes`` (M,), interpolated at times ``t`` (N,) to unit variance; (N, K)."""
    place = (t - nodes[0]) / (nodes[1] - nodes[0])
    low = np.minimum(place.astype(np.int64), len(nodes) - 2)
    share = (place - low)[:, None]
    made = (1.0 - share) * values[low] + share * values[low + 1]
    return np.asarray(made / np.linalg.norm(made, axis=1)[:, None])


def in_level(scene: Scene, stops: float) -> Floats:
    """A factor that is a random function of the predicted level, the same in all tests of an instrument."""
    r = scene.readings
    level = np.log2(np.maximum(r.simulated, r.floor))  # never the reading itself: it carries its own noise
    return np.concatenate(
        [
            smooth(level, np.arange(level[rows].min() - stops, level[rows].max() + stops, 0.7 * stops), stops)
            * (rows * loud(scene))[:, None]
            for rows in (r.channel == k if kind == "sky" else r.kind == kind for k, kind in _groups(scene))
        ],
        axis=1,
    )


def in_luminance(scene: Scene, stops: float) -> Floats:
    """The same of luminances alone."""
    columns = np.where(scene.is_sky[:, None], in_level(scene, stops), 0.0)
    return np.asarray(columns[:, np.any(columns, axis=0)])


def _groups(scene: Scene) -> list[tuple[int, str]]:
    """Luminance channels one by one, goniometer and roof as a whole."""
    r = scene.readings
    groups = [(int(k), "sky") for k in np.unique(r.channel[r.kind == "sky"])]
    return groups + [(-1, kind) for kind in scene.kinds if kind != "sky"]


def in_direction(scene: Scene, degrees: float) -> Floats:
    """A factor that is a random function of direction, fixed in the room: the same for every test and system."""
    return sphere(scene, degrees) * (loud(scene) * ~np.isnan(scene.readings.gamma_deg))[:, None]


def added_in_direction(scene: Scene, degrees: float) -> Floats:
    """Light added as a random function of direction, in proportion to each test's mean intensity."""
    r = scene.readings
    count = len(r.case.tests)
    total = np.bincount(r.test, weights=np.abs(r.measured), minlength=count)
    mean = total / np.maximum(np.bincount(r.test, minlength=count), 1)
    size = np.minimum(mean[r.test] / np.hypot(r.simulated, r.floor), 5.0)  # by the reading it would follow its noise
    return np.asarray(sphere(scene, degrees) * (size * ~np.isnan(r.gamma_deg))[:, None])


def in_sun(scene: Scene, degrees: float) -> Floats:
    """A factor on the sun part that is a random function of the sun's place."""
    r = scene.readings
    towards = directions.sky_vector(r.altitude_deg, r.azimuth_deg)
    near = np.exp(-np.maximum(1.0 - towards @ towards.T, 0.0) / np.radians(degrees) ** 2)
    root = np.linalg.cholesky(near + 1e-6 * np.eye(len(near)))
    return np.asarray(root[r.test] * sun_share(scene)[:, None])


def in_gamma(scene: Scene, degrees: float) -> Floats:
    """A factor that is a random function of gamma alone, the same in all planes and tests."""
    nodes = np.arange(-degrees, 90.0 + degrees, 0.7 * degrees)
    return smooth(np.nan_to_num(scene.readings.gamma_deg), nodes, degrees) * (loud(scene) * scene.is_gonio)[:, None]


def in_scan_order(scene: Scene, seconds: float) -> Floats:
    """A factor that is a random function of the time since the test began, the same in all tests."""
    r = scene.readings
    t = r.utc_ns / 1e9
    began = np.full(len(r.case.tests), np.inf)
    np.minimum.at(began, r.test, t)
    since = t - began[r.test]
    return smooth(since, np.arange(-seconds, since.max() + seconds, 0.7 * seconds), seconds) * loud(scene)[:, None]


def in_time_of_day(scene: Scene, minutes: float) -> Floats:
    """A factor that is a smooth random function of the time of day, the same on all days and channels."""
    local = 60.0 * scene.readings.solar_h
    nodes = np.arange(local.min() - minutes, local.max() + minutes, 0.7 * minutes)
    return smooth(local, nodes, minutes) * loud(scene)[:, None]


def in_broken_cloud(scene: Scene, _: float) -> Floats:
    """Independent errors, as large as daylight wanders in a minute: two instruments that do not read at one moment.

    Only the most restless rows: beyond a few hundred they cost time and tell nothing more.
    """
    restless = unrest(scene) * loud(scene)
    rows = np.argsort(-restless)[:_RESTLESS_ROWS]
    rows = rows[restless[rows] > 0.0]
    columns = np.zeros((len(restless), len(rows)))
    columns[rows, np.arange(len(rows))] = restless[rows]
    return columns


def in_hours(scene: Scene, minutes: float) -> Floats:
    """A factor that is a slow random function of time over the campaign, the same for all channels."""
    t = scene.readings.utc_ns / 6e10
    middles = np.array([t[scene.readings.test == k].mean() for k in np.unique(scene.readings.test)])
    kernel = np.exp(-np.abs(middles[:, None] - middles[None, :]) / minutes) + 1e-9 * np.eye(len(middles))
    where = np.searchsorted(np.unique(scene.readings.test), scene.readings.test)
    return np.asarray(np.linalg.cholesky(kernel)[where] * loud(scene)[:, None])


def smooth(x: Floats, nodes: Floats, width: float) -> Floats:
    """Gaussian bumps (N, K) at ``nodes``, scaled so that their independent sum has unit variance about everywhere."""
    bumps = np.exp(-(((x[:, None] - nodes[None, :]) / width) ** 2))
    power = np.sqrt(np.pi / 2.0) / 0.7  # sum over nodes 0.7 widths apart of exp(-2 d²/w²)
    return np.asarray(bumps / np.sqrt(power))


def in_suns_frame(scene: Scene, degrees: float) -> Floats:
    """A factor that is a random function of direction as seen with the sun ahead: it turns with the sun's azimuth."""
    r = scene.readings
    turned = np.nan_to_num(r.c_deg) + r.sun_azimuth_at_deg
    v = directions.vector(np.nan_to_num(r.gamma_deg, nan=180.0), turned)
    return _bumps(v, degrees) * (loud(scene) * ~np.isnan(r.gamma_deg))[:, None]


def sphere(scene: Scene, degrees: float) -> Floats:
    """Bumps about nodes spread over the sphere where readings lie; (N, K), unit variance."""
    r = scene.readings
    return _bumps(directions.vector(np.nan_to_num(r.gamma_deg, nan=180.0), np.nan_to_num(r.c_deg)), degrees)


def _bumps(v: Floats, degrees: float) -> Floats:
    count = int(np.ceil(4.0 * np.pi / (0.8 * np.radians(degrees)) ** 2))
    nodes = directions.evenly(count)
    # exp(-angle²/w²): the product of two of them correlates as exp(-angle²/(2 w²))
    bumps = np.exp(-2.0 * np.maximum(1.0 - v @ nodes.T, 0.0) / np.radians(degrees) ** 2)
    bumps = bumps[:, bumps.max(axis=0) > 0.2]
    return np.asarray(bumps / np.sqrt(np.maximum(np.sum(bumps**2, axis=1, keepdims=True), 0.05)))
