"""The dark room with its goniophotometer under a skylight: what light reaches every sensor, record by record."""

import math
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from labdaq.directions import angle_between, vector
from simulators.hidden.arm import ArmFaults, Sensors, sensors
from simulators.hidden.heads import HeadFaults, angular_response, read
from simulators.hidden.light_faults import FaultedLight
from simulators.hidden.maps import Field
from simulators.hidden.responses import Response
from simulators.hidden.room import Room

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Spot:
    """Something small between aperture and sensors, fixed in the room.

    Attributes
    ----------
    gamma_deg, c_deg, width_deg
        Where it is seen from the aperture, and its rms width [deg].
    shade
        Share of light it takes from sensors behind it.
    mirror
        Share of the intensity sent towards ``from_gamma_deg``, ``from_c_deg`` that it throws to those sensors.
    """

    gamma_deg: float
    c_deg: float
    width_deg: float
    shade: float = 0.0
    mirror: float = 0.0
    from_gamma_deg: float = 0.0
    from_c_deg: float = 0.0


@dataclass(frozen=True)
class RoomFaults:
    """What a simulated black room lacks.

    Attributes
    ----------
    room
        Reflectances and bright panels.
    stray_lx
        Light that has nothing to do with the skylight [lx], at every sensor.
    leak
        Illuminance per illuminance of the horizontal outdoors (global) that leaks in, strongest towards ``leak_c_deg``.
    spots
        Cables, ladders, glossy rails.
    """

    room: Room = field(default_factory=Room)
    stray_lx: float = 0.0
    leak: float = 0.0
    leak_c_deg: float = 0.0
    spots: tuple[Spot, ...] = ()


@dataclass(frozen=True)
class Scan:
    """One scan of the arm.

    Attributes
    ----------
    gammas_deg : (g,)
    planes_deg : (p,)
        In the order visited.
    times_ns : shape (p, g) of int
        UTC of the middle of each reading, by the clock of the room [ns].
    distance_m
        Nominal radius of the arm.
    """

    gammas_deg: Floats
    planes_deg: Floats
    times_ns: NDArray[np.int64]
    distance_m: float


@dataclass(frozen=True)
class Lit:
    """Illuminance at the sensors of a scan [lx], shape (p * g,) each: from sun, from sky, by way of the room."""

    sun: Floats
    sky: Floats
    room: Floats

    @property
    def total(self) -> Floats:
        """All of it."""
        return self.sun + self.sky + self.room


Pattern = Callable[[Floats], Floats]
"""Relative deviation of a skylight's intensity from its response, over directions below it."""


@dataclass(frozen=True)
class Fields:
    """Distributions below a skylight during a scan.

    Attributes
    ----------
    suns
        For 1 lx of the sun's disc with the halo that belongs to it, at the first and the last instant.
    skies
        From the sky at equal steps of time.
    first_ns, last_ns
        Those instants (UTC).
    """

    suns: tuple[Field, Field]
    skies: tuple[Field, ...]
    first_ns: int
    last_ns: int


def fields(response: Response, light: FaultedLight, first_ns: int, last_ns: int) -> Fields:
    """Work out the distributions below a skylight from one instant to another: the sky's at up to five instants."""
    knots = 5 if light.faults.drift is not None else 2
    moments = [first_ns + round(k / (knots - 1) * (last_ns - first_ns)) for k in range(knots)]
    skies = response.sky(np.stack([light.luminance(response.directions, t) for t in moments]))
    first, last = (_sun_field(response, light, t) for t in (first_ns, last_ns))
    return Fields((first, last), tuple(skies), first_ns, last_ns)


def normals(light: FaultedLight, below: Fields, times_ns: NDArray[np.int64]) -> Floats:
    """Illuminance facing the sun at each record (n,) [lx]; without moving cloud a parabola through three instants."""
    if light.faults.drift is not None:
        return np.array([light.sun(int(t)).normal_lx for t in times_ns])
    span = max(1, below.last_ns - below.first_ns)
    three = [light.sun(below.first_ns + round(u * span)).normal_lx for u in (0.0, 0.5, 1.0)]
    u = (times_ns - below.first_ns) / span
    return (2 * u - 1) * (u - 1) * three[0] + 4 * u * (1 - u) * three[1] + u * (2 * u - 1) * three[2]


def _sun_field(response: Response, light: FaultedLight, utc_ns: int) -> Field:
    sun = light.sun(utc_ns)
    points, each = light.halo(utc_ns)
    if each == 0.0 or sun.normal_lx == 0.0:
        return response.sun(sun.direction)
    levels = np.concatenate([[1.0], np.full(len(points), each / sun.normal_lx)])
    return response.suns(np.concatenate([sun.direction[None], points]), levels)


