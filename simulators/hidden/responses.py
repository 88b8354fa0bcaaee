"""What a skylight does with light from any place in the sky: traced once, kept on disk, then only sums.

A response holds, for every node of a grid over the sky, the distribution below for 1 lx of light from there on a
plane that faces it. A sun is a smooth mean of the nodes about it, a sky a sum over all of them. Beside the nominal
response lie ratios to it for other wall reflectances, bounce limits, scattering walls, haze and dirt, counted on
the same rays.
"""

import hashlib
import json
import os
import tempfile
from collections.abc import Callable
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from simulators.hidden.collect import RADII_M
from simulators.hidden.maps import COARSE, SMOOTHING_DEG, Field, smooth, turned
from simulators.hidden.skylight import Skylight
from simulators.hidden.symmetry import SkyNodes, apply, sky_nodes, symmetries
from simulators.hidden.tracer import Answer, trace

Floats = NDArray[np.float64]

RECIPE = 1
"""Raise when the tracer changes what a response holds: old ones on disk are then left alone."""
ACROSS = 57
"""Nodes across the sky's map: one every 2.8 degrees."""
RAYS_PER_NODE = 500_000
DRAWN = 0.08
"""Share of scattering and haze with which the second tracing is drawn."""

REFLECTANCE_STEPS = (-0.12, -0.05, 0.03)
LIMITS = (1, 2, 3, 4, 6, 9, 14)
SHARES = (0.04, 0.12)
DEPTHS = (0.1, 0.4)


def cache_folder() -> Path:
    """Where responses are kept: ``$XDG_CACHE_HOME/labdaq`` or ``~/.cache/labdaq``."""
    base = os.environ.get("XDG_CACHE_HOME")
    return (Path(base) if base else Path.home() / ".cache") / "labdaq" / "responses"


def reflectances(nominal: float) -> tuple[float, ...]:
    """Wall reflectances for which ratios are kept, beside the nominal one."""
    return tuple(min(0.998, nominal + step) for step in REFLECTANCE_STEPS)


def first_answers(skylight: Skylight) -> tuple[Answer, ...]:
    """Answers of the tracing without scattering or haze, the nominal one first."""
    walls = [Answer(wall_reflectance=r) for r in reflectances(skylight.wall_reflectance)]
    limits = [Answer(max_bounces=n) for n in LIMITS]
    dirt = [Answer(soiling=depth) for depth in DEPTHS]
    return (Answer(), *walls, *limits, *dirt)


def second_answers(skylight: Skylight) -> tuple[Answer, ...]:
    """Answers of the tracing with them, its own nominal one first."""
    clear = Answer(wall_scatter=0.0, haze=0.0)
    scatter = [replace(clear, wall_scatter=f) for f in SHARES] if skylight.wall_finish == "specular" else []
    return (clear, *scatter, *[replace(clear, haze=h) for h in SHARES])


