"""Paths of settings of the lenses and their covers: turns, haze, dirt, a pattern that was lost."""

import dataclasses
from collections.abc import Iterator
from typing import Final

import numpy as np

from analysis.explain.densities import densities, is_oval
from analysis.explain.parameter import Parameter
from analysis.explain.path_making import EVENED_DEG, OWN, along, through
from analysis.explain.ratios import Field, over
from analysis.explain.retrace import Path
from analysis.explain.scattering import SCATTERED, SCATTERERS, partly
from analysis.explain.trace_settings import (
    ANY_TURNS_DEG,
    ASLANT,
    AXES_DEG,
    DEPTHS,
    DIAGONAL,
    FLAT,
    HALF_TURN,
    HAZE,
    HAZES,
    ISOTROPIC,
    MIRRORED,
    STRETCH,
    STRETCH_OF,
    STRETCHED,
    TRACED_AXES_DEG,
    TURNS_DEG,
    Setting,
    any_pattern,
    haze,
    knows_no_pattern,
    scatterer,
)
from analysis.explain.tracing import Tracing

PATTERNS: Final[dict[str, Setting]] = {
    "a pattern, not its mean": (),
    "a pattern along the diagonals, not its mean": (DIAGONAL,),
    **{f"a pattern turned by {turn[1]:.0f}°, not its mean": (turn,) for turn in ASLANT},
}


def turns(traced: Tracing) -> Iterator[Path]:
    """Turns of the lens patterns; of one that nothing says is square, to both sides, and its mirror images."""
    what = "turn of the lens patterns, counter-clockwise from above"
    if any(any_pattern(system) for system in traced.systems.values()):
        yield from _any_turns(traced, what)
        return
    turn = Parameter("rotation_deg", "deg", what, 6.0, 84.0, 30.0, (8.0, 25.0, 45.0, 65.0, 82.0), centre=45.0)
    for path in along(traced, OWN, turn, {t: (("rotation_deg", t),) for t in TURNS_DEG}, 0.0):
        one = np.ones_like(path.sun[:1])
        yield dataclasses.replace(
            path,
            positions=np.append(path.positions, 90.0),
            sun=np.concatenate([path.sun, one]),
            sky=np.concatenate([path.sky, one]),
        )


def _any_turns(traced: Tracing, what: str) -> Iterator[Path]:
    """To either side as far as a quarter turn, half a turn, and the mirror image."""
    for side, label in ((1.0, OWN), (-1.0, f"{OWN}, clockwise")):
        low, high = sorted((side * 6.0, side * 88.0))
        starts = tuple(side * t for t in (8.0, 25.0, 50.0, 85.0))
        turn = Parameter("rotation_deg", "deg", what, low, high, 30.0, starts, centre=side * 45.0)
        rows: dict[float, Setting] = {t: (("rotation_deg", t),) for t in ANY_TURNS_DEG if t * side > 0.0}
        yield from along(traced, label, turn, rows, 0.0)
    others: dict[str, Setting] = {
        "half a turn": (HALF_TURN,),
        "mirrored, east to west": (MIRRORED,),
        "mirrored, north to south": (MIRRORED, HALF_TURN),
    }
    for label, setting in others.items():
        seen = f"share of the change to lens patterns {label} that is seen"
        weight = Parameter("weight", "1", seen, 0.0, 1.5, 0.2, (1.0,), centre=1.0)
        yield from along(traced, f"lens patterns {label}", weight, {1.0: setting}, 0.0)


def hazes(traced: Tracing) -> Iterator[Path]:
    """Haze to all sides, in both lenses or in either; of densities of shifts, also forwards (`scattering`)."""
    what = "share of the transmitted light that is scattered widely"
    share = Parameter("haze", "1", what, 0.0, 0.6, 0.12, (0.02, 0.06, 0.2))
    for label, where in HAZES.items():
        yield from along(traced, f"{label}, traced", share, {HAZE: haze(where)}, 0.0)
    for kind in SCATTERERS if any(densities(system) for system in traced.systems.values()) else ():
        yield from through(traced, f"{SCATTERED} {kind}, traced", share, {HAZE: _partly_scattered(traced, kind)}, 0.0)


