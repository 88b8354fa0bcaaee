"""The three skylight systems as solids that rays can meet.

Frame: x east, y north, z up; the exit aperture lies at z = 0 with its centre in the origin, the well rises to z =
depth, and the cover stands on it. Lengths in metres (the sheets' own structure is in millimetres).
"""

import math
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from simulators.hidden.lens import Lens, LensNumbers, Table, rows

FLAT, PYRAMID, DOME = 0, 1, 2


@dataclass(frozen=True)
class Defect:
    """Something broken in one place; all zero in a sound skylight.

    Attributes
    ----------
    sector_deg
        Compass sector of the cover, from and to, clockwise [deg], that is dirty or fogged.
    gap_m
        Lowest and highest point of a strip of wall that swallows light [m above the exit].
    gap_azimuth_deg
        Compass direction of the middle of that strip, which spans a quarter of the way round [deg].
    """

    sector_deg: tuple[float, float] = (0.0, 0.0)
    gap_m: tuple[float, float] = (0.0, 0.0)
    gap_azimuth_deg: float = 0.0


@dataclass(frozen=True)
class Skylight:
    """A skylight from its cover to its exit.

    Attributes
    ----------
    kind
        ``top``, ``box`` or ``tube``: what it is called.
    round
        A cylinder of diameter ``width_m`` instead of a box ``width_m`` (east-west) by ``length_m`` (north-south).
    cover
        ``pyramid`` (of ``rise_m``), ``flat``, or ``dome`` (spherical cap of ``rise_m``, clear, straight through).
    wall_finish
        ``specular`` (with ``wall_spread_deg`` rms error of its normal) or ``diffuse``.
    wall_scatter
        Share of reflections on a specular wall that scatter: half of them widely, half by about 25 degrees.
    boot_m, boot_reflectance
        Height and reflectance of the white diffuse ring above the exit.
    """

    kind: str
    depth_m: float
    width_m: float
    length_m: float
    round: bool
    cover: str
    rise_m: float
    entry: Lens
    exit: Lens
    wall_reflectance: float
    wall_finish: str
    wall_spread_deg: float = 0.0
    wall_scatter: float = 0.0
    boot_m: float = 0.0
    boot_reflectance: float = 0.85
    defect: Defect = Defect()

    @property
    def aperture_m2(self) -> float:
        """Area of the exit [m²]."""
        return math.pi * self.width_m**2 / 4.0 if self.round else self.width_m * self.length_m

    def turned(self, degrees: float) -> "Skylight":
        """The same skylight with both lens patterns turned counter-clockwise, seen from above."""
        entry = replace(self.entry, orientation_deg=self.entry.orientation_deg + degrees)
        leaving = replace(self.exit, orientation_deg=self.exit.orientation_deg + degrees)
        return replace(self, entry=entry, exit=leaving)

    def numbers(self) -> "SkylightNumbers":
        """Return the same as the tracer takes it."""
        cover = {"pyramid": PYRAMID if self.rise_m > 0.0 else FLAT, "dome": DOME, "flat": FLAT}[self.cover]
        half = np.array([self.width_m / 2.0, self.length_m / 2.0])
        return SkylightNumbers(
            round=self.round,
            half_x=float(half[0]),
            half_y=float(half[1]),
            depth=self.depth_m,
            cover=cover,
            rise=self.rise_m if cover != FLAT else 0.0,
            panes=rows(_panes(float(half[0]), float(half[1]), self.depth_m, self.rise_m, cover)),
            frames=tuple(
                rows(frame)
                for frame in _frames(float(half[0]), float(half[1]), self.rise_m, cover, self.entry.orientation_deg)
            ),
            exit_frame=rows(_turned_frame(self.exit.orientation_deg, up=True)),
            entry=self.entry.numbers(),
            exit=self.exit.numbers(),
            diffuse=self.wall_finish == "diffuse",
            reference_reflectance=self.wall_reflectance,
            wall_spread=math.radians(self.wall_spread_deg),
            scatter=self.wall_scatter,
            boot=self.boot_m,
            boot_reflectance=self.boot_reflectance,
            sector_from=math.radians(self.defect.sector_deg[0]),
            sector_width=math.radians(self.defect.sector_deg[1] - self.defect.sector_deg[0]),
            gap_low=self.defect.gap_m[0],
            gap_high=self.defect.gap_m[1],
            gap_azimuth=math.radians(self.defect.gap_azimuth_deg),
        )


