"""What a skylight does with light from any place in the sky: traced once, kept on disk, then only sums.

A response holds, for every node of a grid over the sky, the distribution below for 1 lx of light from there on a
plane that faces it. A sun is a smooth mean of the nodes about it, a sky a sum over all of them. Other wall
reflectances, bounce limits and dirt are ratios to the nominal response; scattering walls and haze, which put light
where there was next to none, are differences from it; each is counted on the same rays as what it is compared with.
"""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from simulators.hidden.maps import Field, turned
from simulators.hidden.skylight import Skylight
from simulators.hidden.store import DEPTHS, LIMITS, RAYS_PER_NODE, SHARES, Store, cache_folder, key, reflectances
from simulators.hidden.symmetry import SkyNodes, apply, symmetries
from simulators.hidden.tracer import Answer

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Response:
    """The response of one skylight.

    Attributes
    ----------
    store
        What was traced of it.
    base : shape (N, R, COARSE, COARSE)
        Per traced sun and radius: intensity over cos γ [cd per lx facing the sun].
    turn_deg
        A round skylight may be turned as a whole, counter-clockwise seen from above [deg].
    """

    store: Store
    base: NDArray[np.float32]
    turn_deg: float = 0.0
    _logs: dict[int, NDArray[np.float32]] = field(default_factory=dict, compare=False)

    @property
    def skylight(self) -> Skylight:
        """What was traced."""
        return self.store.skylight

    @property
    def nodes(self) -> SkyNodes:
        """Which suns."""
        return self.store.nodes

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
        factor, change = self._factor(answer), self._change(answer)
        if factor is None and change is None:
            return self
        base: NDArray[np.float32] = np.asarray(self.base)
        if factor is not None:
            base = base * factor[:, [0, 1, 1]]
        if change is not None:
            base = np.maximum(base + change[:, [0, 1, 1]], np.float32(0.0))
        return replace(self, base=base)

    def _factor(self, answer: Answer) -> NDArray[np.float32] | None:
        """Ratio (N, 2, COARSE, COARSE) of an answer to the nominal response; None where nothing changes."""
        parts = []
        nominal = self.skylight.wall_reflectance
        wanted = answer.wall_reflectance
        if wanted is not None and wanted != nominal:
            knots = reflectances(nominal)
            parts.append(_curve([k - nominal for k in knots], [self._log(i) for i in range(3)], wanted - nominal))
        if answer.max_bounces:
            if answer.max_bounces not in LIMITS:
                raise ValueError(f"bounce limits that were traced: {LIMITS}, not {answer.max_bounces}")
            parts.append(self._log(3 + LIMITS.index(answer.max_bounces)))
        if answer.soiling:
            first = 3 + len(LIMITS)
            parts.append(_curve(DEPTHS, [self._log(first), self._log(first + 1)], answer.soiling))
        return np.exp(np.clip(np.sum(parts, axis=0), -12.0, 4.0)) if parts else None

    def _change(self, answer: Answer) -> NDArray[np.float32] | None:
        """Difference (N, 2, COARSE, COARSE) of an answer from the nominal response; None where nothing changes."""
        if not answer.wall_scatter and not answer.haze:
            return None
        specular = self.skylight.wall_finish == "specular"
        if answer.wall_scatter and not specular:
            raise ValueError("only a specular wall can begin to scatter")
        changes = self.store.changes()
        total = np.zeros(changes.shape[1:], dtype=np.float32)
        for share, first in ((answer.wall_scatter, 0), (answer.haze, len(SHARES) if specular else 0)):
            if share:  # the difference is nearly a parabola in the share
                total += _curve(SHARES, [changes[first + k].astype(np.float32) for k in range(len(SHARES))], share)
        return total

    def _log(self, index: int) -> NDArray[np.float32]:
        if index not in self._logs:
            self._logs[index] = np.log(np.maximum(self.store.ratios()[index].astype(np.float32), 1e-4))
        return self._logs[index]


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


def response(
    skylight: Skylight,
    rays_per_node: int = RAYS_PER_NODE,
    folder: Path | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> Response:
    """Return the response of a skylight, from disk if it was traced before, else traced now (minutes).

    The rays per node are for a skylight with all eight symmetries; one with fewer gets fewer, so that the whole
    costs at most twice as much. Ratios and changes are traced when an answer first needs them.
    """
    place = (folder or cache_folder()) / f"{skylight.kind}-{key(skylight, rays_per_node)}"
    rays = max(1000, rays_per_node * min(8, 2 * len(symmetries(skylight))) // 8)
    store = Store(skylight, rays, place, progress)
    return Response(store, store.base())
