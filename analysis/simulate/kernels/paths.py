"""Whole paths: from the sun or the sky through cover, well and exit lens to the far and the near field."""

import math
from typing import Final

import numpy as np

from analysis.simulate.kernels.arrays import (
    BACK,
    BOOT,
    CUT,
    GIVEN,
    IN,
    KIND,
    LENS,
    NONE,
    OUT,
    OUTSIDE,
    RAYS,
    TABLE,
    TURN_C,
    TURN_S,
    Counts,
    Light,
    Load,
    Ray,
    Scene,
    Skylight,
)
from analysis.simulate.kernels.counting import NO, ONE, TWO, YES, ZERO
from analysis.simulate.kernels.cover import enter, through_cover
from analysis.simulate.kernels.exits import exit_fan, exit_plain
from analysis.simulate.kernels.geometry import land, under_cover
from analysis.simulate.kernels.jit import borrowed, jit, kernel
from analysis.simulate.kernels.launch import A1, A2, A3, A6, direction, even, source_at
from analysis.simulate.kernels.maps import mix, stream, uniform
from analysis.simulate.kernels.shade import shaded
from analysis.simulate.kernels.wells import LOW, cross, roulette

MAX_EVENTS: Final = 200_000
RAY_STEP: Final = np.uint64(0x9E3779B97F4A7C15)


@jit
def aperture(scene: Scene, ray: Ray, load: Load, state: np.uint64) -> tuple[Ray, Load, np.uint64]:
    """Arrive at the aperture from above; the light that is left goes up again (weight 0: none)."""
    counts, unit = scene.counts, load.unit
    if load.seen or scene.sky.exit[KIND] != TABLE:
        value = 0.0 if load.seen else load.weight * load.area
        through, ox, oy, v, state = exit_plain(scene, load, value, ray, state)
    else:
        through, ox, oy, v, state = exit_fan(scene, load, load.weight * load.area, ray, state)
    counts.balance[LENS] += load.weight * (1.0 - v) * unit
    w = load.weight * v
    if through:
        counts.balance[OUT] += w * unit
        w = 0.0
    up = math.sqrt(max(1e-12, 1.0 - ox * ox - oy * oy))
    return (
        Ray(ray.x, ray.y, 0.0, ox, oy, up),
        Load(load.source, load.area, unit, w, load.boot, load.wall, False),
        state,
    )


@jit
def follow(scene: Scene, key: np.uint64, ray: Ray, load: Load) -> None:
    """Follow one ray from inside the cover until it is out, back in the sky, absorbed, or cut."""
    sky, balance, unit = scene.sky, scene.counts.balance, load.unit
    event = TWO
    zone = ZERO  # 0 under the cover, 1 well, 2 boot
    last = TWO if sky.geometry[BOOT] > 0.0 else ONE
    while event < MAX_EVENTS:
        state = stream(key, event)
        event += ONE
        if zone == ZERO:
            met, x, y, z, nx, ny, nz = under_cover(
                sky.geometry, sky.facets, ray.x, ray.y, ray.z, ray.dx, ray.dy, ray.dz
            )
            ray = Ray(x, y, z, ray.dx, ray.dy, ray.dz)
            if not met:
                zone = ONE
                continue
            pick, state = uniform(state)
            dx, dy, dz, through, v, state = through_cover(sky, NO, ray, nx, ny, nz, pick, state)
            ray = Ray(x, y, z, dx, dy, dz)
            w = load.weight * v
            balance[LENS] += load.weight * (1.0 - v) * unit
            load = Load(load.source, load.area, unit, w, load.boot, load.wall, False)
            if through:
                balance[BACK] += w * unit
                return
        else:
            ray, load, state = cross(scene, zone, ray, load, state)
            if load.weight > 0.0:
                if ray.dz > 0.0:
                    zone -= ONE
                elif zone < last:
                    zone += ONE
                else:
                    ray, load, state = aperture(scene, ray, load, state)
            if load.weight == 0.0:
                return
        if load.weight < LOW:
            w, state = roulette(load.weight, balance, unit, state)
            if w == 0.0:
                return
            load = Load(load.source, load.area, unit, w, load.boot, load.wall, load.seen)
    balance[CUT] += load.weight * unit


