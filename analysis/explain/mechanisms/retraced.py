"""Settings of the simulation that may have been wrong: shown by simulating again, never by a formula.

The case may bring variants (the same simulation run again with one thing changed); where it brings none but
describes its systems, labdaq's own simulator supplies the change as a ratio to its own baseline.
"""

import numpy as np
from scipy.special import expn

from analysis.cases.model import Floats
from analysis.explain.geometry import turned
from analysis.explain.mechanisms.base import Branch, Mechanism, Stage
from analysis.explain.parameter import Parameter
from analysis.explain.scene import Light, Scene

_NO_VARIANT = "the case brings no variant for it and does not describe its systems well enough to simulate one"


class _Retraced(Mechanism):
    """Base: one branch per path of settings that can be had, a position along it as parameter."""

    form_error = 0.2  # what a change does is taken from another engine, or from another lens

    def why_not(self, scene: Scene) -> str:
        """There must be a re-simulation."""
        if self.id in scene.readings.case.setup.simulation.includes:
            return "the prediction already models it"
        return "" if self.branches(scene) else _NO_VARIANT

    def branches(self, scene: Scene) -> tuple[Branch, ...]:
        """One per path of settings."""
        if scene.retraced is None:
            return ()
        return tuple(Branch(path.label, path) for path in scene.retraced.paths(self.id))

    def parameters_in(self, scene: Scene, branch: Branch) -> tuple[Parameter, ...]:
        """Each path says what its position means."""
        return (branch.value.parameter,)

    def illuminate(self, scene: Scene, light: Light, p: Floats, branch: Branch) -> None:
        """Change both parts as the re-simulation did."""
        sun, sky = branch.value.change(float(p[0]), scene.fields)
        base = scene.fields
        if light.sun is base.sun and light.sky is base.sky:
            light.sun, light.sky = sun, sky
            return
        if branch.value.added:
            light.sun, light.sky = light.sun + sun - base.sun, light.sky + sky - base.sky
            return
        light.sun = light.sun * np.divide(sun, base.sun, out=np.ones_like(sun), where=base.sun > 0)
        light.sky = light.sky * np.divide(sky, base.sky, out=np.ones_like(sky), where=base.sky > 0)

    def statement(self, p: Floats, branch: Branch) -> str:
        """What was left out, and the setting that fits."""
        q = branch.value.parameter
        return f"{self.leaves_out.rstrip('.')} ({branch.label}: {q.name} = {p[0] * q.per_unit:.3g} {q.unit})."


def systems_on_the_arm(scene: Scene) -> dict[int, str]:
    """Index and name of the systems that the arm was under."""
    r = scene.readings
    seen = np.unique(r.system[np.unique(r.test[scene.is_gonio])])
    return {int(k): next(t.system or "" for t, s in zip(r.case.tests, r.system, strict=True) if s == k) for k in seen}


_DOME_SLANT = 1.3
"""Mean path through a shallow dome's pane over the straight one, of a sun 20 to 70° high."""

_WEIGHT = Parameter(
    "weight", "1", "share of the re-simulated change that is seen (1 = all)", 0.0, 1.5, 0.2, (1.0,), centre=1.0
)


_IMAGE_TURN = Parameter(
    "rotation_deg",
    "deg",
    "turn of the pattern, counter-clockwise from above",
    -45.0,
    45.0,
    12.0,
    (-20.0, -7.0, 7.0, 20.0),
)


