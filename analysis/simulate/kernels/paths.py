"""Whole paths: from the sun or the sky through cover, well and exit lens to the far and the near field."""

import math
from typing import Final

import numpy as np
from numpy.typing import NDArray

from analysis.simulate.kernels.aiming import cover_aim, enter_aim, exit_aim, exit_below, exit_lobe, see_sky
from analysis.simulate.kernels.arrays import (
    AREA,
    BACK,
    BOOT,
    CUT,
    DIFFUSING,
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
    Aims,
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
from analysis.simulate.kernels.geometry import land, outline_point, under_cover
from analysis.simulate.kernels.jit import borrowed, jit, kernel, part
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
    if scene.aims.on and scene.sky.exit[KIND] == TABLE:
        through, ox, oy, v, state = exit_aim(scene, load, 0.0 if load.seen else load.weight * load.area, ray, state)
    elif scene.aims.on and scene.sky.exit[KIND] == DIFFUSING:
        through, ox, oy, v, state = exit_lobe(scene, load, 0.0 if load.seen else load.weight * load.area, ray, state)
    elif load.seen or scene.sky.exit[KIND] != TABLE:
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
    """Follow one ray from inside the cover, or up from the aperture, until it is out, back, absorbed, or cut."""
    sky, balance, unit = scene.sky, scene.counts.balance, load.unit
    event = TWO
    zone = ZERO  # 0 under the cover, 1 well, 2 boot
    last = TWO if sky.geometry[BOOT] > 0.0 else ONE
    if scene.aims.back:
        zone = last
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
            seen = NO
            if scene.aims.on and scene.aims.entry.shape[0] > 0:
                seen = sky.exit[KIND] == NONE
                dx, dy, dz, through, v, state = cover_aim(scene, load, ray, nx, ny, nz, state)
            else:
                dx, dy, dz, through, v, state = through_cover(sky, NO, ray, nx, ny, nz, pick, state)
            ray = Ray(x, y, z, dx, dy, dz)
            w = load.weight * v
            balance[LENS] += load.weight * (1.0 - v) * unit
            load = Load(load.source, load.area, unit, w, load.boot, load.wall, seen)
            if through:
                balance[BACK] += w * unit
                if scene.aims.back:
                    see_sky(scene, load.source, w * unit, dx, dy, dz)
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
    if scene.aims.on and scene.aims.entry.shape[0] > 0:
        dx, dy, dz, through, w, state = enter_aim(scene, source, area, ray, nx, ny, nz, state)
    elif prismatic:
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


@part
def rise(scene: Scene, key: np.uint64, target: int, x: float, y: float, worth: float, state: np.uint64) -> None:
    """Follow a ray from a sensor through the aperture at (x, y) and up; ``worth``: candela per cd/m² of its sky."""
    where = scene.aims.where
    ux, uy, uz, d = float(where[0, target]), float(where[1, target]), float(where[2, target]), float(where[3, target])
    vx, vy, vz = ux, uy, uz
    if d > 0.0:
        vx, vy, vz = d * ux - x, d * uy - y, d * uz
        square = vx * vx + vy * vy + vz * vz
        far = math.sqrt(square)
        vx, vy, vz = vx / far, vy / far, vz / far
        worth *= (ux * vx + uy * vy + uz * vz) * d * d / square
    worth *= -vz
    ray = Ray(x, y, 0.0, -vx, -vy, -vz)
    passed, ox, oy, w, state = exit_below(scene, ray, state)
    if passed and w > 0.0:
        up = math.sqrt(max(1e-12, 1.0 - ox * ox - oy * oy))
        follow(scene, key, Ray(x, y, 0.0, ox, oy, up), Load(target, 0.0, worth, w, ZERO, ZERO, NO))


@jit
def uncounted(sky: Skylight, counts: Counts, light: Light, aims: Aims) -> Scene:
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
        Aims(
            aims.on, aims.back, borrowed(aims.where), borrowed(aims.entry), borrowed(aims.exit), aims.entry_up,
            aims.exit_up, borrowed(aims.wanted), borrowed(aims.reach), borrowed(aims.found), borrowed(aims.state),
        ),
    )  # fmt: skip


@kernel
def trace(
    sky: Skylight, counts: Counts, light: Light, aims: Aims, seed: np.uint64, count: int, first: int, step: int
) -> None:
    """Trace rays ``first``, ``first + step``, and so on of the ``count`` rays of one batch.

    With other parts of the tables for each ``first`` < ``step``, the whole batch is traced through parts of them only.
    Sources are gone through in order, with as many rays each as their probability says (systematic sampling), and the
    places on the cover follow an evenly spread sequence.
    """
    scene = uncounted(sky, counts, light, aims)
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
    for i in range(first, count, step):
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


@kernel
def trace_back(
    sky: Skylight, counts: Counts, light: Light, aims: Aims, seed: np.uint64, rays: NDArray[np.int64]
) -> None:
    """Trace ``rays[j]`` rays of one batch from each sensor j back to the sky; ``light.flux`` is luminance [cd/m²].

    What passes one way through our sheets and walls passes the other way as well (Helmholtz reciprocity), so the mean
    luminance that such rays meet, times the aperture's area as the sensor sees it, is the sensor's candela.
    """
    scene = uncounted(sky, counts, light, aims)
    geo = scene.sky.geometry
    base = mix(seed)
    for j in range(rays.shape[0]):
        own = mix(base + np.uint64(j + 1) * RAY_STEP)
        state = stream(own, ZERO)
        s1, state = uniform(state)
        s2, state = uniform(state)
        for i in range(rays[j]):
            key = mix(own + np.uint64(i) * RAY_STEP)
            x, y = outline_point(geo, even(s1, i, A1), even(s2, i, A2))
            rise(scene, key, j, x, y, geo[AREA] / rays[j], stream(key, ONE))
