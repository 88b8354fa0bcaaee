"""The rooms of CIE 171:2006, sections 5.9 to 5.14, and what an integral over the opening says of them.

CIE 171:2006 is sold, not public. Its arrangements, points and tables are retold in public by J. Thompson's
CyclesCIEtest (github.com/jjathompson4/CyclesCIEtest, test_cases_daylight.py and IMPLEMENTATION_AUDIT.md), who had the
document; errors in its tables were found there, in NVIDIA's validation of Iray (Dau Design and Consulting, 2016) and by
I. Ashdown (lightinganalysts.com, CIE 171:2006 errata). What is taken from there are facts:

* a black room of 4 m x 4 m x 3 m, walls without thickness; x goes east, y north, z up; the facade is at y = 0;
* openings in the middle of the roof (1 m x 1 m, 4 m x 4 m) or of the facade (2 m x 1 m on a sill of 1 m; 4 m x 3 m);
* the sun (for the sky's shape alone) 60 degrees high in the south; a ground of 30 % with an even luminance;
* points every half metre on the middle of the north wall (A to F, from the top), of the floor (G to N) and of the
  ceiling (G' to N'), from the north;
* 5.13: an overhang along the facade, 3 m above the floor and 0.5, 1 or 2 m deep; 5.14: a wall 6 m before the facade, 3,
  6 or 9 m high; both without ends; points A to H, on the floor;
* illuminance in percent of that of the unobstructed horizontal.

Chosen here, as the sources do not say: the glass (Fresnel, index 1.52, no absorption), and what the masks reflect. The
overhang has 5 % of a white surface's luminance in the open, which the tables' points that see nothing else imply; the
wall sends back 30 % of what the sky behind the facade and the ground throw on it.
"""

from dataclasses import dataclass
from itertools import pairwise
from typing import Final

import numpy as np
from numpy.typing import NDArray

from analysis.simulate.source import Luminance
from analysis.sky.standard import StandardSky

Floats = NDArray[np.float64]
Rectangle = tuple[Floats, Floats, Floats]
"""Corner and two edges [m]."""

TYPES: Final = tuple(range(1, 16))
GROUND: Final = 0.3
SOUTH, UP, DOWN = (np.array(v, dtype=float) for v in ((0, -1, 0), (0, 0, 1), (0, 0, -1)))
WALL_AWAY_M: Final = 6.0
ROOM_M: Final = (4.0, 4.0, 3.0)

PUBLISHED: Final = {
    ("5.9", "1 m x 1 m", ""): (1.74, 3.76, 4.55, 4.61, 4.24, 3.63, 0.96, 1.40, 2.03, 2.90, 3.97, 5.12, 6.01, 5.72),
    ("5.11", "2 m x 1 m", ""): (
        *(0.95, 1.06, 2.39, 4.93, 5.80, 5.01, 2.00, 2.80, 4.06, 6.13, 9.54, 14.57, 16.35, 5.03),
        *(0.38, 0.53, 0.75, 1.08, 1.56, 2.14, 2.40, 1.24),
    ),
    ("5.13", "2 m x 1 m", "overhang 0.5 m"): (2.00, 2.80, 4.06, 6.13, 9.54, 14.57, 14.68, 0.21),
    ("5.13", "2 m x 1 m", "overhang 1 m"): (2.00, 2.80, 4.06, 6.13, 8.73, 10.46, 7.25, 0.21),
    ("5.13", "2 m x 1 m", "overhang 2 m"): (1.90, 2.36, 2.94, 3.58, 3.97, 2.82, 0.40, 0.21),
}
"""Percent at the case's points under the CIE's sky 12, as printed (tables B.1, B.2, B.9 to B.11, B.21 to B.23). Where
the sun's side of the sky lies for the roof's rows is not told; they fit with the wall in the north."""


@dataclass(frozen=True)
class Case:
    """One room: section, opening [m], whether in the facade, whether glazed; depth or height of a mask [m]."""

    section: str
    size_m: tuple[float, float]
    facade: bool
    glazed: bool = False
    overhang_m: float = 0.0
    wall_m: float = 0.0

    @property
    def key(self) -> tuple[str, str, str]:
        """Section, opening, mask."""
        mask = (
            f"overhang {self.overhang_m:g} m" if self.overhang_m else f"wall {self.wall_m:g} m" if self.wall_m else ""
        )
        return self.section, f"{self.size_m[0]:g} m x {self.size_m[1]:g} m", mask

    @property
    def name(self) -> str:
        """For a table."""
        return " ".join(part for part in self.key if part)

    @property
    def opening(self) -> Rectangle:
        """With the normal (first edge x second) outwards."""
        a, b = self.size_m
        if self.facade:
            return np.array([2 - a / 2, 0, 1.5 - b / 2]), np.array([a, 0, 0]), np.array([0, 0, b])
        return np.array([2 - a / 2, 2 - b / 2, 3]), np.array([a, 0, 0]), np.array([0, b, 0])

    @property
    def points(self) -> list[tuple[Floats, Floats]]:
        """Places [m] and the room's side there (normal): wall, floor and ceiling, as far as the case has them."""
        high, far = np.arange(2.75, 0, -0.5), np.arange(3.75, 0, -0.5)
        wall = [(np.array([2, 4, z]), SOUTH) for z in high]
        floor = [(np.array([2, y, 0.0]), UP) for y in far]
        ceiling = [(np.array([2, y, 3.0]), DOWN) for y in far]
        if self.overhang_m or self.wall_m:
            return floor
        if self.facade:
            return wall + floor + ceiling
        return wall + floor[::-1]

    @property
    def mask(self) -> Rectangle | None:
        """What stands before the facade, 400 m long."""
        along = np.array([400.0, 0, 0])
        if self.overhang_m:
            return np.array([-198, -self.overhang_m, 3]), along, np.array([0, self.overhang_m, 0])
        if self.wall_m:
            return np.array([-198, -WALL_AWAY_M, 0]), along, np.array([0, 0, self.wall_m])
        return None

    def mask_luminance(self, kind: int) -> float:
        """Luminance of the mask where a white surface in the open has 100 / pi."""
        if self.overhang_m:
            return 0.05 * 100 / np.pi
        return GROUND * (behind(kind) + GROUND * 100 / 2) / np.pi


