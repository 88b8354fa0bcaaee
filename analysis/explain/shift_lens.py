"""A prediction's lens as a density of shifts: whatever its facets are, its images say where it sends light.

Prisms of one shape are what a case's "prismatic" suggests, and what no two simulations agree about. But most lenses
move the direction cosines of light by amounts that hardly depend on where it came from, so the images of a few suns
show one density of shifts. It is found as blurred pictures are sharpened: traced, compared with the prediction, and
made denser where that has more light (Richardson 1972, doi:10.1364/JOSA.62.000055; Lucy 1974, doi:10.1086/111605).
"""

from functools import partial
from typing import Final

import numpy as np
from scipy.ndimage import gaussian_filter, map_coordinates
from scipy.signal import fftconvolve

from analysis.cases.model import Floats
from analysis.explain.densities import densities
from analysis.explain.fields import C_DEG, GAMMA_DEG, solid_angle
from analysis.explain.look import BETTER, Look
from analysis.simulate.components import Lens
from analysis.simulate.lens_shift import REACH, SIDE, cells
from analysis.simulate.system import System

STEPS: Final = 16
"""At most so many steps,"""
_PATIENCE: Final = 4
"""and no more than so many without one that is better than all before."""
_HOPELESS: Final = 1.3
"""Nor so many of a lens that is still so many times as unlike as another."""
NEAR: Final = 0.1
"""Lenses more unlike than this may draw light towards their normal:"""
DRAWN: Final = 0.7
"""so much of its direction cosines is kept then,"""
MORE_OR_LESS: Final = (0.85, 0.5)
"""and these are tried where that is better. (Of one author's tubes such a lens is unlike by .16 where one that only
shifts light is by .36.)"""
_POWER: Final = 1.2
"""Exponent of each step,"""
_ONWARDS: Final = 0.7
"""and below a well that mirrors, how far it goes on as the last one did (Biggs and Andrews 1997,
doi:10.1364/AO.36.001766),"""
_MOST_ONWARDS: Final = 2.0
"""but by no more than such a factor."""
_SMOOTHED: Final = 0.5
"""Cells by which each step's density is blurred: what few rays happen to do is no pattern."""
_DARK: Final = 0.02
"""Share of the brightest direction that is added to both before they are compared;"""
_MOST: Final = 5.0
"""and by how much one may be brighter than the other."""
_SEEN_DEG: Final = 82.0
"""Beyond this gamma little light of an image is left."""
_NARROW, _WIDE, _SHARE_WIDE = 0.18, 0.6, 0.15
"""The first density: two Gaussians, rms widths in direction cosines, and the share of the wider."""
_STEP: Final = 2.0 * REACH / (SIDE - 1)
_DISC: Final = np.arange(-1.0, 1.0 + 0.5 * _STEP, _STEP)
"""Direction cosines (N,) of a grid that the cells fit."""


def shift_lens(look: Look) -> tuple[System, float]:
    """The system with lenses of the density that looks most like the prediction, and how unlike it still is.

    Its covers are flat, and its well has no boot, as a case tells of none. Where lenses that only shift light are still
    unlike, those that draw it towards their normal are tried, too.
    """
    best = _fitted(look, 1.0)
    if best[1] < NEAR:
        return best
    drawn = _fitted(look, DRAWN, best[1])
    if drawn[1] > BETTER * best[1]:
        return best
    return min(drawn, *look.tracers.map(partial(_fitted, look), MORE_OR_LESS), key=lambda found: found[1])


def _fitted(look: Look, kept: float, than: float = np.inf) -> tuple[System, float]:
    """The same, where light keeps so much of its direction cosines; given up if it is far more unlike ``than``."""
    density = before = _begun()
    best: tuple[System, float] | None = None
    idle = 0
    suns = [_splat(*_travel(day.sun_azimuth_deg, day.sun_altitude_deg), kept, np.ones(1)) for day in look.days]
    for step in range(STEPS):
        system = _with(look, density, kept)
        light = look.light(system)
        unlike = look.beside(light)
        idle += 1
        if best is None or unlike < best[1]:
            best, idle = (system, unlike), 0
        if idle == _PATIENCE or (step == _PATIENCE and best[1] > _HOPELESS * than):
            break
        exits = _at_the_exit(look, system, kept)
        better = _better(density, kept, look, light, suns, exits)
        density = _onwards(before, better) if step and exits is not None else better
        before = better
    assert best is not None
    return best


def patternless(system: System) -> System:
    """The system with lenses that send light alike to all sides."""
    return system.with_settings({f"{place}.isotropic": True for place in densities(system)})


def _begun() -> Floats:
    x, y = np.meshgrid(cells(), cells(), indexing="ij")
    square = x**2 + y**2
    lobes = ((1.0 - _SHARE_WIDE, _NARROW), (_SHARE_WIDE, _WIDE))
    return np.asarray(sum(share / width**2 * np.exp(-0.5 * square / width**2) for share, width in lobes))


def _with(look: Look, density: Floats, kept: float) -> System:
    lens = Lens(kind="shift", shifts=tuple((density / density.sum()).ravel().tolist()), kept=kept)
    plain = look.system.with_settings({"rise_m": 0.0, "boot_height_m": 0.0})
    return plain.replace(**dict.fromkeys(look.places, lens))


def _at_the_exit(look: Look, system: System, kept: float) -> list[Floats] | None:
    """How light meets the exit's lens under each sun, on the grid of direction cosines; ``None`` if there is none.

    Of these light keeps so much.
    """
    if "exit" not in look.places:
        return None
    return [_binned(part, kept) for part in look.light(system.replace(exit=Lens(kind="none")))]


