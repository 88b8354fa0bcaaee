"""How what is concealed in instruments gets into their emulators: options in, other options out."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from simulators.cl200 import ChromaMeterOptions, LevelHead
from simulators.goniophotometer import BentArm, GoniophotometerOptions
from simulators.hidden.effects import Hidden
from simulators.hidden.heads import HeadFaults, angular_response, read

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class SpoiltHeads:
    """Heads with faults, as the goniophotometer's emulator takes them.

    With an angular response the heads all face straight down, and the laboratory corrects for the cosine of that.
    """

    faults: HeadFaults

    def __call__(self, illuminance_lx: Floats, gamma_deg: Floats, c_deg: float) -> Floats:
        """Illuminance as each head responds to it [lx]."""
        level = illuminance_lx
        if self.faults.response:
            incidence = np.cos(np.radians(self.faults.corrected_tilt * gamma_deg))
            level = level * angular_response(incidence, self.faults.response, self.faults.response_form)
        still = np.zeros(len(level))
        return read(level, still, np.arange(len(level)), still, self.faults)


def altered(hidden: Hidden, options: Any) -> Any:
    """Options of an emulator with what is concealed in that instrument; others are returned as they are."""
    if isinstance(options, GoniophotometerOptions):
        return _goniophotometer(hidden, options)
    if isinstance(options, ChromaMeterOptions) and hidden.source.diffuse_shift:
        return _shaded_meters(hidden.source.diffuse_shift, options)
    return options


def _goniophotometer(hidden: Hidden, options: GoniophotometerOptions) -> GoniophotometerOptions:
    arm = hidden.arm
    if arm.gamma_offset_deg or arm.c_offset_deg or arm.mirrored or arm.backlash_deg:
        bent = BentArm(arm.gamma_offset_deg, arm.c_offset_deg, 2.0 * arm.backlash_deg, arm.mirrored)
        options = replace(options, arm=bent)
    if arm.swapped is not None:
        wiring = list(options.wiring or range(len(options.gammas_deg)))
        a, b = arm.swapped
        wiring[a], wiring[b] = wiring[b], wiring[a]
        options = replace(options, wiring=tuple(wiring))
    if hidden.heads != HeadFaults():
        options = replace(options, sensors=SpoiltHeads(hidden.heads))
    return options


def _shaded_meters(shift: float, options: ChromaMeterOptions) -> ChromaMeterOptions:
    """Heads under a disc read too little by as much as the true diffuse is more."""
    heads = tuple(
        replace(head, response=replace(head.response, gain=head.response.gain / (1.0 + shift)))
        if isinstance(head.response, LevelHead) and head.response.shaded_half_angle_deg > 0.0
        else head
        for head in options.heads
    )
    return replace(options, heads=heads)
