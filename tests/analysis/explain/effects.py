"""What physics does to the invented campaign's readings, written down anew: no line here calls `analysis.explain`.

Each function gives a truth [cd] for each row, free of noise.
"""

from functools import lru_cache
from itertools import product

import numpy as np

from tests.analysis.explain.campaign import (
    DISTANCE_M,
    ROOM_M,
    Floats,
    Rows,
    Sky,
    Truth,
    light,
    part,
    sky_part,
    sun_part,
)

# the goniometer


def gamma_offset(degrees: float) -> Truth:
    return lambda rows: light(rows, rows.gamma_deg + degrees)


def c_offset(degrees: float) -> Truth:
    return lambda rows: light(rows, None, rows.c_deg + degrees)


def handedness(zero_deg: float, below: tuple[str, ...] = ("box", "tube")) -> Truth:
    def truth(rows: Rows) -> Floats:
        turned = np.array([t.system in below for t in rows.tests])[rows.test]
        return light(rows, None, np.where(turned, zero_deg - rows.c_deg, rows.c_deg))

    return truth


def swap(one_deg: float, other_deg: float) -> Truth:
    def truth(rows: Rows) -> Floats:
        there = np.where(rows.gamma_deg == one_deg, other_deg, np.where(rows.gamma_deg == other_deg, one_deg, np.nan))
        return light(rows, np.where(np.isnan(there), rows.gamma_deg, there))

    return truth


def near_field(rows: Rows) -> Floats:
    """A fine grid of points over each aperture; inverse-square law and cosine at a sensor that faces the centre."""
    total = np.zeros(len(rows.test))
    at = DISTANCE_M * _vectors(rows.gamma_deg, rows.c_deg)
    box = np.array([t.system == "box" for t in rows.tests])[rows.test]
    middle = (np.arange(20) + 0.5) / 20
    for u, v in product(middle, middle):
        radius, turn = 0.3556 / 2 * np.sqrt(u), 2 * np.pi * v
        x = np.where(box, 0.6096 * (u - 0.5), radius * np.cos(turn))
        y = np.where(box, 0.6096 * (v - 0.5), radius * np.sin(turn))
        ray = at - np.stack([x, y, 0 * x], axis=1)
        length = np.linalg.norm(ray, axis=1)
        facing = np.sum(ray * at, axis=1) / (length * DISTANCE_M)
        gamma = np.degrees(np.arccos(-ray[:, 2] / length))
        c = np.degrees(np.arctan2(-ray[:, 0], ray[:, 1]))
        total += DISTANCE_M**2 * light(rows, gamma, c) * facing / length**2 / len(middle) ** 2
    return total


# the sensors


def offset(candela: float) -> Truth:
    return lambda rows: light(rows) + candela


OFFSETS = (0.0, 20.0, 0.0, -12.0, 0.0, 35.0, 0.0, 0.0, 0.0, 8.0)
"""What ten sensors read in the dark [cd], from nadir to the horizon."""


def offsets(candela: tuple[float, ...]) -> Truth:
    def truth(rows: Rows) -> Floats:
        sensors = np.unique(rows.gamma_deg)
        return light(rows) + np.asarray(candela)[np.searchsorted(sensors, rows.gamma_deg)]

    return truth


def power(exponent: float, about_cd: float = 800.0) -> Truth:
    return lambda rows: about_cd * (light(rows) / about_cd) ** (1.0 + exponent)


def bend(share: float, top_cd: float) -> Truth:
    """A parabola: the brightest reading is off by a share."""
    return lambda rows: light(rows) + share / top_cd * light(rows) ** 2


def ranges(step: float, above_cd: float) -> Truth:
    """Meters that change their range between 14 % below a level and 16 % above it, each at its own."""
    return lambda rows: light(rows) * (1.0 + np.interp(np.log(light(rows) / above_cd), [-0.15, 0.15], [0.0, step]))


def gradual(step: float, about_cd: float, over: float) -> Truth:
    """From one response to another, half way at a level: a hyperbolic tangent of the light's logarithm."""
    return lambda rows: light(rows) * (1.0 + 0.5 * step * (1.0 + np.tanh(np.log(light(rows) / about_cd) / over)))


def rounded(end_cd: float, sharpness: float) -> Truth:
    """Both ends of the response by one norm: what is small adds up with what is large as powers do."""
    return lambda rows: (light(rows) ** -sharpness + end_cd**-sharpness) ** (-1.0 / sharpness)


def dead_time(end_cd: float) -> Truth:
    return lambda rows: 1.0 / (1.0 / light(rows) + 1.0 / end_cd)


