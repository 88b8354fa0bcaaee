"""The smooth shape of each test's sky: what its luminance would be a little beside a direction, or under another sun.

A recording of the sky holds few directions; what lies between them, and what another sun would show, is read from a
standard sky (CIE S 011, by the kind of sky) that is bent towards the test's own prediction by a few smooth terms. Only
ratios are used.
"""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from analysis.cases.model import Floats, Ints
from analysis.explain.readings import SKY, Readings, sun_at
from labdaq import directions

_KIND_OF_SKY = {"clear": 12, "partly-cloudy": 8, "overcast": 1, None: 8}
_SCATTER = 0.05
"""Relative scatter of a prediction about a smooth sky."""
_PRIOR = np.array([2.0, 1.0, 1.0, 2.0, 2.0, 2.0, 0.7])
"""How far a sky may differ from its standard, per term of `_terms`."""
_BRIGHTENS = 0.5
"""The sky grows as this power of the sine of the sun's height (clear: .4 to .6; Kittler et al. 1998)."""


@dataclass(frozen=True)
class SkyShape:
    """Smooth skies of the tests of some readings.

    Attributes
    ----------
    kind : shape (N,)
        Standard sky of each row's test.
    bent : shape (N, 7)
        Coefficients of the smooth terms that bend it.
    sun_altitude_deg, sun_azimuth_deg : shape (N,)
    """

    readings: Readings
    kind: Ints
    bent: Floats
    sun_altitude_deg: Floats
    sun_azimuth_deg: Floats

    @classmethod
    def of(cls, readings: Readings) -> "SkyShape":
        """Fit the skies of all tests to the predictions."""
        r = readings
        kinds = np.array([_KIND_OF_SKY[t.sky] for t in r.case.tests], dtype=np.int64)
        shape = cls(r, kinds[r.test], np.zeros((len(r), 7)), r.sun_altitude_at_deg, r.sun_azimuth_at_deg)
        v = towards(r)
        sun = directions.sky_vector(shape.sun_altitude_deg, shape.sun_azimuth_deg)
        left = np.log(np.maximum(r.simulated, 1e-9)) - shape._standard(v, shape.sun_altitude_deg, sun)
        terms = _terms(v, sun)
        for k in np.unique(r.test[r.kind == SKY]):
            rows = np.flatnonzero((r.test == k) & (r.kind == SKY) & (v[:, 2] > 0.0))
            if len(rows) < 3:
                continue
            level = left[rows].mean()
            a = terms[rows]
            normal = a.T @ a / _SCATTER**2 + np.diag(_PRIOR**-2.0)
            shape.bent[r.test == k] = np.linalg.solve(normal, a.T @ (left[rows] - level) / _SCATTER**2)
        return shape

    def log_ratio(self, v: Floats, altitude_deg: Floats, azimuth_deg: Floats) -> Floats:
        """ln of the luminance towards ``v`` (N, 3) under a sun at those angles, over that of the row itself; (N,)."""
        now = directions.sky_vector(self.sun_altitude_deg, self.sun_azimuth_deg)
        then = directions.sky_vector(altitude_deg, azimuth_deg)
        here = towards(self.readings)
        change = self._standard(v, altitude_deg, then) - self._standard(here, self.sun_altitude_deg, now)
        change = change + np.sum(self.bent * (_terms(v, then) - _terms(here, now)), axis=1)
        return np.asarray(np.clip(change, -2.0, 2.0))

    def beside(self, v: Floats) -> Floats:
        """`log_ratio` at directions ``v`` (N, 3) under the same sun."""
        return self.log_ratio(v, self.sun_altitude_deg, self.sun_azimuth_deg)

    def later(self, minutes: float) -> Floats:
        """`log_ratio` of the same directions that many minutes later."""
        r = self.readings
        altitude, azimuth = sun_at(r.case, r.utc_ns + np.int64(round(minutes * 60e9)))
        return self.log_ratio(towards(self.readings), altitude, azimuth)

    def luminance(self, test: int, v: Floats) -> Floats:
        """Luminance [cd/m²] of the smooth sky of a test towards ``v`` (M, 3), at the level of its predictions; (M,)."""
        rows = np.flatnonzero((self.readings.test == test) & (self.readings.kind == SKY))
        seen = self._of_rows(rows)._logs(towards(self.readings)[rows])
        level = np.mean(np.log(np.maximum(self.readings.simulated[rows], 1e-9)) - seen)
        return np.asarray(np.exp(level + self._of_rows(np.full(len(v), rows[0]))._logs(v)))

    def _of_rows(self, rows: Ints) -> "SkyShape":
        """The skies of some rows."""
        return SkyShape(
            self.readings,
            self.kind[rows],
            self.bent[rows],
            self.sun_altitude_deg[rows],
            self.sun_azimuth_deg[rows],
        )

    def _logs(self, v: Floats) -> Floats:
        """ln of the bent skies towards ``v`` (N, 3), up to a constant of the test; (N,)."""
        sun = directions.sky_vector(self.sun_altitude_deg, self.sun_azimuth_deg)
        return np.asarray(self._standard(v, self.sun_altitude_deg, sun) + np.sum(self.bent * _terms(v, sun), axis=1))

    def _standard(self, v: Floats, altitude_deg: Floats, sun: Floats) -> Floats:
        """ln of the standard sky's luminance, up to a constant of the test; (N,)."""
        from analysis.sky.standard import CIE_TYPES

        cosine = np.maximum(v[:, 2], 0.02)
        height = np.sin(np.radians(np.maximum(altitude_deg, 3.0)))
        away = np.radians(directions.angle_between(v, sun))
        noon = np.radians(90.0 - np.maximum(altitude_deg, 3.0))
        value = np.zeros(len(v))
        for kind in np.unique(self.kind):
            a, b, c, d, e = CIE_TYPES[int(kind)]
            gradation = np.log(1.0 + a * np.exp(b / cosine))
            end = np.exp(d * np.pi / 2)
            ring = np.log(1.0 + c * (np.exp(d * np.maximum(away, np.radians(1.0))) - end) + e * np.cos(away) ** 2)
            level = _mean_ring(noon, (c, d, e, float(end)))
            value = np.where(self.kind == kind, gradation + ring - level, value)
        return np.asarray(value + _BRIGHTENS * np.log(height))


