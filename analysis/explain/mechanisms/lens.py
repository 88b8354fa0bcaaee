"""The lens: haze, and the pattern of its prisms."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from analysis.cases.model import Floats
from analysis.explain import shift_pattern
from analysis.explain.geometry import turned
from analysis.explain.mechanisms.base import IMAGES_OF_SIZE, Branch, Reported, Stage, Term, told
from analysis.explain.mechanisms.retraced import NO_VARIANT, Retraced, systems_on_the_arm
from analysis.explain.parameter import Parameter
from analysis.explain.retrace import Path
from analysis.explain.scene import Light, Scene
from analysis.explain.shift_pattern import WAYS
from analysis.explain.small_turns import turns_little

_WEIGHT = Parameter(
    "weight", "1", "share of the re-simulated change that is seen (1 = all)", 0.0, 1.5, 0.2, (1.0,), centre=1.0
)
_OTHER_LENS = 0.3
"""Share by which the change of a turned pattern may miss from one direction to the next."""
_OF_HAZE = 0.3
"""Share of a haze that its form leaves open: no two lenses scatter alike. (Of twelve by seven other authors three were
told as .57 to .65 times as much, one as 2.4 times.)"""
_OF_ALL_LIGHT = 0.6
"""Share by which an angle may be larger than all light turned. (Below the wells of three other authors a lens was
turned by 1.4 to 2.1 times as much.)"""
_IMAGE_TURN = Parameter(
    "rotation_deg",
    "deg",
    "turn of the pattern, counter-clockwise from above",
    -45.0,
    45.0,
    12.0,
    (-20.0, -7.0, -2.5, 2.5, 7.0, 20.0),
)


class LensHaze(Retraced):
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
        "re-simulation; entry, where it cannot be traced: (1-h) S + h (B/D) K; "
        "exit: (1-h) I + h (flux) cos(gamma)/pi (a dull surface) or (flux)/2pi (a turbid one); ASTM D1003 (haze)"
    )
    tie_breaker = "the same scan with a cleaned or exchanged lens"

    def why_not(self, scene: Scene) -> str:
        """Something must be had of entry, exit or re-simulation."""
        return ""

    def branches(self, scene: Scene) -> tuple[Branch, ...]:
        """Scatter at the entry, at the exit, or as re-simulated; in all systems, or in one of them.

        That what is scattered at the entry goes on as the sky's light does is a stopgap, for where it cannot be traced:
        it stands for whatever widens an image. (On another author's cases an aureole, walls that scatter and a turned
        lens gained 29 to 116 nats by it, and 8 to 27 by haze that was traced.)
        """
        ways = super().branches(scene)
        closed = {"exit lens": "exit", "exit lens, evenly to all sides": "even"}
        if scene.knows_split and not any(b.label.startswith("entry lens, traced") for b in ways):
            closed = {"entry lens": "entry", **closed}
        names = list(systems_on_the_arm(scene).values())
        alone = names if len(names) > 1 else []
        every = [Branch(label, where) for label, where in closed.items()]
        one = [Branch(f"{label}, {n} only", f"{where}:{n}") for label, where in closed.items() for n in alone]
        return (*every, *one, *ways)

    def size_error_in(self, scene: Scene, branch: Branch) -> float:
        """Widely is a word; the case's own re-simulation knows how widely."""
        return super().size_error_in(scene, branch) if branch.of_case else _OF_HAZE

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


ANY_PATTERN = Branch("any pattern, read off the recordings", of_random=True)


