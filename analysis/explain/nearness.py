"""How readings near each other err together: correlations over directions, and over time."""

from typing import Final

import numpy as np
from numpy.typing import NDArray

from analysis.cases.model import Floats
from analysis.explain.readings import GONIOMETER, SKY, Readings
from labdaq import directions

_FORGOTTEN_H: Final = 5.0
_WIDTHS: Final = {
    GONIOMETER: ((0.25, 9.0), (0.35, 17.0), (0.4, 46.0)),
    SKY: ((0.4, 10.0), (0.4, 18.0), (0.2, 46.0)),  # clouds and the sun's surroundings are small, a wrong type is not
}
"""Shares of the variance, and half widths [deg]."""


def days_of(r: Readings) -> NDArray[np.int64]:
    """A number for each stretch of time without a gap of hours, over which nothing is remembered; shape (N,)."""
    if not r.has_times:
        return np.zeros(len(r), dtype=np.int64)
    order = np.argsort(r.utc_ns, kind="stable")
    number = np.empty(len(r), dtype=np.int64)
    number[order] = np.cumsum(np.diff(r.utc_ns[order], prepend=r.utc_ns[order[:1]]) > _FORGOTTEN_H * 3.6e12)
    return number


def by_direction(r: Readings, rows: NDArray[np.int64]) -> Floats:
    """Squared-exponential correlations of directions, mixed of three widths; rows without one look up."""
    v = directions.vector(np.nan_to_num(r.gamma_deg[rows], nan=180.0), np.nan_to_num(r.c_deg[rows]))
    return nearness(v, v, str(r.kind[rows[0]]))


def nearness(v: Floats, w: Floats, kind: str) -> Floats:
    """Correlation (N, M) of directions given as unit vectors (N, 3) and (M, 3), for a kind of channel."""
    half_chord2 = np.maximum(1.0 - v @ w.T, 0.0)  # = 2 sin²(a/2), about a²/2
    near = np.zeros_like(half_chord2)
    for share, width_deg in _WIDTHS[kind]:
        near += share * np.exp(-half_chord2 / np.radians(width_deg) ** 2)
    return near


def by_time(r: Readings, rows: NDArray[np.int64]) -> Floats:
    """Correlation over about half an hour and over two; without times, over the order of the rows."""
    t = r.utc_ns[rows] / 6e10 if r.has_times else 5.0 * np.arange(len(rows))
    apart = np.abs(t[:, None] - t[None, :])
    return np.asarray(0.6 * np.exp(-apart / 30.0) + 0.4 * np.exp(-apart / 120.0))


def smooth_along(x: Floats, width: float) -> Floats:
    """Smooth functions (N, K) of a coordinate (N,), in its unit as ``width`` is, over which they change.

    Gaussian bumps whose independent sum has unit variance: nearly a Gaussian process of that length (Rasmussen and
    Williams 2006, Gaussian Processes for Machine Learning, ch. 4.2.1).
    """
    nodes = np.arange(x.min() - width, x.max() + 1.8 * width, 0.8 * width)
    bumps = np.exp(-2.0 * ((x[:, None] - nodes) / width) ** 2)
    return np.asarray(bumps / np.sqrt(np.sum(bumps**2, axis=1, keepdims=True)))
