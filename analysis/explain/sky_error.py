"""What all pictures of one camera have wrong together, as random effects that every hypothesis allows for.

A camera's flat field is never known exactly: a smooth factor over the picture, the same in every test. And a model of
the sky, or a second instrument, is wrong by a little that goes smoothly with the angle from the sun, with heights, and
with the level. How large all this is nobody announces, so it grows with `Hyper.lens`.
"""

import numpy as np

from analysis.cases.model import Floats
from analysis.explain.nearness import smooth_along
from analysis.explain.scene import Scene
from analysis.explain.sky_shape import towards
from analysis.explain.sun_light import sun_about
from labdaq import directions

USUAL = 0.005
"""Usual relative error of a corrected flat field."""
WIDTHS_DEG = ((0.7, 22.0), (0.3, 60.0))
"""Shares of its variance, and the angles over which it changes."""
BY_ANGLE, BY_LEVEL = 0.004, 0.003
"""Usual relative error of a model of the sky, as smooth functions of the angle from the sun, of the height of a
direction and of the sun's; and of the level. (Another author's models were wrong so by 2.5 % rms where nothing was
left out: errors of the exposures for 400 nats.)"""
BY_SUN = 0.002
"""The same of a model's light about the sun, which looks like the sun's light spread in a lens: rms over all rows."""
WIDTH_DEG = 20.0
"""Over so much of an angle these change; of the level, over a factor of two."""


def sky_error_effects(scene: Scene) -> Floats:
    """Independent unit effects (N, K) on the stretched scale; (N, 0) without luminance rows of two tests."""
    if len(np.unique(scene.readings.test[scene.is_sky])) < 2:
        return np.zeros((len(scene.readings), 0))
    return np.concatenate([flat_field(scene), of_a_model(scene)], axis=1)


def flat_field(scene: Scene) -> Floats:
    """Effects (N, K) of what each camera's flat field has wrong."""
    v = towards(scene.readings)
    bumps = np.concatenate([np.sqrt(share) * _bumps(v, width) for share, width in WIDTHS_DEG], axis=1)
    return np.concatenate([USUAL * loud * bumps for loud in _channels(scene)], axis=1)


def of_a_model(scene: Scene) -> Floats:
    """Effects (N, K): smooth functions of what a sky model's luminance goes by, for each channel.

    What they would have in common in all rows of a channel is its gain, and left out.
    """
    r = scene.readings
    shares = [BY_LEVEL * smooth_along(np.log2(np.maximum(r.simulated, r.floor)), 1.0)]
    placed = np.isfinite(r.sun_altitude_at_deg) & np.isfinite(r.sun_azimuth_at_deg)
    if np.all(placed[scene.is_sky]):
        v, altitude = towards(r), np.where(placed, r.sun_altitude_at_deg, 45.0)
        sun = directions.sky_vector(altitude, np.where(placed, r.sun_azimuth_at_deg, 0.0))
        height = np.degrees(np.arcsin(np.clip(v[:, 2], -1.0, 1.0)))
        angles = (directions.angle_between(v, sun), height, altitude)
        shares += [BY_ANGLE * smooth_along(x, WIDTH_DEG) for x in angles]
        about = np.where(scene.is_sky, scene.remember(sun_about) / np.maximum(r.simulated, r.floor), 0.0)
        size = float(np.sqrt(np.mean(about[scene.is_sky] ** 2)))
        shares.append(BY_SUN * about[:, None] / max(size, 1e-12))
    functions = np.concatenate(shares, axis=1)
    return np.concatenate(
        [loud * (functions - functions[loud[:, 0] > 0.0].mean(axis=0)) for loud in _channels(scene)], axis=1
    )


def _channels(scene: Scene) -> list[Floats]:
    """Of each channel of luminances, how far its readings stand above their floor, (N, 1); zero for other rows."""
    r = scene.readings
    loud = np.where(scene.is_sky, np.abs(r.measured) / r.scale, 0.0)
    return [np.where(r.channel == k, loud, 0.0)[:, None] for k in np.unique(r.channel[scene.is_sky])]


def _bumps(v: Floats, width_deg: float) -> Floats:
    """Smooth bumps over the upper half of the sphere whose independent sum has unit variance; (N, K)."""
    count = int(np.ceil(4.0 * np.pi / np.radians(0.8 * width_deg) ** 2))
    nodes = directions.evenly(count)
    bumps = np.exp(-2.0 * np.maximum(1.0 - v @ nodes.T, 0.0) / np.radians(width_deg) ** 2)
    bumps = bumps[:, bumps.max(axis=0) > 0.1]
    return np.asarray(bumps / np.sqrt(np.maximum(np.sum(bumps**2, axis=1, keepdims=True), 0.05)))
