"""Where the goniophotometer's sensors really are, which way they look, and when.

Nominal: ten sensors on a half-circle arm about the aperture's centre, facing it; the arm turns through the C-planes.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from labdaq.directions import vector

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class ArmFaults:
    """How the arm differs from its drawing; all zero for a true one.

    Attributes
    ----------
    gamma_offset_deg, c_offset_deg
        Real minus nominal angle of every sensor, of every plane [deg].
    mirrored
        The arm turns the other way: what is called C is really 360 - C.
    swapped
        Two sensors whose readings come under each other's name (indices), or none.
    sag_deg
        The arm bends under its weight: real gamma is smaller by this much times sin γ [deg].
    backlash_deg
        The planes lag behind by this much in the direction of travel [deg].
    aperture_shift_m
        Where the aperture's centre really is in the arm's frame: east, north, up [m].
    aim_droop
        Share of γ by which a sensor's axis turns from the aperture towards straight up (0: faces the aperture).
    """

    gamma_offset_deg: float = 0.0
    c_offset_deg: float = 0.0
    mirrored: bool = False
    swapped: tuple[int, int] | None = None
    sag_deg: float = 0.0
    backlash_deg: float = 0.0
    aperture_shift_m: tuple[float, float, float] = (0.0, 0.0, 0.0)
    aim_droop: float = 0.0


@dataclass(frozen=True)
class Sensors:
    """Sensors as they are during one scan; all arrays (n, ...), n = planes x sensors, plane by plane.

    Attributes
    ----------
    places : shape (n, 3) [m]
        From the aperture's true centre.
    aims : shape (n, 3)
        Unit vectors along the sensors' axes.
    incidence : shape (n,)
        Cosine between the axis and the direction of the aperture's centre.
    """

    places: Floats
    aims: Floats
    incidence: Floats

    @property
    def distances(self) -> Floats:
        """Distance of each sensor from the aperture's centre [m]."""
        return np.asarray(np.linalg.norm(self.places, axis=-1))

    @property
    def directions(self) -> Floats:
        """Unit vectors from the aperture's centre to each sensor."""
        return self.places / self.distances[:, None]


def sensors(gammas_deg: Floats, planes_deg: Floats, distance_m: float, faults: ArmFaults) -> Sensors:
    """Return the sensors for nominal gammas (g,) in nominal planes (p,) in the order they are visited."""
    gamma = np.asarray(gammas_deg, dtype=np.float64)
    planes = np.asarray(planes_deg, dtype=np.float64)
    if faults.swapped is not None:
        a, b = faults.swapped
        gamma = gamma.copy()
        gamma[[a, b]] = gamma[[b, a]]
    gamma = gamma + faults.gamma_offset_deg - faults.sag_deg * np.sin(np.radians(gamma))
    travel = np.sign(np.diff(planes, prepend=planes[0] - np.diff(planes[:2])[:1])) if len(planes) > 1 else np.ones(1)
    c = planes + faults.c_offset_deg - faults.backlash_deg * travel
    if faults.mirrored:
        c = -c
    grid_gamma, grid_c = np.broadcast_arrays(gamma[None, :], c[:, None])
    # beyond nadir the arm reaches over to the opposite plane
    grid_c = np.where(grid_gamma < 0.0, grid_c + 180.0, grid_c)
    outward = vector(np.abs(grid_gamma), grid_c).reshape(-1, 3)
    places = distance_m * outward - np.array(faults.aperture_shift_m)
    droop = np.radians(faults.aim_droop * grid_gamma.ravel())
    up = np.array([0.0, 0.0, 1.0])
    across = up - np.sum(-outward * up, axis=-1, keepdims=True) * -outward
    across /= np.maximum(1e-12, np.linalg.norm(across, axis=-1, keepdims=True))
    aims = -outward * np.cos(droop)[:, None] + across * np.sin(droop)[:, None]
    towards = -places / np.linalg.norm(places, axis=-1, keepdims=True)
    return Sensors(places, aims, np.sum(aims * towards, axis=-1))
