"""What each event sends to each wanted direction, scored at once: no cells, no smoothing.

Light that leaves the aperture was last scattered by a prismatic sheet, a diffuser or a Lambertian wall. Each of these
has a density for every direction, so each ray that reaches one adds what it expects to send to every sensor (the last
event estimator; Kalos 1963, doi:10.13182/NSE63-A26481). The far field needs the direction alone; a sensor at a distance
D adds the way from the place of the event: candela "as measured" are E D² = I cos β D² / r².
"""

import math

import numpy as np

from analysis.bsdf.prism_aim import scatter_aimed
from analysis.simulate.kernels.arrays import (
    AX,
    AY,
    HAZE,
    INDEX,
    KIND,
    MIRROR,
    NONE,
    RECTANGLE,
    REFLECT,
    SHAPE,
    TABLE,
    TRANSMIT,
    TURN_C,
    TURN_S,
    Frame,
    Load,
    Numbers,
    Ray,
    Scene,
)
from analysis.simulate.kernels.counting import cell_of
from analysis.simulate.kernels.frames import Turned, frame_of, inward
from analysis.simulate.kernels.jit import part
from analysis.simulate.kernels.maps import cosine_lobe, uniform
from analysis.simulate.kernels.optics import dirt, from_pattern, lens_finish, lens_plain, lens_turn, to_pattern

Left = tuple[bool, float, float, float, np.uint64]
"""Whether light passed the exit lens, tangential cosines, weight, and the random state."""


@part
def carried(scene: Scene, source: int) -> float:
    """Light [lx] of a source's cell, of the one member that it belongs to."""
    light = scene.light
    first = light.span[source, 0]
    return light.flux[source, first] if light.span[source, 1] > first else 0.0


@part
def look(
    scene: Scene, x: float, y: float, z: float, f: Frame, c: float, s: float, lens: Numbers, up: bool, into: bool
) -> None:
    """Fill ``wanted``: the ways from (x, y, z) through the aperture to the sensors, in the pattern's frame (x, y, w).

    Worth 0 if the aperture is missed. ``into``: as the directions are inside the sheet (Snell's law at the flat face).
    """
    geo, where, wanted = scene.sky.geometry, scene.aims.where, scene.aims.wanted
    one, zero, tiny = np.float32(1.0), np.float32(0.0), np.float32(1e-9)
    x1, y1, z1 = np.float32(x), np.float32(y), np.float32(z)
    width, depth = np.float32(geo[AX] * 1.000001), np.float32(geo[AY] * 1.000001)
    rectangle = geo[SHAPE] == RECTANGLE
    ex, ey, ez = np.float32(f.ex), np.float32(f.ey), np.float32(f.ez)
    fx, fy, fz = np.float32(f.fx), np.float32(f.fy), np.float32(f.fz)
    nx, ny, nz = np.float32(f.nx), np.float32(f.ny), np.float32(f.nz)
    c1, s1 = np.float32(c), np.float32(s)
    flip, over = np.float32(-1.0 if lens[MIRROR] != 0.0 else 1.0), np.float32(1.0 if up else -1.0)
    shrink = np.float32(1.0 / lens[INDEX]) if into else one
    for j in range(where.shape[1]):
        ux, uy, uz, d = where[0, j], where[1, j], where[2, j], where[3, j]
        far = d <= zero
        vx = ux if far else d * ux - x1
        vy = uy if far else d * uy - y1
        vz = uz if far else d * uz - z1
        square = vx * vx + vy * vy + vz * vz
        per = one / np.sqrt(square)
        vx, vy, vz = vx * per, vy * per, vz * per
        worth = one if far else (ux * vx + uy * vy + uz * vz) * d * d / square
        t = z1 / max(tiny, -vz)
        qx, qy = x1 + t * vx, y1 + t * vy
        hit = (abs(qx) <= width) & (abs(qy) <= depth) if rectangle else qx * qx + qy * qy <= width * width
        a = flip * (vx * ex + vy * ey + vz * ez)
        b = vx * fx + vy * fy + vz * fz
        h = vx * nx + vy * ny + vz * nz
        a, b = (c1 * a + s1 * b) * shrink, (c1 * b - s1 * a) * shrink
        wanted[0, j] = a
        wanted[1, j] = b
        wanted[2, j] = -np.sqrt(max(zero, one - a * a - b * b)) if into else over * h
        wanted[3, j] = worth if hit & (vz < -tiny) & (h < zero) else zero