class LensHaze(_Retraced):
    """The lens scatters part of the light widely."""

    like_a_lens = True

    id = "lens-haze"
    stage = Stage.OPTICS
    leaves_out = "The lens scatters part of the light widely, beyond what was simulated."
    parameters = (
        Parameter("haze", "1", "share of the transmitted light that is scattered widely", 0.0, 1.0, 0.12, (0.05, 0.2)),
    )
    needs = "sun and sky parts apart, with illuminances (light scattered at the entry enters like the sky's)"
    source = (
        "entry: (1-h) S + h (B/D) K; exit: (1-h) I + h (flux) cos(gamma)/pi (a dull surface) "
        "or (flux)/2pi (a turbid one); ASTM D1003 (haze)"
    )
    tie_breaker = "the same scan with a cleaned or exchanged lens"

    def why_not(self, scene: Scene) -> str:
        """Something must be had of entry, exit or re-simulation."""
        return ""

    def branches(self, scene: Scene) -> tuple[Branch, ...]:
        """Scatter at the entry, at the exit, or as re-simulated; in all systems, or in one of them."""
        ways = {"entry lens": "entry"} if scene.knows_split else {}
        ways |= {"exit lens": "exit", "exit lens, evenly to all sides": "even"}
        names = list(systems_on_the_arm(scene).values())
        alone = names if len(names) > 1 else []
        every = [Branch(label, where) for label, where in ways.items()]
        one = [Branch(f"{label}, {n} only", f"{where}:{n}") for label, where in ways.items() for n in alone]
        return (*every, *one, *super().branches(scene))

    def parameters_in(self, scene: Scene, branch: Branch) -> tuple[Parameter, ...]:
        """Closed forms have the haze itself."""
        return self.parameters if isinstance(branch.value, str) else super().parameters_in(scene, branch)

    def illuminate(self, scene: Scene, light: Light, p: Floats, branch: Branch) -> None:
        """Mix in the scattered light."""
        if not isinstance(branch.value, str):
            super().illuminate(scene, light, p, branch)
            return
        where, _, system = branch.value.partition(":")
        tests = scene.readings.case.tests
        h = float(p[0]) * np.array([system in ("", t.system) for t in tests])[:, None, None]
        if where == "entry":
            diffuse = np.maximum(scene.readings.diffuse_lx, 1e-9)
            like_sky = (scene.beam_lx / diffuse)[:, None, None] * light.sky
            light.sun = (1.0 - h) * light.sun + h * like_sky
            return
        from analysis.explain.fields import GAMMA_DEG, solid_angle

        lobe = np.cos(np.radians(GAMMA_DEG)) / np.pi if where == "exit" else 1.0 / (2.0 * np.pi)
        weight = solid_angle()
        for name in ("sun", "sky"):
            field = getattr(light, name)
            flux = np.sum(field * weight, axis=(1, 2))
            setattr(light, name, (1.0 - h) * field + h * flux[:, None, None] * lobe)

    def statement(self, p: Floats, branch: Branch) -> str:
        """Say how much and where."""
        if not isinstance(branch.value, str):
            return super().statement(p, branch)
        return f"{p[0]:.1%} of the light is scattered widely ({branch.label}), beyond what was simulated."


class LensAnisotropy(_Retraced):
    """An isotropic lens was simulated; the real one is not."""

    like_a_lens = True

    id = "lens-anisotropy"
    stage = Stage.OPTICS
    leaves_out = "The lens was simulated as isotropic; its pattern of prisms sends light along its own axes."
    parameters = (_WEIGHT,)
    needs = "a variant, or the systems' description"
    source = "re-simulation; report chapters 6 and 9"
    tie_breaker = "turn the skylight by 45°"


class LensOrientation(_Retraced):
    """The lens pattern lies turned or mirrored."""

    like_a_lens = True

    id = "lens-orientation"
    stage = Stage.OPTICS
    leaves_out = "The lens pattern is turned or mirrored against the simulated one."
    parameters = (
        Parameter(
            "rotation_deg",
            "deg",
            "turn of the pattern, counter-clockwise from above",
            -180.0,
            180.0,
            45.0,
            (20.0, 90.0),
        ),
    )
    needs = "a variant, or the systems' description, or the sun's angles"
    modelled_twice = True
    source = (
        "re-simulation; small turns also as a turn of the sun's image about its middle; report test 15 and chapter 9"
    )
    tie_breaker = "turn the skylight by 90°"

    def why_not(self, scene: Scene) -> str:
        """Something must be had of re-simulation and the sun's image."""
        return "" if scene.readings.has_parts or self.branches(scene) else _NO_VARIANT

    def branches(self, scene: Scene) -> tuple[Branch, ...]:
        """As re-simulated, and by turning the sun's image about its middle."""
        image = (Branch("turn of the sun's image", "image"),) if scene.knows_image else ()
        return (*super().branches(scene), *image)

    def parameters_in(self, scene: Scene, branch: Branch) -> tuple[Parameter, ...]:
        """An image is turned by less than its own symmetry."""
        return (_IMAGE_TURN,) if isinstance(branch.value, str) else super().parameters_in(scene, branch)

    def illuminate(self, scene: Scene, light: Light, p: Floats, branch: Branch) -> None:
        """Turn the image, or change both parts as the re-simulation did."""
        if not isinstance(branch.value, str):
            super().illuminate(scene, light, p, branch)
            return
        middle = -scene.sun_vectors  # the light goes on away from the sun; seen from above, turns go the other way
        light.sun = turned(light.sun, -middle, np.full(len(middle), float(p[0])))

    def statement(self, p: Floats, branch: Branch) -> str:
        """Say how far."""
        if not isinstance(branch.value, str):
            return super().statement(p, branch)
        return f"The lens pattern is turned by {p[0]:+.1f}° (counter-clockwise from above) against the simulated one."


