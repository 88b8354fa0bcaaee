"""Heads of sensors: how they weigh the angle of light, and how much one of them makes of it against the others."""

import numpy as np

from analysis.cases.model import Floats
from analysis.explain.mechanisms.base import Branch, Mechanism, Stage
from analysis.explain.parameter import Parameter
from analysis.explain.scene import Scene


class CosineResponse(Mechanism):
    """Sensitivity falls (or rises) with the sensor's angle on the arm."""

    id = "cosine-response"
    stage = Stage.SENSORS
    leaves_out = "The sensors' angular response is not what was assumed."
    parameters = (Parameter("error_at_90deg", "1", "relative error at gamma = 90", -0.9, 0.9, 0.08, (-0.05, 0.05)),)
    source = "y (1 + c (1 - cos gamma)^n), n = 1 or (grazing light) 2; CIE/ISO 19476 f2 (directional response)"
    tie_breaker = "a small lamp at the aperture's centre"

    def branches(self, scene: Scene) -> tuple[Branch, ...]:
        """Losses that grow evenly, and at grazing incidence."""
        return Branch("", 1.0), Branch("grazing light", 2.0)

    def respond(self, scene: Scene, values: Floats, p: Floats, branch: Branch) -> Floats:
        """Weight by the angle."""
        law = (1.0 - np.cos(np.radians(np.nan_to_num(scene.readings.gamma_deg)))) ** branch.value
        return np.where(scene.is_gonio, values * (1.0 + p[0] * law), values)

    def statement(self, p: Floats, branch: Branch) -> str:
        """Say how much."""
        growing = "as 1 - cos of the angle" if branch.value == 1.0 else "most at grazing angles"
        return f"The sensors read {p[0]:+.1%} at 90° against nadir, growing {growing}."


class ChannelGain(Mechanism):
    """One sensor's sensitivity is wrong."""

    id = "channel-gain"
    stage = Stage.SENSORS
    leaves_out = "One sensor's sensitivity is wrong."
    parameters = (Parameter("error", "1", "relative error of the sensitivity", -0.9, 3.0, 0.12, (-0.08, 0.08)),)
    source = "y_i (1 + e) for one channel i"
    tie_breaker = "swap the sensor with its neighbour; for a lone instrument, another one beside it"
    kinds = ("goniometer", "sky")

    def branches(self, scene: Scene) -> tuple[Branch, ...]:
        """Each sensor of the goniometer, each camera and luminance meter."""
        r = scene.readings
        gamma = np.where(scene.is_gonio, r.gamma_deg, np.nan)
        ends = set(r.channel[(gamma == np.nanmin(gamma)) | (gamma == np.nanmax(gamma))]) if scene.is_gonio.any() else ()
        sensors = np.unique(r.channel[scene.is_gonio | scene.is_sky])
        return tuple(Branch(r.case.channels[k].id, int(k), outermost=k in ends) for k in sensors)

    def why_not(self, scene: Scene) -> str:
        """With one sensor on the arm its gain is the gain of every test; a lone camera's is no test's."""
        alone = np.any(scene.is_gonio) and len(self.branches(scene)) == 1
        return "there is only one channel" if alone else ""

    def respond(self, scene: Scene, values: Floats, p: Floats, branch: Branch) -> Floats:
        """Scale one channel."""
        return np.where(scene.readings.channel == branch.value, values * (1.0 + p[0]), values)

    def statement(self, p: Floats, branch: Branch) -> str:
        """Name the channel."""
        return f"The sensor of {branch.label} reads {p[0]:+.1%} against the others."
