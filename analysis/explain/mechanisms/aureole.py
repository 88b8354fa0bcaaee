"""The bright ring about the sun, as a lens shows it."""

import numpy as np

from analysis.cases.model import Floats
from analysis.explain.geometry import blurred
from analysis.explain.mechanisms.base import IMAGES_OF_SIZE, Branch, Stage
from analysis.explain.mechanisms.retraced import Retraced
from analysis.explain.parameter import Parameter
from analysis.explain.retrace import Path
from analysis.explain.scene import Light, Scene
from analysis.explain.thresholds import NARROW_DEG, NO_DISC, NO_SUN

_LEAST_WIDE_DEG = 2.0
_SPREAD, _AGAIN, _HALFWAY = "spread", "again", "halfway"


class CircumsolarAureole(Retraced):
    """Part of the beam comes from a wide aureole round the disc."""

    id = "circumsolar-aureole"
    stage = Stage.SUN_AND_SKY
    leaves_out = (
        "Part of the sun's light comes from a bright aureole round the disc; the simulation had the disc alone."
    )
    parameters = (
        Parameter("fraction", "1", "share of the beam that comes from the aureole", 0.0, 1.0, 0.25, (0.1, 0.4)),
        Parameter(
            "width_deg", "deg", "rms half width of the aureole", _LEAST_WIDE_DEG, 14.0, 3.5, (4.0, 9.0), centre=6.0
        ),
    )
    needs = "sun and sky parts apart"
    source = "S -> (1-k) S + k (S * Gaussian of the width); Blanc et al. 2014, Solar Energy 110 (circumsolar review)"
    tie_breaker = "a picture of the sun's surroundings through a small shading disc"
    form_error = 0.2
    local_error = 0.3  # where a lens sends the light about the sun, it decides
    like_a_lens = True
    modelled_twice = True

    def why_not(self, scene: Scene) -> str:
        """The aureole belongs to the sun part."""
        return super().why_not(scene) if scene.readings.has_parts else "the records do not give the sun and sky apart"

    def branches(self, scene: Scene) -> tuple[Branch, ...]:
        """What the case's lens or ours makes of the sun's surroundings; else the prediction's own images spread.

        Images spread are also what any lens makes that scatters more than the one simulated, so alone they serve only
        where no lens can be traced. (In the own trial all five names told by them were wrong, four of them where the
        lens traced under an aureole gained nothing.) Halfway between both is nearest to another author's lens: it
        correlated with the true change by .91, .69, .43 and .74 where images spread had .87, .63, .37 and .62, and our
        lens .75, .49, .22 and .65.
        """
        if scene.retraced is None or scene.retraced.aureole(_LEAST_WIDE_DEG) is None:
            own: tuple[Branch, ...] = (Branch("images spread", _SPREAD),)
        else:
            like = scene.retraced.alike
            own = (Branch("simulated again", _AGAIN, like=like), Branch("halfway to images spread", _HALFWAY))
        return (*super().branches(scene), *own)

    def parameters_in(self, scene: Scene, branch: Branch) -> tuple[Parameter, ...]:
        """Of a variant that tells its width, other widths are told too."""
        whole = not isinstance(branch.value, Path) or "width_deg" in branch.value.held
        return self.parameters if whole else super().parameters_in(scene, branch)

    def size_error_in(self, scene: Scene, branch: Branch) -> float:
        """A lens that spreads light itself hides a part of an aureole, another part than the one that was traced."""
        return super().size_error_in(scene, branch) if branch.of_case else IMAGES_OF_SIZE

    def blurs(self, p: Floats, branch: Branch) -> bool:
        """Whether light is spread by no more than any lens may, or no disc is left; not if the case brings it."""
        return not branch.of_case and (float(p[0] * p[1] ** 2) < NARROW_DEG**2 or float(p[0]) > NO_DISC)

    def absurd(self, p: Floats, branch: Branch) -> bool:
        """Whether the sun has no disc left at all."""
        return not branch.of_case and float(p[0]) > NO_SUN

    def illuminate(self, scene: Scene, light: Light, p: Floats, branch: Branch) -> None:
        """Blur the sun part by the aureole: by re-simulation, on the outgoing sphere, or halfway."""
        if not isinstance(branch.value, Path):
            wide = _wide(scene, light.sun, float(p[1]), branch.value)
        elif "width_deg" in branch.value.held:
            wide = light.sun * _as_the_case_has_it(scene, branch.value, float(p[1]))
        else:
            super().illuminate(scene, light, p, branch)
            return
        light.sun = light.sun + p[0] * (wide - light.sun)

    def statement(self, p: Floats, branch: Branch) -> str:
        """Say how wide."""
        if isinstance(branch.value, Path) and "width_deg" not in branch.value.held:
            return super().statement(p, branch)
        return (
            f"{p[0]:.0%} of the sun's light comes from an aureole about {p[1]:.0f}° wide; the "
            "simulation had the disc alone."
        )


def _wide(scene: Scene, sun: Floats, width_deg: float, way: str) -> Floats:
    """The sun part (T, P, G) [cd] with all of the beam spread over an aureole."""
    ratio = scene.retraced.aureole(width_deg) if scene.retraced and way != _SPREAD else None
    if ratio is None:
        return blurred(sun, width_deg)
    return sun * ratio if way == _AGAIN else 0.5 * (sun * ratio + blurred(sun, width_deg))


def _as_the_case_has_it(scene: Scene, path: Path, width_deg: float) -> Floats:
    """The sun part with all of the beam spread, over that of the disc alone, (T, P, G).

    At the width of the case's variant as that has it; at others, as much more or less as our own ways make of it.
    """
    sun = scene.fields.sun
    whole = path.change(1.0, scene.fields)[0]
    there, here = (_wide(scene, sun, w, _HALFWAY) for w in (path.held["width_deg"], width_deg))
    other = np.divide(here, there, out=np.ones_like(sun), where=there > 0.0)
    return np.divide(whole * other, sun, out=np.ones_like(sun), where=sun > 0.0)
