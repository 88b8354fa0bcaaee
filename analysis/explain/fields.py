"""Predicted intensity as fields over the whole lower hemisphere, sun part and sky part apart.

A mechanism may need the light in directions that no sensor looked in (the room is lit by all of it, a turned arm
samples between the planes). The fields come from the case's .ies files where it brings them, else they are
interpolated from the records themselves.
"""

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import Akima1DInterpolator, CubicSpline

from analysis.cases import Case
from analysis.cases.model import Floats, Parts
from analysis.explain.readings import GONIOMETER, Readings

GAMMA_DEG: Floats = np.arange(0.0, 90.1, 2.5)
"""Gammas of the fields [deg]; shape (G,)."""
C_DEG: Floats = np.arange(0.0, 360.0, 5.0)
"""C-planes of the fields [deg], periodic; shape (P,)."""
_FLOOR = 0.005
"""Share of a part's brightest direction that is added before the logarithm is taken."""


@dataclass(frozen=True)
class Fields:
    """Luminous intensity [cd] of each test on the grid `GAMMA_DEG` x `C_DEG`.

    Attributes
    ----------
    sun, sky : shape (T, P, G) [cd]
        The parts; where a test's parts are not known apart, all of it is in ``sun`` and ``sky`` is zero.
    """

    sun: Floats
    sky: Floats

    @property
    def total(self) -> Floats:
        """Sun and sky together; shape (T, P, G) [cd]."""
        return self.sun + self.sky


def solid_angle() -> Floats:
    """Solid angle of each grid cell [sr], shape (P, G); sums to 2π."""
    edge = np.radians(np.concatenate([[0.0], (GAMMA_DEG[1:] + GAMMA_DEG[:-1]) / 2, [90.0]]))
    ring = np.cos(edge[:-1]) - np.cos(edge[1:])
    return np.broadcast_to(ring * np.radians(C_DEG[1]), (len(C_DEG), len(GAMMA_DEG)))


def fields_of(readings: Readings) -> Fields:
    """Fields of every test that has goniometer rows (zeros for the others)."""
    shape = (len(readings.case.tests), len(C_DEG), len(GAMMA_DEG))
    sun, sky = np.zeros(shape), np.zeros(shape)
    for k, test in enumerate(readings.case.tests):
        if test.simulated is not None:
            sun[k], sky[k] = from_files(readings.case, test.simulated)
            continue
        rows = (readings.test == k) & (readings.kind == GONIOMETER)
        if not np.any(rows):
            continue
        part = readings.only(rows)
        if readings.has_parts:
            sun[k] = _from_rows(part.gamma_deg, part.c_deg, part.sun)
            sky[k] = _from_rows(part.gamma_deg, part.c_deg, part.sky)
        else:
            sun[k] = _from_rows(part.gamma_deg, part.c_deg, part.simulated)
    return Fields(sun, sky)


def from_files(case: Case, parts: Parts) -> tuple[Floats, Floats]:
    """Sun and sky part (P, G) [cd] of one test from its .ies files."""
    from analysis.photometry.lm63 import read_lm63

    def grid(name: str | None) -> Floats:
        if name is None:
            return np.zeros((len(C_DEG), len(GAMMA_DEG)))
        of = read_lm63(case.folder / name).distribution
        below = of.gamma_deg <= 90.0
        return _through(of.gamma_deg[below], [(of.c_deg[:-1], ring) for ring in of.candela[:-1, below].T])

    return (grid(parts.total), grid(None)) if parts.total and not parts.sun else (grid(parts.sun), grid(parts.sky))


def steps_of_file(case: Case, parts: Parts) -> tuple[float, float]:
    """How far apart the gammas and the planes of an .ies file are [deg], in the middle."""
    from analysis.photometry.lm63 import read_lm63

    name = parts.sun or parts.total or parts.sky
    assert name is not None
    of = read_lm63(case.folder / name).distribution
    gamma, c = (np.diff(angles) if len(angles) > 1 else np.array([360.0]) for angles in (of.gamma_deg, of.c_deg))
    return float(np.median(gamma)), float(np.median(c))


def _from_rows(gamma_deg: Floats, c_deg: Floats, candela: Floats) -> Floats:
    """The field (P, G) [cd] through the rows of one test."""
    of_ring = np.round(gamma_deg, 3)
    rings = np.unique(of_ring)
    return _through(rings, [(c_deg[of_ring == ring], candela[of_ring == ring]) for ring in rings])


def _through(gamma_deg: Floats, rings: list[tuple[Floats, Floats]]) -> Floats:
    """The field (P, G) [cd] through rings of planes [deg] and candela, at each gamma; nothing goes level unless told.

    In the logarithm, above a floor: light is nowhere negative, and an image of the sun falls off as a Gaussian does.
    In C a periodic cubic spline, in gamma a modified Akima one (scipy 1.14; Akima 1970, J. ACM 17, 589), which does
    not wave beside an edge. (Read from planes 18° to 60° apart, sun parts of other authors' lenses were missed by .023
    to .15 rms so, by .028 to .24 along splines of the candela themselves; sky parts alike.)
    """
    top = max((float(candela.max()) for _, candela in rings), default=0.0)
    if top <= 0.0:
        return np.zeros((len(C_DEG), len(GAMMA_DEG)))
    planes, lights = [c_deg for c_deg, _ in rings], [candela / top for _, candela in rings]
    if all(np.array_equal(planes[0], c_deg) for c_deg in planes[1:]):
        table = _around(planes[0], np.stack(lights, axis=1))
    else:
        table = np.concatenate([_around(c, share[:, None]) for c, share in zip(planes, lights, strict=True)], axis=1)
    if gamma_deg[0] == 0.0:
        table[:, 0] = table[:, 0].mean()
    if gamma_deg[-1] < 90.0:
        gamma_deg = np.append(gamma_deg, 90.0)
        table = np.concatenate([table, np.full((len(C_DEG), 1), np.log(_FLOOR))], axis=1)
    inside = np.clip(GAMMA_DEG, gamma_deg[0], gamma_deg[-1])
    field = np.exp(Akima1DInterpolator(gamma_deg, table, axis=1, method="makima")(inside))
    return np.asarray(top * np.maximum(field - _FLOOR, 0.0))


def _around(c_deg: Floats, shares: Floats) -> Floats:
    """Logarithms (P, R) of rings (N, R) at `C_DEG`: mean of repeats, then a periodic cubic spline.

    Linear under four planes.
    """
    planes, where = np.unique(np.round(c_deg, 3), return_inverse=True)
    total = np.zeros((len(planes), shares.shape[1]))
    np.add.at(total, where, shares)
    mean = np.log(np.maximum(total / np.bincount(where)[:, None], 0.0) + _FLOOR)
    if len(planes) < 4:
        return np.stack([np.interp(C_DEG, planes, ring, period=360.0) for ring in mean.T], axis=1)
    spline = CubicSpline(np.append(planes, planes[0] + 360.0), np.concatenate([mean, mean[:1]]), bc_type="periodic")
    return np.asarray(spline(planes[0] + np.mod(C_DEG - planes[0], 360.0)), dtype=np.float64)
