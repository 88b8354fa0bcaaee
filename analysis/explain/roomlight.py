"""Light that the dark room's surfaces send back to the sensors, as a map of the aperture's distribution.

All bounces between matt patches, as `analysis.simulate.room` works them out. The ceiling, which the aperture itself
does not light, is as the walls are: sensors look up at it.
"""

from dataclasses import dataclass

import numpy as np
from scipy import sparse

from analysis.cases.model import USUAL_ARM_M, CaseFile, Floats, Goniometer
from analysis.explain.fields import C_DEG, GAMMA_DEG
from analysis.explain.geometry import bilinear
from analysis.simulate.room import Patches, Room, gathered, patches_of
from labdaq import directions

_PER_ARM = 2.11
"""Edge of a room that a case does not describe, over the arm's length: the report's is a cube of 5.486 m, for 2.6."""
_RINGS = np.arange(0.0, 90.1, 7.5)  # the light from the room varies slowly from sensor to sensor
_PLANES = np.arange(0.0, 360.0, 22.5)


@dataclass(frozen=True)
class DarkRoom:
    """What the arm stands in, as far as a case says.

    Attributes
    ----------
    size_m
        East-west, north-south, height [m].
    distance_m, half_angle_deg
        From the aperture's centre to the sensors, and what they take light within.
    supposed
        Whether size or distance is not told, and the report's laboratory stands for it.
    """

    size_m: tuple[float, float, float]
    distance_m: float
    half_angle_deg: float
    supposed: bool

    @classmethod
    def of(cls, setup: CaseFile) -> "DarkRoom | None":
        """The case's room; ``None`` where the arm's sensors, at nadir at least, are not inside it."""
        arm = setup.goniometer or Goniometer()
        distance = arm.distance_m or USUAL_ARM_M
        edge = _PER_ARM * distance
        size = setup.room.size_m if setup.room else (edge, edge, edge)
        supposed = setup.room is None or arm.distance_m is None
        return cls(size, distance, arm.sensor_half_angle_deg, supposed) if distance < size[2] else None


@dataclass(frozen=True)
class RoomLight:
    """Linear maps from a distribution to the room's patches, and from these to the sensors.

    Attributes
    ----------
    size_m
        East-west, north-south, height [m].
    lit : shape (K, cells)
        Illuminance of the patches by the aperture [lx/cd].
    seen : shape (sensors, K)
        d²E [cd] at the sensors of all planes and rings per exitance of a patch [lm/m²].
    """

    size_m: tuple[float, float, float]
    lit: sparse.csr_matrix
    seen: sparse.csr_matrix

    def added(self, field: Floats, wall_reflectance: float, floor_reflectance: float) -> Floats:
        """Light added at each direction (T, P, G) [cd] for fields (T, P, G) [cd]."""
        room = Room(self.size_m, wall_reflectance, floor_reflectance, wall_reflectance)
        sent = room.exitance_soon(np.asarray(self.lit @ field.reshape(len(field), -1).T))
        return _refine(np.asarray(self.seen @ sent).T.reshape(len(field), len(_PLANES), -1))


def inside(rings_deg: Floats, size_m: tuple[float, float, float], distance_m: float) -> Floats:
    """The rings of gamma [deg] on which an arm's sensors are between the walls in every plane."""
    return rings_deg[distance_m * np.sin(np.radians(rings_deg)) < 0.5 * min(size_m[:2])]


def room_light(size_m: tuple[float, float, float], distance_m: float, half_angle_deg: float) -> RoomLight:
    """The maps of a room for sensors on the arm.

    Sensors face the aperture's centre and take light within ``half_angle_deg`` [deg], cosine-weighted. Beyond the walls
    there are none: there the last ring before them counts.
    """
    sensors = tuple((float(g), float(c)) for c in _PLANES for g in inside(_RINGS, size_m, distance_m))
    seen = gathered(size_m, sensors, distance_m, half_angle_deg, 0.0) * distance_m**2
    return RoomLight(size_m, _lit(patches_of(size_m)), sparse.csr_matrix(seen))


def _lit(patches: Patches) -> sparse.csr_matrix:
    """Mean illuminance of patches by the aperture in the origin [lx/cd]; (K, cells)."""
    count, each, _ = patches.points.shape
    to = patches.points.reshape(-1, 3)
    distance = np.linalg.norm(to, axis=1)
    cosine = np.maximum(-np.sum(to * np.repeat(patches.normal, each, axis=0), axis=1), 0.0) / distance
    points = sparse.diags(cosine / distance**2) @ bilinear(*directions.gamma_c(to))
    return sparse.csr_matrix(sparse.kron(sparse.eye(count), np.full((1, each), 1.0 / each)) @ points)


def _refine(coarse: Floats) -> Floats:
    """From the sensor grid (T, planes, rings) to the field grid (T, P, G), linearly; constant beyond the last ring."""
    y = C_DEG / _PLANES[1]
    j, v = y.astype(np.intp), (y - np.floor(y))[None, :, None]
    around = (1 - v) * coarse[:, j] + v * coarse[:, (j + 1) % len(_PLANES)]
    x = np.minimum(GAMMA_DEG / _RINGS[1], coarse.shape[2] - 1.000001)
    i, u = x.astype(np.intp), (x - np.floor(x))[None, None, :]
    return np.asarray((1 - u) * around[:, :, i] + u * around[:, :, i + 1])
