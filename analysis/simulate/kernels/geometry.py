"""Covers (flat, pyramid, dome) and wells (box, cylinder) in closed form.

Cover and well together are convex, so a ray inside meets exactly one surface, and light that leaves the cover upwards
never comes back.
"""

import math

import numpy as np

from analysis.simulate.kernels.arrays import (
    AREA,
    AX,
    AY,
    CAP_CENTRE,
    CAP_RADIUS,
    COVER,
    FACET_AREA,
    FLAT,
    HEIGHT,
    LAMBERT,
    NX,
    NY,
    NZ,
    OFFSET,
    PYRAMID,
    RECTANGLE,
    RISE,
    SHAPE,
    SPREAD,
    Floats,
    Numbers,
)
from analysis.simulate.kernels.jit import jit
from analysis.simulate.kernels.maps import circle, cosine_lobe, uniform


@jit
def outline_point(geo: Numbers, a: float, b: float) -> tuple[float, float]:
    """A point uniform in the aperture's outline, from two numbers in [0, 1)."""
    if geo[SHAPE] == RECTANGLE:
        return (2.0 * a - 1.0) * geo[AX], (2.0 * b - 1.0) * geo[AY]
    r = geo[AX] * math.sqrt(a)
    c, s = circle(b)
    return r * c, r * s


@jit
def facet_point(geo: Numbers, f: int, a: float, b: float) -> tuple[float, float, float]:
    """A point uniform on facet f (0 east, 1 north, 2 west, 3 south) of the pyramid."""
    r = math.sqrt(a)  # share of the way from the apex to the eave
    along = 2.0 * b - 1.0
    z = geo[HEIGHT] + geo[RISE] * (1.0 - r)
    sign = 1.0 if f < 2 else -1.0
    if f % 2 == 0:
        return sign * r * geo[AX], r * along * geo[AY], z
    return r * along * geo[AX], sign * r * geo[AY], z


@jit
def land(
    geo: Numbers, facets: Floats, dx: float, dy: float, dz: float, a: float, b: float, c: float
) -> tuple[float, float, float, float, float, float, float, int]:
    """Let a beam of direction d (dz < 0) fall on the cover, from three numbers in [0, 1).

    Returns the point, the cover's outward normal there, the projected area [m²] that this ray stands for, and the
    facet.
    """
    if geo[COVER] == FLAT:
        x, y = outline_point(geo, a, b)
        return x, y, geo[HEIGHT], 0.0, 0.0, 1.0, -dz * geo[AREA], 0
    if geo[COVER] == PYRAMID:
        total = 0.0
        for f in range(4):
            total += facets[f, FACET_AREA] * max(0.0, -(dx * facets[f, NX] + dy * facets[f, NY] + dz * facets[f, NZ]))
        left = c * total
        chosen = 3
        for f in range(4):
            left -= facets[f, FACET_AREA] * max(0.0, -(dx * facets[f, NX] + dy * facets[f, NY] + dz * facets[f, NZ]))
            if left < 0.0:
                chosen = f
                break
        x, y, z = facet_point(geo, chosen, a, b)
        return x, y, z, facets[chosen, NX], facets[chosen, NY], facets[chosen, NZ], total, chosen
    # spherical cap: uniform over its area (Archimedes: uniform in z), weighted with the cosine
    z = geo[HEIGHT] + geo[RISE] * a
    nz = (z - geo[CAP_CENTRE]) / geo[CAP_RADIUS]
    r = math.sqrt(max(0.0, 1.0 - nz * nz))
    c, s = circle(b)
    nx, ny = r * c, r * s
    share = max(0.0, -(dx * nx + dy * ny + dz * nz)) * 2.0 * math.pi * geo[CAP_RADIUS] * geo[RISE]
    return nx * geo[CAP_RADIUS], ny * geo[CAP_RADIUS], z, nx, ny, nz, share, 0


@jit
def under_cover(
    geo: Numbers, facets: Floats, x: float, y: float, z: float, dx: float, dy: float, dz: float
) -> tuple[bool, float, float, float, float, float, float]:
    """Follow a ray inside the cover (z >= well height) to the cover or down to the well.

    Returns whether it met the cover, the point, and the cover's outward normal there.
    """
    down = 1e30
    if dz < 0.0:
        down = (geo[HEIGHT] - z) / dz
    if geo[COVER] == FLAT:
        return dz > 0.0, x, y, geo[HEIGHT], 0.0, 0.0, 1.0
    if geo[COVER] == PYRAMID:
        nearest = 1e30
        chosen = -1
        for f in range(4):
            rate = dx * facets[f, NX] + dy * facets[f, NY] + dz * facets[f, NZ]
            if rate > 1e-12:
                gap = facets[f, OFFSET] - (x * facets[f, NX] + y * facets[f, NY] + z * facets[f, NZ])
                t = max(0.0, gap) / rate
                if t < nearest:
                    nearest = t
                    chosen = f
        if chosen < 0 or down <= nearest:
            return False, x + dx * down, y + dy * down, geo[HEIGHT], 0.0, 0.0, 1.0
        f = chosen
        return True, x + dx * nearest, y + dy * nearest, z + dz * nearest, facets[f, NX], facets[f, NY], facets[f, NZ]
    h = z - geo[CAP_CENTRE]
    half = x * dx + y * dy + h * dz
    rest = geo[CAP_RADIUS] * geo[CAP_RADIUS] - (x * x + y * y + h * h)
    t = -half + math.sqrt(max(0.0, half * half + rest))
    if down <= t:
        return False, x + dx * down, y + dy * down, geo[HEIGHT], 0.0, 0.0, 1.0
    x, y, h = x + dx * t, y + dy * t, h + dz * t
    r = 1.0 / geo[CAP_RADIUS]
    return True, x, y, h + geo[CAP_CENTRE], x * r, y * r, h * r


