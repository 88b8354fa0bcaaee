"""Tracing a case's systems again, all settings of a system in one go with the same rays.

The engine that made the prediction is somebody else's; only ratios of our simulation to itself are used, so that what
the two engines disagree about drops out.
"""

from collections.abc import Collection, Mapping
from dataclasses import replace
from functools import cached_property
from typing import Final

import numpy as np

from analysis.cases import Case
from analysis.cases.model import USUAL_ARM_M, Floats
from analysis.explain.fields import C_DEG, GAMMA_DEG, solid_angle
from analysis.explain.geometry import blurred
from analysis.explain.ratios import Field, blurred_ratio, over
from analysis.explain.readings import sun_at
from analysis.explain.trace_settings import AUREOLES_DEG, ISOTROPIC, SETTINGS_OF, Setting, on_top, settings_of
from analysis.simulate.changes import Change
from analysis.simulate.daylight import Daylight, daylight
from analysis.simulate.system import System, from_case_table
from analysis.simulate.variants import Outcome, Parts, VariantSet, variants
from labdaq.errors import LabdaqError

RAYS: Final = 100_000
MORE_RAYS: Final = 320_000
"""Rays for each sun: with the same ones for each variant, and where the difference itself must be smooth."""
MANY: Final = 4
"""With more tests than these each has the fewer rays: what counts is what they tell together, and a case's time."""
SAMPLES: Final = 4_096
"""Entries of the lens tables: half of what a prediction has, for which a core works thirteen seconds, once a lens."""
SUN_SAMPLES: Final = 8_192
"""Entries of each sun's lens tables: more of them cost more than they quieten."""
SHARP_SIDE: Final = 96
"""Direction cells along the side of the tallies (1.5°): finer ones, beside what images are blurred by, cost time."""
IMAGE_DEG: Final = 4.5
"""Images of the sun are blurred by this before they are compared with others: another lens has them elsewhere."""


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


