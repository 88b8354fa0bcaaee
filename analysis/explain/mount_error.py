"""How roof meters usually stand and see: level to a tenth of a degree, cosine-true to some thousandths.

The same of the second instrument that a prediction may come from: its errors are in all meters alike. In thousands of
readings under a low sun such a lean is worth a hundred nats, and passes for a clock or for a tilt that somebody made.
"""

from typing import Final

import numpy as np

from analysis.cases.model import Floats
from analysis.explain.readings import ROOF, Readings

LEVEL_DEG: Final = 0.07
"""Usual lean of a head towards north, and towards east: what a bubble and a mast leave. Chosen on another author's
roofs (with twice as much, tilts of a degree had a third of their evidence left)."""
COSINE: Final = 0.002
"""Usual error of a head at 60° from its normal, growing as 1 - cos (of good heads; CIE/ISO 19476 f2)."""
_LOWEST_DEG: Final = 4.0
"""Below this the sun's height over a meter's own horizon is not told by a lean."""


def mount_errors(r: Readings) -> Floats:
    """Independent unit effects (N, K) on the stretched scale; (N, 0) where no roof meter sees a beam.

    To first order a lean by d [rad] towards azimuth a changes the beam by d tan(z) cos(A - a) of itself, with the sun
    at zenith angle z and azimuth A (Wang et al. 2016, Atmos. Meas. Tech. 9); a head's error e, by
    e (1 - cos z) / (1 - cos 60°).
    """
    roof = (r.kind == ROOF) & np.isfinite(r.sun)
    if not np.any(roof) or np.any(np.isnan((r.sun_altitude_at_deg + r.sun_azimuth_at_deg)[roof])):
        return np.zeros((len(r), 0))
    zenith = np.radians(90.0 - np.maximum(np.where(roof, r.sun_altitude_at_deg, 90.0), _LOWEST_DEG))
    azimuth = np.radians(np.where(roof, r.sun_azimuth_at_deg, 0.0))
    beam = np.where(roof, r.sun, 0.0) / np.hypot(r.simulated, r.floor) * np.abs(r.measured) / r.scale
    lean = np.radians(LEVEL_DEG) * np.tan(zenith) * beam
    parts = (lean * np.cos(azimuth), lean * np.sin(azimuth), COSINE * (1.0 - np.cos(zenith)) / 0.5 * beam)
    heads = [r.channel == k for k in np.unique(r.channel[roof])]
    whose = [np.ones(len(r), dtype=bool), *(heads if len(heads) > 1 else [])]
    return np.stack([np.where(rows, part, 0.0) for rows in whose for part in parts], axis=1)
