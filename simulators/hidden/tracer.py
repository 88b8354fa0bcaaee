"""The forward Monte Carlo tracer: sunlight from one direction through a skylight, counted below it.

One tracing answers many questions at once. Each ray's events are tallied, and what it carries is counted once for every
*answer*: another wall reflectance, a bounce limit, more haze, dirt on the cover.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from simulators.hidden.collect import FINE, RADII_M, cell_of, pierce
from simulators.hidden.compiled import compiled
from simulators.hidden.draws import KRONECKER_DIMENSIONS, State, kronecker_steps, lobe, start, uniform
from simulators.hidden.ray import DEAD, GOES_ON, OUT_ABOVE, TALLIES, WALL, Tally, enter, follow
from simulators.hidden.skylight import DOME, Skylight, SkylightNumbers
from simulators.hidden.surfaces import tilted

Floats = NDArray[np.float64]
DEPTH = 128
"""Tallies beyond this count as this."""
SUN_HALF_ANGLE_DEG = 0.2665


@dataclass(frozen=True)
class Answer:
    """What to apply to the tallied events of the same rays.

    Attributes
    ----------
    wall_reflectance
        Of the well's wall, instead of the nominal one.
    max_bounces
        Rays with more reflections on the wall are dropped; 0 for no limit.
    wall_scatter, haze
        Shares instead of those the rays were drawn with (which must then not be zero); ``None`` leaves them.
    soiling
        Optical depth of dirt on the cover, met at the ray's slant: exp(-depth / cosine).
    sector_loss
        Share of light lost in the defect's sector of the cover.
    gap
        The strip of the defect swallows what meets it.
    """

    wall_reflectance: float | None = None
    max_bounces: int = 0
    wall_scatter: float | None = None
    haze: float | None = None
    soiling: float = 0.0
    sector_loss: float = 0.0
    gap: bool = False


@dataclass(frozen=True)
class Traced:
    """What came of a tracing, for 1 lx on a plane that faces the source.

    Attributes
    ----------
    flux : shape (A, R, across, across) [lm]
        Per answer, radius and cell; first axis of the map east, second north.
    square : shape (R, across, across) [lm²]
        Sum of squares for the first answer, for its statistical uncertainty.
    bounces : shape (DEPTH,) [lm]
        Flux that leaves below by number of wall reflections, first answer.
    sent_lm, entered_lm, below_lm, above_lm, absorbed_lm
        Where the light went (nominal wall): reached the cover's outline, got past the cover, left below, went back to
        the sky (from the outside of the cover as well), ended in a material.
    rays
        Number of rays followed.
    """

    flux: Floats
    square: Floats
    bounces: Floats
    sent_lm: float
    entered_lm: float
    below_lm: float
    above_lm: float
    absorbed_lm: float
    rays: int


def tables(skylight: Skylight, answers: tuple[Answer, ...]) -> tuple[Floats, Floats]:
    """Factors per answer, kind of tally and count, shape (A, TALLIES, DEPTH); and dirt depths (A,)."""
    count = np.arange(DEPTH, dtype=np.float64)
    factors = np.ones((len(answers), TALLIES, DEPTH))
    for i, answer in enumerate(answers):
        reflectance = skylight.wall_reflectance if answer.wall_reflectance is None else answer.wall_reflectance
        wall = reflectance**count
        if answer.max_bounces:
            wall = np.where(count > answer.max_bounces, 0.0, wall)
        for tally, drawn, wanted in (
            (0, skylight.wall_scatter, answer.wall_scatter),
            (2, max(skylight.entry.haze, skylight.exit.haze), answer.haze),
        ):
            if wanted is not None and drawn > 0.0:
                stay = (1.0 - wanted) / (1.0 - drawn)
                factors[i, tally] *= stay**count
                with np.errstate(over="ignore"):  # counts that never occur
                    factors[i, tally + 1] *= (wanted / drawn / stay) ** count if wanted > 0.0 else count == 0
        factors[i, 0] *= wall
        factors[i, 4] *= (1.0 - answer.sector_loss) ** count
        if answer.gap:
            factors[i, 5] = count == 0
    return factors, np.array([answer.soiling for answer in answers])


@compiled
def _outline(s: SkylightNumbers, dx: float, dy: float, dz: float) -> tuple[float, float, float, float]:
    """Rectangle in the entry plane that holds the cover's shadow along the light (x and y, from and to)."""
    ax, ay = -s.rise * dx / dz, -s.rise * dy / dz
    if s.cover == DOME:
        return min(0.0, ax) - s.half_x, max(0.0, ax) + s.half_x, min(0.0, ay) - s.half_y, max(0.0, ay) + s.half_y
    return min(ax, -s.half_x), max(ax, s.half_x), min(ay, -s.half_y), max(ay, s.half_y)


@compiled
def _sunbeam(state: State, sun: Floats, disc: float, power: float, u: float, v: float) -> tuple[float, float, float]:
    """Direction of light from somewhere on the sun's disc (a lobe of ``power``, if any), by two uniform numbers."""
    if power == 0.0:
        r, t = disc * math.sqrt(u), 2.0 * math.pi * v
        a, b = r * math.cos(t), r * math.sin(t)
    else:
        a, b = lobe(state, disc, power)
    return tilted(-sun[0], -sun[1], -sun[2], a, b)


