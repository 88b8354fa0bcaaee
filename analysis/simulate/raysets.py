"""Sources given as rays one by one, e.g. of a ray file: where they meet the cover of a skylight."""

import math
from typing import Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from analysis.simulate.kernels import arrays as k
from analysis.simulate.model import facets, geometry
from analysis.simulate.obstruction import between
from analysis.simulate.source import Source, given
from analysis.simulate.system import System
from labdaq.errors import DataError

Floats = NDArray[np.float64]

_WHERE: Final = (
    "check origin (centre of the aperture), axes (x east, y north, z up; l m n the way that light goes, so n < 0) and "
    "unit: metres, unless text says e.g. `# unit: mm`"
)


def on_cover(system: System, points: ArrayLike, directions: ArrayLike, flux_lm: ArrayLike) -> Source:
    """The rays of a set that fall on the cover from outside, as a source; all others are lost on the black roof or on
    the system's obstructions.

    Parameters
    ----------
    points, directions : shape (n, 3)
        Starting points [m] (origin: centre of the aperture, z up) and directions of travel, in the site's frame; any
        length of direction.
    flux_lm : shape (n,) [lm]

    Raises
    ------
    DataError
        When shapes or numbers do not make rays, or no ray meets the cover.
    """
    start, travel = np.asarray(points, dtype=np.float64), np.asarray(directions, dtype=np.float64)
    flux = np.asarray(flux_lm, dtype=np.float64)
    if start.ndim != 2 or start.shape != travel.shape or start.shape[1] != 3 or flux.shape != (len(start),):
        raise DataError(f"rays of shapes {start.shape}, {travel.shape} and {flux.shape} do not belong together")
    length = np.linalg.norm(travel, axis=1)
    if not (np.all(np.isfinite(start)) and np.all(length > 0.0) and np.all(flux >= 0.0) and np.isfinite(flux).all()):
        raise DataError("a ray has an undefined place or direction, or negative flux")
    travel = travel / length[:, None]
    turn = math.radians(system.rotation_deg)
    to_own = np.array([[math.cos(turn), math.sin(turn), 0.0], [-math.sin(turn), math.cos(turn), 0.0], [0.0, 0.0, 1.0]])
    distance, normal = _first_hit(system, start @ to_own.T, travel @ to_own.T)
    hit = np.isfinite(distance)
    if not hit.any():
        raise DataError(f"no ray of the set meets the cover; {_whereabouts(system, start, travel)}", _WHERE)
    place = start[hit] + distance[hit, None] * travel[hit]
    open_ = ~between(system.obstructions, place, start[hit])
    if not open_.any():
        raise DataError("every ray of the set that would meet the cover meets an obstruction before")
    return given(place[open_], (normal[hit] @ to_own)[open_], travel[hit][open_], flux[hit][open_])


def _whereabouts(system: System, start: Floats, travel: Floats) -> str:
    """Where the rays start and go, and where the cover is."""
    low, high = start.min(axis=0), start.max(axis=0)
    spans = ", ".join(f"{axis} {a:.4g} to {b:.4g}" for axis, a, b in zip("xyz", low, high, strict=True))
    top = system.well_depth_m + system.rise_m
    return (
        f"they start at {spans} m, {np.mean(travel[:, 2] < 0.0):.0%} of them go down, and the cover is "
        f"{system.well_depth_m:.4g} to {top:.4g} m above the origin"
    )


def _first_hit(system: System, start: Floats, travel: Floats) -> tuple[Floats, Floats]:
    """Distance to the cover (infinite: missed) and its outward normal, in the skylight's own frame."""
    row = geometry(system)
    if row[k.COVER] == k.DOME:
        return _on_dome(row, start, travel)
    if row[k.COVER] == k.PYRAMID:
        planes = facets(system)
        normals, offsets = planes[:, :3], planes[:, k.OFFSET]
    else:
        normals, offsets = np.array([[0.0, 0.0, 1.0]]), np.array([row[k.HEIGHT]])
    rate = travel @ normals.T
    gap = offsets - start @ normals.T
    with np.errstate(divide="ignore", invalid="ignore"):
        t = np.where(rate < 0.0, gap / rate, -np.inf)
    # a convex solid is entered through the last of the planes that are crossed inwards
    last = np.argmax(t, axis=1)
    distance = t[np.arange(len(t)), last]
    place = start + np.where(np.isfinite(distance), distance, 0.0)[:, None] * travel
    inside = np.all(place @ normals.T <= offsets + 1e-9, axis=1) & _above(row, place)
    return np.where(inside & (distance > 0.0), distance, np.inf), normals[last]


def _above(row: tuple[float, ...], place: Floats) -> NDArray[np.bool_]:
    """Whether places are over the outline and not below the well's top."""
    if row[k.SHAPE] == k.DISC:
        over = np.hypot(place[:, 0], place[:, 1]) <= row[k.AX] + 1e-9
    else:
        over = (np.abs(place[:, 0]) <= row[k.AX] + 1e-9) & (np.abs(place[:, 1]) <= row[k.AY] + 1e-9)
    return np.asarray(over & (place[:, 2] >= row[k.HEIGHT] - 1e-9))


def _on_dome(row: tuple[float, ...], start: Floats, travel: Floats) -> tuple[Floats, Floats]:
    radius = row[k.CAP_RADIUS]
    from_centre = start - np.array([0.0, 0.0, row[k.CAP_CENTRE]])
    half = np.sum(from_centre * travel, axis=1)
    rest = half**2 - np.sum(from_centre**2, axis=1) + radius**2
    distance = -half - np.sqrt(np.maximum(rest, 0.0))
    place = start + distance[:, None] * travel
    good = (rest > 0.0) & (distance > 0.0) & (place[:, 2] >= row[k.HEIGHT] - 1e-9)
    normal = (from_centre + distance[:, None] * travel) / radius
    return np.where(good, distance, np.inf), normal