def world(kind: int) -> Luminance:
    """Luminance of sky and ground for 100 lx on the horizontal."""
    sky = StandardSky.of_diffuse(kind, 100.0, 60.0, 180.0).luminance

    def at(v: Floats) -> Floats:
        up = np.stack([v[..., 0], v[..., 1], np.maximum(v[..., 2], 1e-9)], axis=-1)
        return np.where(v[..., 2] > 0, sky(up / np.linalg.norm(up, axis=-1, keepdims=True)), GROUND * 100 / np.pi)

    return at


def behind(kind: int) -> float:
    """Illuminance [lx] of the sky alone on a wall that looks north."""
    n = 400
    sine, azimuth = (np.arange(n) + 0.5) / n, (np.arange(n) + 0.5) / n * np.pi
    s, a = np.meshgrid(sine, azimuth)
    c = np.sqrt(1 - s**2)
    v = np.stack([c * np.cos(a), c * np.sin(a), s], axis=-1)
    return float((world(kind)(v) * v[..., 1]).mean() * np.pi)


def pane(cosine: Floats, index: float = 1.52) -> Floats:
    """Transmittance of a clear pane (Fresnel, both polarisations, inter-reflections), apart from the engines."""
    inside = np.sqrt(1.0 - (1.0 - cosine**2) / index**2)
    rs = ((cosine - index * inside) / (cosine + index * inside)) ** 2
    rp = ((inside - index * cosine) / (inside + index * cosine)) ** 2
    return 0.5 * ((1.0 - rs) / (1.0 + rs) + (1.0 - rp) / (1.0 + rp))


def hidden(case: Case, place: Floats, to: Floats) -> NDArray[np.bool_]:
    """Whether the mask, taken without ends, stands in directions from a place."""
    with np.errstate(divide="ignore", invalid="ignore"):
        if case.overhang_m:
            y = place[1] + (3 - place[2]) / to[..., 2] * to[..., 1]
            return (to[..., 2] > 0) & (y < 0) & (y > -case.overhang_m)
        z = place[2] - (place[1] + WALL_AWAY_M) / to[..., 1] * to[..., 2]
        return (to[..., 1] < 0) & (z > 0) & (z < case.wall_m)


def integral(case: Case, types: tuple[int, ...] = TYPES, steps: int = 600) -> Floats:
    """Illuminance [%] (skies, points): L tau cos cos / d² over the opening, by the midpoint rule between its edges and
    those of mask and horizon.
    """
    corner, u, v = case.opening
    normal = np.cross(u, v)
    area, normal = float(np.linalg.norm(normal)), normal / np.linalg.norm(normal)
    skies, result = [world(kind) for kind in types], np.empty((len(types), len(case.points)))
    for k, (place, side) in enumerate(case.points):
        rows, weight = _rows(case, place, steps)
        at = corner + (np.arange(steps) + 0.5)[:, None, None] / steps * u + rows[None, :, None] * v
        to = at - place
        d2 = np.sum(to**2, axis=-1)
        to = to / np.sqrt(d2)[..., None]
        out = to @ normal
        worth = np.maximum(0, to @ side) * out / d2 * weight * (area / steps) * (pane(out) if case.glazed else 1.0)
        blocked = hidden(case, place, to) if case.mask is not None else np.zeros(d2.shape, dtype=bool)
        for j, (kind, sky) in enumerate(zip(types, skies, strict=True)):
            luminance = np.where(blocked, case.mask_luminance(kind), sky(to)) if case.mask is not None else sky(to)
            result[j, k] = float(np.sum(luminance * worth))
    return result


def _rows(case: Case, place: Floats, steps: int) -> tuple[Floats, Floats]:
    """Places along the opening's second edge and their weights, where what is seen jumps at none but between two."""
    low, high = case.opening[0][2], case.opening[0][2] + case.size_m[1]
    jumps = [place[2]]
    if case.overhang_m:
        jumps.append(3 * place[1] / (place[1] + case.overhang_m))
    if case.wall_m:
        jumps.append(case.wall_m * place[1] / (place[1] + WALL_AWAY_M))
    inside = [(z - low) / (high - low) for z in jumps if low < z < high] if case.facade else []
    rows, weights = [], []
    for start, end in pairwise([0.0, *inside, 1.0]):
        rows.append(start + (end - start) * (np.arange(steps) + 0.5) / steps)
        weights.append(np.full(steps, (end - start) / steps))
    return np.concatenate(rows), np.concatenate(weights)


_ROOF, _FACADE = ((1.0, 1.0), (4.0, 4.0)), ((2.0, 1.0), (4.0, 3.0))
CASES: Final = (
    *(Case("5.9", size, False) for size in _ROOF),
    *(Case("5.10", size, False, True) for size in _ROOF),
    *(Case("5.11", size, True) for size in _FACADE),
    *(Case("5.12", size, True, True) for size in _FACADE),
    *(Case("5.13", _FACADE[0], True, overhang_m=depth) for depth in (0.5, 1.0, 2.0)),
    *(Case("5.14", _FACADE[0], True, wall_m=height) for height in (3.0, 6.0, 9.0)),
)