@compiled
def _answer(carried: Floats, w: float, slant: float, tally: Tally, factors: Floats, dirt: Floats) -> None:
    """What a ray of weight ``w`` carries in each answer, by its tallied events."""
    for i in range(len(carried)):
        f = w * math.exp(-dirt[i] * slant)
        for k in range(TALLIES):
            f *= factors[i, k, min(DEPTH - 1, tally[k])]
        carried[i] = f


@compiled
def _trace(
    s: SkylightNumbers,
    sun: Floats,
    disc: float,
    power: float,
    first: int,
    rays: int,
    seed: int,
    steps: Floats,
    factors: Floats,
    dirt: Floats,
    radii: Floats,
    across: int,
    flux: Floats,
    square: Floats,
    bounces: Floats,
    sums: Floats,
    state: State,
    tally: Tally,
    shift: Floats,
    place: Floats,
    carried: Floats,
) -> None:
    """Follow rays ``first`` to ``first + rays`` and add what they carry (in m² of normal area) to the counters."""
    start(state, seed, -1)
    for k in range(KRONECKER_DIMENSIONS):
        shift[k] = uniform(state)
    x0, x1, y0, y1 = _outline(s, -sun[0], -sun[1], -sun[2])
    area = (x1 - x0) * (y1 - y0) * sun[2]
    answers = len(dirt)
    for ray in range(first, first + rays):
        start(state, seed, ray)
        for k in range(KRONECKER_DIMENSIONS):
            place[k] = (shift[k] + ray * steps[k]) % 1.0
        dx, dy, dz = _sunbeam(state, sun, disc, power, place[4], place[5])
        sums[0] += area
        if dz >= -1e-4:
            continue
        for k in range(TALLIES):
            tally[k] = 0
        x, y = x0 + place[0] * (x1 - x0), y0 + place[1] * (y1 - y0)
        fate, x, y, z, dx, dy, dz, w, slant = enter(state, s, tally, x, y, dx, dy, dz, place[2], place[3])
        if fate != GOES_ON:
            if fate == OUT_ABOVE and slant > 0.0:
                sums[3] += area * w if w > 0.0 else area
                sums[1] += area
            elif slant > 0.0:
                sums[1] += area
            continue
        sums[1] += area
        sums[5] += area * w
        fate, x, y, z, dx, dy, dz, more = follow(state, s, tally, x, y, z, dx, dy, dz)
        if fate == DEAD:
            continue
        w *= more * area
        nominal = w * s.reference_reflectance ** tally[WALL]
        if fate == OUT_ABOVE:
            sums[3] += nominal
            continue
        sums[2] += nominal
        _answer(carried, w, slant, tally, factors, dirt)
        bounces[min(DEPTH - 1, tally[WALL])] += carried[0]
        for r in range(len(radii)):
            if math.isinf(radii[r]):
                cell = cell_of(dx, dy, dz, across)
            else:
                qx, qy, qz = pierce(x, y, dx, dy, dz, radii[r])
                cell = cell_of(qx, qy, qz, across)
            square[r, cell] += carried[0] * carried[0]
            for i in range(answers):
                flux[cell, r, i] += carried[i]


def trace(
    skylight: Skylight,
    sun: Floats,
    rays: int,
    seed: int,
    answers: tuple[Answer, ...] = (Answer(),),
    disc_deg: float = SUN_HALF_ANGLE_DEG,
    aureole_power: float = 0.0,
    radii_m: tuple[float, ...] = RADII_M,
    across: int = FINE,
) -> Traced:
    """Trace light from ``sun`` through ``skylight``.

    Parameters
    ----------
    sun : shape (3,)
        Unit vector towards the source, above the horizon.
    rays, seed
        Number of rays and which random numbers; the same seed gives the same rays through any skylight.
    disc_deg
        Half angle of a uniform disc [deg]; with ``aureole_power`` > 0 the scale of a `draws.lobe` instead.
    radii_m, across
        Spheres on which to count, infinity for the far field, and cells across the map.
    """
    numbers = skylight.numbers()
    factors, dirt = tables(skylight, answers)
    flux = np.zeros((across * across, len(radii_m), len(answers)))
    square = np.zeros((len(radii_m), across * across))
    bounces, sums = np.zeros(DEPTH), np.zeros(6)
    direction = np.asarray(sun, dtype=np.float64)
    _trace(
        numbers,
        direction,
        math.radians(disc_deg),
        aureole_power,
        0,
        rays,
        seed,
        kronecker_steps(),
        factors,
        dirt,
        np.array(radii_m),
        across,
        flux,
        square,
        bounces,
        sums,
        np.zeros(2, dtype=np.uint64),
        np.zeros(TALLIES, dtype=np.int64),
        np.zeros(KRONECKER_DIMENSIONS),
        np.zeros(KRONECKER_DIMENSIONS),
        np.zeros(len(answers)),
    )
    sums /= rays
    return Traced(
        flux=np.moveaxis(flux.reshape(across, across, len(radii_m), len(answers)), (2, 3), (1, 0)) / rays,
        square=square.reshape(len(radii_m), across, across) / rays**2,
        bounces=bounces / rays,
        sent_lm=float(sums[0]),
        entered_lm=float(sums[5]),
        below_lm=float(sums[2]),
        above_lm=float(sums[3]),
        absorbed_lm=float(sums[1] - sums[2] - sums[3]),
        rays=rays,
    )


__all__ = ["Answer", "Traced", "trace"]
