"""Trace a source through a skylight: batches over threads, the same result whatever their number."""

import math
import os
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from analysis.simulate.aims import NO_AIMS
from analysis.simulate.kernels import arrays as k
from analysis.simulate.kernels.paths import trace as trace_kernel
from analysis.simulate.lens import LEAST, PARTS, SAMPLES, Sampler, piece_of
from analysis.simulate.model import for_sun, skylight, with_ring
from analysis.simulate.source import Source
from analysis.simulate.system import System
from analysis.simulate.tally import Balance, Tally
from labdaq.errors import ConfigError

Floats = NDArray[np.float64]

BATCHES: Final = PARTS
NO_LIMIT: Final = 1 << 40
ROUND: Final = 4_000_000
"""Rays that single precision sums take before they are added up in double precision."""

PIECES: Final = 16
"""Pieces in which a batch reads its scatter tables, one after the other.

The tables of a skylight with two prismatic sheets take 17 MB, and most rays waited for memory; a piece of each, 1 to 2
MB, stays near the processor. More pieces gain nothing: each is copied, and overlaps its neighbour.
"""

LEAST_PIECE: Final = 2_000
"""Rays that a piece should serve, lest copying it costs more than it saves."""


@dataclass(frozen=True)
class Settings:
    """How a run is made.

    Attributes
    ----------
    rays
        Rays sent towards the cover, for each sun, or for all skies together.
    seed
        Same seed, same rays: variants of one system then differ by physics only.
    distance_m
        Of the near field's sensors from the aperture's centre; 0 for the far field alone.
    flat
        The sensors lie in a horizontal plane that far below the aperture and look up; see `Tally.illuminance`.
    max_bounces
        Rays are cut after so many reflections at walls; None follows them to the end. (A finished run can be cut
        afterwards with `Tally.collapsed`; cutting now only saves time.)
    split, glow
        Samples scored for each ray at a prismatic lens before the room, and at each reflection from a diffuse wall.
    sharp_side, soft_side
        Direction cells along the side of the tallies' squares (128: 1.1 degrees, 64: 2.2), for light of specular paths
        and for light that a diffuse wall sent.
    bounces
        Wall reflections told apart in the tally (more are counted with the last); 0 chooses by the well's shape.
    samples
        Entries per direction of the lens tables.
    sun_samples
        Entries of the tables made for each sun and facet; 0 uses the general tables for suns too.
        About an eighth of the rays is enough. An exit lens behind a clear cover has a ring of such tables, each with
        an eighth of the entries.
    threads
        Cores to use; 0 means all there are.
    """

    rays: int = 2_000_000
    seed: int = 1
    distance_m: float = 2.6
    flat: bool = False
    max_bounces: int | None = None
    split: int = 32
    glow: int = 1
    sharp_side: int = 128
    soft_side: int = 64
    bounces: int = 0
    samples: int = SAMPLES
    sun_samples: int = 65_536
    threads: int = 1


def trace(system: System, source: Source, settings: Settings | None = None, sampler: Sampler | None = None) -> Tally:
    """Trace a source; the tally holds lumens by direction, bounce, field, member and batch.

    The result depends on system, source, rays and seed only: each of the eight batches has random numbers and a tally
    of its own, and they are added in order. ``sampler`` replaces the ray tracer of prismatic sheets.
    """
    use = settings or Settings()
    if not 1 <= use.split <= LEAST // PARTS:
        raise ConfigError(f"split: {use.split} is not between 1 and {LEAST // PARTS}")
    ready = skylight(system, use.samples, sampler)
    jobs = _jobs(system, ready, source, use, sampler)
    blank = _counts(system, use, 1 if len(jobs) > 1 else source.members)
    sharp = np.zeros((BATCHES, len(jobs), *blank.sharp.shape), dtype=np.float32)
    soft = np.zeros((BATCHES, len(jobs), *blank.soft.shape), dtype=np.float32)

    def run(number: int) -> tuple[Any, Any, Floats]:
        b, j = divmod(number, len(jobs))
        return _batch(*jobs[j], _own(blank, sharp[b, j], soft[b, j]), use, b)

    threads = use.threads or len(os.sched_getaffinity(0))
    count = BATCHES * len(jobs)
    if threads > 1:
        with ThreadPoolExecutor(min(threads, count)) as pool:
            results = list(pool.map(run, range(count)))
    else:
        results = [run(number) for number in range(count)]
    if results[0][0] is not None:
        sharp = np.stack([result[0] for result in results]).reshape(sharp.shape)
        soft = np.stack([result[1] for result in results]).reshape(soft.shape)
    balance = np.sum([result[2] for result in results], axis=0) / BATCHES
    return Tally(
        sharp=_axes(sharp, blank, use.sharp_side, sharp=True),
        soft=_axes(soft, blank, use.soft_side, sharp=False),
        system=system,
        distance_m=use.distance_m,
        flat=use.flat,
        max_bounces=use.max_bounces,
        balance=Balance.of(balance, BATCHES),
    )


