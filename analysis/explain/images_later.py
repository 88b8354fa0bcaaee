"""The sun's images below a skylight some minutes later, where nothing is simulated again."""

import numpy as np
from numpy.typing import NDArray

from analysis.cases.model import Floats
from analysis.explain.fields import C_DEG, GAMMA_DEG
from analysis.explain.geometry import turned
from analysis.explain.readings import sun_at
from analysis.explain.sampler import Sampler
from analysis.explain.scene import Scene
from labdaq import directions


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
    sinks, turns = now[0] - later[0], now[1] - later[1]  # C runs against the azimuth
    planes, rings = field.shape[1:]
    tests = np.repeat(np.arange(len(field)), planes * rings)
    c, gamma = (np.broadcast_to(x, field.shape) for x in (C_DEG[None, :, None], GAMMA_DEG[None, None, :]))
    read = Sampler(tests, (gamma - sinks[:, None, None]).ravel(), (c - turns[:, None, None]).ravel())
    return read(field).reshape(field.shape)


def in_tubes(scene: Scene) -> NDArray[np.bool_]:
    """Which tests (T,) are below round tubes with mirrored walls."""
    tubes = {s.id for s in scene.readings.case.setup.system if s.kind == "tube" and s.wall_finish != "diffuse"}
    return np.array([t.system in tubes for t in scene.readings.case.tests])
