"""Where rays come from: a cell of the sky, a sun, or a list; all land on the cover."""

import math
from typing import Final

import numpy as np

from analysis.simulate.kernels.arrays import SKY, Floats, Light
from analysis.simulate.kernels.jit import jit
from analysis.simulate.kernels.maps import circle, hemisphere_of, uniform

# additive recurrence in six dimensions: powers of the root of x^7 = x + 1 (Roberts 2018, generalised golden ratio)
_ROOT: Final = 1.1127756842787055
A1: Final = 1 / _ROOT
A2: Final = 1 / _ROOT**2
A3: Final = 1 / _ROOT**3
A4: Final = 1 / _ROOT**4
A5: Final = 1 / _ROOT**5
A6: Final = 1 / _ROOT**6


@jit
def even(start: float, i: int, step: float) -> float:
    """The i-th number of an evenly spread sequence in [0, 1) (additive recurrence)."""
    a = start + i * step
    return a - math.floor(a)


@jit
def from_sky(place: int, side: int, state: np.uint64) -> tuple[float, float, float, np.uint64]:
    """Direction of travel (down) of light from somewhere in cell ``place`` of the sky's square."""
    a, state = uniform(state)
    b, state = uniform(state)
    step = 1.0 / side
    row = int((place + 0.5) * step)
    u = 2.0 * (row + a) * step - 1.0
    v = 2.0 * (place - row * side + b) * step - 1.0
    x, y, z = hemisphere_of(u, v)
    return -x, -y, -max(z, 1e-9), state


@jit
def from_sun(suns: Floats, k: int, a: float, b: float, spread_a: float, spread_b: float) -> tuple[float, float, float]:
    """Direction of travel of light from the sun's disc, widened by a Gaussian if asked.

    Row ``k`` of ``suns``: unit vector towards the sun (3), sine of the disc's radius, and the Gaussian's rms [rad].
    """
    sx, sy, sz = suns[k, 0], suns[k, 1], suns[k, 2]
    r = suns[k, 3] * math.sqrt(a)
    c, s = circle(b)
    p, q = r * c, r * s
    if suns[k, 4] > 0.0:
        g = suns[k, 4] * math.sqrt(-2.0 * math.log(1.0 - spread_a))
        c, s = circle(spread_b)
        p += g * c
        q += g * s
    h = math.sqrt(sx * sx + sy * sy)
    ax, ay = (-sy / h, sx / h) if h > 1e-9 else (1.0, 0.0)
    bx, by, bz = -sz * ay, sz * ax, sx * ay - sy * ax
    x, y, z = sx + p * ax + q * bx, sy + p * ay + q * by, sz + q * bz
    scale = -1.0 / math.sqrt(x * x + y * y + z * z)
    return x * scale, y * scale, z * scale


@jit
def source_at(light: Light, place: float, source: int) -> int:
    """The member of a source whose turn it is at ``place`` [0, 1) of the rays, ``source`` or a later one."""
    while source < light.steps.shape[0] - 2 and place >= light.steps[source + 1]:
        source += 1
    return source


@jit
def direction(
    light: Light, source: int, i: int, s4: float, s5: float, state: np.uint64
) -> tuple[float, float, float, np.uint64]:
    """Direction of travel of the i-th ray from a member of a source, sky or sun."""
    if light.mode == SKY:
        return from_sky(source, light.side, state)
    a, state = uniform(state)
    b, state = uniform(state)
    dx, dy, dz = from_sun(light.suns, source, even(s4, i, A4), even(s5, i, A5), a, b)
    return dx, dy, dz, state
