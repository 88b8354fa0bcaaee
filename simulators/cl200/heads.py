"""Measuring heads on the roof: how each stands, and what it makes of the light."""

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cache
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from labdaq import directions
from simulators.world.observed import World

Floats = NDArray[np.float64]


class HeadResponse(Protocol):
    """How a head turns the world into a reading; the hook for concealed physics."""

    def illuminance(self, world: World, utc_ns: int) -> tuple[float, float]:
        """Illuminance as the head responds to it [lx]: from the sun's beam, and from the sky."""
        ...


@dataclass(frozen=True, slots=True)
class LevelHead:
    """A head that is what it should be, unless told otherwise.

    Attributes
    ----------
    shaded_half_angle_deg
        Half angle of the disc that hides the sun and the sky around it [deg]; 0 without a disc.
    tilt_deg, tilt_azimuth_deg
        How far, and towards which azimuth, the head's axis leans from the zenith [deg].
    gain
        Reading over true value.
    cosine
        Response over that of a perfect cosine receiver, as a function of the angle of incidence [deg, array]; ``None``
        is perfect.
    """

    shaded_half_angle_deg: float = 0.0
    tilt_deg: float = 0.0
    tilt_azimuth_deg: float = 0.0
    gain: float = 1.0
    cosine: Callable[[Floats], Floats] | None = None

    def illuminance(self, world: World, utc_ns: int) -> tuple[float, float]:
        """Beam and sky part [lx]."""
        normal = directions.sky_vector(90.0 - self.tilt_deg, self.tilt_azimuth_deg)
        total = world.roof_illuminance(normal, utc_ns, self.shaded_half_angle_deg)
        sun = world.sun(utc_ns)
        towards_sun = directions.sky_vector(sun.altitude_deg, sun.azimuth_deg)
        beam = 0.0
        if sun.altitude_deg > 0 and self.shaded_half_angle_deg <= 0:
            beam = sun.normal_illuminance_lx * max(0.0, float(normal @ towards_sun))
        sky = max(0.0, total - beam)
        if self.cosine is not None:
            incidence = np.degrees(np.arccos(np.clip(normal @ towards_sun, -1.0, 1.0)))
            beam *= float(self.cosine(np.array([incidence]))[0])
            sky += self._sky_correction(world, utc_ns, normal, towards_sun, self.cosine)
        return self.gain * beam, self.gain * sky

    def _sky_correction(
        self, world: World, utc_ns: int, normal: Floats, towards_sun: Floats, cosine: Callable[[Floats], Floats]
    ) -> float:
        """Sum of L cos θ (f(θ) - 1) dω over the unshaded sky: what the error in the cosine adds [lx]."""
        towards, solid_angle = _hemisphere()
        cos = np.clip(towards @ normal, 0.0, 1.0)
        luminance = world.sky_luminance(towards, utc_ns)
        if self.shaded_half_angle_deg > 0:
            hidden = directions.angle_between(towards, towards_sun) < self.shaded_half_angle_deg
            luminance = np.where(hidden, 0.0, luminance)
        error = cosine(np.degrees(np.arccos(cos))) - 1.0
        return float(np.sum(luminance * cos * error) * solid_angle)


@cache
def _hemisphere() -> tuple[Floats, float]:
    """Directions (n, 3) of the upper hemisphere in rings of equal height, and the solid angle of each [sr]."""
    rings, sectors = 40, 90
    z = (np.arange(rings) + 0.5) / rings
    turn = 2.0 * np.pi * (np.arange(sectors) + 0.5) / sectors
    height, around = (a.ravel() for a in np.meshgrid(z, turn, indexing="ij"))
    across = np.sqrt(1.0 - height**2)
    towards = np.stack([across * np.cos(around), across * np.sin(around), height], axis=-1)
    return towards, 2.0 * np.pi / (rings * sectors)


@dataclass(frozen=True, slots=True)
class Head:
    """One measuring head.

    Attributes
    ----------
    number
        Set on its rotary switches: 0 to 29.
    response
        How it stands in the world.
    error
        A hardware error it reports with every reply: ``1`` lost power, ``2`` or ``3`` EEPROM; empty when sound.
    """

    number: int = 0
    response: HeadResponse = field(default_factory=LevelHead)
    error: str = ""