@jit
def admit(
    scene: Scene, key: np.uint64, source: int, ray: Ray, normal: tuple[float, float, float], area: float, facet: int,
    pick: float, state: np.uint64,
) -> None:  # fmt: skip
    """Let a ray that fell on the cover pass it, and follow it."""
    sky, balance = scene.sky, scene.counts.balance
    nx, ny, nz = normal
    unit = area * scene.light.flux[source, scene.light.span[source, 0]]
    balance[IN] += unit
    balance[RAYS] += 1.0
    prismatic = sky.entry[KIND] == TABLE
    if prismatic:
        dx, dy, dz, through, w, state = enter(
            scene, source, facet if sky.exact else -ONE, area, ray, nx, ny, nz, pick, state
        )
    else:
        dx, dy, dz, through, w, state = through_cover(sky, YES, ray, nx, ny, nz, pick, state)
    balance[LENS] += (1.0 - w) * unit
    if through:
        seen = prismatic and sky.exit[KIND] == NONE
        inside = Ray(ray.x, ray.y, ray.z, dx, dy, dz)
        follow(scene, key, inside, Load(source, area, unit, w, ZERO, ZERO, seen))
    else:
        balance[OUTSIDE] += w * unit


@jit
def uncounted(sky: Skylight, counts: Counts, light: Light) -> Scene:
    """The scene with arrays that are not reference-counted; see `borrowed`."""
    return Scene(
        Skylight(
            sky.geometry, borrowed(sky.facets), sky.well, sky.boot, sky.entry, sky.exit, borrowed(sky.above),
            borrowed(sky.below), borrowed(sky.under), borrowed(sky.nodes), borrowed(sky.wide), sky.exact,
            borrowed(sky.spots), borrowed(sky.ring), borrowed(sky.ring_nodes), sky.ring_cosine, borrowed(sky.lobe),
            borrowed(sky.powers), borrowed(sky.obstructions),
        ),
        Counts(
            borrowed(counts.sharp), borrowed(counts.soft), counts.sharp_side, counts.soft_side, counts.classes,
            counts.sharp_classes, counts.bounces, counts.members, counts.diffuse_well, counts.diffuse_boot,
            counts.distance, counts.flat,
            counts.split, counts.glow, counts.limit, borrowed(counts.balance), borrowed(counts.fan_a),
            borrowed(counts.fan_b), borrowed(counts.fan_w), borrowed(counts.fan_far), borrowed(counts.fan_near),
        ),
        Light(
            light.mode, light.side, borrowed(light.steps), borrowed(light.flux), borrowed(light.span),
            borrowed(light.suns), borrowed(light.rays),
        ),
    )  # fmt: skip


@kernel
def trace(sky: Skylight, counts: Counts, light: Light, seed: np.uint64, count: int) -> None:
    """Trace ``count`` rays of one batch.

    Sources are gone through in order, with as many rays each as their probability says (systematic sampling), and the
    places on the cover follow an evenly spread sequence.
    """
    scene = uncounted(sky, counts, light)
    sky, light, geo = scene.sky, scene.light, scene.sky.geometry
    base = mix(seed)
    state = stream(base, ZERO)
    shift, state = uniform(state)
    s1, state = uniform(state)
    s2, state = uniform(state)
    s3, state = uniform(state)
    s4, state = uniform(state)
    s5, state = uniform(state)
    s6, state = uniform(state)
    source = ZERO
    for i in range(count):
        key = mix(base + np.uint64(i) * RAY_STEP)
        state = stream(key, ONE)
        pick = even(s6, i, A6)
        if light.mode == GIVEN:
            r = light.rays
            ray = Ray(r[i, 0], r[i, 1], r[i, 2], r[i, 6], r[i, 7], r[i, 8])
            admit(scene, key, source, ray, (r[i, 3], r[i, 4], r[i, 5]), r[i, 9], -ONE, pick, state)
            continue
        place = (i + shift) / count
        source = source_at(light, place, source)
        dx, dy, dz, state = direction(light, source, i, s4, s5, state)
        if dz < 0.0:
            dx, dy = geo[TURN_C] * dx + geo[TURN_S] * dy, geo[TURN_C] * dy - geo[TURN_S] * dx
            x, y, z, nx, ny, nz, area, facet = land(
                geo, sky.facets, dx, dy, dz, even(s1, i, A1), even(s2, i, A2), even(s3, i, A3)
            )
            if area > 0.0 and not shaded(sky.obstructions, x, y, z, dx, dy, dz):
                admit(scene, key, source, Ray(x, y, z, dx, dy, dz), (nx, ny, nz), area, facet, pick, state)
