"""Our own re-simulations of a case's systems: what each setting would have changed, as ratios to our own baseline.

The engine that made the prediction is somebody else's; only ratios of our simulation to itself are used, so that what
the two engines disagree about drops out. All settings of a system are traced in one go with the same rays.
"""

import dataclasses
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Final

import numpy as np

from analysis.cases import Case
from analysis.cases.model import Floats
from analysis.explain.fields import C_DEG, GAMMA_DEG
from analysis.explain.parameter import Parameter
from analysis.explain.readings import sun_at
from analysis.explain.retrace import Path
from analysis.simulate.daylight import Daylight, daylight
from analysis.simulate.system import System, from_case_table
from analysis.simulate.variants import Change, Outcome, Parts, VariantSet, variants
from labdaq.errors import LabdaqError

Setting = tuple[tuple[str, float], ...]
Field = tuple[Floats, Floats]

TURNS_DEG: Final = (12.0, 34.0, 56.0, 78.0)
DIFFUSE_SHARES: Final = (0.15,)
SCATTERS_DEG: Final = (5.0,)
AUREOLES_DEG: Final = (3.0, 8.0)
LIMITS: Final = (1, 2, 3, 4, 5, 6, 8, 10, 12, 16, 20, 26)
UNLIMITED: Final = 40.0
"""Where "no limit" stands on the scale of bounce limits; beyond it hardly any light is left."""
REFLECTANCES: Final = (-0.3, -0.15, -0.08, -0.04, -0.015, 0.015, 0.03, 0.05, 0.1)
MINUTES: Final = (-15.0, -5.0, 5.0, 15.0)

RAYS: Final = 45_000
MORE_RAYS: Final = 160_000
"""Rays for each sun: with the same ones for each variant, and where the difference itself must be smooth."""
_DARK: Final = 0.01
"""Share of a part's brightest direction below which a ratio is drawn towards 1: the rays there are few."""


def systems_of(case: Case) -> dict[str, System]:
    """The case's systems that our engine can trace, by id."""
    systems: dict[str, System] = {}
    for described in case.setup.system:
        if described.kind is None:
            continue
        table = described.model_dump(exclude_none=True)
        if "aperture" in table:
            table["aperture"] = dict(table["aperture"])
        try:
            systems[described.id] = from_case_table(table)
        except LabdaqError:
            continue  # a system that our engine cannot imagine: the case's own variants have to do
    return systems


def simulator_of(case: Case) -> "OwnSimulation | None":
    """A simulator for the case; ``None`` where no system is described, or no sun is known."""
    systems = systems_of(case)
    usable = [k for k, t in enumerate(case.tests) if t.system in systems and t.sun_altitude_deg is not None]
    return OwnSimulation(case, systems) if usable and case.setup.goniometer else None


@dataclass(frozen=True)
class Retracings:
    """What re-simulations of one case came to; the light that was traced for it is forgotten.

    Attributes
    ----------
    paths
        Mechanism to its paths of settings.
    aureoles
        Sun part (T, P, G) over that of the disc alone, for no aureole and for `AUREOLES_DEG`.
    near
        Near over far field of both parts, (T, P, G) each.
    sun_share
        Sun part over both, as predicted, (T, P, G); NaN in tests that cannot be traced.
    """

    paths: dict[str, tuple[Path, ...]]
    aureoles: list[Floats]
    near: Field
    sun_share: Floats


class OwnSimulation:
    """Re-simulations of the tests of one case; nothing is traced before it is asked for."""

    def __init__(self, case: Case, systems: Mapping[str, System]) -> None:
        self.case = case
        self.systems = systems

    @cached_property
    def made(self) -> Retracings:
        """All of it, traced in one go."""
        tracing = _Tracing(self.case, self.systems)
        return Retracings(tracing.paths(), tracing.aureoles(), tracing.near_over_far(), tracing.sun_share())

    def paths(self, mechanism: str) -> tuple[Path, ...]:
        """See `analysis.explain.retrace.Simulator.paths`."""
        return self.made.paths.get(mechanism, ())

    def aureole(self, width_deg: float) -> Floats | None:
        """See `analysis.explain.retrace.Simulator.aureole`; linear in the width between the traced ones."""
        at, rows = np.array([0.0, *AUREOLES_DEG]), self.made.aureoles
        k = int(np.clip(np.searchsorted(at, width_deg, side="right") - 1, 0, len(at) - 2))
        x = (width_deg - at[k]) / (at[k + 1] - at[k])
        return np.asarray(np.maximum((1 - x) * rows[k] + x * rows[k + 1], 0.0))

    def near_field(self) -> Field | None:
        """See `analysis.explain.retrace.Simulator.near_field`."""
        return self.made.near

    def sun_share(self) -> Floats | None:
        """See `analysis.explain.retrace.Simulator.sun_share`."""
        return self.made.sun_share