@part
def sheet_aim(
    scene: Scene, entry: bool, many: int, value: float, ray: Ray, f: Frame, state: np.uint64
) -> tuple[float, float, bool, float, np.uint64]:
    """Let a ray meet a prismatic sheet and score it in the first ``many`` directions; one sample goes on.

    ``value``: what it carries [lm]. Returns tangential cosines in the sheet's frame, whether the sample goes on along
    the frame's normal, its weight, and the random state.
    """
    aims, sky = scene.aims, scene.sky
    lens, sheet, up = (sky.entry, aims.entry, aims.entry_up) if entry else (sky.exit, aims.exit, aims.exit_up)
    c, s, state = lens_turn(lens, state)
    if many > 0:
        look(scene, ray.x, ray.y, ray.z, f, c, s, lens, up, up)
    lx = ray.dx * f.ex + ray.dy * f.ey + ray.dz * f.ez
    ly = ray.dx * f.fx + ray.dy * f.fy + ray.dz * f.fz
    lz = ray.dx * f.nx + ray.dy * f.ny + ray.dz * f.nz
    px, py = to_pattern(lens, lx, ly, c, s)
    over = 1.0 if up else -1.0
    aims.state[0] = state
    qx, qy, qw, w = scatter_aimed(
        px, py, over * lz, sheet, up, value, aims.wanted, many, aims.reach, aims.found, aims.state
    )
    ox, oy = from_pattern(lens, qx, qy, c, s)
    return ox, oy, over * qw > 0.0, w, aims.state[0]


@part
def lobe_aim(scene: Scene, value: float, ray: Ray) -> None:
    """Score a cosine lobe [lm] below the aperture at the ray's place."""
    aims = scene.aims
    flat = Frame(1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0)
    look(scene, ray.x, ray.y, 0.0, flat, 1.0, 0.0, scene.sky.exit, True, False)
    for j in range(aims.where.shape[1]):
        aims.found[j] -= value / math.pi * aims.wanted[2, j] * aims.wanted[3, j]


@part
def exit_aim(scene: Scene, load: Load, value: float, ray: Ray, state: np.uint64) -> Left:
    """Pass a prismatic exit lens: its density is scored, one sample decides what is reflected."""
    lens = scene.sky.exit
    flat = Frame(1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0)
    lumens = value * carried(scene, load.source) * dirt(lens, -ray.dz)
    place = Ray(ray.x, ray.y, 0.0, ray.dx, ray.dy, ray.dz)
    many = scene.aims.where.shape[1] if value > 0.0 else 0
    ox, oy, back, w, state = sheet_aim(scene, False, many, lumens * (1.0 - lens[HAZE]), place, flat, state)
    through = not back
    if through and many > 0 and lens[HAZE] > 0.0:
        lobe_aim(scene, lumens * lens[HAZE] * w, ray)
    if through:
        w *= dirt(lens, -ray.dz)
    return through, ox, oy, w, state


@part
def exit_lobe(scene: Scene, load: Load, value: float, ray: Ray, state: np.uint64) -> Left:
    """Pass a diffusing exit lens: its cosine lobe is scored, one sample decides what is reflected."""
    lens = scene.sky.exit
    left = dirt(lens, -ray.dz)
    if value > 0.0:
        lobe_aim(scene, value * carried(scene, load.source) * lens[TRANSMIT] * left, ray)
    a, state = uniform(state)
    ox, oy, state = cosine_lobe(state)
    both = lens[TRANSMIT] + lens[REFLECT]
    through = a * both < lens[TRANSMIT]
    return through, ox, oy, both * left if through else both, state


