"""What conceals itself in the light: another split of sun and sky, a halo, drifting cloud, something on the horizon."""

import math
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from labdaq.clock import NS
from labdaq.directions import sky_vector
from simulators.hidden.light import Light, Sun

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Drift:
    """Thin cloud of uneven depth that the wind moves across sun and sky.

    Attributes
    ----------
    depth
        Rms of the change of the beam, as a share of it.
    crossing_s
        Time in which a typical cloud passes the sun [s].
    wind_from_deg
        Compass direction the cloud comes from [deg].
    seed
        Which clouds.
    spans_ns
        Recorded times from and to which clouds pass at all [ns]; empty: always.
    """

    depth: float
    crossing_s: float = 45.0
    wind_from_deg: float = 250.0
    seed: int = 0
    spans_ns: tuple[tuple[int, int], ...] = ()


@dataclass(frozen=True)
class SourceFaults:
    """How sun and sky differ from what the station's record says; all zero for an honest record.

    Attributes
    ----------
    diffuse_shift
        True diffuse illuminance over the recorded, less 1; the global is right.
    disc_half_angle_deg
        The shading disc hid this much sky about the sun as well, so the recorded diffuse is too low by it [deg].
    halo, halo_deg, halo_power
        Share of the beam that comes from about the sun instead of from its disc, the scale of its spread [deg],
        and the shape: exp(-(angle / scale)^power).
    clock_s
        The room's clock shows this much less than the true time [s].
    drift
        Moving cloud.
    skyline
        Obstruction: compass from, to, and altitude [deg], and its luminance as a share of the mean sky's.
    """

    diffuse_shift: float = 0.0
    disc_half_angle_deg: float = 0.0
    halo: float = 0.0
    halo_deg: float = 4.0
    halo_power: float = 1.0
    clock_s: float = 0.0
    drift: Drift | None = None
    skyline: tuple[float, float, float, float] | None = None

    def over(self, light: Light) -> "FaultedLight":
        """The light as it truly was, where ``light`` is what the record says."""
        return FaultedLight(light, self)


@dataclass(frozen=True)
class FaultedLight:
    """A light seen through `SourceFaults`."""

    light: Light
    faults: SourceFaults
    _shares: dict[int, float] = field(default_factory=dict, compare=False)

    def sun(self, utc_ns: int) -> Sun:
        """The sun's disc, without its halo."""
        true_ns = utc_ns + round(self.faults.clock_s * NS)
        sun = self.light.sun(true_ns)
        shift = self._shift(true_ns)
        diffuse = self.diffuse(true_ns) if shift else 0.0
        level = sun.normal_lx - shift * diffuse / max(0.05, float(sun.direction[2]))
        level *= (1.0 - self.faults.halo) * self.transmission(true_ns)
        if self.faults.skyline is not None and bool(self._hidden(sun.direction[None])[0]):
            level = 0.0
        return Sun(sun.direction, max(0.0, level))

    def halo(self, utc_ns: int, count: int = 60) -> tuple[Floats, float]:
        """The halo as equally bright points (count, 3), and the illuminance of each facing it [lx]."""
        direct = self.sun(utc_ns)
        if self.faults.halo == 0.0:
            return np.zeros((0, 3)), 0.0
        radius = np.radians(_halo_quantiles(self.faults.halo_deg, self.faults.halo_power, count))
        angle = 2.399963229728653 * np.arange(count)  # golden angle: no two on a line
        east = np.cross([0.0, 1.0, 0.0], direct.direction)
        east /= np.linalg.norm(east)
        north = np.cross(direct.direction, east)
        side = np.cos(angle)[:, None] * east + np.sin(angle)[:, None] * north
        points = np.cos(radius)[:, None] * direct.direction + np.sin(radius)[:, None] * side
        total = direct.normal_lx * self.faults.halo / (1.0 - self.faults.halo)
        return points[points[:, 2] > 0.02], total / count

    def luminance(self, directions: Floats, utc_ns: int) -> Floats:
        """Sky without disc and halo [cd/m²] towards unit vectors (..., 3)."""
        true_ns = utc_ns + round(self.faults.clock_s * NS)
        value = self.light.luminance(directions, true_ns) * (1.0 + self._shift(true_ns))
        if self.faults.drift is not None:
            value = value * (1.0 + 0.5 * self._passing(directions, true_ns))
        if self.faults.skyline is not None:
            wall = self.faults.skyline[3] * self.diffuse(true_ns) / math.pi
            value = np.where(self._hidden(directions), wall, value)
        return value

    def glow(self, directions: Floats, utc_ns: int) -> Floats:
        """Sky with the halo [cd/m²], as a camera would see it."""
        value = self.luminance(directions, utc_ns)
        if self.faults.halo:
            direct = self.sun(utc_ns)
            angle = np.degrees(np.arccos(np.clip(directions @ direct.direction, -1.0, 1.0)))
            fine = np.linspace(0.0, 60.0, 6001)
            shape = np.exp(-((fine / self.faults.halo_deg) ** self.faults.halo_power))
            norm = 2.0 * math.pi * np.trapezoid(shape * np.sin(np.radians(fine)), np.radians(fine))
            total = direct.normal_lx * self.faults.halo / (1.0 - self.faults.halo)
            value = value + total / norm * np.exp(-((angle / self.faults.halo_deg) ** self.faults.halo_power))
        return value

    def transmission(self, true_ns: int) -> float:
        """What the drifting cloud lets through of the beam, about 1."""
        if self.faults.drift is None:
            return 1.0
        sun = self.light.sun(true_ns).direction
        return float(1.0 + self._passing(sun[None], true_ns)[0])

    def _passing(self, directions: Floats, true_ns: int) -> Floats:
        assert self.faults.drift is not None
        spans, read_ns = self.faults.drift.spans_ns, true_ns - round(self.faults.clock_s * NS)
        if spans and not any(start <= read_ns <= end for start, end in spans):
            return np.zeros(directions.shape[:-1])
        return self._veil.at(directions, true_ns)

    @cached_property
    def _veil(self) -> "_Veil":
        assert self.faults.drift is not None
        return _Veil(self.faults.drift)

    def _shift(self, true_ns: int) -> float:
        if self.faults.disc_half_angle_deg <= 0.0:
            return self.faults.diffuse_shift
        if true_ns not in self._shares:
            sun = self.light.sun(true_ns).direction
            near = _cap(sun, self.faults.disc_half_angle_deg)
            inside = np.mean(self.light.luminance(near, true_ns) * near[:, 2])
            inside *= 2.0 * math.pi * (1.0 - math.cos(math.radians(self.faults.disc_half_angle_deg)))
            share = float(inside / self.diffuse(true_ns))
            self._shares[true_ns] = share / (1.0 - share)
        return self.faults.diffuse_shift + self._shares[true_ns]

    def diffuse(self, true_ns: int) -> float:
        """Horizontal diffuse illuminance that the record says [lx]."""
        return self.light.diffuse(true_ns)

    def _hidden(self, directions: Floats) -> NDArray[np.bool_]:
        assert self.faults.skyline is not None
        first, last, altitude, _ = self.faults.skyline
        azimuth = np.degrees(np.arctan2(directions[..., 0], directions[..., 1]))
        below = directions[..., 2] < math.sin(math.radians(altitude))
        return below & ((azimuth - first) % 360.0 < (last - first) % 360.0)


