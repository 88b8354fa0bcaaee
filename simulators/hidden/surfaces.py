"""What one surface does to one ray: Fresnel, refraction, mirrors, matt walls.

Directions are unit vectors as three floats; normals point towards the side the ray comes from.
"""

import math

from simulators.hidden.compiled import compiled
from simulators.hidden.draws import State, lobe, uniform

Vector = tuple[float, float, float]


@compiled
def fresnel(cosine: float, ratio: float) -> float:
    """Reflectance of a smooth dielectric surface for unpolarised light.

    ``cosine`` of the angle of incidence, ``ratio`` of the refractive indices (incident over transmitted). 1 beyond the
    critical angle. (Born and Wolf, Principles of Optics, section 1.5.)
    """
    sine2 = ratio * ratio * (1.0 - cosine * cosine)
    if sine2 >= 1.0:
        return 1.0
    other = math.sqrt(1.0 - sine2)
    s = (ratio * cosine - other) / (ratio * cosine + other)
    p = (cosine - ratio * other) / (cosine + ratio * other)
    return 0.5 * (s * s + p * p)


@compiled
def clear_slab(cosine: float, index: float) -> float:
    """Transmittance of a clear pane with all inter-reflections inside, unpolarised light, no absorption.

    Per polarisation T = (1 - r) / (1 + r). (Duffie and Beckman, Solar Engineering, section 5.1.)
    """
    cosine = min(1.0, max(1e-6, cosine))
    inner = math.sqrt(1.0 - (1.0 - cosine * cosine) / (index * index))
    s = ((cosine - index * inner) / (cosine + index * inner)) ** 2
    p = ((index * cosine - inner) / (index * cosine + inner)) ** 2
    return 0.5 * ((1.0 - s) / (1.0 + s) + (1.0 - p) / (1.0 + p))


@compiled
def refracted(dx: float, dy: float, dz: float, nx: float, ny: float, nz: float, ratio: float) -> Vector:
    """Direction after refraction; the normal faces the incoming ray, and total reflection was excluded before."""
    cosine = -(dx * nx + dy * ny + dz * nz)
    inner = math.sqrt(max(0.0, 1.0 - ratio * ratio * (1.0 - cosine * cosine)))
    f = ratio * cosine - inner
    return ratio * dx + f * nx, ratio * dy + f * ny, ratio * dz + f * nz


@compiled
def mirrored(dx: float, dy: float, dz: float, nx: float, ny: float, nz: float) -> Vector:
    """Direction after a mirror with that normal (either side)."""
    f = 2.0 * (dx * nx + dy * ny + dz * nz)
    return dx - f * nx, dy - f * ny, dz - f * nz


@compiled
def tangents(nx: float, ny: float, nz: float) -> tuple[float, float, float, float, float, float]:
    """Two unit vectors that complete the normal to a right-handed frame (Duff et al. 2017, JCGT 6(1))."""
    sign = math.copysign(1.0, nz)
    a = -1.0 / (sign + nz)
    b = nx * ny * a
    return 1.0 + sign * nx * nx * a, sign * b, -sign * nx, b, sign + ny * ny * a, -ny


@compiled
def tilted(nx: float, ny: float, nz: float, a: float, b: float) -> Vector:
    """Turn the normal by the slopes ``a`` and ``b`` along two tangents, and make it a unit vector again."""
    ux, uy, uz, vx, vy, vz = tangents(nx, ny, nz)
    x, y, z = nx + a * ux + b * vx, ny + a * uy + b * vy, nz + a * uz + b * vz
    f = 1.0 / math.sqrt(x * x + y * y + z * z)
    return x * f, y * f, z * f


@compiled
def matt(state: State, nx: float, ny: float, nz: float) -> Vector:
    """Draw a direction from a Lambertian surface with that normal."""
    u = uniform(state)
    angle = 2.0 * math.pi * uniform(state)
    r = math.sqrt(u)
    a, b, c = r * math.cos(angle), r * math.sin(angle), math.sqrt(1.0 - u)
    ux, uy, uz, vx, vy, vz = tangents(nx, ny, nz)
    return a * ux + b * vx + c * nx, a * uy + b * vy + c * ny, a * uz + b * vz + c * nz


@compiled
def brushed(state: State, dx: float, dy: float, dz: float, nx: float, ny: float, nz: float, spread: float) -> Vector:
    """Mirror the ray on a wall whose normal errs by ``spread`` [rad, rms]; it never leaves through the wall."""
    if spread > 0.0:
        a, b = lobe(state, spread, 0.5)
        mx, my, mz = tilted(nx, ny, nz, a, b)
        dx, dy, dz = mirrored(dx, dy, dz, mx, my, mz)
    else:
        dx, dy, dz = mirrored(dx, dy, dz, nx, ny, nz)
    if dx * nx + dy * ny + dz * nz <= 0.0:
        dx, dy, dz = mirrored(dx, dy, dz, nx, ny, nz)
    return dx, dy, dz
