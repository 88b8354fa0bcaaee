"""What the simulation's lens usually has wrong, as random effects that every hypothesis allows for.

A smooth factor on the sphere is not enough: a lens that blurs or bends a little otherwise than its model changes
the sun's image where it is steep. These errors follow the sun, so they are written in its frame: a wider or
narrower image, an image nearer to or farther from nadir, turned about it, and a brighter or darker sun part; and all
images farther from nadir, as of prisms that are a little steeper. Each system has its own, and each test a little more
(the error depends on the angle of incidence).
"""

from dataclasses import replace

import numpy as np

from analysis.cases.model import Floats
from analysis.explain.fields import GAMMA_DEG, solid_angle
from analysis.explain.geometry import blurred, turned
from analysis.explain.readings import Readings
from analysis.explain.sampler import Sampler
from analysis.explain.scene import Light, Scene
from labdaq import directions

BLUR_DEG = (4.5, 10.0)
"""Widths whose blur is allowed for [deg]."""
SIZES = {
    "blur": (0.54, 0.04),
    "broad": (0.17, 0.013),
    "wide": (0.06, 0.007),
    "shift": (0.05, 0.038),
    "turn": (0.027, 0.03),
    "outwards": (0.2, 0.064),
    "gain": (0.024, 0.0037),
    "contrast": (0.064, 0.008),
    "spin": (0.1, 0.038),
    "twist": (0.068, 0.042),
}
"""Usual sizes of what all tests of a system have wrong, and of what each has more: shares of a blur of those widths and
to the surroundings, degrees of shift, relative gain of the sun part, loss of contrast, and degrees of turn about nadir
and about the image's own middle. About those under which the readings of 93 skylights by nine other authors are
likeliest, where nothing was left out (expectation maximisation; Dempster et al. 1977, J. R. Stat. Soc. B 39)."""
HAZE = 0.005
"""Usual change of the readings below a system (rms, relative, their mean removed) by light that any surface scatters
widely, more or less of it than was simulated. (Of three other authors' hazes that were not there one changed them by
1.2 % and one, below a diffusing lens, by 2.5 %: 86 nats.)"""
SURROUNDINGS_DEG = 16.0
"""Width of the surroundings that a contrast is relative to, and to which light is spread widely [deg]."""
SUN_S_PER_DEG = 240.0
"""The sky turns by a degree in this time [s]."""
FOLLOWS = 0.35
"""By which share of the sun's way an image of it usually shifts, or turns, otherwise than predicted."""
DIMS_PER_DEG = 0.035
"""Usual relative change of the sun part for a degree of the sun's way: height above the pane, Fresnel losses."""


def lens_error_effects(scene: Scene) -> Floats:
    """Independent unit effects (N, K) on the stretched scale; (N, 0) without goniometer rows."""
    r = scene.readings
    if not np.any(scene.is_gonio):
        return np.zeros((len(r), 0))
    shapes = _shapes(scene)
    columns = list(_of_systems(scene, shapes).values())
    for name, change in shapes.items():
        relative = SIZES[name][1] * np.where(scene.is_gonio, change / np.hypot(r.simulated, r.floor), 0.0)
        columns += [np.where(r.test == t, relative, 0.0) for t in np.unique(r.test[scene.is_gonio])]
    if r.has_times:
        columns += _while_the_sun_moves(scene, shapes)
    return np.stack(columns, axis=1)


def lens_error_of(scene: Scene, light: Light, model: Floats) -> Floats:
    """Unit effects (N, K) on the stretched scale that all tests of a system share, of other light than was predicted.

    ``model`` (N,) [cd] is what is read of that light.
    What a lens has wrong lies where its images are seen: by planes that run the other way round, on the other side.
    (An aureole had gained 109 nats beside such planes, a near field 64 beside exchanged sensors, on another author's
    cases; neither was there.)
    """
    r = replace(scene.readings, gamma_deg=light.gamma_deg, c_deg=light.c_deg, simulated=model)
    there = replace(scene, readings=r, memory={}, lit={}, of_rows={})
    there.__dict__["fields"] = replace(scene.fields, sun=light.sun, sky=light.sky)
    return np.stack(list(lens_error_of_systems(there).values()), axis=1)


def lens_error_of_systems(scene: Scene) -> dict[tuple[str, str], Floats]:
    """The unit effects (N,) that all tests of a system share, by the system's id and the kind of error."""
    return _of_systems(scene, _shapes(scene)) if np.any(scene.is_gonio) else {}


def _of_systems(scene: Scene, shapes: dict[str, Floats]) -> dict[tuple[str, str], Floats]:
    r = scene.readings
    found = {}
    for name, change in shapes.items():
        relative = SIZES[name][0] * np.where(scene.is_gonio, change / np.hypot(r.simulated, r.floor), 0.0)
        for system in np.unique(r.system[np.unique(r.test[scene.is_gonio])]):
            mine = r.system[r.test] == system
            id_ = r.case.tests[r.test[np.argmax(mine)]].system or ""
            found[id_, name] = np.where(mine, relative, 0.0)
    return found


def _while_the_sun_moves(scene: Scene, shapes: dict[str, Floats]) -> list[Floats]:
    """A prediction for the middle of a test meets a sun that goes on: its image shifts, turns, dims in the meantime."""
    r = scene.readings
    columns = []
    for t in np.unique(r.test[scene.is_gonio]):
        rows = scene.is_gonio & (r.test == t)
        seconds = (r.utc_ns - r.utc_ns[rows].mean()) / 1e9
        moved_deg = np.where(rows, seconds / SUN_S_PER_DEG, 0.0)
        for name, size in (("shift", FOLLOWS), ("turn", FOLLOWS), ("gain", DIMS_PER_DEG)):
            columns.append(size * moved_deg * shapes[name] / np.hypot(r.simulated, r.floor))
    return columns


