"""The world that emulated instruments observe: sun, sky and clouds over a skylight above a dark room.

Everything is a function of UTC, so that whoever looks at the same instant sees the same. Light through the skylight is
traced ray by ray (`simulators.hidden`); what may be concealed in source, optics and room is laid over it.
"""

import math
import threading
from collections import OrderedDict
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, Final, Literal, TypeVar

import numpy as np
from numpy.typing import NDArray

from labdaq.clock import NS
from labdaq.directions import vector
from simulators.hidden.effects import Hidden
from simulators.hidden.light import Site
from simulators.hidden.light_faults import FaultedLight
from simulators.hidden.maps import Field
from simulators.hidden.room import Room
from simulators.world.darkroom import DarkRoom, between_nodes
from simulators.world.daylight import Daylight, hemisphere
from simulators.world.observed import SunSeen
from simulators.world.roof import cap
from simulators.world.sunpath import SunPath
from simulators.world.tracing import NODES, Cells, Halo, Tracing, skylight_with

Floats = NDArray[np.float64]
T = TypeVar("T")

SUN_STEP_NS: Final = 240 * NS
"""Suns are traced at multiples of this (one degree of their way) and interpolated; a lobe loses at most 0.6 %."""
STEADY_STEP_NS: Final = 60 * NS
DRIFTING_STEP_NS: Final = 5 * NS
"""The sky is worked out at multiples of these and interpolated; clouds move by a few hundredths of their height."""


@dataclass(frozen=True)
class WorldOptions:
    """Where the world is and what is in it.

    Attributes
    ----------
    site
        Where.
    system
        The skylight in the roof: ``top``, ``box`` or ``tube``.
    sky, cloud_cover, seed
        Kind of sky, share of it that drifting clouds cover, and which clouds.
    distance_m
        From the aperture's centre to the goniophotometer's sensors.
    room
        The dark room with the sensors' shields.
    effort
        Multiplies the number of traced rays; at 1 a sun's light is good to about 1 % in each bright direction.
    """

    site: Site = field(default_factory=lambda: Site(34.2176, -82.1084, 180.0))
    system: Literal["top", "box", "tube"] = "box"
    sky: Literal["clear", "partly-cloudy", "overcast"] = "clear"
    cloud_cover: float = 0.0
    seed: int = 1
    distance_m: float = 2.6
    room: Room = field(default_factory=lambda: Room(walls=0.043, floor=0.015, ceiling=0.043))
    effort: float = 1.0


