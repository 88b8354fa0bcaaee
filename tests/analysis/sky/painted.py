"""Skies with a shading disc painted in, whose truth is known."""

import numpy as np
from numpy.typing import NDArray

from analysis.sky.map import SkyMap
from analysis.sky.perez import PerezSky
from labdaq.directions import angle_between, sky_vector

Floats = NDArray[np.float64]


def rod_and_disc(
    directions: Floats, centre: Floats, radius_deg: float, half_width_deg: float, lean_deg: float
) -> Floats:
    """Share of sky (1 open, 0 hidden) left by a disc and its rod, both with edges half a degree soft.

    The rod hangs down from the disc, leaning ``lean_deg`` to the left as seen.
    """
    off = angle_between(directions, centre)
    disc = np.clip((off - radius_deg) / 0.5 + 0.5, 0.0, 1.0)
    left = np.cross([0.0, 0.0, 1.0], centre)
    left /= np.linalg.norm(left)
    up = np.cross(centre, left)
    along = -np.cos(np.radians(lean_deg)) * up + np.sin(np.radians(lean_deg)) * left
    normal = np.cross(centre, along)
    across = np.degrees(np.arcsin(np.clip(np.abs(directions @ normal), 0.0, 1.0)))
    rod = np.clip((across - half_width_deg) / 0.5 + 0.5, 0.0, 1.0)
    rod = np.where(directions @ along > 0.0, rod, 1.0)
    return np.minimum(disc, rod)


def painted(
    sky: PerezSky, n: int, *, radius_deg: float = 5.0, arm_deg: float = 1.0, lean_deg: float = 10.0,
    off_deg: float = 0.0, trees: bool = True, noise: float = 0.0, seed: int = 0,
) -> tuple[SkyMap, SkyMap]:  # fmt: skip
    """A map of ``sky`` with disc, rod, dark trees up to 8° high in the north, and noise; and one without disc, rod."""
    centre = sky_vector(sky.sun_altitude_deg + off_deg, sky.sun_azimuth_deg)

    def truth(d: Floats) -> Floats:
        luminance = sky.luminance(d)
        altitude = np.degrees(np.arcsin(np.clip(d[..., 2], -1.0, 1.0)))
        azimuth = np.degrees(np.arctan2(d[..., 0], d[..., 1])) % 360.0
        top = 4.0 + 4.0 * np.abs(np.sin(np.radians(5.0 * azimuth)))
        wood = trees & (altitude < top) & ((azimuth < 60.0) | (azimuth > 300.0))
        return np.where(wood, 0.05 * luminance, luminance)

    def seen(d: Floats) -> Floats:
        share = rod_and_disc(d, centre, radius_deg, arm_deg, lean_deg)
        return truth(d) * (0.03 + 0.97 * share)

    rng = np.random.default_rng(seed)
    grain = 1.0 + noise * rng.standard_normal((n, n))
    return SkyMap.from_function(seen, n).scaled(grain), SkyMap.from_function(truth, n)
