"""Whole paths: from the sun or the sky through cover, well and exit lens to the far and the near field."""

import math
from typing import Final

import numpy as np

from analysis.simulate.kernels.arrays import (
    AX,
    AY,
    BACK,
    BOOT,
    CUT,
    GIVEN,
    HAZE,
    HEIGHT,
    IN,
    KIND,
    LAMBERT,
    LENS,
    MIRROR,
    NONE,
    OUT,
    OUTSIDE,
    RAYS,
    RECTANGLE,
    RHO,
    ROULETTE,
    SHAPE,
    SKY,
    SPREAD,
    TABLE,
    TURN_C,
    TURN_S,
    WALL,
    Counts,
    Light,
    Skylight,
)
from analysis.simulate.kernels.counting import score
from analysis.simulate.kernels.fan import read_fan, score_fan, turn_fan
from analysis.simulate.kernels.geometry import bounce, land, mirror_box, mirror_cylinder, next_wall, under_cover
from analysis.simulate.kernels.jit import borrowed, jit, kernel, part
from analysis.simulate.kernels.launch import A1, A2, A3, A4, A5, A6, even, from_sky, from_sun
from analysis.simulate.kernels.optics import (
    cosine_lobe,
    dirt,
    entry_of,
    from_pattern,
    lens_finish,
    lens_hit,
    lens_row,
    lens_sample,
    mix,
    stream,
    uniform,
)

# typed, because numba compiles a function again for every literal it is called with
ZERO: Final = np.int64(0)
ONE: Final = np.int64(1)
TWO: Final = np.int64(2)
YES: Final = np.bool_(True)
NO: Final = np.bool_(False)

MAX_EVENTS: Final = 200_000
LOW: Final = 0.05
RAISED: Final = 0.1
HAZE_SAMPLES: Final = 4


@jit
def frame(nx, ny, nz):  # type: ignore[no-untyped-def]
    """The sheet's x axis (the world's x laid onto it) and y axis, for an outward normal with nz > 0."""
    k = 1.0 / math.sqrt(max(1e-12, 1.0 - nx * nx))
    ex, ey, ez = (1.0 - nx * nx) * k, -nx * ny * k, -nx * nz * k
    return ex, ey, ez, ny * ez - nz * ey, nz * ex - nx * ez, nx * ey - ny * ex


@jit
def through_cover(sky, from_above, dx, dy, dz, nx, ny, nz, pick, state):  # type: ignore[no-untyped-def]
    """Pass the cover at a point with outward normal n; returns the new direction, whether it passed, and weight."""
    ex, ey, ez, fx, fy, fz = frame(nx, ny, nz)
    lx = dx * ex + dy * ey + dz * ez
    ly = dx * fx + dy * fy + dz * fz
    cosine = abs(dx * nx + dy * ny + dz * nz)
    table = sky.above if from_above else sky.below
    ox, oy, through, w, state = lens_hit(sky, sky.entry, table, from_above, lx, ly, cosine, pick, state)
    oz = math.sqrt(max(1e-12, 1.0 - ox * ox - oy * oy))
    if through == from_above:  # goes on, or turns back, inwards
        oz = -oz
    return ox * ex + oy * fx + oz * nx, ox * ey + oy * fy + oz * ny, ox * ez + oy * fz + oz * nz, through, w, state


@jit
def haze_direct(sky, counts, light, source, value, x, y, z, ex, ey, ez, fx, fy, fz, nx, ny, nz, state):  # type: ignore[no-untyped-def]
    """Score the cosine lobe of a hazy lens by a few samples that go straight to (or leave from) the aperture."""
    few = min(counts.split, HAZE_SAMPLES)
    for k in range(few):
        counts.fan_a[k], counts.fan_b[k], state = cosine_lobe(state)
        counts.fan_w[k] = 1.0
    score_fan(counts, few, light, sky.geometry, source, ZERO, ZERO, value, x, y, z, ex, ey, ez, fx, fy, fz, nx, ny, nz)
    return state