class Soiling(Mechanism):
    """Dirt takes light, the more the more grazing the sun."""

    id = "soiling"
    stage = Stage.OPTICS
    leaves_out = "Dirt on the skylight takes light, more at grazing incidence."
    parameters = (Parameter("loss", "1", "transmittance lost at normal incidence", 0.0, 0.8, 0.12, (0.04, 0.15)),)
    needs = "sun and sky parts apart; sun angles"
    source = (
        "(1-l)^(1/cos z) for the beam, its mean over a uniform sky for the sky; (1-l)^1.3 for both under a dome; "
        "Martin and Ruiz 2001, Sol. Energy Mater. 70"
    )
    form_error = 0.2  # dirt is not even, nor alike at all angles
    tie_breaker = "the same sky before and after cleaning"

    def why_not(self, scene: Scene) -> str:
        """The loss depends on the sun's angle."""
        r = scene.readings
        if not r.has_parts:
            return "the records do not give the sun and sky parts apart"
        return "sun angles are not given" if np.any(np.isnan(r.altitude_deg)) else ""

    def branches(self, scene: Scene) -> tuple[Branch, ...]:
        """All systems alike, or one of them; under a pane, or a dome, through which all light goes as slantingly."""
        systems = systems_on_the_arm(scene)
        some = {"every system": None} | ({name: k for k, name in systems.items()} if len(systems) > 1 else {})
        panes = tuple(Branch(label, (k, "pane")) for label, k in some.items())
        return (*panes, *(Branch(f"{label}, domed", (k, "dome")) for label, k in some.items()))

    def illuminate(self, scene: Scene, light: Light, p: Floats, branch: Branch) -> None:
        """Weaken the beam by its path through the dirt, the sky by the mean."""
        system, cover = branch.value
        r = scene.readings
        if cover == "pane":
            beam = (1.0 - p[0]) ** (1.0 / np.maximum(np.cos(scene.sun_zenith_at), 0.1))
            sky = 2.0 * float(expn(3, -np.log1p(-p[0])))  # ∫ 2 μ exp(-τ/μ) dμ = 2 E₃(τ)
        else:
            beam = np.full(len(r), (1.0 - p[0]) ** _DOME_SLANT)
            sky = (1.0 - float(p[0])) ** _DOME_SLANT
        hit = np.ones(len(r), bool) if system is None else r.system[r.test] == system
        light.sun_factor = np.where(hit, light.sun_factor * beam, light.sun_factor)
        light.sky_factor = np.where(hit, light.sky_factor * sky, light.sky_factor)

    def statement(self, p: Floats, branch: Branch) -> str:
        """Say how much."""
        if branch.value[1] == "dome":
            return f"Dirt on {branch.label}, takes {p[0]:.1%} at normal incidence."
        return f"Dirt on {branch.label} takes {p[0]:.1%} at normal incidence and more at grazing."


class WallReflectance(_Retraced):
    """The well's walls reflect more or less than assumed."""

    id = "wall-reflectance"
    stage = Stage.WELL
    leaves_out = "The well's walls reflect more or less than was simulated; it counts once per bounce."
    parameters = (Parameter("wall_reflectance", "1", "reflectance of the well", 0.3, 1.0, 0.03, (0.9,), centre=0.95),)
    needs = "a variant, or the systems' description"
    source = "sum over bounces R^n S_n; Swift and Smith 1995, Sol. Energy Mater. Sol. Cells 36"
    tie_breaker = "a reflectance measurement of the wall at grazing incidence, or a test with the sun low in the tube"


class BounceTruncation(_Retraced):
    """The ray tracer stopped after too few bounces."""

    id = "bounce-truncation"
    stage = Stage.WELL
    leaves_out = "The simulation stopped its rays after too few bounces; light that bounces often is missing."
    parameters = (
        Parameter(
            "max_bounces", "1", "wall bounces after which the simulation stopped", 1.0, 40.0, 12.0, (4.0,), centre=40.0
        ),
    )
    needs = "a variant, or the systems' description"
    source = "re-simulation without a limit; report chapters 7 to 9 (12, 20 and 50 bounces)"
    tie_breaker = "run the simulation again with a higher limit"


class WallScatter(_Retraced):
    """The specular wall scatters a little."""

    like_a_lens = True

    id = "wall-scatter"
    stage = Stage.WELL
    leaves_out = "The specular wall scatters part of the light."
    parameters = (Parameter("scatter", "1", "share of each reflection that is diffuse", 0.0, 1.0, 0.15, (0.1,)),)
    needs = "a variant, or the systems' description"
    source = "re-simulation; report chapters 6 and 8 (foam core, tube wall)"
    tie_breaker = "a scatter measurement of the wall"


WELL_AND_LENS = frozenset(m.id for m in (LensHaze, LensOrientation, WallReflectance, WallScatter)) | {"clock-offset"}
"""Mechanisms whose parameters are settings of a simulation."""