def cut(end_cd: float) -> Truth:
    return lambda rows: np.minimum(light(rows), end_cd)


def knee(from_cd: float, slope: float) -> Truth:
    """Where the range bends, only a share of the rise is left."""
    return lambda rows: np.interp(light(rows), [0.0, from_cd, 1e9], [0.0, from_cd, from_cd + slope * (1e9 - from_cd)])


def gain(gamma_deg: float, error: float) -> Truth:
    return lambda rows: light(rows) * np.where(rows.gamma_deg == gamma_deg, 1.0 + error, 1.0)


def cosine(error_at_90deg: float) -> Truth:
    return lambda rows: light(rows) * (1.0 + error_at_90deg * 2.0 * np.sin(np.radians(rows.gamma_deg) / 2.0) ** 2)


def grazing(error_at_90deg: float) -> Truth:
    return lambda rows: light(rows) * (1.0 + error_at_90deg * 4.0 * np.sin(np.radians(rows.gamma_deg) / 2.0) ** 4)


# sun, sky and lens


def split(change: float) -> Truth:
    """The sky gives more, the sun so much less that the roof's global illuminance stays."""

    def truth(rows: Rows) -> Floats:
        diffuse, total = rows.of_test(lambda t: t.diffuse_lx), rows.of_test(lambda t: t.global_lx)
        beam = np.maximum(total - (1.0 + change) * diffuse, 0.0)
        return _sun(rows) / (total - diffuse) * beam + _sky(rows) * (1.0 + change)

    return truth


def cone(share: float) -> Truth:
    """A disc hides so much less than the beam: it counts as the sky's."""

    def truth(rows: Rows) -> Floats:
        diffuse, total = rows.of_test(lambda t: t.diffuse_lx), rows.of_test(lambda t: t.global_lx)
        return (1.0 - share) * _sun(rows) + (diffuse + share * (total - diffuse)) / diffuse * _sky(rows)

    return truth


def beam(change: float) -> Truth:
    return lambda rows: (1.0 + change) * _sun(rows) + _sky(rows)


def entry_haze(share: float) -> Truth:
    """Beam scattered at the entry goes through like the sky's light, lux for lux."""

    def truth(rows: Rows) -> Floats:
        per_lux = _sky(rows) / rows.of_test(lambda t: t.diffuse_lx)
        beam = rows.of_test(lambda t: t.global_lx - t.diffuse_lx)
        return (1.0 - share) * _sun(rows) + share * beam * per_lux + _sky(rows)

    return truth


def exit_haze(share: float) -> Truth:
    """Light scattered at the exit leaves by Lambert's law."""

    def truth(rows: Rows) -> Floats:
        lambert = np.cos(np.radians(rows.gamma_deg)) / np.pi
        return (1.0 - share) * light(rows) + share * lambert * rows.of_test(_flux)

    return truth


@lru_cache(maxsize=64)
def _flux(test: Sky) -> float:
    """Flux [lm]: Gauss-Legendre in cos(gamma), equal steps in C."""
    x, w = np.polynomial.legendre.leggauss(60)
    gamma = np.degrees(np.arccos((x + 1.0) / 2.0))[None, :]
    c = np.arange(0.0, 360.0, 4.0)[:, None]
    total = sun_part(test, gamma, c) + sky_part(test, gamma, c)
    return float(np.sum(total * w / 2.0) * np.radians(4.0))


def dirt(loss: float) -> Truth:
    """Beer's law along the slant; for the sky its mean over a uniform hemisphere, weighted by cosine."""
    mu = (np.arange(2000) + 0.5) / 2000
    mean = float(np.mean(2.0 * mu * (1.0 - loss) ** (1.0 / mu)))

    def truth(rows: Rows) -> Floats:
        up = np.sin(np.radians(rows.of_test(lambda t: t.sun[0])))
        return _sun(rows) * (1.0 - loss) ** (1.0 / up) + _sky(rows) * mean

    return truth


def dirt_below(loss: float) -> Truth:
    """The same dirt on the face towards the room: Beer's law along each way out, to nearly grazing."""

    def truth(rows: Rows) -> Floats:
        down = np.maximum(np.cos(np.radians(rows.gamma_deg)), 0.1)
        return dirt(loss)(rows) * (1.0 - loss) ** (1.0 / down)

    return truth


