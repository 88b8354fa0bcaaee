"""Exposure times, refined from what the exposures show.

The ratio of two exposure times is the ratio of their summed signals over places where both are good. Places are
chosen by the value predicted for them, not by what was read there, so that noise does not choose. All ratios and the
times the camera told (each taken as good to 3 %) are fitted by least squares on the logarithm. What a common factor of
all times would do to the level cannot be seen. Nor can a real change of the scene's brightness be told from an error of
a time: it is taken for one, so the merged picture shows the scene at its mean.
"""

from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from analysis.hdr.noise import Noise, estimate

Floats = NDArray[np.float64]

PRIOR_SD: Final = 0.03
"""How far a time may be from what the camera tells (standard deviation of its logarithm)."""

_PAIR_SD: Final = 2e-4  # of a ratio, beyond its noise: black level, linearity


@dataclass(frozen=True, eq=False)
class Refined:
    """Refined times.

    Attributes
    ----------
    times_s : shape (F,) [s]
    relative_sd : shape (F,)
        Standard uncertainty of each time relative to the others.
    pairs
        How many ratios were measured.
    residual
        Root mean square of ln(measured ratio / fitted ratio).
    """

    times_s: Floats
    relative_sd: Floats
    pairs: int
    residual: float

    def record(self, told_s: Floats) -> dict[str, Any]:
        """JSON-able account of what was changed."""
        return {
            "pairs": self.pairs,
            "residual_ln": round(self.residual, 6),
            "change_percent": [round(float(v), 3) for v in 100.0 * (self.times_s / told_s - 1.0)],
            "relative_sd_percent": [round(float(v), 4) for v in 100.0 * self.relative_sd],
        }


def refine_times(signals: Floats, times: Floats, noise: Noise, hard: float) -> Refined:
    """Refine the times of F exposures from linear signals of the same P places.

    Parameters
    ----------
    signals : shape (F, P)
    times : shape (F,) [s]
        As the camera tells.
    noise
        Of the signals, for the weights.
    hard
        Limit beyond which a signal is not used.
    """
    told = np.log(times)
    now = told.copy()
    design, ratios, variances = np.zeros((0, len(times))), np.zeros(0), np.zeros(0)
    for _ in range(3):
        x = estimate(signals, np.exp(now), noise, hard)
        design, ratios, variances = _ratios(signals, np.exp(now), x, noise, hard)
        weight = 1.0 / variances
        normal = design.T @ (weight[:, None] * design) + np.eye(len(times)) / PRIOR_SD**2
        now = np.linalg.solve(normal, design.T @ (weight * ratios) + told / PRIOR_SD**2)
    covariance = np.linalg.inv(normal)
    # relative to the mean of all: the common factor is only as good as the prior, and does not matter
    centre = np.eye(len(times)) - 1.0 / len(times)
    sd = np.sqrt(np.diag(centre @ covariance @ centre))
    residual = float(np.sqrt(np.mean((design @ now - ratios) ** 2))) if len(ratios) else 0.0
    return Refined(np.exp(now), sd, len(ratios), residual)


def misfit(signals: Floats, times: Floats, noise: Noise, hard: float) -> float:
    """How far the exposures' ratios are from those of the times: root mean square of the logarithm, 0 without any.

    Ratios count by their noise, but none as better than one per cent. Arguments as for `refine_times`.
    """
    x = estimate(signals, times, noise, hard)
    design, ratios, variances = _ratios(signals, times, x, noise, hard)
    if len(ratios) == 0:
        return 0.0
    weight = 1.0 / (variances + 1e-4)
    return float(np.sqrt(np.sum(weight * (design @ np.log(times) - ratios) ** 2) / np.sum(weight)))


def _ratios(signals: Floats, times: Floats, x: Floats, noise: Noise, hard: float) -> tuple[Floats, Floats, Floats]:
    """Design (n, F), logarithms of signal ratios (n,) and their variances (n,) of neighbours and next but one."""
    order = np.argsort(-times)
    design, ratios, variances = [], [], []
    for a in range(len(order)):
        for b in (a + 1, a + 2):
            if b >= len(order):
                continue
            i, j = order[a], order[b]
            p, q = x * times[i], x * times[j]
            open_ = (signals[i] < hard) & (signals[j] < hard)
            good = np.isfinite(x) & open_ & (p < 0.8 * hard) & (p > 0.03 * hard) & (q > 0.004 * hard)
            found = _ratio(signals[i][good], signals[j][good], noise)
            # a ratio that is off by a third is no error of a shutter: the scene changed, or next to nothing was seen
            if found is None or abs(found[0] - np.log(times[i] / times[j])) > 0.3:
                continue
            row = np.zeros(len(order))
            row[i], row[j] = 1.0, -1.0
            design.append(row)
            ratios.append(found[0])
            variances.append(found[1] + _PAIR_SD**2)
    return np.array(design).reshape(-1, len(order)), np.array(ratios), np.array(variances)


def _ratio(longer: Floats, shorter: Floats, noise: Noise) -> tuple[float, float] | None:
    """Logarithm of the ratio of two exposures' signals at the same places, and its variance.

    Places that differ from it by more than four standard deviations have moved (a disc's rim that follows the sun) and
    are left out. The scatter of the rest counts where it is larger than noise. ``None`` with fewer than 50 places.
    """
    keep = np.ones(len(longer), dtype=np.bool_)
    # moved places can hold more light than all others, so the first guess is a median
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = float(np.median(longer / shorter)) if len(longer) >= 50 else 0.0
    for _ in range(3):
        if ratio <= 0.0 or not np.isfinite(ratio) or np.count_nonzero(keep) < 50:
            return None
        off = longer - ratio * shorter
        variance = noise.variance(longer) + ratio**2 * noise.variance(longer / ratio)
        keep = off**2 < 16.0 * variance
        top, bottom = float(longer[keep].sum()), float(shorter[keep].sum())
        ratio = top / bottom if bottom > 0.0 else 0.0
    spread = max(float(np.sum(variance[keep])), float(np.sum(off[keep] ** 2)))
    return float(np.log(ratio)), spread / top**2
