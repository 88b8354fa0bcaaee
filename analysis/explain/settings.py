"""Paths of settings that a simulation may have wrong, traced again: turns, scatter, bounces, walls, the time.

What a path holds at each setting is our own simulation's ratio to itself as described (`analysis.explain.tracing`).
"""

import dataclasses
import os
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from typing import Final, TypeVar

import numpy as np

from analysis.cases.model import Floats
from analysis.explain.parameter import Parameter
from analysis.explain.ratios import Field, over
from analysis.explain.retrace import Path, by_system
from analysis.explain.trace_settings import (
    ASLANT,
    DEPTHS,
    DIAGONAL,
    DIFFUSE_SHARES,
    FLAT,
    HAZE,
    HAZES,
    ISOTROPIC,
    SCATTERS_DEG,
    TURNS_DEG,
    Setting,
    haze,
    knows_no_pattern,
)
from analysis.explain.tracing import IMAGE_DEG, Tracing, later

X = TypeVar("X")

LIMITS: Final = (1, 2, 3, 4, 5, 6, 8, 10, 12, 16, 20, 26)
UNLIMITED: Final = 40.0
"""Where "no limit" stands on the scale of bounce limits; beyond it hardly any light is left."""
REFLECTANCES: Final = (-0.3, -0.15, -0.08, -0.04, -0.015, 0.015, 0.03, 0.05, 0.1)
OWN: Final = "own re-simulation"
DIFFUSE_SHARE: Final = "diffuse share"
EVENED: Final = ", evened out"
EVENED_DEG: Final = {IMAGE_DEG: "", 12.0: EVENED}
"""Widths over which fields are blurred before their ratio is taken, and how a path says so: another lens throws its
images elsewhere, so that what a setting does to an image is told only as far as images of both lenses overlap."""
PATTERNS: Final[dict[str, Setting]] = {
    "a pattern, not its mean": (),
    "a pattern along the diagonals, not its mean": (DIAGONAL,),
    **{f"a pattern turned by {turn[1]:.0f}°, not its mean": (turn,) for turn in ASLANT},
}
LEAST, MOST = 0.05, 0.998
"""Changes of a wall's reflectance that are tried, and between what it must stay."""
MINUTES: Final = (-60.0, -28.0, -9.0, 9.0, 28.0, 60.0)


def paths_of(traced: Tracing, only: Collection[str] | None = None) -> dict[str, tuple[Path, ...]]:
    """Paths of settings of each mechanism, or of some ``only``; none where the case has no such setting."""
    makers: dict[str, Callable[[], Iterable[Path]]] = {
        "lens-haze": lambda: _every(traced, _hazes(traced)),
        "soiling": lambda: _every(traced, _dirt(traced)),
        "lens-orientation": lambda: _every(traced, _turns(traced)),
        "lens-anisotropy": lambda: _every(traced, _isotropy(traced)),
        "wall-scatter": lambda: _every(traced, _scatter(traced)),
        "wall-reflectance": lambda: _reflectances(traced),
        "bounce-truncation": lambda: _every(traced, _limits(traced)),
        "clock-offset": lambda: _clock(traced),  # one clock for all systems
    }
    made = {key: tuple(make()) for key, make in makers.items() if only is None or key in only}
    return {key: paths for key, paths in made.items() if paths}


def _each(work: Callable[[X], Field], items: Iterable[X]) -> list[Field]:
    """``work`` of each item, on as many threads as there are cores."""
    with ThreadPoolExecutor(len(os.sched_getaffinity(0))) as pool:
        return list(pool.map(work, items))


def _every(traced: Tracing, paths: Iterator[Path]) -> Iterator[Path]:
    """Each path for all systems together, and for each system that it changes alone."""
    tests = {name: [k for k, _ in days] for name, days in traced.days.items()}
    for path in paths:
        yield from by_system(path, tests)


def _along(
    traced: Tracing, label: str, parameter: Parameter, rows: dict[float, Setting], origin: float
) -> Iterator[Path]:
    yield from _through(traced, label, parameter, {at: traced.lit(settings) for at, settings in rows.items()}, origin)


