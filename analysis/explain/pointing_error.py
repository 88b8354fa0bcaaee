"""Where a camera usually points: its axis and its north are right to a fraction of a degree.

The same of whatever predicts its readings. Near the sun a sky changes by several per cent in a degree, so that in
hundreds of directions a quarter of a degree is worth hundreds of nats, and passes for the projection of the lens. A
camera that points much farther off is a conjecture (`analysis.explain.mechanisms.misaligned_camera`).
"""

from typing import Final

import numpy as np

from analysis.cases.model import Floats
from analysis.explain.lens_error import arm_steepness
from analysis.explain.scene import Scene
from analysis.explain.sky_shape import tilted, towards, turned

USUAL_DEG: Final = 0.15
"""Usual error about each of three axes: what a spirit level and a compass leave."""
_STEP_DEG: Final = 0.5


def pointing_errors(scene: Scene) -> Floats:
    """Independent unit effects (N, K) on the stretched scale; (N, 0) where the sky's shape is not known."""
    r = scene.readings
    placed = np.isfinite(r.sun_altitude_at_deg + r.sun_azimuth_at_deg) & np.isfinite(r.gamma_deg)
    if not np.any(scene.is_sky) or not np.all(placed[scene.is_sky]):
        return np.zeros((len(r), 0))
    v, loud = towards(r), np.where(scene.is_sky, np.abs(r.measured) / r.scale, 0.0)
    moved = tilted(v, _STEP_DEG, 0.0), tilted(v, 0.0, _STEP_DEG), turned(v, _STEP_DEG)
    return np.stack([USUAL_DEG / _STEP_DEG * loud * scene.sky_shape.beside(w) for w in moved], axis=1)


def sky_steepness(scene: Scene) -> Floats:
    """Change of each luminance per degree across the sky, on the stretched scale; (N,), zero where it is not known.

    The three axes together are two directions at right angles, wherever one looks.
    """
    return np.asarray(np.linalg.norm(scene.remember(pointing_errors), axis=1) / USUAL_DEG)


def steepness(scene: Scene) -> Floats:
    """Change of each row's prediction per degree, of an arm and of the sky, on the stretched scale; (N,)."""
    return arm_steepness(scene) + sky_steepness(scene)
