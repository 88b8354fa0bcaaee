"""The lens that a prediction was made with, as far as its light tells.

A case says "prismatic" and no more. Our own tracing of other settings is only as good as its lens: where its images lie
beside those of the prediction, what it changes lies beside them, too. So before anything is traced again, the prisms
(which way they look, how steep and how evenly moulded they are), the haze, and the width by which the lens spreads
light as it leaves are chosen with which our engine comes nearest to the prediction's own sun part; or a density of
shifts (`shift_lens`), where that comes nearer than any prisms.

Moulding alone cannot stand for that width: facets that lean at random lose the pattern that a spread keeps. (Below
another author's round and square wells, what turned or patternless lenses, an aureole or a late clock changed
correlated with the true changes by .2 to .5 without the spread, and by .7 to .8 with it.)
"""

import os
from collections.abc import Iterable, Mapping
from concurrent.futures import Executor, ThreadPoolExecutor
from functools import partial
from typing import Final

import numpy as np

from analysis.explain.look import BETTER, Likened, Look, Predicted, look_at
from analysis.explain.prisms import Prisms
from analysis.explain.shift_lens import patternless, shift_lens
from analysis.simulate.system import System

ALIKE: Final = 0.15
"""Densities of shifts that are no more unlike than this (rms of a case's systems) are hardly unlike,"""
_FAR_NEARER: Final = 0.6
"""and prisms are not sought where those that they are begun with are so much more unlike. (Of one author's predictions
densities are unlike by a third of what the supposed prisms are, and by half of what the best are.)"""
_SMOOTH_DEG: Final = (9.0, 16.0)
"""A diffuser's light is blurred by these before it is compared: few of its rays meet any one direction."""
_NO_DIFFUSER: Final = 0.75
"""A lens called diffusing is none where a density of shifts is unlike by less than so much of what the diffuser is,"""
_STILL_UNLIKE: Final = 0.25
"""and by no more than this. (Of another author's five are unlike by .13 to .19, the diffusers by .26 to .42; one of a
further author's is unlike by .37, and below it a wall had 72 nats where a limit of bounces was true and had 58.)"""
_NO_PATTERN: Final = 0.94
"""Lenses without a pattern are taken if they are unlike by less than so much of what those with one are;"""
_NO_PATTERN_IF_EVEN: Final = 1.1
"""and this where some system's prediction is even about the sun's plane."""


def likened(systems: Mapping[str, System], predicted: Mapping[str, Predicted]) -> dict[str, Likened]:
    """The systems with the prisms and haze that look most like a prediction; those that it does not show as they are.

    Whether a simulation knew its lenses' patterns is a matter of its engine, so it is decided for all systems together.
    """
    cores = len(os.sched_getaffinity(0))
    with ThreadPoolExecutor(cores) as pool, ThreadPoolExecutor(cores) as tracers:
        found = {name: look_at(systems[name], what, tracers) for name, what in predicted.items()}
        seen = {name: look for name, look in found.items() if look is not None}
        dull = _diffusers({name: look for name, look in seen.items() if not look.prismatic}, pool)
        looks = {name: look for name, look in seen.items() if look.prismatic}
        shifted = _shifted(looks, pool)
        prisms = {} if not looks or _far_nearer(shifted, looks) else _prismatic(looks, shifted, pool)
    dense = dull if prisms else shifted | dull
    alike = not prisms and _are_alike(shifted or dull)
    even = any(like.even for like in prisms.values())
    plain = {name: Likened(system, even=even) for name, system in systems.items()}
    return plain | {name: Likened(system, alike=alike) for name, (system, _) in dense.items()} | prisms


def _prismatic(
    looks: Mapping[str, Look], shifted: Mapping[str, tuple[System, float]], pool: Executor
) -> dict[str, Likened]:
    """All systems with prisms and haze; none where their densities of shifts look more like the predictions."""
    best = list(pool.map(Look.patterned, looks.values()))
    blurred = list(pool.map(Look.patternless, looks.values(), best))
    even = any(look.even for look in looks.values())
    limit = _NO_PATTERN_IF_EVEN if even else _NO_PATTERN
    if _unlike(looks.values(), blurred) < limit * _unlike(looks.values(), best):
        best = blurred
    if shifted and _rms(unlike for _, unlike in shifted.values()) < BETTER * _unlike(looks.values(), best):
        return {}
    made = pool.map(partial(Look.hazy, even=even and best is blurred), looks.values(), best)
    return dict(zip(looks, made, strict=True))


def _are_alike(densities: Mapping[str, tuple[System, float]]) -> bool:
    unlike = _rms(unlike for _, unlike in densities.values())
    return bool(densities) and unlike < ALIKE * float(np.sqrt(len(densities)))


def _far_nearer(densities: Mapping[str, tuple[System, float]], looks: Mapping[str, Look]) -> bool:
    """Whether densities are hardly unlike the predictions, and by so much less than prisms that none need be sought."""
    if not _are_alike(densities):
        return False
    unlike = _rms(unlike for _, unlike in densities.values())
    return unlike < _FAR_NEARER * _rms(look.begun() for look in looks.values())


def _unlike(looks: Iterable[Look], chosen: Iterable[Prisms]) -> float:
    return _rms(look.unlike(prisms) for look, prisms in zip(looks, chosen, strict=True))


def _rms(unlike: Iterable[float]) -> float:
    return float(np.sqrt(sum(x**2 for x in unlike)))


def _shifted(looks: Mapping[str, Look], pool: Executor) -> dict[str, tuple[System, float]]:
    """All systems with densities of shifts, and how unlike they are."""
    if not all(_may_have_density(look) for look in looks.values()):
        return {}
    return dict(zip(looks, pool.map(_density, looks.values()), strict=True))


def _density(look: Look) -> tuple[System, float]:
    """The density of shifts of one system; without a pattern, if the one that was found holds under no other sun.

    (Of three other authors' nine boxes and tops with a pattern the one that was found left under the other suns
    .4 to .75 of what its mean left; of four without a pattern 1 to 1.1, though under its own .85 to 1.)
    """
    system, unlike = shift_lens(look)
    even = patternless(system)
    if look.far_and_wide(system) < _NO_PATTERN * look.far_and_wide(even):
        return system, unlike
    return even, look.beside(look.light(even))


def _may_have_density(look: Look) -> bool:
    """Whether several suns show one, with a pattern, in a skylight that lies along the compass."""
    return len(look.days) > 1 and not look.even and look.system.rotation_deg == 0.0


def _diffusers(looks: Mapping[str, Look], pool: Executor) -> dict[str, tuple[System, float]]:
    """Those whose lens, called diffusing, sends light about its direction rather than to all sides.

    With densities of shifts that are the same to all sides, and how unlike they are. (What two other authors call so
    spreads light by 15 to 30°; below a perfect diffuser no wall, no aureole and no haze shows.)
    """
    chosen = [name for name, look in looks.items() if len(look.days) > 1 and not look.system.rotation_deg]
    found = dict(zip(chosen, pool.map(lambda name: patternless(shift_lens(looks[name])[0]), chosen), strict=True))
    made = {name: (system, looks[name].beside(looks[name].light(system))) for name, system in found.items()}
    near = {name: like for name, like in made.items() if like[1] < _STILL_UNLIKE}
    return {name: like for name, like in near.items() if like[1] < _NO_DIFFUSER * _as_diffuser(looks[name])}


def _as_diffuser(look: Look) -> float:
    """How unlike the prediction a system with perfect diffusers is."""
    light = look.light(look.system)
    return min(look.beside(Likened(look.system, width).spread(light)) for width in _SMOOTH_DEG)