@dataclass(frozen=True)
class Response:
    """The response of one skylight.

    Attributes
    ----------
    skylight
        What was traced.
    nodes
        Which suns.
    base : shape (N, R, COARSE, COARSE)
        Per traced sun and radius: intensity over cos γ [cd per lx facing the sun].
    ratios : shape (J, N, 2, COARSE, COARSE)
        Ratio to ``base`` in the far field and at the middle radius, for all answers but the nominal, first and second.
    turn_deg
        A round skylight may be turned as a whole, counter-clockwise seen from above [deg].
    """

    skylight: Skylight
    nodes: SkyNodes
    base: NDArray[np.float32]
    ratios: NDArray[np.float16]
    turn_deg: float = 0.0
    _logs: dict[int, NDArray[np.float32]] = field(default_factory=dict, compare=False)

    @property
    def directions(self) -> Floats:
        """Unit vectors (n_all, 3) towards the places in the sky that a `sky` is given at."""
        return turned(self.nodes.directions, self.turn_deg)

    def sun(self, direction: Floats) -> Field:
        """Light below for 1 lx of sunlight facing ``direction`` (3,)."""
        return self.suns(np.asarray(direction, dtype=np.float64)[None], np.ones(1))

    def suns(self, directions: Floats, normal_lx: Floats) -> Field:
        """Light below for several suns together: unit vectors (k, 3) and illuminances facing them (k,) [lx]."""
        weights = np.zeros(len(self.nodes.where))
        for direction, level in zip(turned(directions, -self.turn_deg), normal_lx, strict=True):
            nodes, share = self.nodes.spline(direction)
            np.add.at(weights, nodes, share * level)
        return self.weighted(weights[None])[0]

    def sky(self, luminance: Floats) -> list[Field]:
        """Light below for skies given as luminance at `directions`, shape (K, n_all) [cd/m²]."""
        return self.weighted(np.atleast_2d(luminance) * self.nodes.solid_angle)

    def turned(self, degrees: float) -> "Response":
        """The same skylight turned counter-clockwise, seen from above; only a round one can be."""
        if degrees and not self.skylight.round:
            raise ValueError("only a round skylight is the same when it is turned; trace the turned lens instead")
        return replace(self, turn_deg=self.turn_deg + degrees)

    def blended(self, other: "Response", share: float) -> "Response":
        """A skylight of which a ``share`` of the area is like ``other``."""
        base = (1.0 - share) * self.base + share * other.base
        return replace(self, base=base.astype(np.float32))

    def weighted(self, weights: Floats) -> list[Field]:
        """Light below for illuminances (K, n_all) [lx, facing each node] from all nodes together."""
        shape = self.base.shape[1:]
        flat = self.base.reshape(len(self.base), -1)
        group = self.nodes.group
        per_seed = np.zeros((len(group), len(weights), len(self.base)), dtype=np.float32)
        where: Any = (self.nodes.turn, slice(None), self.nodes.seed)
        np.add.at(per_seed, where, weights.T.astype(np.float32))
        rows = per_seed.reshape(-1, len(self.base))
        used = np.flatnonzero(rows.any(axis=0))
        if len(used) < len(flat) // 2:
            rows, flat = rows[:, used], flat[used]
        parts = (rows @ flat).reshape(len(group), len(weights), *shape)
        total = sum((apply(g, part) for g, part in zip(group, parts, strict=True)), start=np.zeros(shape))
        return [Field(values, self.turn_deg) for values in total]

    def with_answer(self, answer: Answer) -> "Response":
        """The response with an answer applied, by interpolation between those that were traced."""
        factor = self._factor(answer)
        if factor is None:
            return self
        near = factor[:, 1]
        base = self.base * np.stack([factor[:, 0], near, near], axis=1)
        return replace(self, base=base.astype(np.float32))

    def _factor(self, answer: Answer) -> NDArray[np.float32] | None:
        """Ratio (N, 2, COARSE, COARSE) of an answer to the nominal response; None where nothing changes."""
        parts = []
        nominal = self.skylight.wall_reflectance
        wanted = answer.wall_reflectance
        if wanted is not None and wanted != nominal:
            knots = reflectances(nominal)
            parts.append(_curve([k - nominal for k in knots], [self._log(i) for i in range(3)], wanted - nominal))
        if answer.max_bounces:
            parts.append(self._limited(answer.max_bounces))
        if answer.soiling:
            first = 3 + len(LIMITS)
            logs = [self._log(first), self._log(first + 1)]
            parts.append(_curve(DEPTHS, logs, answer.soiling))
        after = 3 + len(LIMITS) + len(DEPTHS)
        if answer.wall_scatter:
            if self.skylight.wall_finish != "specular":
                raise ValueError("only a specular wall can begin to scatter")
            parts.append(self._shared(after, answer.wall_scatter))
        if answer.haze:
            after += 2 if self.skylight.wall_finish == "specular" else 0
            parts.append(self._shared(after, answer.haze))
        return np.exp(np.clip(np.sum(parts, axis=0), -12.0, 4.0)) if parts else None

    def _log(self, index: int) -> NDArray[np.float32]:
        if index not in self._logs:
            self._logs[index] = np.log(np.maximum(self.ratios[index].astype(np.float32), 1e-4))
        return self._logs[index]

    def _shared(self, index: int, share: float) -> NDArray[np.float32]:
        """Logarithm of the ratio for a share of scattered light: the ratio itself is nearly a parabola in it."""
        changes = [self.ratios[index + k].astype(np.float32) - np.float32(1.0) for k in range(len(SHARES))]
        return np.asarray(np.log(np.maximum(1.0 + _curve(SHARES, changes, share), np.float32(0.02))))

    def _limited(self, limit: int) -> NDArray[np.float32]:
        if limit not in LIMITS:
            raise ValueError(f"bounce limits that were traced: {LIMITS}, not {limit}")
        return self._log(3 + LIMITS.index(limit))