def _onwards(before: Floats, better: Floats) -> Floats:
    """A density that goes on as the last step did."""
    least = 1e-6 * better.max()
    step = np.clip((better + least) / (before + least), 1.0 / _MOST_ONWARDS, _MOST_ONWARDS)
    further = better * step**_ONWARDS
    return np.asarray(further / further.sum())


def _better(
    density: Floats, kept: float, look: Look, light: Floats, suns: list[Floats], exits: list[Floats] | None
) -> Floats:
    """The density after one step: where shifted light meets more of the prediction than was traced, there is more.

    Of light that an exit's lens shifts it is known how it met it. Light that an entry's lens shifts and an exit's lens
    after it meets what that makes of the prediction; mirrors between them turn it to all four sides.
    """
    x, y = np.meshgrid(_DISC, _DISC, indexing="ij")
    square = x**2 + y**2
    level = np.where(square < 1.0, np.sqrt(np.maximum(1.0 - square, 0.0)), 0.0)
    wanted, made = np.zeros_like(density), np.zeros_like(density)
    for k, (ratio, sun) in enumerate(zip(_ratios(look, light), look.suns.ravel(), strict=True)):
        for total, field in ((wanted, level * _at(ratio, x, y)), (made, level)):
            total += sun * _correlated(field, suns[k] if exits is None else exits[k])
            if exits is not None and "entry" in look.places:
                total += sun * _correlated(_mirrored(_drawn_out(_shifted_back(field, density), kept)), suns[k])
    known = made > 1e-4 * made.max()
    factor = np.where(known, wanted / np.where(known, made, 1.0), 1.0)
    better = gaussian_filter(density * np.maximum(factor, 0.0) ** _POWER, _SMOOTHED)
    return np.asarray(better / better.sum())


def _shifted_back(field: Floats, density: Floats) -> Floats:
    """For each direction what a lens's shifts make of a field that its light meets."""
    return np.asarray(fftconvolve(field, density[::-1, ::-1] / density.sum(), mode="same"))


def _drawn_out(field: Floats, kept: float) -> Floats:
    """A field at the share that light keeps of each direction's cosines."""
    if kept == 1.0:
        return field
    at = kept * (np.arange(len(_DISC)) - 0.5 * (len(_DISC) - 1)) + 0.5 * (len(_DISC) - 1)
    return np.asarray(map_coordinates(field, np.meshgrid(at, at, indexing="ij"), order=1))


def _mirrored(field: Floats) -> Floats:
    """The mean of a field and its images in mirrors along either side."""
    return np.asarray(0.25 * (field + field[::-1] + field[:, ::-1] + field[::-1, ::-1]))


def _ratios(look: Look, light: Floats) -> Floats:
    """The predicted sun part over one that was traced, with the same flux, (T, P, G)."""
    weight = solid_angle()
    flux = np.sum(light * weight, axis=(1, 2), keepdims=True)
    traced = light * look.suns / np.maximum(flux, 1e-12)
    predicted = np.maximum(look.raw - look.sky, 0.0)
    dark = _DARK * predicted.max(axis=(1, 2), keepdims=True)
    ratio = np.clip((predicted + dark) / (traced + dark), 1.0 / _MOST, _MOST)
    ratio[..., min(_SEEN_DEG, GAMMA_DEG[look.known_to - 1]) < GAMMA_DEG] = 1.0
    return np.asarray(ratio)


def _travel(azimuth_deg: float, altitude_deg: float) -> tuple[Floats, Floats]:
    """Direction cosines east and north of a sun's light on its way."""
    azimuth, level = np.radians(azimuth_deg), np.cos(np.radians(altitude_deg))
    return np.array([-np.sin(azimuth) * level]), np.array([-np.cos(azimuth) * level])


def _at(field: Floats, x: Floats, y: Floats) -> Floats:
    """A field (P, G) at direction cosines east and north."""
    gamma = np.degrees(np.arcsin(np.minimum(np.hypot(x, y), 1.0))) / GAMMA_DEG[1]
    c = np.degrees(-np.arctan2(x, y)) % 360.0 / C_DEG[1]
    closed = np.concatenate([field, field[:1]])
    return np.asarray(map_coordinates(closed, [c, gamma], order=1, mode="nearest"))


def _binned(light: Floats, kept: float) -> Floats:
    """A light (P, G) [cd] as shares of flux on the grid of direction cosines, of which it keeps so much."""
    sine, c = np.sin(np.radians(GAMMA_DEG))[None, :], np.radians(C_DEG)[:, None]
    x, y = -sine * np.sin(c), sine * np.cos(c)
    flux = light * solid_angle()
    return _splat(x.ravel(), y.ravel(), kept, (flux / max(float(flux.sum()), 1e-12)).ravel())


def _splat(x: Floats, y: Floats, kept: float, weight: Floats) -> Floats:
    """Weights at so much of places' coordinates, each shared by the four grid points around it."""
    grid = np.zeros((len(_DISC), len(_DISC)))
    u, v = (np.clip((kept * p + 1.0) / _STEP, 0.0, len(_DISC) - 1.001) for p in (x, y))
    i, j = u.astype(np.intp), v.astype(np.intp)
    a, b = u - i, v - j
    for di, dj, part in ((0, 0, (1 - a) * (1 - b)), (1, 0, a * (1 - b)), (0, 1, (1 - a) * b), (1, 1, a * b)):
        np.add.at(grid, (i + di, j + dj), weight * part)
    return grid


def _correlated(seen: Floats, before: Floats) -> Floats:
    """For each shift the sum over directions of what is seen there, times the light that this shift sends there."""
    every = fftconvolve(seen, before[::-1, ::-1], mode="full")
    middle, half = len(_DISC) - 1, SIDE // 2
    near = slice(middle - half, middle + half + 1)
    return np.asarray(np.maximum(every[near, near], 0.0))
