"""What happens to one ray at one dielectric surface; compiled functions for the ray tracers.

Light is unpolarised at every surface (rays carry no polarisation). Random numbers come from a splitmix64 sequence whose
state is an array of one number, so that a result depends on its seed and not on threads or on other rays.
"""

import math

import numpy as np
from numpy.typing import NDArray

from analysis.bsdf.compiled import compiled

State = NDArray[np.uint64]
Vector = tuple[float, float, float]

TRUNCATION = 4.0
"""Slopes of the Gaussian surface error are drawn within this many standard deviations (0.03 % lie beyond)."""


@compiled
def uniform(state: State) -> float:
    """Next random number in [0, 1) (splitmix64; Steele, Lea and Flood 2014, doi:10.1145/2660193.2660195)."""
    state[0] += np.uint64(0x9E3779B97F4A7C15)
    z = state[0]
    z = (z ^ (z >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    z = (z ^ (z >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    z = z ^ (z >> np.uint64(31))
    return float(z >> np.uint64(11)) * (1.0 / 9007199254740992.0)


@compiled
def fresnel(cos_i: float, n_from: float, n_to: float) -> float:
    """Reflectance of unpolarised light (Fresnel; Born and Wolf, Principles of Optics, section 1.5); 1 beyond TIR."""
    ratio = n_from / n_to
    sin2_t = ratio * ratio * (1.0 - cos_i * cos_i)
    if sin2_t >= 1.0:
        return 1.0
    cos_t = math.sqrt(1.0 - sin2_t)
    rs = (n_from * cos_i - n_to * cos_t) / (n_from * cos_i + n_to * cos_t)
    rp = (n_from * cos_t - n_to * cos_i) / (n_from * cos_t + n_to * cos_i)
    return 0.5 * (rs * rs + rp * rp)


@compiled
def rough_normal(
    nx: float, ny: float, nz: float, dx: float, dy: float, dz: float, sigma: float, state: State
) -> Vector:
    """Normal of the bit of surface that a ray along d meets on a facet with normal n.

    Slopes are Gaussian with standard deviation ``sigma`` in each of two directions; a bit of surface is met in
    proportion to the area it shows to the ray (visible normals; Heitz and d'Eon 2014, doi:10.1111/cgf.12417), which
    keeps reflectance and transmittance reciprocal. The result lies on the same side as n.
    """
    if sigma <= 0.0:
        return nx, ny, nz
    # two unit vectors in the facet (Duff et al. 2017, jcgt.org/published/0006/01/01)
    sign = math.copysign(1.0, nz)
    a = -1.0 / (sign + nz)
    b = nx * ny * a
    ux, uy, uz = 1.0 + sign * nx * nx * a, sign * b, -sign * nx
    vx, vy, vz = b, sign + ny * ny * a, -ny
    along = nx * dx + ny * dy + nz * dz
    du, dv = ux * dx + uy * dy + uz * dz, vx * dx + vy * dy + vz * dz
    side = 1.0 if along > 0.0 else -1.0
    bound = abs(along) + TRUNCATION * sigma * math.sqrt(du * du + dv * dv)
    for _ in range(10000):
        radius = math.sqrt(-2.0 * math.log(1.0 - uniform(state)))
        if radius > TRUNCATION:
            continue
        turn = 2.0 * math.pi * uniform(state)
        p, q = sigma * radius * math.cos(turn), sigma * radius * math.sin(turn)
        shown = side * (along - p * du - q * dv)  # area towards the ray per area of the facet
        if uniform(state) * bound < shown:
            mx, my, mz = nx - p * ux - q * vx, ny - p * uy - q * vy, nz - p * uz - q * vz
            length = math.sqrt(mx * mx + my * my + mz * mz)
            return mx / length, my / length, mz / length
    return nx, ny, nz


@compiled
def meet_surface(
    inside: bool,
    nx: float,
    ny: float,
    nz: float,
    dx: float,
    dy: float,
    dz: float,
    index: float,
    sigma: float,
    state: State,
) -> tuple[bool, float, float, float]:
    """Let a ray meet a bit of a surface once; return whether it goes on inside the material, and its direction.

    n points out of the material of refractive index ``index``; d runs towards the surface. A tilted bit may send the
    ray the wrong way through the facet.
    """
    mx, my, mz = rough_normal(nx, ny, nz, dx, dy, dz, sigma, state)
    along = mx * dx + my * dy + mz * dz
    cos_i = min(1.0, abs(along))
    n_from, n_to = (index, 1.0) if inside else (1.0, index)
    if uniform(state) < fresnel(cos_i, n_from, n_to):
        dx, dy, dz = dx - 2.0 * along * mx, dy - 2.0 * along * my, dz - 2.0 * along * mz
    else:
        ratio = n_from / n_to
        cos_t = math.sqrt(max(0.0, 1.0 - ratio * ratio * (1.0 - cos_i * cos_i)))
        shift = (cos_t if along > 0.0 else -cos_t) - ratio * along
        dx, dy, dz = ratio * dx + shift * mx, ratio * dy + shift * my, ratio * dz + shift * mz
        inside = not inside
    length = math.sqrt(dx * dx + dy * dy + dz * dz)
    return inside, dx / length, dy / length, dz / length


@compiled
def cross_surface(
    inside: bool,
    nx: float,
    ny: float,
    nz: float,
    dx: float,
    dy: float,
    dz: float,
    index: float,
    sigma: float,
    state: State,
) -> tuple[bool, float, float, float]:
    """Let a ray meet a surface; return whether it goes on inside the material, and its direction.

    As `meet_surface`, but a ray that a tilted bit of surface sends the wrong way through the facet meets the facet
    again, so no energy is lost.
    """
    for _ in range(1000):
        inside, dx, dy, dz = meet_surface(inside, nx, ny, nz, dx, dy, dz, index, sigma, state)
        away = nx * dx + ny * dy + nz * dz
        if (away < 0.0) == inside:
            return inside, dx, dy, dz
    return inside, dx, dy, dz
