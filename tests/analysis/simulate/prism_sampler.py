"""A small, separate ray tracer of a prismatic sheet: what the lens tables are checked against.

The sheet's flat face is z = 0, the solid below it; pyramids point down, their points at z = -thickness.
"""

import math

import numba
import numpy as np

from analysis.simulate.components import Lens


@numba.njit(cache=True)
def fresnel(c, n1, n2):
    """Unpolarised reflectance and the cosine behind the surface (negative: total reflection)."""
    s2 = (n1 / n2) ** 2 * (1.0 - c * c)
    if s2 >= 1.0:
        return 1.0, -1.0
    t = math.sqrt(1.0 - s2)
    rs = (n1 * c - n2 * t) / (n1 * c + n2 * t)
    rp = (n2 * c - n1 * t) / (n2 * c + n1 * t)
    return 0.5 * (rs * rs + rp * rp), t


@numba.njit(cache=True)
def meet(dx, dy, dz, nx, ny, nz, n1, n2):
    """Reflect or refract at a face whose normal points against the ray."""
    c = -(dx * nx + dy * ny + dz * nz)
    r, t = fresnel(c, n1, n2)
    if np.random.random() < r:
        return dx + 2 * c * nx, dy + 2 * c * ny, dz + 2 * c * nz, False
    k = n1 / n2
    q = k * c - t
    return k * dx + q * nx, k * dy + q * ny, k * dz + q * nz, True


@numba.njit(cache=True)
def at_facet(dx, dy, dz, gx, gy, gz, n1, n2, blur):
    """A facet with geometric normal g (against the ray) whose true normal is tilted at random."""
    for _ in range(20):
        a, b = np.random.normal(0.0, blur), np.random.normal(0.0, blur)
        h = math.sqrt(gx * gx + gz * gz)
        ux, uz = gz / h, -gx / h
        vx, vy, vz = gy * uz, gz * ux - gx * uz, -gy * ux
        nx, ny, nz = gx + a * ux + b * vx, gy + b * vy, gz + a * uz + b * vz
        k = 1.0 / math.sqrt(nx * nx + ny * ny + nz * nz)
        nx, ny, nz = nx * k, ny * k, nz * k
        if dx * nx + dy * ny + dz * nz >= 0.0:
            continue
        ox, oy, oz, through = meet(dx, dy, dz, nx, ny, nz, n1, n2)
        side = ox * gx + oy * gy + oz * gz
        if (side < 0.0) == through:
            return ox, oy, oz, through
    return dx, dy, dz, True


@numba.njit(cache=True)
def one_ray(dx, dy, dz, from_prisms, n, pitch, thick, tan, blur, absorb):
    half = pitch / 2
    norm = 1.0 / math.sqrt(1.0 + tan * tan)
    x, y = (np.random.random() - 0.5) * pitch, (np.random.random() - 0.5) * pitch
    path = 0.0
    if from_prisms:
        z, inside = -thick - 1e-9, False
    else:
        z = 0.0
        dx, dy, dz, inside = meet(dx, dy, dz, 0.0, 0.0, 1.0, 1.0, n)
        if not inside:
            return dx, dy, dz, 1.0
    for _ in range(1000):
        if not inside and z < -thick and dz < 0.0:
            return dx, dy, dz, math.exp(-absorb * path)
        cell_t, wx, wy = 1e30, 0.0, 0.0
        if dx != 0.0:
            cell_t, wx = (math.copysign(half, dx) - x) / dx, math.copysign(pitch, dx)
        if dy != 0.0:
            t = (math.copysign(half, dy) - y) / dy
            if t < cell_t:
                cell_t, wx, wy = t, 0.0, math.copysign(pitch, dy)
        enter, leave, fe, fl = -1e30, 1e30, -1, -1
        for k in range(4):  # outward normals of the solid: (±tan, 0, -1), (0, ±tan, -1), times norm
            sx = (tan if k == 0 else -tan if k == 1 else 0.0) * norm
            sy = (tan if k == 2 else -tan if k == 3 else 0.0) * norm
            rate = dx * sx + dy * sy - dz * norm
            gap = thick * norm - (x * sx + y * sy - z * norm)
            if rate > 1e-14 and gap / rate < leave:
                leave, fl = gap / rate, k
            if rate < -1e-14 and gap / rate > enter:
                enter, fe = gap / rate, k
        if inside:
            top = -z / dz if dz > 0.0 else 1e30
            t = min(cell_t, leave, top)
            t = max(t, 0.0)
            path += t
            x, y, z = x + dx * t, y + dy * t, z + dz * t
            if t == top:
                dx, dy, dz, out = meet(dx, dy, dz, 0.0, 0.0, -1.0, n, 1.0)
                if out:
                    return dx, dy, dz, math.exp(-absorb * path)
                z = -1e-12
            elif t == cell_t:
                x, y = x - wx, y - wy
            else:
                gx = -(tan if fl == 0 else -tan if fl == 1 else 0.0) * norm
                gy = -(tan if fl == 2 else -tan if fl == 3 else 0.0) * norm
                dx, dy, dz, out = at_facet(dx, dy, dz, gx, gy, norm, n, 1.0, blur)
                x, y, z = x + 1e-10 * dx, y + 1e-10 * dy, z + 1e-10 * dz
                inside = not out
        else:
            if fe >= 0 and enter >= -1e-12 and enter < leave and enter <= cell_t:
                t = max(enter, 0.0)
                x, y, z = x + dx * t, y + dy * t, z + dz * t
                gx = (tan if fe == 0 else -tan if fe == 1 else 0.0) * norm
                gy = (tan if fe == 2 else -tan if fe == 3 else 0.0) * norm
                dx, dy, dz, into = at_facet(dx, dy, dz, gx, gy, -norm, 1.0, n, blur)
                x, y, z = x + 1e-10 * dx, y + 1e-10 * dy, z + 1e-10 * dz
                inside = into
            else:
                x, y, z = x + dx * cell_t - wx, y + dy * cell_t - wy, z + dz * cell_t
                if cell_t >= 1e29:
                    return 0.0, 0.0, 1.0, 0.0
    return dx, dy, dz, 0.0


@numba.njit(cache=True)
def many(directions, per, from_prisms, n, pitch, thick, tan, blur, absorb, seed):
    np.random.seed(seed)
    out = np.empty((len(directions), per, 3))
    weight = np.empty((len(directions), per))
    for i in range(len(directions)):
        for k in range(per):
            ox, oy, oz, w = one_ray(
                directions[i, 0], directions[i, 1], directions[i, 2], from_prisms, n, pitch, thick, tan, blur, absorb
            )
            out[i, k, 0], out[i, k, 1], out[i, k, 2], weight[i, k] = ox, oy, oz, w
    return out, weight


def sheet_samples(lens: Lens, from_prisms, directions, per_direction, rng):
    """Outgoing directions (N, M, 3) and weights (N, M) for incident directions of travel (N, 3)."""
    return many(
        np.ascontiguousarray(directions),
        per_direction,
        from_prisms,
        lens.refractive_index,
        lens.pitch_mm,
        lens.thickness_mm,
        math.tan(math.radians(lens.slope_deg)),
        math.radians(lens.blur_deg),
        lens.absorption_per_mm,
        int(rng.integers(2**31)),
    )