def _through(
    traced: Tracing,
    label: str,
    parameter: Parameter,
    lit: dict[float, Field],
    origin: float,
    base: Field | None = None,
    *,
    geometric: bool = False,
) -> Iterator[Path]:
    """The path through fields that were traced at its positions, over ``base``, at each of `EVENED_DEG`."""
    one = np.ones_like(traced.base[0])
    for width, note in EVENED_DEG.items():
        over_base = _each(partial(traced.over_base, width_deg=width, base=base), lit.values())
        ratios = dict(zip(lit, over_base, strict=True)) | {origin: (one, one)}
        yield Path(label + note, parameter, *_stacked(ratios), geometric)


def _turns(traced: Tracing) -> Iterator[Path]:
    what = "turn of the lens patterns, counter-clockwise from above"
    turn = Parameter("rotation_deg", "deg", what, 6.0, 84.0, 30.0, (8.0, 25.0, 45.0, 65.0, 82.0), centre=45.0)
    for path in _along(traced, OWN, turn, {t: (("rotation_deg", t),) for t in TURNS_DEG}, 0.0):
        one = np.ones_like(path.sun[:1])
        yield dataclasses.replace(
            path,
            positions=np.append(path.positions, 90.0),
            sun=np.concatenate([path.sun, one]),
            sky=np.concatenate([path.sky, one]),
        )


def _hazes(traced: Tracing) -> Iterator[Path]:
    what = "share of the transmitted light that is scattered widely"
    for label, where in HAZES.items():
        share = Parameter("haze", "1", what, 0.0, 0.6, 0.12, (0.02, 0.06, 0.2))
        yield from _along(traced, f"{label}, traced", share, {HAZE: haze(where)}, 0.0)


def _dirt(traced: Tracing) -> Iterator[Path]:
    """Along the transmittance lost at normal incidence: on covers as described, and on flat ones if some are not flat.

    (Another author's round panes let 22 % of a low sun's light pass and 76 % of the zenith's; supposed domes let pass
    47 and 70 %, and the loss gained 56 nats instead of 415.)
    """
    loss = Parameter("loss", "1", "transmittance lost at normal incidence", 0.0, 0.8, 0.12, (0.04, 0.15, 0.45))
    lit = {_lost(depth): traced.lit((("soiling", depth),)) for depth in DEPTHS}
    yield from _through(traced, "dirt, traced", loss, lit, 0.0, geometric=True)
    if any(system.rise_m > 0.0 for system in traced.systems.values()):
        lit = {_lost(depth): traced.lit((("soiling", depth), FLAT), (("soiling", depth),)) for depth in DEPTHS}
        clean = traced.lit((FLAT,))
        for path in _through(traced, "dirt on flat covers, traced", loss, lit, 0.0, clean, geometric=True):
            yield dataclasses.replace(path, supposed=dict((FLAT,)))


def _lost(depth: float) -> float:
    """Transmittance lost at normal incidence through dirt of an optical depth."""
    return 1.0 - float(np.exp(-depth))


def _isotropy(traced: Tracing) -> Iterator[Path]:
    """From a simulation that knows no pattern to one that does; which of the two was predicted, `likeness` says.

    A prediction without a pattern does not show how it lies, along the skylight's sides, along their diagonals or
    aslant, nor how sharp it is. (Another author's top, whose pattern its prediction did not know, gained 9 nats without
    the aslant ones, and 140 with them.)
    """
    weight = Parameter(
        "weight",
        "1",
        "contrast of the pattern that the simulation had lost (1 = that of the lens that was traced)",
        0.0,
        4.0,
        1.0,
        (0.1, 0.4, 1.0, 3.0),
    )
    for label, turn in PATTERNS.items():
        new, old = _pattern(traced, turn)
        one = np.ones_like(old[0])
        for width, note in EVENED_DEG.items():
            sun, sky = over(traced.wide(new, width), traced.wide(old, width))
            path = np.stack([one, sun]), np.stack([one, sky])
            yield Path(label + note, weight, np.array([0.0, 1.0]), *path, geometric=True)


