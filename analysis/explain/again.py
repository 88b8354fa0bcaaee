"""Close the loop: put the physics that was found into the simulation, and simulate again.

The fit reads re-simulations between the settings that were traced, and the room in closed form. Here the skylights are
traced once more with exactly the settings found, all of them together, and the room is solved by radiosity. If both
agree with the recording alike, the found physics does in a simulation what the fit says.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from analysis.cases import Case
from analysis.cases.model import Floats
from analysis.explain.densities import densities
from analysis.explain.fields import C_DEG, GAMMA_DEG
from analysis.explain.mechanisms.base import Branch, Mechanism, Stage, Term, predict
from analysis.explain.mechanisms.retraced import WELL_AND_LENS
from analysis.explain.mechanisms.timing import HOUR, ClockOffset
from analysis.explain.path_making import EVENED
from analysis.explain.ratios import Field, ratio
from analysis.explain.retrace import Path
from analysis.explain.roomlight import DarkRoom, inside
from analysis.explain.scattering import SCATTERED, partly
from analysis.explain.scene import Light, Scene
from analysis.explain.trace_settings import HAZES, STRETCH_OF, STRETCHED, on_top, scatterer
from analysis.explain.tracing import as_predicted, daylight_of, simulated
from analysis.photometry import Distribution
from analysis.simulate.changes import Change
from analysis.simulate.room import Room
from analysis.simulate.system import System
from labdaq.errors import ConfigError

RAYS = 60_000
"""Rays for each sun."""
SETTING_OF = {
    "rotation_deg": "rotation_deg",
    "haze": "haze",
    "loss": "soiling",
    "scatter": "diffuse_fraction",
    "scatter_deg": "scatter_deg",
    "wall_reflectance": "wall_reflectance",
    "offset_min": "minutes",
    STRETCH_OF: STRETCH_OF,
}
"""Parameter of a path to the simulator's setting; minutes move the sun."""
_OF_ALL = {ClockOffset.id}
"""What is true of all systems, though the readings of one may tell it: there is one clock."""
_ROOM_GAMMA = np.arange(0.0, 90.1, 7.5)
_ROOM_C = np.arange(0.0, 360.0, 22.5)


@dataclass(frozen=True)
class Set:
    """Settings that were found, of one system or of all (``None``), beside those that were ``supposed``."""

    system: str | None
    found: Mapping[str, float]
    supposed: Mapping[str, float]


@dataclass(frozen=True)
class Again:
    """A simulation with the found physics in it.

    Attributes
    ----------
    ids
        Mechanisms that were simulated; the others act as they were fitted.
    predicted : shape (N,) [cd]
    """

    ids: tuple[str, ...]
    predicted: Floats


def simulated_again(scene: Scene, terms: tuple[Term, ...], theta: Floats) -> Again | None:
    """Simulate the settings among ``terms``; ``None`` where there is none, or the systems are not described."""
    settings, kept, values, ids = _sorted_out(scene, terms, theta)
    if not ids:
        return None
    if settings:
        traced = _traced(scene, settings)
        if traced is None:
            return None
        kept.append(Term(_Traced(), Branch(value=traced), ()))
    made = predict(scene, tuple(kept), np.concatenate([*values, np.zeros(0)]))
    return Again(tuple(dict.fromkeys(ids)), made)


def _sorted_out(
    scene: Scene, terms: tuple[Term, ...], theta: Floats
) -> tuple[list[Set], list[Term], list[Floats], list[str]]:
    """Settings to trace; terms that stay, with their parameters; ids simulated."""
    settings: list[Set] = []
    kept, values, ids, start = [], [], [], 0
    for term in terms:
        p = theta[start : start + len(term.parameters)]
        start += len(term.parameters)
        name = term.parameters[0].name if term.parameters else ""
        if term.mechanism.id in WELL_AND_LENS and name in SETTING_OF and isinstance(term.branch.value, Path | None):
            settings.append(_set(scene, term, float(p[0])))
            ids.append(term.mechanism.id)
            if term.mechanism.id == ClockOffset.id:
                kept.append(replace(term, branch=replace(term.branch, value=HOUR)))
                values.append(p)
            continue
        if term.mechanism.id == "room-interreflection" and not isinstance(term.branch.value, Path):
            term = replace(term, mechanism=_Radiosity())
            ids.append("room-interreflection")
        kept.append(term)
        values.append(p)
    return settings, kept, values, ids


def _set(scene: Scene, term: Term, value: float) -> Set:
    """What a term is to a simulator, its parameter having such a value."""
    label, path = term.branch.label, term.branch.value
    system = None if term.mechanism.id in _OF_ALL else _system_in(scene, label)
    name, set_to = _setting(term.parameters[0].name, value, label)
    if path is None:
        return Set(system, {name: set_to}, {})
    axis = {STRETCHED: path.held[STRETCHED]} if name == STRETCH_OF else {}
    return Set(system, {name: set_to, **axis}, path.supposed)


def _setting(name: str, value: float, label: str) -> tuple[str, float]:
    """The simulator's setting and its value, for a parameter of a path."""
    if name == "loss":
        return SETTING_OF[name], -float(np.log1p(-value))
    if name == "haze" and label.startswith(SCATTERED):
        return label.partition(",")[0], value
    places = [place for where, names in HAZES.items() if label.startswith(where) for place in names]
    return f"{places[0]}.haze" if name == "haze" and places else SETTING_OF[name], value