def _jobs(
    system: System, ready: k.Skylight, source: Source, use: Settings, sampler: Sampler | None
) -> list[tuple[k.Skylight, Source]]:
    """Each sun is a job of its own, with its own entry table where that is exact; skies and ray sets are one job."""
    if source.mode == k.GIVEN:
        return [(ready, replace(source, rays=_in_frame(source.rays, ready.geometry)))]
    if source.mode == k.SKY:
        return [(ready, source)]
    disc = use.sun_samples > 0 and not np.any(source.suns[:, 4])
    exact = disc and system.entry.kind in ("prismatic", "bsdf", "shift") and ready.geometry[k.COVER] != k.DOME
    ring = disc and system.entry.kind in ("none", "clear") and system.exit.kind == "prismatic"
    jobs = []
    for row, flux in zip(source.suns, np.diag(source.flux), strict=True):
        own = for_sun(ready, system, row[:3], use.sun_samples, sampler) if exact else ready
        if ring:
            own = with_ring(own, system, float(row[2]), use.sun_samples // 8, sampler)
        one = replace(
            source, probability=np.ones(1), flux=np.array([[flux]]), span=np.array([[0, 1]]), suns=row[None, :].copy()
        )
        jobs.append((own, one))
    return jobs


def _counts(system: System, use: Settings, members: int) -> k.Counts:
    boot = system.boot_height_m > 0.0
    soft_wall = system.wall.lambertian > 0.5
    soft_boot = boot and system.boot.lambertian > 0.5
    classes = 4 if boot else 1
    sharp_classes = 1 if soft_boot else classes
    width = min(system.aperture.size_m) if system.aperture.shape == "rectangle" else system.aperture.diameter_m
    bounces = use.bounces or (24 if soft_wall else min(64, 12 + math.ceil(12 * system.well_depth_m / width)))
    fields = 2 if use.distance_m > 0.0 else 1
    sharp = sharp_classes * (1 if soft_wall else bounces) * fields * use.sharp_side**2 * members
    soft = classes * bounces * fields * use.soft_side**2 * members if soft_wall or soft_boot else 1
    return k.Counts(
        sharp=np.empty(sharp, dtype=np.float32),
        soft=np.empty(soft, dtype=np.float32),
        sharp_side=use.sharp_side,
        soft_side=use.soft_side,
        classes=classes,
        sharp_classes=sharp_classes,
        bounces=bounces,
        members=members,
        diffuse_well=soft_wall,
        diffuse_boot=soft_boot,
        distance=use.distance_m,
        flat=use.flat,
        split=use.split,
        glow=use.glow,
        limit=NO_LIMIT if use.max_bounces is None else use.max_bounces,
        balance=np.zeros(9),
        fan_a=np.zeros(use.split, dtype=np.float32),
        fan_b=np.zeros(use.split, dtype=np.float32),
        fan_w=np.zeros(use.split, dtype=np.float32),
        fan_far=np.zeros(use.split, dtype=np.int32),
        fan_near=np.zeros(use.split, dtype=np.int32),
    )


def _own(counts: k.Counts, sharp: Any, soft: Any) -> k.Counts:
    """Counts that no other batch writes to."""
    names = ("balance", "fan_a", "fan_b", "fan_w", "fan_far", "fan_near")
    return counts._replace(sharp=sharp, soft=soft, **{name: getattr(counts, name).copy() for name in names})


def _axes(hits: Any, counts: k.Counts, side: int, sharp: bool) -> Any:
    """Name the axes of flat tallies (batches, jobs, ...): (batches, boot, wall, field, cell, member)."""
    fields = 2 if counts.distance > 0.0 else 1
    cells = side**2
    classes = counts.sharp_classes if sharp else counts.classes
    bounces = 1 if sharp and counts.diffuse_well else counts.bounces
    if hits.shape[-1] == 1:
        return np.zeros((hits.shape[0], 1, 1, fields, cells, hits.shape[1] * counts.members), dtype=np.float32)
    named = hits.reshape(hits.shape[0], hits.shape[1], classes, bounces, fields, cells, counts.members)
    return np.moveaxis(named, 1, -2).reshape(hits.shape[0], classes, bounces, fields, cells, -1)


def _batch(ready: k.Skylight, source: Source, counts: k.Counts, use: Settings, b: int) -> tuple[Any, Any, Floats]:
    """Trace one batch of one job into its tally; long ones in rounds, whose double precision sums are returned."""
    given = source.mode == k.GIVEN
    rays = source.rays[b::BATCHES] if given else source.rays
    total = len(rays) if given else math.ceil(use.rays / BATCHES)
    rounds = max(1, math.ceil(total / ROUND))
    count = math.ceil(total / rounds)
    ready = ready._replace(above=ready.above[b], below=ready.below[b], under=ready.under[b], ring=ready.ring[b])
    steps = np.concatenate([[0.0], np.cumsum(source.probability)])
    sums: tuple[Any, Any] = (None, None)
    for r in range(rounds):
        part = rays[r * count : (r + 1) * count] if given else rays
        number = len(part) if given else count
        flux = source.flux * BATCHES if given else per_ray(source, number * rounds)
        light = k.Light(source.mode, source.side, steps, flux, source.span, source.suns, np.ascontiguousarray(part))
        seed = np.uint64((use.seed * 1_000_003 + b) * 65_537 + r)
        _through_pieces(ready, counts, light, seed, number)
        if rounds > 1:
            here = (counts.sharp.astype(np.float64), counts.soft.astype(np.float64))
            sums = here if sums[0] is None else (sums[0] + here[0], sums[1] + here[1])
            counts.sharp[:] = 0.0
            counts.soft[:] = 0.0
    return sums[0], sums[1], counts.balance


def _through_pieces(ready: k.Skylight, counts: k.Counts, light: k.Light, seed: np.uint64, number: int) -> None:
    """Trace rays, every n-th of them through the n-th pieces of the tables."""
    pieces = max(1, min(PIECES, number // LEAST_PIECE))
    for n in range(pieces):
        near: dict[str, Any] = {
            name: piece_of(getattr(ready, name), n, pieces, counts.split)
            for name in ("above", "below", "under", "ring")
        }
        trace_kernel(ready._replace(**near), counts, light, NO_AIMS, seed, number, n, pieces)


def per_ray(source: Source, rays: int) -> Floats:
    """What a ray of each cell carries per projected area, so that every batch alone gives the whole flux."""
    probability = np.where(source.probability > 0.0, source.probability, 1.0)
    flux: Floats = source.flux / (probability * rays)[:, None]
    return flux


def _in_frame(rays: Floats, geometry: tuple[float, ...]) -> Floats:
    """Given rays in the skylight's own frame."""
    c, s = geometry[k.TURN_C], geometry[k.TURN_S]
    turned = rays.copy()
    for first in (0, 3, 6):
        turned[:, first] = c * rays[:, first] + s * rays[:, first + 1]
        turned[:, first + 1] = c * rays[:, first + 1] - s * rays[:, first]
    return turned