def _pattern(traced: Tracing, turn: Setting) -> tuple[Field, Field]:
    """Light with the pattern, turned so, and without any."""
    other, turned = traced.lit((ISOTROPIC, *turn)), traced.lit(turn) if turn else traced.base
    given = np.zeros((len(traced.case.tests), 1, 1), dtype=bool)
    given[[k for name, days in traced.days.items() if knows_no_pattern(traced.systems[name]) for k, _ in days]] = True

    def of_each(blank: Field, known: Field) -> Field:
        return np.where(given, blank[0], known[0]), np.where(given, blank[1], known[1])

    return of_each(other, turned), of_each(traced.base, traced.lit((ISOTROPIC,)))


def _scatter(traced: Tracing) -> Iterator[Path]:
    share = Parameter("scatter", "1", "share of each reflection that is diffuse", 0.0, 1.0, 0.15, (0.05, 0.2))
    yield from _along(traced, DIFFUSE_SHARE, share, {s: (("diffuse_fraction", s),) for s in DIFFUSE_SHARES}, 0.0)
    width = Parameter("scatter_deg", "deg", "rms width of each reflection's lobe", 1.0, 20.0, 4.0, (3.0, 8.0))
    yield from _along(traced, "wide reflections", width, {s: (("scatter_deg", s),) for s in SCATTERS_DEG}, 0.0)


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
    yield Path(OWN, limit_of, *_stacked(lacking | {UNLIMITED: (none, none)}), added=True)
    for width, note in EVENED_DEG.items():
        over_cut = _each(partial(_over, traced, width, traced.wide(whole, width)), cuts.values())
        ratios = dict(zip(cuts, over_cut, strict=True)) | {UNLIMITED: (one, one)}
        yield Path(f"ratio to what was left{note}", limit_of, *_stacked(ratios))


def _over(traced: Tracing, width_deg: float, most: Field, cut: Field) -> Field:
    return over(most, traced.wide(cut, width_deg))


def _first(count: int | None, by_bounce: Field) -> Field:
    """Both parts of what bounced less than ``count`` times."""
    sun, sky = by_bounce
    return sun[:count].sum(axis=0), sky[:count].sum(axis=0)


def _stacked(fields: Mapping[float, Field]) -> tuple[Floats, Floats, Floats]:
    """Positions in order, and the fields of both parts at them."""
    at = np.array(sorted(fields))
    return at, np.stack([fields[a][0] for a in at]), np.stack([fields[a][1] for a in at])


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
        blurred = dict(zip(lit, _each(partial(traced.wide, width_deg=width), lit.values()), strict=True))
        over_base = {at: over(field, blurred[parameter.centre]) for at, field in blurred.items()}
        yield Path(label + note, parameter, *_stacked(over_base), geometric=True)


def _clock(traced: Tracing) -> Iterator[Path]:
    """The sun earlier or later than the recorded times say, the illuminances as measured."""
    if traced.case.setup.site is None or any(t.start is None for t in traced.case.tests):
        return
    lit = dict(zip(MINUTES, _each(partial(_later, traced), MINUTES), strict=True))
    starts = (-60.0, -30.0, -10.0, 10.0, 30.0, 60.0)
    late = Parameter("offset_min", "min", "true time minus recorded time", -65.0, 65.0, 15.0, starts)
    yield from _through(traced, OWN, late, lit, 0.0)


def _later(traced: Tracing, minutes: float) -> Field:
    """Both parts with all suns ``minutes`` later; the sky's stays as it was measured."""
    moved = {}
    for name, days in traced.days.items():
        shifted = [later(traced.case, k, day, minutes) for k, day in days]
        moved[name] = traced.as_predicted(traced.trace(name, shifted, sky=False).baseline)
    return traced.spread(moved)[0], traced.base[1]
