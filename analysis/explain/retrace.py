"""Re-simulations, of the case's own and of ours, as changes of the predicted fields along a setting."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import Protocol

import numpy as np

from analysis.cases.model import Floats
from analysis.explain.fields import Fields
from analysis.explain.look import Likened
from analysis.explain.parameter import Parameter


@dataclass(frozen=True)
class Path:
    """Fields along one setting: at its positions they are simulated, between them interpolated.

    Attributes
    ----------
    positions : shape (K,)
        Settings, increasing; the baseline's is one of them.
    sun, sky : shape (K, T, P, G)
        Ratio to the baseline at each position; where ``added``, the light [cd] that comes on top of it instead.
    of_case
        Whether the case brings it: its lens is the prediction's own, not one that is like it.
    alike
        Whether it was traced on a lens that is hardly unlike the prediction's (`Likened.alike`).
    held
        Other settings that were changed with it, and stay as they were simulated.
    supposed
        Settings of the system in both simulations, with the change and without.
    """

    label: str
    parameter: Parameter
    positions: Floats
    sun: Floats
    sky: Floats
    geometric: bool = False
    added: bool = False
    of_case: bool = False
    alike: bool = False
    held: Mapping[str, float] = field(default_factory=dict)
    supposed: Mapping[str, float] = field(default_factory=dict)

    def change(self, at: float, base: Fields) -> tuple[Floats, Floats]:
        """Fields (T, P, G) of both parts at setting ``at`` (extrapolated beyond the ends)."""
        k = int(np.clip(np.searchsorted(self.positions, at, side="right") - 1, 0, len(self.positions) - 2))
        x = (at - self.positions[k]) / (self.positions[k + 1] - self.positions[k])
        sun, sky = self._between(self.sun, k, x), self._between(self.sky, k, x)
        return (base.sun + sun, base.sky + sky) if self.added else (base.sun * sun, base.sky * sky)

    def _between(self, ratio: Floats, k: int, x: float) -> Floats:
        if self.geometric:
            return np.asarray(ratio[k] ** (1 - x) * ratio[k + 1] ** x)
        return np.asarray(np.maximum((1 - x) * ratio[k] + x * ratio[k + 1], 0.0))


def by_system(path: Path, tests: Mapping[str, list[int]]) -> Iterator[Path]:
    """The path for all systems together, and for each that it changes alone; ``tests`` are those of each system."""
    touched = [name for name, rows in tests.items() if _changes(path, rows)]
    if touched:
        yield path
    if len(touched) > 1:
        yield from (_alone(path, name, tests[name]) for name in touched)


def _changes(path: Path, rows: list[int]) -> bool:
    same = 0.0 if path.added else 1.0
    return any(bool(np.any(np.abs(part[:, rows] - same) > 1e-3)) for part in (path.sun, path.sky))


def _alone(path: Path, name: str, rows: list[int]) -> Path:
    keep = np.isin(np.arange(path.sun.shape[1]), rows)[None, :, None, None]
    sun, sky = (np.where(keep, part, 0.0 if path.added else 1.0) for part in (path.sun, path.sky))
    return replace(path, label=f"{path.label}, {name} only", sun=sun, sky=sky)


class Simulator(Protocol):
    """Our own re-simulations of the case's systems, as ratios to our own baseline."""

    def paths(self, mechanism: str) -> tuple[Path, ...]:
        """Paths of settings for one mechanism; empty where it has none."""
        ...

    def aureole(self, width_deg: float) -> Floats | None:
        """Sun part (T, P, G) with the whole beam spread over an aureole, over the sun part of the disc alone."""
        ...

    def near_field(self) -> tuple[Floats, Floats] | None:
        """Ratio (T, P, G) of near to far intensity of both parts."""
        ...

    def sky_part(self) -> Floats | None:
        """The predicted sky part (T, P, G) [cd], where only the sum is given; NaN in tests that it cannot trace."""
        ...

    def traced_systems(self) -> Mapping[str, Likened]:
        """The systems that are traced, by id: as described, with lenses like the prediction's."""
        ...


@dataclass(frozen=True)
class Retraced:
    """All re-simulations that a case can have; the case's own variants come first.

    Attributes
    ----------
    case_paths
        Mechanism to what the case's variants change.
    simulator
        Supplies what they do not.
    idle
        Variants that are no way in which anything acts: they change nothing, or take away what the prediction has.
    has, lacks
        Mechanisms that the prediction has, or has not, by what its variants change.
    """

    case_paths: dict[str, tuple[Path, ...]]
    simulator: Simulator | None = None
    idle: tuple[Path, ...] = ()
    has: frozenset[str] = frozenset()
    lacks: frozenset[str] = frozenset()

    @property
    def alike(self) -> bool:
        """Whether what is traced has lenses that are hardly unlike the prediction's."""
        return self.simulator is not None and any(x.alike for x in self.simulator.traced_systems().values())

    def of_case(self) -> Iterator[Path]:
        """All that the case's variants change, or do not."""
        for paths in (*self.case_paths.values(), self.idle):
            yield from paths

    def paths(self, mechanism: str) -> tuple[Path, ...]:
        """Paths of settings for one mechanism: a case's variants may not reach as far as the settings do."""
        own = self.case_paths.get(mechanism, ())
        return own if self.simulator is None else (*own, *self.simulator.paths(mechanism))

    def sun_later(self, minutes: float, path: Path | None = None) -> Floats | None:
        """Ratio (T, P, G) of the sun part with the sun ``minutes`` later, by the first path if none is given.

        ``None`` where it is not known.
        """
        known = (path,) if path is not None else self.paths("clock-offset")
        if not known:
            return None
        one = Fields(np.ones(known[0].sun.shape[1:]), np.ones(known[0].sun.shape[1:]))
        return known[0].change(minutes, one)[0]

    def aureole(self, width_deg: float) -> Floats | None:
        """See `Simulator.aureole`: a ratio; ``None`` without a simulator."""
        return self.simulator.aureole(width_deg) if self.simulator else None

    def near_field(self) -> tuple[Floats, Floats] | None:
        """See `Simulator.near_field`; the case's variant counts if there is one."""
        if own := self.case_paths.get("near-field"):
            return own[-1].sun[-1], own[-1].sky[-1]
        return self.simulator.near_field() if self.simulator else None
