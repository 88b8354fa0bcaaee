"""Harvey-Shack scattering in its ABg form: a peak about the mirror (or straight) ray that falls off as a power.

f = A / (B + d**g), where d is the distance of the outgoing from the mirror direction in direction cosines (J. Harvey,
Light-scattering characteristics of optical surfaces, Arizona 1976; ABg as in TracePro's and Breault's manuals, and the
Greenwood report's figure 46). An elliptical peak measures d with different units along and across the plane of
incidence.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.random import Generator
from numpy.typing import ArrayLike

from analysis.bsdf.model import Component, Floats, Incidence, component_of, travel_sign, with_z
from labdaq.errors import DataError

_RADII = 2000
_ANGLES = 2.0 * np.pi * (np.arange(720) + 0.5) / 720
_SMALLEST = 1e-7  # direction cosines; finer peaks are mirrors


@dataclass(frozen=True)
class AbgLobe:
    """One component of an ABg description, by angle of incidence.

    Attributes
    ----------
    theta_deg : shape (n,)
        Increasing angles of incidence [deg]; parameters between are interpolated (A and B by their logarithms), beyond
        the ends they stay.
    a : shape (n,) [1/sr], b : shape (n,), g : shape (n,)
        Parameters; b > 0, g >= 0.
    across : shape (n,)
        Width of the peak across the plane of incidence relative to along it; 1 for a round one.
    specular : shape (n,)
        Part of the light that is not scattered at all, 0 to 1.
    """

    theta_deg: Floats
    a: Floats
    b: Floats
    g: Floats
    across: Floats
    specular: Floats

    @classmethod
    def of(
        cls,
        a: ArrayLike,
        b: ArrayLike,
        g: ArrayLike,
        theta_deg: ArrayLike = 0.0,
        across: ArrayLike = 1.0,
        specular: ArrayLike = 0.0,
    ) -> "AbgLobe":
        """Make a lobe of numbers or lists; raises `DataError` for parameters that make no light or too much sense."""
        theta = np.atleast_1d(np.asarray(theta_deg, dtype=np.float64))
        values = [
            np.broadcast_to(np.asarray(x, dtype=np.float64), theta.shape).copy() for x in (a, b, g, across, specular)
        ]
        lobe = cls(theta, *values)
        if np.any(np.diff(theta) <= 0) or theta[0] < 0 or theta[-1] > 90:
            raise DataError("ABg: angles of incidence must increase within 0..90")
        if (lobe.a < 0).any() or (lobe.b <= 0).any() or (lobe.g < 0).any() or (lobe.across <= 0).any():
            raise DataError("ABg: needs A >= 0, B > 0, g >= 0 and across > 0")
        if (lobe.specular < 0).any() or (lobe.specular > 1).any():
            raise DataError("ABg: the specular part lies between 0 and 1")
        return lobe

    def at(self, sine: Floats) -> tuple[Floats, Floats, Floats, Floats, Floats]:
        """A, B, g, across and specular part at sines of incidence (...)."""
        theta = np.degrees(np.arcsin(np.clip(sine, 0.0, 1.0)))

        def between(values: Floats, by_logarithm: bool = False) -> Floats:
            if by_logarithm and (values > 0).all():
                return np.exp(np.interp(theta, self.theta_deg, np.log(values)))
            return np.interp(theta, self.theta_deg, values)

        return (
            between(self.a, True), between(self.b, True), between(self.g), between(self.across), between(self.specular)
        )  # fmt: skip


@dataclass(frozen=True)
class AbgBsdf:
    """A BSDF of ABg lobes.

    Attributes
    ----------
    lobes
        By component. The centre of a lobe is where the light would go through a clear pane, or off a mirror.
    """

    lobes: Mapping[Component, AbgLobe] = field(default_factory=dict)

    def components(self) -> tuple[Component, ...]:
        """The parts it describes."""
        return tuple(self.lobes)

    def evaluate(self, component: Component, incident_xy: Floats, outgoing_xy: Floats) -> Floats:
        """BSDF [1/sr] of the scattered part for directions of travel (..., 2), which broadcast.

        The specular part has no finite value and is left out.
        """
        incident, outgoing = np.broadcast_arrays(incident_xy, outgoing_xy)
        lobe = self.lobes.get(component)
        if lobe is None:
            return np.zeros(incident.shape[:-1])
        sine = np.hypot(incident[..., 0], incident[..., 1])
        a, b, g, across, _ = lobe.at(sine)
        along, side = _in_plane(incident, outgoing - incident, sine)
        value: Floats = a / (b + np.hypot(along, side / across) ** g)
        return value

    def hemispherical(self, component: Component, incident_xy: Floats) -> Floats:
        """Part of the light from each direction (..., 2) that this component sends on, specular part included."""
        lobe = self.lobes.get(component)
        flat = incident_xy.reshape(-1, 2)
        totals = np.zeros(len(flat))
        if lobe is not None:
            for i, sine in enumerate(np.hypot(flat[:, 0], flat[:, 1])):
                totals[i] = self._scattered(lobe, float(sine)) + float(lobe.at(np.array(sine))[4])
        return totals.reshape(incident_xy.shape[:-1])

    @staticmethod
    def _scattered(lobe: AbgLobe, sine: float) -> float:
        """Integral of the lobe over the disc: along rays from its centre to the rim, all around."""
        a, b, g, across, _ = (float(x) for x in lobe.at(np.array(sine)))
        radius, cumulative = _radial(b, g, across)
        c, s = np.cos(_ANGLES), across * np.sin(_ANGLES)
        # (sine + r c)^2 + (r s)^2 = 1 for the distance r to the rim
        square = c * c + s * s
        rim = (-sine * c + np.sqrt((sine * c) ** 2 + square * max(0.0, 1.0 - sine * sine))) / square
        return float(a * across * 2.0 * np.pi * np.interp(rim, radius, cumulative).mean())

    def __call__(
        self, incidence: Incidence, travel: Floats, per_direction: int, rng: Generator
    ) -> tuple[Floats, Floats]:
        """Scatter rays as a `Tracer`: directions (n, 3) to (n, m, 3) and weights (n, m)."""
        sign, m = travel_sign(incidence), per_direction
        out = np.zeros((len(travel), m, 3))
        weights = np.zeros((len(travel), m))
        for i, direction in enumerate(travel):
            xy = direction[:2]
            shares = [self.hemispherical(component_of(incidence, t), xy) for t in (True, False)]
            total = float(sum(shares))
            through = rng.random(m) * total < shares[0]
            weights[i] = total
            for transmitted in (True, False):
                rows = np.flatnonzero(through == transmitted)
                lobe = self.lobes.get(component_of(incidence, transmitted))
                scattered = np.tile(xy, (len(rows), 1)) if lobe is None else self._sample(lobe, xy, len(rows), rng)
                out[i, rows] = with_z(scattered, sign if transmitted else -sign)
        return out, weights

    @staticmethod
    def _sample(lobe: AbgLobe, xy: Floats, count: int, rng: Generator) -> Floats:
        """Directions (count, 2) drawn from a lobe; those beyond the disc are drawn again."""
        sine = float(np.hypot(*xy))
        a, b, g, across, specular = (float(x) for x in lobe.at(np.array(sine)))
        edges, cumulative = _radial(b, g, across)
        cumulative /= cumulative[-1]
        result = np.tile(xy, (count, 1)).astype(np.float64)
        whole = AbgBsdf._scattered(lobe, sine) + specular
        todo = np.flatnonzero(rng.random(count) * whole >= specular)
        axis = xy / sine if sine > 0.0 else np.array([1.0, 0.0])
        while todo.size and a > 0.0:
            # within a ring the square of the radius is even
            radius = np.sqrt(np.interp(rng.random(todo.size), cumulative, edges**2))
            turn = 2.0 * np.pi * rng.random(todo.size)
            along, side = radius * np.cos(turn), across * radius * np.sin(turn)
            place = xy + along[:, None] * axis + side[:, None] * np.array([-axis[1], axis[0]])
            good = np.sum(place**2, axis=1) <= 1.0
            result[todo[good]] = place[good]
            todo = todo[~good]
        return result


def _radial(b: float, g: float, across: float) -> tuple[Floats, Floats]:
    """Radii up to the far rim, and the integral of r / (B + r**g) from 0 to each of them."""
    radius = np.concatenate([[0.0], np.geomspace(_SMALLEST, 2.0 / min(1.0, across), _RADII)])
    middle = 0.5 * (radius[1:] + radius[:-1])
    steps = 0.5 * np.diff(radius**2) / (b + middle**g)
    return radius, np.concatenate([[0.0], np.cumsum(steps)])


def _in_plane(incident: Floats, offset: Floats, sine: Floats) -> tuple[Floats, Floats]:
    """Parts of offsets (..., 2) along and across the plane of incidence."""
    safe = np.where(sine > 0.0, sine, 1.0)
    ux = np.where(sine > 0.0, incident[..., 0] / safe, 1.0)
    uy = np.where(sine > 0.0, incident[..., 1] / safe, 0.0)
    return ux * offset[..., 0] + uy * offset[..., 1], ux * offset[..., 1] - uy * offset[..., 0]


def fit_abg(distance: ArrayLike, values: ArrayLike) -> tuple[float, float, float]:
    """Fit A, B and g to BSDF values [1/sr] at distances from the mirror direction (direction cosines).

    Least squares of the logarithms, so that the tail counts as much as the peak.

    Raises
    ------
    DataError
        Fewer than four positive values, or no fit.
    """
    from scipy.optimize import least_squares  # slow to import

    d, f = np.asarray(distance, dtype=np.float64).ravel(), np.asarray(values, dtype=np.float64).ravel()
    good = (f > 0) & np.isfinite(f) & (d >= 0)
    d, f = d[good], f[good]
    if d.size < 4:
        raise DataError(f"an ABg fit needs at least four positive values, not {d.size}")

    def residual(p: Floats) -> Floats:
        miss: Floats = np.log(f) - (p[0] - np.logaddexp(p[1], p[2] * np.log(np.maximum(d, 1e-12))))
        return miss

    best = min(
        (least_squares(residual, [np.log(f.max()) + start, start, 2.0], bounds=([-60, -60, 0], [60, 20, 12]))
         for start in (-2.0, -6.0, -10.0)),
        key=lambda result: result.cost,
    )  # fmt: skip
    if not best.success:
        raise DataError(f"no ABg fit: {best.message}")
    return float(np.exp(best.x[0])), float(np.exp(best.x[1])), float(best.x[2])