class Tracing:
    """The light of all tests and settings of a case (of those for some mechanisms ``only``), traced when asked for."""

    def __init__(
        self,
        case: Case,
        systems: Mapping[str, System],
        only: Collection[str] | None = None,
        spread_deg: Mapping[str, float] | None = None,
    ) -> None:
        self.case = case
        self.systems = systems
        self.spread_deg = spread_deg or {}
        self._names = {s for m in (SETTINGS_OF if only is None else only) for s in SETTINGS_OF.get(m, ())}
        self._diffusing = {s.id for s in case.setup.system if s.lens == "diffusing"}
        self._blurred: dict[float, Field] = {}

    @cached_property
    def days(self) -> dict[str, list[tuple[int, Daylight]]]:
        """Each system's tests: their numbers, and their daylight."""
        days: dict[str, list[tuple[int, Daylight]]] = {name: [] for name in self.systems}
        for k, test in enumerate(self.case.tests):
            if test.system in days and test.sun_altitude_deg is not None:
                days[test.system].append((k, daylight_of(self.case, k, 0.0)))
        return {name: tests for name, tests in days.items() if tests}

    @cached_property
    def _share(self) -> float:
        """Rays for each sun, over those of a case of few tests."""
        return min(1.0, MANY / max(sum(len(days) for days in self.days.values()), 1))

    @cached_property
    def runs(self) -> dict[str, VariantSet]:
        """The systems as described, and with each setting."""
        return {name: self.trace(name, [d for _, d in days], True) for name, days in self.days.items()}

    @cached_property
    def precise(self) -> dict[str, VariantSet]:
        """The systems as they are with more rays, for what their bounces tell: there, no rays are shared."""
        return {name: self.plain(name, int(self._share * MORE_RAYS)) for name in self.days}

    def plain(self, name: str, rays: int) -> VariantSet:
        """One system as described, under all its days."""
        return self.trace(name, [day for _, day in self.days[name]], rays=rays)

    def trace(
        self, name: str, days: list[Daylight], changed: bool = False, rays: int = 0, *, sky: bool = True
    ) -> VariantSet:
        """One system under some daylights: as described, and with each of its settings if ``changed``.

        ``rays`` for each sun; 0 takes `RAYS`, or fewer where there are many tests.
        """
        system = self.systems[name]
        changes = [Change("", on_top(system, dict(s))) for s in self._settings(name)] if changed else []
        return simulated(self.case, system, days, changes, rays or int(self._share * RAYS), sky=sky)

    def _settings(self, name: str) -> list[Setting]:
        """A system's settings; a lens that is called diffusing has no pattern that a simulation could lose."""
        names = self._names - ({ISOTROPIC[0]} if name in self._diffusing else set())
        return [setting for setting in settings_of(self.systems[name]) if setting[0][0] in names]

    def as_predicted(self, outcome: Outcome) -> Parts:
        """See the function of that name."""
        return as_predicted(self.case, outcome)

    def by_bounce(self, run: VariantSet, *, boot: bool = False) -> Field:
        """Both parts of one system as predicted, by bounces on its wall (and on its boot), (bounces, tests, P, G)."""
        sun, sky = run.by_bounce("near" if self.case.setup.simulation.field == "near" else "far", boot=boot)
        return sun[..., :-1, :], sky[..., :-1, :]

    @cached_property
    def base(self) -> Field:
        """Both parts as predicted, each (T, P, G)."""
        return self.spread({name: self.as_predicted(run.baseline) for name, run in self.runs.items()})

    def spread(self, parts: Mapping[str, Parts]) -> Field:
        """Parts of each system's tests, laid into arrays of all tests (zero elsewhere)."""
        return self.laid({name: (made.sun[:, :-1], made.sky[:, :-1]) for name, made in parts.items()})

    def laid(self, parts: Mapping[str, Field]) -> Field:
        """The same of fields (tests of the system, P, G)."""
        shape = (len(self.case.tests), len(C_DEG), len(GAMMA_DEG))
        sun, sky = np.zeros(shape), np.zeros(shape)
        for name, made in parts.items():
            rows = [k for k, _ in self.days[name]]
            sun[rows], sky[rows] = made
        return sun, sky

    def lit(self, *settings: Setting) -> Field:
        """Both parts with the first of ``settings`` that a system has; as they are for systems that have none."""
        made = {}
        for name, run in self.runs.items():
            mine = dict(zip(self._settings(name), (outcome for _, outcome in run.variants), strict=True))
            known = (mine[one] for one in settings if one in mine)
            made[name] = self.as_predicted(next(known, run.baseline))
        return self.spread(made)

    def over_base(self, lit: Field, width_deg: float, base: Field | None = None) -> Field:
        """Ratio of both parts to those of the systems as described (or to ``base``), both blurred as by `wide`."""
        if base is not None:
            return over(self.wide(lit, width_deg), self.wide(base, width_deg))
        if width_deg not in self._blurred:
            self._blurred[width_deg] = self.wide(self.base, width_deg)
        return over(self.wide(lit, width_deg), self._blurred[width_deg])

    def wide(self, parts: Field, width_deg: float) -> Field:
        """Both parts (T, P, G) blurred by a Gaussian of ``width_deg``, beside what each system's lens spreads."""
        sun, sky = np.zeros_like(parts[0]), np.zeros_like(parts[1])
        for name, days in self.days.items():
            rows, width = [k for k, _ in days], float(np.hypot(width_deg, self.spread_deg.get(name, 0.0)))
            sun[rows], sky[rows] = (blurred(part[rows], width) if width else part[rows] for part in parts)
        return sun, sky

    # what is made of it

    def aureoles(self) -> list[Floats]:
        """See `Retracings`."""
        made = (self.over_base(self.lit((("aureole_deg", w),)), IMAGE_DEG)[0] for w in AUREOLES_DEG)
        return [np.ones_like(self.base[0]), *made]

    def near_over_far(self) -> Field:
        """See `Retracings`."""
        far = self.wide(self.spread({name: run.baseline.far for name, run in self.precise.items()}), 0.0)
        near = self.wide(self.spread({name: run.baseline.near for name, run in self.precise.items()}), 0.0)
        return blurred_ratio(near[0], far[0]), blurred_ratio(near[1], far[1])

    def sky_part(self, total: Floats, rays: int | None = None) -> Floats:
        """The sky's part of a prediction (T, P, G) [cd] that gives only the sum; NaN in tests that are not traced.

        What our lens makes of the sky is smooth, and so nearly what another lens makes of it: it is taken with each
        system's ratio of fluxes, and the sun's part is the rest. The sun's images lie where the prediction has them.
        Traced with so many rays for each sun, if told; else with those that `precise` has.
        """
        runs = self.precise if rays is None else {n: self.plain(n, rays) for n in self.days}
        sun, sky = self.wide(self.spread({n: self.as_predicted(run.baseline) for n, run in runs.items()}), 0.0)
        made = np.full_like(sky, np.nan)
        for days in self.days.values():
            rows = [k for k, _ in days]
            flux = [np.sum(field[rows] * solid_angle(), axis=(1, 2)) for field in (total, sun + sky)]
            made[rows] = sky[rows] * np.median(flux[0] / np.maximum(flux[1], 1e-12))
        return made