class _Tracing:
    """The tracing itself, of all tests and settings, and what is made of it."""

    def __init__(self, case: Case, systems: Mapping[str, System]) -> None:
        self.case = case
        self.systems = systems

    def aureoles(self) -> list[Floats]:
        """See `Retracings`."""
        return [np.ones_like(self._base[0]), *(self._ratio((("aureole_deg", w),))[0] for w in AUREOLES_DEG)]

    def near_over_far(self) -> Field:
        """See `Retracings`."""
        far = self._spread({name: run.baseline.far for name, run in self._precise.items()})
        near = self._spread({name: run.baseline.near for name, run in self._precise.items()})
        return ratio(near[0], far[0]), ratio(near[1], far[1])

    def sun_share(self) -> Floats:
        """See `Retracings`; in the dark the share of the whole flux."""
        sun, sky = self._spread({n: self._as_predicted(run.baseline) for n, run in self._precise.items()})
        whole = sun + sky
        floor = _DARK * whole.max(axis=(1, 2), keepdims=True)
        mean = np.sum(sun, axis=(1, 2), keepdims=True) / np.sum(whole, axis=(1, 2), keepdims=True)
        return np.asarray((sun + floor * mean) / (whole + floor))

    # what is traced

    @cached_property
    def _days(self) -> dict[str, list[tuple[int, Daylight]]]:
        days: dict[str, list[tuple[int, Daylight]]] = {name: [] for name in self.systems}
        for k, test in enumerate(self.case.tests):
            if test.system in days and test.sun_altitude_deg is not None:
                days[test.system].append((k, daylight_of(self.case, k, 0.0)))
        return {name: tests for name, tests in days.items() if tests}

    @cached_property
    def _runs(self) -> dict[str, VariantSet]:
        return {name: self._trace(name, [d for _, d in days], True) for name, days in self._days.items()}

    @cached_property
    def _precise(self) -> dict[str, VariantSet]:
        """The systems as they are with more rays, for what their bounces tell: there, no rays are shared."""
        return {name: self._trace(name, [d for _, d in days], False, MORE_RAYS) for name, days in self._days.items()}

    def _trace(self, name: str, days: list[Daylight], changed: bool, rays: int = RAYS) -> VariantSet:
        changes = [Change("", dict(s)) for s in _settings(self.systems[name])] if changed else []
        assert self.case.setup.goniometer is not None
        return variants(
            self.systems[name],
            days,
            changes,
            distance_m=self.case.setup.goniometer.distance_m,
            rays=rays,
            gamma_deg=GAMMA_DEG,
            c_deg=np.append(C_DEG, 360.0),
        )

    def _as_predicted(self, outcome: Outcome) -> Parts:
        """In the far field, or at the sensors, as the case's prediction is."""
        return outcome.near if self.case.setup.simulation.field == "near" else outcome.far

    @cached_property
    def _base(self) -> Field:
        """Both parts as predicted, each (T, P, G)."""
        return self._spread({name: self._as_predicted(run.baseline) for name, run in self._runs.items()})

    def _spread(self, parts: Mapping[str, Parts]) -> Field:
        """Parts of each system's tests, laid into arrays of all tests (zero elsewhere)."""
        shape = (len(self.case.tests), len(C_DEG), len(GAMMA_DEG))
        sun, sky = np.zeros(shape), np.zeros(shape)
        for name, made in parts.items():
            rows = [k for k, _ in self._days[name]]
            sun[rows], sky[rows] = made.sun[:, :-1], made.sky[:, :-1]
        return sun, sky

    def _ratio(self, settings: Setting) -> Field:
        """Ratio of both parts with ``settings`` to the baseline; 1 for systems that do not have such a setting."""
        made = {}
        for name, run in self._runs.items():
            found = [outcome for change, outcome in run.variants if tuple(change.setting.items()) == settings]
            made[name] = self._as_predicted(found[0] if found else run.baseline)
        return self._over_base(made)

    def _over_base(self, made: Mapping[str, Parts]) -> Field:
        sun, sky = self._spread(made)
        return ratio(sun, self._base[0]), ratio(sky, self._base[1])

    # what is made of it

    def paths(self) -> dict[str, tuple[Path, ...]]:
        """See `Retracings`."""
        made: dict[str, tuple[Path, ...]] = {
            "lens-orientation": tuple(self._every(self._turns())),
            "lens-anisotropy": tuple(self._every(self._isotropy())),
            "wall-scatter": tuple(self._every(self._scatter())),
            "wall-reflectance": tuple(self._reflectances()),
            "bounce-truncation": tuple(self._every(self._limits())),
            "clock-offset": tuple(self._clock()),
        }
        return {key: paths for key, paths in made.items() if paths}

    def _every(self, paths: Iterator[Path]) -> Iterator[Path]:
        """Each path for all systems together, and for each system that it changes alone."""
        for path in paths:
            touched = [n for n in self._days if self._changes(path, n)]
            if touched:
                yield path
            if len(touched) > 1:
                yield from (self._alone(path, name) for name in touched)

    def _changes(self, path: Path, name: str) -> bool:
        rows, same = [k for k, _ in self._days[name]], 0.0 if path.added else 1.0
        return any(bool(np.any(np.abs(part[:, rows] - same) > 1e-3)) for part in (path.sun, path.sky))

    def _alone(self, path: Path, name: str) -> Path:
        mine = np.zeros(len(self.case.tests), dtype=bool)
        mine[[k for k, _ in self._days[name]]] = True
        keep, same = mine[None, :, None, None], 0.0 if path.added else 1.0
        return dataclasses.replace(
            path,
            label=f"{path.label}, {name} only",
            sun=np.where(keep, path.sun, same),
            sky=np.where(keep, path.sky, same),
        )

    def _along(self, label: str, parameter: Parameter, rows: dict[float, Setting], origin: float) -> Path:
        one = np.ones_like(self._base[0])
        fields = {at: self._ratio(settings) for at, settings in rows.items()} | {origin: (one, one)}
        at = np.array(sorted(fields))
        return Path(label, parameter, at, np.stack([fields[a][0] for a in at]), np.stack([fields[a][1] for a in at]))

    def _turns(self) -> Iterator[Path]:
        what = "turn of the lens patterns, counter-clockwise from above"
        turn = Parameter("rotation_deg", "deg", what, 6.0, 84.0, 30.0, (8.0, 25.0, 45.0, 65.0, 82.0), centre=45.0)
        path = self._along("own re-simulation", turn, {t: (("rotation_deg", t),) for t in TURNS_DEG}, 0.0)
        one = np.ones_like(path.sun[:1])
        yield dataclasses.replace(
            path,
            positions=np.append(path.positions, 90.0),
            sun=np.concatenate([path.sun, one]),
            sky=np.concatenate([path.sky, one]),
        )

    def _isotropy(self) -> Iterator[Path]:
        blurred = self._ratio((("isotropic", True),))
        one = np.ones_like(blurred[0])
        weight = Parameter(
            "weight",
            "1",
            "how much of the pattern the simulation had lost (1 = all)",
            0.0,
            1.5,
            0.3,
            (1.0,),
            centre=1.0,
        )
        sun, sky = (ratio(one, r) for r in blurred)
        yield Path("a pattern, not its mean", weight, np.array([0.0, 1.0]), np.stack([one, sun]), np.stack([one, sky]))

    def _scatter(self) -> Iterator[Path]:
        share = Parameter("scatter", "1", "share of each reflection that is diffuse", 0.0, 1.0, 0.15, (0.05, 0.2))
        yield self._along("diffuse share", share, {s: (("diffuse_fraction", s),) for s in DIFFUSE_SHARES}, 0.0)
        width = Parameter("scatter_deg", "deg", "rms width of each reflection's lobe", 1.0, 20.0, 4.0, (3.0, 8.0))
        yield self._along("wide reflections", width, {s: (("scatter_deg", s),) for s in SCATTERS_DEG}, 0.0)

    def _limits(self) -> Iterator[Path]:
        """Light that bounces more than N times: what the prediction lacks if it was cut there.

        It is added, not multiplied: below a deep well with the sun low, nothing may have been left to multiply.
        """
        rows = {}
        whole = self._spread({n: self._as_predicted(run.baseline) for n, run in self._precise.items()})
        for limit in LIMITS:
            cut = self._spread(
                {n: self._as_predicted(run.again(max_bounces=limit)) for n, run in self._precise.items()}
            )
            rows[float(limit)] = whole[0] - cut[0], whole[1] - cut[1]
        rows[UNLIMITED] = np.zeros_like(whole[0]), np.zeros_like(whole[1])
        at = np.array(sorted(rows))
        what = "reflections on the wall after which the simulation stopped"
        limit_of = Parameter("max_bounces", "1", what, 1.0, UNLIMITED, 12.0, (2.0, 4.0, 7.0, 14.0), centre=UNLIMITED)
        stated = self.case.setup.simulation.max_bounces
        if stated:
            limit_of = dataclasses.replace(limit_of, sigma=1.0, centre=float(min(stated, UNLIMITED)))
        sun, sky = np.stack([rows[a][0] for a in at]), np.stack([rows[a][1] for a in at])
        yield Path("own re-simulation", limit_of, at, sun, sky, added=True)

    def _reflectances(self) -> Iterator[Path]:
        """One path for each system: its wall reflects more or less than described; and one for all alike."""
        for name, run in self._runs.items():
            assumed = run.system.wall.reflectance
            tried = sorted({min(max(assumed + d, 0.05), 0.998) for d in REFLECTANCES} | {assumed})
            fields = [
                self._over_base(self._with(name, self._as_predicted(run.again(wall_reflectance=r)))) for r in tried
            ]
            what = f"reflectance of the well of {name}"
            starts = tuple(r for r in (assumed - 0.1, assumed - 0.03, assumed + 0.02) if tried[0] < r < tried[-1])
            parameter = Parameter("wall_reflectance", "1", what, tried[0], tried[-1], 0.05, starts, centre=assumed)
            sun, sky = np.stack([f[0] for f in fields]), np.stack([f[1] for f in fields])
            yield Path(name, parameter, np.array(tried), sun, sky, geometric=True)

        if len(self._runs) > 1:
            yield self._all_walls()

    def _all_walls(self) -> Path:
        """The walls of all systems reflect more or less by the same amount."""
        tried = sorted({*REFLECTANCES, 0.0})
        fields = []
        for d in tried:
            runs = self._runs.items()
            bounded = {n: min(max(run.system.wall.reflectance + d, 0.05), 0.998) for n, run in runs}
            fields.append(
                self._over_base({n: self._as_predicted(run.again(wall_reflectance=bounded[n])) for n, run in runs})
            )
        what = "change of the reflectance of all wells"
        change = Parameter("change", "1", what, tried[0], tried[-1], 0.05, (-0.1, -0.03, 0.02))
        sun, sky = np.stack([f[0] for f in fields]), np.stack([f[1] for f in fields])
        return Path("all systems alike", change, np.array(tried), sun, sky, geometric=True)

    def _with(self, name: str, parts: Parts) -> dict[str, Parts]:
        return {n: self._as_predicted(run.baseline) for n, run in self._runs.items()} | {name: parts}

    def _clock(self) -> Iterator[Path]:
        """The sun earlier or later than the recorded times say, the illuminances as measured."""
        if self.case.setup.site is None or any(t.start is None for t in self.case.tests):
            return
        rows: dict[float, Field] = {}
        for minutes in MINUTES:
            moved = {}
            for name, days in self._days.items():
                shifted = [daylight_of(self.case, k, minutes) for k, _ in days]
                moved[name] = self._as_predicted(self._trace(name, shifted, False).baseline)
            rows[minutes] = self._over_base(moved)
        one = np.ones_like(self._base[0])
        rows[0.0] = one, one
        at = np.array(sorted(rows))
        late = Parameter("offset_min", "min", "true time minus recorded time", -60.0, 60.0, 15.0, (-10.0, 10.0))
        sun, sky = np.stack([rows[a][0] for a in at]), np.stack([rows[a][1] for a in at])
        yield Path("own re-simulation", late, at, sun, sky)