def _shapes(scene: Scene) -> dict[str, Floats]:
    """Change of each row's prediction [cd] per unit of each kind of error; shape (N,) each."""
    return dict(zip(SIZES, scene.remember_rows(_changes), strict=False))


def _changes(scene: Scene) -> Floats:
    """The same in the order of `SIZES`, the last where images are known; shape (K, N)."""
    r, sun = scene.readings, scene.fields.sun
    gamma, c = np.nan_to_num(r.gamma_deg), np.nan_to_num(r.c_deg)
    at = Sampler(r.test, gamma, c)
    here = at(sun)
    narrow, wide = blurred(sun, BLUR_DEG[0]), blurred(sun, BLUR_DEG[1])
    around = at(blurred(sun, SURROUNDINGS_DEG))
    shapes = {"blur": at(narrow) - here, "broad": at(wide) - at(narrow), "wide": around - at(wide), "gain": here}
    shapes["contrast"] = -here * np.log(np.clip(here / np.maximum(around, 1e-9), 0.1, 10.0))
    azimuth = np.nan_to_num(r.azimuth_deg)
    for name, axis_azimuth in (("shift", azimuth + 90.0), ("turn", azimuth)):
        axis = directions.sky_vector(np.zeros(len(azimuth)), axis_azimuth)
        moved, back = (_rotated(gamma, c, axis[r.test], way) for way in (1.0, -1.0))
        shapes[name] = (Sampler(r.test, *moved)(sun) - Sampler(r.test, *back)(sun)) / 2.0
    outer, inner = np.minimum(gamma + 1.0, 90.0), np.abs(gamma - 1.0)
    shapes["outwards"] = (Sampler(r.test, inner, c)(sun) - Sampler(r.test, outer, c)(sun)) / 2.0
    shapes["spin"] = (_turned(r, sun, 1.0) - _turned(r, sun, -1.0)) / 2.0
    if scene.knows_image:
        one = np.ones(len(sun))
        shapes["twist"] = at(turned(sun, scene.sun_vectors, one) - turned(sun, scene.sun_vectors, -one)) / 2.0
    return np.stack([shapes[name] for name in SIZES if name in shapes])


def haze_errors(scene: Scene) -> Floats:
    """One unit effect (N, K) on the stretched scale for each system; (N, 0) without goniometer rows."""
    r = scene.readings
    if not np.any(scene.is_gonio):
        return np.zeros((len(r), 0))
    effects = _by_system(scene, scene.remember_rows(_scattered) / np.hypot(r.simulated, r.floor))
    size = np.array([np.std(x[x != 0.0]) for x in effects.T])
    return np.asarray(HAZE * effects / np.maximum(size, 1e-9) * (np.abs(r.measured) / r.scale)[:, None])


def _by_system(scene: Scene, effect: Floats) -> Floats:
    """An effect (N,) on each system by itself, (N, K)."""
    r = scene.readings
    systems = np.unique(r.system[r.test[scene.is_gonio]])
    return np.where(scene.is_gonio[:, None] & (r.system[r.test][:, None] == systems[None, :]), effect[:, None], 0.0)


def _scattered(scene: Scene) -> Floats:
    """Change of each row's prediction [cd] if all light left a dull surface, brightest at nadir; shape (N,)."""
    r, field = scene.readings, scene.fields.total
    at = Sampler(r.test, np.nan_to_num(r.gamma_deg), np.nan_to_num(r.c_deg))
    flux = np.sum(field * solid_angle(), axis=(1, 2))
    lobe = flux[:, None, None] * np.cos(np.radians(GAMMA_DEG)) / np.pi
    return at(np.broadcast_to(lobe, field.shape)) - at(field)


def arm_steepness(scene: Scene) -> Floats:
    """Change of each row's prediction per degree, on the stretched scale; shape (N,), zero but for goniometer rows."""
    return scene.remember_rows(_steepness)


def _steepness(scene: Scene) -> Floats:
    r, total = scene.readings, scene.fields.total
    if not np.any(scene.is_gonio):
        return np.zeros(len(r))
    gamma, c = np.nan_to_num(r.gamma_deg), np.nan_to_num(r.c_deg)
    outwards = Sampler(r.test, np.minimum(gamma + 1.0, 90.0), c)(total) - Sampler(r.test, np.abs(gamma - 1.0), c)(total)
    across = _turned(r, total, 1.0) - _turned(r, total, -1.0)
    slope = np.hypot(outwards, across * np.sin(np.radians(gamma))) / 2.0
    return np.where(scene.is_gonio, slope / np.hypot(r.simulated, r.floor), 0.0)


def _turned(r: Readings, field: Floats, degrees: float) -> Floats:
    """The field where the sensors would be, were the arm turned by an angle [deg]; shape (N,)."""
    return Sampler(r.test, np.nan_to_num(r.gamma_deg), np.nan_to_num(r.c_deg) + degrees)(field)


def _rotated(gamma_deg: Floats, c_deg: Floats, axis: Floats, degrees: float) -> tuple[Floats, Floats]:
    """Directions turned about horizontal axes (N, 3) by an angle [deg]; kept below the horizon."""
    gamma, c = directions.gamma_c(directions.rotated(directions.vector(gamma_deg, c_deg), axis, degrees))
    return np.minimum(gamma, 90.0), c