def _partly_scattered(traced: Tracing, kind: str) -> Field:
    """Both parts of all tests where a little of what each lens sends on is scattered instead."""
    lit = {place: traced.lit(scatterer(place, kind)) for place in ("entry", "exit")}
    made = [part.copy() for part in traced.base]
    for name, days in traced.days.items():
        rows = [k for k, _ in days]
        for k, part in enumerate(made):
            part[rows] = partly(part[rows], [lit[place][k][rows] for place in densities(traced.systems[name])], HAZE)
    return made[0], made[1]


def dirt(traced: Tracing) -> Iterator[Path]:
    """Along the transmittance lost at normal incidence: on covers as described, and on flat ones if some are not flat.

    (Another author's round panes let 22 % of a low sun's light pass and 76 % of the zenith's; supposed domes let pass
    47 and 70 %, and the loss gained 56 nats instead of 415.)
    """
    loss = Parameter("loss", "1", "transmittance lost at normal incidence", 0.0, 0.8, 0.12, (0.04, 0.15, 0.45))
    lit = {_lost(depth): traced.lit((("soiling", depth),)) for depth in DEPTHS}
    yield from through(traced, "dirt, traced", loss, lit, 0.0, geometric=True)
    if any(system.rise_m > 0.0 for system in traced.systems.values()):
        lit = {_lost(depth): traced.lit((("soiling", depth), FLAT), (("soiling", depth),)) for depth in DEPTHS}
        clean = traced.lit((FLAT,))
        for path in through(traced, "dirt on flat covers, traced", loss, lit, 0.0, clean, geometric=True):
            yield dataclasses.replace(path, supposed=dict((FLAT,)))


def _lost(depth: float) -> float:
    """Transmittance lost at normal incidence through dirt of an optical depth."""
    return 1.0 - float(np.exp(-depth))


def isotropy(traced: Tracing) -> Iterator[Path]:
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
    own = all(any_pattern(system) for system in traced.systems.values())
    for label, turn in PATTERNS.items():
        if own and turn:
            continue
        new, old = _pattern(traced, turn)
        one = np.ones_like(old[0])
        for width, note in EVENED_DEG.items():
            sun, sky = over(traced.wide(new, width), traced.wide(old, width))
            path = np.stack([one, sun]), np.stack([one, sky])
            yield Path(label + note, weight, np.array([0.0, 1.0]), *path, geometric=True)


def stretches(traced: Tracing) -> Iterator[Path]:
    """Lenses that send light further along one axis than across it, where they are densities of shifts.

    That changes the logarithm of the light nearly in proportion, as much the other way where the axis lies across, and
    aslant as both together do. A lens that is predicted so already and lies turned does the same: of such none is
    tried. (Two lenses of another author, turned by 15° and 22.5°, had been told as stretched, with 93 and 58 nats.)
    """
    what = "by how much further light is sent along an axis, and less far across it"
    lenses = [getattr(system, place) for system in traced.systems.values() for place in densities(system)]
    if not lenses or any(is_oval(lens) for lens in lenses):
        return
    one = np.ones_like(traced.base[0])
    for width, note in EVENED_DEG.items():
        east, aslant = (traced.over_base(traced.lit(((STRETCHED, axis),)), width) for axis in TRACED_AXES_DEG)
        for axis in AXES_DEG:
            c, s = np.cos(np.radians(2.0 * axis)), np.sin(np.radians(2.0 * axis))
            sun, sky = (np.stack([one, e**c * a**s]) for e, a in zip(east, aslant, strict=True))
            along_it = f"{what} ({axis:.1f}°, from east to north)"
            stretch = Parameter(STRETCH_OF, "1", along_it, -0.7, 0.7, 0.15, (-0.3, -0.1, 0.1, 0.3))
            label = f"stretched along {axis:.1f}°{note}"
            yield Path(label, stretch, np.array([0.0, STRETCH]), sun, sky, geometric=True, held={STRETCHED: axis})


def _pattern(traced: Tracing, turn: Setting) -> tuple[Field, Field]:
    """Light with the pattern, turned so, and without any."""
    other, turned = traced.lit((ISOTROPIC, *turn)), traced.lit(turn) if turn else traced.base
    given = np.zeros((len(traced.case.tests), 1, 1), dtype=bool)
    given[[k for name, days in traced.days.items() if knows_no_pattern(traced.systems[name]) for k, _ in days]] = True

    def of_each(blank: Field, known: Field) -> Field:
        return np.where(given, blank[0], known[0]), np.where(given, blank[1], known[1])

    return of_each(other, turned), of_each(traced.base, traced.lit((ISOTROPIC,)))
