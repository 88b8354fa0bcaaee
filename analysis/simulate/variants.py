"""What a simulation would have said with one thing changed: the explanation's raw material.

Everything is predicted with the same rays as the baseline, so that ratios to it are quiet where physics is alike. What
the tallies of one run know (wall reflectance, bounce limit, near and far field) costs no rays at all; the rest is
traced again, once for each changed skylight or sun, for all tests together.
"""

import dataclasses
import os
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from analysis.simulate.changes import TALLY_KEYS, Change, changed
from analysis.simulate.daylight import Daylight, sky_source, sun_source
from analysis.simulate.lens import SAMPLES, Sampler
from analysis.simulate.model import skylight
from analysis.simulate.source import Source
from analysis.simulate.system import System
from analysis.simulate.tally import Field, Tally
from analysis.simulate.tracer import Settings, trace
from labdaq.errors import ConfigError

Floats = NDArray[np.float64]

GAMMA_DEG: Final[Floats] = np.arange(0.0, 90.1, 2.5)
C_DEG: Final[Floats] = np.arange(0.0, 360.1, 5.0)
"""The fine grid: 37 gammas and 73 C-planes, closed (the last plane repeats the first)."""

SKY_SHARE: Final = 0.6
"""Rays for each sky, in rays for each sun: skies are smoother, and share their rays."""


@dataclass(frozen=True)
class Parts:
    """Sun part and sky part of several tests.

    Attributes
    ----------
    sun, sky : shape (tests, C, gamma) [cd]
    sun_uncertainty, sky_uncertainty : shape (tests, C, gamma) [cd]
        Standard uncertainty from statistics.
    """

    sun: Floats
    sky: Floats
    sun_uncertainty: Floats
    sky_uncertainty: Floats

    @property
    def total(self) -> Floats:
        """Sun part plus sky part [cd]."""
        return self.sun + self.sky


@dataclass(frozen=True)
class Outcome:
    """A prediction in the far field, and at the sensors' distance; each is made of the tallies when asked for."""

    _made: Callable[[Field], Parts] = field(repr=False)

    @cached_property
    def far(self) -> Parts:
        """Seen from infinitely far away."""
        return self._made("far")

    @cached_property
    def near(self) -> Parts:
        """Illuminance at the sensors times the square of their distance."""
        return self._made("near")


@dataclass(frozen=True)
class VariantSet:
    """Baseline and variants of one system under several daylights.

    Attributes
    ----------
    system, tests
        What was simulated.
    gamma_deg, c_deg : shape (G,), (P,)
        The grid of all arrays; C runs from 0 to 360, both included.
    baseline
    variants
        In the order of the changes asked for.
    """

    system: System
    tests: tuple[Daylight, ...]
    gamma_deg: Floats
    c_deg: Floats
    baseline: Outcome
    variants: tuple[tuple[Change, Outcome], ...]
    _tallies: "tuple[Tally | None, Tally | None]" = field(repr=False)

    def again(self, *, wall_reflectance: float | None = None, max_bounces: int | None = None) -> Outcome:
        """The baseline with another wall reflectance or bounce limit, from its tallies: exact, and without new rays."""
        return _outcome(*self._tallies, len(self.tests), self.gamma_deg, self.c_deg, wall_reflectance, max_bounces)

    def by_bounce(self, field_: Field = "far", *, boot: bool = False) -> tuple[Floats, Floats]:
        """Baseline by wall bounces n, sun and sky, each (n, tests, C, gamma) [cd]; weigh with (R/R0)^n.

        With ``boot``, by all bounces, those on a boot included: a limit leaves the first of them. Smoothed with fixed
        neighbourhoods, so the sum over n differs from the baseline by smoothing: use ratios.
        """
        shape = (1, len(self.tests), len(self.c_deg), len(self.gamma_deg))
        mesh = _mesh(self.gamma_deg, self.c_deg)
        sun, sky = (
            np.zeros(shape) if tally is None else _closed(tally.by_bounce(*mesh, field_, boot=boot))
            for tally in self._tallies
        )
        return sun, sky


def variants(
    system: System,
    tests: Sequence[Daylight],
    changes: Sequence[Change],
    *,
    distance_m: float = 2.6,
    rays: int = 200_000,
    seed: int = 1,
    threads: int = 0,
    sun_samples: int = 0,
    samples: int = SAMPLES,
    sharp_side: int = Settings.sharp_side,
    sky: bool = True,
    gamma_deg: Floats = GAMMA_DEG,
    c_deg: Floats = C_DEG,
    sampler: Sampler | None = None,
) -> VariantSet:
    """Predict a system under several daylights, as it is and with each change.

    ``rays`` are traced for each sun, and `SKY_SHARE` times as many for each sky. ``c_deg`` must be closed (0 to 360).
    The result depends on seed and rays, not on ``threads`` (0: all cores). ``samples``, ``sun_samples`` and
    ``sharp_side``: see `Settings`; 0 of the second takes a quarter of the rays. Without ``sky`` the sky part is not
    traced, and zero.
    Raises `ConfigError` for a setting that does not exist.
    """
    plans = [_plan(system, {}, distance_m), *(_plan(system, change.setting, distance_m) for change in changes)]
    settings = Settings(
        rays=rays, seed=seed, samples=samples, sun_samples=sun_samples or _samples(rays), sharp_side=sharp_side
    )
    runs = _Runs(tests, settings, sampler, sky)
    for plan in plans:
        runs.want(plan)
    tallies = runs.made(threads or len(os.sched_getaffinity(0)))

    def outcome(plan: "_Plan") -> Outcome:
        return _outcome(
            tallies.get(plan.sun_key),
            tallies.get(plan.sky_key),
            len(tests),
            gamma_deg,
            c_deg,
            plan.wall_reflectance,
            plan.max_bounces,
        )

    outcomes = [outcome(plan) for plan in plans]
    base = (tallies.get(plans[0].sun_key), tallies.get(plans[0].sky_key))
    named = tuple(zip(changes, outcomes[1:], strict=True))
    return VariantSet(system, tuple(tests), gamma_deg, c_deg, outcomes[0], named, base)