class SkylightNumbers(NamedTuple):
    """A skylight as the tracer takes it.

    ``panes``: outward normal and offset of the cover's four panes, and of the plane of the entry. ``frames``: per pane,
    the sheet's axes in the world's frame (z towards the prisms); ``exit_frame`` likewise.
    """

    round: bool
    half_x: float
    half_y: float
    depth: float
    cover: int
    rise: float
    panes: Table
    frames: tuple[Table, ...]
    exit_frame: Table
    entry: LensNumbers
    exit: LensNumbers
    diffuse: bool
    reference_reflectance: float
    wall_spread: float
    scatter: float
    boot: float
    boot_reflectance: float
    sector_from: float
    sector_width: float
    gap_low: float
    gap_high: float
    gap_azimuth: float


def _turned_frame(orientation_deg: float, up: bool) -> NDArray[np.float64]:
    """Axes of a horizontal sheet: its x towards east and its y towards north before it is turned."""
    c, s = math.cos(math.radians(orientation_deg)), math.sin(math.radians(orientation_deg))
    return np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0 if up else -1.0]])


def _frames(half_x: float, half_y: float, rise: float, cover: int, orientation_deg: float) -> NDArray[np.float64]:
    """Axes of the four panes: seen from above, the pattern's x lies over east and its y over north on all of them."""
    flat = _turned_frame(orientation_deg, up=False)
    if cover != PYRAMID:
        return np.stack([flat] * 4)
    frames = []
    for side in (1.0, -1.0):  # panes facing east, west
        slope = np.array([half_x, 0.0, -side * rise]) / math.hypot(half_x, rise)
        frames.append(
            np.stack([slope, [0.0, 1.0, 0.0], -np.array([side * rise, 0.0, half_x]) / math.hypot(half_x, rise)])
        )
    for side in (1.0, -1.0):  # panes facing north, south
        slope = np.array([0.0, half_y, -side * rise]) / math.hypot(half_y, rise)
        frames.append(
            np.stack([[1.0, 0.0, 0.0], slope, -np.array([0.0, side * rise, half_y]) / math.hypot(half_y, rise)])
        )
    turn = np.array([[flat[0, 0], flat[0, 1], 0.0], [flat[1, 0], flat[1, 1], 0.0], [0.0, 0.0, 1.0]])
    return np.stack([turn @ frame for frame in frames])


def _panes(half_x: float, half_y: float, depth: float, rise: float, cover: int) -> NDArray[np.float64]:
    """Outward normals and offsets (n · p = offset) of the panes facing east, west, north, south, and the entry."""
    planes = np.zeros((5, 4))
    planes[4] = (0.0, 0.0, -1.0, -depth)
    if cover == PYRAMID:
        apex = np.array([0.0, 0.0, depth + rise])
        normals = [(rise, 0.0, half_x), (-rise, 0.0, half_x), (0.0, rise, half_y), (0.0, -rise, half_y)]
        for i, normal in enumerate(normals):
            n = np.array(normal) / np.linalg.norm(normal)
            planes[i] = (*n, n @ apex)
    return planes


def top(**changes: object) -> Skylight:
    """Pyramid of prismatic sheet on a white well, nothing below."""
    plain = Skylight("top", 0.6096, 0.6096, 0.6096, False, "pyramid", 0.15, Lens(), Lens(kind="none"), 0.85, "diffuse")
    return replace(plain, **changes)  # type: ignore[arg-type]


def box(**changes: object) -> Skylight:
    """Pyramid of prismatic sheet, mirror well, flat prismatic sheet below (prisms up)."""
    plain = Skylight("box", 0.61, 0.6096, 0.6096, False, "pyramid", 0.15, Lens(), Lens(), 0.95, "specular")
    return replace(plain, **changes)  # type: ignore[arg-type]


def tube(**changes: object) -> Skylight:
    """Clear dome, mirror tube, white boot, flat prismatic sheet below (prisms up)."""
    clear = Lens(kind="clear", absorption_per_mm=0.0)
    plain = Skylight("tube", 0.9144, 0.3556, 0.3556, True, "dome", 0.12, clear, Lens(), 0.98, "specular", boot_m=0.08)
    return replace(plain, **changes)  # type: ignore[arg-type]
