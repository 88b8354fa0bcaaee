"""A skylight as a Radiance scene: what the kernels hold in closed form, here as surfaces and materials.

Millimetres; the aperture in z = 0, the sky above. Mirror walls are ``BRTDfunc`` with a constant reflectance, because
``metal`` grows brighter at grazing angles. Scattering walls (a spread mirror direction) have no counterpart here.
"""

import math
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path
from typing import Final

import numpy as np

from analysis.simulate.components import Lens, Wall
from analysis.simulate.system import System
from labdaq.errors import Problems, SimulationError

Vector = tuple[float, float, float]

_DOME_RINGS, _DOME_SECTORS = 24, 64

UNITS_PER_M: Final = 1000.0
"""Radiance takes points within 1e-6 squared units of an edge as inside a polygon. In metres neighbouring panes then
overlap by that much, and 2 % of the rays through a dome of 1500 panes pass two of them."""


def scene_text(
    system: System,
    lens_files: dict[str, Path],
    suns: list[tuple[float, float, float]],
    half_angle_deg: float,
    *,
    sky_data: bool = False,
) -> str:
    """The scene description.

    ``lens_files``: BSDF files of the prismatic lenses by place; ``suns``: unit vectors of suns of this half angle and
    radiance 1, each under a modifier of its own (``sun0``, ``sun1``, ...), as is the sky (``skyglow``, radiance 1, or
    that of the table ``sky.dat`` over the ``alt`` and ``azi`` of ``sky.cal``).
    Raises `SimulationError` for what the engine cannot do.
    """
    lines = []
    kind = "light {} 0 0 3 1 1 1" if sees_sun_directly(system) else "glow {} 0 0 4 1 1 1 0"
    for k, (x, y, z) in enumerate(suns):  # before the sky: of distant sources in line a ray meets the first
        lines.append("void " + kind.format(f"sun{k}"))
        lines.append(f"sun{k} source disc{k} 0 0 4 {x:.9f} {y:.9f} {z:.9f} {2.0 * half_angle_deg:.6f}")
    if sky_data:
        lines.append("void brightdata skydata 5 noop sky.dat sky.cal alt azi 0 0")
    lines.append(f"{'skydata' if sky_data else 'void'} glow skyglow 0 0 4 1 1 1 0")
    lines.append("skyglow source sky 0 0 4 0 0 1 180")
    return "\n".join(lines) + "\n" + surfaces_text(system, lens_files)


def surfaces_text(system: System, lens_files: dict[str, Path]) -> str:
    """The skylight, a black roof around it and its obstructions, without any light source; see `scene_text`."""
    check(system)
    parts = (
        _well(system),
        _roof(system),
        _cover(system, lens_files.get("entry")),
        _exit(system, lens_files.get("exit")),
        _obstructions(system),
    )
    return "\n".join(line for part in parts for line in part) + "\n"


def check(system: System) -> None:
    """Raise one `SimulationError` that lists what of a system this engine cannot do."""
    problems = Problems(f"system {system.name}, Radiance engine")
    for place, lens in (("entry", system.entry), ("exit", system.exit)):
        for name in ("haze", "soiling", "isotropic"):
            if lens.kind != "none" and getattr(lens, name):
                problems.add(f"{place}.{name}", "has no counterpart")
        if lens.kind == "shift":
            problems.add(f"{place}.kind", "a density of shifts has no counterpart")
        if lens.kind == "bsdf" and lens.mirrored:
            problems.add(f"{place}.mirrored", "a file cannot be mirrored")
    walls = [("wall", system.wall)] + ([("boot", system.boot)] if system.boot_height_m > 0.0 else [])
    for place, wall in walls:
        if wall.scatter_deg > 0.0 and wall.lambertian < 1.0:
            problems.add(f"{place}.scatter_deg", "a spread mirror direction has no counterpart")
    if system.aperture.shape == "disc" and system.entry.kind in ("prismatic", "bsdf") and system.rise_m > 0:
        problems.add("entry.kind", "a prismatic dome has no counterpart")
    problems.raise_if_any(SimulationError, "use --engine tracer")


def sees_sun_directly(system: System) -> bool:
    """Whether the cover scatters, so that Radiance can look from it straight at the sun (a ``light``).

    Through a clear cover the sun's image goes down the mirror well by reflections that only a sampled ray follows; then
    the sun must be something that a ray may run into (a ``glow``).
    """
    return system.entry.kind in ("prismatic", "diffusing", "bsdf")


def _wall_material(name: str, wall: Wall) -> str:
    diffuse = wall.reflectance * wall.lambertian
    mirror = wall.reflectance - diffuse
    return (
        f"void BRTDfunc {name} 10 {mirror:.6f} {mirror:.6f} {mirror:.6f} 0 0 0 0 0 0 . 0 9 "
        f"{diffuse:.6f} {diffuse:.6f} {diffuse:.6f} {diffuse:.6f} {diffuse:.6f} {diffuse:.6f} 0 0 0"
    )