def _samples(rays: int) -> int:
    return max(8192, min(rays // 4, 1 << 18))


@dataclass(frozen=True)
class _Plan:
    """A change, taken apart: what must be traced, and what the tallies give."""

    system: System
    aureole_deg: float
    distance_m: float
    wall_reflectance: float | None
    max_bounces: int | None

    @property
    def sun_key(self) -> tuple[Any, ...]:
        return "sun", self.system, self.distance_m, self.aureole_deg

    @property
    def sky_key(self) -> tuple[Any, ...]:
        return "sky", self.system, self.distance_m

    @property
    def tallied(self) -> bool:
        return self.wall_reflectance is not None or self.max_bounces is not None


def _plan(system: System, setting: Mapping[str, Any], distance_m: float) -> _Plan:
    reflectance, limit = (setting.get(key) for key in TALLY_KEYS)
    if reflectance is not None and not 0.0 <= reflectance <= 1.0:
        raise ConfigError(f"wall_reflectance: {reflectance} is not between 0 and 1")
    if limit is not None and limit < 0:
        raise ConfigError(f"max_bounces: {limit} is negative")
    aureole, distance = setting.get("aureole_deg", 0.0), setting.get("distance_m", distance_m)
    return _Plan(changed(system, setting), float(aureole), float(distance), reflectance, limit)


class _Runs:
    """The traces that the plans need, each once."""

    def __init__(self, tests: Sequence[Daylight], settings: Settings, sampler: Sampler | None, sky: bool) -> None:
        self._tests = list(tests)
        self._settings = settings
        self._sampler = sampler
        self._sky = sky
        self._wanted: dict[tuple[Any, ...], tuple[_Plan, bool]] = {}

    def want(self, plan: _Plan) -> None:
        first = not self._wanted
        for key in (plan.sun_key, plan.sky_key) if self._sky else (plan.sun_key,):
            _, tallied = self._wanted.get(key, (plan, False))
            self._wanted[key] = (plan, tallied or plan.tallied or first)

    def made(self, threads: int) -> dict[tuple[Any, ...], Tally | None]:
        for plan, _ in self._wanted.values():  # scatter tables first, so that two threads do not make the same
            skylight(plan.system, self._settings.samples, self._sampler)
        sources: dict[tuple[str, float], Source | None] = {("sky", 0.0): sky_source(self._tests)}
        jobs: list[tuple[tuple[Any, ...], Source | None]] = []
        for key, (plan, _) in self._wanted.items():
            name = (key[0], plan.aureole_deg if key[0] == "sun" else 0.0)
            if name not in sources:
                sources[name] = sun_source(self._tests, plan.aureole_deg)
            jobs.append((key, sources[name]))
        with ThreadPoolExecutor(threads) as pool:
            return dict(zip([key for key, _ in jobs], pool.map(lambda job: self._run(*job), jobs), strict=True))

    def _run(self, key: tuple[Any, ...], source: Source | None) -> Tally | None:
        if source is None:
            return None
        plan, tallied = self._wanted[key]
        count = len(self._tests) if key[0] == "sky" else 1
        use = dataclasses.replace(
            self._settings,
            rays=int(self._settings.rays * (SKY_SHARE * count if key[0] == "sky" else 1)),
            distance_m=plan.distance_m,
            bounces=0 if tallied else 1,
        )
        return trace(plan.system, source, use, self._sampler)


def _mesh(gamma_deg: Floats, c_deg: Floats) -> tuple[Floats, Floats]:
    """The grid without its last plane, as arrays that broadcast to (C, gamma)."""
    if c_deg[0] != 0.0 or c_deg[-1] != 360.0:
        raise ConfigError(f"C must run from 0 to 360, not from {c_deg[0]:g} to {c_deg[-1]:g}")
    return gamma_deg[None, :], c_deg[:-1, None]


def _closed(values: Floats) -> Floats:
    return np.concatenate([values, values[..., :1, :]], axis=-2)


def _outcome(
    sun: Tally | None,
    sky: Tally | None,
    tests: int,
    gamma_deg: Floats,
    c_deg: Floats,
    wall_reflectance: float | None,
    max_bounces: int | None,
) -> Outcome:
    gamma, c = _mesh(gamma_deg, c_deg)

    def made(name: Field) -> Parts:
        found: list[Floats] = []
        for tally in (sun, sky):
            if tally is None:
                found += [np.zeros((tests, len(c_deg), len(gamma_deg)))] * 2
                continue
            part = tally.intensity(gamma, c, name, wall_reflectance=wall_reflectance, max_bounces=max_bounces)
            found += [_closed(part.candela), _closed(part.uncertainty)]
        return Parts(found[0], found[2], found[1], found[3])

    return Outcome(made)
