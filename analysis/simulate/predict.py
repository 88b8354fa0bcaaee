"""The predicted photometry of one skylight under one daylight, sun part and sky part apart."""

import dataclasses
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from analysis.photometry import Distribution
from analysis.simulate.daylight import Daylight, sky_source, sun_source
from analysis.simulate.lens import Sampler
from analysis.simulate.prediction import Engine, Prediction, SunAndSky
from analysis.simulate.rays import RaySet
from analysis.simulate.raysets import on_cover
from analysis.simulate.room import Room
from analysis.simulate.scored import Grid, Scored, score
from analysis.simulate.source import Source
from analysis.simulate.system import System
from analysis.simulate.tally import Field, Tally
from analysis.simulate.tracer import Settings, trace
from labdaq.errors import ConfigError

Floats = NDArray[np.float64]

GAMMA_DEG: Final[Floats] = np.arange(0.0, 90.1, 2.5)
C_DEG: Final[Floats] = np.arange(0.0, 360.1, 7.5)
"""The grid of a prediction: it holds the goniophotometer's directions (gamma 5, 15, ...; C 22.5, 45, ...)."""

ARM_GAMMA_DEG: Final[Floats] = np.array([0.0, 5.0, 15.0, 25.0, 35.0, 45.0, 55.0, 65.0, 75.0, 85.0, 90.0])
ARM_C_DEG: Final[Floats] = np.arange(0.0, 360.1, 22.5)
"""The goniophotometer's 145 directions: nine gammas in sixteen C-planes, and the nadir; and the horizon, for files."""

FEW: Final = 400
"""So many directions are scored one by one; more are counted and smoothed."""

PILOT: Final = 200_000
MOST_RAYS: Final = 200_000_000


def predict(
    system: System,
    daylight: Daylight,
    *,
    engine: Engine = "tracer",
    distance_m: float = 0.0,
    room: Room | None = None,
    precision: float = 0.01,
    rays: int = 0,
    seed: int = 1,
    max_bounces: int | None = None,
    threads: int = 0,
    gamma_deg: Floats = GAMMA_DEG,
    c_deg: Floats = C_DEG,
    sampler: Sampler | None = None,
) -> Prediction:
    """Predict one system under one daylight.

    Parameters
    ----------
    distance_m
        Of the sensors; 0 predicts the far field alone.
    room
        Adds the light that the room's surfaces send to the sensors (needs a distance).
    precision
        Relative statistical uncertainty to reach, root mean square over the brighter directions; the rays follow from
        a pilot run.
    rays
        Rays for each part, instead of a precision.
    gamma_deg
        With ``c_deg`` at most `FEW` directions are scored one by one, without smoothing, where the skylight allows it.
    max_bounces, seed, threads
        See `analysis.simulate.tracer.Settings`.
    c_deg
        From 0 to 360, both included.

    Raises
    ------
    ConfigError
        For a room without a distance, or sensors outside the room.
    SimulationError
        When the engine fails or makes light out of nothing.
    """
    if room is not None and distance_m <= 0.0:
        raise ConfigError("the room's light is what sensors at a distance see", "give a distance")
    if engine == "radiance":
        from analysis.simulate.radiance.engine import radiance_prediction

        made = radiance_prediction(system, daylight, distance_m, precision, seed, gamma_deg, c_deg)
    else:
        settings = Settings(
            rays=rays or PILOT, seed=seed, distance_m=distance_m, max_bounces=max_bounces, threads=threads, bounces=1
        )
        made = traced(system, daylight, settings, 0.0 if rays else precision, gamma_deg, c_deg, sampler).prediction()
    return made if room is None else in_room(made, room)


def predict_rays(system: System, rays: RaySet, settings: Settings, *, room: Room | None = None) -> Prediction:
    """The photometry of a skylight on which given rays fall, each traced once; all of it stands as the sky part.

    ``settings`` gives distance, seed, bounce limit and threads. Raises `DataError` when no ray meets the cover.
    """
    source = on_cover(system, rays.points, rays.directions, rays.flux_lm)
    tally = trace(system, source, dataclasses.replace(settings, bounces=1))
    day = Daylight("", 90.0, 0.0, 0.0, lambda v: np.zeros(v.shape[:-1]))
    far = _parts([None, tally], "far", GAMMA_DEG, C_DEG)
    near = _parts([None, tally], "near", GAMMA_DEG, C_DEG) if settings.distance_m > 0.0 else None
    facts: dict[str, Any] = {"seed": settings.seed, "max_bounces": settings.max_bounces, "sun": None}
    facts |= {"sky": dataclasses.asdict(tally.balance), "rays": len(rays.flux_lm), "rays_lm": float(rays.flux_lm.sum())}
    made = Prediction(system, day, "tracer", far, near, settings.distance_m, facts)
    return made if room is None else in_room(made, room)


@dataclass(frozen=True)
class Traced:
    """What was traced for one prediction: the sun, then the sky.

    Attributes
    ----------
    tallies
        None where a part has no light, or was scored and is not needed for the room.
    scored
        None where a part was counted.
    rays
        Sent for each part that was counted, else 0.
    """

    system: System
    daylight: Daylight
    settings: Settings
    tallies: tuple[Tally | None, ...]
    scored: tuple[Scored | None, ...]
    rays: tuple[int, ...]
    gamma_deg: Floats
    c_deg: Floats

    def prediction(self, wall_reflectance: float | None = None, max_bounces: int | None = None) -> Prediction:
        """Sun part and sky part of it; with another reflectance or bounce limit from the tallies (nothing scored)."""
        wanted: Field = "near" if self.settings.distance_m > 0.0 else "far"
        tallies, grid = list(self.tallies), (self.gamma_deg, self.c_deg)
        weights: dict[str, Any] = {"wall_reflectance": wall_reflectance, "max_bounces": max_bounces}
        fields = {name: _parts(tallies, name, *grid, **weights) for name in {"far", wanted}}
        exact = [None if s is None else (Distribution(*grid, s.candela), s.uncertainty) for s in self.scored]
        fields[wanted] = _replaced(fields[wanted], *exact)
        facts: dict[str, Any] = {"seed": self.settings.seed, "max_bounces": self.settings.max_bounces}
        if wall_reflectance is None and max_bounces is None:
            pairs = zip(("sun", "sky"), self.scored, self.tallies, strict=True)
            facts |= {name: dataclasses.asdict(it.balance) if (it := s or t) else None for name, s, t in pairs}
        near = fields["near"] if wanted == "near" else None
        return Prediction(self.system, self.daylight, "tracer", fields["far"], near, self.settings.distance_m, facts)


