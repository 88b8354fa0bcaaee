"""Trace a source towards wanted directions, or back from them: candela without cells and smoothing."""

import os
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from analysis.simulate.aims import aims, own
from analysis.simulate.kernels import arrays as k
from analysis.simulate.kernels.paths import trace as trace_kernel
from analysis.simulate.kernels.paths import trace_back as back_kernel
from analysis.simulate.model import skylight
from analysis.simulate.source import Source
from analysis.simulate.system import System
from analysis.simulate.tally import Balance
from analysis.simulate.tracer import NO_LIMIT, Settings, per_ray

Floats = NDArray[np.float64]

BATCHES: Final = 32
"""The scatter between so few batches tells each direction's own uncertainty to 13 %."""


@dataclass(frozen=True)
class Aimed:
    """Intensity in wanted directions.

    Attributes
    ----------
    batches : shape (BATCHES, n) [cd]
        What each batch alone makes of it.
    balance
        Where the light went.
    """

    batches: Floats
    balance: Balance

    @property
    def candela(self) -> Floats:
        """Mean of the batches, shape (n,) [cd]."""
        mean: Floats = self.batches.mean(axis=0)
        return mean

    @property
    def uncertainty(self) -> Floats:
        """Standard uncertainty of the mean, shape (n,) [cd]."""
        error: Floats = self.batches.std(axis=0, ddof=1) / len(self.batches) ** 0.5
        return error


def trace_aimed(
    system: System, source: Source, settings: Settings, gamma_deg: Floats, c_deg: Floats, distance_m: Floats
) -> Aimed:
    """Trace one sun or sky towards directions (each of shape (n,)) of a skylight that `aims.can_be_aimed`.

    ``distance_m``: of each direction's sensor; 0 is the far field. Of the settings, rays, seed, bounce limit, glow and
    threads count. The result does not depend on the threads.
    """
    ready = skylight(system, settings.samples, prismatic_tables=False)
    shared = aims(system, gamma_deg, c_deg, distance_m)
    steps = np.concatenate([[0.0], np.cumsum(source.probability)])
    number = -(-settings.rays // BATCHES)
    light = k.Light(source.mode, source.side, steps, per_ray(source, number), source.span, source.suns, source.rays)

    def run(b: int) -> tuple[Floats, Floats]:
        part = ready._replace(**{name: getattr(ready, name)[b % 8] for name in ("above", "below", "under", "ring")})
        mine, counts = own(shared), _nothing_counted(system, settings)
        seed = np.uint64((settings.seed * 1_000_003 + b) * 65_537 + 40_503)
        trace_kernel(part, counts, light, mine, seed, number, 0, 1)
        return mine.found, counts.balance

    threads = settings.threads or len(os.sched_getaffinity(0))
    with ThreadPoolExecutor(threads) as pool:
        results = list(pool.map(run, range(BATCHES)))
    balance = np.mean([result[1] for result in results], axis=0)
    return Aimed(np.stack([result[0] for result in results]), Balance.of(balance, BATCHES))


def trace_back(
    system: System,
    source: Source,
    settings: Settings,
    gamma_deg: Floats,
    c_deg: Floats,
    distance_m: Floats,
    rays: NDArray[np.int64],
) -> Floats:
    """Candela (BATCHES, n) of one sky in directions of a skylight that `aims.can_be_followed_back`.

    ``rays`` (n,): for each direction and batch, from the sensor back to the sky. A sky is wide, so most of them meet
    some light; a sun they would hardly ever meet. Of the settings, seed, bounce limit and threads count.
    """
    ready = skylight(system, settings.samples, prismatic_tables=False)
    ready = ready._replace(**{name: getattr(ready, name)[0] for name in ("above", "below", "under", "ring")})
    shared = aims(system, gamma_deg, c_deg, distance_m)._replace(back=True)
    luminance = source.flux / (2.0 * np.pi / source.side**2)
    light = k.Light(source.mode, source.side, np.zeros(2), luminance, source.span, source.suns, source.rays)

    def run(b: int) -> Floats:
        mine = own(shared)
        seed = np.uint64((settings.seed * 1_000_003 + b) * 65_537 + 50_021)
        back_kernel(ready, _nothing_counted(system, settings), light, mine, seed, rays)
        return mine.found

    with ThreadPoolExecutor(settings.threads or len(os.sched_getaffinity(0))) as pool:
        return np.stack(list(pool.map(run, range(BATCHES))))


def _nothing_counted(system: System, use: Settings) -> k.Counts:
    """Counts with hardly any cells: what is scored needs none."""
    empty: dict[str, Any] = {name: np.zeros(1, dtype=np.float32) for name in ("fan_a", "fan_b", "fan_w")}
    empty |= {name: np.zeros(1, dtype=np.int32) for name in ("fan_far", "fan_near")}
    return k.Counts(
        sharp=np.zeros(2, dtype=np.float32),
        soft=np.zeros(2, dtype=np.float32),
        sharp_side=1,
        soft_side=1,
        classes=1,
        sharp_classes=1,
        bounces=1,
        members=1,
        diffuse_well=system.wall.lambertian > 0.5,
        diffuse_boot=system.boot_height_m > 0.0 and system.boot.lambertian > 0.5,
        distance=0.0,
        flat=False,
        split=1,
        glow=use.glow,
        limit=NO_LIMIT if use.max_bounces is None else use.max_bounces,
        balance=np.zeros(9),
        **empty,
    )
