"""The case's own variants, as paths of settings: the same simulation run again with one thing changed."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from analysis.cases import Case
from analysis.cases.model import Floats, Variant
from analysis.explain.fields import Fields, fields_of, from_files, steps_of_file
from analysis.explain.idle import Tells, is_idle, what_it_tells
from analysis.explain.parameter import Parameter
from analysis.explain.ratios import plain_ratio
from analysis.explain.readings import Readings
from analysis.explain.retrace import Path, Retraced, Simulator, by_system
from analysis.explain.small_turns import SMALL_TURN_DEG
from analysis.explain.variant_gaps import without_gaps
from analysis.explain.variant_rays import without_rays

_BEYOND = 2.2  # as far as a setting may lie beyond a case's variants, in the steps from the baseline to them
_NEARER = (0.4, 0.2)  # ways are chosen by how they do at their starts, and most settings are off by less than variants
_LEAST_TURN = 0.2  # of the least that was simulated, where that is small; else
_NEAR_TURN, _FAR_TURN = 0.7, 1.3  # of the least and the largest
_AMOUNT = "fraction"  # of settings that are changed together, the one that says how much of all that is seen
_WALLS = "wall-reflectance"
OF_CASE: Final = "case's variant"
"""How labels of paths begin that the case itself brings."""
_ALL_OR_NOTHING: Final = frozenset({"near-field", "bounce-truncation", "lens-anisotropy"})
_OF_A_SYSTEM: Final = frozenset(
    {"lens-haze", "soiling", "lens-orientation", "lens-anisotropy", "wall-scatter", _WALLS, "bounce-truncation"}
)


@dataclass(frozen=True)
class _Run:
    """One variant as what it changes: its setting's place if that is one number, and both parts over the baseline's."""

    value: float | None
    sun: Floats
    sky: Floats


@dataclass(frozen=True)
class _Kind:
    """What variants must have in common to lie on one path; ``merged`` are those run for each system apart."""

    mechanism: str
    key: str
    held: tuple[tuple[str, float], ...]
    systems: frozenset[str]
    merged: bool = False

    @property
    def label(self) -> str:
        held = "".join(f", {key} = {value:g}" for key, value in self.held)
        return self.key + held


def retraced_of(case: Case, simulator: Simulator | None = None) -> Retraced:
    """Read the case's variants; ``simulator`` supplies what they do not."""
    if not case.setup.variant:
        return Retraced({}, simulator)
    readings = Readings.of(case, measured_only=False)
    base = fields_of(readings)
    paths: dict[str, tuple[Path, ...]] = {}
    walls: dict[str, Path] = {}
    idle: list[Path] = []
    told: list[tuple[str, Tells]] = []
    systems, step = _tests_of_systems(case), _gamma_step(case)
    for kind, alone, path in _named(case, _kinds(case, base), systems):
        tells = what_it_tells(readings, base, kind.mechanism, path)
        told.append((kind.mechanism, tells))
        apart = kind.mechanism in _OF_A_SYSTEM and not kind.merged
        for way in by_system(path, systems) if apart else (path,):
            if tells in (Tells.HAS, Tells.LESS) or is_idle(readings, base, way):
                idle.append(way)
                continue
            quiet = without_gaps(without_rays(way, base, step), kind.mechanism, simulator, base, systems)
            paths[kind.mechanism] = (*paths.get(kind.mechanism, ()), quiet)
            if alone and kind.mechanism == _WALLS and kind.key == "wall_reflectance":
                walls[alone] = quiet
    if len(walls) == len(systems) > 1:
        paths[_WALLS] = (*paths[_WALLS], _alike(tuple(walls.values())))
    lacks = frozenset(m for m, tells in told if tells is Tells.LACKS)
    has = frozenset(m for m, tells in told if tells is Tells.HAS) - lacks
    return Retraced(paths, simulator, tuple(idle), has, lacks)


def _tests_of_systems(case: Case) -> dict[str, list[int]]:
    tests: dict[str, list[int]] = {}
    for k, test in enumerate(case.tests):
        tests.setdefault(test.system or "", []).append(k)
    return tests


def _gamma_step(case: Case) -> float:
    """How far apart the gammas of the variants' files are [deg]."""
    files = [parts for variant in case.setup.variant for parts in variant.simulated.values()]
    return steps_of_file(case, files[0])[0] if files else 0.0


def _kinds(case: Case, base: Fields) -> dict[_Kind, list[_Run]]:
    """The variants' runs, those together that may lie on one path."""
    kinds: dict[_Kind, list[_Run]] = {}
    for variant in case.setup.variant:
        kind, value = _setting(case, variant)
        kinds.setdefault(kind, []).append(_Run(value, *_ratio(case, base, variant)))
    return kinds


