"""What a mechanism is: physics that a prediction may have left out, as a forward model with parameters.

A mechanism changes the predicted light (`Mechanism.illuminate`) or what a sensor makes of it (`Mechanism.respond`).
Several can act together; they are applied in the order of the chain, from the sun to the sensor.
"""

from dataclasses import dataclass, field, replace
from enum import IntEnum
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from analysis.cases.model import Floats
from analysis.explain.parameter import Parameter
from analysis.explain.retrace import Path
from analysis.explain.scene import Light, Scene

_OF_ROWS = "sun_factor", "sky_factor", "gamma_deg", "c_deg"
_OF_TESTS = "sun", "sky", "added"
_KEPT = 8  # lights after the first terms, some megabytes each
FORM_OF_SIZE = 0.18
"""Share of an effect's size that its form usually leaves open, set on a blind trial (docs/explaining.md)."""
IMAGES_OF_SIZE = 0.5
"""The same where sharp images move: under a lens that is blurred otherwise than simulated they seem to move less."""


class Stage(IntEnum):
    """Where in the chain a mechanism acts; the order is the order of application."""

    SUN_AND_SKY = 0
    ROOF_METERS = 1
    OPTICS = 2
    WELL = 3
    GONIOMETER = 4
    ROOM = 5
    TIME = 6
    CAMERA = 7
    SENSORS = 8

    @property
    def label(self) -> str:
        """The name used in the catalogue."""
        return self.name.lower().replace("_", " ")


@dataclass(frozen=True)
class Branch:
    """One of several discrete ways in which a mechanism can act: which channel, which form, which variant.

    Attributes
    ----------
    label
        Names the way, in words; the same in every case of a station.
    value
        What the mechanism needs to act this way.
    facts
        Numbers taken from the case that was fitted (a reference level, say), so that the same law can be applied
        to another case.
    brought
        Whether the case brings the change itself, in another form than a path of settings.
    blurs
        Whether the change is hardly more than a blur at any parameters, as that of a lens simulated a little wrong.
    stands_in
        Whether it lets light go on as the sky's does, which stands for whatever else spreads the sun's light.
    like
        Whether it was simulated on a lens that is hardly unlike the prediction's, in another form than a path.
    sort
        What kind of way it is: the best of each kind is fitted again with what its form has wrong.
    outermost
        Whether it is about the first or the last sensor of an arm: beyond it nothing is read.
    of_random
        Whether it holds what a random effect has told, and is not looked for by itself.
    """

    label: str = ""
    value: Any = None
    facts: dict[str, float] = field(default_factory=dict)
    brought: bool = False
    blurs: bool = False
    stands_in: bool = False
    like: bool = False
    sort: str = ""
    outermost: bool = False
    of_random: bool = False

    @property
    def of_case(self) -> bool:
        """Whether the case brings the change itself, as a variant of its own simulation."""
        return self.brought or (isinstance(self.value, Path) and self.value.of_case)

    @property
    def alike(self) -> bool:
        """Whether it was simulated again on a lens that is hardly unlike the prediction's."""
        return self.like or (isinstance(self.value, Path) and self.value.alike)


Reported = dict[str, dict[str, float | str]]
"""Parameters as they are told: name to value, uncertainty and unit."""


def told(value: float, uncertainty: float, unit: str) -> dict[str, float | str]:
    """One parameter as it is told."""
    return {"value": float(f"{value:.5g}"), "uncertainty": float(f"{uncertainty:.5g}"), "unit": unit}