def _well(system: System) -> Iterator[str]:
    parts = [("well", system.wall, system.boot_height_m, system.well_depth_m)]
    if system.boot_height_m > 0.0:
        parts.append(("boot", system.boot, 0.0, system.boot_height_m))
    for name, wall, low, high in parts:
        yield _wall_material(f"{name}_wall", wall)
        if system.aperture.shape == "disc":
            radius = system.aperture.diameter_m / 2
            yield f"{name}_wall tube {name} 0 0 7 {_units(0.0, 0.0, low, 0.0, 0.0, high, radius)}"
            continue
        ring = [_turned(system, x, y) for x, y in _corners(system)]
        for k, (a, b) in enumerate(zip(ring, ring[1:] + ring[:1], strict=True)):
            yield polygon(f"{name}_wall", f"{name}{k}", [(*b, low), (*a, low), (*a, high), (*b, high)])


def _roof(system: System) -> Iterator[str]:
    """A black roof around the cover: light comes in through the cover alone."""
    yield "void plastic black 0 0 5 0 0 0 0 0"
    if system.aperture.shape == "disc":
        top, inside = _units(0.0, 0.0, system.well_depth_m), _units(system.aperture.diameter_m / 2, 20.0)
        yield f"black ring roof 0 0 8 {top} 0 0 1 {inside}"
        return
    inner = _corners(system)
    for k, (a, b) in enumerate(zip(inner, inner[1:] + inner[:1], strict=True)):
        far = [(50.0 * x, 50.0 * y) for x, y in (b, a)]
        points = [_turned(system, x, y) for x, y in (a, b, *far)]
        yield polygon("black", f"roof{k}", [(x, y, system.well_depth_m) for x, y in points])


def _obstructions(system: System) -> Iterator[str]:
    """What stands around the skylight, black; ``rotation_deg`` does not turn it."""
    for k, it in enumerate(system.obstructions):
        yield polygon("black", f"obstruction{k}", it.corners)


def _cover(system: System, bsdf: Path | None) -> Iterator[str]:
    lens = system.entry
    if lens.kind == "none":
        return
    top = system.well_depth_m
    if system.aperture.shape == "disc":
        yield lens_material("entry", lens, bsdf, _up(system, lens, (0.0, 0.0, 1.0)))
        # a BSDF's z axis, the normal, runs from the flat side to the prisms
        down = lens.prisms == "down"
        yield from _dome(system) if system.rise_m > 0.0 else [_disc("entry", system, top, down=down)]
        return
    corners = _corners(system)
    if system.rise_m == 0.0:
        yield lens_material("entry", lens, bsdf, _up(system, lens, (0.0, 0.0, 1.0)))
        flat = [(*_turned(system, x, y), top) for x, y in corners]
        yield polygon("entry", "cover", flat[::-1] if lens.prisms == "down" else flat)
        return
    sides = zip(corners, corners[1:] + corners[:1], _outward(system), strict=True)
    for k, (a, b, outward) in enumerate(sides):
        name = f"entry{k}"
        yield lens_material(name, lens, bsdf, _up(system, lens, outward))
        facet = [(*_turned(system, *a), top), (*_turned(system, *b), top), (0.0, 0.0, top + system.rise_m)]
        yield polygon(name, f"cover{k}", facet[::-1] if lens.prisms == "down" else facet)


def _outward(system: System) -> list[Vector]:
    """Normals of the cover's panes before ``rotation_deg`` turns them: of the flat sheet, or of the pyramid's four."""
    if system.rise_m == 0.0:
        return [(0.0, 0.0, 1.0)]
    corners, found = _corners(system), []
    for a, b in zip(corners, corners[1:] + corners[:1], strict=True):
        normal = np.cross(np.array([b[0] - a[0], b[1] - a[1], 0.0]), np.array([-a[0], -a[1], system.rise_m]))
        x, y, z = normal / np.linalg.norm(normal)
        found.append((float(x), float(y), float(z)))
    return found


def on_panes(system: System, toward: Vector) -> list[Vector]:
    """A direction above the roof in the frames of the cover's panes' BSDFs; only panes that it sees from above."""
    found = []
    for normal in _outward(system):
        (nx, ny, nz), y = _turned3(system, normal), np.array(_up(system, system.entry, normal))
        z = np.array([nx, ny, nz]) * (-1.0 if system.entry.prisms == "down" else 1.0)
        if np.dot((nx, ny, nz), toward) > 0.0:
            a, b, c = (float(axis @ np.array(toward)) for axis in (np.cross(y, z), y, z))
            found.append((a, b, c))
    return found


