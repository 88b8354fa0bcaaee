"""The dark room is not quite dark: light that its surfaces send on to the sensors.

Radiosity on patches: each patch gets light from the aperture by the intensity distribution (inverse square), and from
all other patches by form factors that are exact from a patch's middle to a rectangle (Lambert's polygon formula;
e.g. Howell, Siegel & Mengüç, Thermal Radiation Heat Transfer, ch. 5; Baum et al. 1989, doi:10.1145/74334.74367).
The room is a convex box, so every patch sees every other whole. Sensors gather the patches' luminance over the cone
that their shields leave open. Aperture, sensors and arm themselves are taken as black.
"""

import functools
import math
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from analysis.photometry import Distribution
from labdaq.directions import gamma_c, vector
from labdaq.errors import ConfigError

Floats = NDArray[np.float64]
Whole = NDArray[np.int64]

CELLS: Final = 14
"""Patches along each side of each surface."""

LOOKS: Final = 4096
"""Directions in which each sensor looks."""


@dataclass(frozen=True)
class Room:
    """A box with the aperture in the centre of its ceiling.

    Attributes
    ----------
    size_m
        East-west, north-south, height [m].
    wall, floor, ceiling
        Diffuse reflectances [0..1).
    half_angle_deg
        Acceptance of the sensors' shields, cosine-weighted inside; 90 without shields.
    """

    size_m: tuple[float, float, float] = (5.486, 5.486, 5.486)
    wall: float = 0.043
    floor: float = 0.015
    ceiling: float = 0.043
    half_angle_deg: float = 60.0

    def __post_init__(self) -> None:
        if min(self.size_m) <= 0.0:
            raise ConfigError(f"a room of {self.size_m} m has no space")
        for name in ("wall", "floor", "ceiling"):
            if not 0.0 <= getattr(self, name) < 1.0:
                raise ConfigError(f"room: {name}: a reflectance must lie in [0, 1), not {getattr(self, name):g}")
        if not 0.0 < self.half_angle_deg <= 90.0:
            raise ConfigError(f"room: half_angle_deg must lie in (0, 90], not {self.half_angle_deg:g}")

    def added(
        self, far: Distribution, gamma_deg: ArrayLike, c_deg: ArrayLike, distance_m: float, aperture_m: float = 0.0
    ) -> Floats:
        """Candela that the room adds to what sensors at ``distance_m`` read (E times distance squared).

        Parameters
        ----------
        far
            Far-field distribution of the aperture [cd].
        gamma_deg, c_deg
            Where the sensors are; they broadcast.
        distance_m
            From the aperture's centre [m]; raises `ConfigError` where that is outside the room.
        aperture_m
            Radius around the aperture's centre that sends no reflected light [m].
        """
        gamma, c = np.broadcast_arrays(np.asarray(gamma_deg, dtype=np.float64), np.asarray(c_deg, dtype=np.float64))
        patches = patches_of(self.size_m)
        reach = patches.reach(far)
        sensors = tuple(zip(np.ravel(gamma).tolist(), np.ravel(c).tolist(), strict=True))
        look = gathered(self.size_m, sensors, distance_m, self.half_angle_deg, aperture_m)
        seen: Floats = look @ self.exitance(reach) * distance_m**2
        return seen.reshape(gamma.shape)

    def exitance(self, direct_lx: Floats) -> Floats:
        """Exitance [lm/m²] of the patches after all bounces, for direct illuminances (patches, ...) [lx]."""
        patches = patches_of(self.size_m)
        return _bounced(patches.factors, self._reflectance(patches.surface, direct_lx.ndim), direct_lx)

    def exitance_soon(self, direct_lx: Floats) -> Floats:
        """`exitance` [lm/m²] in a tenth of the time: the first bounce as exactly, later ones by four patches at once.

        Shapes as there. Of a room of .05 reflectance patches differ by half a per cent, of .3 by 3 %; fluxes by .1 %.
        """
        patches = patches_of(self.size_m)
        rho = self._reflectance(patches.surface, direct_lx.ndim)
        quads, factors = patches.by_four
        direct = np.asarray(rho * direct_lx)[quads].mean(axis=1)
        again = factors @ direct  # light on each four from what has bounced once
        total = _bounced(factors, self._reflectance(patches.surface[quads[:, 0]], direct_lx.ndim), again)
        arriving = np.empty_like(direct_lx)
        arriving[quads] = (again + factors @ total)[:, None]
        return np.asarray(rho * (direct_lx + arriving))

    def _reflectance(self, surface: Whole, dimensions: int) -> Floats:
        """Reflectance of each patch, to be multiplied with arrays of so many dimensions."""
        by_surface = np.array([self.wall] * 4 + [self.floor, self.ceiling])
        return np.asarray(by_surface[surface].reshape(-1, *[1] * (dimensions - 1)))