def traced(
    system: System,
    daylight: Daylight,
    settings: Settings,
    precision: float,
    gamma_deg: Floats,
    c_deg: Floats,
    sampler: Sampler | None = None,
    rays: tuple[int, ...] = (0, 0),
    aureole_deg: float = 0.0,
) -> Traced:
    """Sun and sky, each scored in few directions where that is possible, else counted.

    The far field beside a near one that is scored is counted, roughly: only the room's light needs it. ``rays`` other
    than 0 are what a counted part takes, whatever the precision; ``aureole_deg`` widens the sun.
    """
    grid = Grid.of(gamma_deg, c_deg)
    near = settings.distance_m > 0.0
    found: list[tuple[Tally | None, Scored | None, int]] = []
    for source, given in zip((sun_source([daylight], aureole_deg), sky_source([daylight])), rays, strict=True):
        scored, tally, sent = None, None, 0
        if source is not None and len(grid.gamma_deg) <= FEW:
            scored = score(system, source, settings, precision, grid, sampler)
        if source is not None and (scored is None or near):
            enough = precision if scored is None and not given else 0.0
            use = dataclasses.replace(settings, rays=given or settings.rays)
            tally, sent = _enough(system, source, use, enough, gamma_deg, c_deg, sampler)
        found.append((tally, scored, sent))
    tallies, scores, counts = zip(*found, strict=True)
    return Traced(system, daylight, settings, tallies, scores, counts, gamma_deg, c_deg)


def _replaced(
    counted: SunAndSky, sun: tuple[Distribution, Floats] | None, sky: tuple[Distribution, Floats] | None
) -> SunAndSky:
    """With the parts that were scored in place of those that were counted."""
    a, b = sun or (counted.sun, counted.sun_uncertainty), sky or (counted.sky, counted.sky_uncertainty)
    return SunAndSky(a[0], b[0], a[1], b[1])


def _enough(
    system: System,
    source: Source,
    settings: Settings,
    precision: float,
    gamma_deg: Floats,
    c_deg: Floats,
    sampler: Sampler | None,
) -> tuple[Tally, int]:
    """Trace as many rays as the precision needs, by a pilot run's uncertainty (or as many as the settings say)."""

    def sized(rays: int) -> Settings:
        return dataclasses.replace(settings, rays=rays, sun_samples=int(min(max(rays // 4, 1 << 15), 1 << 20)))

    tally = trace(system, source, sized(settings.rays), sampler)
    rays = settings.rays
    for _ in range(2):
        if precision <= 0.0:
            break
        field: Field = "near" if settings.distance_m > 0.0 else "far"
        have = _parts([tally, None], field, gamma_deg, c_deg, smoothing=False).worst_relative()
        if have <= precision or rays >= MOST_RAYS:
            break
        rays = int(min(MOST_RAYS, rays * min(400.0, 1.1 * (have / precision) ** 2)))
        tally = trace(system, source, sized(rays), sampler)
    return tally, rays


def _parts(
    tallies: list[Tally | None],
    field: Field,
    gamma_deg: Floats,
    c_deg: Floats,
    smoothing: bool = True,
    **weights: Any,
) -> SunAndSky:
    """Candela of what was counted; the uncertainty is that of statistics, and of ``smoothing`` if asked for.

    ``weights``: wall reflectance and bounce limit, see `Tally.intensity`.
    """
    Grid.of(gamma_deg, c_deg)
    found: list[Any] = []
    for tally in tallies:
        if tally is None:
            nothing = np.zeros((len(c_deg), len(gamma_deg)))
            found += [Distribution(gamma_deg, c_deg, nothing), nothing]
            continue
        part = tally.intensity(gamma_deg[None, :], c_deg[:-1, None], field, bias=smoothing, **weights)
        error = np.concatenate([part.uncertainty[0], part.uncertainty[0, :1]])
        found += [Distribution.closed(gamma_deg, c_deg[:-1], part.candela[0]), error]
    return SunAndSky(found[0], found[2], found[1], found[3])


def in_room(made: Prediction, room: Room) -> Prediction:
    """A near field with the light that a room adds."""
    assert made.near is not None
    near = made.near
    gamma, c = near.sun.gamma_deg, near.sun.c_deg[:-1]
    aperture = made.system.aperture
    radius = aperture.diameter_m / 2 if aperture.shape == "disc" else max(aperture.size_m) / 2
    parts = []
    for far, seen in ((made.far.sun, near.sun), (made.far.sky, near.sky)):
        extra = room.added(far, gamma[None, :], c[:, None], made.distance_m, radius)
        parts.append(Distribution.closed(gamma, c, seen.candela[:-1] + extra))
    facts = made.facts | {"room": dataclasses.asdict(room)}
    lit = SunAndSky(parts[0], parts[1], near.sun_uncertainty, near.sky_uncertainty)
    return dataclasses.replace(made, near=lit, facts=facts)
