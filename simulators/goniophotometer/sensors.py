"""From light on ten heads to volts at the converters: E [lx] -> s E [A] -> R s E [V], plus what is imperfect."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

Floats = NDArray[np.float64]

GAMMAS_DEG: Final = (0.0, 5.0, 15.0, 25.0, 35.0, 45.0, 55.0, 65.0, 75.0, 85.0)


class SensorResponse(Protocol):
    """What the heads make of the light; the hook for concealed physics of sensors."""

    def __call__(self, illuminance_lx: Floats, gamma_deg: Floats, c_deg: float) -> Floats:
        """Illuminance as each head responds to it [lx, (n,)], given the true one and the heads' true angles."""
        ...


def faithful_sensors(illuminance_lx: Floats, gamma_deg: Floats, c_deg: float) -> Floats:
    """Perfect heads."""
    return illuminance_lx


@dataclass(frozen=True, slots=True)
class ImperfectSensors:
    """Heads with the usual faults; each number may be one for all or one per head.

    Attributes
    ----------
    gain
        Reading over true value.
    offset_lx
        Reading in the dark [lx].
    exponent
        Response goes as illuminance to this power, 1 when linear; unchanged at 1000 lx.
    saturation_lx
        Highest illuminance the head can follow [lx].
    angular
        Further factor (n,) as a function of true gamma (n,) and C [deg]: cosine response, shields.
    """

    gain: ArrayLike = 1.0
    offset_lx: ArrayLike = 0.0
    exponent: ArrayLike = 1.0
    saturation_lx: ArrayLike = np.inf
    angular: Callable[[Floats, float], Floats] | None = None

    def __call__(self, illuminance_lx: Floats, gamma_deg: Floats, c_deg: float) -> Floats:
        """Illuminance as each head responds to it [lx]."""
        seen = illuminance_lx * (1.0 if self.angular is None else self.angular(gamma_deg, c_deg))
        bent = 1000.0 * (np.maximum(seen, 0.0) / 1000.0) ** np.asarray(self.exponent)
        followed = np.minimum(bent, np.asarray(self.saturation_lx))
        result: Floats = np.asarray(self.gain) * followed + np.asarray(self.offset_lx)
        return result


@dataclass(frozen=True, slots=True)
class SensorChain:
    """Electrical side of the heads; the first three may be one number for all or one per head.

    Attributes
    ----------
    sensitivity_a_per_lx
        Photocurrent per illuminance [A/lx]; about 0.3 nA/lx for the usual cosine-corrected silicon head.
    transimpedance_ohm
        Gain of the amplifier [V/A]; with 10 MΩ one lux is 3 mV, ±10 V reach to 3333 lx, and a step of the ±150 mV range
        is 0.0015 lx.
    offset_v
        Voltage in the dark [V].
    noise_v
        Standard deviation of one conversion's noise, referred to the amplifier's output [V].
    rail_v
        Where the amplifier saturates [V].
    """

    sensitivity_a_per_lx: float | tuple[float, ...] = 0.3e-9
    transimpedance_ohm: float | tuple[float, ...] = 1.0e7
    offset_v: float | tuple[float, ...] = 0.0
    noise_v: float = 10e-6
    rail_v: float = 11.0

    @property
    def sensitivity_v_per_lx(self) -> Floats:
        """What a calibration certificate would say [V/lx], () or (n,)."""
        product: Floats = np.multiply(self.sensitivity_a_per_lx, self.transimpedance_ohm)
        return product

    def volts(self, illuminance_lx: Floats) -> Floats:
        """Output of the amplifiers without noise [V, (n,)]."""
        volts = illuminance_lx * self.sensitivity_v_per_lx + np.asarray(self.offset_v)
        limited: Floats = np.clip(volts, -self.rail_v, self.rail_v)
        return limited
