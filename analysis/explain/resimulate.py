"""Our own re-simulations of a case's systems: what each setting would have changed, as ratios to our own baseline."""

from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from analysis.cases import Case
from analysis.cases.model import USUAL_ARM_M, Floats
from analysis.explain.fields import GAMMA_DEG, fields_of
from analysis.explain.file_parts import readings_of
from analysis.explain.found_lenses import FoundLenses
from analysis.explain.likeness import likened
from analysis.explain.look import Likened, Predicted
from analysis.explain.ratios import Field
from analysis.explain.readings import GONIOMETER
from analysis.explain.retrace import Path
from analysis.explain.settings import paths_of
from analysis.explain.trace_settings import AUREOLES_DEG
from analysis.explain.tracing import Tracing, systems_of
from analysis.simulate.system import System
from analysis.simulate.tally import Field as TallyField

FEW_RAYS = 30_000
"""Rays for each sun and sky where only the sky's smooth part is asked for."""


def simulator_of(
    case: Case, only: Collection[str] | None = None, lenses: FoundLenses | None = None
) -> "OwnSimulation | None":
    """A simulator for the case, of all mechanisms or of some ``only``; ``None`` where no system or no sun is known.

    With ``lenses`` that another case's predictions were found to have; those of other systems are found here.
    """
    systems = systems_of(case)
    usable = [k for k, t in enumerate(case.tests) if t.system in systems and t.sun_altitude_deg is not None]
    on_an_arm = any(channel.kind == GONIOMETER for channel in case.setup.channel)
    return OwnSimulation(case, systems, only, lenses) if usable and on_an_arm else None


@dataclass(frozen=True)
class Retracings:
    """What re-simulations of one case came to; the light that was traced for it is forgotten.

    Attributes
    ----------
    paths
        Mechanism to its paths of settings.
    aureoles
        Sun part (T, P, G) over that of the disc alone, for no aureole and for `AUREOLES_DEG`; none if not asked for.
    near
        Near over far field of both parts, (T, P, G) each; ``None`` if not asked for.
    sky_part
        The predicted sky part (T, P, G) [cd] as told from the sum; NaN in tests that cannot be traced.
    systems
        What was traced: the case's systems with lenses like the prediction's.
    """

    paths: dict[str, tuple[Path, ...]]
    aureoles: list[Floats]
    near: Field | None
    sky_part: Floats | None
    systems: Mapping[str, Likened]


class OwnSimulation:
    """Re-simulations of the tests of one case; nothing is traced before it is asked for.

    Where they are asked for some mechanisms ``only``, the others have none.
    """

    def __init__(
        self,
        case: Case,
        systems: Mapping[str, System],
        only: Collection[str] | None = None,
        lenses: FoundLenses | None = None,
    ) -> None:
        self.case = case
        self.systems = systems
        self.only = only
        self.lenses = lenses or FoundLenses()

    @cached_property
    def made(self) -> Retracings:
        """All of it, traced in one go."""
        known = self.lenses.of(self.systems)
        alike = known | _likened(self.case, {k: s for k, s in self.systems.items() if k not in known})
        systems = {name: like.system for name, like in alike.items()}
        traced = Tracing(self.case, systems, self.only, {name: like.spread_deg for name, like in alike.items()})
        readings = readings_of(self.case, measured_only=False)
        split = self.only is None or not readings.has_parts
        return Retracings(
            _paths(traced, self.only, any(like.alike for like in alike.values())),
            traced.aureoles() if self._wants("circumsolar-aureole") else [],
            traced.near_over_far() if self._wants("near-field") else None,
            traced.sky_part(fields_of(readings).total) if split else None,
            alike,
        )

    def _wants(self, mechanism: str) -> bool:
        return self.only is None or mechanism in self.only

    def paths(self, mechanism: str) -> tuple[Path, ...]:
        """See `analysis.explain.retrace.Simulator.paths`."""
        return self.made.paths.get(mechanism, ())

    def aureole(self, width_deg: float) -> Floats | None:
        """See `analysis.explain.retrace.Simulator.aureole`; linear in the width between the traced ones."""
        at, rows = np.array([0.0, *AUREOLES_DEG]), self.made.aureoles
        if not rows:
            return None
        k = int(np.clip(np.searchsorted(at, width_deg, side="right") - 1, 0, len(at) - 2))
        x = (width_deg - at[k]) / (at[k + 1] - at[k])
        return np.asarray(np.maximum((1 - x) * rows[k] + x * rows[k + 1], 0.0))

    def near_field(self) -> Field | None:
        """See `analysis.explain.retrace.Simulator.near_field`."""
        return self.made.near

    def sky_part(self) -> Floats | None:
        """See `analysis.explain.retrace.Simulator.sky_part`."""
        return self.made.sky_part

    def traced_systems(self) -> Mapping[str, Likened]:
        """See `analysis.explain.retrace.Simulator.traced_systems`."""
        return self.made.systems


def _paths(traced: Tracing, only: Collection[str] | None, alike: bool) -> dict[str, tuple[Path, ...]]:
    made = paths_of(traced, only)
    return {key: tuple(replace(path, alike=alike) for path in paths) for key, paths in made.items()}


def _likened(case: Case, systems: Mapping[str, System]) -> dict[str, Likened]:
    """The systems with lenses like the prediction's; where that gives only the sum, ours is one with our sky's part."""
    if not systems:
        return {}
    readings = readings_of(case, measured_only=False)
    given, tracing = fields_of(readings), Tracing(case, systems)
    sky = np.zeros_like(given.sky) if readings.has_parts else np.nan_to_num(tracing.sky_part(given.total, FEW_RAYS))
    seen = given.sun if readings.has_parts else given.total
    field: TallyField = "near" if case.setup.simulation.field == "near" else "far"
    distance_m = case.setup.distance_m or USUAL_ARM_M
    whole = all(t.simulated is not None for t in case.tests)
    to_deg = 90.0 if whole else float(np.nanmax(readings.gamma_deg)) + GAMMA_DEG[1]
    predicted = {}
    for name, tests in tracing.days.items():
        rows, days = [k for k, _ in tests], [day for _, day in tests]
        predicted[name] = Predicted(days, seen[rows], sky[rows], distance_m, field, to_deg)
    return likened(systems, predicted)
