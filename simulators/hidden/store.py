"""What was traced of a skylight, kept on disk under a name that changes with anything that changes its content."""

import hashlib
import json
import os
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from simulators.hidden.collect import RADII_M
from simulators.hidden.maps import COARSE, SMOOTHING_DEG, smooth
from simulators.hidden.skylight import Skylight
from simulators.hidden.symmetry import sky_nodes, symmetries
from simulators.hidden.tracer import Answer, trace

Floats = NDArray[np.float64]

RECIPE = 1
"""Raise when the tracer changes what a response holds: old ones on disk are then left alone."""
ACROSS = 57
"""Nodes across the sky's map: one every 2.8 degrees."""
RAYS_PER_NODE = 500_000
DRAWN = 0.08
"""Share of scattering and haze with which the second tracing is drawn."""

NOMINAL = Answer()
"""Nothing applied to the tallied events."""

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


class Store:
    """The parts of one skylight's response on disk; what is missing is traced when it is asked for (minutes).

    Parameters
    ----------
    skylight, rays
        What to trace, with how many rays for each sun.
    place
        Folder of the parts.
    progress
        Called with how many of how many suns are traced.
    across
        Nodes across the sky's map.
    nominal
        What is applied to the tallied events of the base.
    threads
        How many suns to trace at a time.
    """

    def __init__(
        self,
        skylight: Skylight,
        rays: int,
        place: Path,
        progress: Callable[[int, int], None] | None = None,
        *,
        across: int = ACROSS,
        nominal: Answer = NOMINAL,
        threads: int = 1,
    ) -> None:
        self.skylight = skylight
        self.nodes = sky_nodes(across, symmetries(skylight))
        self._rays = rays
        self._place = place
        self._progress = progress
        self._nominal = nominal
        self._threads = threads

    def base(self) -> NDArray[np.float32]:
        """Per traced sun and radius: intensity over cos γ [cd per lx facing the sun], (N, R, COARSE, COARSE)."""
        if not self._has("base"):
            levels = np.stack([level[0] for level in self._levels(self.skylight, self._rays, (self._nominal,))])
            self._save("base", levels.astype(np.float32))
        return self._load("base")

    def ratios(self) -> NDArray[np.float16]:
        """Ratio to the base in the far field and at the middle radius, (J, N, 2, COARSE, COARSE).

        One for each of `first_answers` after the nominal.
        """
        if not self._has("ratios"):
            base, ratios = [], []
            for level in self._levels(self.skylight, self._rays, (self._nominal, *first_answers(self.skylight)[1:])):
                base.append(level[0].astype(np.float32))
                ratios.append(_ratio(level[1:, :2], level[0, :2]).astype(np.float16))
            if not self._has("base"):
                self._save("base", np.stack(base))  # the same rays as without the answers
            self._save("ratios", np.stack(ratios, axis=1))
        return self._load("ratios")

    def changes(self) -> NDArray[np.float16]:
        """Difference from the nominal response, likewise, for each of `second_answers` after the nominal."""
        if not self._has("changes"):
            hazy = replace(self.skylight, wall_scatter=DRAWN if self.skylight.wall_finish == "specular" else 0.0)
            hazy = replace(hazy, entry=replace(hazy.entry, haze=DRAWN), exit=replace(hazy.exit, haze=DRAWN))
            answers = second_answers(self.skylight)
            levels = self._levels(hazy, self._rays // 2, answers)
            changes = [(level[1:, :2] - level[:1, :2]).astype(np.float16) for level in levels]
            self._save("changes", np.stack(changes, axis=1))
        return self._load("changes")

    def _levels(self, skylight: Skylight, rays: int, answers: tuple[Answer, ...]) -> Iterator[Floats]:
        """Smoothed distributions (A, R, COARSE, COARSE) for one traced sun after the other."""
        seeds = self.nodes.seeds

        def level(n: int) -> Floats:
            return smooth(trace(skylight, seeds[n], rays, n + 1, answers).flux)

        with ThreadPoolExecutor(self._threads) as pool:
            found = pool.map(level, range(len(seeds))) if self._threads > 1 else map(level, range(len(seeds)))
            for n, one in enumerate(found):
                yield one
                if self._progress is not None:
                    self._progress(n + 1, len(seeds))

    def _has(self, name: str) -> bool:
        return (self._place / f"{name}.npy").is_file()

    def _load(self, name: str) -> NDArray[Any]:
        loaded: NDArray[Any] = np.load(self._place / f"{name}.npy")
        return loaded

    def _save(self, name: str, array: NDArray[Any]) -> None:
        """Write an array beside its final name, then rename, so that no half of it is ever read."""
        self._place.mkdir(parents=True, exist_ok=True)
        made = self._place / f".{name}.{os.getpid()}"
        with made.open("wb") as file:
            np.save(file, array)
        made.replace(self._place / f"{name}.npy")


def _ratio(level: Floats, nominal: Floats) -> Floats:
    """Ratio of two distributions, drawn to 1 where there is next to nothing to compare."""
    floor = 1e-5 * np.max(nominal, axis=(-1, -2), keepdims=True)
    return np.asarray(np.minimum(60_000.0, (level + floor) / (nominal + floor)))


def key(skylight: Skylight, rays_per_node: int, across: int = ACROSS, *more: object) -> str:
    """Name of a response on disk: changes with anything that changes its content."""
    what = [RECIPE, across, COARSE, SMOOTHING_DEG, [str(r) for r in RADII_M], rays_per_node, asdict(skylight), *more]
    return hashlib.sha256(json.dumps(what, sort_keys=True).encode()).hexdigest()[:24]