def _bounced(factors: Floats, rho: Floats, direct_lx: Floats) -> Floats:
    """Exitance after all bounces between patches of reflectances ``rho``."""
    first: Floats = rho * direct_lx
    total: Floats = first
    for _ in range(200):
        before, total = total, np.asarray(first + rho * (factors @ total))
        if np.allclose(before, total, rtol=1e-6, atol=0.0):
            break
    return total


@dataclass(frozen=True, eq=False)
class Patches:
    """Rectangles that make up the room's surfaces.

    Attributes
    ----------
    middle, normal : shape (n, 3)
        Middles [m] (origin: centre of the ceiling, z up) and inward normals.
    surface : shape (n,)
        0 east, 1 west, 2 north, 3 south wall, 4 floor, 5 ceiling.
    points : shape (n, k, 3)
        Points spread over each patch.
    factors : shape (n, n)
        Form factor from row to column.
    """

    middle: Floats
    normal: Floats
    surface: Whole
    points: Floats
    factors: Floats

    @functools.cached_property
    def by_four(self) -> tuple[Whole, Floats]:
        """The patches of each square of four, shape (n / 4, 4), and the form factors between such squares."""
        numbers = np.arange(len(self.surface)).reshape(-1, CELLS // 2, 2, CELLS // 2, 2)
        quads = numbers.transpose(0, 1, 3, 2, 4).reshape(-1, 4)
        return quads, np.asarray(self.factors[quads].mean(axis=1)[:, quads].sum(axis=2))

    def reach(self, far: Distribution) -> Floats:
        """Mean direct illuminance [lx] of each patch from the aperture, taken as a point."""
        gamma, c = gamma_c(self.points)
        squared = np.sum(self.points**2, axis=-1)
        cosine = np.maximum(0.0, -np.einsum("nkd,nd->nk", self.points, self.normal)) / np.sqrt(squared)
        below = self.points[..., 2] < 0.0
        lux = np.where(below, far.at(np.minimum(gamma, 90.0), c) * cosine / np.maximum(squared, 1e-12), 0.0)
        mean: Floats = lux.mean(axis=1)
        return mean


_AXES: Final = (  # corner, two edges and inward normal of each surface, in units of half the size; z from 0 to -2
    ((1, -1, -2), (0, 2, 0), (0, 0, 2), (-1, 0, 0)),
    ((-1, -1, -2), (0, 2, 0), (0, 0, 2), (1, 0, 0)),
    ((-1, 1, -2), (2, 0, 0), (0, 0, 2), (0, -1, 0)),
    ((-1, -1, -2), (2, 0, 0), (0, 0, 2), (0, 1, 0)),
    ((-1, -1, -2), (2, 0, 0), (0, 2, 0), (0, 0, 1)),
    ((-1, -1, 0), (2, 0, 0), (0, 2, 0), (0, 0, -1)),
)


@functools.lru_cache(maxsize=4)
def patches_of(size: tuple[float, float, float]) -> Patches:
    """The patches of a room of that size: east-west, north-south, height [m]."""
    half = np.array(size) / 2.0
    corners, points, normals, surface = [], [], [], []
    step = np.arange(CELLS) / CELLS
    inside = (np.arange(4) + 0.5) / 4 / CELLS
    for number, (corner, u, v, normal) in enumerate(_AXES):
        c, a, b = (np.array(vector_) * half for vector_ in (corner, u, v))
        i, j = (grid.ravel()[:, None] for grid in np.meshgrid(step, step, indexing="ij"))
        low = c + i * a + j * b
        edge_a, edge_b = a / CELLS, b / CELLS
        corners.append(np.stack([low, low + edge_a, low + edge_a + edge_b, low + edge_b], axis=1))
        s, t = (grid.ravel() for grid in np.meshgrid(inside, inside, indexing="ij"))
        points.append(low[:, None, :] + s[None, :, None] * a + t[None, :, None] * b)
        normals.append(np.tile(np.array(normal, dtype=np.float64), (len(low), 1)))
        surface.append(np.full(len(low), number))
    all_corners = np.concatenate(corners)
    middle = all_corners.mean(axis=1)
    normal_ = np.concatenate(normals)
    number_ = np.concatenate(surface)
    factors = _factors(middle, normal_, all_corners, number_)
    return Patches(middle, normal_, number_, np.concatenate(points), factors)


def _factors(middle: Floats, normal: Floats, corners: Floats, surface: Whole) -> Floats:
    """Form factors from middles to rectangles: Lambert's sum over edges of angle times (edge normal · n) / 2π."""
    count = len(middle)
    result = np.zeros((count, count))
    for i in range(count):
        to = corners - middle[i]
        to = to / np.maximum(np.linalg.norm(to, axis=-1, keepdims=True), 1e-12)
        following = np.roll(to, -1, axis=1)
        across = np.cross(to, following)
        length = np.linalg.norm(across, axis=-1)
        angle = np.arctan2(length, np.sum(to * following, axis=-1))
        share = angle * (across @ normal[i]) / np.maximum(length, 1e-12)
        result[i] = np.abs(share.sum(axis=1)) / (2.0 * math.pi)
        result[i, surface == surface[i]] = 0.0
    return result


@functools.lru_cache(maxsize=8)
def gathered(
    size: tuple[float, float, float],
    sensors: tuple[tuple[float, float], ...],
    distance_m: float,
    half_angle_deg: float,
    aperture_m: float,
) -> Any:
    """Sparse matrix from the patches' exitance [lm/m²] to the sensors' illuminance [lx].

    ``sensors`` are their gamma and C [deg]; raises `ConfigError` where one is outside the room.
    """
    from scipy import sparse

    gamma, c = np.array(sensors).T
    toward = vector(gamma, c)
    places = distance_m * toward
    limit = np.array([size[0] / 2, size[1] / 2, size[2]])
    if np.any(np.abs(places) > limit) or np.any(places[:, 2] > 1e-9):
        raise ConfigError(f"sensors {distance_m:g} m from the aperture do not fit into a room of {size} m")
    local = _cone(half_angle_deg)
    rows, columns = [], []
    for k, (axis, place) in enumerate(zip(-toward, places, strict=True)):
        side = np.cross(axis, [0.0, 0.0, 1.0] if abs(axis[2]) < 0.9 else [1.0, 0.0, 0.0])
        side /= np.linalg.norm(side)
        looks = local[:, :1] * side + local[:, 1:2] * np.cross(axis, side) + local[:, 2:] * axis
        seen, patch = _meet(size, place, looks, aperture_m)
        rows.append(np.full(int(seen.sum()), k))
        columns.append(patch[seen])
    # E = ∫ L cos dω; looks are cosine-weighted, so each carries π sin²(half angle) / LOOKS of it, and L = M / π
    weight = math.sin(math.radians(half_angle_deg)) ** 2 / LOOKS
    where = (np.concatenate(rows), np.concatenate(columns))
    return sparse.csr_matrix((np.full(len(where[0]), weight), where), shape=(len(places), 6 * CELLS**2))


def _cone(half_angle_deg: float) -> Floats:
    """Cosine-weighted directions (LOOKS, 3) in a cone about z: Fibonacci points on the projected disc."""
    k = np.arange(LOOKS) + 0.5
    r = math.sin(math.radians(half_angle_deg)) * np.sqrt(k / LOOKS)
    phi = k * math.pi * (3.0 - math.sqrt(5.0))
    return np.stack([r * np.cos(phi), r * np.sin(phi), np.sqrt(1.0 - r**2)], axis=1)


def _meet(
    size: tuple[float, float, float], place: Floats, looks: Floats, aperture_m: float
) -> tuple[NDArray[np.bool_], Whole]:
    """The patch that each look from a place inside the room meets, and whether that is not the aperture."""
    half = np.array(size) / 2.0
    start = place + np.array([0.0, 0.0, half[2]])  # now the room is centred
    with np.errstate(divide="ignore"):
        t = np.where(looks != 0.0, (np.copysign(half, looks) - start) / looks, np.inf)
    axis = np.argmin(t, axis=1)
    one = np.arange(len(looks))
    hit = np.clip((start + looks * t[one, axis][:, None]) / half, -1.0, 1.0)
    positive = looks[one, axis] > 0.0
    surface = np.choose(axis, [np.where(positive, 0, 1), np.where(positive, 2, 3), np.where(positive, 5, 4)])
    other = np.choose(axis, [1, 0, 0]), np.choose(axis, [2, 2, 1])
    i, j = (np.minimum(((hit[one, o] + 1.0) / 2.0 * CELLS).astype(np.int64), CELLS - 1) for o in other)
    radius = np.hypot(hit[:, 0] * half[0], hit[:, 1] * half[1])
    return (surface != 5) | (radius > aperture_m), surface * CELLS**2 + i * CELLS + j
