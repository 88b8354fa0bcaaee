"""Reading fields between the nodes of their grid: the innermost loop of all that moves an arm, a lens or a sun."""

from collections.abc import Callable
from functools import cache

import numpy as np
from numpy.typing import NDArray

from analysis.cases.model import Floats

Read = Callable[[Floats, NDArray[np.int64], Floats, Floats], Floats]


class Sampler:
    """Reads fields (T, P, G), of planes all around and gammas from 0° to 90°, at directions.

    Cubic in gamma and C (Keys 1981, IEEE Trans. ASSP 29, 1153, a = -1/2), as an image of the sun is too sharp for
    straight lines between 5° x 2.5°. Beyond nadir lies the opposite half-plane, beyond the horizon the straight
    continuation.

    Parameters
    ----------
    test : shape (N,), integers
        Number of the field that each row is read from.
    gamma_deg, c_deg : shape (N,) [deg]
        Where; a negative gamma lies in the opposite half-plane, gammas over 90° are read at 90°.
    """

    def __init__(self, test: NDArray[np.int64], gamma_deg: Floats, c_deg: Floats) -> None:
        self._rows = np.asarray(test, dtype=np.int64), np.asarray(gamma_deg, float), np.asarray(c_deg, float)

    def __call__(self, field: Floats) -> Floats:
        """Values (N,) of a field (T, P, G) that is nowhere negative; NaN beside NaN."""
        return _compiled()(np.ascontiguousarray(field), *self._rows)


@cache
def _compiled() -> Read:
    """`_read`, compiled when it is first asked for: roofs and cameras need no arm's fields."""
    from analysis.bsdf.compiled import compiled

    return compiled(_read)


def _read(field: Floats, test: NDArray[np.int64], gamma_deg: Floats, c_deg: Floats) -> Floats:
    planes, rings = field.shape[1], field.shape[2]
    made = np.empty(len(test))
    weights = np.empty((2, 4))
    for n in range(len(test)):
        c = c_deg[n] + 180.0 if gamma_deg[n] < 0.0 else c_deg[n]
        x = min(abs(gamma_deg[n]) / 90.0 * (rings - 1), rings - 1.000001)
        y = c % 360.0 / 360.0 * planes
        i, j = int(x), int(y)
        for axis, u in enumerate((x - i, y - j)):
            weights[axis, 0] = 0.5 * u * (u * (2.0 - u) - 1.0)
            weights[axis, 1] = 0.5 * (2.0 + u * u * (3.0 * u - 5.0))
            weights[axis, 2] = 0.5 * u * (1.0 + u * (4.0 - 3.0 * u))
            weights[axis, 3] = 0.5 * u * u * (u - 1.0)
        if i + 2 == rings:  # a fourth value as straight as the second and the third
            weights[0, 1] -= weights[0, 3]
            weights[0, 2] += 2.0 * weights[0, 3]
            weights[0, 3] = 0.0
        value = 0.0
        for a in range(4):
            ring = min(i - 1 + a, rings - 1)
            opposite = planes // 2 if ring < 0 else 0
            for b in range(4):
                plane = (j - 1 + b + opposite) % planes
                value += weights[0, a] * weights[1, b] * field[test[n], plane, abs(ring)]
        made[n] = 0.0 if value < 0.0 else value
    return made