def _system_in(scene: Scene, label: str) -> str | None:
    """The one system that a way of a mechanism is about, by its label; ``None`` for all."""
    names = {t.system for t in scene.readings.case.tests if t.system}
    label = label.removesuffix(EVENED)
    return next((n for n in names if label == n or label.endswith(f", {n} only")), None)


def _traced(scene: Scene, settings: list[Set]) -> tuple[Floats, Floats] | None:
    """Ratio (T, P, G) of both parts with the settings to the baseline; ``None`` where a system is not described."""
    case = scene.readings.case
    if scene.retraced is None or scene.retraced.simulator is None:
        return None
    systems = scene.retraced.simulator.traced_systems()
    sun, sky = (np.ones((len(case.tests), len(C_DEG), len(GAMMA_DEG))) for _ in range(2))
    for name in {t.system for t in case.tests if t.system}:
        here = [s for s in settings if s.system in (None, name)]
        mine, given = _together(s.found for s in here), _together(s.supposed for s in here)
        if not mine:
            continue
        tests = [k for k, t in enumerate(case.tests) if t.system == name and t.sun_altitude_deg is not None]
        if name not in systems or not tests:
            return None
        minutes = mine.pop("minutes", 0.0)

        try:
            old = _simulated(case, systems[name].system, tests, 0.0, given)
            new = _simulated(case, systems[name].system, tests, minutes, given | mine)
        except ConfigError:
            return None  # the fit went where no skylight can
        as_seen = systems[name].spread
        sun[tests], sky[tests] = (ratio(as_seen(n), as_seen(o)) for n, o in zip(new, old, strict=True))
    return sun, sky


def _together(settings: Iterable[Mapping[str, float]]) -> dict[str, float]:
    """All of several settings."""
    return {name: value for some in settings for name, value in some.items()}


def _simulated(case: Case, system: System, tests: list[int], late: float, change: Mapping[str, float]) -> Field:
    """Both parts (T, P, G) of one system as changed, under the daylight of its tests some minutes later."""
    rest = {key: value for key, value in change.items() if not key.startswith(SCATTERED)}
    shares = {key.removeprefix(f"{SCATTERED} "): share for key, share in change.items() if key not in rest}
    wholes = [dict(scatterer(place, kind)) for kind in shares for place in densities(system)]
    days = [daylight_of(case, k, late) for k in tests]
    made = simulated(case, system, days, [Change("", on_top(system, rest | whole)) for whole in ({}, *wholes)], RAYS)
    lit = [as_predicted(case, outcome) for _, outcome in made.variants]
    sun, sky = ([part[:, :-1] for part in parts] for parts in zip(*((x.sun, x.sky) for x in lit), strict=True))
    share = sum(shares.values())  # of one kind: a haze has one form
    return partly(sun[0], sun[1:], share), partly(sky[0], sky[1:], share)


class _Traced(Mechanism):
    """Lens, well and sun as traced again."""

    id = "traced-again"
    stage = Stage.OPTICS
    leaves_out = "The settings that were found."
    source = "re-simulation"

    def illuminate(self, scene: Scene, light: Light, p: Floats, branch: Branch) -> None:
        """Change both parts by the traced ratios."""
        light.sun, light.sky = light.sun * branch.value[0], light.sky * branch.value[1]


class _Radiosity(Mechanism):
    """The room's light by radiosity."""

    id = "room-again"
    stage = Stage.ROOM
    leaves_out = "The room that was found."
    source = "radiosity (analysis.simulate.room)"

    def illuminate(self, scene: Scene, light: Light, p: Floats, branch: Branch) -> None:
        """Add what the room sends to sensors all over the hemisphere, interpolated to the fields' grid.

        Beyond the walls there are none: there the last ring before them counts.
        """
        dark = DarkRoom.of(scene.readings.case.setup)
        assert dark is not None
        room = Room(dark.size_m, float(p[0]), float(p[1]), float(p[0]), dark.half_angle_deg)
        sun, sky = light.factor_of_tests(scene.readings.test, len(light.sun))
        field = sun[:, None, None] * light.sun + sky[:, None, None] * light.sky
        added = np.zeros_like(field)
        rings = inside(_ROOM_GAMMA, dark.size_m, dark.distance_m)
        beyond = len(_ROOM_GAMMA) - len(rings)
        for k in np.unique(scene.readings.test[scene.is_gonio]):
            closed = np.append(C_DEG, 360.0)
            far = Distribution(GAMMA_DEG, closed, np.concatenate([field[k], field[k, :1]]))
            coarse = room.added(far, rings[None, :], _ROOM_C[:, None], dark.distance_m)
            coarse = np.pad(np.concatenate([coarse, coarse[:1]]), ((0, 0), (0, beyond)), mode="edge")
            added[k] = Distribution(_ROOM_GAMMA, np.append(_ROOM_C, 360.0), coarse).at(
                GAMMA_DEG[None, :], C_DEG[:, None]
            )
        light.added = light.added + added
