"""Sky for the places a shading disc hid: a Perez sky, matched to what is seen around them.

The ratio of the seen sky to the Perez sky is taken just outside the mask and carried over it, so that the filler
meets the sky it is put into. Either as one number for the whole disc, as in the Greenwood report, or as a membrane:
the harmonic function that takes the rim's values, which also suits an arm that runs from bright aureole to dark
horizon, where the report's single factor was known to overestimate.
"""

from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from analysis.sky.map import SkyMap
from analysis.sky.mask import ShadingDisc
from analysis.sky.perez import PerezSky
from labdaq.directions import angle_between

Floats = NDArray[np.float64]
Mask = NDArray[np.bool_]

RIM_DEG: Final = 2.5
"""How far around the mask the sky is looked at [deg]."""

METHODS: Final = ("membrane", "single")


def fill(sky: SkyMap, disc: ShadingDisc, model: PerezSky, method: str = "membrane") -> tuple[SkyMap, dict[str, Any]]:
    """Fill the masked part of a map.

    Parameters
    ----------
    sky
        In any unit; only its ratio to the model counts.
    disc
        Its ``mask`` is filled, and what else of the sky is unknown.
    model
        The Perez sky of the moment; its level does not matter.
    method
        ``membrane`` or ``single``.

    Returns the filled map and a JSON-able account: the median ratio at the rim in the sky's unit, how much it scatters
    (a rim that scatters by more than a fifth is a broken sky, where any filler is a guess), and flags.
    """
    if method not in METHODS:
        raise ValueError(f"a filler is one of {', '.join(METHODS)}, not {method!r}")
    shape = SkyMap.from_function(model.luminance, sky.n)
    hidden = disc.mask | (~sky.known & (sky.solid_angle_sr > 0.0))
    rim = _grown(hidden, RIM_DEG, sky.n) & sky.known & ~hidden
    ratio = np.where(rim, sky.luminance / np.where(shape.luminance > 0.0, shape.luminance, 1.0), 0.0)
    # the level of the disc's filler comes from the disc's rim, not from the arm's
    at_disc = rim & (angle_between(sky.directions, disc.centre) < disc.radius_deg + RIM_DEG + 0.5)
    level, scatter = _middle(ratio, at_disc if np.count_nonzero(at_disc) >= 20 else rim)
    flags = []
    if not np.any(rim):
        flags.append("no-rim")
    if scatter > 0.2:
        flags.append("broken-sky-at-rim")
    if method == "single" or not np.any(rim):
        factor = np.full(hidden.shape, level)
    else:
        factor = _membrane(np.where(rim, ratio, level), hidden, rim, level)
    patch = SkyMap.of(np.where(hidden, shape.luminance * factor, 0.0), hidden)
    account = {
        "method": method,
        "rim_ratio": level,
        "rim_scatter": round(scatter, 4),
        "rim_pixels": int(np.count_nonzero(rim)),
        "perez": {
            "epsilon": model.condition.epsilon,
            "delta": model.condition.delta,
            "coefficients": list(model.coefficients),
            "flags": list(model.flags),
        },
        "flags": flags,
    }
    return sky.masked(hidden).filled(patch), account


def _grown(mask: Mask, by_deg: float, n: int) -> Mask:
    import cv2

    reach = max(1, round(by_deg / 180.0 * n))
    kernel = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * reach + 1, 2 * reach + 1))
    return np.asarray(cv2.dilate(mask.astype(np.uint8), kernel) > 0)


def _middle(ratio: Floats, where: Mask) -> tuple[float, float]:
    """Median of the ratios in ``where``, and half the width of their middle two thirds over it; 1 and 0 without any."""
    values = ratio[where]
    if values.size == 0:
        return 1.0, 0.0
    level = float(np.median(values))
    low, high = np.quantile(values, [1.0 / 6.0, 5.0 / 6.0])
    spread = float(high - low) / 2.0
    return level, spread / level if level > 0.0 else float("inf")


def _membrane(ratio: Floats, hidden: Mask, rim: Mask, level: float) -> Floats:
    """Harmonic continuation of the rim's ratios over the hidden pixels (Laplace's equation, five points)."""
    import cv2
    from scipy.sparse import csr_matrix
    from scipy.sparse.linalg import spsolve

    # the rim itself is smoothed first, so that one noisy pixel does not pull the membrane; outliers are trees or glints
    good = rim & (ratio > 0.4 * level) & (ratio < 2.5 * level)
    size = (0, 0)
    sigma = max(1.0, RIM_DEG / 2.5 / 180.0 * len(ratio))
    top = cv2.GaussianBlur(np.where(good, ratio, 0.0), size, sigma)
    bottom = cv2.GaussianBlur(good.astype(np.float64), size, sigma)
    smooth = np.where(bottom > 1e-3, top / np.maximum(bottom, 1e-3), level)
    rows, columns = np.nonzero(hidden)
    number = np.full(hidden.shape, -1)
    number[rows, columns] = np.arange(len(rows))
    own, other, value = [np.arange(len(rows))], [np.arange(len(rows))], [np.zeros(len(rows))]
    right, degree = np.zeros(len(rows)), np.zeros(len(rows))
    for di, dj in ((-1, 0), (1, 0), (0, -1), (0, 1)):
        i, j = rows + di, columns + dj
        inside = (i >= 0) & (i < len(ratio)) & (j >= 0) & (j < len(ratio))
        i, j = np.clip(i, 0, len(ratio) - 1), np.clip(j, 0, len(ratio) - 1)
        next_hidden = inside & (number[i, j] >= 0)
        on_rim = inside & rim[i, j] & ~next_hidden
        # a neighbour that is neither (the horizon, another hole) lets the membrane end freely
        degree += next_hidden | on_rim
        right += np.where(on_rim, smooth[i, j], 0.0)
        own.append(np.nonzero(next_hidden)[0])
        other.append(number[i, j][next_hidden])
        value.append(np.full(np.count_nonzero(next_hidden), -1.0))
    # a whisper of the level keeps patches without any rim solvable
    value[0] = degree + 1e-9
    right += 1e-9 * level
    system = csr_matrix((np.concatenate(value), (np.concatenate(own), np.concatenate(other))))
    factor = np.full(hidden.shape, level)
    factor[rows, columns] = spsolve(system, right)
    return factor
