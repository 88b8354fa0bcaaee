"""What mirroring walls do to light by the way it leaves the well, as they do where a lens above them scatters it.

A prediction does not tell which of two lenses scatters most, or whether a dome does. Traced again, light meets the
walls as it comes from above (`analysis.explain.settings`); here, as it goes on below. The truth lies between, now at
one end, now at the other. (Of other authors' wells whose walls reflected less, a tube's gained 20 nats by the first and
94 by the second, for its true reflectance; a box's 28 and 20.)
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

import numpy as np

from analysis.cases.model import Floats, System
from analysis.explain.fields import C_DEG, GAMMA_DEG, solid_angle
from analysis.explain.geometry import blurred
from analysis.explain.parameter import Parameter
from analysis.explain.path_making import stacked
from analysis.explain.ratios import Field, over
from analysis.explain.retrace import Path, by_system
from analysis.explain.scene import Scene

LABEL: Final = "as light leaves"
SPREAD_DEG: Final = 16.0
"""A last lens below the walls spreads what they leave by this (rms)."""
CHANGES: Final = (-0.3, -0.15, -0.08, -0.04, -0.015, 0.0, 0.015, 0.03, 0.05)
"""Changes of a wall's reflectance that are tried [1],"""
SHARES: Final = (0.0, 0.03, 0.08, 0.15, 0.3, 0.6, 1.0)
"""and shares of each reflection that are diffuse."""
LIMITS: Final = (6, 12, 24)
"""Limits of bounces that a simulation may have had that tells none."""
_LEAST, _MOST = 0.05, 0.998
_TIMES: Final = 3.0
"""Light that was cut is told by what was left in its direction, as at most so many times that."""
_CHORDS: Final = 48
_BEGUN: Final = 12
"""Chords of a tube, and places on each where rays begin, over which bounces are averaged."""
_LAST_DEG: Final = 86.0  # of light that grazes, no more reflections are counted


@dataclass(frozen=True)
class Well:
    """A mirroring well: its tests, what walls are supposed to reflect, reflections by direction (P, G), its shape."""

    name: str
    tests: list[int]
    reflectance: float
    reflections: Floats
    round: bool = False


def wells(scene: Scene) -> list[Well]:
    """Those that the case describes and under which an arm read."""
    case, found = scene.readings.case, []
    for system in case.setup.system:
        tests = [k for k, t in enumerate(case.tests) if t.system == system.id]
        met = reflections(system) if system.wall_finish == "specular" and scene.readings.has_parts else None
        if tests and met is not None and system.wall_reflectance:
            flat = system.aperture is not None and system.aperture.shape == "rectangle"
            found.append(Well(system.id, tests, system.wall_reflectance, met, not flat))
    return found


def reflections(system: System) -> Floats | None:
    """How often light to each direction meets the walls of a straight well, on average; (P, G), ``None`` if unknown.

    Over the depth it goes sideways by depth tan(gamma): between flat walls by their distances, in a tube by its mean
    chord, pi/4 of its width (Zastrow and Wittwer 1986, Proc. SPIE 692).
    """
    opening = system.aperture
    if opening is None or not system.well_depth_m:
        return None
    c = np.radians(C_DEG)[:, None]
    if opening.shape == "disc" or opening.size_m is None:
        per_m = np.full_like(c, 4.0 / (np.pi * (opening.diameter_m or np.inf)))
    else:
        per_m = np.abs(np.sin(c)) / opening.size_m[0] + np.abs(np.cos(c)) / opening.size_m[1]
    return np.asarray(system.well_depth_m * np.tan(np.radians(np.minimum(GAMMA_DEG, _LAST_DEG))) * per_m)


def duller_walls(scene: Scene) -> Iterator[Path]:
    """A path for each well whose walls reflect more or less than was supposed."""
    for well in wells(scene):
        r = well.reflectance
        tried = sorted({float(np.clip(r + change, _LEAST, _MOST)) for change in CHANGES})
        starts = tuple(x for x in (r - 0.1, r - 0.03, r + 0.02) if tried[0] < x < tried[-1])
        what = f"reflectance of the well of {well.name}"
        wall = Parameter("wall_reflectance", "1", what, tried[0], tried[-1], 0.05, starts, centre=r)
        lit = {x: _dimmed(scene, well, x / r) for x in tried}
        yield Path(f"{LABEL}, {well.name} only", wall, *stacked(lit), geometric=True)


