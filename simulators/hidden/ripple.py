"""Smooth random fields: what no model of a lens, a sky or a head gets quite right.

A sum of plane waves in space, looked at on the unit sphere (a random Fourier series of a stationary field; Rahimi
and Recht 2007): band-limited, without poles or seams.
"""

import math

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


class Ripple:
    """A field of mean about zero and given rms over the directions.

    Parameters
    ----------
    rms
        Root mean square over realisations and directions.
    shortest_deg, longest_deg
        Range of wavelengths on the sphere [deg].
    """

    def __init__(
        self,
        rng: np.random.Generator,
        rms: float,
        shortest_deg: float = 30.0,
        longest_deg: float = 150.0,
        waves: int = 48,
    ) -> None:
        axes = rng.normal(size=(waves, 3))
        axes /= np.linalg.norm(axes, axis=1, keepdims=True)
        lengths = np.exp(rng.uniform(math.log(shortest_deg), math.log(longest_deg), waves))
        self._waves = axes * (2.0 * math.pi / np.radians(lengths))[:, None]
        self._phases = rng.uniform(0.0, 2.0 * math.pi, waves)
        self._level = rms * math.sqrt(2.0 / waves)

    def __call__(self, directions: Floats) -> Floats:
        """Value towards unit vectors (..., 3)."""
        return self._level * np.sum(np.cos(directions @ self._waves.T + self._phases), axis=-1)  # type: ignore[no-any-return]
