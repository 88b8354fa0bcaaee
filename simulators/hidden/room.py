"""The dark room as it is: walls, floor and ceiling give back a little of the light, and sensors see it.

Radiosity on patches (Goral, Torrance, Greenberg, Battaile 1984, doi:10.1145/964965.808601): every patch is matt and
evenly lit; exchange is by form factors, and the sum over all bounces is solved, not truncated.

Frame: the aperture's centre in the middle of the ceiling is the origin; x east, y north, z up.
"""

import math
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray

from simulators.hidden.maps import Field

Floats = NDArray[np.float64]

ACROSS = 11
"""Patches across each face: 6 x 11 x 11 = 726."""


@dataclass(frozen=True)
class Panel:
    """Something bright in one place: whatever part of the room lies within a cone seen from the aperture.

    Attributes
    ----------
    gamma_deg, c_deg, half_angle_deg
        Middle and half width of the cone [deg].
    reflectance
        Of the surface there.
    """

    gamma_deg: float
    c_deg: float
    half_angle_deg: float
    reflectance: float


@dataclass(frozen=True)
class Room:
    """A dark room.

    Attributes
    ----------
    size_m
        East-west, north-south, height [m].
    walls, floor, ceiling
        Reflectances.
    half_angle_deg
        What the sensors' shields let through, from the sensor's axis [deg].
    panel
        One surface that differs, or none.
    """

    size_m: tuple[float, float, float] = (5.486, 5.486, 5.486)
    walls: float = 0.0
    floor: float = 0.0
    ceiling: float = 0.0
    half_angle_deg: float = 60.0
    panel: Panel | None = None

    def black(self) -> bool:
        """Whether no surface gives back any light."""
        return self.walls == self.floor == self.ceiling == 0.0 and self.panel is None

    def exitance(self, field: Field) -> Floats:
        """Exitance of every patch [lm/m²] with all inter-reflections, shape (patches,)."""
        return np.asarray(np.linalg.solve(self._system(), self.first_exitance(field)))

    def first_exitance(self, field: Field) -> Floats:
        """Exitance of every patch [lm/m²] from the aperture's light alone, shape (patches,)."""
        patches = _patches(self.size_m)
        return self._reflectances(patches) * _first_light(patches, field)

    def transfer(self, seen: Floats) -> Floats:
        """Illuminance [lx] at sensors per first exitance of each patch, (n, patches), from `seen` for those sensors."""
        return np.asarray(np.linalg.solve(self._system().T, seen.T).T)

    def added(self, field: Field, places: Floats, aims: Floats) -> Floats:
        """Illuminance [lx] that the room adds at sensors at ``places`` (n, 3) [m], facing ``aims`` (n, 3)."""
        if self.black():
            return np.zeros(len(places))
        return self.seen(places, aims) @ self.exitance(field)

    def _system(self) -> Floats:
        reflectance = self._reflectances(_patches(self.size_m))
        return np.eye(len(reflectance)) - reflectance[:, None] * _form_factors(self.size_m)

    def seen(self, places: Floats, aims: Floats) -> Floats:
        """Share of each patch's exitance that arrives at each sensor, within its shields, shape (n, patches)."""
        patches = _patches(self.size_m)
        total = np.zeros((len(places), len(patches.centre)))
        parts = 4
        limit = math.cos(math.radians(self.half_angle_deg))
        for a in (np.arange(parts) + 0.5) / parts - 0.5:
            for b in (np.arange(parts) + 0.5) / parts - 0.5:
                spots = patches.centre + a * patches.first + b * patches.second
                way = spots[None] - places[:, None]
                d2 = np.sum(way**2, axis=-1)
                way /= np.sqrt(d2)[..., None]
                here = np.einsum("ijk,ik->ij", way, aims)
                there = -np.einsum("ijk,jk->ij", way, patches.normal)
                area = patches.area / parts**2
                # a disc of the part's area instead of a point keeps a sensor close to a wall finite
                share = area * here * np.maximum(0.0, there) / (math.pi * d2 + area)
                total += np.where(here >= limit, share, 0.0)
        return total

    def _reflectances(self, patches: "_Patches") -> Floats:
        values = np.array([self.floor, self.ceiling, *[self.walls] * 4])[patches.face]
        if self.panel is not None:
            from labdaq.directions import angle_between, vector

            towards = patches.centre / np.maximum(1e-9, np.linalg.norm(patches.centre, axis=-1, keepdims=True))
            angle = angle_between(towards, vector(self.panel.gamma_deg, self.panel.c_deg))
            values = np.where(angle < self.panel.half_angle_deg, self.panel.reflectance, values)
        return values