def scattering_walls(scene: Scene) -> Iterator[Path]:
    """Paths along the share of each reflection that goes to all sides: without a last lens, and with one."""
    share = Parameter("scatter", "1", "share of each reflection that is diffuse", 0.0, 1.0, 0.15, (0.05, 0.2))
    there = wells(scene)
    for spread_deg, note in ((0.0, ""), (SPREAD_DEG, ", and is spread once more")) if there else ():
        lit = {x: _scattered(scene, there, x, spread_deg) for x in SHARES}
        yield from by_system(Path(LABEL + note, share, *stacked(lit)), {well.name: well.tests for well in there})


def cut_short(scene: Scene) -> Iterator[Path]:
    """Paths along the share of the light in each direction that a limit of bounces cut as often as it says.

    The rest was spread there by a last lens. (Below another author's tubes, cut after 12 bounces, what a clear one
    lacked went with this to .98, with what our own simulation cuts to .59, and with its ratio to what is left to .93.)
    """
    stated, there = scene.readings.case.setup.simulation.max_bounces, wells(scene)
    tests = {well.name: well.tests for well in there}
    what = "share of the light that bounced as often as its direction says"
    share = Parameter("weight", "1", what, 0.0, 1.5, 0.3, (0.1, 0.3, 1.0))
    for limit in ((stated,) if stated else LIMITS) if there else ():
        one, cut = np.ones_like(scene.fields.sun), _cut(scene, there, limit)
        yield from by_system(
            Path(f"{LABEL}, after {limit}", share, *stacked({0.0: (one, one), 1.0: (cut, cut)})), tests
        )


def _cut(scene: Scene, there: list[Well], limit: int) -> Floats:
    """Ratio (T, P, G) of light to what is left of it after so many bounces, by the direction in which it leaves."""
    ratio = np.ones_like(scene.fields.sun)
    for well in there:
        kept, whole = within(well, limit), within(well, None)
        ratio[well.tests] = np.minimum(whole / np.maximum(kept, whole / _TIMES), _TIMES)
    return ratio


def within(well: Well, limit: int | None) -> Floats:
    """Share of the light to each direction that leaves after at most ``limit`` bounces, by what walls take; (P, G).

    A beam that fills a tube goes in chords beside its axis, as much of it in each as that is long (the mean chord is
    that of `reflections`), and begins anywhere on its chord; between flat walls it meets them once more or once less.
    """
    begun = (np.arange(_BEGUN) + 0.5) / _BEGUN
    chord = np.sqrt(1.0 - ((np.arange(_CHORDS) + 0.5) / _CHORDS) ** 2) if well.round else np.ones(1)
    mean = np.pi / 4.0 if well.round else 1.0
    met = np.floor(well.reflections[..., None, None] * mean / chord[:, None] + begun)
    left = well.reflectance**met
    kept = left if limit is None else np.where(met <= limit, left, 0.0)
    return np.asarray(kept.mean(axis=-1) @ chord / chord.sum())


def _dimmed(scene: Scene, well: Well, factor: float) -> Field:
    """Ratio (T, P, G) of both parts with ``factor`` times the reflectance to that supposed."""
    fields = scene.fields
    sun, sky = np.ones_like(fields.sun), np.ones_like(fields.sky)
    now, then = (
        (blurred(fields.sun[well.tests] * w, SPREAD_DEG), blurred(fields.sky[well.tests] * w, SPREAD_DEG))
        for w in (factor**well.reflections, 1.0)
    )
    sun[well.tests], sky[well.tests] = over(now, then)
    return sun, sky


def _scattered(scene: Scene, there: list[Well], share: float, spread_deg: float) -> Field:
    """Ratio (T, P, G) of both parts where such a share of each reflection goes to all sides."""
    fields = scene.fields
    sun, sky = np.ones_like(fields.sun), np.ones_like(fields.sky)
    for well in there:
        parts = fields.sun[well.tests], fields.sky[well.tests]
        kept = (1.0 - share) ** well.reflections
        now, then = (
            tuple(_wider(_to_all_sides(part, k), spread_deg) for part in parts) for k in (kept, np.ones_like(kept))
        )
        sun[well.tests], sky[well.tests] = over((now[0], now[1]), (then[0], then[1]))
    return sun, sky


def _to_all_sides(light: Floats, kept: Floats) -> Floats:
    """Light (T, P, G) [cd] of which each direction keeps a share (P, G), and the rest leaves as of a dull surface."""
    flux = np.sum(light * (1.0 - kept) * solid_angle(), axis=(1, 2))
    return np.asarray(light * kept + flux[:, None, None] * np.cos(np.radians(GAMMA_DEG)) / np.pi)


def _wider(light: Floats, spread_deg: float) -> Floats:
    return blurred(light, spread_deg) if spread_deg else light