@jit
def enter(sky, counts, light, source, facet, area, x, y, z, dx, dy, dz, nx, ny, nz, pick, state):  # type: ignore[no-untyped-def]
    """Light from outside passes a prismatic cover: one sample goes on; without an exit lens a fan is scored that goes
    straight to the aperture. ``facet`` >= 0 reads the table that was made for this sun and facet.

    Returns the direction, whether it passed, its weight, and the state.
    """
    lens = sky.entry
    ex, ey, ez, fx, fy, fz = frame(nx, ny, nz)
    px = dx * ex + dy * ey + dz * ez
    py = dx * fx + dy * fy + dz * fz
    cosine = -(dx * nx + dy * ny + dz * nz)
    row, swap, sx, sy, c, s, mirrored = facet, False, 1.0, 1.0, 1.0, 0.0, False
    if facet < 0:
        px, py, row, swap, sx, sy, c, s, state = lens_row(lens, sky.half, px, py, cosine, state)
        mirrored = lens[MIRROR] != 0.0
    nodes = sky.spots if facet >= 0 else sky.nodes
    k0 = entry_of(sky, sky.above, counts.split, pick)
    qx, qy, through, w = lens_sample(sky.above, nodes, row, k0, swap, sx, sy, px, py)
    ox, oy = c * qx - s * qy, s * qx + c * qy
    if mirrored:
        ox = -ox
    ox, oy, w, state = lens_finish(lens, YES, cosine, ox, oy, through, w, state)
    if sky.exit[KIND] == NONE:
        read_fan(counts, counts.split, sky.above, row, k0, swap, sx, sy)
        passed = 0.0
        for k in range(counts.split):
            passed += counts.fan_w[k]
        p, q = nodes[row, 0], nodes[row, 1]
        if swap:
            p, q = q, p
        turn_fan(counts, counts.split, px, py, sx, sy, p, q, c, s, mirrored)
        value = area * dirt(lens, cosine)
        clear = value * (1.0 - lens[HAZE])
        score_fan(
            counts,
            counts.split,
            light,
            sky.geometry,
            source,
            ZERO,
            ZERO,
            clear,
            x,
            y,
            z,
            ex,
            ey,
            ez,
            fx,
            fy,
            fz,
            nx,
            ny,
            nz,
        )
        if lens[HAZE] > 0.0:
            value *= lens[HAZE] * passed / counts.split
            state = haze_direct(sky, counts, light, source, value, x, y, z, ex, ey, ez, fx, fy, fz, nx, ny, nz, state)
    oz = math.sqrt(max(1e-12, 1.0 - ox * ox - oy * oy))
    if through:
        oz = -oz
    return ox * ex + oy * fx + oz * nx, ox * ey + oy * fy + oz * ny, ox * ez + oy * fz + oz * nz, through, w, state


@jit
def mirror_well(geo, low, high, x, y, z, dx, dy, dz):  # type: ignore[no-untyped-def]
    """Straight through a perfectly specular part of the well, low <= z <= high; returns the reflections on the way."""
    goal = low if dz < 0.0 else high
    length = (goal - z) / dz
    if geo[SHAPE] == RECTANGLE:
        x, dx, n = mirror_box(geo[AX], x, dx, length)
        y, dy, m = mirror_box(geo[AY], y, dy, length)
        return x, y, goal, dx, dy, n + m
    x, y, dx, dy, n = mirror_cylinder(geo[AX], x, y, dx, dy, length)
    return x, y, goal, dx, dy, n


@jit
def roulette(w, balance, unit, state):  # type: ignore[no-untyped-def]
    """Let a weak ray die or grow, fairly (Russian roulette)."""
    a, state = uniform(state)
    if a * RAISED < w:
        balance[ROULETTE] += (w - RAISED) * unit
        return RAISED, state
    balance[ROULETTE] += w * unit
    return 0.0, state


@part
def exit_plain(sky, counts, light, source, m, n, value, x, y, dx, dy, dz, state):  # type: ignore[no-untyped-def]
    """One sample of an exit lens of any kind, scored with its weight; what it did, and the state."""
    pick, state = uniform(state)
    ox, oy, through, w, state = lens_hit(sky, sky.exit, sky.under, YES, dx, dy, -dz, pick, state)
    if through:
        oz = -math.sqrt(max(1e-12, 1.0 - ox * ox - oy * oy))
        score(counts, light, sky.geometry, source, m, n, value * w, x, y, ox, oy, oz)
    return through, ox, oy, w, state


