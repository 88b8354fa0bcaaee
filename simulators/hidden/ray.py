"""One ray's way through a skylight: cover, well, boot, exit lens, and back again as often as it likes.

There is no limit to the bounces: light ends by leaving, by being absorbed, or by Russian roulette, which is fair on
average. Events are tallied, so that another wall reflectance, a bounce limit or a haze can be applied to the same
rays afterwards.
"""

import math

import numpy as np
from numpy.typing import NDArray

from simulators.hidden.compiled import compiled
from simulators.hidden.draws import State, uniform
from simulators.hidden.lens import CLEAR, LOST, NO_LENS, PRISM_SIDE, hazed, through
from simulators.hidden.skylight import DOME, FLAT, PYRAMID, SkylightNumbers
from simulators.hidden.surfaces import brushed, clear_slab, matt, mirrored

Tally = NDArray[np.int64]
WALL, SCATTERED, PASSES, HAZED, SECTOR, GAP = 0, 1, 2, 3, 4, 5
TALLIES = 6

DEAD, OUT_BELOW, OUT_ABOVE, GOES_ON = 0, 1, 2, 3
BROAD = math.radians(12.0)
ROULETTE_BELOW, ROULETTE_SURVIVAL = 0.02, 0.25

Step = tuple[int, float, float, float, float, float, float, float]
"""Fate, place (3), direction (3), factor on the weight."""


@compiled
def _in_sector(s: SkylightNumbers, x: float, y: float) -> bool:
    turn = (math.atan2(x, y) - s.sector_from) % (2.0 * math.pi)
    return turn < s.sector_width


@compiled
def _sheet(
    state: State, s: SkylightNumbers, exit_lens: bool, pane: int, dx: float, dy: float, dz: float, u: float, v: float
) -> tuple[int, float, float, float, float]:
    """Send a ray through a pane of the cover or the exit lens, in the world's frame."""
    frame = s.exit_frame if exit_lens else s.frames[pane]
    lens = s.exit if exit_lens else s.entry
    a = frame[0][0] * dx + frame[0][1] * dy + frame[0][2] * dz
    b = frame[1][0] * dx + frame[1][1] * dy + frame[1][2] * dz
    c = frame[2][0] * dx + frame[2][1] * dy + frame[2][2] * dz
    side, a, b, c, weight = through(state, lens, a, b, c, u, v)
    return (
        side,
        frame[0][0] * a + frame[1][0] * b + frame[2][0] * c,
        frame[0][1] * a + frame[1][1] * b + frame[2][1] * c,
        frame[0][2] * a + frame[1][2] * b + frame[2][2] * c,
        weight,
    )


@compiled
def _haze_trial(
    state: State, s: SkylightNumbers, tally: Tally, exit_lens: bool, pane: int, dx: float, dy: float, dz: float
) -> tuple[float, float, float]:
    """Perhaps scatter light that has passed a lens; each chance is tallied, and each scattering."""
    lens = s.exit if exit_lens else s.entry
    if lens.haze <= 0.0:
        return dx, dy, dz
    tally[PASSES] += 1
    if uniform(state) >= lens.haze:
        return dx, dy, dz
    tally[HAZED] += 1
    if exit_lens or s.cover == DOME:
        nx, ny, nz = 0.0, 0.0, -1.0
    else:
        nx, ny, nz = s.frames[pane][2][0], s.frames[pane][2][1], s.frames[pane][2][2]
    for _ in range(8):
        x, y, z = hazed(state, lens, -1 if dz < 0.0 else 1, dx, dy, dz)
        if (x * nx + y * ny + z * nz) * (dx * nx + dy * ny + dz * nz) > 0.0:
            return x, y, z
    return dx, dy, dz


@compiled
def _dome_centre(s: SkylightNumbers) -> tuple[float, float]:
    """Radius of the dome's sphere, and the height of its centre."""
    radius = (s.half_x * s.half_x + s.rise * s.rise) / (2.0 * s.rise)
    return radius, s.depth + s.rise - radius


