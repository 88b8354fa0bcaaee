"""A dial turns one concealed cause from nothing to its most; its strength is found by what it does to the readings."""

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Generic, Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
W = TypeVar("W")
"""What is concealed in a kind of station, and in its simulation."""
W_in = TypeVar("W_in", contravariant=True)

Parameters = dict[str, tuple[float, str]]
"""Name to value and unit."""


@dataclass(frozen=True)
class Dial(Generic[W]):
    """One cause that can be concealed.

    Attributes
    ----------
    id
        Of the catalogue, or a name of our own for physics outside it.
    stage
        Of the catalogue: causes of a pair come from different ones.
    apply
        Lays the cause over a world, at a setting in [0, 1].
    report
        True parameters at a setting, in units as the catalogue would use.
    choices
        Settings that exist, where the dial does not turn smoothly.
    systems
        Which systems it concerns; empty for all.
    inside
        Whether the catalogue has it.
    on_simulation
        Whether it is the simulation that is wrong.
    """

    id: str
    stage: str
    apply: Callable[[W, float], W]
    report: Callable[[float], Parameters]
    choices: tuple[float, ...] = ()
    systems: tuple[str, ...] = ()
    inside: bool = True
    on_simulation: bool = False
    notes: dict[str, object] = field(default_factory=dict)


class Bench(Protocol[W_in]):
    """A station under any world, as far as dials need to know it."""

    @property
    def floor(self) -> float:
        """Floor of the readings, in their unit."""
        ...

    @property
    def free_gain(self) -> bool:
        """Whether every test has a gain of its own that nobody knows."""
        ...

    def outcome(self, world: W_in, simulated: bool) -> list[Floats]:
        """Noise-free readings of every test, or what the simulation predicts for them."""
        ...


def relative(with_it: Floats, without: Floats, floor: float) -> Floats:
    """Change relative to the mean of both plus the readings' floor, so that readings of nearly nothing do not count."""
    return (with_it - without) / (0.5 * (np.abs(with_it) + np.abs(without)) + floor)


def rms_change(with_it: list[Floats], without: list[Floats], floor: float, free_gain: bool) -> float:
    """Rms relative change over all readings, with a free gain per test removed if there is one [1]."""
    parts = [relative(a, b, floor) for a, b in zip(with_it, without, strict=True)]
    if free_gain:
        parts = [part - np.mean(part) for part in parts]
    return float(np.sqrt(np.mean(np.concatenate(parts) ** 2)))


def effect(bench: Bench[W], dial: Dial[W], setting: float, base: W, free_gain: bool | None = None) -> float:
    """What a dial does to the readings, or to the predictions where the simulation is at fault [1]."""
    on, off = (bench.outcome(dial.apply(base, x), dial.on_simulation) for x in (setting, 0.0))
    return rms_change(on, off, bench.floor, bench.free_gain if free_gain is None else free_gain)


def setting_for(bench: Bench[W], dial: Dial[W], wanted: float, base: W) -> tuple[float, float]:
    """Find the setting whose effect is ``wanted``, and return it with its effect.

    Smooth dials by regula falsi on logarithms (effects grow nearly as powers of the setting), others by trying all.
    """
    if dial.choices:
        found = [(choice, effect(bench, dial, choice, base)) for choice in dial.choices]
        return min(found, key=lambda pair: abs(math.log(max(pair[1], 1e-9) / wanted)))
    high, at_high = 1.0, effect(bench, dial, 1.0, base)
    if at_high <= wanted:
        return high, at_high
    setting, reached = max(1e-4, wanted / at_high), 0.0
    low, at_low = 0.0, 0.0
    for _ in range(6):
        reached = effect(bench, dial, setting, base)
        if abs(reached / wanted - 1.0) < 0.08:
            break
        if reached > wanted:
            high, at_high = setting, reached
        else:
            low, at_low = setting, reached
        if low > 0.0 and at_low > 0.0:
            slope = math.log(at_high / at_low) / math.log(high / low)
            guess = low * (wanted / at_low) ** (1.0 / max(slope, 0.2))
            setting = min(max(guess, low + 0.05 * (high - low)), high - 0.05 * (high - low))
        else:
            setting = max(high * wanted / at_high, 0.02 * high)
    return setting, effect(bench, dial, setting, base)
