"""A skylight as closed solids of triangles: cover, well, boot and exit lens, each a body of its own.

The surface that the engines work with is the lower side of the cover, the inner side of well and boot, and the upper
side of the exit lens; thickness lies behind it. Prisms are not in the solids: a lens is a smooth sheet, and its BSDF
says what it does. Curves are polygons inscribed in them.
"""

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from analysis.simulate.components import Lens
from analysis.simulate.system import System

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

WALL_M: Final = 0.002
"""Thickness of well and boot in the solids."""

SECTORS: Final = 96
RINGS: Final = 24


@dataclass(frozen=True, eq=False)
class Solid:
    """A closed body.

    Attributes
    ----------
    name
        ``cover``, ``well``, ``boot`` or ``exit``.
    vertices : shape (n, 3) [m]
        x east, y north, z up; origin in the centre of the aperture.
    triangles : shape (m, 3)
        Seen from outside counter-clockwise; every edge belongs to two of them, once in each direction.
    """

    name: str
    vertices: Floats
    triangles: Ints

    @property
    def volume_m3(self) -> float:
        """Enclosed volume (divergence theorem), positive when the triangles look outwards."""
        a, b, c = (self.vertices[self.triangles[:, k]] for k in range(3))
        return float(np.sum(a * np.cross(b, c)) / 6.0)


def solids(system: System) -> list[Solid]:
    """The bodies of a skylight, from the top down; a place without a lens has none."""
    outline = _outline(system)
    made: list[Solid] = []
    if system.entry.kind != "none":
        made.append(_sheet("cover", *_cover(system, outline), 0.0, _thickness(system.entry)))
    made.append(_ring("well", outline, system.boot_height_m, system.well_depth_m))
    if system.boot_height_m > 0.0:
        made.append(_ring("boot", outline, 0.0, system.boot_height_m))
    if system.exit.kind != "none":
        flat, triangles, rim = _flat(outline, 0.0)
        made.append(_sheet("exit", flat, triangles, rim, -_thickness(system.exit), 0.0))
    turn = math.radians(system.rotation_deg)
    to_site = np.array([[math.cos(turn), math.sin(turn), 0.0], [-math.sin(turn), math.cos(turn), 0.0], [0.0, 0.0, 1.0]])
    return [Solid(body.name, body.vertices @ to_site, body.triangles) for body in made]


def _thickness(lens: Lens) -> float:
    return lens.thickness_mm / 1000.0


def _outline(system: System) -> Floats:
    """Corners (n, 2) of well and aperture, counter-clockwise seen from above."""
    if system.aperture.shape == "disc":
        turn = 2.0 * math.pi * np.arange(SECTORS) / SECTORS
        return system.aperture.diameter_m / 2 * np.stack([np.cos(turn), np.sin(turn)], axis=1)
    ax, ay = (side / 2 for side in system.aperture.size_m)
    return np.array([(-ax, -ay), (ax, -ay), (ax, ay), (-ax, ay)])


def _cover(system: System, outline: Floats) -> tuple[Floats, Ints, Ints]:
    """Lower surface of the cover: vertices, triangles seen from above counter-clockwise, and the rim."""
    top = system.well_depth_m
    if system.rise_m == 0.0:
        return _flat(outline, top)
    if system.aperture.shape == "rectangle":
        vertices = np.vstack([np.column_stack([outline, np.full(4, top)]), [0.0, 0.0, top + system.rise_m]])
        return vertices, np.array([(k, (k + 1) % 4, 4) for k in range(4)]), np.arange(4)
    radius = system.aperture.diameter_m / 2
    sphere = (radius**2 + system.rise_m**2) / (2.0 * system.rise_m)
    edge = math.asin(min(1.0, radius / sphere))
    points = [np.array([[0.0, 0.0, top + system.rise_m]])]
    for k in range(1, RINGS + 1):
        polar = edge * k / RINGS
        height = top + system.rise_m - sphere + sphere * math.cos(polar)
        points.append(np.column_stack([outline * (math.sin(polar) * sphere / radius), np.full(len(outline), height)]))
    n = len(outline)
    around = np.arange(n)
    after = (around + 1) % n
    triangles = [np.stack([np.zeros(n, dtype=np.int64), 1 + around, 1 + after], axis=1)]
    for k in range(1, RINGS):
        inner, outer = 1 + (k - 1) * n, 1 + k * n
        triangles.append(np.stack([inner + around, outer + around, outer + after], axis=1))
        triangles.append(np.stack([inner + around, outer + after, inner + after], axis=1))
    return np.vstack(points), np.vstack(triangles), 1 + (RINGS - 1) * n + around


def _flat(outline: Floats, z: float) -> tuple[Floats, Ints, Ints]:
    n = len(outline)
    vertices = np.column_stack([outline, np.full(n, z)])
    return vertices, np.array([(0, k, k + 1) for k in range(1, n - 1)]), np.arange(n)


def _sheet(name: str, surface: Floats, triangles: Ints, rim: Ints, low: float, high: float) -> Solid:
    """The body between a surface moved down by ``low`` and up by ``high`` [m]."""
    n = len(surface)
    vertices = np.vstack([surface + np.array([0.0, 0.0, z]) for z in (low, high)])
    after = np.roll(rim, -1)
    sides = [np.stack([rim, after, n + after], axis=1), np.stack([rim, n + after, n + rim], axis=1)]
    return Solid(name, vertices, np.vstack([triangles[:, ::-1], n + triangles, *sides]))


def _ring(name: str, outline: Floats, low: float, high: float) -> Solid:
    """The body of a wall around an outline."""
    n = len(outline)
    after_outline, before_outline = np.roll(outline, -1, axis=0), np.roll(outline, 1, axis=0)
    edge, edge_before = after_outline - outline, outline - before_outline
    normals = [
        np.stack([e[:, 1], -e[:, 0]], axis=1) / np.linalg.norm(e, axis=1, keepdims=True) for e in (edge, edge_before)
    ]
    across = normals[0] + normals[1]
    outer = outline + across * (2.0 * WALL_M / np.sum(across**2, axis=1))[:, None]
    vertices = np.vstack([np.column_stack([xy, np.full(n, z)]) for xy, z in
                          ((outline, low), (outline, high), (outer, low), (outer, high))])  # fmt: skip
    k = np.arange(n)
    after = (k + 1) % n

    def band(a: int, b: int) -> list[Ints]:
        """Triangles between loops a and b; seen from outside a lies below (or within) b, going around to the right."""
        return [
            np.stack([a * n + k, a * n + after, b * n + after], 1),
            np.stack([a * n + k, b * n + after, b * n + k], 1),
        ]

    faces = band(2, 3) + band(1, 0) + band(3, 1) + band(0, 2)
    return Solid(name, vertices, np.vstack(faces))