class EmulatedWorld:
    """A `simulators.world.observed.World`; may be asked from several threads.

    Parameters
    ----------
    options
        What is there.
    hidden
        What is concealed: ``source``, ``optics`` and ``room`` act here; ``arm`` and ``heads`` are the instruments'.
    """

    def __init__(self, options: WorldOptions | None = None, hidden: Hidden | None = None) -> None:
        self.options = o = options or WorldOptions()
        self.hidden = hidden = hidden or Hidden()
        self.daylight = Daylight(SunPath(o.site), o.sky, o.cloud_cover, o.seed)
        self._late_ns = round(hidden.source.clock_s * NS)
        self._light = FaultedLight(self.daylight, replace(hidden.source, clock_s=0.0))
        optics = hidden.optics_of(o.system)
        halo = Halo(hidden.source.halo_deg, hidden.source.halo)
        self.tracing = Tracing(skylight_with(o.system, optics), optics.answer.soiling, halo, o.effort)
        room = o.room if hidden.room.room.black() else replace(hidden.room.room, size_m=o.room.size_m)
        self._room = DarkRoom(replace(room, half_angle_deg=o.room.half_angle_deg), o.distance_m)
        steady = self.daylight.steady and hidden.source.drift is None
        self._sky_step_ns = STEADY_STEP_NS if steady else DRIFTING_STEP_NS
        self._kept: OrderedDict[tuple[str, int], Any] = OrderedDict()
        self._lock = threading.RLock()

    # --- outdoors ---

    def sun(self, utc_ns: int) -> SunSeen:
        """Where the sun is and how bright."""
        altitude, azimuth = self.daylight.path.angles(utc_ns)
        return SunSeen(altitude, azimuth, self._light.sun(utc_ns).normal_lx)

    def sky_luminance(self, directions: Floats, utc_ns: int) -> Floats:
        """Sky luminance without the sun's disc [cd/m²] towards unit vectors (..., 3); 0 below the horizon."""
        directions = np.asarray(directions, dtype=np.float64)
        return np.where(directions[..., 2] > 0.0, self._light.glow(directions, utc_ns), 0.0)

    def roof_illuminance(self, normal: Floats, utc_ns: int, shaded_half_angle_deg: float = 0.0) -> float:
        """Illuminance [lx] on the roof for a sensor facing ``normal`` (3,), without what a disc hides."""
        normal = np.asarray(normal, dtype=np.float64)
        directions, solid_angle = hemisphere()
        seen = np.maximum(0.0, directions @ normal) * solid_angle
        total = float(self._between("roof", utc_ns, self._sky_step_ns, self._sky_on_roof) @ seen)
        sun = self._light.sun(utc_ns)
        facing = max(0.0, float(normal @ sun.direction)) if sun.direction[2] > 0.0 else 0.0
        halo = self.hidden.source.halo
        glow = sun.normal_lx * halo / (1.0 - halo) * facing
        if shaded_half_angle_deg <= 0.0:
            return total + glow + sun.normal_lx * facing
        around, weight = cap(sun.direction, shaded_half_angle_deg)
        hidden = self._light.luminance(around, utc_ns) @ (np.maximum(0.0, around @ normal) * weight)
        left = math.exp(-((shaded_half_angle_deg / self.hidden.source.halo_deg) ** 2)) if halo else 0.0
        return max(0.0, total - float(hidden) + glow * left)

    def _sky_on_roof(self, utc_ns: int) -> Floats:
        return self._light.luminance(hemisphere()[0], utc_ns)

    # --- indoors ---

    def room_illuminance(self, gamma_deg: Floats, c_deg: float, utc_ns: int) -> Floats:
        """Illuminance [lx] at the goniophotometer's sensors (n,), each facing the aperture's centre."""
        gamma = np.asarray(gamma_deg, dtype=np.float64)
        true_ns = utc_ns + self._late_ns
        sun = self._light.sun(true_ns)
        level = sun.normal_lx / (1.0 - self.hidden.source.halo)
        directions, distance = vector(gamma, c_deg), self.options.distance_m
        values, glow = self._between("sky", true_ns, self._sky_step_ns, self._sky_below)
        candela = Field(values).intensity(directions, distance)
        if level > 0.0 and sun.direction[2] > 0.0:
            first = true_ns // SUN_STEP_NS * SUN_STEP_NS
            self._trace((first, first + SUN_STEP_NS))
            from_sun, sun_glow = self._between("sun", true_ns, SUN_STEP_NS, self._sun_below)
            candela, glow = candela + level * Field(from_sun).intensity(directions, distance), glow + level * sun_glow
        return candela / distance**2 + between_nodes(glow, gamma, c_deg) + self._stray(directions, true_ns)

    def prepare(self, first_utc_ns: int, last_utc_ns: int) -> None:
        """Trace, on all cores, what will be asked for between two instants; else it is traced when it is asked for."""
        first, last = first_utc_ns + self._late_ns, last_utc_ns + self._late_ns
        self._trace(tuple(range(first // SUN_STEP_NS * SUN_STEP_NS, last + SUN_STEP_NS, SUN_STEP_NS)))
        self._sky_below(first)

    def _trace(self, instants: tuple[int, ...]) -> None:
        if all(("sun", t) in self._kept for t in instants):
            return
        places = [self.daylight.path(t) for t in instants]
        self.tracing.suns(place for place in places if place[2] > 0.0)

    def _sun_below(self, utc_ns: int) -> tuple[Floats, Floats]:
        """Light below for 1 lx facing the sun: a field's values, and the room's glow."""
        place = self.daylight.path(utc_ns)
        if place[2] <= 0.0:
            nothing = Field(np.zeros((3, NODES, NODES)))
            return nothing.values, self._room.glow(nothing)
        (found,) = self.tracing.suns([place])
        return found.values, self._room.glow(found)

    def _sky_below(self, utc_ns: int) -> tuple[Floats, Floats]:
        """Light below from the sky: a field's values, and the room's glow."""
        response, cells = self.tracing.sky, self._cells
        (found,) = response.sky(cells.mean(self._light.luminance(cells.directions, utc_ns)))
        return found.values, self._room.glow(found)

    @cached_property
    def _cells(self) -> Cells:
        return Cells(self.tracing.sky.nodes)

    def _stray(self, directions: Floats, utc_ns: int) -> Floats:
        """Light that does not come through the skylight [lx]."""
        faults = self.hidden.room
        added = np.full(len(directions), faults.stray_lx)
        if faults.leak:
            outdoors = self.roof_illuminance(np.array([0.0, 0.0, 1.0]), utc_ns)
            added += faults.leak * outdoors * 0.5 * (1.0 + directions @ vector(75.0, faults.leak_c_deg))
        return added

    # --- memory ---

    def _between(self, what: str, utc_ns: int, step_ns: int, make: Callable[[int], T]) -> T:
        """Interpolate what is made at multiples of a step: an array, or several."""
        first = utc_ns // step_ns * step_ns
        share = (utc_ns - first) / step_ns
        low, high = (self._keep(what, t, make) for t in (first, first + step_ns))
        if isinstance(low, tuple):
            assert isinstance(high, tuple)
            mixed: Any = tuple((1.0 - share) * a + share * b for a, b in zip(low, high, strict=True))
            return mixed  # type: ignore[no-any-return]
        blend: Any = (1.0 - share) * low + share * high  # type: ignore[operator]
        return blend  # type: ignore[no-any-return]

    def _keep(self, what: str, utc_ns: int, make: Callable[[int], T]) -> T:
        with self._lock:
            if (what, utc_ns) not in self._kept:
                self._kept[what, utc_ns] = make(utc_ns)
                if len(self._kept) > 400:
                    self._kept.popitem(last=False)
            kept: T = self._kept[what, utc_ns]
            return kept