@compiled
def enter(
    state: State,
    s: SkylightNumbers,
    tally: Tally,
    x: float,
    y: float,
    dx: float,
    dy: float,
    dz: float,
    u: float,
    v: float,
) -> tuple[int, float, float, float, float, float, float, float, float]:
    """Bring a ray that would cross the entry plane at (x, y) from outside through the cover.

    Returns its fate, place, direction, weight, and 1 / cosine of its incidence on the cover (0 if it missed).
    """
    z = s.depth
    pane, way, cosine = -1, 0.0, 0.0
    if s.cover == PYRAMID:
        way, leave = -1e30, 0.0
        for i in range(4):
            n = s.panes[i]
            speed = n[0] * dx + n[1] * dy + n[2] * dz
            gap = n[3] - (n[0] * x + n[1] * y + n[2] * z)
            if speed < 0.0:
                if gap / speed > way:
                    way, pane, cosine = gap / speed, i, -speed
            elif speed > 0.0:
                leave = min(leave, gap / speed)
        if pane < 0 or way > leave:
            return OUT_ABOVE, x, y, z, dx, dy, dz, 0.0, 0.0
    elif s.cover == DOME:
        radius, centre = _dome_centre(s)
        b = x * dx + y * dy + (z - centre) * dz
        c = x * x + y * y + (z - centre) ** 2 - radius * radius
        if b * b <= c:
            return OUT_ABOVE, x, y, z, dx, dy, dz, 0.0, 0.0
        way = -b - math.sqrt(b * b - c)
        if z + way * dz < s.depth:
            return OUT_ABOVE, x, y, z, dx, dy, dz, 0.0, 0.0
        cosine = -((x + way * dx) * dx + (y + way * dy) * dy + (z + way * dz - centre) * dz) / radius
    else:
        inside = x * x + y * y < s.half_x**2 if s.round else abs(x) < s.half_x and abs(y) < s.half_y
        if not inside:
            return OUT_ABOVE, x, y, z, dx, dy, dz, 0.0, 0.0
        pane, cosine = 0, -dz
    x, y, z = x + way * dx, y + way * dy, z + way * dz
    grazing = 1.0 / max(cosine, 0.02)
    weight = 1.0
    if s.cover == DOME and s.entry.kind == CLEAR:
        if uniform(state) >= clear_slab(cosine, s.entry.refractive):
            return OUT_ABOVE, x, y, z, dx, dy, dz, 0.0, grazing
    elif s.entry.kind != NO_LENS:
        side, dx, dy, dz, weight = _sheet(state, s, False, max(0, pane), dx, dy, dz, u, v)
        if side != PRISM_SIDE:
            return (DEAD if side == LOST else OUT_ABOVE), x, y, z, dx, dy, dz, weight, grazing
    if s.sector_width > 0.0:
        if _in_sector(s, x, y):
            tally[SECTOR] += 1
            dx, dy, dz = _haze_trial(state, s, tally, False, max(0, pane), dx, dy, dz)
    else:
        dx, dy, dz = _haze_trial(state, s, tally, False, max(0, pane), dx, dy, dz)
    if s.cover == FLAT and dz > 0.0:
        return OUT_ABOVE, x, y, z, dx, dy, dz, weight, grazing
    return GOES_ON, x, y, z, dx, dy, dz, weight, grazing


@compiled
def _under_cover(
    state: State, s: SkylightNumbers, tally: Tally, x: float, y: float, z: float, dx: float, dy: float, dz: float
) -> Step:
    """One step between the entry plane and the cover: to the plane (then on into the well), or to the cover."""
    down = (s.depth - z) / dz if dz < 0.0 else 1e30
    if s.cover == DOME:
        radius, centre = _dome_centre(s)
        b = x * dx + y * dy + (z - centre) * dz
        c = x * x + y * y + (z - centre) ** 2 - radius * radius
        way = -b + math.sqrt(max(0.0, b * b - c))
        if down <= way:
            return GOES_ON, x + down * dx, y + down * dy, s.depth, dx, dy, dz, 1.0
        x, y, z = x + way * dx, y + way * dy, z + way * dz
        nx, ny, nz = x / radius, y / radius, (z - centre) / radius
        if uniform(state) < clear_slab(abs(dx * nx + dy * ny + dz * nz), s.entry.refractive):
            return OUT_ABOVE, x, y, z, dx, dy, dz, 1.0
        dx, dy, dz = mirrored(dx, dy, dz, nx, ny, nz)
        return GOES_ON, x, y, z, dx, dy, dz, 1.0
    pane, way = 0, 0.0
    if s.cover == PYRAMID:
        way, pane = 1e30, -1
        for i in range(4):
            n = s.panes[i]
            speed = n[0] * dx + n[1] * dy + n[2] * dz
            if speed > 1e-12:
                t = max(0.0, (n[3] - (n[0] * x + n[1] * y + n[2] * z)) / speed)
                if t < way:
                    way, pane = t, i
        if down <= way:
            return GOES_ON, x + down * dx, y + down * dy, s.depth, dx, dy, dz, 1.0
    x, y, z = x + way * dx, y + way * dy, z + way * dz
    if s.entry.kind == NO_LENS:
        return OUT_ABOVE, x, y, z, dx, dy, dz, 1.0
    side, dx, dy, dz, weight = _sheet(state, s, False, pane, dx, dy, dz, uniform(state), uniform(state))
    if side == PRISM_SIDE:
        return GOES_ON, x, y, z, dx, dy, dz, weight
    return (DEAD if side == LOST else OUT_ABOVE), x, y, z, dx, dy, dz, weight


