"""How much light a prismatic sheet sends in wanted directions: the last event's density instead of a count; compiled.

A ray is followed through the sheet as `analysis.bsdf.prism_trace` does. At each facet that it meets, the slope of the
bit of facet is not yet drawn; so for every wanted direction the one slope that would send the light there is known
(the half vector; Walter et al. 2007, doi:10.2312/EGWR/EGSR07/195-206, eq. 13 to 17), and with it the density of light
per steradian. The mean over rays is the sheet's scatter in that very direction: no bins, no smoothing, no table. What a
wanted direction needs is a Gaussian slope error; without one there is no density.

Directions are in the frame of `prism_trace`, (x, y, w), w the depth below the flat side. Wanted directions that leave
by the flat side are given as they are inside the material (`inside_of`), because that is where facets send light.
"""

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from analysis.bsdf.compiled import compiled
from analysis.bsdf.optics import TRUNCATION, State, Vector, fresnel, meet_surface, uniform
from analysis.bsdf.prism_trace import facet_normal, next_inside, next_outside

Floats = NDArray[np.float64]
Singles = NDArray[np.float32]
Wanted = NDArray[np.float32]
"""Shape (4, n): direction cosines x, y, w, and what a unit of density is worth there (0: not wanted)."""

_MAX_EVENTS = 20000
_KEPT = 1.0 - math.exp(-0.5 * TRUNCATION**2)
"""Share of the Gaussian within the truncation."""


@compiled
def shown_area(cosine: float, sine: float, sigma: float) -> float:
    """Mean area that the bits of a rough facet show to a ray, per area of the facet (0 for bits turned away).

    For slopes Gaussian with ``sigma`` in each direction: c Φ(c / s) + s φ(c / s), with s = sigma times sine (Smith's
    masking; Heitz 2014, jcgt.org/published/0003/02/03, eq. 72). Bits beyond the truncation are neglected (3e-4).
    """
    s = sigma * sine
    if cosine >= TRUNCATION * s:
        return cosine
    a = cosine / s
    return cosine * 0.5 * math.erfc(-a / math.sqrt(2.0)) + s * math.exp(-0.5 * a * a) / math.sqrt(2.0 * math.pi)


@compiled
def slope_density(
    nx: float, ny: float, nw: float, mx: float, my: float, mw: float, cos_i: float, area: float, sigma: float
) -> float:
    """Density per steradian of normals m among the bits of a facet (normal n) that a ray meets at cosine ``cos_i``."""
    cosine = mx * nx + my * ny + mw * nw
    square = cosine * cosine
    slope = (1.0 - square) / square
    gauss = math.exp(-0.5 * slope / (sigma * sigma)) / (2.0 * math.pi * sigma * sigma * _KEPT)
    return gauss * cos_i / (area * square * square)


@compiled
def reachable(
    wanted: Wanted, many: int, n: Vector, d: Vector, ahead: float, back: float, sigma: float, reach: Singles
) -> None:
    """Mark (> 0) the wanted directions for which a slope within the truncation exists, in one quick loop.

    The half vector is ``ahead`` d minus ``back`` t; n and d as three numbers each. Single precision: more numbers fit a
    register.
    """
    nx, ny, nw = np.float32(n[0]), np.float32(n[1]), np.float32(n[2])
    dx, dy, dw = np.float32(d[0]), np.float32(d[1]), np.float32(d[2])
    base = np.float32(ahead * (d[0] * n[0] + d[1] * n[1] + d[2] * n[2]))
    b = np.float32(back)
    both = np.float32(ahead * ahead + back * back)
    cross = np.float32(2.0 * ahead * back)
    limit = np.float32(1.0 / (1.0 + (TRUNCATION * sigma) ** 2))
    zero = np.float32(0.0)
    for j in range(many):
        tx, ty, tw = wanted[0, j], wanted[1, j], wanted[2, j]
        dot = base - b * (tx * nx + ty * ny + tw * nw)
        length2 = both - cross * (tx * dx + ty * dy + tw * dw)
        good = (dot > zero) & (wanted[3, j] > zero)
        reach[j] = dot * dot - limit * length2 if good else np.float32(-1.0)


@compiled
def half_vector_density(
    inside: bool, into: bool, n: Vector, d: Vector, t: Vector, ahead: float, back: float, geometry: Floats, area: float
) -> float:
    """Density per steradian, about t, of light that comes along d and goes on along t after one bit of facet.

    ``into``: t runs inside the material. With ``inside`` equal to ``into`` the light is reflected, else refracted.
    """
    index, sigma = geometry[0], geometry[7]
    away = n[0] * t[0] + n[1] * t[1] + n[2] * t[2]
    if (away < 0.0) != into:
        return 0.0
    mx, my, mw = ahead * d[0] - back * t[0], ahead * d[1] - back * t[1], ahead * d[2] - back * t[2]
    length = math.sqrt(mx * mx + my * my + mw * mw)
    if length < 1e-9:
        return 0.0
    mx, my, mw = mx / length, my / length, mw / length
    comes = mx * d[0] + my * d[1] + mw * d[2]
    goes = mx * t[0] + my * t[1] + mw * t[2]
    mirrored = inside == into
    if (comes > 0.0) != inside or (comes * goes > 0.0) == mirrored:
        return 0.0
    n_from, n_to = (index, 1.0) if inside else (1.0, index)
    reflected = fresnel(min(1.0, abs(comes)), n_from, n_to)
    density = slope_density(n[0], n[1], n[2], mx, my, mw, abs(comes), area, sigma)
    if mirrored:
        return density * reflected / (4.0 * abs(goes))
    return density * (1.0 - reflected) * n_to * n_to * abs(goes) / (length * length)


