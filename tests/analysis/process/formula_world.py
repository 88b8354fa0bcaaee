"""A world by formula, so that what analysis finds can be compared with what is known: an even sky with a glow about
the sun, and a skylight of two closed-form lobes. It has nothing in common with the traced world but the sun's path.
"""

import math

import numpy as np
from numpy.typing import NDArray

from labdaq import directions
from simulators.hidden.light import Site
from simulators.world.observed import SunSeen
from simulators.world.sunpath import SunPath

Floats = NDArray[np.float64]
UP = np.array([0.0, 0.0, 1.0])


class FormulaWorld:
    """Levels like those of a clear summer morning; the glow is a Gaussian of the chord to the sun."""

    distance_m = 2.6
    glow_rad = math.radians(12.0)
    lobe_rad = math.radians(15.0)
    through_m2 = 0.5 * 0.6096**2

    def __init__(self) -> None:
        self.path = SunPath(Site(34.2176, -82.1084, 180.0))
        self._around, self._weight = _cap(5.0 * 12.0)

    def sun(self, utc_ns: int) -> SunSeen:
        altitude, azimuth = self.path.angles(utc_ns)
        return SunSeen(altitude, azimuth, 120_000.0 * math.exp(-0.21 / math.sin(math.radians(altitude))))

    def _towards_sun(self, utc_ns: int) -> Floats:
        return directions.sky_vector(*self.path.angles(utc_ns))

    def _level(self, utc_ns: int) -> float:
        """Diffuse illuminance without the glow [lx]; rises with the sun."""
        return 13_000.0 * math.sqrt(math.sin(math.radians(self.path.angles(utc_ns)[0])))

    def _glow(self, towards: Floats, towards_sun: Floats) -> Floats:
        chord2 = 2.0 - 2.0 * (towards @ towards_sun)
        return np.asarray(3.0 * np.exp(-chord2 / (2.0 * self.glow_rad**2)))

    def sky_luminance(self, towards: Floats, utc_ns: int) -> Floats:
        towards = np.asarray(towards, dtype=np.float64)
        even = self._level(utc_ns) / math.pi
        return np.where(towards[..., 2] > 0.0, even * (1.0 + self._glow(towards, self._towards_sun(utc_ns))), 0.0)

    def roof_illuminance(self, normal: Floats, utc_ns: int, shaded_half_angle_deg: float = 0.0) -> float:
        """For a level sensor: the even sky, a sum over the glow, the beam; less a disc's part of them."""
        assert np.allclose(normal, UP)
        sun, level = self._towards_sun(utc_ns), self._level(utc_ns)
        side = np.cross(sun, [0.0, 1.0, 0.0])
        side /= np.linalg.norm(side)
        around = self._around @ np.stack([side, np.cross(sun, side), sun])
        seen = np.clip(around[:, 2], 0.0, None) * self._weight
        seen = seen * (around @ sun <= math.cos(math.radians(shaded_half_angle_deg)))
        total = level + level / math.pi * float(np.sum(self._glow(around, sun) * seen))
        if shaded_half_angle_deg > 0.0:
            return total - level * math.sin(math.radians(shaded_half_angle_deg)) ** 2 * float(sun[2])
        return total + self.sun(utc_ns).normal_illuminance_lx * float(sun[2])

    def candela(self, gamma_deg: Floats, c_deg: float, utc_ns: int) -> Floats:
        """Half of the beam goes on as a lobe; everything else leaves like a Lambertian surface's [cd]."""
        towards_sun = self._towards_sun(utc_ns)
        beam = self.sun(utc_ns).normal_illuminance_lx * float(towards_sun[2])
        towards = directions.vector(gamma_deg, c_deg)
        cosine = np.clip(-towards[..., 2], 0.0, None)
        spread = (self.roof_illuminance(UP, utc_ns) - 0.5 * beam) * cosine / math.pi
        width2 = 2.0 * self.lobe_rad**2
        lobe = np.exp(-(2.0 + 2.0 * (towards @ towards_sun)) / width2) / (math.pi * width2)
        return np.asarray(self.through_m2 * (spread + 0.5 * beam * lobe * (cosine > 0.0)))

    def room_illuminance(self, gamma_deg: Floats, c_deg: float, utc_ns: int) -> Floats:
        return self.candela(gamma_deg, c_deg, utc_ns) / self.distance_m**2


def _cap(outer_deg: float) -> tuple[Floats, Floats]:
    """Directions (n, 3) about the z axis and their solid angles (n,): midpoints in the polar angle and the azimuth."""
    edges = np.radians(np.linspace(0.0, outer_deg, 241))  # a disc of 5 degrees ends on an edge
    theta, ring = (edges[1:] + edges[:-1]) / 2.0, np.cos(edges[:-1]) - np.cos(edges[1:])
    turn = 2.0 * np.pi * (np.arange(72) + 0.5) / 72
    polar, phi = (a.ravel() for a in np.meshgrid(theta, turn, indexing="ij"))
    weight = np.repeat(ring * 2.0 * np.pi / 72, 72)
    return np.stack([np.sin(polar) * np.cos(phi), np.sin(polar) * np.sin(phi), np.cos(polar)], axis=-1), weight