def scattering_dirt(loss: float, share: float) -> Truth:
    """What dirt takes of beam and sky (see `dirt`) comes in as sky light again, a share of it."""

    def truth(rows: Rows) -> Floats:
        up = np.sin(np.radians(rows.of_test(lambda t: t.sun[0])))
        to_sky = rows.of_test(lambda t: (t.global_lx - t.diffuse_lx) / t.diffuse_lx)
        taken = _sun(rows) + _sky(rows) - dirt(loss)(rows)
        of_sky = taken - _sun(rows) * (1.0 - (1.0 - loss) ** (1.0 / up))
        return dirt(loss)(rows) + share * (of_sky + to_sky * _sky(rows) * (1.0 - (1.0 - loss) ** (1.0 / up)))

    return truth


def domed(loss: float) -> Truth:
    """Dirt on a dome: sun and sky go through alike, 1.3 times as slantingly as straight down."""
    return lambda rows: light(rows) * (1.0 - loss) ** 1.3


def only(system: str, truth: Truth) -> Truth:
    """An effect on one system alone."""
    return lambda rows: np.where(rows.of_test(lambda t: float(t.system == system)) > 0.5, truth(rows), light(rows))


def aureole(share: float, sigma_deg: float) -> Truth:
    """The sun's image seen through a Gaussian: Gauss-Hermite points in the tangent plane of each direction."""
    x, w = np.polynomial.hermite_e.hermegauss(9)
    w = w / w.sum()

    def truth(rows: Rows) -> Floats:
        v = _vectors(rows.gamma_deg, rows.c_deg)
        up = np.array([0.02, 0.03, 1.0])
        across = np.cross(v, up)
        across /= np.linalg.norm(across, axis=1, keepdims=True)
        along = np.cross(across, v)
        wide = np.zeros(len(v))
        for xi, wi in zip(x, w, strict=True):
            for xj, wj in zip(x, w, strict=True):
                moved = v + np.tan(np.radians(sigma_deg)) * (xi * across + xj * along)
                moved /= np.linalg.norm(moved, axis=1, keepdims=True)
                gamma = np.degrees(np.arccos(np.clip(-moved[:, 2], -1, 1)))
                c = np.degrees(np.arctan2(-moved[:, 0], moved[:, 1]))
                wide += wi * wj * np.where(gamma < 90.0, part(rows, sun_part, np.minimum(gamma, 90.0), c), 0.0)
        return (1.0 - share) * _sun(rows) + share * wide + _sky(rows)

    return truth


def clouds(sd: float, seconds: float, seed: int = 3) -> Truth:
    """The beam wanders by a random walk that forgets itself, one for each test."""

    def truth(rows: Rows) -> Floats:
        rng = np.random.default_rng(seed)
        factor = np.ones(len(rows.test))
        keep = np.exp(-10.0 / seconds)
        for k in range(len(rows.tests)):
            steps = rng.standard_normal(16)
            walk = np.zeros(16)
            walk[0] = steps[0]
            for i in range(1, 16):
                walk[i] = keep * walk[i - 1] + np.sqrt(1 - keep**2) * steps[i]
            factor[rows.test == k] = np.repeat(np.exp(sd * walk), 10)
        return _sun(rows) * factor + _sky(rows)

    return truth


# the room


def leak(lux_per_100_klx: float) -> Truth:
    """Daylight through a gap in the door, everywhere alike."""
    return lambda rows: light(rows) + DISTANCE_M**2 * lux_per_100_klx * rows.of_test(lambda t: t.global_lx) / 1e5


def lamp(lux: float, c_deg: float, share: float) -> Truth:
    """A light that is always on; a share of it comes from one side."""
    return lambda rows: light(rows) + DISTANCE_M**2 * lux * (1.0 + share * _towards(rows, c_deg))


def gap(lux_per_100_klx: float, c_deg: float) -> Truth:
    """Daylight through a gap on one side: twice as much on a horizontal arm towards it, none on one away from it."""

    def truth(rows: Rows) -> Floats:
        added = DISTANCE_M**2 * lux_per_100_klx * rows.of_test(lambda t: t.global_lx) / 1e5
        return light(rows) + added * (1.0 + _towards(rows, c_deg))

    return truth


def _towards(rows: Rows, c_deg: float) -> Floats:
    """How far the arm points to one side: 1 where it is level towards it, -1 away from it."""
    outwards = np.stack([np.cos(np.radians(rows.c_deg)), np.sin(np.radians(rows.c_deg))], axis=1)
    towards = outwards @ np.array([np.cos(np.radians(c_deg)), np.sin(np.radians(c_deg))])
    return np.asarray(towards * np.sin(np.radians(rows.gamma_deg)))


