"""The cover: light falls in from outside, and light that comes back up meets it from below."""

import math
from typing import Final

import numpy as np

from analysis.simulate.kernels.arrays import GRAIN, HAZE, KIND, MIRROR, NONE, WIDE, Frame, Load, Ray, Scene, Skylight
from analysis.simulate.kernels.counting import NO, ZERO
from analysis.simulate.kernels.fan import read_fan, score_fan, turn_fan
from analysis.simulate.kernels.frames import Turned, frame_of, inward
from analysis.simulate.kernels.jit import jit, part
from analysis.simulate.kernels.maps import cosine_lobe
from analysis.simulate.kernels.optics import Place, dirt, entry_of, lens_finish, lens_hit, lens_place, lens_sample

HAZE_SAMPLES: Final = 4


@jit
def through_cover(
    sky: Skylight, from_above: bool, ray: Ray, nx: float, ny: float, nz: float, pick: float, state: np.uint64
) -> Turned:
    """Pass the cover at a point with outward normal n."""
    f = frame_of(nx, ny, nz)
    lx = ray.dx * f.ex + ray.dy * f.ey + ray.dz * f.ez
    ly = ray.dx * f.fx + ray.dy * f.fy + ray.dz * f.fz
    cosine = abs(ray.dx * nx + ray.dy * ny + ray.dz * nz)
    table = sky.above if from_above else sky.below
    ox, oy, through, w, state = lens_hit(sky, sky.entry, table, from_above, lx, ly, cosine, pick, state)
    oz = math.sqrt(max(1e-12, 1.0 - ox * ox - oy * oy))
    if through == from_above:  # goes on, or turns back, inwards
        oz = -oz
    dx, dy, dz = inward(f, ox, oy, oz)
    return dx, dy, dz, through, w, state


@part
def haze_fan(
    scene: Scene, load: Load, value: float, x: float, y: float, z: float, frame: Frame, state: np.uint64
) -> np.uint64:
    """Score what the cosine lobe of a hazy lens at (x, y, z) sends straight through the aperture, by a few samples."""
    counts = scene.counts
    few = min(counts.split, HAZE_SAMPLES)
    for k in range(few):
        counts.fan_a[k], counts.fan_b[k], state = cosine_lobe(state)
        counts.fan_w[k] = 1.0
    score_fan(scene, few, load.source, load.boot, load.wall, value, x, y, z, frame)
    return state


@jit
def enter(
    scene: Scene,
    source: int,
    facet: int,
    area: float,
    ray: Ray,
    nx: float,
    ny: float,
    nz: float,
    pick: float,
    state: np.uint64,
) -> Turned:
    """Pass a prismatic cover from outside; ``facet`` >= 0 reads the table that was made for this sun and facet.

    One sample goes on into the skylight. Without an exit lens, a fan is scored as well: what goes straight through the
    aperture.
    """
    sky, counts = scene.sky, scene.counts
    lens = sky.entry
    f = frame_of(nx, ny, nz)
    lx = ray.dx * f.ex + ray.dy * f.ey + ray.dz * f.ez
    ly = ray.dx * f.fx + ray.dy * f.fy + ray.dz * f.fz
    cosine = -(ray.dx * nx + ray.dy * ny + ray.dz * nz)
    at = Place(lx, ly, facet, False, 1.0, 1.0, 1.0, 0.0, lens[GRAIN])
    mirrored = False
    nodes = sky.spots
    if facet < 0:
        at, state = lens_place(lens, lx, ly, cosine, state)
        mirrored = lens[MIRROR] != 0.0
        nodes = sky.wide if lens[WIDE] != 0.0 else sky.nodes
    first = entry_of(sky.above, counts.split, pick)
    p, q = nodes[at.row, 0], nodes[at.row, 1]
    qx, qy, through, w = lens_sample(sky.above, p, q, at, first)
    ox, oy = at.c * qx - at.s * qy, at.s * qx + at.c * qy
    if mirrored:
        ox = -ox
    ox, oy, w, state = lens_finish(lens, True, cosine, ox, oy, through, w, state)
    if sky.exit[KIND] == NONE:
        passed = read_fan(counts, counts.split, sky.above, at, first) / counts.split
        turn_fan(counts, counts.split, at, p, q, mirrored)
        value = area * dirt(lens, cosine)
        clear = value * (1.0 - lens[HAZE])
        score_fan(scene, counts.split, source, ZERO, ZERO, clear, ray.x, ray.y, ray.z, f)
        if lens[HAZE] > 0.0:
            load = Load(source, area, 0.0, 1.0, ZERO, ZERO, NO)
            state = haze_fan(scene, load, value * lens[HAZE] * passed, ray.x, ray.y, ray.z, f, state)
    oz = math.sqrt(max(1e-12, 1.0 - ox * ox - oy * oy))
    dx, dy, dz = inward(f, ox, oy, -oz if through else oz)
    return dx, dy, dz, through, w, state
