"""The inner loops of the merge, compiled by numba; the compiled code is kept beside this file.

A few rows of pixels are taken through all exposures, longest first, while their sums stay in the processor's cache.
Every exposure of a pixel adds to

    num = sum w y      den = sum w t      with  w = soft t / v(x t),   v(p) = s2 + g p + k p²

where y is the linear signal, t the exposure time and x = num / den what is known of the pixel so far: weights come from
the running estimate, not from the sample itself, whose own noise would bias them. x is the estimate and 1 / den its
variance. The loops are written without branches, so that they compile to vector instructions.
"""

from collections.abc import Callable
from typing import Any, Final, TypeVar, cast

import numba
import numpy as np
from numpy.typing import NDArray

from analysis.hdr.flags import LOW_SIGNAL, MOVED, SATURATED, SINGLE

f4 = np.float32

NUM, DEN, SQUARES, WHEN, JUMP = range(5)
"""Planes of the running sums: of w y, of w t, of (w t)², of w t times the frame's time, largest departure."""

ROWS: Final = 4
"""Rows of a mosaic taken together; even, so that the mosaic's cells stay whole."""

# no signal is NaN or infinite; divisions may be taken as multiplications by a reciprocal good to 1e-7
_FAST: Final = {"nnan", "ninf", "nsz", "contract", "arcp", "reassoc", "afn"}

F = TypeVar("F", bound=Callable[..., None])


def _exact(function: F) -> F:
    """Compile ``function``, keeping its type; infinities are allowed in it."""
    return cast(F, numba.njit(error_model="numpy", inline="never", nogil=True, cache=True)(function))


def _fast(function: F) -> F:
    """Compile ``function`` for finite numbers only."""
    return cast(F, numba.njit(error_model="numpy", fastmath=_FAST, inline="never", nogil=True, cache=True)(function))


@_exact
def _colour_row(
    code: NDArray[np.uint8], curves: NDArray[np.float32], hard_code: int, shut: float, y: NDArray[np.float32]
) -> None:
    """Signals (3, W) of a row of a colour picture (W, 3), through its response curves (3, 256).

    Where one channel is beyond ``hard_code`` all get ``shut``: the camera mixed them before it coded them.
    """
    for i in range(code.shape[0]):
        a, b, c = code[i, 0], code[i, 1], code[i, 2]
        if max(a, b, c) >= hard_code:
            y[0, i], y[1, i], y[2, i] = shut, shut, shut
        else:
            y[0, i], y[1, i], y[2, i] = curves[0, a], curves[1, b], curves[2, c]


@_fast
def _add(
    code: NDArray[Any],
    black: NDArray[np.float32],
    t: float,
    when: float,
    noise: NDArray[np.float32],
    limits: NDArray[np.float32],
    num: NDArray[np.float32],
    den: NDArray[np.float32],
    squares: NDArray[np.float32],
    whens: NDArray[np.float32],
    jump: NDArray[np.float32],
) -> None:
    """Add one exposure of a run of pixels, ``code`` less ``black``, to their sums; see the module docstring.

    ``limits``: hard limit, 1 / width of the soft roll-off below it, lowest signal worth adding to others, squared share
    by which exposures may differ without having moved. The sums come one by one: as rows of one array the compiler
    takes them for overlapping, and the loop runs ten times slower.
    """
    s2, g, k = noise[0], noise[1], noise[2]
    hard, roll, low, play = limits[0], limits[1], limits[2], limits[3]
    zero, one = f4(0.0), f4(1.0)
    t2 = f4(25.0) * t * t
    for i in range(code.shape[0]):
        y = f4(code[i]) - black[i]
        d = den[i]
        p = max(num[i] * t / max(d, f4(1e-30)) if d > zero else y, zero)
        soft = min(max((hard - p) * roll, zero), one)
        soft = soft if y < hard else zero
        soft = zero if (p < low) & (d > zero) else soft
        v = s2 + p * (g + k * p)
        w = soft * t / v
        info = w * t
        off = y - p
        # more than five standard deviations, and more than the response may be wrong: the scene moved
        beyond = max(d * (off * off - play * p * p - f4(25.0) * v) - t2, zero) * soft
        num[i] += w * y
        den[i] = d + info
        squares[i] += info * info
        whens[i] += info * when
        jump[i] = max(jump[i], beyond)


@_exact
def _settle_row(
    num: NDArray[np.float32],
    den: NDArray[np.float32],
    squares: NDArray[np.float32],
    whens: NDArray[np.float32],
    jump: NDArray[np.float32],
    bound: NDArray[np.float32],
    value: NDArray[np.float32],
    variance: NDArray[np.float32],
    worth: NDArray[np.float32],
    mean_time: NDArray[np.float32],
    flags: NDArray[np.uint8],
) -> None:
    """Turn a row's sums into results.

    ``bound`` is the shortest exposure's signal over its time: the value, with infinite variance, where nothing else is.
    ``worth`` is how many equal exposures would tell as much.
    """
    zero, one, nothing = f4(0.0), f4(1.0), np.uint8(0)
    for i in range(num.shape[0]):
        d = den[i]
        shut = d <= zero
        inverse = one / (one if shut else d)
        x = bound[i] if shut else num[i] * inverse
        n = one if shut else d * d / max(squares[i], f4(1e-38))
        value[i] = x
        variance[i] = f4(np.inf) if shut else inverse
        worth[i] = n
        mean_time[i] = whens[i] * inverse
        alone = (n < f4(1.05)) & (not shut)
        faint = (x * x * d < f4(25.0)) & (not shut)
        flags[i] = (
            (np.uint8(SATURATED) if shut else nothing)
            | (np.uint8(SINGLE) if alone else nothing)
            | (np.uint8(LOW_SIGNAL) if faint else nothing)
            | (np.uint8(MOVED) if jump[i] > zero else nothing)
        )


