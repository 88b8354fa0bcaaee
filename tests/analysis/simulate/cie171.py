"""Rooms of CIE 171:2006 with openings to the sky (5.9 to 5.14): both engines beside an integral.

    python3 -m tests.analysis.simulate.cie171

`cie171_rooms` says what the rooms are and from where. Three ways to a number:

* **Radiance**: rays from each point through the opening, which is a skylight whose pane and mask are Radiance's.
* **The tracer at every point**: the point is a hole of 0.1 mm, a skylight without depth; the room around it and the
  mask before the opening are obstructions, and flux over area is the illuminance. It has no place for a pane.
* **The tracer on a plane**: the opening is the skylight, with its pane, and the points are those of the plane of
  sensors parallel to it: the floor below a roof, the wall opposite a facade. (Masks are left to the holes.)

A facade is a roof turned about: the engines get the hemisphere before it, sky above and ground below the horizon.
A mask's own light is its luminance times what it takes from an even sky, by a run with it and one without.
"""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from analysis.simulate.components import Aperture, Lens, Wall
from analysis.simulate.obstruction import Obstruction
from analysis.simulate.radiance.contributions import contributions
from analysis.simulate.source import Luminance, Source, skies
from analysis.simulate.system import System
from analysis.simulate.tracer import Settings, trace
from tests.analysis.simulate.cie171_rooms import CASES, DOWN, ROOM_M, SOUTH, TYPES, UP, Case, Rectangle, integral, world

Floats = NDArray[np.float64]

_NONE = Lens(kind="none")
_PANE = Lens(kind="clear", refractive_index=1.52, thickness_mm=6.0, absorption_per_mm=0.0)


def turn(normal: Floats) -> Floats:
    """Rows: axes of a frame whose z is a normal of the room (x stays east)."""
    east = np.array([1.0, 0.0, 0.0])
    return np.array([east, np.cross(normal, east), normal])


def opening_system(size_m: tuple[float, float], pane: bool = False, depth_m: float = 1e-4) -> System:
    """An opening as a skylight: no well to speak of, black sides, a pane or none."""
    return System(
        name="opening", aperture=Aperture(size_m=size_m), well_depth_m=depth_m, rise_m=0.0, entry=_NONE,
        exit=_PANE if pane else _NONE, wall=Wall(reflectance=0.0),
    )  # fmt: skip


def turned(sky: Luminance, axes: Floats) -> Luminance:
    """A luminance of the world in a frame of its own."""
    return lambda v: sky(v @ axes)


def placed(rectangle: Rectangle, place: Floats, axes: Floats) -> Obstruction:
    """A rectangle of the world as an obstruction in a frame of its own."""
    corner, u, v = rectangle
    return Obstruction(_triple(axes @ (corner - place)), _triple(axes @ u), _triple(axes @ v))


def _triple(vector: Floats) -> tuple[float, float, float]:
    x, y, z = (float(a) for a in vector)
    return x, y, z


def room(case: Case, side: Floats) -> list[Rectangle]:
    """The room's surfaces with the hole that the opening is; without the surface that looks towards ``side``."""
    x, y, z = (length * axis for length, axis in zip(ROOM_M, np.eye(3), strict=True))
    zero = np.zeros(3)
    roof, facade = (z, x, y), (zero, x, z)
    faces = [((zero, x, y), UP), ((y, x, z), SOUTH), ((zero, y, z), x), ((x, y, z), -x)]
    faces.append((facade, -SOUTH) if not case.facade else (roof, DOWN))
    solid = [rectangle for rectangle, look in faces if look @ side < 0.5]
    return solid + _frame(facade if case.facade else roof, case.opening)


def _frame(face: Rectangle, hole: Rectangle) -> list[Rectangle]:
    """A rectangle with a hole of the same orientation as four rectangles."""
    corner, u, v = face
    start, a, b = hole
    near, low = (start - corner) @ u / (u @ u), (start - corner) @ v / (v @ v)
    wide, tall = a @ u / (u @ u), b @ v / (v @ v)
    parts = [
        (corner, u, low * v),
        (corner + (low + tall) * v, u, (1 - low - tall) * v),
        (corner + low * v, near * u, tall * v),
        (corner + low * v + (near + wide) * u, (1 - near - wide) * u, tall * v),
    ]
    return [(c, p, q) for c, p, q in parts if np.linalg.norm(np.cross(p, q)) > 1e-9]


def holes(case: Case, types: tuple[int, ...] = TYPES, rays: int = 2_000_000) -> Floats:
    """Illuminance [%] (skies, points) by our tracer, each point a hole of 0.1 mm. Not for panes."""
    hole = opening_system((1e-4, 1e-4), depth_m=1e-9)
    settings = Settings(rays=rays, bounces=1, sharp_side=8, threads=0)
    found = np.empty((len(types), len(case.points)))
    for k, (place, side) in enumerate(case.points):
        axes = turn(side)
        source = skies([turned(world(kind), axes) for kind in types] + [_even])
        walls = tuple(placed(rectangle, place, axes) for rectangle in room(case, side))
        open_ = _lit(hole.replace(obstructions=walls), source, settings)
        if case.mask is None:
            found[:, k] = open_[:-1]
            continue
        mask = placed(case.mask, place, axes)
        with_mask = _lit(hole.replace(obstructions=(*walls, mask)), source, settings)
        taken = open_[-1] - with_mask[-1]
        found[:, k] = with_mask[:-1] + taken * np.array([case.mask_luminance(kind) for kind in types])
    return found


