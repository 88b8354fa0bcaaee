"""Dirt on a skylight: it takes light, the more the more grazing it comes or goes, and scatters some of that on."""

import numpy as np
from numpy.typing import NDArray
from scipy.special import expn

from analysis.cases.model import Floats
from analysis.explain.fields import GAMMA_DEG
from analysis.explain.mechanisms.base import Branch, Stage
from analysis.explain.mechanisms.retraced import Retraced, systems_on_the_arm
from analysis.explain.parameter import Parameter
from analysis.explain.scene import Light, Scene

SEEN = 0.6
"""Nobody overlooks dirt that takes more than this. (A scale of all readings by 1/3.1 was dirt of .8, for 10 nats.)"""
_DOME_SLANT = 1.3
"""Mean path through a shallow dome's pane over the straight one, of a sun 20 to 70° high."""
MOST_SCATTERED = 0.6
"""What lets more than this go on is no dirt but haze, or, as the sun's light goes on as the sky's, a split of the two.
(Of another author's cases a haze of 5.5 % and a split of 5 % had 137 and 168 nats as dirt that took 5 %, of which 95 %
went on.)"""


class Soiling(Retraced):
    """Dirt takes light, the more the more grazing it comes."""

    like_a_lens = True

    id = "soiling"
    stage = Stage.OPTICS
    leaves_out = "Dirt on the skylight takes light, more at grazing incidence."
    parameters = (Parameter("loss", "1", "transmittance lost at normal incidence", 0.0, 0.8, 0.12, (0.04, 0.15)),)
    needs = "sun and sky parts apart; sun angles"
    source = (
        "re-simulation with exp(-depth / cos) on the cover; else (1-l)^(1/cos z) for the beam, its mean over a uniform "
        "sky for the sky, (1-l)^1.3 for both under a dome; on the face towards the room, too, (1-l)^(1/cos gamma) of "
        "what leaves; scattering: of what is taken, a share goes on like the sky's light; Martin and Ruiz 2001, Sol. "
        "Energy Mater. 70"
    )
    scattered = Parameter(
        "scattered_on",
        "1",
        "share of what dirt takes that goes on scattered",
        0.0,
        MOST_SCATTERED,
        0.25,
        (0.2, 0.5),
        centre=0.4,
    )
    form_error = 0.4  # dirt is not even, nor alike at all angles, nor is it told how it scatters
    tie_breaker = "the same sky before and after cleaning"

    def why_not(self, scene: Scene) -> str:
        """The loss depends on the sun's angle."""
        r = scene.readings
        if not r.has_parts:
            return "the records do not give the sun and sky parts apart"
        return "sun angles are not given" if np.any(np.isnan(r.altitude_deg)) else ""

    def branches(self, scene: Scene) -> tuple[Branch, ...]:
        """All systems alike, or one of them; as traced, else under a pane, or a dome, where all light goes aslant.

        Nothing that is traced knows of light that dirt scatters on, nor of dirt on the face towards the room.
        """
        systems = systems_on_the_arm(scene)
        some = {"every system": None} | ({name: k for k, name in systems.items()} if len(systems) > 1 else {})
        ways = super().branches(scene) or (
            *(Branch(label, (k, "pane")) for label, k in some.items()),
            *(Branch(f"{label}, domed", (k, "dome")) for label, k in some.items()),
        )
        ways += tuple(Branch(f"{name}, both faces", (k, "faces")) for name, k in some.items())
        if not scene.knows_split:
            return ways
        scattering = (Branch(f"{name}, scattering", (k, "scattering"), stands_in=True) for name, k in some.items())
        return (*ways, *scattering)

    def parameters_in(self, scene: Scene, branch: Branch) -> tuple[Parameter, ...]:
        """Closed forms have the loss itself."""
        if not isinstance(branch.value, tuple):
            return super().parameters_in(scene, branch)
        return (*self.parameters, self.scattered) if branch.value[1] == "scattering" else self.parameters

    def absurd(self, p: Floats, branch: Branch) -> bool:
        """Whether anybody would see it; what a case's variant has changed is its own affair, and may be no loss."""
        return not branch.of_case and float(p[0]) > SEEN

    def illuminate(self, scene: Scene, light: Light, p: Floats, branch: Branch) -> None:
        """Weaken the beam by its path through the dirt, the sky by the mean."""
        if not isinstance(branch.value, tuple):
            super().illuminate(scene, light, p, branch)
            return
        system, cover = branch.value
        r = scene.readings
        hit = np.ones(len(r.case.tests), bool) if system is None else r.system == system
        if cover == "scattering":
            _scatter(scene, light, hit, float(p[0]), float(p[1]))
            return
        if cover == "faces":
            _as_it_leaves(light, hit, float(p[0]))
        if cover == "dome":
            beam = np.full(len(r), (1.0 - p[0]) ** _DOME_SLANT)
            sky = (1.0 - float(p[0])) ** _DOME_SLANT
        else:
            beam, sky = _through(p[0], np.cos(scene.sun_zenith_at))
        light.sun_factor = np.where(hit[r.test], light.sun_factor * beam, light.sun_factor)
        light.sky_factor = np.where(hit[r.test], light.sky_factor * sky, light.sky_factor)

    def statement(self, p: Floats, branch: Branch) -> str:
        """Say how much."""
        said = f"Dirt on the skylight ({branch.label}) takes {p[0]:.1%} at normal incidence and more at grazing"
        return f"{said}; {p[1]:.0%} of that goes on, scattered." if len(p) > 1 else f"{said}."


def _through(loss: float, cosine: Floats) -> tuple[Floats, float]:
    """What dirt leaves of a beam at incidences of some cosine (N,), and of a uniform sky."""
    beam = (1.0 - loss) ** (1.0 / np.maximum(cosine, 0.1))
    return np.asarray(beam), 2.0 * float(expn(3, -np.log1p(-loss)))  # ∫ 2 μ exp(-τ/μ) dμ = 2 E₃(τ)


def _as_it_leaves(light: Light, hit: NDArray[np.bool_], loss: float) -> None:
    """Weaken what leaves in the tests (T,) that are hit, by its path through dirt on the face towards the room."""
    left = np.where(hit[:, None], _through(loss, np.cos(np.radians(GAMMA_DEG)))[0], 1.0)[:, None, :]
    light.sun, light.sky = light.sun * left, light.sky * left


def _scatter(scene: Scene, light: Light, hit: NDArray[np.bool_], loss: float, share: float) -> None:
    """Take light from the tests (T,) that are hit; of what is taken, a share comes in as the sky's light does."""
    r = scene.readings
    beam, sky = _through(loss, np.sin(np.radians(r.altitude_deg)))
    like_sky = (scene.beam_lx / np.maximum(r.diffuse_lx, 1e-9) * share * (1.0 - beam))[:, None, None] * light.sky
    here = hit[:, None, None]
    light.sun = np.where(here, beam[:, None, None] * light.sun + like_sky, light.sun)
    light.sky = np.where(here, (sky + share * (1.0 - sky)) * light.sky, light.sky)