class Bench:
    """Carries out scans; keeps what only depends on the arm and the room.

    Parameters
    ----------
    faults, arm
        The room and the arm as they truly are.
    """

    def __init__(self, faults: RoomFaults, arm: ArmFaults) -> None:
        self.faults = faults
        self.arm = arm
        self._transfers: dict[bytes, Floats] = {}

    def sensors(self, scan: Scan) -> Sensors:
        """Where the sensors truly are."""
        return sensors(scan.gammas_deg, scan.planes_deg, scan.distance_m, self.arm)

    def light(
        self, below: Fields, light: FaultedLight, scan: Scan, pattern: Pattern | None = None, far: bool = False
    ) -> Lit:
        """Light at every sensor of a scan, given the distributions below the skylight during it.

        The sun's brightness is taken at every record, its distribution in between by time. ``pattern`` is what the
        response does not know of the lens. With ``far`` sensors see the far field from where they are.
        """
        here = self.sensors(scan)
        times = scan.times_ns.ravel()
        along = (times - below.first_ns) / max(1, below.last_ns - below.first_ns)
        directions, distances = here.directions, here.distances
        reach: float | Floats = math.inf if far else distances
        factor = np.ones(len(times)) if pattern is None else np.exp(pattern(directions))
        factor = factor / distances**2 * np.maximum(0.0, here.incidence)
        level = normals(light, below, times)
        low, high = (field.intensity(directions, reach) for field in below.suns)
        sun = ((1.0 - along) * low + along * high) * level * factor
        sky = _between(np.stack([field.intensity(directions, reach) for field in below.skies]), along) * factor
        room = np.zeros(len(times))
        if not self.faults.room.black():
            ends = ((below.suns[0], below.skies[0], below.first_ns), (below.suns[1], below.skies[-1], below.last_ns))
            transfer = self._transfer(here)
            added = [
                transfer @ self.faults.room.first_exitance(s.scaled(light.sun(t).normal_lx) + k) for s, k, t in ends
            ]
            room = (1.0 - along) * added[0] + along * added[1]
        return self._spotted(Lit(sun, sky, room), here, scan)

    def _transfer(self, here: Sensors) -> Floats:
        key = here.places.tobytes() + here.aims.tobytes()
        if key not in self._transfers:
            room = self.faults.room
            self._transfers[key] = room.transfer(room.seen(here.places, here.aims))
        return self._transfers[key]

    def _spotted(self, lit: Lit, here: Sensors, scan: Scan) -> Lit:
        """Apply cables and glints."""
        sun, sky, room = lit.sun, lit.sky, lit.room
        nominal = sensors(scan.gammas_deg, scan.planes_deg, scan.distance_m, ArmFaults())
        for spot in self.faults.spots:
            angle = angle_between(here.directions, vector(spot.gamma_deg, spot.c_deg))
            mask = np.exp(-0.5 * (angle / spot.width_deg) ** 2)
            source = angle_between(nominal.directions, vector(spot.from_gamma_deg, spot.from_c_deg))
            k = int(np.argmin(source))
            added = spot.mirror * mask * (sun[k] + sky[k])
            sun, sky = sun * (1.0 - spot.shade * mask), sky * (1.0 - spot.shade * mask)
            room = room + added
        return Lit(sun, sky, room)

    def stray(self, light: FaultedLight, scan: Scan) -> Floats:
        """Light that does not come through the skylight [lx], shape (p * g,)."""
        here = self.sensors(scan)
        added = np.full(len(here.places), self.faults.stray_lx)
        if self.faults.leak:
            middle = int(np.median(scan.times_ns))
            sun = light.sun(middle)
            outdoors = sun.normal_lx * float(sun.direction[2]) + light.diffuse(middle)
            towards = vector(75.0, self.faults.leak_c_deg)
            added = added + self.faults.leak * outdoors * 0.5 * (1.0 + here.directions @ towards)
        return added


def readings(lit: Lit, stray: Floats, here: Sensors, scan: Scan, heads: HeadFaults) -> Floats:
    """What the heads read of a scan [lx], without noise, shape (p * g,) in the scan's layout."""
    total = lit.total + stray
    share = np.divide(lit.sky + lit.room * 0.5, total, out=np.zeros_like(total), where=total > 0.0)
    if heads.response:
        incidence = here.incidence
        if heads.corrected_tilt:
            gamma = np.broadcast_to(scan.gammas_deg, (len(scan.planes_deg), len(scan.gammas_deg))).ravel()
            incidence = np.cos(np.radians(heads.corrected_tilt * gamma))
        total = total * angular_response(incidence, heads.response, heads.response_form)
    times = scan.times_ns.ravel()
    order = np.argsort(times, kind="stable")
    index = np.tile(np.arange(len(scan.gammas_deg)), len(scan.planes_deg))
    seconds = (times - times[order[0]]) / 1e9
    values = np.empty_like(total)
    values[order] = read(total[order], share[order], index[order], seconds[order], heads)
    return values


def _between(levels: Floats, along: Floats) -> Floats:
    """Interpolate levels (k, n) at equal steps to the place ``along`` (n,) in [0, 1]."""
    place = along * (len(levels) - 1)
    low = np.clip(np.floor(place).astype(int), 0, len(levels) - 2)
    u = place - low
    n = np.arange(levels.shape[1])
    return np.asarray((1.0 - u) * levels[low, n] + u * levels[low + 1, n])
