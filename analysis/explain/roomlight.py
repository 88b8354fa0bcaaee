"""Light that the dark room's floor, walls and ceiling send back to the sensors.

Sensors see the first bounce from fine patches of floor and walls as the aperture's distribution lights them, and all
later ones as the radiosity of coarser patches of the whole room (Goral et al. 1984, doi 10.1145/964965.808601). The
ceiling, which the aperture itself does not light, is as the walls are: sensors look up at it.
"""

from dataclasses import dataclass

import numpy as np
from scipy import sparse

from analysis.cases.model import Floats
from analysis.explain.fields import C_DEG, GAMMA_DEG
from analysis.explain.geometry import Patches, bilinear, room_patches
from labdaq import directions

_RINGS = np.arange(0.0, 90.1, 7.5)  # the light from the room varies slowly from sensor to sensor
_PLANES = np.arange(0.0, 360.0, 22.5)
_FINE, _COARSE = 28, 7  # patches across a surface: as sensors see them, and as they light each other
_TURNS = 30  # enough for closed form factors: a cube's are right to 1e-9 after them


@dataclass(frozen=True)
class RoomLight:
    """Linear maps from a distribution to what the room adds at the sensors.

    Attributes
    ----------
    floor, walls : shape (P*G of the sensor grid, cells)
        d²E [cd] at the sensors per reflectance and per candela of the field, of the first bounce.
    floor_flux, walls_flux : shape (cells,)
        Flux that reaches floor and walls [lm/cd].
    lit : shape (K, cells)
        Illuminance of the coarse patches [lx/cd].
    factors : shape (K, K)
        Form factors between them.
    seen : shape (P*G of the sensor grid, K)
        d²E [cd] at the sensors per exitance of a patch [lm/m²].
    is_floor : shape (K,)
        Whether a patch is the floor's.
    """

    floor: Floats
    walls: Floats
    floor_flux: Floats
    walls_flux: Floats
    lit: sparse.csr_matrix
    factors: Floats
    seen: Floats
    is_floor: Floats

    def added(self, field: Floats, wall_reflectance: float, floor_reflectance: float) -> Floats:
        """Light added at each direction (T, P, G) [cd] for fields (T, P, G) [cd]."""
        flat = field.reshape(len(field), -1).T
        first = wall_reflectance * (self.walls @ flat) + floor_reflectance * (self.floor @ flat)
        sends = np.where(self.is_floor, floor_reflectance, wall_reflectance)
        lit = self.lit @ flat
        later = np.linalg.solve(np.eye(len(sends)) - self.factors * sends, lit) - lit
        coarse = (first + self.seen @ (sends[:, None] * later)).T
        return _refine(coarse.reshape(len(field), len(_PLANES), len(_RINGS)))


def room_light(size_m: tuple[float, float, float], distance_m: float, half_angle_deg: float) -> RoomLight:
    """Work out the bounces of a room (east-west, north-south, height [m]) for sensors on the arm.

    Sensors face the aperture's centre and take light within ``half_angle_deg`` [deg], cosine-weighted.
    """
    gamma, c = np.meshgrid(_RINGS, _PLANES)
    aim = directions.vector(gamma, c).reshape(-1, 3)
    fine, coarse = room_patches(size_m, _FINE), room_patches(size_m, _COARSE)
    seen = {name: _at_sensors(patches, distance_m, aim, half_angle_deg) for name, patches in fine.items()}
    lit = {name: _lit(patches) for name, patches in fine.items()}
    mean = {name: _coarser(len(patches.area_m2) // _FINE**2) for name, patches in fine.items()}
    return RoomLight(
        floor=np.asarray(seen["floor"] @ lit["floor"]),
        walls=np.asarray(seen["walls"] @ lit["walls"]),
        floor_flux=np.asarray(fine["floor"].area_m2 @ lit["floor"]),
        walls_flux=np.asarray(fine["walls"].area_m2 @ lit["walls"]),
        lit=sparse.csr_matrix(sparse.vstack([mean[name] @ lit[name] for name in fine])),
        factors=_form_factors(list(coarse.values())),
        seen=np.hstack([seen[name] @ (mean[name].T > 0) for name in fine]),
        is_floor=np.concatenate([np.full(len(p.area_m2), name == "floor") for name, p in coarse.items()]),
    )


def _coarser(sheets: int) -> sparse.csr_matrix:
    """Mean over the fine patches in each coarse one; (coarse, fine) patches of so many sheets."""
    half = sparse.kron(sparse.eye(_COARSE), np.full((1, _FINE // _COARSE), _COARSE / _FINE))
    return sparse.csr_matrix(sparse.kron(sparse.eye(sheets), sparse.kron(half, half)))


def _lit(patches: Patches) -> sparse.csr_matrix:
    """Illuminance of patches by the aperture in the origin [lx/cd]; (K, cells)."""
    distance = np.linalg.norm(patches.centre, axis=1)
    cosine = np.maximum(-np.sum(patches.centre * patches.normal, axis=1), 0.0) / distance
    return sparse.csr_matrix(sparse.diags(cosine / distance**2) @ bilinear(*directions.gamma_c(patches.centre)))


def _at_sensors(patches: Patches, distance_m: float, aim: Floats, half_angle_deg: float) -> Floats:
    """What sensors see of patches: d²E [cd] per exitance [lm/m²]; (sensors, K)."""
    to_sensor = distance_m * aim[:, None, :] - patches.centre
    length2 = np.maximum(np.sum(to_sensor**2, axis=2), 1e-9)
    length = np.sqrt(length2)
    leaving = np.maximum(np.einsum("spk,pk->sp", to_sensor, patches.normal) / length, 0.0)
    arriving = np.einsum("spk,sk->sp", to_sensor, aim) / length
    arriving = np.where(arriving > np.cos(np.radians(half_angle_deg)), arriving, 0.0)
    return np.asarray(distance_m**2 * leaving * arriving / (np.pi * length2) * patches.area_m2)


def _form_factors(surfaces: list[Patches]) -> Floats:
    """Form factors from centre to centre, balanced until they are reciprocal and all that leaves a patch arrives."""
    centre, normal = (np.concatenate([getattr(s, name) for s in surfaces]) for name in ("centre", "normal"))
    area = np.concatenate([s.area_m2 for s in surfaces])
    ray = centre[None, :, :] - centre[:, None, :]
    length2 = np.sum(ray**2, axis=2) + np.eye(len(area))
    leaving = np.maximum(np.einsum("ijk,ik->ij", ray, normal), 0.0)
    arriving = np.maximum(-np.einsum("ijk,jk->ij", ray, normal), 0.0)
    both = np.outer(area, area)
    exchange = (
        both * leaving * arriving / (length2 * (np.pi * length2 + np.sqrt(both)))
    )  # as discs: neighbours are near
    weight = np.ones(len(area))
    for _ in range(_TURNS):
        weight = np.sqrt(weight * area / (exchange @ weight))
    return np.asarray(weight[:, None] * exchange * weight / area[:, None])


def _refine(coarse: Floats) -> Floats:
    """From the sensor grid (T, planes, rings) to the field grid (T, P, G), linearly."""
    y = C_DEG / _PLANES[1]
    j, v = y.astype(np.intp), (y - np.floor(y))[None, :, None]
    around = (1 - v) * coarse[:, j] + v * coarse[:, (j + 1) % len(_PLANES)]
    x = np.minimum(GAMMA_DEG / _RINGS[1], len(_RINGS) - 1.000001)
    i, u = x.astype(np.intp), (x - np.floor(x))[None, None, :]
    return np.asarray((1 - u) * around[:, :, i] + u * around[:, :, i + 1])