class _Veil:
    """A random field in a plane high above, moved by the wind: relative change of transmission."""

    def __init__(self, drift: Drift) -> None:
        rng = np.random.default_rng(drift.seed)
        waves = 40
        length = np.exp(rng.uniform(math.log(0.15), math.log(1.2), waves))  # in units of the layer's height
        heading = rng.uniform(0.0, 2.0 * math.pi, waves)
        self._waves = (2.0 * math.pi / length)[:, None] * np.column_stack([np.sin(heading), np.cos(heading)])
        self._phases = rng.uniform(0.0, 2.0 * math.pi, waves)
        self._level = drift.depth * math.sqrt(2.0 / waves)
        blow = math.radians(drift.wind_from_deg + 180.0)
        self._wind = 0.4 / drift.crossing_s * np.array([math.sin(blow), math.cos(blow)])  # heights per second

    def at(self, directions: Floats, utc_ns: int) -> Floats:
        """Change towards unit vectors (..., 3), at least -0.9."""
        place = directions[..., :2] / np.maximum(0.15, directions[..., 2:])
        place = place - self._wind * ((utc_ns / NS) % 86_400.0)
        value = self._level * np.sum(np.cos(place @ self._waves.T + self._phases), axis=-1)
        return np.maximum(-0.9, value)  # type: ignore[no-any-return]


def _halo_quantiles(scale_deg: float, power: float, count: int) -> Floats:
    """Angles from the sun [deg] that split the halo's light into equal parts."""
    fine = np.linspace(0.0, 60.0, 6001)
    light = np.exp(-((fine / scale_deg) ** power)) * np.sin(np.radians(fine))
    whole = np.cumsum(light)
    return np.interp((np.arange(count) + 0.5) / count, whole / whole[-1], fine)


def _cap(axis: Floats, half_angle_deg: float, count: int = 400) -> Floats:
    """Even directions (count, 3) within a cone about ``axis``."""
    k = np.arange(count) + 0.5
    cosine = 1.0 - k / count * (1.0 - math.cos(math.radians(half_angle_deg)))
    sine = np.sqrt(1.0 - cosine**2)
    angle = 2.399963229728653 * k
    helper = sky_vector(0.0, 0.0) if abs(axis[1]) < 0.9 else sky_vector(0.0, 90.0)
    first = np.cross(helper, axis)
    first /= np.linalg.norm(first)
    second = np.cross(axis, first)
    points = cosine[:, None] * axis + sine[:, None] * (np.cos(angle)[:, None] * first + np.sin(angle)[:, None] * second)
    return np.asarray(points[points[:, 2] > 0.0])
