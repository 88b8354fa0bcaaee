"""The goniometer: where its sensors really were."""

from functools import lru_cache

import numpy as np
from scipy import sparse

from analysis.cases.model import Aperture, Floats
from analysis.explain.geometry import apply_operator, near_field_matrix
from analysis.explain.mechanisms.base import Branch, Mechanism, Stage
from analysis.explain.mechanisms.retraced import systems_on_the_arm
from analysis.explain.parameter import Parameter
from analysis.explain.scene import Light, Scene
from analysis.explain.variants import OF_CASE

BROUGHT = f"{OF_CASE} of the near field"
"""The way in which a case's own near field is seen."""


@lru_cache(maxsize=8)
def _near_matrix(shape: str, size: tuple[float, ...], distance_m: float) -> sparse.csr_matrix:
    aperture = (
        Aperture(shape="rectangle", size_m=(size[0], size[1]))
        if shape == "rectangle"
        else Aperture(shape="disc", diameter_m=size[0])
    )
    return near_field_matrix(aperture, distance_m)


_INTERPOLATED = 0.25
"""Form error of a turn where the prediction is known at the sensors' nominal directions alone: sharp images dull."""
_OF_TURN = 0.2
"""Share of an azimuth's error that images leave open. (Of twenty in seven other authors' cases two were told as
larger by more than .3 of it.)"""


_FAR_DEG = float(np.degrees(np.arctan(0.5 / 6.0)))
"""Half the width of an aperture that is six of itself away; the five-times rule calls that far."""


class NearField(Mechanism):
    """The sensors are not infinitely far away: each sees the aperture's parts under different angles."""

    id = "near-field"
    stage = Stage.GONIOMETER
    leaves_out = "The sensors are not infinitely far from the aperture; the simulation gave far-field intensities."
    parameters = (
        Parameter(
            "weight", "1", "share of the far-to-near change that is seen (1 = all)", 0.0, 1.6, 0.15, (1.0,), centre=1.0
        ),
    )
    needs = "goniometer distance; aperture of each system"
    modelled_twice = True
    source = (
        "E = ∫ L cos cos / l² dA over the aperture; the five-times rule (report ch. 1); own "
        "re-simulation where possible"
    )
    tie_breaker = "the same scan with the arm's radius changed by a tenth"
    form_error = 0.2
    local_error = 0.3

    def why_not(self, scene: Scene) -> str:
        """Only a far-field prediction can lack it."""
        case = scene.readings.case
        if case.setup.simulation.field == "near":
            return "the simulation already predicts at the sensors' distance"
        if scene.retraced is not None and self.id in scene.retraced.has:
            return "the prediction is of the near field, by the case's own variants"
        known = scene.distance_m and all(
            (s := case.system_of(t)) is not None and s.aperture is not None for t in case.tests
        )
        return "" if known else "goniometer distance and the systems' apertures are not all given"

    def branches(self, scene: Scene) -> tuple[Branch, ...]:
        """By re-simulation where there is one, in closed form from the predicted far field itself, and halfway.

        Each errs in its own way: the mean is nearer to another lens than either. Of several systems one's lens may be
        likened and another's not: each is simulated alone, too, beside the others' closed form. What the case brings
        needs no other form.
        """
        retraced = scene.retraced is not None and scene.retraced.near_field() is not None
        if scene.retraced is not None and "near-field" in scene.retraced.case_paths:
            return (Branch(BROUGHT, dict.fromkeys(systems_on_the_arm(scene), 1.0), brought=True),)
        ways = {"traced": 1.0, "halfway": 0.5} if retraced else {}
        systems = systems_on_the_arm(scene)
        apart = [(f"{label}, {name} only", {k: share}) for label, share in ways.items() for k, name in systems.items()]
        together = [(label, dict.fromkeys(systems, share)) for label, share in {"closed form": 0.0, **ways}.items()]
        tried = together + (apart if len(systems) > 1 else [])
        blurs = self.displaces_deg(scene) < _FAR_DEG
        return tuple(Branch(label, share, blurs=blurs) for label, share in tried)

    def displaces_deg(self, scene: Scene) -> float:
        """The aperture's half width as the sensors see it."""
        case = scene.readings.case
        widths = [max(s.aperture.size_m or (s.aperture.diameter_m or 0.0,)) for s in case.setup.system if s.aperture]
        distance = scene.distance_m or np.inf
        return float(np.degrees(np.arctan(0.5 * max(widths, default=0.0) / distance)))

    def illuminate(self, scene: Scene, light: Light, p: Floats, branch: Branch) -> None:
        """Move both parts from far towards near."""
        traced = np.array([branch.value.get(int(k), 0.0) for k in scene.readings.system])[:, None, None]
        sun, sky = np.zeros_like(light.sun), np.zeros_like(light.sky)
        if np.any(traced < 1.0):
            sun, sky = ((1.0 - traced) * self._from_far(scene, part) for part in (light.sun, light.sky))
        if np.any(traced > 0.0) and scene.retraced is not None and (near := scene.retraced.near_field()) is not None:
            sun, sky = sun + traced * near[0] * light.sun, sky + traced * near[1] * light.sky
        light.sun, light.sky = light.sun + p[0] * (sun - light.sun), light.sky + p[0] * (sky - light.sky)

    @staticmethod
    def _from_far(scene: Scene, field: Floats) -> Floats:
        """What sensors at the arm's distance make of a far field (T, P, G) [cd]."""
        assert scene.distance_m is not None
        case, made = scene.readings.case, field.copy()
        for k in np.unique(scene.readings.system):
            rows = np.flatnonzero(scene.readings.system == k)
            system = case.system_of(case.tests[rows[0]])
            assert system is not None
            assert system.aperture is not None
            a = system.aperture
            size = a.size_m if a.shape == "rectangle" else (a.diameter_m,)
            matrix = _near_matrix(a.shape, tuple(float(x) for x in size or () if x), scene.distance_m)
            made[rows] = apply_operator(matrix, field[rows])
        return made

    def statement(self, p: Floats, branch: Branch) -> str:
        """Say it."""
        return (
            "The sensors are so near that they see the aperture's parts under different angles; "
            "the simulation was far-field."
        )


