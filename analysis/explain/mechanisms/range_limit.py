"""The end of a roof meter's range: a hard stop, or a response that flattens towards it."""

from dataclasses import replace

import numpy as np

from analysis.cases.model import Floats
from analysis.explain.mechanisms.base import Branch, Mechanism, Reported, Stage, Term, told
from analysis.explain.mechanisms.roof_meters import of_channel, roof_channels
from analysis.explain.parameter import Parameter
from analysis.explain.scene import Scene


class MeterRangeLimit(Mechanism):
    """The meter cannot read beyond the end of its range."""

    id = "meter-range-limit"
    stage = Stage.SENSORS
    leaves_out = "An illuminance meter was near or beyond the end of its range."
    parameters = (
        Parameter(
            "excess", "1", "largest prediction over the end of the range, minus one", 0.0, 3.0, 0.3, (0.03, 0.15, 0.5)
        ),
    )
    source = (
        "min(E, Y), Y(1 - exp(-E/Y)), E/(1 + E/Y), E/(1 + (E/Y)^n)^(1/n), Y the range's end; report ch. 3 (9 999 fc)"
    )
    tie_breaker = "a second meter with a higher range, or a neutral filter"
    kinds = ("roof",)
    soft = Parameter(
        "compression", "1", "largest prediction over the end of the range", 0.0, 3.0, 0.3, (0.02, 0.1, 0.4)
    )
    at_knee = Parameter("compression", "1", soft.meaning, 0.0, 3.0, 0.5, (0.8, 1.1), centre=0.5)
    sharpness = Parameter("sharpness", "1", "n: how suddenly the knee bends", 2.0, 30.0, 6.0, (4.0, 10.0), centre=6.0)

    def why_not(self, scene: Scene) -> str:
        """Only where roof meters are read."""
        return "" if np.any(scene.is_roof) else "there is no illuminance meter among the channels"

    def branches(self, scene: Scene) -> tuple[Branch, ...]:
        """Each meter, with a hard or a soft end."""
        found = []
        for way in roof_channels(scene):
            facts = {"top": float(np.max(scene.readings.simulated[of_channel(scene, way.value)]))}
            found.append(replace(way, facts=facts))
            for form in ("gradual", "exponential", "knee"):
                found.append(Branch(f"{way.label}, {form}", (way.value, form), facts))
        return tuple(found)

    def parameters_in(self, scene: Scene, branch: Branch) -> tuple[Parameter, ...]:
        """Excess over a hard end, or nearness to a soft one; a knee may be more or less sharp."""
        if not isinstance(branch.value, tuple):
            return self.parameters
        return (self.at_knee, self.sharpness) if branch.value[1] == "knee" else (self.soft,)

    def respond(self, scene: Scene, values: Floats, p: Floats, branch: Branch) -> Floats:
        """Cut or compress the meter's readings towards the end of its range."""
        top = branch.facts["top"]
        if not isinstance(branch.value, tuple):
            return np.where(of_channel(scene, branch.value), np.minimum(values, top / (1.0 + p[0])), values)
        channel, form = branch.value
        if p[0] <= 0.0:
            return values
        acts = of_channel(scene, channel) & (values > 0)
        return np.where(acts, _compressed(np.maximum(values, 0.0), top / float(p[0]), form, *p[1:]), values)

    def report(self, p: Floats, sd: Floats, term: Term) -> Reported:
        """The end of the range is what a data sheet gives; the loss at the brightest is the same for all forms."""
        top, x, u = term.branch.facts["top"], float(p[0]), float(sd[0])
        if not isinstance(term.branch.value, tuple):
            end, loss, slope = top / (1.0 + x), x / (1.0 + x), 1.0 / (1.0 + x) ** 2
            end_sd = end * u / (1.0 + x)
        else:
            end = top / max(x, 1e-6)
            end_sd = end * u / max(x, 1e-6)
            form, *more = term.branch.value[1], *p[1:]
            loss = 1.0 - float(_compressed(np.array([top]), end, form, *more)[0]) / top
            slope = (1.0 - float(_compressed(np.array([top]), top / (x + 1e-4), form, *more)[0]) / top - loss) / 1e-4
        return {
            "range_end_lx": told(end, end_sd, "lx"),
            "loss_at_brightest": told(loss, abs(slope) * u, "1"),
            **super().report(p, sd, term),
        }

    def statement(self, p: Floats, branch: Branch) -> str:
        """Say by how much."""
        if isinstance(branch.value, tuple):
            return f"{branch.label}: the brightest daylight reached {p[0]:.0%} of the end of the meter's range."
        return f"{branch.label} was at the end of its range: the brightest daylight was {p[0]:.0%} beyond it."


def _compressed(values: Floats, end: float, form: str, sharpness: float = 1.0) -> Floats:
    """Readings of a meter whose response flattens towards ``end``."""
    share = values / end
    if form == "exponential":
        return np.asarray(end * -np.expm1(-share))
    n = sharpness if form == "knee" else 1.0
    return np.asarray(end * share / (1.0 + share**n) ** (1.0 / n))