@dataclass(frozen=True)
class Mechanism:
    """Base of all mechanisms; subclasses are stateless and implement one or both hooks.

    Class attributes ``id``, ``stage``, ``leaves_out`` (what a prediction without it leaves out), ``parameters``,
    ``needs`` (what a case must bring), ``source`` (paper, standard, manual), ``tie_breaker`` (a cheap measurement
    that isolates it), ``kinds`` (kinds of channel it can show in), ``random`` (its effect is a random function, not a
    formula), ``form_error`` (how wrong the form itself may be, relative to the effect), ``local_error`` (the same,
    from one direction to the next), ``like_a_lens`` (its effect looks like that of a lens simulated a little wrong,
    which every lens is), ``modelled_twice`` (its ways are models of one and the same thing), ``fitted_ways`` (so
    many of its ways are fitted after a first look at all), ``in_one_test`` (on a roof it may act in a single test),
    ``in_time`` (it is a function of time, or of the order of the readings), ``other_light`` (readings are of other
    light than that which was predicted for them: from elsewhere, or such as the prediction lacks), ``bends`` (its forms
    of many parameters take what a simulation has wrong).
    """

    id: ClassVar[str]
    stage: ClassVar[Stage]
    leaves_out: ClassVar[str]
    parameters: ClassVar[tuple[Parameter, ...]] = ()
    needs: ClassVar[str] = "readings and prediction"
    source: ClassVar[str]
    tie_breaker: ClassVar[str] = ""
    kinds: ClassVar[tuple[str, ...]] = ("goniometer",)
    random: ClassVar[bool] = False
    other_light: ClassVar[bool] = False
    form_error: ClassVar[float] = 0.08
    local_error: ClassVar[float] = 0.0
    like_a_lens: ClassVar[bool] = False
    modelled_twice: ClassVar[bool] = False
    fitted_ways: ClassVar[int] = 3
    in_one_test: ClassVar[bool] = False
    in_time: ClassVar[bool] = False
    bends: ClassVar[bool] = False

    def why_not(self, scene: Scene) -> str:
        """Why this case cannot be tried for the mechanism; empty when it can."""
        return "the records carry no time" if self.in_time and not scene.readings.has_times else ""

    def branches(self, scene: Scene) -> tuple[Branch, ...]:
        """The discrete ways to try."""
        return (Branch(),)

    def parameters_in(self, scene: Scene, branch: Branch) -> tuple[Parameter, ...]:
        """The parameters with ranges that fit the case (an offset's prior depends on the size of the readings)."""
        return self.parameters

    def form_error_in(self, scene: Scene) -> float:
        """How wrong the form may be in this case, relative to the effect."""
        return self.form_error

    def local_error_in(self, scene: Scene, branch: Branch) -> float:
        """The same from one direction to the next: only below a skylight are images so sharp that it matters."""
        return self.local_error if np.any(scene.is_gonio) else 0.0

    def between_readings_min(self, scene: Scene, p: Floats, branch: Branch) -> float:
        """Time [min] for which what clouds did is not known, where a series is read between two of its points."""
        return 0.0

    def size_error_in(self, scene: Scene, branch: Branch) -> float:
        """Share of the effect's size that the form leaves open in this case; a parameter's uncertainty holds it."""
        return FORM_OF_SIZE

    def displaces_deg(self, scene: Scene) -> float:
        """By how much it may move the edges of sharp images to either side [deg]: there its form tells little."""
        return 0.0

    def blurs(self, p: Floats, branch: Branch) -> bool:
        """Whether the change is hardly more than a blur, or than one taken away, at these parameters."""
        return branch.blurs

    def absurd(self, p: Floats, branch: Branch) -> bool:
        """Whether nothing is so: at the end of its range a form takes what others left."""
        return False

    def illuminate(self, scene: Scene, light: Light, p: Floats, branch: Branch) -> None:
        """Change the light on its way; ``p`` are the parameters."""

    def respond(self, scene: Scene, values: Floats, p: Floats, branch: Branch) -> Floats:
        """What the sensors make of ``values`` (N,)."""
        return values

    def statement(self, p: Floats, branch: Branch) -> str:
        """One sentence on what was found, for the report."""
        return self.leaves_out

    def report(self, p: Floats, sd: Floats, term: "Term") -> Reported:
        """Fitted parameters as they are told: name to value, standard uncertainty and unit."""
        return {
            q.name: told(x * q.per_unit, u * q.per_unit, q.unit) for q, x, u in zip(term.parameters, p, sd, strict=True)
        }


