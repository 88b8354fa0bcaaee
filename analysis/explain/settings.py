"""Paths of settings that a simulation may have wrong, traced again: turns, scatter, bounces, walls, the time.

What a path holds at each setting is our own simulation's ratio to itself as described (`analysis.explain.tracing`).
"""

import dataclasses
import itertools
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from functools import partial
from typing import Final

import numpy as np

from analysis.explain.lens_paths import dirt, hazes, isotropy, stretches, turns
from analysis.explain.parameter import Parameter
from analysis.explain.path_making import EVENED_DEG, OWN, along, each, stacked, through
from analysis.explain.ratios import Field, over
from analysis.explain.retrace import Path, by_system
from analysis.explain.trace_settings import DIFFUSE_SHARES, SCATTERS_DEG
from analysis.explain.tracing import Tracing, later

LIMITS: Final = (1, 2, 3, 4, 5, 6, 8, 10, 12, 16, 20, 26)
UNLIMITED: Final = 40.0
"""Where "no limit" stands on the scale of bounce limits; beyond it hardly any light is left."""
REFLECTANCES: Final = (-0.3, -0.15, -0.08, -0.04, -0.015, 0.015, 0.03, 0.05, 0.1)
DIFFUSE_SHARE: Final = "diffuse share"
LEAST, MOST = 0.05, 0.998
"""Changes of a wall's reflectance that are tried, and between what it must stay."""
MINUTES: Final = (-60.0, -28.0, -9.0, 9.0, 28.0, 60.0)


def paths_of(traced: Tracing, only: Collection[str] | None = None) -> dict[str, tuple[Path, ...]]:
    """Paths of settings of each mechanism, or of some ``only``; none where the case has no such setting."""
    makers: dict[str, Callable[[], Iterable[Path]]] = {
        "lens-haze": lambda: _every(traced, hazes(traced)),
        "soiling": lambda: _every(traced, dirt(traced)),
        "lens-orientation": lambda: _every(traced, turns(traced)),
        "lens-anisotropy": lambda: _every(traced, itertools.chain(isotropy(traced), stretches(traced))),
        "wall-scatter": lambda: _every(traced, _scatter(traced)),
        "wall-reflectance": lambda: _reflectances(traced),
        "bounce-truncation": lambda: _every(traced, _limits(traced)),
        "clock-offset": lambda: _clock(traced),  # one clock for all systems
    }
    made = {key: tuple(make()) for key, make in makers.items() if only is None or key in only}
    return {key: paths for key, paths in made.items() if paths}


def _every(traced: Tracing, paths: Iterator[Path]) -> Iterator[Path]:
    """Each path for all systems together, and for each system that it changes alone."""
    tests = {name: [k for k, _ in days] for name, days in traced.days.items()}
    for path in paths:
        yield from by_system(path, tests)


def _scatter(traced: Tracing) -> Iterator[Path]:
    """Walls that send a share of each reflection to all sides, that spread all light a little, or some of it widely.

    (Another author's, which spread 9 % of each reflection by 12°, has 79 nats as the last, 56 as the first.)
    """
    share = Parameter("scatter", "1", "share of each reflection that is diffuse", 0.0, 1.0, 0.15, (0.05, 0.2))
    yield from along(traced, DIFFUSE_SHARE, share, {s: (("diffuse_fraction", s),) for s in DIFFUSE_SHARES}, 0.0)
    width = Parameter("scatter_deg", "deg", "rms width of each reflection's lobe", 1.0, 20.0, 4.0, (3.0, 8.0))
    yield from along(traced, "wide reflections", width, {s: (("scatter_deg", s),) for s in SCATTERS_DEG}, 0.0)
    widest = SCATTERS_DEG[-1]
    what = f"share of the light that is spread at each reflection, by {widest:.0f}° rms"
    some = Parameter("spread", "1", what, 0.0, 1.0, 0.2, (0.1, 0.4))
    yield from through(traced, "some light spread", some, {1.0: traced.lit((("scatter_deg", widest),))}, 0.0)