@part
def enter_aim(
    scene: Scene, source: int, area: float, ray: Ray, nx: float, ny: float, nz: float, state: np.uint64
) -> Turned:
    """Pass a prismatic cover from outside; into an open aperture its density is scored."""
    lens = scene.sky.entry
    f = frame_of(nx, ny, nz)
    cosine = -(ray.dx * nx + ray.dy * ny + ray.dz * nz)
    many = scene.aims.where.shape[1] if scene.sky.exit[KIND] == NONE else 0
    value = area * carried(scene, source) * dirt(lens, cosine)
    ox, oy, back, w, state = sheet_aim(scene, True, many, value, ray, f, state)
    ox, oy, w, state = lens_finish(lens, True, cosine, ox, oy, not back, w, state)
    oz = math.sqrt(max(1e-12, 1.0 - ox * ox - oy * oy))
    dx, dy, dz = inward(f, ox, oy, oz if back else -oz)
    return dx, dy, dz, not back, w, state


@part
def cover_aim(scene: Scene, load: Load, ray: Ray, nx: float, ny: float, nz: float, state: np.uint64) -> Turned:
    """Meet a prismatic cover from inside; what it reflects into an open aperture is scored."""
    lens = scene.sky.entry
    f = frame_of(nx, ny, nz)
    cosine = ray.dx * nx + ray.dy * ny + ray.dz * nz
    many = scene.aims.where.shape[1] if scene.sky.exit[KIND] == NONE else 0
    value = load.weight * load.area * carried(scene, load.source)
    ox, oy, through, w, state = sheet_aim(scene, True, many, value, ray, f, state)
    ox, oy, w, state = lens_finish(lens, False, cosine, ox, oy, through, w, state)
    oz = math.sqrt(max(1e-12, 1.0 - ox * ox - oy * oy))
    dx, dy, dz = inward(f, ox, oy, oz if through else -oz)
    return dx, dy, dz, through, w, state


@part
def glow_aim(scene: Scene, load: Load, value: float, x: float, y: float, z: float, nx: float, ny: float) -> None:
    """Score what a Lambertian bounce at (x, y, z) of a wall with inward normal n sends through an open aperture."""
    if value == 0.0:
        return
    aims = scene.aims
    wall = Frame(-ny, nx, 0.0, 0.0, 0.0, 1.0, -nx, -ny, 0.0)
    look(scene, x, y, z, wall, 1.0, 0.0, scene.sky.exit, True, False)
    lumens = value * carried(scene, load.source) / math.pi
    for j in range(aims.where.shape[1]):
        aims.found[j] -= lumens * aims.wanted[2, j] * aims.wanted[3, j]


@part
def exit_below(scene: Scene, ray: Ray, state: np.uint64) -> Left:
    """Pass the exit lens upwards, by one sample; see `paths.trace_back`."""
    lens = scene.sky.exit
    if lens[KIND] == TABLE:
        flat = Frame(1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0)
        ox, oy, up, w, state = sheet_aim(scene, False, 0, 0.0, ray, flat, state)
    else:
        ox, oy, up, w, state = lens_plain(lens, ray.dx, ray.dy, ray.dz, state)
    ox, oy, w, state = lens_finish(lens, False, ray.dz, ox, oy, up, w, state)
    return up, ox, oy, w, state


@part
def see_sky(scene: Scene, target: int, worth: float, dx: float, dy: float, dz: float) -> None:
    """Score the sky's luminance where a ray that runs backwards leaves the cover; below the horizon there is none."""
    if dz <= 0.0:
        return
    geo, light = scene.sky.geometry, scene.light
    x, y = geo[TURN_C] * dx - geo[TURN_S] * dy, geo[TURN_S] * dx + geo[TURN_C] * dy
    scene.aims.found[target] += worth * light.flux[cell_of(x, y, dz, light.side), 0]