def _lit(hole: System, source: Source, settings: Settings) -> Floats:
    """Illuminance of a hole under each sky of a source."""
    flux, _ = trace(hole, source, settings).flux()
    return flux / hole.aperture_area_m2


def plane(case: Case, types: tuple[int, ...] = TYPES, rays: int = 4_000_000) -> Floats:
    """Illuminance [%] (skies, points of `parallel`) by our tracer, on the plane of sensors parallel to the opening."""
    centre, axes = _centre(case)
    at = np.array([axes @ (place - centre) for place in (case.points[k][0] for k in parallel(case))])
    settings = Settings(rays=rays, distance_m=-float(at[0, 2]), flat=True, bounces=1, threads=0)
    source = skies([turned(world(kind), axes) for kind in types])
    tally = trace(opening_system(case.size_m, case.glazed), source, settings)
    return tally.illuminance(at[:, 0], at[:, 1])[0]


def parallel(case: Case) -> list[int]:
    """Which of a case's points lie in the plane that is parallel to the opening."""
    inwards = SOUTH if case.facade else UP
    return [k for k, (_, side) in enumerate(case.points) if side @ inwards > 0.5]


def radiance(case: Case, types: tuple[int, ...] = TYPES, rays: int = 16_384) -> Floats:
    """Illuminance [%] (skies, points) by Radiance: rays from the points, drawn in proportion to cos cos / d²."""
    centre, axes = _centre(case)
    system = opening_system(case.size_m, case.glazed)
    rng = np.random.default_rng(3)
    rows, weights = zip(*(_rays(case, axes @ (p - centre), axes @ n, rays, rng) for p, n in case.points), strict=True)
    masked = system if case.mask is None else system.replace(obstructions=(placed(case.mask, centre, axes),))

    def lit(system: System, sky: Luminance) -> Floats:
        sent = np.concatenate(rows)
        return contributions(system, [], 0.25, sent, rays, turned(sky, axes))[:, 0] * np.array(weights)

    found = np.array([lit(masked, world(kind)) for kind in types])
    if case.mask is not None:
        taken = lit(system, _even) - lit(masked, _even)
        found += np.outer([case.mask_luminance(kind) for kind in types], taken)
    return found


def _rays(case: Case, place: Floats, side: Floats, rays: int, rng: np.random.Generator) -> tuple[Floats, float]:
    """Rays from a place up through the opening, and what luminance is worth there.

    Candidates go to and fro along the rows of a grid, so that drawing at even steps of their summed worth leaves no
    part of the opening out. (Along an additive recurrence such steps fall in with its rhythm: the part of a view that a
    mask hides came out up to 15 % wrong.)
    """
    across = 4 * round(rays**0.5)
    i, j = np.divmod(np.arange(across * across), across)
    j = np.where(i % 2, across - 1 - j, j)
    x = ((j + rng.random(len(j))) / across - 0.5) * case.size_m[0]
    y = ((i + rng.random(len(i))) / across - 0.5) * case.size_m[1]
    to = np.stack([x, y, np.zeros(len(x))], axis=1) - place
    d2 = np.sum(to**2, axis=1)
    worth = np.maximum(0.0, to @ side) * to[:, 2] / d2**2
    steps = np.cumsum(worth) / worth.sum()
    pick = np.searchsorted(steps, (np.arange(rays) + rng.random()) / rays).clip(0, len(worth) - 1)
    travel = to[pick] / np.sqrt(d2[pick])[:, None]
    start = np.stack([x[pick], y[pick], np.zeros(rays)], axis=1)
    weight = worth.mean() * case.size_m[0] * case.size_m[1]
    return np.concatenate([start - 1e-4 * travel, travel], axis=1), float(weight)


def _centre(case: Case) -> tuple[Floats, Floats]:
    """Centre of the opening, and its frame."""
    corner, u, v = case.opening
    normal = np.cross(u, v)
    return corner + 0.5 * (u + v), turn(normal / np.linalg.norm(normal))


def _even(v: Floats) -> Floats:
    return np.ones(v.shape[:-1])


def errors(
    case: Case, engine: Callable[..., Floats], types: tuple[int, ...] = TYPES, steps: int = 600, **how: int
) -> Floats:
    """(engine - integral) / integral, (skies, points); 0 where no light comes."""
    exact = integral(case, types, steps)
    if engine is plane:
        exact = exact[:, parallel(case)]
    return np.where(exact > 0.0, engine(case, types, **how) / np.where(exact > 0.0, exact, 1.0) - 1.0, 0.0)


def main() -> None:
    """Print a table: mean and largest error of all points and skies."""
    print("case | tracer, every point | tracer, parallel plane | Radiance (skies 1, 5, 12): mean, largest")
    for case in CASES:
        found = [
            None if case.glazed else errors(case, holes),
            None if case.mask is not None else errors(case, plane),
            errors(case, radiance, (1, 5, 12)),
        ]
        told = ("" if e is None else f"{100 * e.mean():+.2f} %, {100 * np.abs(e).max():.2f} %" for e in found)
        print(f"{case.name} | " + " | ".join(told), flush=True)


if __name__ == "__main__":
    main()