@compiled
def _sent(
    inside: bool, into: bool, place: Vector, n: Vector, d: Vector, geometry: Floats, wanted: Wanted, j: int,
    ahead: float, back: float, area: float,
) -> float:  # fmt: skip
    """Density towards wanted direction j, times its worth, of light that meets no other facet on its way out."""
    index, absorption = geometry[0], geometry[1]
    t = (float(wanted[0, j]), float(wanted[1, j]), float(wanted[2, j]))
    density = half_vector_density(inside, into, n, d, t, ahead, back, geometry, area)
    if density <= 0.0:
        return 0.0
    if not into:
        _, _, _, surface = next_outside(place[0], place[1], place[2], t[0], t[1], t[2], geometry)
        return density * float(wanted[3, j]) if surface == 0 else 0.0
    _, _, _, path, surface = next_inside(place[0], place[1], place[2], t[0], t[1], t[2], geometry)
    if surface != 0:
        return 0.0
    cos_in = abs(t[2])
    cos_out = math.sqrt(max(0.0, 1.0 - index * index * (t[0] * t[0] + t[1] * t[1])))
    passed: float = math.exp(-absorption * path) * (1.0 - fresnel(cos_in, index, 1.0))
    # Snell's law: n² cos dω is the same on both sides of the flat face
    sent: float = density * float(wanted[3, j]) * passed * cos_out / (index * index * cos_in)
    return sent


@compiled
def aim_facet(
    inside: bool,
    into: bool,
    place: Vector,
    n: Vector,
    d: Vector,
    geometry: Floats,
    share: float,
    wanted: Wanted,
    many: int,
    reach: Singles,
    found: Floats,
) -> None:
    """Add to ``found`` what the facet at ``place`` sends in the wanted directions without meeting another."""
    index, sigma = geometry[0], geometry[7]
    if inside == into:
        ahead, back = (1.0, 1.0) if inside else (-1.0, -1.0)
    else:
        ahead, back = (index, 1.0) if inside else (1.0, index)
    along = n[0] * d[0] + n[1] * d[1] + n[2] * d[2]
    area = shown_area(abs(along), math.sqrt(max(0.0, 1.0 - along * along)), sigma)
    reachable(wanted, many, n, d, ahead, back, sigma, reach)
    for j in range(many):
        if reach[j] > 0.0:
            found[j] += share * _sent(inside, into, place, n, d, geometry, wanted, j, ahead, back, area)


@compiled
def scatter_aimed(
    dx: float,
    dy: float,
    dw: float,
    geometry: Floats,
    into: bool,
    share: float,
    wanted: Wanted,
    many: int,
    reach: Singles,
    found: Floats,
    state: State,
) -> tuple[float, float, float, float]:
    """Send one ray through the sheet like `scatter_one`, and add its density in the wanted directions to ``found``.

    Parameters
    ----------
    dx, dy, dw
        Direction of travel in the pattern's frame; dw > 0 meets the flat side. The place on the sheet is random.
    geometry
        See `analysis.bsdf.prism_trace`; its orientation is not used.
    into
        Whether the wanted directions leave by the flat side (and are given as they are inside), or by the prisms.
    share
        What the ray carries: ``found`` gets share times density per steradian times each direction's worth.
    wanted, reach, found : shape (4, n), (n,), (n,)
        The first ``many`` are used; ``reach`` is room to work.

    Returns
    -------
    Direction of travel (x, y, w) and weight of what comes out: one sample of the sheet.
    """
    index, absorption, half, sigma = geometry[0], geometry[1], geometry[4], geometry[7]
    x, y = half * (2.0 * uniform(state) - 1.0), half * (2.0 * uniform(state) - 1.0)
    weight = 1.0
    w, surface = 0.0, 0
    if dw <= 0.0:
        w = geometry[2] + geometry[3]
        x, y, w, surface = next_outside(x, y, w, dx, dy, dw, geometry)
    inside = False
    for _ in range(_MAX_EVENTS):
        n = facet_normal(surface, geometry)
        rough = sigma if surface > 0 else 0.0
        for _ in range(1000):  # until the surface sends the ray the right way, see `cross_surface`
            if surface > 0 and many > 0:
                aim_facet(
                    inside, into, (x, y, w), n, (dx, dy, dw), geometry, share * weight, wanted, many, reach, found
                )
            inside, dx, dy, dw = meet_surface(inside, n[0], n[1], n[2], dx, dy, dw, index, rough, state)
            if (n[0] * dx + n[1] * dy + n[2] * dw < 0.0) == inside:
                break
        if inside:
            x, y, w, path, surface = next_inside(x, y, w, dx, dy, dw, geometry)
            weight *= math.exp(-absorption * path)
            if weight < 1e-3:  # Russian roulette keeps the mean
                if uniform(state) > 0.1:
                    return dx, dy, dw, 0.0
                weight *= 10.0
        elif surface == 0:
            return dx, dy, dw, weight
        else:
            x, y, w, surface = next_outside(x, y, w, dx, dy, dw, geometry)
            if surface == 0:
                return dx, dy, dw, weight
    return dx, dy, dw, 0.0


@compiled
def aimed_many(
    d: Vector, rays: int, seed: Any, geometry: Floats, into: bool, wanted: Wanted, reach: Singles, found: Floats
) -> None:
    """Fill ``found`` (n,) with the mean density per steradian of ``rays`` rays along d in the wanted directions."""
    state = np.zeros(1, dtype=np.uint64)
    state[0] = seed
    for _ in range(rays):
        scatter_aimed(d[0], d[1], d[2], geometry, into, 1.0 / rays, wanted, wanted.shape[1], reach, found, state)