@jit
def mirror_box(half: float, x: float, d: float, length: float) -> tuple[float, float, int]:
    """One axis of a mirror box, unfolded: place and direction after ``length`` of path, and reflections on the way."""
    u = (x + d * length) / (2.0 * half) + 0.5
    cell = math.floor(u)
    u -= cell
    n = int(abs(cell))
    if n % 2 == 1:
        u = 1.0 - u
        d = -d
    return (u - 0.5) * 2.0 * half, d, n


@jit
def mirror_cylinder(
    radius: float, x: float, y: float, dx: float, dy: float, length: float
) -> tuple[float, float, float, float, int]:
    """A mirror cylinder in closed form: all chords are equal, all turns about the axis too.

    Returns place and direction after ``length`` of three-dimensional path, and the number of reflections.
    """
    speed = math.sqrt(dx * dx + dy * dy)
    if speed < 1e-12:
        return x, y, dx, dy, 0
    left = speed * length
    ex, ey = dx / speed, dy / speed
    b = x * ex + y * ey
    root = math.sqrt(max(0.0, b * b + radius * radius - x * x - y * y))
    first = max(0.0, root - b)
    if first >= left:
        return x + ex * left, y + ey * left, dx, dy, 0
    x, y = x + ex * first, y + ey * first
    left -= first
    chord = max(2.0 * root, 1e-9 * radius)
    more = int(left / chord)  # whole chords after the first reflection
    out = 2.0 * (ex * x + ey * y) / (radius * radius)
    ex, ey = ex - out * x, ey - out * y
    if more > 0:
        nx, ny = x + ex * chord, y + ey * chord
        c = (x * nx + y * ny) / (radius * radius)
        s = (x * ny - y * nx) / (radius * radius)
        pc, ps = 1.0, 0.0
        k = more
        while k > 0:  # (c + is) to the power `more`, by squaring
            if k % 2 == 1:
                pc, ps = pc * c - ps * s, pc * s + ps * c
            c, s = c * c - s * s, 2.0 * c * s
            k //= 2
        norm = 1.0 / math.sqrt(pc * pc + ps * ps)
        pc, ps = pc * norm, ps * norm
        x, y = pc * x - ps * y, ps * x + pc * y
        ex, ey = pc * ex - ps * ey, ps * ex + pc * ey
        left -= more * chord
    return x + ex * left, y + ey * left, ex * speed, ey * speed, more + 1


@jit
def next_wall(geo: Numbers, x: float, y: float, dx: float, dy: float) -> tuple[float, float, float]:
    """Path to the well's wall and the wall's inward normal (horizontal) there."""
    if geo[SHAPE] == RECTANGLE:
        tx = 1e30
        ty = 1e30
        if abs(dx) > 1e-12:
            tx = (math.copysign(geo[AX], dx) - x) / dx
        if abs(dy) > 1e-12:
            ty = (math.copysign(geo[AY], dy) - y) / dy
        if tx < ty:
            return max(0.0, tx), -math.copysign(1.0, dx), 0.0
        return max(0.0, ty), 0.0, -math.copysign(1.0, dy)
    a = dx * dx + dy * dy
    if a < 1e-18:
        return 1e30, -1.0, 0.0
    b = x * dx + y * dy
    t = (math.sqrt(max(0.0, b * b + a * (geo[AX] * geo[AX] - x * x - y * y))) - b) / a
    t = max(0.0, t)
    nx, ny = x + dx * t, y + dy * t
    r = math.sqrt(nx * nx + ny * ny)
    return t, -nx / r, -ny / r


@jit
def bounce(
    wall: Numbers, dx: float, dy: float, dz: float, nx: float, ny: float, state: np.uint64
) -> tuple[float, float, float, bool, np.uint64]:
    """Direction after a wall with inward normal (nx, ny, 0): mirror, spread mirror, or Lambertian (then True)."""
    lambert = wall[LAMBERT]
    if lambert > 0.0:
        a, state = uniform(state)
        if a < lambert:
            p, q, state = cosine_lobe(state)
            out = math.sqrt(1.0 - p * p - q * q)
            return out * nx - p * ny, out * ny + p * nx, q, True, state
    along = 2.0 * (dx * nx + dy * ny)
    dx, dy = dx - along * nx, dy - along * ny
    spread = wall[SPREAD]
    if spread > 0.0:
        for _ in range(8):
            a, state = uniform(state)
            b, state = uniform(state)
            r = spread * math.sqrt(-2.0 * math.log(1.0 - a))
            # two axes across the mirror direction
            h = math.sqrt(dx * dx + dy * dy)
            c, s = circle(b)
            p, q = r * c, r * s
            if h > 1e-6:
                tx = dx - p * dy / h - q * dx * dz / h
                ty = dy + p * dx / h - q * dy * dz / h
                tz = dz + q * h
            else:
                tx, ty, tz = dx + p, dy + q, dz
            if tx * nx + ty * ny > 0.0:
                k = 1.0 / math.sqrt(tx * tx + ty * ty + tz * tz)
                return tx * k, ty * k, tz * k, False, state
    return dx, dy, dz, False, state