def _named(
    case: Case, kinds: Mapping[_Kind, list[_Run]], systems: Mapping[str, list[int]]
) -> Iterable[tuple[_Kind, str, Path]]:
    """All paths, with the one system that they were run for, if it is not the only one."""
    for kind, runs in (*kinds.items(), *_together(kinds)):
        alone = next(iter(kind.systems)) if len(kind.systems) == 1 < len(systems) else ""
        for path in _paths(case, kind, runs):
            yield kind, alone, replace(path, label=f"{path.label}, {alone} only") if alone else path


def _together(kinds: Mapping[_Kind, list[_Run]]) -> Iterable[tuple[_Kind, list[_Run]]]:
    """What was run for each system apart with the same settings, as one run of all (walls start from their own)."""
    alike: dict[_Kind, list[_Kind]] = {}
    for kind in kinds:
        if kind.mechanism != _WALLS:
            alike.setdefault(replace(kind, systems=frozenset()), []).append(kind)
    for kind, apart in alike.items():
        systems = frozenset[str]().union(*(k.systems for k in apart))
        settings = [{run.value for run in kinds[k]} for k in apart]
        if (
            len(apart) > 1
            and len(systems) == sum(len(k.systems) for k in apart)
            and all(settings[0] == s for s in settings)
        ):
            yield replace(kind, systems=systems, merged=True), _merged([run for k in apart for run in kinds[k]])


def _merged(runs: list[_Run]) -> list[_Run]:
    """Runs of some tests each, of one setting, as one."""
    made: dict[float | None, _Run] = {}
    for run in runs:
        before = made.setdefault(run.value, run)
        sun, sky = np.where(before.sun == 1.0, run.sun, before.sun), np.where(before.sky == 1.0, run.sky, before.sky)
        made[run.value] = _Run(run.value, sun, sky)
    return list(made.values())


def _setting(case: Case, variant: Variant) -> tuple[_Kind, float | None]:
    """What a variant changes and how far, if that is one number or a share beside others; else a label alone."""
    given = variant.setting
    numbers = {k: float(v) for k, v in given.items() if isinstance(v, int | float) and not isinstance(v, bool)}
    systems = frozenset(t.system or "" for t in case.tests if t.id in variant.simulated)
    key = next(iter(numbers)) if len(numbers) == 1 else _AMOUNT
    if len(numbers) < len(given) or key not in numbers:
        label = ", ".join(f"{k} = {v}" for k, v in given.items()) or "variant"
        return _Kind(variant.mechanism, label, (), systems), None
    held = tuple((k, v) for k, v in sorted(numbers.items()) if k != key)
    return _Kind(variant.mechanism, key, held, systems), numbers[key]


def _base_position(case: Case, kind: _Kind) -> float | None:
    """Where the baseline stands on the scale of a setting; ``None`` where that is not known."""
    if kind.mechanism in _ALL_OR_NOTHING:
        return None  # "more bounces" is all or nothing: the real light has no limit
    if kind.mechanism == _WALLS:
        walls = {s.wall_reflectance for s in case.setup.system if s.id in kind.systems}
        return walls.pop() if len(walls) == 1 else None
    return 0.0


def _paths(case: Case, kind: _Kind, runs: list[_Run]) -> Iterable[Path]:
    origin, one = _base_position(case, kind), np.ones_like(runs[0].sun)
    numbered = [run for run in runs if run.value is not None and origin is not None and run.value != origin]
    if numbered and kind.key == "rotation_deg":
        yield from _turns(kind.label, [_Run(0.0, one, one), *numbered])
        return
    if numbered and origin is not None:
        rows = [_Run(origin, one, one), *numbered]
        parameter = _parameter(kind, np.unique([run.value for run in rows]), origin)
        geometric = kind.mechanism == _WALLS
        path = Path(f"{OF_CASE}s of {kind.label}", parameter, *_stacked(rows), geometric, of_case=True)
        yield replace(path, held=dict(kind.held))
        return
    for run in _merged(runs):
        label = kind.label if run.value is None else f"{kind.label} = {run.value:g}"
        parts = np.stack([one, run.sun]), np.stack([one, run.sky])
        held = dict(kind.held) if run.value is None else {**dict(kind.held), kind.key: run.value}
        yield Path(f"{OF_CASE} {label}", _weight(kind, label), np.array([0.0, 1.0]), *parts, of_case=True, held=held)


def _weight(kind: _Kind, label: str) -> Parameter:
    """How much of a variant's change is seen: about all of what is there or not, any amount of what has a size."""
    what = f"share of the change to {label} that is seen"
    if kind.mechanism == "lens-anisotropy":  # a lens may have less of a pattern than the one that was simulated
        return Parameter("weight", "1", what, 0.0, 1.5, 0.5, (0.1, 0.4, 1.0))
    if kind.mechanism in {*_ALL_OR_NOTHING, "lens-orientation"}:
        return Parameter("weight", "1", what, 0.0, 1.5, 0.2, (1.0,), centre=1.0)
    return Parameter("weight", "1", what, 0.0, 4.0, 1.0, (0.3, 1.0, 2.0))