class LensAnisotropy(Retraced):
    """An isotropic lens was simulated; the real one is not."""

    like_a_lens = True

    id = "lens-anisotropy"
    stage = Stage.OPTICS
    leaves_out = "The lens was simulated as isotropic; its pattern of prisms sends light along its own axes."
    parameters = (_WEIGHT,)
    needs = "a variant, or the systems' description"
    source = (
        "re-simulation; any pattern: sun's part (1 + f(s)), s the shift of its direction cosines, f a random function "
        "twice, three and four times round; report chapters 6 and 9"
    )
    tie_breaker = "turn the skylight by 45°"

    def why_not(self, scene: Scene) -> str:
        """Of a prediction that a variant makes isotropic, and none gives more of a pattern, the lens had its own."""
        if scene.retraced is not None and self.id in scene.retraced.has:
            return "the prediction has the lens's pattern, by the case's own variants"
        return super().why_not(scene) or ("" if super().branches(scene) else NO_VARIANT)

    def branches(self, scene: Scene) -> tuple[Branch, ...]:
        """Patterns that were traced; and one that is read off the recordings themselves, when they have told of it."""
        return (*super().branches(scene), ANY_PATTERN)

    def parameters_in(self, scene: Scene, branch: Branch) -> tuple[Parameter, ...]:
        """Of any pattern, so much of each unit effect of each system that the branch's facts name."""
        if not branch.of_random:
            return super().parameters_in(scene, branch)
        effect = Parameter("", "1", "relative change of the sun's light", -1.0, 1.0, 0.06, (0.0,))
        return tuple(replace(effect, name=f"{system}: {way}") for system in branch.facts for way in WAYS)

    def illuminate(self, scene: Scene, light: Light, p: Floats, branch: Branch) -> None:
        """Let the sun's light go by the shift; light of the sky comes from everywhere, and has no pattern."""
        if not branch.of_random:
            super().illuminate(scene, light, p, branch)
            return
        numbers = shift_pattern.systems_of(scene)
        of_test = np.zeros((len(scene.readings.case.tests), len(WAYS)))
        for system, mine in zip(branch.facts, p.reshape(-1, len(WAYS)), strict=True):
            of_test[scene.readings.system == numbers.get(system, -1)] = mine
        change = np.einsum("tk,ktpg->tpg", of_test, scene.remember(shift_pattern.on_fields))
        light.sun = light.sun * np.maximum(1.0 + change, 0.0)

    def report(self, p: Floats, sd: Floats, term: Term) -> Reported:
        """Of any pattern its contrast alone, the rms relative change of the sun's light over shifts up to one."""
        if not term.branch.of_random:
            return super().report(p, sd, term)
        each = p.reshape(-1, len(WAYS))  # of each system
        slope = each @ shift_pattern.products() / len(each)
        size = float(np.sqrt(np.sum(each * slope)))
        spread = float(np.linalg.norm(slope * sd.reshape(each.shape))) / max(size, 1e-9)
        return {"contrast": told(size, spread, "1")}

    def statement(self, p: Floats, branch: Branch) -> str:
        """Say that there is one."""
        if not branch.of_random:
            return super().statement(p, branch)
        return "The simulation's lens sends the sun's light alike to all sides; the real one has a pattern of its own."

    def size_error_in(self, scene: Scene, branch: Branch) -> float:
        """Another lens has other prisms than the one that was traced; the case's own variants have the same."""
        return super().size_error_in(scene, branch) if branch.of_case or branch.of_random else IMAGES_OF_SIZE


@dataclass(frozen=True)
class _Turned:
    """Systems below which all light turns with the lens, and those where the sun's image turns about its middle."""

    whole: tuple[str, ...] = ()
    image: tuple[str, ...] = ()

    def tests(self, scene: Scene) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
        """Which tests (T,) are of either."""
        systems = [t.system or "" for t in scene.readings.case.tests]
        return np.isin(systems, self.whole), np.isin(systems, self.image)


