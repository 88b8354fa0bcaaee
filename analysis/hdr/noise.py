"""How noisy a camera is, learnt from the bracket itself.

The variance of a signal p (in one exposure) is taken as v(p) = s2 + g p + k p²: read-out, photons, and what is
proportional (flicker, tone curve errors, the scene moving). Two exposures of one place differ by y - R y', R the ratio
of their times, with variance v(p) + R² v(p / R); binned by p, that is linear in s2, g and k.
"""

from dataclasses import dataclass
from itertools import pairwise
from typing import Final

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

_BINS: Final = 24
_LEAST: Final = 60


@dataclass(frozen=True, slots=True)
class Noise:
    """Coefficients of v(p) = s2 + g p + k p², in the signal's units.

    ``assumed`` says that the bracket could not tell, and typical values were taken.
    """

    s2: float
    g: float
    k: float
    assumed: bool = False

    def variance(self, signal: Floats) -> Floats:
        """v of signals (clipped at 0)."""
        p = np.maximum(signal, 0.0)
        return np.asarray(self.s2 + p * (self.g + self.k * p))

    @classmethod
    def typical(cls, full_scale: float) -> "Noise":
        """10,000 photoelectrons at full scale, read-out noise of 1/3000 of it, 0.5 % proportional."""
        return cls((full_scale / 3000.0) ** 2, full_scale / 10_000.0, 2.5e-5, assumed=True)


def estimate(signals: Floats, times: Floats, noise: Noise, hard: float) -> Floats:
    """Signal per second (P,) of places seen in F exposures (F, P), by maximum likelihood in two passes.

    The kernels' estimator without their order of exposures: weights from a first estimate instead of a running one.
    NaN where every exposure is beyond ``hard``.
    """
    t = times[:, None]
    open_ = signals < hard
    longest = np.where(open_, t, 0.0).argmax(axis=0)
    with np.errstate(invalid="ignore", divide="ignore"):
        x = np.take_along_axis(signals, longest[None], 0)[0] / times[longest]
        for _ in range(2):
            p = np.maximum(x, 0.0) * t
            w = np.where(open_, np.clip((hard - p) / (0.15 * hard), 0.0, 1.0) * t / noise.variance(p), 0.0)
            w = np.where((w.sum(axis=0) == 0.0) & open_, t, w)
            x = np.sum(w * signals, axis=0) / np.sum(w * t, axis=0)
    return np.asarray(x)


def learn_noise(signals: Floats, times: Floats, hard: float, full_scale: float) -> Noise:
    """Fit the noise of a bracket.

    Parameters
    ----------
    signals : shape (F, P)
        Linear signals of the same places in F exposures.
    times : shape (F,) [s]
    hard
        Limit beyond which signals are not used.
    full_scale
        The largest signal, for the typical noise taken when fewer than six levels can be told apart.
    """
    from scipy.optimize import nnls

    noise = Noise.typical(full_scale)
    for _ in range(2):
        x = estimate(signals, times, noise, hard)
        rows, variances = _levels(signals, times, x, 0.8 * hard)
        if len(variances) < 6:
            return noise
        found, _ = nnls(rows / variances[:, None], np.ones(len(variances)))
        for _ in range(3):  # a variance estimated from n places is good to a share of itself: fit shares, both ways
            fitted = np.maximum(rows @ found, 1e-30)
            found, _ = nnls(rows / fitted[:, None], variances / fitted)
        # an all-zero floor would give dark places infinite weight; no converter is better than a third of its step
        floor = max(float(found[0]), (full_scale * 1e-6) ** 2)
        noise = Noise(floor, float(found[1]), float(found[2]))
    return noise


def _levels(signals: Floats, times: Floats, x: Floats, limit: float) -> tuple[Floats, Floats]:
    """Design rows (n, 3) and variances (n,) of the differences of neighbouring exposures, by level."""
    order = np.argsort(-times)
    rows, variances = [], []
    for i, j in pairwise(order):
        ratio = times[i] / times[j]
        p = x * times[i]
        fit = np.isfinite(p) & (p > 0.0) & (p < limit) & (signals[i] < limit * 1.15) & (signals[j] < limit)
        if np.count_nonzero(fit) < _LEAST:
            continue
        level, off = p[fit], (signals[i] - ratio * signals[j])[fit]
        edges = np.unique(np.quantile(level, np.linspace(0.0, 1.0, min(_BINS, len(level) // _LEAST) + 1)))
        for k in np.split(np.argsort(level), np.searchsorted(np.sort(level), edges[1:-1])):
            if len(k) < _LEAST // 2:
                continue
            m = float(level[k].mean())
            # 5th to 95th percentile: up to 5 % of moved places on either side do not count
            low, high = np.quantile(off[k], [0.05, 0.95])
            spread = (high - low) / 3.2897
            if spread > 0.0:
                rows.append([1.0 + ratio**2, m * (1.0 + ratio), 2.0 * m * m])
                variances.append(spread**2)
    return np.array(rows).reshape(-1, 3), np.array(variances)
