"""The aperture: an exit lens or none, and what a diffuse wall sends straight to it."""

import math
from typing import Final

import numpy as np

from analysis.simulate.kernels.aiming import Left, exit_aim, exit_lobe, glow_aim
from analysis.simulate.kernels.arrays import (
    AX,
    AY,
    HAZE,
    KIND,
    MIRROR,
    NONE,
    RECTANGLE,
    SHAPE,
    TABLE,
    WEIGHT_SCALE,
    WIDE,
    Frame,
    Load,
    Ray,
    Scene,
)
from analysis.simulate.kernels.counting import ONE, ZERO, score
from analysis.simulate.kernels.cover import haze_fan
from analysis.simulate.kernels.fan import read_fan, score_fan, turn_fan
from analysis.simulate.kernels.jit import jit
from analysis.simulate.kernels.maps import cosine_lobe, uniform
from analysis.simulate.kernels.optics import (
    Place,
    dirt,
    entry_of,
    from_pattern,
    lens_hit,
    lens_place,
    lens_sample,
    ring_place,
)

RING: Final = 0.005
"""How far from its cosine of incidence a ring is used; the sun's disc reaches as far at grazing incidence."""


@jit
def exit_plain(scene: Scene, load: Load, value: float, ray: Ray, state: np.uint64) -> Left:
    """Pass an exit lens of any kind by one sample, scored with its weight."""
    sky = scene.sky
    pick, state = uniform(state)
    ox, oy, through, w, state = lens_hit(sky, sky.exit, sky.under, True, ray.dx, ray.dy, -ray.dz, pick, state)
    if through:
        oz = -math.sqrt(max(1e-12, 1.0 - ox * ox - oy * oy))
        score(scene, load.source, load.boot, load.wall, value * w, Ray(ray.x, ray.y, 0.0, ox, oy, oz))
    return through, ox, oy, w, state


@jit
def exit_fan(scene: Scene, load: Load, value: float, ray: Ray, state: np.uint64) -> Left:
    """Pass a prismatic exit lens: a fan of samples is scored, the first decides what is reflected."""
    sky, counts = scene.sky, scene.counts
    lens = sky.exit
    pick, state = uniform(state)
    at, state = lens_place(lens, ray.dx, ray.dy, -ray.dz, state)
    table = sky.under
    nodes = sky.wide if lens[WIDE] != 0.0 else sky.nodes
    if abs(ray.dz + sky.ring_cosine) < RING:
        table, nodes = sky.ring, sky.ring_nodes
        r, state = uniform(state)
        at = ring_place(at, table.shape[0], r)
    first = entry_of(table, counts.split, pick)
    p, q = nodes[at.row, 0], nodes[at.row, 1]
    qx, qy, through, w = lens_sample(table, p, q, at, first)
    ox, oy = from_pattern(lens, qx, qy, at.c, at.s)
    left = dirt(lens, -ray.dz)
    if through:
        w *= left
    value *= left
    passed = read_fan(counts, counts.split, table, at, first) / counts.split
    turn_fan(counts, counts.split, at, p, q, lens[MIRROR] != 0.0)
    flat = Frame(1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0)
    clear = value * (1.0 - lens[HAZE])
    score_fan(scene, counts.split, load.source, load.boot, load.wall, clear, ray.x, ray.y, 0.0, flat)
    if lens[HAZE] > 0.0:
        state = haze_fan(scene, load, value * lens[HAZE] * passed, ray.x, ray.y, 0.0, flat, state)
    return through, ox, oy, w, state


@jit
def glow(
    scene: Scene, load: Load, value: float, x: float, y: float, z: float, nx: float, ny: float, state: np.uint64
) -> np.uint64:
    """Score what a Lambertian bounce at (x, y, z) of a wall with inward normal n sends straight to the aperture.

    Only the lower half of the lobe is sampled, with half the weight: the upper half is its mirror image. Into an open
    aperture goes a whole fan; a lens there gets a few samples, each with a fan of its own.
    """
    sky, counts, geo = scene.sky, scene.counts, scene.sky.geometry
    if scene.aims.back:
        return state
    if scene.aims.on and sky.exit[KIND] == NONE:
        glow_aim(scene, load, value, x, y, z, nx, ny)
        return state
    if sky.exit[KIND] == NONE:
        size = counts.split if load.boot + load.wall < 2 else max(ONE, counts.split // 4)
        pick, state = uniform(state)
        first = int(pick * (sky.lobe.shape[1] - size + 1))
        read_fan(counts, size, sky.lobe, Place(0.0, 0.0, ZERO, False, 1.0, 1.0, 1.0, 0.0, WEIGHT_SCALE), first)
        wall = Frame(-ny, nx, 0.0, 0.0, 0.0, 1.0, -nx, -ny, 0.0)
        score_fan(scene, size, load.source, load.boot, load.wall, 0.5 * value, x, y, z, wall)
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
            ray = Ray(ax, ay, 0.0, dx, dy, dz)
            if scene.aims.on and sky.exit[KIND] == TABLE:
                _, _, _, _, state = exit_aim(scene, load, share, ray, state)
            elif scene.aims.on:
                _, _, _, _, state = exit_lobe(scene, load, share, ray, state)
            elif sky.exit[KIND] == TABLE:
                _, _, _, _, state = exit_fan(scene, load, share, ray, state)
            else:
                _, _, _, _, state = exit_plain(scene, load, share, ray, state)
    return state