def _settings(system: System) -> list[Setting]:
    """What is traced for a system: only settings that change it."""
    made: list[Setting] = [(("aureole_deg", w),) for w in AUREOLES_DEG]
    if "prismatic" in (system.entry.kind, system.exit.kind):
        made += [(("rotation_deg", t),) for t in TURNS_DEG]
        made += [(("isotropic", True),)]
    if system.wall.finish == "specular":
        made += [(("diffuse_fraction", s),) for s in DIFFUSE_SHARES]
        made += [(("scatter_deg", s),) for s in SCATTERS_DEG]
    return made


def daylight_of(case: Case, k: int, minutes: float) -> Daylight:
    """Daylight of test ``k``, with the sun ``minutes`` later; typical illuminances where none were measured."""
    test = case.tests[k]
    altitude, azimuth = float(test.sun_altitude_deg or 0.0), float(test.sun_azimuth_deg or 0.0)
    if minutes and test.start is not None:
        start_ns = int(test.start.timestamp()) * 1_000_000_000
        (h0, h1), (a0, a1) = sun_at(case, np.array([start_ns, start_ns + int(minutes * 60e9)]))
        altitude, azimuth = altitude + h1 - h0, azimuth + a1 - a0
    altitude = min(max(altitude, 2.0), 90.0)
    diffuse = test.diffuse_illuminance_lx or 15_000.0
    beam = max((test.global_illuminance_lx or 0.0) - diffuse, 0.02 * diffuse)  # a hidden sun has a ratio, too
    return daylight(altitude, azimuth % 360.0, diffuse + beam, diffuse, "perez", test.id)


def ratio(new: Floats, old: Floats) -> Floats:
    """Ratio of fields (T, P, G), drawn towards 1 where a test's part is dark."""
    floor = _DARK * np.maximum(old.max(axis=(-2, -1), keepdims=True), 1e-12)
    return np.asarray(np.clip((new + floor) / (old + floor), 0.02, 50.0))
