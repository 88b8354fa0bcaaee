"""What one broken place in a skylight does: traced for the very sun, sound and broken on the same rays."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from simulators.hidden.maps import smooth
from simulators.hidden.skylight import Defect, Skylight
from simulators.hidden.symmetry import IDENTITY, sky_nodes
from simulators.hidden.tracer import Answer, trace

Floats = NDArray[np.float64]

SUN_RAYS = 150_000
SKY_RAYS = 12_000
SKY_SUNS = 36


def with_defect(skylight: Skylight, defect: Defect, fogged: bool) -> Skylight:
    """The skylight with a defect; a fogged sector scatters half of what passes it (other shares follow by weight)."""
    if fogged:
        skylight = replace(skylight, entry=replace(skylight.entry, haze=0.5))
    return replace(skylight, defect=defect)


def answers(fogged: bool, gap: bool) -> tuple[Answer, Answer]:
    """Sound and fully broken."""
    if fogged:
        return Answer(haze=0.0), Answer(haze=0.9999)
    return (Answer(), Answer(gap=True)) if gap else (Answer(), Answer(sector_loss=1.0))


def sun_change(skylight: Skylight, pair: tuple[Answer, Answer], sun: Floats, seed: int) -> Floats:
    """Relative change below for a sun when the defect is complete, shape (R, COARSE, COARSE)."""
    sound, broken = smooth(trace(skylight, sun, SUN_RAYS, seed, pair).flux)
    return _relative(sound, broken)


def sky_change(skylight: Skylight, pair: tuple[Answer, Answer], seed: int) -> Floats:
    """Relative change below for an even sky when the defect is complete, shape (R, COARSE, COARSE)."""
    nodes = sky_nodes(57, (IDENTITY,))
    rng = np.random.default_rng(seed)
    weight = nodes.solid_angle / nodes.solid_angle.sum()
    total = np.zeros(1)
    for k in rng.choice(len(weight), size=SKY_SUNS, p=weight):
        total = total + trace(skylight, nodes.directions[k], SKY_RAYS, seed + int(k), pair).flux
    sound, broken = smooth(total)
    return _relative(sound, broken)


def _relative(sound: Floats, broken: Floats) -> Floats:
    floor = 1e-4 * sound.max(axis=(-1, -2), keepdims=True)
    return np.asarray((broken - sound) / (sound + floor))