@jit
def exit_fan(sky, counts, light, source, m, n, value, x, y, dx, dy, dz, state):  # type: ignore[no-untyped-def]
    """Pass a prismatic exit lens: a fan of samples is scored, the first decides what is reflected.

    Returns whether the first passed, its tangential cosines and weight, and the state.
    """
    lens = sky.exit
    pick, state = uniform(state)
    px, py, row, swap, sx, sy, c, s, state = lens_row(lens, sky.half, dx, dy, -dz, state)
    k0 = entry_of(sky, sky.under, counts.split, pick)
    qx, qy, through, w = lens_sample(sky.under, sky.nodes, row, k0, swap, sx, sy, px, py)
    ox, oy = from_pattern(lens, qx, qy, c, s)
    value *= dirt(lens, -dz)
    if through:
        w *= dirt(lens, -dz)
    read_fan(counts, counts.split, sky.under, row, k0, swap, sx, sy)
    passed = 0.0
    for k in range(counts.split):
        passed += counts.fan_w[k]
    p, q = sky.nodes[row, 0], sky.nodes[row, 1]
    if swap:
        p, q = q, p
    turn_fan(counts, counts.split, px, py, sx, sy, p, q, c, s, lens[MIRROR] != 0.0)
    clear = value * (1.0 - lens[HAZE])
    score_fan(
        counts,
        counts.split,
        light,
        sky.geometry,
        source,
        m,
        n,
        clear,
        x,
        y,
        0.0,
        1.0,
        0.0,
        0.0,
        0.0,
        1.0,
        0.0,
        0.0,
        0.0,
        1.0,
    )
    if lens[HAZE] > 0.0:
        few = min(counts.split, HAZE_SAMPLES)
        share = value * lens[HAZE] * passed / counts.split / few
        for _ in range(few):
            hx, hy, state = cosine_lobe(state)
            hz = -math.sqrt(max(1e-12, 1.0 - hx * hx - hy * hy))
            score(counts, light, sky.geometry, source, m, n, share, x, y, hx, hy, hz)
    return through, ox, oy, w, state