@dataclass(frozen=True)
class Term:
    """A mechanism acting in one of its ways, with its parameters as they are in this case.

    ``tests`` holds the tests in which it acts (a state may change during a campaign); ``None`` means all. ``share`` is
    how much of its change is seen.
    """

    mechanism: Mechanism
    branch: Branch
    parameters: tuple[Parameter, ...]
    tests: frozenset[int] | None = None
    share: float = 1.0

    def illuminate(self, scene: Scene, light: Light, p: Floats) -> None:
        """Change the light, in the tests where the mechanism acts, by the share that is seen."""
        if self.tests is None and self.share == 1.0:
            self.mechanism.illuminate(scene, light, p, self.branch)
            return
        before = replace(light)
        self.mechanism.illuminate(scene, light, p, self.branch)
        for name in _OF_ROWS + _OF_TESTS:
            was, made = getattr(before, name), getattr(light, name)
            if made is not was:
                acts = self._acts_in(scene)
                here = acts[:, None, None] if name in _OF_TESTS else acts[scene.readings.test]
                setattr(light, name, self._seen(here, was, made))

    def respond(self, scene: Scene, values: Floats, p: Floats) -> Floats:
        """What the sensors make of ``values``, in the tests where the mechanism acts."""
        made = self.mechanism.respond(scene, values, p, self.branch)
        if made is values or (self.tests is None and self.share == 1.0):
            return made
        return self._seen(self._acts_in(scene)[scene.readings.test], values, made)

    def _seen(self, here: NDArray[np.bool_], before: Floats, made: Floats) -> Floats:
        """The share of a change that is seen where it is."""
        return np.where(here, made if self.share == 1.0 else before + self.share * (made - before), before)

    def _acts_in(self, scene: Scene) -> NDArray[np.bool_]:
        """Whether it acts in each test; shape (T,)."""
        acts = np.full(len(scene.readings.case.tests), self.tests is None)
        acts[list(self.tests or ())] = True
        return acts


def predict(scene: Scene, terms: tuple[Term, ...], theta: Floats) -> Floats:
    """Readings predicted with ``terms`` at parameters ``theta`` (all terms' parameters in a row); shape (N,)."""
    parts: list[tuple[Term, Floats]] = []
    k = 0
    for term in terms:
        n = len(term.parameters)
        parts.append((term, np.asarray(theta[k : k + n], dtype=np.float64)))
        k += n
    parts.sort(key=lambda item: item[0].mechanism.stage)
    values = scene.read(_lit(scene, parts))
    for term, p in parts:
        values = term.respond(scene, values, p)
    return values


def lit_by(scene: Scene, terms: tuple[Term, ...], theta: Floats) -> Light:
    """The light that ``terms`` make of what the case predicts, and where they say that each reading was taken."""
    light, k = scene.dark_light(), 0
    for term in terms:
        term.illuminate(scene, light, theta[k : k + len(term.parameters)])
        k += len(term.parameters)
    return light


def _lit(scene: Scene, parts: list[tuple[Term, Floats]]) -> Light:
    """The light after all terms; what the first of them make of it is kept, as fits move one parameter at a time."""
    key = tuple((id(term), p.tobytes()) for term, p in parts)
    known = next((n for n in range(len(parts) - 1, 0, -1) if key[:n] in scene.lit), 0)
    light = replace(scene.lit[key[:known]][0]) if known else scene.dark_light()
    for n in range(known, len(parts)):
        term, p = parts[n]
        term.illuminate(scene, light, p)
        if n + 1 < len(parts):
            scene.lit[key[: n + 1]] = replace(light), parts  # with the terms, so that their ids stay theirs
    while len(scene.lit) > _KEPT:
        del scene.lit[next(iter(scene.lit))]
    return light