@compiled
def _to_wall(s: SkylightNumbers, x: float, y: float, dx: float, dy: float) -> tuple[float, float, float]:
    """Distance to the well's wall and the wall's inward normal there (x, y)."""
    if s.round:
        a = dx * dx + dy * dy
        if a < 1e-16:
            return 1e30, 0.0, 0.0
        b = x * dx + y * dy
        c = min(0.0, x * x + y * y - s.half_x * s.half_x)
        way = (-b + math.sqrt(b * b - a * c)) / a
        f = -1.0 / s.half_x
        return way, f * (x + way * dx), f * (y + way * dy)
    to_x = (math.copysign(s.half_x, dx) - x) / dx if dx != 0.0 else 1e30
    to_y = (math.copysign(s.half_y, dy) - y) / dy if dy != 0.0 else 1e30
    if to_x < to_y:
        return max(0.0, to_x), -math.copysign(1.0, dx), 0.0
    return max(0.0, to_y), 0.0, -math.copysign(1.0, dy)


@compiled
def _bounce(
    state: State,
    s: SkylightNumbers,
    tally: Tally,
    x: float,
    y: float,
    z: float,
    dx: float,
    dy: float,
    dz: float,
    nx: float,
    ny: float,
) -> tuple[float, float, float, float]:
    """Reflect on the wall or the boot; returns the direction and the factor that is not tallied."""
    if z < s.boot:
        dx, dy, dz = matt(state, nx, ny, 0.0)
        return dx, dy, dz, s.boot_reflectance
    if s.gap_low < z < s.gap_high:
        turn = (math.atan2(x, y) - s.gap_azimuth + math.pi) % (2.0 * math.pi) - math.pi
        if abs(turn) < math.pi / 4.0:
            tally[GAP] += 1
    tally[WALL] += 1
    if s.diffuse:
        dx, dy, dz = matt(state, nx, ny, 0.0)
        return dx, dy, dz, 1.0
    if s.scatter > 0.0:
        chance = uniform(state)
        if chance < s.scatter:
            tally[SCATTERED] += 1
            if chance < 0.5 * s.scatter:
                dx, dy, dz = matt(state, nx, ny, 0.0)
            else:
                dx, dy, dz = brushed(state, dx, dy, dz, nx, ny, 0.0, BROAD)
            return dx, dy, dz, 1.0
    dx, dy, dz = brushed(state, dx, dy, dz, nx, ny, 0.0, s.wall_spread)
    return dx, dy, dz, 1.0


@compiled
def follow(
    state: State, s: SkylightNumbers, tally: Tally, x: float, y: float, z: float, dx: float, dy: float, dz: float
) -> Step:
    """Follow a ray inside the skylight until it leaves or ends; adds to ``tally``."""
    weight = 1.0
    level = 1.0  # expected weight with the nominal walls, for the roulette
    attic = z > s.depth or (s.cover == FLAT and z >= s.depth and dz > 0.0)
    for _ in range(100_000):
        if attic or (z >= s.depth and dz > 0.0):
            fate, x, y, z, dx, dy, dz, factor = _under_cover(state, s, tally, x, y, z, dx, dy, dz)
            if fate != GOES_ON:
                return fate, x, y, z, dx, dy, dz, weight * factor
            attic = z > s.depth
        else:
            way, nx, ny = _to_wall(s, x, y, dx, dy)
            factor = 1.0
            if dz < 0.0 and -z / dz <= way:
                x, y, z = x - z / dz * dx, y - z / dz * dy, 0.0
                if s.exit.kind == NO_LENS:
                    return OUT_BELOW, x, y, z, dx, dy, dz, weight
                side, dx, dy, dz, factor = _sheet(state, s, True, 0, dx, dy, dz, uniform(state), uniform(state))
                if side == LOST:
                    return DEAD, x, y, z, dx, dy, dz, 0.0
                if dz < 0.0:
                    if s.sector_width <= 0.0:
                        dx, dy, dz = _haze_trial(state, s, tally, True, 0, dx, dy, dz)
                    return OUT_BELOW, x, y, z, dx, dy, dz, weight * factor
            elif dz > 0.0 and (s.depth - z) / dz <= way:
                way = (s.depth - z) / dz
                x, y, z = x + way * dx, y + way * dy, s.depth
                attic = s.cover != FLAT
                if s.cover == FLAT:
                    fate, x, y, z, dx, dy, dz, factor = _under_cover(state, s, tally, x, y, z, dx, dy, dz)
                    if fate != GOES_ON:
                        return fate, x, y, z, dx, dy, dz, weight * factor
            else:
                x, y, z = x + way * dx, y + way * dy, z + way * dz
                dx, dy, dz, factor = _bounce(state, s, tally, x, y, z, dx, dy, dz, nx, ny)
                level *= factor * s.reference_reflectance
            weight *= factor
        if weight * level < ROULETTE_BELOW:
            if uniform(state) > ROULETTE_SURVIVAL:
                return DEAD, x, y, z, dx, dy, dz, 0.0
            weight /= ROULETTE_SURVIVAL
    return DEAD, x, y, z, dx, dy, dz, 0.0
