"""Random numbers for the tracer: each ray has its own stream, so a change in one ray leaves all others alone.

Two tracings that differ in one detail of the optics then use the same numbers for the same events, and most of their
noise cancels in the comparison.
"""

import math

import numpy as np
from numpy.typing import NDArray

from simulators.hidden.compiled import compiled

State = NDArray[np.uint64]
"""Two words: the state of one xoroshiro128+ generator."""

KRONECKER_DIMENSIONS = 6


@compiled
def _mix(word: np.uint64) -> np.uint64:
    """Finaliser of splitmix64 (Steele, Lea, Flood 2014, doi:10.1145/2714064.2660195)."""
    word = (word ^ (word >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    word = (word ^ (word >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return word ^ (word >> np.uint64(31))


@compiled
def start(state: State, seed: int, ray: int) -> None:
    """Set ``state`` to the stream of one ray of one tracing."""
    golden = np.uint64(0x9E3779B97F4A7C15)
    word = _mix(np.uint64(seed) * golden + np.uint64(ray))
    state[0] = _mix(word + golden)
    state[1] = _mix(word + golden + golden)


@compiled
def uniform(state: State) -> float:
    """Draw the next number in (0, 1); xoroshiro128+ (Blackman and Vigna 2021, doi:10.1145/3460772)."""
    a = state[0]
    b = state[1]
    total = a + b
    b ^= a
    state[0] = ((a << np.uint64(24)) | (a >> np.uint64(40))) ^ b ^ (b << np.uint64(16))
    state[1] = (b << np.uint64(37)) | (b >> np.uint64(27))
    return (float(total >> np.uint64(11)) + 0.5) * (1.0 / 9007199254740992.0)


def lobe_scale(rms: float, power: float) -> float:
    """Scale of `lobe` that gives it the root-mean-square radius ``rms``."""
    return rms / math.sqrt(math.gamma(1.0 + 2.0 * power))


@compiled
def lobe(state: State, scale: float, power: float) -> tuple[float, float]:
    """Draw a two-dimensional error of radius ``scale (-ln U)^power``.

    Power 0.5 is a Gaussian; larger powers have heavier tails (at 1 the radius is exponential). All powers use the
    random numbers alike.
    """
    depth = -math.log(uniform(state))
    radius = scale * (math.sqrt(depth) if power == 0.5 else depth**power)
    angle = 2.0 * math.pi * uniform(state)
    return radius * math.cos(angle), radius * math.sin(angle)


def kronecker_steps() -> NDArray[np.float64]:
    """Steps of an additive recurrence that fills the cube evenly, shape (KRONECKER_DIMENSIONS,).

    Powers of the generalised golden ratio (M. Roberts 2018, "The unreasonable effectiveness of quasirandom sequences").
    """
    ratio = 2.0
    for _ in range(60):
        ratio = (1.0 + ratio) ** (1.0 / (KRONECKER_DIMENSIONS + 1))
    steps: NDArray[np.float64] = np.mod(ratio ** -np.arange(1.0, KRONECKER_DIMENSIONS + 1), 1.0)
    return steps
