"""What all pictures of one camera have wrong together, as random effects that every hypothesis allows for.

A camera's flat field is never known exactly: a smooth factor over the picture, the same in every test. How large it is
nobody announces, so it grows with `Hyper.lens`.
"""

import numpy as np

from analysis.cases.model import Floats
from analysis.explain.scene import Scene
from labdaq import directions

USUAL = 0.005
"""Usual relative error of a corrected flat field."""
WIDTHS_DEG = ((0.7, 22.0), (0.3, 60.0))
"""Shares of its variance, and the angles over which it changes."""


def sky_error_effects(scene: Scene) -> Floats:
    """Independent unit effects (N, K) on the stretched scale; (N, 0) without luminance rows of two tests."""
    r = scene.readings
    tests = np.unique(r.test[scene.is_sky])
    parts = [np.zeros((len(r), 0))]
    if len(tests) > 1:
        loud = np.where(scene.is_sky, np.abs(r.measured) / r.scale, 0.0)
        v = directions.vector(np.nan_to_num(r.gamma_deg, nan=180.0), np.nan_to_num(r.c_deg))
        for channel in np.unique(r.channel[scene.is_sky]):
            size = USUAL * np.where(r.channel == channel, loud, 0.0)[:, None]
            parts += [np.sqrt(share) * size * _bumps(v, width) for share, width in WIDTHS_DEG]
    return np.concatenate(parts, axis=1)


def _bumps(v: Floats, width_deg: float) -> Floats:
    """Smooth bumps over the upper half of the sphere whose independent sum has unit variance; (N, K)."""
    count = int(np.ceil(4.0 * np.pi / np.radians(0.8 * width_deg) ** 2))
    nodes = directions.evenly(count)
    bumps = np.exp(-2.0 * np.maximum(1.0 - v @ nodes.T, 0.0) / np.radians(width_deg) ** 2)
    bumps = bumps[:, bumps.max(axis=0) > 0.1]
    return np.asarray(bumps / np.sqrt(np.maximum(np.sum(bumps**2, axis=1, keepdims=True), 0.05)))