def _turns(key: str, runs: list[_Run]) -> Iterable[Path]:
    """A turned pattern is no mixture with the one that is not turned: only turns near the simulated ones, by side.

    A small turn moves images by less than they are wide, and what lies between is such a mixture: small ones are a path
    of their own.
    """
    one, *turned = runs
    for side, way in ((1.0, "counter-clockwise"), (-1.0, "clockwise")):
        mine = [(side * run.value, run) for run in turned if run.value is not None]
        small = {size for size, _ in mine if 0.0 < size <= SMALL_TURN_DEG}
        large = [run for size, run in mine if size > SMALL_TURN_DEG]
        label = f"{OF_CASE}s of {key}, {way}"
        if small:
            reach = _LEAST_TURN, min(_BEYOND, max(_FAR_TURN, SMALL_TURN_DEG / max(small)))
            runs_of_it = [one, *(run for size, run in mine if size in small)]
            starts = (side * _NEARER[0] * min(small),)
            yield _turn(f"{label}, by little" if large else label, key, runs_of_it, reach, starts)
        if large:
            yield _turn(label, key, [one, *large], (_NEAR_TURN, _FAR_TURN))


def _turn(label: str, key: str, runs: list[_Run], reach: tuple[float, float], starts: tuple[float, ...] = ()) -> Path:
    """Turns to one side, from and to shares of the least and the largest simulated; ``starts`` beside those."""
    at, sun, sky = _stacked(runs)
    turns = at[at != 0.0]
    near, far = sorted((float(turns[0]), float(turns[-1])), key=abs)
    low, high = sorted((reach[0] * near, reach[1] * far))
    width = max(0.15 * abs(far), abs(far - near), 0.5 * abs(near) if starts else 0.0)
    what = "turn of the pattern, counter-clockwise from above"
    turn = Parameter(key, "deg", what, low, high, width, (*turns.tolist(), *starts), centre=float(turns.mean()))
    return Path(label, turn, at, sun, sky, of_case=True)


def _stacked(runs: list[_Run]) -> tuple[Floats, Floats, Floats]:
    """Settings in order, and both parts at them."""
    rows = sorted(_merged(runs), key=lambda run: run.value or 0.0)
    at = np.array([run.value for run in rows], dtype=np.float64)
    return at, np.stack([run.sun for run in rows]), np.stack([run.sky for run in rows])


def _parameter(kind: _Kind, at: Floats, origin: float) -> Parameter:
    """A parameter that runs along the variants and as far again beyond, with a prior as wide as they reach."""
    reach = float(np.max(np.abs(at - origin)))
    low = origin - _BEYOND * float(origin - at[0]) if at[0] < origin else origin
    high = origin + _BEYOND * float(at[-1] - origin) if at[-1] > origin else origin
    if kind.mechanism == _WALLS:
        low, high = max(low - reach, 0.05), min(high + reach, 0.999)
    if kind.key == _AMOUNT:
        high = max(high, 1.0)
    unit = "deg" if kind.key.endswith("_deg") else "min" if kind.key.endswith("_min") else "1"
    tried = [float(a) for a in at if a != origin]
    starts = (*tried, *(origin + share * (a - origin) for share in _NEARER for a in tried))
    what = f"{kind.key.replace('_', ' ')} of the real thing"
    return Parameter(kind.key, unit, what, low, high, reach, starts, centre=origin)


def _alike(walls: tuple[Path, ...]) -> Path:
    """The walls of all systems changed alike, where each system's were simulated apart."""
    far = [float(p.positions[np.argmax(np.abs(p.positions - p.parameter.centre))] - p.parameter.centre) for p in walls]
    reach = min(far, key=abs)
    at = np.sort(reach * np.array([0.0, 0.5, 1.0]))
    one = np.ones_like(walls[0].sun[0])
    changes = [[p.change(p.parameter.centre + a, Fields(one, one)) for p in walls] for a in at]
    sun, sky = (np.stack([np.prod([c[part] for c in row], axis=0) for row in changes]) for part in (0, 1))
    low, high = sorted((_BEYOND * reach, -reach))
    what = "change of the reflectance of all wells"
    change = Parameter("change", "1", what, low, high, abs(reach), (reach, 0.4 * reach), centre=0.0)
    return Path(f"{OF_CASE}s of all walls", change, at, sun, sky, geometric=True, of_case=True)


def _ratio(case: Case, base: Fields, variant: Variant) -> tuple[Floats, Floats]:
    """Variant over baseline for both parts (T, P, G); 1 in tests that the variant does not cover."""
    sun, sky = np.ones_like(base.sun), np.ones_like(base.sky)
    for k, test in enumerate(case.tests):
        if parts := variant.simulated.get(test.id):
            new_sun, new_sky = from_files(case, parts)
            if parts.total and not parts.sun:
                whole = plain_ratio(new_sun, base.total[k])
                sun[k], sky[k] = whole, whole
            else:
                sun[k], sky[k] = plain_ratio(new_sun, base.sun[k]), plain_ratio(new_sky, base.sky[k])
    return sun, sky
