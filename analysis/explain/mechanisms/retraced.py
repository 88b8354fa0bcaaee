"""Settings of the simulation that may have been wrong: shown by simulating again, never by a formula.

The case may bring variants (the same simulation run again with one thing changed); where it brings none but
describes its systems, labdaq's own simulator supplies the change as a ratio to its own baseline.
"""

import numpy as np

from analysis.cases.model import Floats
from analysis.explain.mechanisms.base import Branch, Mechanism
from analysis.explain.parameter import Parameter
from analysis.explain.scene import Light, Scene

NO_VARIANT = "the case brings no variant for it and does not describe its systems well enough to simulate one"


class Retraced(Mechanism):
    """Base: one branch per path of settings that can be had, a position along it as parameter."""

    form_error = 0.2  # what a change does is taken from another engine, or from another lens

    def why_not(self, scene: Scene) -> str:
        """There must be a re-simulation."""
        if self.id in scene.readings.case.setup.simulation.includes:
            return "the prediction already models it"
        return "" if self.branches(scene) else NO_VARIANT

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


WELL_AND_LENS = frozenset(
    {
        "lens-haze",
        "soiling",
        "lens-orientation",
        "lens-anisotropy",
        "wall-reflectance",
        "wall-scatter",
        "clock-offset",
    }
)
"""Mechanisms whose parameters are settings of a simulation."""
