"""A dial turns one concealed cause from nothing to its most; its strength is found by what it does to the readings."""

import math
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from simulators.trial.station import Station, World

Floats = NDArray[np.float64]
Parameters = dict[str, tuple[float, str]]
"""Name to value and unit."""


@dataclass(frozen=True)
class Dial:
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
    apply: Callable[[World, float], World]
    report: Callable[[float], Parameters]
    choices: tuple[float, ...] = ()
    systems: tuple[str, ...] = ()
    inside: bool = True
    on_simulation: bool = False
    notes: dict[str, object] = field(default_factory=dict)


def change(with_it: list[Floats], without: list[Floats], floor: float) -> float:
    """Effect: rms relative change over all readings with a free gain per test removed [1].

    Relative to the mean of both plus the readings' floor, so that readings next to nothing do not count.
    """
    parts = []
    for a, b in zip(with_it, without, strict=True):
        relative = (a - b) / (0.5 * (np.abs(a) + np.abs(b)) + floor)
        parts.append(relative - np.mean(relative))
    return float(np.sqrt(np.mean(np.concatenate(parts) ** 2)))


def raw_change(with_it: list[Floats], without: list[Floats], floor: float) -> float:
    """The same without removing a gain [1]."""
    parts = [(a - b) / (0.5 * (np.abs(a) + np.abs(b)) + floor) for a, b in zip(with_it, without, strict=True)]
    return float(np.sqrt(np.mean(np.concatenate(parts) ** 2)))


def floor_cd(station: Station) -> float:
    """Floor of the readings [cd]."""
    return station.campaign.care.floor_lx * station.campaign.distance_m**2


def effect(station: Station, dial: Dial, setting: float, base: World | None = None) -> float:
    """What a dial does to the readings, or to the predictions where the simulation is at fault [1]."""
    base = base or World()
    on, off = dial.apply(base, setting), dial.apply(base, 0.0)
    if dial.on_simulation:
        total = [[sun + sky for sun, sky in station.predict(w.flaws)] for w in (on, off)]
    else:
        total = [station.read(w) for w in (on, off)]
    return change(total[0], total[1], floor_cd(station))


def setting_for(station: Station, dial: Dial, wanted: float) -> tuple[float, float]:
    """Find the setting whose effect is ``wanted``, and return it with its effect.

    Smooth dials by regula falsi on logarithms (effects grow nearly as powers of the setting), others by trying all.
    """
    if dial.choices:
        found = [(choice, effect(station, dial, choice)) for choice in dial.choices]
        return min(found, key=lambda pair: abs(math.log(max(pair[1], 1e-9) / wanted)))
    high, at_high = 1.0, effect(station, dial, 1.0)
    if at_high <= wanted:
        return high, at_high
    setting = max(1e-4, wanted / at_high)
    low, at_low = 0.0, 0.0
    for _ in range(6):
        reached = effect(station, dial, setting)
        if abs(reached / wanted - 1.0) < 0.08:
            return setting, reached
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
    return setting, reached