def simulated(
    case: Case, system: System, days: list[Daylight], changes: list[Change], rays: int, *, sky: bool = True
) -> VariantSet:
    """A system under some daylights, as it is and with each change, on the grid of `analysis.explain.fields`.

    ``rays`` for each sun.
    """
    return variants(
        system,
        days,
        changes,
        distance_m=case.setup.distance_m or USUAL_ARM_M,
        rays=rays,
        sun_samples=SUN_SAMPLES,
        samples=SAMPLES,
        sharp_side=SHARP_SIDE,
        sky=sky,
        gamma_deg=GAMMA_DEG,
        c_deg=np.append(C_DEG, 360.0),
    )


def as_predicted(case: Case, outcome: Outcome) -> Parts:
    """In the far field, or at the sensors, as the case's prediction is."""
    return outcome.near if case.setup.simulation.field == "near" else outcome.far


def daylight_of(case: Case, k: int, minutes: float) -> Daylight:
    """Daylight of test ``k``, with the sun ``minutes`` later; typical illuminances where none were measured."""
    test = case.tests[k]
    diffuse = test.diffuse_illuminance_lx or 15_000.0
    beam = max((test.global_illuminance_lx or 0.0) - diffuse, 0.02 * diffuse)  # a hidden sun has a ratio, too
    return daylight(*_sun(case, k, minutes), diffuse + beam, diffuse, "perez", test.id)


def later(case: Case, k: int, day: Daylight, minutes: float) -> Daylight:
    """The same daylight of test ``k`` with the sun where it is ``minutes`` later, and the sky as it was."""
    altitude, azimuth = _sun(case, k, minutes)
    return replace(day, sun_altitude_deg=altitude, sun_azimuth_deg=azimuth)


def _sun(case: Case, k: int, minutes: float) -> tuple[float, float]:
    """Altitude and azimuth [deg] of the sun ``minutes`` after test ``k``; never quite down."""
    test = case.tests[k]
    altitude, azimuth = float(test.sun_altitude_deg or 0.0), float(test.sun_azimuth_deg or 0.0)
    if minutes and test.start is not None:
        start_ns = int(test.start.timestamp()) * 1_000_000_000
        (h0, h1), (a0, a1) = sun_at(case, np.array([start_ns, start_ns + int(minutes * 60e9)]))
        altitude, azimuth = altitude + h1 - h0, azimuth + a1 - a0
    return min(max(altitude, 2.0), 90.0), azimuth % 360.0
