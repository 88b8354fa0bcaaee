"""A lens's pattern that nobody knows beforehand: how light goes by how far, and which way, the lens shifts it.

A lens that was simulated without a pattern spreads the sun's light about its way alike to all sides. A real one does
not, and where its prisms send more and where less no drawing tells. But whatever it is, it hangs on the shift of the
direction cosines alone, and so goes with the sun: what is seen under one sun tells of the others. (To direction cosines
a thin periodic sheet adds: Born and Wolf, Principles of Optics, on gratings. The random function is our own.)
"""

from functools import cache

import numpy as np

from analysis.cases.model import Floats
from analysis.explain.along import sun_share
from analysis.explain.fields import C_DEG, GAMMA_DEG
from analysis.explain.geometry import grid_vectors
from analysis.explain.scene import Scene
from labdaq import directions

HARMONICS = (2, 3, 4)
"""So often a pattern repeats itself around the shift. (Once round is a sun, or an arm, that stands elsewhere.)"""
RING = 0.3
"""Distance between the rings of shifts, and their width [direction cosines]."""
RINGS = RING * np.arange(1.0, 6.0)
WAYS = tuple(f"{n} {way} {ring:.1f}" for ring in RINGS for n in HARMONICS for way in ("cos", "sin"))
"""Each unit effect: how often round, from which side, and at what shift."""
NO_CONTRAST = 0.14
"""Predictions with less have no pattern. (Of four other authors' that have none .076 to .103, of six others' that have
one .175 to .66; of one whose lens is round but for a little .088.)"""
_SUNLIT, _DARK, _ENOUGH = 0.15, 0.02, 60
"""Rows that tell have such a share of sunlight, and of the brightest; and so many are enough."""
_FINE = 0.12
"""Width of the rings of an even lens [direction cosines]."""


def effects(scene: Scene, _: float = RING) -> Floats:
    """Independent unit effects (N, K) of each such system's lens on the rows: relative changes of the sun part."""
    r = scene.readings
    made = basis(directions.vector(np.nan_to_num(r.gamma_deg), np.nan_to_num(r.c_deg)), scene.sun_vectors[r.test])
    share = sun_share(scene) * scene.is_gonio
    parts = [made.T * (share * (r.system[r.test] == k))[:, None] for k in without_pattern(scene).values()]
    return np.concatenate(parts, axis=1) if parts else np.zeros((len(r), 0))


def on_fields(scene: Scene) -> Floats:
    """The same unit effects on the fields of the tests; shape (K, T, P, G)."""
    grid = grid_vectors().reshape(1, len(C_DEG), len(GAMMA_DEG), 3)
    return basis(grid, scene.sun_vectors[:, None, None, :])


def basis(way_out: Floats, to_the_sun: Floats) -> Floats:
    """Unit effects (K, ...) of light that leaves along ``way_out`` (..., 3), the sun being ``to_the_sun`` (..., 3).

    Undeflected light goes straight away from the sun. Where nothing is shifted there is no side.
    """
    far, side = _shift(way_out, to_the_sun)
    rings = np.stack([np.exp(-(((far - ring) / RING) ** 2)) for ring in RINGS])
    rings = rings / np.maximum(np.linalg.norm(rings, axis=0), 1e-9) * np.minimum(far / RING, 1.0)
    turns = {(n, name): f(n * side) for n in HARMONICS for name, f in (("cos", np.cos), ("sin", np.sin))}
    found = [ring * turns[n, way] for ring in rings for n in HARMONICS for way in ("cos", "sin")]
    return np.asarray(np.nan_to_num(np.stack(found) / np.sqrt(len(HARMONICS))))


@cache
def products() -> Floats:
    """Mean products (K, K) of the unit effects over shifts up to one, evenly over that disc."""
    x, y = np.meshgrid(np.linspace(-1.0, 1.0, 61), np.linspace(-1.0, 1.0, 61))
    inside = np.stack([x, y], axis=-1)[np.hypot(x, y) <= 1.0]
    made = basis(inside, np.zeros(2))
    return made @ made.T / len(inside)


def without_pattern(scene: Scene) -> dict[str, int]:
    """Systems whose predictions have no pattern that hangs on the shift, and their numbers.

    Of tubes nobody can tell: their mirrors spread the sun's light all round before it comes to the lens.
    """
    even = scene.remember(_even)
    return {name: k for name, k in systems_of(scene).items() if even[k]}


def has_pattern(scene: Scene) -> bool:
    """Whether the prediction of some system, tubes apart, has a pattern that hangs on the shift."""
    even = scene.remember(_even)
    return any(not even[k] for k in _but_tubes(scene))


def systems_of(scene: Scene) -> dict[str, int]:
    """The numbers of the systems of a case's tests, by their ids."""
    r = scene.readings
    return {test.system or "": int(k) for test, k in zip(r.case.tests, r.system, strict=True)}


def _even(scene: Scene) -> Floats:
    """1 for each system (S,) of which that is so."""
    found = np.zeros(max(systems_of(scene).values()) + 1)
    for k in _but_tubes(scene):
        found[k] = contrast(scene, k) < NO_CONTRAST
    return found


def _but_tubes(scene: Scene) -> list[int]:
    """The numbers of the systems that are no tubes."""
    tubes = {s.id for s in scene.readings.case.setup.system if s.kind == "tube"}
    return [k for name, k in systems_of(scene).items() if name not in tubes]


def contrast(scene: Scene, system: int) -> float:
    """By how much (rms of the logarithm) a system's predicted sun part goes by the side to which light is shifted.

    Beside how it goes by how far that is, by gamma and by test. Infinite where too few directions see the sun's light.
    """
    r = scene.readings
    bright = (r.system[r.test] == system) & scene.is_gonio & (sun_share(scene) > _SUNLIT)
    rows = np.flatnonzero(bright & (r.sun > _DARK * np.max(r.sun[bright], initial=0.0)))
    if len(rows) < _ENOUGH:
        return np.inf
    way_out = directions.vector(r.gamma_deg[rows], r.c_deg[rows])
    far, _ = _shift(way_out, scene.sun_vectors[r.test[rows]])
    round_it = [np.exp(-(((far - at) / _FINE) ** 2)) for at in np.arange(0.0, 1.9, _FINE)]
    tests = [(r.test[rows] == k).astype(float) for k in np.unique(r.test[rows])]
    gamma = [np.cos(n * np.radians(r.gamma_deg[rows])) for n in (1, 2, 3)]
    sides = basis(way_out, scene.sun_vectors[r.test[rows]])
    columns = np.stack([*round_it, *tests, *gamma, *sides], axis=1)
    stiff = np.diag([1e-4] * (columns.shape[1] - len(sides)) + [0.05] * len(sides))
    fitted = np.linalg.solve(columns.T @ columns + stiff, columns.T @ np.log(r.sun[rows]))
    return float(np.std(sides.T @ fitted[-len(sides) :]))


def _shift(way_out: Floats, to_the_sun: Floats) -> tuple[Floats, Floats]:
    """How far light was shifted [direction cosines], and to which side [rad]."""
    shift = way_out[..., :2] + to_the_sun[..., :2]
    return np.hypot(shift[..., 0], shift[..., 1]), np.arctan2(shift[..., 1], shift[..., 0])
