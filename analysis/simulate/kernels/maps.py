"""Random numbers, angles, and maps between square and hemisphere.

Every ray has its own stream of random numbers, and every event along its path a fresh place in it: two runs with the
same seed meet the same accidents as long as their paths have the same events, which keeps ratios of variants quiet.
"""

import math
from typing import Final

import numpy as np

from analysis.simulate.kernels.jit import jit

_GAMMA: Final = np.uint64(0x9E3779B97F4A7C15)
_MIX1: Final = np.uint64(0xBF58476D1CE4E5B9)
_MIX2: Final = np.uint64(0x94D049BB133111EB)
_EVENT: Final = np.uint64(0xD1342543DE82EF95)
_S30: Final = np.uint64(30)
_S27: Final = np.uint64(27)
_S31: Final = np.uint64(31)
_S11: Final = np.uint64(11)
_UNIT: Final = 1.0 / 9007199254740992.0


@jit
def mix(z: np.uint64) -> np.uint64:
    """Scramble 64 bits (splitmix64; Steele, Lea & Flood 2014, doi:10.1145/2660193.2660195)."""
    z = (z ^ (z >> _S30)) * _MIX1
    z = (z ^ (z >> _S27)) * _MIX2
    return z ^ (z >> _S31)


@jit
def stream(key: np.uint64, event: int) -> np.uint64:
    """Start of the random numbers of one event of the ray with this key."""
    return mix(key + np.uint64(event) * _EVENT)


@jit
def uniform(state: np.uint64) -> tuple[float, np.uint64]:
    """The next number in [0, 1) and the state after it."""
    state = state + _GAMMA
    return float(mix(state) >> _S11) * _UNIT, state


@jit
def arctan_unit(x: float) -> float:
    """Arc tangent for -1 <= x <= 1; odd polynomial fitted on Chebyshev nodes, error below 2e-6."""
    s = x * x
    q = s * s
    low = 0.999977219 - 0.332622827 * s
    middle = 0.193540371 - 0.11642647 * s
    high = 0.0526473392 - 0.0117191312 * s
    return x * (low + q * (middle + q * high))


@jit
def square_of(x: float, y: float, z: float) -> tuple[float, float]:
    """Place (u, v) in [-1, 1]² of a direction of the hemisphere z >= 0; equal solid angles on equal areas.

    Shirley & Chiu 1997, doi:10.1080/10867651.1997.10487479, with the disc's radius squared = 1 - z.
    """
    rho = math.sqrt(max(0.0, 1.0 - z))
    ax, ay = abs(x), abs(y)
    first = ax >= ay
    big = ax if first else ay
    small = ay if first else ax
    part = rho * (4.0 / math.pi) * arctan_unit(small / max(big, 1e-300))
    return math.copysign(rho if first else part, x), math.copysign(part if first else rho, y)


@jit
def eighth(share: float) -> tuple[float, float]:
    """Cosine and sine of -1 <= share <= 1 eighths of a turn, to 1e-13, by Taylor's series.

    A library's functions take several times as long, because they care for angles of any size.
    """
    x = 0.25 * math.pi * share
    s = x * x
    a = 1 / 24 + s * (-1 / 720 + s * (1 / 40320 + s * (-1 / 3628800 + s * (1 / 479001600 + s * (-1 / 87178291200)))))
    b = 1 / 120 + s * (-1 / 5040 + s * (1 / 362880 + s * (-1 / 39916800 + s * (1 / 6227020800))))
    return 1.0 + s * (-1 / 2 + s * a), x * (1.0 + s * (-1 / 6 + s * b))


@jit
def circle(turns: float) -> tuple[float, float]:
    """Cosine and sine of an angle in turns, 0 <= turns <= 1."""
    whole = math.floor(4.0 * turns + 0.5)
    a, b = eighth(8.0 * turns - 2.0 * whole)
    quarter = int(whole)
    first, second = (b, a) if quarter & 1 else (a, b)
    return (-first if (quarter + 1) & 2 else first), (-second if quarter & 2 else second)


@jit
def hemisphere_of(u: float, v: float) -> tuple[float, float, float]:
    """Direction (x, y, z >= 0) at a place of the square [-1, 1]²; the inverse of `square_of`."""
    if abs(u) >= abs(v):
        rho = abs(u)
        c, s = eighth(v / rho if rho > 0.0 else 0.0)
        c = math.copysign(c, u)
    else:
        rho = abs(v)
        s, c = eighth(u / rho)
        s = math.copysign(s, v)
    sine = rho * math.sqrt(max(0.0, 2.0 - rho * rho))
    return c * sine, s * sine, 1.0 - rho * rho


@jit
def cosine_lobe(state: np.uint64) -> tuple[float, float, np.uint64]:
    """Tangential cosines of a Lambertian direction: uniform on the unit disc (Nusselt)."""
    a, state = uniform(state)
    b, state = uniform(state)
    r = math.sqrt(a) * 0.999995
    c, s = circle(b)
    return r * c, r * s, state