@dataclass(frozen=True)
class _Patches:
    """Patches of a box: centres, the two edges, normals into the room (n, 3); areas and faces (n,)."""

    centre: Floats
    first: Floats
    second: Floats
    normal: Floats
    area: Floats
    face: NDArray[np.int64]


@cache
def _patches(size_m: tuple[float, float, float]) -> _Patches:
    x, y, z = size_m
    ex, ey, ez = np.eye(3)
    faces = [  # middle, two edges, normal
        (-z * ez, x * ex, y * ey, ez),
        (0 * ez, x * ex, y * ey, -ez),
        (0.5 * x * ex - 0.5 * z * ez, y * ey, z * ez, -ex),
        (-0.5 * x * ex - 0.5 * z * ez, y * ey, z * ez, ex),
        (0.5 * y * ey - 0.5 * z * ez, x * ex, z * ez, -ey),
        (-0.5 * y * ey - 0.5 * z * ez, x * ex, z * ez, ey),
    ]
    steps = (np.arange(ACROSS) + 0.5) / ACROSS - 0.5
    rows: list[list[Floats]] = [[], [], [], []]
    number = []
    for k, (middle, first, second, normal) in enumerate(faces):
        for a in steps:
            for b in steps:
                values = (middle + a * first + b * second, first / ACROSS, second / ACROSS, normal)
                for row, value in zip(rows, values, strict=True):
                    row.append(value)
                number.append(k)
    centre, edge_a, edge_b, inward = (np.array(row) for row in rows)
    area = np.linalg.norm(edge_a, axis=1) * np.linalg.norm(edge_b, axis=1)
    return _Patches(centre, edge_a, edge_b, inward, area, np.array(number))


@cache
def _form_factors(size_m: tuple[float, float, float]) -> Floats:
    """Share of a patch's light that goes to each other, (patches, patches): rows sum to 1, as the room is closed."""
    p = _patches(size_m)
    factors = np.zeros((len(p.area), len(p.area)))
    corners = [(a, b) for a in (-0.25, 0.25) for b in (-0.25, 0.25)]
    for a, b in corners:
        start = p.centre + a * p.first + b * p.second
        for c, d in corners:
            end = p.centre + c * p.first + d * p.second
            # products of matrices, not of each pair's vectors
            d2 = np.sum(start**2, axis=1)[:, None] + np.sum(end**2, axis=1)[None] - 2.0 * start @ end.T
            np.fill_diagonal(d2, 1.0)
            here = p.normal @ end.T - np.sum(p.normal * start, axis=1)[:, None]
            there = start @ p.normal.T - np.sum(p.normal * end, axis=1)[None]
            factors += np.maximum(0.0, here) * np.maximum(0.0, there) / d2**2
    factors *= p.area[None] / (16.0 * math.pi)
    np.fill_diagonal(factors, 0.0)
    return np.asarray(factors / factors.sum(axis=1, keepdims=True))


def _first_light(patches: _Patches, field: Field) -> Floats:
    """Illuminance of every patch straight from the aperture [lx], the mean of nine places on it."""
    thirds = (-1.0 / 3.0, 0.0, 1.0 / 3.0)
    spots = np.stack([patches.centre + a * patches.first + b * patches.second for a in thirds for b in thirds])
    distance = np.maximum(0.3, np.linalg.norm(spots, axis=-1))
    towards = spots / distance[..., None]
    cosine = np.maximum(0.0, -np.sum(towards * patches.normal, axis=-1))
    lit = (patches.face != 1) & (towards[..., 2] < -1e-6)
    level = np.zeros(distance.shape)
    level[lit] = field.intensity(towards[lit], np.maximum(2.0, distance[lit]))
    return np.asarray(np.mean(level * cosine / distance**2, axis=0))