@_exact
def merge_mono(
    stack: NDArray[Any],
    black: NDArray[np.float32],
    times: NDArray[np.float32],
    when: NDArray[np.float32],
    noise: NDArray[np.float32],
    limits: NDArray[np.float32],
    state: NDArray[np.float32],
    first: bool,
    last: bool,
    top: int,
    end: int,
    planes: NDArray[np.float32],
    flags: NDArray[np.uint8],
) -> None:
    """Merge rows ``top`` (a multiple of `ROWS`) to ``end`` of exposures (F, H, W), longest first.

    Results go to ``planes`` (4, B, W) - signal per second, its variance, worth in exposures, mean time; see
    `_settle_row` - and ``flags`` (B, W), from row 0. ``black`` (`ROWS`, W) are the mosaic's black levels. ``state``
    (N, 5, `ROWS` W) carries the sums from one group of exposures to the next (``first``, ``last`` tell which group this
    is): one entry for each `ROWS` rows, or a single one when all exposures come in one group.
    """
    count, _, width = stack.shape
    levels = black.reshape(-1)
    bound = np.empty(ROWS * width, np.float32)
    for r in range(top, end, ROWS):
        stop = min(r + ROWS, end)
        n = (stop - r) * width
        s = state[r // ROWS if state.shape[0] > 1 else 0]
        num, den, squares, whens, jump = s[0][:n], s[1][:n], s[2][:n], s[3][:n], s[4][:n]
        if first:
            s[:] = f4(0.0)
        for f in range(count):
            code = stack[f, r:stop].reshape(-1)
            _add(code, levels[:n], times[f], when[f], noise, limits, num, den, squares, whens, jump)
        if last:
            code = stack[count - 1, r:stop].reshape(-1)
            for i in range(n):
                bound[i] = (f4(code[i]) - levels[i]) / times[count - 1]
            a, b = r - top, stop - top
            value, variance = planes[0, a:b].reshape(-1), planes[1, a:b].reshape(-1)
            worth, mean_time = planes[2, a:b].reshape(-1), planes[3, a:b].reshape(-1)
            mark = flags[a:b].reshape(-1)
            _settle_row(num, den, squares, whens, jump, bound[:n], value, variance, worth, mean_time, mark)


@_exact
def merge_colour(
    stack: NDArray[np.uint8],
    curves: NDArray[np.float32],
    hard_code: int,
    weights: NDArray[np.float32],
    times: NDArray[np.float32],
    when: NDArray[np.float32],
    noise: NDArray[np.float32],
    limits: NDArray[np.float32],
    state: NDArray[np.float32],
    first: bool,
    last: bool,
    planes: NDArray[np.float32],
    flags: NDArray[np.uint8],
    signals: NDArray[np.float32],
) -> None:
    """Merge colour exposures (F, H, W, 3), longest first; as `merge_mono`, with curves (3, 2^bits), noise (3, 3).

    ``limits`` (3, 4) are each channel's. ``planes[0]`` is the sum of the channels times ``weights``. ``signals``
    (3, H, W) gets each channel's, or is (3, 1, W) when nobody wants them.
    """
    count, height, width, _ = stack.shape
    y, nothing = np.empty((3, width), np.float32), np.zeros(width, np.float32)
    part = np.empty((4, width), np.float32)
    flag = np.empty(width, np.uint8)
    main = int(np.argmax(weights))
    shut = 1e9  # beyond any limit, but squares of it stay finite
    for r in range(height):
        sums = state[r if state.shape[0] > 1 else 0]
        if first:
            sums[:] = f4(0.0)
        for f in range(count):
            _colour_row(stack[f, r], curves, hard_code, shut, y)
            for c in range(3):
                s = sums[c]
                _add(y[c], nothing, times[f], when[f], noise[c], limits[c], s[0], s[1], s[2], s[3], s[4])
        if last:
            planes[0, r], planes[1, r], flags[r] = f4(0.0), f4(0.0), np.uint8(0)
            for c in range(3):
                _bound_row(stack[count - 1, r], c, curves[c], times[count - 1], y[c])
                s = sums[c]
                _settle_row(s[0], s[1], s[2], s[3], s[4], y[c], part[0], part[1], part[2], part[3], flag)
                _mix_row(part[0], part[1], flag, weights[c], planes[0, r], planes[1, r], flags[r])
                if signals.shape[1] > 1:
                    signals[c, r] = part[0]
                if c == main:
                    planes[2, r], planes[3, r] = part[2], part[3]


@_exact
def _bound_row(
    code: NDArray[np.uint8], channel: int, curve: NDArray[np.float32], time: float, y: NDArray[np.float32]
) -> None:
    """One channel's signal over the exposure time, whatever the other channels are."""
    for i in range(code.shape[0]):
        y[i] = curve[code[i, channel]] / time


@_exact
def _mix_row(
    value: NDArray[np.float32],
    variance: NDArray[np.float32],
    flag: NDArray[np.uint8],
    weight: float,
    values: NDArray[np.float32],
    variances: NDArray[np.float32],
    flags: NDArray[np.uint8],
) -> None:
    """Add one channel's share to a row of the weighted sum; a flag of any channel is the sum's."""
    for i in range(value.shape[0]):
        values[i] += weight * value[i]
        variances[i] += weight * weight * variance[i]
        flags[i] |= flag[i]