def _limits(traced: Tracing) -> Iterator[Path]:
    """Light that bounces more than N times: what the prediction lacks if it was cut there.

    It is added where our lens throws it: below a deep well with the sun low, nothing may have been left to multiply.
    And as a ratio, as a wall's reflectance is: another lens throws it elsewhere, but beside what it throws there.
    """
    by_bounce = {name: traced.by_bounce(run, boot=True) for name, run in traced.precise.items()}
    whole = traced.laid({name: _first(None, parts) for name, parts in by_bounce.items()})
    cuts = {float(n): traced.laid({name: _first(n + 1, parts) for name, parts in by_bounce.items()}) for n in LIMITS}
    lacking = {at: traced.wide((whole[0] - sun, whole[1] - sky), 0.0) for at, (sun, sky) in cuts.items()}
    none, one = np.zeros_like(whole[0]), np.ones_like(whole[0])
    what = "reflections on the wall after which the simulation stopped"
    limit_of = Parameter("max_bounces", "1", what, 1.0, UNLIMITED, 12.0, (2.0, 4.0, 7.0, 14.0), centre=UNLIMITED)
    stated = traced.case.setup.simulation.max_bounces
    if stated:
        limit_of = dataclasses.replace(limit_of, sigma=1.0, centre=float(min(stated, UNLIMITED)))
    yield Path(OWN, limit_of, *stacked(lacking | {UNLIMITED: (none, none)}), added=True)
    for width, note in EVENED_DEG.items():
        over_cut = each(partial(_over, traced, width, traced.wide(whole, width)), cuts.values())
        ratios = dict(zip(cuts, over_cut, strict=True)) | {UNLIMITED: (one, one)}
        yield Path(f"ratio to what was left{note}", limit_of, *stacked(ratios))


def _over(traced: Tracing, width_deg: float, most: Field, cut: Field) -> Field:
    return over(most, traced.wide(cut, width_deg))


def _first(count: int | None, by_bounce: Field) -> Field:
    """Both parts of what bounced less than ``count`` times."""
    sun, sky = by_bounce
    return sun[:count].sum(axis=0), sky[:count].sum(axis=0)


def _reflectances(traced: Tracing) -> Iterator[Path]:
    """One path for each system: its wall reflects more or less than described; and one for all alike."""
    by_bounce = {name: traced.by_bounce(run) for name, run in traced.runs.items()}
    walls = {n: r for n, run in traced.runs.items() if (r := run.system.wall.reflectance) > 0.0}  # black: no bounces

    def lit(reflectances: Mapping[str, float]) -> Field:
        factor = {name: r / walls[name] for name, r in reflectances.items()}
        return traced.laid({n: _weighed(factor.get(n, 1.0), parts) for n, parts in by_bounce.items()})

    for name, assumed in walls.items():
        tried = sorted({min(max(assumed + d, LEAST), MOST) for d in REFLECTANCES} | {assumed})
        starts = tuple(r for r in (assumed - 0.1, assumed - 0.03, assumed + 0.02) if tried[0] < r < tried[-1])
        what = f"reflectance of the well of {name}"
        wall = Parameter("wall_reflectance", "1", what, tried[0], tried[-1], 0.05, starts, centre=assumed)
        yield from _among(traced, name, wall, {r: lit(walls | {name: r}) for r in tried})
    if len(walls) > 1:
        least, most = LEAST - min(walls.values()), MOST - max(walls.values())
        tried = sorted({d for d in (*REFLECTANCES, least, most, 0.0) if least <= d <= most and abs(d) <= 0.3})
        starts = tuple(d for d in (-0.1, -0.03, 0.02) if tried[0] < d < tried[-1])
        change = Parameter("change", "1", "change of the reflectance of all wells", tried[0], tried[-1], 0.05, starts)
        alike = {d: lit({n: r + d for n, r in walls.items()}) for d in tried}
        yield from _among(traced, "all systems alike", change, alike)


def _weighed(factor: float, by_bounce: Field) -> Field:
    """Both parts with ``factor`` times the reflectance of the wall."""
    sun, sky = (np.tensordot(factor ** np.arange(len(part)), part, 1) for part in by_bounce)
    return sun, sky


def _among(traced: Tracing, label: str, parameter: Parameter, lit: dict[float, Field]) -> Iterator[Path]:
    """The path through fields of one run, as ratios to the one at the parameter's centre."""
    for width, note in EVENED_DEG.items():
        blurred = dict(zip(lit, each(partial(traced.wide, width_deg=width), lit.values()), strict=True))
        over_base = {at: over(field, blurred[parameter.centre]) for at, field in blurred.items()}
        yield Path(label + note, parameter, *stacked(over_base), geometric=True)


def _clock(traced: Tracing) -> Iterator[Path]:
    """The sun earlier or later than the recorded times say, the illuminances as measured."""
    if traced.case.setup.site is None or any(t.start is None for t in traced.case.tests):
        return
    lit = dict(zip(MINUTES, each(partial(_later, traced), MINUTES), strict=True))
    starts = (-60.0, -30.0, -10.0, 10.0, 30.0, 60.0)
    late = Parameter("offset_min", "min", "true time minus recorded time", -65.0, 65.0, 15.0, starts)
    yield from through(traced, OWN, late, lit, 0.0)


def _later(traced: Tracing, minutes: float) -> Field:
    """Both parts with all suns ``minutes`` later; the sky's stays as it was measured."""
    moved = {}
    for name, days in traced.days.items():
        shifted = [later(traced.case, k, day, minutes) for k, day in days]
        moved[name] = traced.as_predicted(traced.trace(name, shifted, sky=False).baseline)
    return traced.spread(moved)[0], traced.base[1]
