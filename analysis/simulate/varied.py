"""A prediction and, beside it, what it would have been with one thing set otherwise: same rays, same random numbers.

What the tallies of the baseline know (wall reflectance, bounce limit) costs no rays; the rest is traced again, with as
many rays as the baseline took. Several tests at once: `analysis.simulate.variants`.
"""

import dataclasses
from collections.abc import Mapping, Sequence
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from analysis.simulate.changes import Change, changed
from analysis.simulate.daylight import Daylight
from analysis.simulate.predict import C_DEG, GAMMA_DEG, PILOT, Traced, in_room, traced
from analysis.simulate.prediction import Prediction
from analysis.simulate.room import Room
from analysis.simulate.system import System
from analysis.simulate.tracer import Settings
from labdaq.errors import ConfigError

Floats = NDArray[np.float64]

WALL: Final = "wall.reflectance"
"""The dotted name of what a change calls ``wall_reflectance``."""


def predict_varied(
    system: System,
    daylight: Daylight,
    changes: Sequence[Change],
    *,
    distance_m: float = 0.0,
    room: Room | None = None,
    precision: float = 0.01,
    rays: int = 0,
    seed: int = 1,
    max_bounces: int | None = None,
    threads: int = 0,
    gamma_deg: Floats = GAMMA_DEG,
    c_deg: Floats = C_DEG,
) -> tuple[Prediction, list[Prediction]]:
    """Predict a system with the tracer as it is, and with each change; parameters are those of `predict`.

    The facts of a variant tell its setting, and whether it was ``traced`` again. Raises `ConfigError` for a setting
    that does not exist or cannot be varied.
    """
    if room is not None and distance_m <= 0.0:
        raise ConfigError("the room's light is what sensors at a distance see", "give a distance")
    plans = [_checked(system, change) for change in changes]
    by_bounce = any(_of_tallies(system, plan, max_bounces) for plan in plans)
    settings = Settings(
        rays=rays or PILOT,
        seed=seed,
        distance_m=distance_m,
        max_bounces=max_bounces,
        threads=threads,
        bounces=0 if by_bounce else 1,
    )
    enough = 0.0 if rays else precision
    base = traced(system, daylight, settings, enough, gamma_deg, c_deg)
    made = [base.prediction()]
    for change, plan in zip(changes, plans, strict=True):
        again = any(base.scored) or not _of_tallies(system, plan, max_bounces)
        one = _again(base, plan, enough) if again else _from_tallies(base, plan)
        told = {"variant": change.mechanism, "setting": dict(change.setting), "traced": again}
        made.append(dataclasses.replace(one, facts=one.facts | told))
    lit = made if room is None else [in_room(one, room) for one in made]
    return lit[0], lit[1:]


def _checked(system: System, change: Change) -> dict[str, Any]:
    """The setting with one name for each thing, if it can be varied."""
    plan = dict(change.setting)
    if WALL in plan:
        plan["wall_reflectance"] = plan.pop(WALL)
    name = f"variant {change.mechanism}"
    if "distance_m" in plan:
        raise ConfigError(f"{name}: the sensors' distance is the same for baseline and variants")
    reflectance, limit = plan.get("wall_reflectance"), plan.get("max_bounces")
    if reflectance is not None and not (_number(reflectance) and 0.0 <= reflectance <= 1.0):
        raise ConfigError(f"{name}: {WALL}: {reflectance!r} is not a number from 0 to 1")
    if limit is not None and not (isinstance(limit, int) and not isinstance(limit, bool) and limit >= 0):
        raise ConfigError(f"{name}: max_bounces: {limit!r} is not a whole number from 0 up")
    for key in ("rotation_deg", "aureole_deg"):
        if key in plan and not _number(plan[key]):
            raise ConfigError(f"{name}: {key}: {plan[key]!r} is not a number of degrees")
    if plan.get("lenses") not in (None, "entry", "exit"):
        raise ConfigError(f"{name}: lenses: {plan['lenses']!r} is neither entry nor exit")
    try:
        _system(system, plan)
    except ConfigError as error:
        raise ConfigError(f"{name}: {error.message}", error.hint) from error
    return plan


def _number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and bool(np.isfinite(value))


def _of_tallies(system: System, plan: Mapping[str, Any], limit: int | None) -> bool:
    """Whether a run of the system that was cut at ``limit`` knows the variant."""
    raised = plan.get("wall_reflectance", 0.0) > 0.0 and system.wall.reflectance == 0.0
    longer = limit is not None and plan.get("max_bounces", limit) > limit
    return not set(plan) - {"wall_reflectance", "max_bounces"} and not raised and not longer


def _system(system: System, plan: Mapping[str, Any]) -> System:
    rest = {key: value for key, value in plan.items() if key not in ("wall_reflectance", "max_bounces")}
    if "wall_reflectance" in plan:
        rest[WALL] = plan["wall_reflectance"]
    return changed(system, rest)


def _from_tallies(base: Traced, plan: Mapping[str, Any]) -> Prediction:
    made = base.prediction(plan.get("wall_reflectance"), plan.get("max_bounces"))
    limit = plan.get("max_bounces", base.settings.max_bounces)
    return dataclasses.replace(
        made, system=_system(base.system, plan), facts=made.facts | {"max_bounces": limit, "sun": None, "sky": None}
    )


def _again(base: Traced, plan: Mapping[str, Any], precision: float) -> Prediction:
    limit = plan.get("max_bounces", base.settings.max_bounces)
    settings = dataclasses.replace(base.settings, max_bounces=limit, bounces=1)
    aureole = float(plan.get("aureole_deg", 0.0))
    return traced(
        _system(base.system, plan),
        base.daylight,
        settings,
        precision,
        base.gamma_deg,
        base.c_deg,
        rays=base.rays,
        aureole_deg=aureole,
    ).prediction()