class LensOrientation(Retraced):
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
        "re-simulation; small turns also as a turn of the sun's image about its middle, below a long well of all "
        "light, below several systems of each in its way; report test 15 and chapter 9"
    )
    tie_breaker = "turn the skylight by 90°"

    def why_not(self, scene: Scene) -> str:
        """Something must be had of re-simulation and the sun's image, and the prediction must have a pattern."""
        simulator = scene.retraced.simulator if scene.retraced else None
        if simulator and any(like.even for like in simulator.traced_systems().values()):
            return "the prediction knows no pattern that could lie turned: it is even about the sun's plane"
        return "" if scene.readings.has_parts or self.branches(scene) else NO_VARIANT

    def branches(self, scene: Scene) -> tuple[Branch, ...]:
        """As re-simulated, by turning the sun's image about its middle, and all light below a long well.

        A round one has no directions of its own, and a square one sends light to all four sides: what the lens below
        it makes turns with the lens. (Where a square one is the only system, that is an arm turned the other way.)
        Lenses that all lie turned alike do each below its own well what it does there; an arm that is turned does
        the same below all. (Of two such cases by another author both had been told as an arm's azimuth.)
        """
        read = tuple(systems_on_the_arm(scene).values())
        patterns = [s for s in scene.readings.case.setup.system if s.lens in (None, "prismatic") and s.id in read]
        long = {"tube", "box"} if len(read) > 1 else {"tube"}
        wells, others = (tuple(sorted(s.id for s in patterns if (s.kind in long) == deep)) for deep in (True, False))
        image = (Branch("turn of the sun's image", _Turned(image=read)),) if scene.knows_image else ()
        whole = (Branch(f"turn of all light of {name}", _Turned(whole=(name,))) for name in wells)
        every = (Branch("turn of every lens", _Turned(wells, others), sort="every"),)
        return (*super().branches(scene), *image, *whole, *(every if image and wells and len(patterns) > 1 else ()))

    @staticmethod
    def is_an_arms(term: Term) -> bool:
        """Whether a term turns all light of several systems: so does an arm that is turned the other way."""
        way = term.branch.value
        return isinstance(way, _Turned) and len(way.whole) > 1 and not way.image

    def size_error_in(self, scene: Scene, branch: Branch) -> float:
        """Light turns by less than the lens does: images lie about the sun's place, which stays.

        (Of four small turns by three authors, told as mixtures, one was told as 1.6 times what it was, one as .7.)
        """
        if turns_little(branch.value):
            return IMAGES_OF_SIZE
        return _OF_ALL_LIGHT if _whole(branch) else super().size_error_in(scene, branch)

    def local_error_in(self, scene: Scene, branch: Branch) -> float:
        """Another lens sends its images elsewhere than the one that was traced."""
        moves_images = isinstance(branch.value, Path) or _whole(branch)
        return _OTHER_LENS if moves_images and np.any(scene.is_gonio) else 0.0

    def parameters_in(self, scene: Scene, branch: Branch) -> tuple[Parameter, ...]:
        """An image is turned by less than its own symmetry."""
        return (_IMAGE_TURN,) if isinstance(branch.value, _Turned) else super().parameters_in(scene, branch)

    def illuminate(self, scene: Scene, light: Light, p: Floats, branch: Branch) -> None:
        """Turn the image, or change both parts as the re-simulation did."""
        if not isinstance(branch.value, _Turned):
            super().illuminate(scene, light, p, branch)
            return
        whole, image = (p[0] * rows for rows in branch.value.tests(scene))
        if np.any(whole):
            upright = np.tile([0.0, 0.0, 1.0], (len(whole), 1))
            light.sun, light.sky = (turned(part, upright, whole) for part in (light.sun, light.sky))
        if np.any(image):
            middle = -scene.sun_vectors  # the light goes on away from the sun; seen from above, turns go the other way
            light.sun = turned(light.sun, -middle, image)

    def statement(self, p: Floats, branch: Branch) -> str:
        """Say how far."""
        if not isinstance(branch.value, _Turned):
            return super().statement(p, branch)
        return f"The lens pattern is turned by {p[0]:+.1f}° (counter-clockwise from above) against the simulated one."


def _whole(branch: Branch) -> bool:
    """Whether all light below some well turns with the lens."""
    return isinstance(branch.value, _Turned) and bool(branch.value.whole)
