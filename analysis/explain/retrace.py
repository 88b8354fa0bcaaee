"""Re-simulations: the case's variants, and where it brings none, our own, as changes of the predicted fields."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from analysis.cases import Case
from analysis.cases.model import Floats, Variant
from analysis.explain.fields import Fields, fields_of, from_files
from analysis.explain.likeness import Likened
from analysis.explain.parameter import Parameter
from analysis.explain.readings import Readings

_BEYOND = 2.2  # as far as a setting may lie beyond a case's variants, in the steps from the baseline to them
_RATIO = (0.02, 50.0)  # a re-simulated ratio beyond these is noise of the rays, not physics


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
    """

    label: str
    parameter: Parameter
    positions: Floats
    sun: Floats
    sky: Floats
    geometric: bool = False
    added: bool = False
    of_case: bool = False

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
    """All re-simulations that a case can have; the case's own variants come first."""

    case_paths: dict[str, tuple[Path, ...]]
    simulator: Simulator | None = None

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
            return own[0].sun[-1], own[0].sky[-1]
        return self.simulator.near_field() if self.simulator else None


def retraced_of(case: Case, simulator: Simulator | None = None) -> Retraced:
    """Read the case's variants; ``simulator`` supplies what they do not."""
    grouped: dict[tuple[str, str], list[tuple[float | None, Variant]]] = {}
    for variant in case.setup.variant:
        key, value = _setting(variant)
        grouped.setdefault((variant.mechanism, key), []).append((value, variant))
    paths: dict[str, tuple[Path, ...]] = {}
    if grouped:
        base = fields_of(Readings.of(case, measured_only=False))
        for (mechanism, key), members in grouped.items():
            made = tuple(_paths(case, base, mechanism, key, members))
            paths[mechanism] = (*paths.get(mechanism, ()), *made)
    return Retraced(paths, simulator)


def _setting(variant: Variant) -> tuple[str, float | None]:
    """The one number a variant changes, if it is one number; else a label and no number."""
    numbers = {
        k: float(v) for k, v in variant.setting.items() if isinstance(v, int | float) and not isinstance(v, bool)
    }
    if len(numbers) == 1 and len(variant.setting) == 1:
        ((key, value),) = numbers.items()
        return key, value
    return ", ".join(f"{k} = {v}" for k, v in variant.setting.items()) or "variant", None


def _base_position(case: Case, key: str) -> float | None:
    """Where the baseline stands on the scale of a setting; ``None`` where that is not known."""
    if key == "wall_reflectance":
        known = {s.wall_reflectance for s in case.setup.system if s.wall_reflectance is not None}
        return known.pop() if len(known) == 1 else None
    if key == "max_bounces":
        return None  # "more bounces" is all or nothing: the real light has no limit
    return 0.0


def _paths(
    case: Case, base: Fields, mechanism: str, key: str, members: list[tuple[float | None, Variant]]
) -> Iterable[Path]:
    origin = _base_position(case, key)
    ratios = [(value, *_ratio(case, base, variant)) for value, variant in members]
    one = np.ones_like(base.sun)
    numbered = [(v, sun, sky) for v, sun, sky in ratios if v is not None and origin is not None and v != origin]
    if numbered and key == "rotation_deg":
        yield from _turns(key, one, numbered)
        return
    if numbered and mechanism not in {"near-field", "bounce-truncation", "lens-anisotropy"}:
        assert origin is not None
        rows = sorted([(origin, one, one), *numbered], key=lambda row: row[0])
        at = np.array([row[0] for row in rows])
        parameter = _parameter(key, at, origin)
        label, geometric = f"case's variants of {key}", key == "wall_reflectance"
        yield Path(label, parameter, at, _stack(rows, 1), _stack(rows, 2), geometric, of_case=True)
        return
    for (value, sun, sky), (_, variant) in zip(ratios, members, strict=True):
        label = key if value is None else f"{key} = {value:g}"
        weight = Parameter(
            "weight", "1", f"share of the change to {label} that is seen", 0.0, 1.5, 0.2, (1.0,), centre=1.0
        )
        parts = np.stack([one, sun]), np.stack([one, sky])
        yield Path(f"case's variant {label}", weight, np.array([0.0, 1.0]), *parts, of_case=True)
        del variant


def _turns(key: str, one: Floats, numbered: list[tuple[float, Floats, Floats]]) -> Iterable[Path]:
    """A turned pattern is no mixture with the one that is not turned: only turns near the simulated ones, by side."""
    for side in (1.0, -1.0):
        rows = sorted([(0.0, one, one), *(row for row in numbered if side * row[0] > 0.0)], key=lambda row: row[0])
        if len(rows) < 2:
            continue
        at = np.array([row[0] for row in rows])
        turns = at[at != 0.0]
        near, far = float(np.abs(turns).min()), float(np.abs(turns).max())
        low, high = sorted((side * 0.7 * near, side * 1.3 * far))
        what = "turn of the pattern, counter-clockwise from above"
        width = max(0.15 * far, far - near)
        turn = Parameter(key, "deg", what, low, high, width, tuple(turns.tolist()), centre=float(turns.mean()))
        label = f"case's variants of {key}, {'counter-' if side > 0 else ''}clockwise"
        yield Path(label, turn, at, _stack(rows, 1), _stack(rows, 2), of_case=True)


def _stack(rows: list[tuple[float, Floats, Floats]], which: int) -> Floats:
    return np.stack([np.asarray(row[which]) for row in rows])


def _parameter(key: str, at: Floats, origin: float) -> Parameter:
    """A parameter that runs along the variants and as far again beyond, with a prior as wide as they reach."""
    reach = float(np.max(np.abs(at - origin)))
    low = origin - _BEYOND * float(origin - at[0]) if at[0] < origin else origin
    high = origin + _BEYOND * float(at[-1] - origin) if at[-1] > origin else origin
    if key == "wall_reflectance":
        low, high = max(low - reach, 0.05), min(high + reach, 0.999)
    unit = "deg" if key.endswith("_deg") else "min" if key.endswith("_min") else "1"
    starts = tuple(float(a) for a in at if a != origin) + tuple(
        origin + 0.4 * float(a - origin) for a in at if a != origin
    )
    return Parameter(key, unit, f"{key.replace('_', ' ')} of the real thing", low, high, reach, starts, centre=origin)


def _ratio(case: Case, base: Fields, variant: Variant) -> tuple[Floats, Floats]:
    """Variant over baseline for both parts (T, P, G); 1 in tests the variant does not cover."""
    sun, sky = np.ones_like(base.sun), np.ones_like(base.sky)
    for k, test in enumerate(case.tests):
        if parts := variant.simulated.get(test.id):
            new_sun, new_sky = from_files(case, parts)
            if parts.total and not parts.sun:
                whole = divided(new_sun, base.total[k])
                sun[k], sky[k] = whole, whole
            else:
                sun[k], sky[k] = divided(new_sun, base.sun[k]), divided(new_sky, base.sky[k])
    return sun, sky


def divided(new: Floats, old: Floats) -> Floats:
    """``new / old``, 1 where there was no light, and never beyond what rays can mean."""
    ratio = np.divide(new, old, out=np.ones_like(new), where=old > 1e-6 * max(float(old.max(initial=0.0)), 1e-12))
    return np.clip(ratio, *_RATIO)