class GammaOffset(Mechanism):
    """The arm's vertical angle is off by a constant."""

    id = "gamma-offset"
    stage = Stage.GONIOMETER
    leaves_out = "The arm's vertical angle is off."
    parameters = (
        Parameter("offset_deg", "deg", "true gamma minus the recorded one", -12.0, 12.0, 1.5, (-3.0, -1.0, 1.0, 3.0)),
    )
    source = "I(gamma + d, C)"
    tie_breaker = "a spirit level on the arm"

    def form_error_in(self, scene: Scene) -> float:
        """Between recorded directions the light is only interpolated."""
        return _INTERPOLATED if scene.interpolated else self.form_error

    def illuminate(self, scene: Scene, light: Light, p: Floats, branch: Branch) -> None:
        """Sample the fields elsewhere."""
        light.gamma_deg = light.gamma_deg + p[0]
        light.moved = True

    def statement(self, p: Floats, branch: Branch) -> str:
        """Say by how much."""
        return f"The sensors were {abs(p[0]):.2f}° {'further from' if p[0] > 0 else 'nearer to'} nadir than recorded."


class COffset(Mechanism):
    """The arm's azimuth is off by a constant."""

    id = "c-offset"
    stage = Stage.GONIOMETER
    leaves_out = "The arm's azimuth is off."
    parameters = (
        Parameter(
            "offset_deg",
            "deg",
            "true C minus the recorded one",
            -180.0,
            180.0,
            6.0,
            (-40.0, -15.0, -5.0, 5.0, 15.0, 40.0),
        ),
    )
    source = "I(gamma, C + d)"
    tie_breaker = "a lamp in a known direction, or a compass and the magnetic declination"
    local_error = 0.3  # sharp images lie a little elsewhere than simulated

    def form_error_in(self, scene: Scene) -> float:
        """Between recorded directions the light is only interpolated."""
        return _INTERPOLATED if scene.interpolated else self.form_error

    def size_error_in(self, scene: Scene, branch: Branch) -> float:
        """Images that are not as sharp as simulated seem to turn less."""
        return _OF_TURN

    def illuminate(self, scene: Scene, light: Light, p: Floats, branch: Branch) -> None:
        """Sample the fields elsewhere."""
        light.c_deg = light.c_deg + p[0]
        light.moved = True

    def statement(self, p: Floats, branch: Branch) -> str:
        """Say by how much."""
        return f"The planes were turned by {p[0]:+.1f}° in C against the recorded ones."


class CHandedness(Mechanism):
    """C runs clockwise seen from above instead of counter-clockwise."""

    other_light = True

    id = "c-handedness"
    stage = Stage.GONIOMETER
    leaves_out = "C runs the other way round: east and west are exchanged."
    parameters = (Parameter("zero_deg", "deg", "true C where the recorded C is 0", -180.0, 180.0, 3.0, (0.0,)),)
    source = "I(gamma, d - C); report ch. 8, figures 77 and 79"
    tie_breaker = "a lamp in the east"

    def branches(self, scene: Scene) -> tuple[Branch, ...]:
        """Mirrored at the north-south axis, or at the east-west axis (C zero in the south); below one system or all."""
        r = scene.readings
        systems = sorted({r.case.tests[k].system or "" for k in np.unique(r.test[scene.is_gonio])})
        below = ("", *systems) if len(systems) > 1 else ("",)
        return tuple(
            Branch(f"zero in the {where}" + (f", {system} only" if system else ""), (zero, system))
            for system in below
            for where, zero in (("north", 0.0), ("south", 180.0))
        )

    def illuminate(self, scene: Scene, light: Light, p: Floats, branch: Branch) -> None:
        """Sample the mirrored fields."""
        zero, system = branch.value
        below = np.array([system in ("", t.system) for t in scene.readings.case.tests])[scene.readings.test]
        light.c_deg = np.where(below, zero + p[0] - light.c_deg, light.c_deg)
        light.moved = True

    def statement(self, p: Floats, branch: Branch) -> str:
        """Say where zero is."""
        zero, system = branch.value
        below = f" below {system}" if system else ""
        there = f"C = 0 lies at {zero + p[0]:.0f}°"
        return f"The planes run the other way round{below} ({there}): east and west are exchanged."
