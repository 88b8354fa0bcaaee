"""The sun's own light, were it spread over the sky: in a lens, or by air of which a model knows less than there is."""

import numpy as np

from analysis.cases.model import Floats
from analysis.explain.scene import Scene
from analysis.explain.sky_shape import towards
from labdaq import directions

CORE_DEG = 10.0
"""Within this angle light is spread evenly, for the directions that were read are as far apart."""
_LOWEST_DEG = 5.0
"""The beam of a lower sun is not what its horizontal part says."""


def normal_beam(scene: Scene) -> Floats:
    """Illuminance [lx] on a plane that faces the sun, at each luminance reading; zero where it is not known; (N,).

    Through a test it is that of the test's illuminances: a sun that climbs shines on the horizontal more, and on such a
    plane hardly.
    """
    r = scene.readings
    height = np.sin(np.radians(np.maximum(np.nan_to_num(r.altitude_deg), _LOWEST_DEG)))
    placed = scene.is_sky & ~np.isnan(r.sun_altitude_at_deg + r.sun_azimuth_at_deg)
    return np.where(placed, np.nan_to_num(scene.beam_lx / height)[r.test], 0.0)


def sun_evenly(scene: Scene) -> Floats:
    """Luminance of the whole sky [cd/m²] if the sun's light were spread over it; (N,)."""
    return scene.remember(normal_beam) / (2.0 * np.pi)


def sun_about(scene: Scene) -> Floats:
    """Luminance [cd/m²] of each row's direction if the sun's light were spread with 1/(angle² + core²); (N,)."""
    r = scene.readings
    sun = directions.sky_vector(np.nan_to_num(r.sun_altitude_at_deg), np.nan_to_num(r.sun_azimuth_at_deg))
    rings = np.arange(0.25, 90.0, 0.5)
    around = 2.0 * np.pi * np.radians(0.5) * np.sum(np.sin(np.radians(rings)) / (rings**2 + CORE_DEG**2))
    away = directions.angle_between(towards(r), sun)
    return np.asarray(scene.remember(normal_beam) / (away**2 + CORE_DEG**2) / around)