def _mean_ring(noon: Floats, ring: tuple[float, float, float, float]) -> Floats:
    """ln of the mean of a standard sky's scattering function over the sky, weighted by the cosine; (N,)."""
    zeniths, place = np.unique(np.round(noon, 2), return_inverse=True)
    return np.array([_mean_ring_at(float(zenith), *ring) for zenith in zeniths])[place]


@lru_cache(maxsize=4096)  # all that there are: 158 zeniths, fifteen skies
def _mean_ring_at(zenith: float, c: float, d: float, e: float, end: float) -> float:
    from analysis.sky.quadrature import hemisphere_nodes

    cosine, away, weight = hemisphere_nodes(zenith)
    value = 1.0 + c * (np.exp(d * away) - end) + e * np.cos(away) ** 2
    return float(np.log(np.sum(value * cosine * weight) / np.sum(cosine * weight)))


def towards(r: Readings) -> Floats:
    """Unit vectors (N, 3) of the directions that the rows look in; rows without one look up."""
    return directions.vector(np.nan_to_num(r.gamma_deg, nan=180.0), np.nan_to_num(r.c_deg))


def tilted(v: Floats, north_deg: float, east_deg: float) -> Floats:
    """Directions (N, 3) of a camera whose axis leans towards north and east by small angles [deg]."""
    lean = np.radians(np.array([east_deg, north_deg, 0.0]))
    moved = v + np.outer(v[:, 2], lean) - np.outer(v @ lean, np.array([0.0, 0.0, 1.0]))
    return np.asarray(moved / np.linalg.norm(moved, axis=1, keepdims=True))


def turned(v: Floats, degrees: float) -> Floats:
    """Directions (N, 3) of a camera whose north lies clockwise of north by an angle [deg]."""
    a = np.radians(degrees)
    east, north = v[:, 0] * np.cos(a) + v[:, 1] * np.sin(a), v[:, 1] * np.cos(a) - v[:, 0] * np.sin(a)
    return np.stack([east, north, v[:, 2]], axis=1)


def _terms(v: Floats, sun: Floats) -> Floats:
    """Smooth terms that bend a standard sky: by height, and by the distance from the sun; (N, 7)."""
    away = directions.angle_between(v, sun)
    low = 1.0 - np.clip(v[:, 2], 0.0, 1.0)
    rings = [np.exp(-away / width) for width in (12.0, 25.0, 60.0)]
    return np.stack([low, low**2, low**4, *rings, np.cos(np.radians(away)) ** 2], axis=1)