def room(wall: float, floor: float) -> Truth:
    """Radiosity of the room: every surface sees every other, ceiling (reflecting like the walls) included."""

    def truth(rows: Rows) -> Floats:
        centre, normal, area, is_floor, is_ceiling = _patches(12)
        rho = np.where(is_floor, floor, wall)
        apart = centre[None, :, :] - centre[:, None, :]
        length = np.linalg.norm(apart, axis=2) + np.eye(len(centre))
        leaving = np.maximum(np.einsum("ijk,ik->ij", apart, normal), 0.0) / length
        arriving = np.maximum(np.einsum("ijk,jk->ij", -apart, normal), 0.0) / length
        to = leaving * arriving / (np.pi * length**2) * area[None, :]  # form factors i -> j
        at = DISTANCE_M * _vectors(rows.gamma_deg, rows.c_deg)
        added = np.zeros(len(at))
        distance = np.linalg.norm(centre, axis=1)
        gamma = np.degrees(np.arccos(np.clip(-centre[:, 2] / distance, -1, 1)))
        c = np.degrees(np.arctan2(-centre[:, 0], centre[:, 1]))
        for k, test in enumerate(rows.tests):
            candela = sun_part(test, gamma, c) + sky_part(test, gamma, c)
            direct = np.where(is_ceiling, 0.0, candela * -np.sum(centre * normal, axis=1) / distance**3)
            exitance = np.linalg.solve(np.eye(len(rho)) - rho[:, None] * to, rho * direct)
            here = rows.test == k
            added[here] = DISTANCE_M**2 * _seen(at[here], centre, normal, area, exitance / np.pi)
        return light(rows) + added

    return truth


def _seen(at: Floats, centre: Floats, normal: Floats, area: Floats, luminance: Floats) -> Floats:
    """Illuminance [lx] at shielded sensors (60°) that face the aperture's centre."""
    ray = at[:, None, :] - centre[None, :, :]
    length = np.linalg.norm(ray, axis=2)
    leaving = np.maximum(np.sum(ray * normal[None], axis=2), 0.0) / length
    facing = np.sum(ray * at[:, None, :], axis=2) / (length * DISTANCE_M)
    return np.asarray(np.where(facing > 0.5, leaving * facing / length**2, 0.0) @ (area * luminance))


def _patches(across: int) -> tuple[Floats, Floats, Floats, np.ndarray, np.ndarray]:
    """Six sides of the cube, origin in the middle of the ceiling."""
    side = ROOM_M[0]
    u = (np.arange(across) + 0.5) / across - 0.5
    a, b = (m.ravel() * side for m in np.meshgrid(u, u))
    middle = np.array([0.0, 0.0, -side / 2])
    centres, normals = [], []
    for axis in range(3):
        for sign in (-1.0, 1.0):
            p = np.zeros((len(a), 3))
            p[:, axis] = sign * side / 2
            p[:, (axis + 1) % 3], p[:, (axis + 2) % 3] = a, b
            n = np.zeros(3)
            n[axis] = -sign
            centres.append(p + middle)
            normals.append(np.tile(n, (len(a), 1)))
    centre, normal = np.concatenate(centres), np.concatenate(normals)
    return centre, normal, np.full(len(centre), (side / across) ** 2), normal[:, 2] > 0.5, normal[:, 2] < -0.5


# nobody's physics


def shadow(depth: float, gamma_deg: float = 50.0, c_deg: float = 200.0, width_deg: float = 14.0) -> Truth:
    """A cable in the room keeps light from sensors that pass behind it."""

    def truth(rows: Rows) -> Floats:
        v = _vectors(rows.gamma_deg, rows.c_deg) @ _vectors(np.array([gamma_deg]), np.array([c_deg]))[0]
        away = np.degrees(np.arccos(np.clip(v, -1.0, 1.0)))
        return light(rows) * (1.0 - depth * np.exp(-0.5 * (away / width_deg) ** 2))

    return truth


def _sun(rows: Rows) -> Floats:
    return part(rows, sun_part, rows.gamma_deg, rows.c_deg)


def _sky(rows: Rows) -> Floats:
    return part(rows, sky_part, rows.gamma_deg, rows.c_deg)


def _vectors(gamma_deg: Floats, c_deg: Floats) -> Floats:
    """East, north, up; C = 0 north, 90 west."""
    g, c = np.radians(gamma_deg), np.radians(c_deg)
    return np.stack([-np.sin(g) * np.sin(c), np.sin(g) * np.cos(c), -np.cos(g)], axis=1)
