"""From the cover down to the aperture and back up: mirror wells in one step, others wall by wall."""

from typing import Final

import numpy as np

from analysis.simulate.kernels.arrays import (
    AX,
    AY,
    BOOT,
    CUT,
    HEIGHT,
    LAMBERT,
    RECTANGLE,
    RHO,
    ROULETTE,
    SHAPE,
    SPREAD,
    WALL,
    Floats,
    Load,
    Numbers,
    Ray,
    Scene,
)
from analysis.simulate.kernels.exits import glow
from analysis.simulate.kernels.geometry import bounce, mirror_box, mirror_cylinder, next_wall
from analysis.simulate.kernels.jit import jit
from analysis.simulate.kernels.maps import uniform

LOW: Final = 0.05
RAISED: Final = 0.1
BOOT_ZONE: Final = 2


@jit
def roulette(w: float, balance: Floats, unit: float, state: np.uint64) -> tuple[float, np.uint64]:
    """Let a weak ray die or grow, fairly (Russian roulette)."""
    a, state = uniform(state)
    if a * RAISED < w:
        balance[ROULETTE] += (w - RAISED) * unit
        return RAISED, state
    balance[ROULETTE] += w * unit
    return 0.0, state


@jit
def mirror_well(geo: Numbers, low: float, high: float, ray: Ray) -> tuple[Ray, int]:
    """Straight through a perfectly specular zone, low <= z <= high; returns the reflections on the way."""
    goal = low if ray.dz < 0.0 else high
    length = (goal - ray.z) / ray.dz
    if geo[SHAPE] == RECTANGLE:
        x, dx, n = mirror_box(geo[AX], ray.x, ray.dx, length)
        y, dy, m = mirror_box(geo[AY], ray.y, ray.dy, length)
        return Ray(x, y, goal, dx, dy, ray.dz), n + m
    x, y, dx, dy, n = mirror_cylinder(geo[AX], ray.x, ray.y, ray.dx, ray.dy, length)
    return Ray(x, y, goal, dx, dy, ray.dz), n


@jit
def rough_well(
    scene: Scene, wall: Numbers, zone: int, low: float, high: float, ray: Ray, load: Load, state: np.uint64
) -> tuple[Ray, Load, np.uint64]:
    """Wall by wall through a zone that scatters; weight 0 when the light died.

    What a Lambertian bounce sends straight to the aperture is scored at once; ``seen`` says so to the ray that goes on.
    """
    balance = scene.counts.balance
    x, y, z, dx, dy, dz = ray.x, ray.y, ray.z, ray.dx, ray.dy, ray.dz
    w, m, n, seen = load.weight, load.boot, load.wall, load.seen
    while True:
        t, nx, ny = next_wall(scene.sky.geometry, x, y, dx, dy)
        goal = low if dz < 0.0 else high
        if abs(dz) * t >= abs(goal - z):
            t = (goal - z) / dz if dz != 0.0 else 0.0
            x, y, z = x + dx * t, y + dy * t, goal
            break
        if m + n >= scene.counts.limit:
            balance[CUT] += w * load.unit
            w = 0.0
            break
        x, y, z = x + dx * t, y + dy * t, z + dz * t
        balance[WALL] += w * (1.0 - wall[RHO]) * load.unit
        w *= wall[RHO]
        if zone == BOOT_ZONE:
            m += 1
        else:
            n += 1
        if wall[LAMBERT] > 0.0:
            here = Load(load.source, load.area, load.unit, w, m, n, False)
            state = glow(scene, here, w * load.area * wall[LAMBERT], x, y, z, nx, ny, state)
        dx, dy, dz, seen, state = bounce(wall, dx, dy, dz, nx, ny, state)
        if w < LOW:
            w, state = roulette(w, balance, load.unit, state)
            if w == 0.0:
                break
    return Ray(x, y, z, dx, dy, dz), Load(load.source, load.area, load.unit, w, m, n, seen), state


@jit
def cross(scene: Scene, zone: int, ray: Ray, load: Load, state: np.uint64) -> tuple[Ray, Load, np.uint64]:
    """Cross one zone (1 well, 2 boot), down or up; weight 0 when the light died."""
    sky, counts = scene.sky, scene.counts
    geo, balance = sky.geometry, counts.balance
    low, high, wall = geo[BOOT], geo[HEIGHT], sky.well
    if zone == BOOT_ZONE:
        low, high, wall = 0.0, geo[BOOT], sky.boot
    if wall[LAMBERT] > 0.0 or wall[SPREAD] > 0.0:
        return rough_well(scene, wall, zone, low, high, ray, load, state)
    w, m, n, seen, unit = load.weight, load.boot, load.wall, load.seen, load.unit
    if abs(ray.dz) < 1e-9:
        balance[WALL] += w * unit
        return ray, Load(load.source, load.area, unit, 0.0, m, n, seen), state
    ray, count = mirror_well(geo, low, high, ray)
    if m + n + count > counts.limit:
        keep = wall[RHO] ** (counts.limit - m - n)
        balance[WALL] += w * (1.0 - keep) * unit
        balance[CUT] += w * keep * unit
        return ray, Load(load.source, load.area, unit, 0.0, m, n, seen), state
    if count > 0:
        v = sky.powers[zone - 1, count] if count < sky.powers.shape[1] else wall[RHO] ** count
        balance[WALL] += w * (1.0 - v) * unit
        w *= v
        seen = False
    if zone == BOOT_ZONE:
        m += count
    else:
        n += count
    return ray, Load(load.source, load.area, unit, w, m, n, seen), state
