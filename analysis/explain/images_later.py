"""The sun's images below a skylight some minutes later, where nothing is simulated again."""

from typing import Final

import numpy as np
from numpy.typing import NDArray

from analysis.cases.model import Floats
from analysis.explain.fields import C_DEG, GAMMA_DEG
from analysis.explain.geometry import turned
from analysis.explain.readings import sun_at
from analysis.explain.sampler import Sampler
from analysis.explain.scene import Scene
from labdaq import directions

_APART_DEG: Final = 8.0
"""Suns of one system whose heights differ by no more tell nothing of how its ring follows them."""
_SLOPES: Final = (0.3, 1.2)
"""By how much a ring may follow its sun, at least and at most."""


def middles(scene: Scene) -> NDArray[np.int64]:
    """The middle moment of each test's readings [ns]; (T,)."""
    r = scene.readings
    tests = range(len(r.case.tests))
    return np.array([int(r.utc_ns[r.test == k].mean()) if np.any(r.test == k) else 0 for k in tests], dtype=np.int64)


def with_the_sun(scene: Scene, field: Floats, minutes: float) -> Floats:
    """The sun part (T, P, G) ``minutes`` later: its image turned by the arc that the sun went."""
    case, middle = scene.readings.case, middles(scene)
    now = directions.sky_vector(*sun_at(case, middle))
    later = directions.sky_vector(*sun_at(case, middle + np.int64(round(minutes * 60e9))))
    across = np.cross(now, later)
    sine = np.linalg.norm(across, axis=1)
    axis = across / np.maximum(sine, 1e-12)[:, None]
    return turned(field, axis, np.degrees(np.arctan2(sine, np.sum(now * later, axis=1))))


def with_height_and_azimuth(scene: Scene, field: Floats, minutes: float) -> Floats:
    """The sun part (T, P, G) ``minutes`` later where vertical walls all around leave light its height alone.

    Below a round tube the sun's light is a ring: it widens as the sun sinks, and turns with its azimuth. (Another
    author's, under suns of 41° to 55°, changed so to .92 to .98, to .6 as our own simulation has it, and not at all as
    if turned about the arc that the sun went.)
    """
    case, middle = scene.readings.case, middles(scene)
    now, later = sun_at(case, middle), sun_at(case, middle + np.int64(round(minutes * 60e9)))
    sinks = scene.remember(ring_per_height) * (now[0] - later[0])
    turns = now[1] - later[1]  # C runs against the azimuth
    planes, rings = field.shape[1:]
    tests = np.repeat(np.arange(len(field)), planes * rings)
    c, gamma = (np.broadcast_to(x, field.shape) for x in (C_DEG[None, :, None], GAMMA_DEG[None, None, :]))
    read = Sampler(tests, (gamma - sinks[:, None, None]).ravel(), (c - turns[:, None, None]).ravel())
    return read(field).reshape(field.shape)


def ring_per_height(scene: Scene) -> Floats:
    """By how much the ring widens per degree by which the sun sinks, as the predictions of other hours have it; (T,).

    A lens above or below the tube draws light together. The slope of the mean gamma of the sun's light over the sun's
    zenith angle, of each system; 1 where its suns are too few or too alike to tell. (Below three authors' tubes it is
    .53 to .86; with 1 a clock that was 7.7 min off was told as 4.7.)
    """
    case, flux = scene.readings.case, scene.fields.sun * np.sin(np.radians(GAMMA_DEG))
    lit = flux.sum(axis=(1, 2))
    mean = np.einsum("tpg,g->t", flux, GAMMA_DEG) / np.maximum(lit, 1e-12)
    zenith = np.array([90.0 - (90.0 if t.sun_altitude_deg is None else t.sun_altitude_deg) for t in case.tests])
    slope = np.ones(len(case.tests))
    for name in {t.system for t in case.tests}:
        mine = np.array([t.system == name for t in case.tests])
        told = mine & (lit > 0.0)
        if np.any(told) and np.ptp(zenith[told]) > _APART_DEG:
            slope[mine] = np.clip(np.polyfit(zenith[told], mean[told], 1)[0], *_SLOPES)
    return slope


def in_tubes(scene: Scene) -> NDArray[np.bool_]:
    """Which tests (T,) are below round tubes with mirrored walls."""
    tubes = {s.id for s in scene.readings.case.setup.system if s.kind == "tube" and s.wall_finish != "diffuse"}
    return np.array([t.system in tubes for t in scene.readings.case.tests])
