"""The goniometer's records of one test as directions with solid angles: what metrics and plots are made of."""

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from analysis.cases import Case
from analysis.cases.model import Floats, Ints
from analysis.compare.simulations import Simulated
from analysis.photometry.sphere import solid_angle_weights

_SAME: Final = 3  # decimals of a degree to which two directions are one


@dataclass(frozen=True)
class Scan:
    """One test on the grid of its gammas and C-planes; the nadir is one direction.

    Attributes
    ----------
    gamma_deg : shape (G,), plane_deg : shape (P,) [deg]
        Increasing; planes in [0, 360).
    cell : shape (P, G)
        Index of the direction in the arrays below, -1 where nothing was read; all planes share the nadir's.
    gamma, c : shape (D,) [deg]
    measured, uncertainty : shape (D,) [cd]
        Mean of repeats, and the standard uncertainty of its noise.
    solid_angle : shape (D,) [sr]
        Weight of each direction in an integral over the sphere (bilinear between directions).
    simulated
        Each simulation's intensity by name, shape (D,) [cd]; NaN where it has none.
    """

    gamma_deg: Floats
    plane_deg: Floats
    cell: Ints
    gamma: Floats
    c: Floats
    measured: Floats
    uncertainty: Floats
    solid_angle: Floats
    simulated: dict[str, Floats]

    def table(self, values: Floats) -> Floats:
        """Values of directions (D,) as a table (P, G), NaN where there is none."""
        return np.where(self.cell >= 0, np.append(values, np.nan)[self.cell], np.nan)

    def along(self, values: Floats, c_deg: float) -> Floats:
        """Values (G,) in a half-plane; between the planes that were visited, linear in C."""
        table, planes = self.table(values), self.plane_deg
        after = int(np.searchsorted(planes, c_deg % 360.0 - 1e-6) % len(planes))
        before = (after - 1) % len(planes)
        if abs((planes[after] - c_deg + 180.0) % 360.0 - 180.0) < 1e-6 or len(planes) == 1:
            return np.asarray(table[after])
        width = (planes[after] - planes[before]) % 360.0
        t = ((c_deg - planes[before]) % 360.0) / width
        return np.asarray((1.0 - t) * table[before] + t * table[after])


def scan_of(case: Case, test: int, simulated: list[Simulated]) -> Scan | None:
    """Records of the goniometer in one test, in cd; ``None`` when it has no reading there."""
    r = case.records
    arm = np.array([c.kind == "goniometer" for c in case.channels])
    rows = np.flatnonzero(arm[r.channel] & (r.test == test) & np.isfinite(r.measured))
    if not len(rows):
        return None
    factor = np.array([1e3 if c.unit == "kcd" else 1.0 for c in case.channels])[r.channel[rows]]
    gamma = np.round(r.gamma_deg[rows], _SAME)
    c = np.where(gamma == 0.0, 0.0, np.round(np.mod(r.c_deg[rows], 360.0), _SAME) % 360.0)
    gammas = np.unique(gamma)
    planes = np.unique(c[gamma > 0.0]) if np.any(gamma > 0.0) else np.zeros(1)
    place = np.column_stack([gamma, c])
    distinct, which = np.unique(place, axis=0, return_inverse=True)
    which = which.ravel()
    count = np.bincount(which)

    def mean(values: Floats) -> Floats:
        return np.asarray(np.bincount(which, weights=values) / count, dtype=np.float64)

    noise = np.nan_to_num(r.uncertainty[rows]) * factor
    cell = _cells(gammas, planes, distinct)
    return Scan(
        gamma_deg=gammas,
        plane_deg=planes,
        cell=cell,
        gamma=distinct[:, 0],
        c=distinct[:, 1],
        measured=mean(r.measured[rows] * factor),
        uncertainty=np.sqrt(mean(noise**2) / count),
        solid_angle=_solid_angles(gammas, planes, cell, len(distinct)),
        simulated={s.name: mean(s.values[rows] * factor) for s in simulated},
    )


def _cells(gammas: Floats, planes: Floats, distinct: Floats) -> Ints:
    cell = np.full((len(planes), len(gammas)), -1, dtype=np.int64)
    i = np.searchsorted(gammas, distinct[:, 0])
    for k, (gamma, c) in enumerate(distinct):
        if gamma == 0.0:
            cell[:, 0] = k
        else:
            cell[np.searchsorted(planes, c), i[k]] = k
    return cell


def _solid_angles(gammas: Floats, planes: Floats, cell: Ints, size: int) -> Floats:
    """Weight of each direction: ring of gamma times half the way to the next planes on both sides."""
    ring = np.ones(1)
    if len(gammas) > 1:
        ring = solid_angle_weights(gammas, np.array([0.0, 360.0])).sum(axis=0) / (2.0 * np.pi)
    gaps = np.radians(np.diff(np.append(planes, planes[0] + 360.0)))
    width = (gaps + np.roll(gaps, 1)) / 2.0
    weights = np.zeros(size)
    there: NDArray[np.bool_] = cell >= 0
    np.add.at(weights, cell[there], (width[:, None] * ring[None, :])[there])
    return weights
