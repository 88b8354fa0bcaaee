"""The response of a camera, recovered from its own bracket.

Two exposures of one scene with known times map codes to codes: z in the longer one and z' in the shorter one mean
g(z) - g(z') = ln(t / t'), where g is the logarithm of the signal (Debevec and Malik 1997, in the form of joint
histograms, "comparagrams", Mann 2000; Grossberg and Nayar 2003, PAMI 25:1455). g is sought as a smooth departure from
the sRGB curve, by least squares with every step of g kept positive, so that it cannot turn back as OpenCV's does near
white. Times and
response share one freedom (a power of both), so an error of the times goes into the curve: a frozen response is better.
"""

from collections.abc import Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from analysis.hdr.response import REFERENCE_CODE, Response, srgb_signal
from labdaq.errors import DataError

Floats = NDArray[np.float64]

CODES_USED: Final = (4, 250)
"""Codes beyond are clipped, rung or rounded away; the curve is continued there by its slope."""

_KNOT: Final = 4  # the departure is known at every fourth code
_TIE: Final = REFERENCE_CODE // _KNOT
_SMOOTHNESS: Final = 5.0
_SMALLEST_STEP: Final = 2e-4  # of the logarithm, from one code to the next


def recover_response(samples: NDArray[np.uint8], times: Sequence[float]) -> Response:
    """Recover the three curves from sampled pixels.

    Parameters
    ----------
    samples : shape (F, P, 3)
        Codes of the same P places in F exposures.
    times : length F [s]

    Raises `DataError` when no two exposures overlap enough to tell.
    """
    curves, misfits = [], []
    for channel in range(3):
        curve, misfit = _channel(samples[..., channel], np.asarray(times, dtype=np.float64))
        curves.append(curve)
        misfits.append(misfit)
    # the level is anybody's choice; code 255 of green gets 1, as in Photosphere's files
    scaled = np.array(curves) / curves[1][255]
    source = f"recovered from {len(times)} exposures, {samples.shape[1]} places"
    return Response(scaled, "recovered", source, float(np.sqrt(np.mean(np.square(misfits)))))


def _channel(codes: NDArray[np.uint8], times: Floats) -> tuple[Floats, float]:
    """Curve (256,) of one channel, and the rms misfit of ln exposure."""
    order = np.argsort(-times)
    start = np.log(np.maximum(srgb_signal(np.arange(256) / 255.0), 1e-6))
    pairs = []
    for a, i in enumerate(order[:-1]):
        for j in order[a + 1 : a + 3]:
            counts = _comparagram(codes[i], codes[j])
            if times[i] > 1.05 * times[j] and counts.sum() >= 200:
                pairs.append((counts, float(np.log(times[i] / times[j]))))
    if not pairs:
        raise DataError(
            "the response cannot be recovered: no two exposures show the same places between black and white",
            "give more exposures, closer together, or a response with --response",
        )
    g = start
    for _ in range(4):  # the weights need the slope of the curve that is sought
        g, misfit = _solve(pairs, start, g)
    return _curve(g), misfit


def _comparagram(longer: NDArray[np.uint8], shorter: NDArray[np.uint8]) -> Floats:
    """Counts (256, 256) of the code pairs whose both codes can be trusted; pairs seen once or twice are dropped."""
    low, high = CODES_USED
    good = (longer >= low) & (longer <= high) & (shorter >= low) & (shorter <= high)
    index = longer[good].astype(np.int64) * 256 + shorter[good]
    counts = np.bincount(index, minlength=65536).reshape(256, 256).astype(np.float64)
    counts[counts < 3] = 0.0
    return counts


def _solve(pairs: list[tuple[Floats, float]], start: Floats, now: Floats) -> tuple[Floats, float]:
    """One reweighted least squares fit of g, with steps kept positive; and its weighted rms residual."""
    slope = np.maximum(np.gradient(now), 1e-3)
    normal, right = np.zeros((256, 256)), np.zeros(256)
    squares, total = 0.0, 0.0
    for counts, ratio in pairs:
        # a code is good to about one step (rounding, coding noise): weight by the slopes at both ends, and by how well
        # the pair has fitted so far, so that what moved between the exposures does not count (Cauchy weights)
        residual = now[:, None] - now[None, :] - ratio
        variance = slope[:, None] ** 2 + slope[None, :] ** 2
        weight = counts / variance / (1.0 + residual**2 / (4.0 * variance))
        weight /= 1.0 + weight.sum() / 1e7  # many pixels do not make a curve exact
        squares += float(np.sum(weight * residual**2))
        total += float(weight.sum())
        normal += np.diag(weight.sum(axis=1) + weight.sum(axis=0)) - weight - weight.T
        right += ratio * (weight.sum(axis=1) - weight.sum(axis=0))
    hats = _hats()
    small = hats.T @ normal @ hats
    bend = _bending()
    small += _SMOOTHNESS * np.median(np.diag(small)[np.diag(small) > 0]) * bend.T @ bend
    target = hats.T @ (right - normal @ start)
    # the departure is 0 at the reference, since a factor of all signals cannot be seen
    small[_TIE, _TIE] += 1e3 * np.trace(small)
    small += 1e-9 * np.trace(small) / len(small) * np.eye(len(small))
    return start + hats @ _rising(small, target, start), float(np.sqrt(squares / total))


def _rising(normal: Floats, right: Floats, start: Floats) -> Floats:
    """Departure at the knots that solves the normal equations, while ``start`` plus it rises from code to code."""
    from scipy.optimize import lsq_linear

    free: Floats = np.asarray(np.linalg.solve(normal, right), dtype=np.float64)
    # between two knots the departure changes evenly, so the least step of the start there bounds the change
    steps = np.diff(start).copy()
    steps = np.append(steps, steps[-1])
    least = _KNOT * (_SMALLEST_STEP - steps.reshape(-1, _KNOT).min(axis=1))
    if np.all(np.diff(free) >= least):
        return free
    # unknowns become the departure at the first knot and its changes from knot to knot, which are bounded
    sums = np.tril(np.ones((len(free), len(free))))
    factor = np.linalg.cholesky(normal).T
    bounds = (np.append(-np.inf, least), np.full(len(free), np.inf))
    found = lsq_linear(factor @ sums, np.linalg.solve(factor.T, right), bounds=bounds, method="trf", tol=1e-10)
    return np.asarray(sums @ found.x)


def _hats() -> Floats:
    """Piecewise linear functions (256, 65) between knots at every fourth code."""
    knots = np.arange(0, 257, _KNOT)
    return np.asarray(np.maximum(0.0, 1.0 - np.abs(np.arange(256)[:, None] - knots[None, :]) / _KNOT))


def _bending() -> Floats:
    """Second differences (63, 65), scaled to let the curve bend as much from code 8 to 16 as from 100 to 200."""
    index = np.arange(256 // _KNOT - 1)
    rows = np.zeros((len(index), len(index) + 2))
    scale = np.minimum((index + 1.0) * _KNOT / 64.0, 1.0) ** 1.5 + 0.02
    rows[index, index], rows[index, index + 1], rows[index, index + 2] = scale, -2.0 * scale, scale
    return rows


def _curve(g: Floats) -> Floats:
    """Signal from its logarithm; below the codes used it runs straight to 0."""
    low, high = CODES_USED
    signal = np.exp(g)
    signal[: low + 1] = signal[low] * np.arange(low + 1) / low
    slope = (signal[high] - signal[high - 8]) / 8.0
    signal[high:] = signal[high] + slope * np.arange(256 - high)
    return signal