@jit
def glow(sky, counts, light, source, m, n, value, x, y, z, nx, ny, state):  # type: ignore[no-untyped-def]
    """Score what a Lambertian bounce at (x, y, z) of a wall with inward normal n sends straight to the aperture.

    Only the lower half of the lobe is sampled, with half the weight: the upper half is its mirror image. Into an open
    aperture goes a whole fan; a lens there gets a few samples, each with a fan of its own.
    """
    geo = sky.geometry
    if sky.exit[KIND] == NONE:
        size = counts.split if m + n < 2 else max(ONE, counts.split // 4)
        pick, state = uniform(state)
        read_fan(counts, size, sky.lobe, ZERO, int(pick * (sky.lobe.shape[1] - size + 1)), NO, 1.0, 1.0)
        half = 0.5 * value
        score_fan(counts, size, light, geo, source, m, n, half, x, y, z, -ny, nx, 0.0, 0.0, 0.0, 1.0, -nx, -ny, 0.0)
        return state
    for _ in range(counts.glow):
        p, q, state = cosine_lobe(state)
        q = -abs(q)
        out = math.sqrt(1.0 - p * p - q * q)
        dx, dy, dz = out * nx - p * ny, out * ny + p * nx, min(q, -1e-9)
        t = z / -dz
        ax, ay = x + dx * t, y + dy * t
        if geo[SHAPE] == RECTANGLE:
            hit = abs(ax) <= geo[AX] and abs(ay) <= geo[AY]
        else:
            hit = ax * ax + ay * ay <= geo[AX] * geo[AX]
        if hit:
            share = 0.5 * value / counts.glow
            if sky.exit[KIND] == TABLE:
                _, _, _, _, state = exit_fan(sky, counts, light, source, m, n, share, ax, ay, dx, dy, dz, state)
            else:
                _, _, _, _, state = exit_plain(sky, counts, light, source, m, n, share, ax, ay, dx, dy, dz, state)
    return state


@jit
def rough_well(
    sky, counts, light, source, wall, in_boot, low, high, x, y, z, dx, dy, dz, w, area, m, n, unit, seen, state
):  # type: ignore[no-untyped-def]
    """Wall by wall through a part of the well that scatters; w = 0 when the light died.

    Lambertian light that goes straight to the aperture is scored here; ``seen`` says so for the ray that goes on.
    """
    balance = counts.balance
    while True:
        t, nx, ny = next_wall(sky.geometry, x, y, dx, dy)
        goal = low if dz < 0.0 else high
        if abs(dz) * t >= abs(goal - z):
            t = (goal - z) / dz if dz != 0.0 else 0.0
            return x + dx * t, y + dy * t, goal, dx, dy, dz, w, m, n, seen, state
        if m + n >= counts.limit:
            balance[CUT] += w * unit
            return x, y, z, dx, dy, dz, 0.0, m, n, seen, state
        x, y, z = x + dx * t, y + dy * t, z + dz * t
        balance[WALL] += w * (1.0 - wall[RHO]) * unit
        w *= wall[RHO]
        if in_boot:
            m += 1
        else:
            n += 1
        if wall[LAMBERT] > 0.0:
            state = glow(sky, counts, light, source, m, n, w * area * wall[LAMBERT], x, y, z, nx, ny, state)
        dx, dy, dz, seen, state = bounce(wall, dx, dy, dz, nx, ny, state)
        if w < LOW:
            w, state = roulette(w, balance, unit, state)
            if w == 0.0:
                return x, y, z, dx, dy, dz, 0.0, m, n, seen, state


@jit
def down_and_up(sky, counts, light, source, zone, x, y, z, dx, dy, dz, w, area, m, n, unit, seen, state):  # type: ignore[no-untyped-def]
    """Cross one zone (1 well, 2 boot); w = 0 when the light died."""
    geo, balance = sky.geometry, counts.balance
    bottom = geo[BOOT]
    low, high, wall = bottom, geo[HEIGHT], sky.well
    if zone == 2:
        low, high, wall = 0.0, bottom, sky.boot
    if wall[LAMBERT] > 0.0 or wall[SPREAD] > 0.0:
        x, y, z, dx, dy, dz, w, m, n, seen, state = rough_well(
            sky,
            counts,
            light,
            source,
            wall,
            zone == 2,
            low,
            high,
            x,
            y,
            z,
            dx,
            dy,
            dz,
            w,
            area,
            m,
            n,
            unit,
            seen,
            state,
        )
        return x, y, z, dx, dy, dz, w, m, n, seen, state
    if abs(dz) < 1e-9:
        balance[WALL] += w * unit
        return x, y, z, dx, dy, dz, 0.0, m, n, False, state
    x, y, z, dx, dy, count = mirror_well(geo, low, high, x, y, z, dx, dy, dz)
    if m + n + count > counts.limit:
        keep = wall[RHO] ** (counts.limit - m - n)
        balance[WALL] += w * (1.0 - keep) * unit
        balance[CUT] += w * keep * unit
        return x, y, z, dx, dy, dz, 0.0, m, n, False, state
    if count > 0:
        v = wall[RHO] ** count
        balance[WALL] += w * (1.0 - v) * unit
        w *= v
        seen = False
    if zone == 2:
        m += count
    else:
        n += count
    return x, y, z, dx, dy, dz, w, m, n, seen, state


@jit
def follow(sky, counts, light, source, key, area, unit, x, y, z, dx, dy, dz, w, seen):  # type: ignore[no-untyped-def]
    """Follow one ray from inside the cover until it is out, back in the sky, absorbed, or cut."""
    balance = counts.balance
    n, m, event = ZERO, ZERO, TWO  # bounces on the wall, on the boot
    zone = ZERO  # 0 under the cover, 1 well, 2 boot
    has_boot = sky.geometry[BOOT] > 0.0
    while event < MAX_EVENTS:
        state = stream(key, event)
        event += 1
        if zone == 0:
            met, x, y, z, nx, ny, nz = under_cover(sky.geometry, sky.facets, x, y, z, dx, dy, dz)
            if not met:
                zone = 1
                continue
            pick, state = uniform(state)
            dx, dy, dz, through, v, state = through_cover(sky, NO, dx, dy, dz, nx, ny, nz, pick, state)
            balance[LENS] += w * (1.0 - v) * unit
            w *= v
            seen = False
            if through:
                balance[BACK] += w * unit
                return
        else:
            x, y, z, dx, dy, dz, w, m, n, seen, state = down_and_up(
                sky, counts, light, source, zone, x, y, z, dx, dy, dz, w, area, m, n, unit, seen, state
            )
            if w == 0.0:
                return
            if dz > 0.0:
                zone -= 1
            elif zone == 1 and has_boot:
                zone = 2
            else:
                if seen or sky.exit[KIND] != TABLE:
                    value = 0.0 if seen else w * area
                    through, ox, oy, v, state = exit_plain(
                        sky, counts, light, source, m, n, value, x, y, dx, dy, dz, state
                    )
                else:
                    through, ox, oy, v, state = exit_fan(
                        sky, counts, light, source, m, n, w * area, x, y, dx, dy, dz, state
                    )
                balance[LENS] += w * (1.0 - v) * unit
                w *= v
                if through:
                    balance[OUT] += w * unit
                    return
                dx, dy, dz = ox, oy, math.sqrt(max(1e-12, 1.0 - ox * ox - oy * oy))
                seen = False
        if w < LOW:
            w, state = roulette(w, balance, unit, state)
            if w == 0.0:
                return
    balance[CUT] += w * unit


@kernel
def trace(sky, counts, light, seed, count):  # type: ignore[no-untyped-def]
    """Trace ``count`` rays of one batch."""
    sky = Skylight(
        sky.geometry, borrowed(sky.facets), sky.well, sky.boot, sky.entry, sky.exit, borrowed(sky.above),
        borrowed(sky.below), borrowed(sky.under), borrowed(sky.nodes), sky.half, sky.exact, borrowed(sky.spots), borrowed(sky.lobe), sky.block, sky.blocks,
    )  # fmt: skip
    counts = Counts(
        borrowed(counts.sharp), borrowed(counts.soft), counts.sharp_side, counts.soft_side, counts.classes, counts.sharp_classes,
        counts.bounces, counts.members, counts.diffuse_well, counts.diffuse_boot, counts.distance, counts.split,
        counts.glow, counts.limit, borrowed(counts.balance), borrowed(counts.fan_a), borrowed(counts.fan_b),
        borrowed(counts.fan_w), borrowed(counts.fan_far), borrowed(counts.fan_near),
    )  # fmt: skip
    light = Light(
        light.mode, light.side, borrowed(light.steps), borrowed(light.flux), borrowed(light.span), borrowed(light.suns),
        borrowed(light.rays),
    )  # fmt: skip
    geo, balance = sky.geometry, counts.balance
    base = mix(seed)
    state = stream(base, ZERO)
    shift, state = uniform(state)
    s1, state = uniform(state)
    s2, state = uniform(state)
    s3, state = uniform(state)
    s4, state = uniform(state)
    s5, state = uniform(state)
    s6, state = uniform(state)
    source = 0
    for i in range(count):
        key = mix(base + np.uint64(i) * np.uint64(0x9E3779B97F4A7C15))
        state = stream(key, ONE)
        facet = -1
        if light.mode == GIVEN:
            x, y, z = light.rays[i, 0], light.rays[i, 1], light.rays[i, 2]
            nx, ny, nz = light.rays[i, 3], light.rays[i, 4], light.rays[i, 5]
            dx, dy, dz, area = light.rays[i, 6], light.rays[i, 7], light.rays[i, 8], light.rays[i, 9]
        else:
            place = (i + shift) / count
            while source < light.steps.shape[0] - 2 and place >= light.steps[source + 1]:
                source += 1
            if light.mode == SKY:
                dx, dy, dz, state = from_sky(source, light.side, state)
            else:
                a, state = uniform(state)
                b, state = uniform(state)
                dx, dy, dz = from_sun(light.suns, source, even(s4, i, A4), even(s5, i, A5), a, b)
            if dz >= 0.0:
                continue
            dx, dy = geo[TURN_C] * dx + geo[TURN_S] * dy, geo[TURN_C] * dy - geo[TURN_S] * dx
            x, y, z, nx, ny, nz, area, facet = land(
                geo, sky.facets, dx, dy, dz, even(s1, i, A1), even(s2, i, A2), even(s3, i, A3)
            )
            if not sky.exact:
                facet = -1
        if area <= 0.0:
            continue
        unit = area * light.flux[source, light.span[source, 0]]
        balance[IN] += unit
        balance[RAYS] += 1.0
        pick = even(s6, i, A6)
        prismatic = sky.entry[KIND] == TABLE
        if prismatic:
            dx, dy, dz, through, w, state = enter(
                sky, counts, light, source, facet, area, x, y, z, dx, dy, dz, nx, ny, nz, pick, state
            )
        else:
            dx, dy, dz, through, w, state = through_cover(sky, YES, dx, dy, dz, nx, ny, nz, pick, state)
        balance[LENS] += (1.0 - w) * unit
        if through:
            seen = prismatic and sky.exit[KIND] == NONE
            follow(sky, counts, light, source, key, area, unit, x, y, z, dx, dy, dz, w, seen)
        else:
            balance[OUTSIDE] += w * unit