def _curve(knots: tuple[float, ...] | list[float], values: list[NDArray[np.float32]], at: float) -> NDArray[np.float32]:
    """Polynomial through (0, 0) and the knots, at ``at``."""
    total = np.zeros_like(values[0])
    for i, (knot, value) in enumerate(zip(knots, values, strict=True)):
        weight = at / knot
        for k, other in enumerate(knots):
            if k != i:
                weight *= (at - other) / (knot - other)
        total += np.float32(weight) * value
    return total


def key(skylight: Skylight, rays_per_node: int) -> str:
    """Name of a response on disk: changes with anything that changes its content."""
    what = [RECIPE, ACROSS, COARSE, SMOOTHING_DEG, [str(r) for r in RADII_M], rays_per_node, asdict(skylight)]
    return hashlib.sha256(json.dumps(what, sort_keys=True).encode()).hexdigest()[:24]


def response(
    skylight: Skylight,
    rays_per_node: int = RAYS_PER_NODE,
    folder: Path | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> Response:
    """Return the response of a skylight, from disk if it was traced before, else traced now (minutes).

    The rays per node are for a skylight with all eight symmetries; one with fewer gets fewer, so that the whole
    costs at most twice as much.
    """
    place = (folder or cache_folder()) / f"{skylight.kind}-{key(skylight, rays_per_node)}"
    nodes = sky_nodes(ACROSS, symmetries(skylight))
    if not (place / "ratios.npy").is_file():
        _write(place, *_traced(skylight, nodes, rays_per_node, progress))
    base = np.load(place / "base.npy", mmap_mode="r")
    return Response(skylight, nodes, base, np.load(place / "ratios.npy", mmap_mode="r"))


def _traced(
    skylight: Skylight, nodes: SkyNodes, rays_per_node: int, progress: Callable[[int, int], None] | None
) -> tuple[NDArray[np.float32], NDArray[np.float16]]:
    rays = max(1000, rays_per_node * min(8, 2 * len(nodes.group)) // 8)
    hazy = replace(skylight, wall_scatter=DRAWN if skylight.wall_finish == "specular" else 0.0)
    hazy = replace(hazy, entry=replace(hazy.entry, haze=DRAWN), exit=replace(hazy.exit, haze=DRAWN))
    first, second = first_answers(skylight), second_answers(skylight)
    shape = (len(nodes.seeds), len(RADII_M), COARSE, COARSE)
    base = np.zeros(shape, dtype=np.float32)
    ratios = np.zeros((len(first) + len(second) - 2, len(nodes.seeds), 2, COARSE, COARSE), dtype=np.float16)
    for n, sun in enumerate(nodes.seeds):
        seed = n + 1
        level = smooth(trace(skylight, sun, rays, seed, first).flux)
        base[n] = level[0]
        ratios[: len(first) - 1, n] = _ratio(level[1:, :2], level[0, :2])
        level = smooth(trace(hazy, sun, rays // 2, seed, second).flux)
        ratios[len(first) - 1 :, n] = _ratio(level[1:, :2], level[0, :2])
        if progress:
            progress(n + 1, len(nodes.seeds))
    return base, ratios


def _ratio(level: Floats, nominal: Floats) -> Floats:
    """Ratio of two distributions, drawn to 1 where there is next to nothing to compare."""
    floor = 1e-5 * np.max(nominal, axis=(-1, -2), keepdims=True)
    return np.asarray(np.minimum(60_000.0, (level + floor) / (nominal + floor)))


def _write(place: Path, base: NDArray[np.float32], ratios: NDArray[np.float16]) -> None:
    """Write a response beside its final name, then rename, so that no half of it is ever read."""
    place.parent.mkdir(parents=True, exist_ok=True)
    made = Path(tempfile.mkdtemp(dir=place.parent, prefix=".new-"))
    np.save(made / "base.npy", base)
    np.save(made / "ratios.npy", ratios)
    try:
        made.rename(place)
    except OSError:  # another process was faster: its result is the same
        for file in made.iterdir():
            file.unlink()
        made.rmdir()


__all__ = ["Response", "cache_folder", "response"]