def _exit(system: System, bsdf: Path | None) -> Iterator[str]:
    lens = system.exit
    if lens.kind == "none":
        return
    up_side = lens.prisms == "up"
    yield lens_material("exit", lens, bsdf, _up(system, lens, (0.0, 0.0, 1.0)))
    if system.aperture.shape == "disc":
        yield _disc("exit", system, 0.0, down=not up_side)
        return
    corners = [(*_turned(system, x, y), 0.0) for x, y in _corners(system)]
    yield polygon("exit", "lens", corners if up_side else corners[::-1])


def lens_material(name: str, lens: Lens, bsdf: Path | None, up: tuple[float, float, float]) -> str:
    """A material for a lens: ``glass`` (Fresnel, inter-reflections), a BSDF file, or a diffuser."""
    if lens.kind == "clear":
        # transmissivity of one straight pass; the material adds path length, Fresnel and inter-reflections
        pass_ = math.exp(-lens.absorption_per_mm * lens.thickness_mm)
        return f"void glass {name} 0 0 4 {pass_:.6f} {pass_:.6f} {pass_:.6f} {lens.refractive_index:.6f}"
    if lens.kind == "diffusing":
        t, r = lens.transmittance, lens.reflectance
        return f"void BRTDfunc {name} 10 0 0 0 0 0 0 0 0 0 . 0 9 {r} {r} {r} {r} {r} {r} {t} {t} {t}"
    if bsdf is None:
        raise SimulationError(f"{name}: the lens needs a BSDF file")
    return f"void BSDF {name} 6 0 {bsdf.name} {up[0]:.9f} {up[1]:.9f} {up[2]:.9f} . 0 0"


def polygon(material: str, name: str, points: list[tuple[float, float, float]]) -> str:
    """One polygon; seen from its normal the points run counter-clockwise."""
    return f"{material} polygon {name} 0 0 {3 * len(points)} {_units(*(value for point in points for value in point))}"


def _units(*metres: float) -> str:
    return " ".join(f"{UNITS_PER_M * value:.7f}" for value in metres)


def _disc(material: str, system: System, z: float, *, down: bool) -> str:
    normal = "0 0 -1" if down else "0 0 1"
    radius = _units(0.0, system.aperture.diameter_m / 2)
    return f"{material} ring {material}_disc 0 0 8 {_units(0.0, 0.0, z)} {normal} {radius}"


def _dome(system: System) -> Iterator[str]:
    """The spherical cap as flat panes; their number keeps the cap's height to a thousandth."""
    radius = system.aperture.diameter_m / 2
    sphere = (radius**2 + system.rise_m**2) / (2.0 * system.rise_m)
    edge = math.asin(min(1.0, radius / sphere))
    if system.rise_m > sphere:
        edge = math.pi - edge
    rings = [edge * k / _DOME_RINGS for k in range(_DOME_RINGS + 1)]
    base = system.well_depth_m + system.rise_m - sphere

    def point(polar: float, k: int) -> tuple[float, float, float]:
        turn = 2.0 * math.pi * k / _DOME_SECTORS
        ring = sphere * math.sin(polar)
        return ring * math.cos(turn), ring * math.sin(turn), base + sphere * math.cos(polar)

    for i, (inner, outer) in enumerate(pairwise(rings)):
        for k in range(_DOME_SECTORS):
            corners = [point(outer, k), point(outer, k + 1), point(inner, k + 1), point(inner, k)]
            yield polygon("entry", f"dome{i}_{k}", corners if inner > 0.0 else corners[:3])


def _corners(system: System) -> list[tuple[float, float]]:
    ax, ay = (side / 2 for side in system.aperture.size_m)
    return [(-ax, -ay), (ax, -ay), (ax, ay), (-ax, ay)]


def _turned(system: System, x: float, y: float) -> tuple[float, float]:
    turn = math.radians(system.rotation_deg)
    return math.cos(turn) * x - math.sin(turn) * y, math.sin(turn) * x + math.cos(turn) * y


def _up(system: System, lens: Lens, normal: tuple[float, float, float]) -> tuple[float, float, float]:
    """The pattern's y axis in space: the world's x laid onto the sheet, a quarter turn on, then turned by the lens."""
    n = np.array(normal)
    x = np.array([1.0, 0.0, 0.0])
    east = x - (x @ n) * n
    east /= np.linalg.norm(east)
    turn = math.radians(-lens.orientation_deg if lens.mirrored else lens.orientation_deg)
    up = math.cos(turn) * np.cross(n, east) - math.sin(turn) * east
    if lens.kind == "bsdf" and lens.prisms == "down":  # the front is up: y looks south
        up = -up
    return _turned3(system, (up[0], up[1], up[2]))


def _turned3(system: System, v: Vector) -> Vector:
    x, y = _turned(system, v[0], v[1])
    return x, y, v[2]
