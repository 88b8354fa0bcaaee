"""Light that the dark room's floor and walls send back to the sensors.

The first bounce is integrated over the surfaces as they are lit by the aperture's distribution; all later ones are
taken as those of an integrating sphere of the room's area (Ulbricht). In a black room the first bounce is nine
tenths of it.
"""

from dataclasses import dataclass

import numpy as np

from analysis.cases.model import Floats
from analysis.explain.fields import C_DEG, GAMMA_DEG
from analysis.explain.geometry import bilinear, room_patches
from labdaq import directions

_RINGS = np.arange(0.0, 90.1, 7.5)  # the light from the room varies slowly from sensor to sensor
_PLANES = np.arange(0.0, 360.0, 22.5)


@dataclass(frozen=True)
class RoomLight:
    """Linear map from a distribution to what the room adds at the sensors.

    Attributes
    ----------
    floor, walls : shape (P*G of the sensor grid, cells)
        d²E [cd] at the sensors per reflectance and per candela of the field.
    floor_flux, walls_flux : shape (cells,)
        Flux that reaches floor and walls [lm/cd].
    area_m2
        Of floor, walls and ceiling together.
    """

    floor: Floats
    walls: Floats
    floor_flux: Floats
    walls_flux: Floats
    area_m2: float
    spread: float

    def added(self, field: Floats, wall_reflectance: float, floor_reflectance: float) -> Floats:
        """Light added at each direction (T, P, G) [cd] for fields (T, P, G) [cd]."""
        flat = field.reshape(len(field), -1).T
        first = wall_reflectance * (self.walls @ flat) + floor_reflectance * (self.floor @ flat)
        bounced = wall_reflectance * (self.walls_flux @ flat) + floor_reflectance * (self.floor_flux @ flat)
        mean = (4 * wall_reflectance + floor_reflectance + wall_reflectance) / 6  # cube: four walls, floor, ceiling
        first = first + self.spread * mean * bounced / (self.area_m2 * (1.0 - mean))
        coarse = first.T.reshape(len(field), len(_PLANES), len(_RINGS))
        return _refine(coarse)


def room_light(size_m: tuple[float, float, float], distance_m: float, half_angle_deg: float) -> RoomLight:
    """Integrate the first bounce of a room (east-west, north-south, height [m]) for sensors on the arm.

    Sensors face the aperture's centre and take light within ``half_angle_deg`` [deg], cosine-weighted.
    """
    gamma, c = np.meshgrid(_RINGS, _PLANES)
    aim = directions.vector(gamma, c).reshape(-1, 3)
    sensors = distance_m * aim
    surfaces = room_patches(size_m)
    matrices: dict[str, Floats] = {}
    flux: dict[str, Floats] = {}
    for name, (centre, normal, area) in surfaces.items():
        distance2 = np.sum(centre**2, axis=1)
        cos_in = np.maximum(-np.sum(centre * normal, axis=1), 0.0) / np.sqrt(distance2)
        lit = bilinear(*directions.gamma_c(centre))
        onto = cos_in / distance2  # lx per cd
        to_sensor = sensors[:, None, :] - centre[None, :, :]
        length2 = np.sum(to_sensor**2, axis=2)
        length = np.sqrt(length2)
        cos_out = np.maximum(np.einsum("spk,pk->sp", to_sensor, normal) / length, 0.0)
        cos_at = np.einsum("spk,sk->sp", to_sensor, aim) / length
        cos_at = np.where(cos_at > np.cos(np.radians(half_angle_deg)), cos_at, 0.0)
        transfer = cos_out * cos_at / (np.pi * length2) * area
        matrices[name] = distance_m**2 * np.asarray((transfer * onto) @ lit)
        flux[name] = np.asarray((onto * area) @ lit)
    width, depth, height = size_m
    return RoomLight(
        floor=matrices["floor"],
        walls=matrices["walls"],
        floor_flux=flux["floor"],
        walls_flux=flux["walls"],
        area_m2=2 * (width * depth + width * height + depth * height),
        spread=distance_m**2 * np.sin(np.radians(half_angle_deg)) ** 2,
    )


def _refine(coarse: Floats) -> Floats:
    """From the sensor grid (T, planes, rings) to the field grid (T, P, G), linearly."""
    y = C_DEG / _PLANES[1]
    j, v = y.astype(np.intp), (y - np.floor(y))[None, :, None]
    around = (1 - v) * coarse[:, j] + v * coarse[:, (j + 1) % len(_PLANES)]
    x = np.minimum(GAMMA_DEG / _RINGS[1], len(_RINGS) - 1.000001)
    i, u = x.astype(np.intp), (x - np.floor(x))[None, None, :]
    return np.asarray((1 - u) * around[:, :, i] + u * around[:, :, i + 1])
