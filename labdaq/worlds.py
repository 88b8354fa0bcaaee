"""The world that a station's emulators observe, from its ``[emulation]`` table.

It is the plain world of `simulators.world.plain`: a formula for each thing to be seen. Of the skylight it knows the
aperture's area, of the sky how much of the sun comes through; it has no drifting clouds, and says so when asked for
them.
"""

import math
from typing import Final

from labdaq.errors import ConfigError
from labdaq.station import Station
from simulators.world.observed import World
from simulators.world.plain import PlainOptions, build_world

EXTINCTION: Final = {"clear": 0.21, "partly-cloudy": 0.80, "overcast": 30.0}
"""Luminous extinction per air mass (IES Lighting Handbook, 9th ed., chapter 8); overcast, no sun comes through."""

APERTURE_M2: Final = {"top": 0.6096**2, "box": 0.6096**2, "tube": math.pi * (0.3556 / 2) ** 2}
"""Area of each system's aperture [m²]: 2 ft square, or a tube of 14 inches."""


def world_of(station: Station) -> World:
    """Make the world of a station with emulated instruments; raises `ConfigError` for what it cannot show."""
    emulation = station.emulation
    if emulation is None:
        raise ConfigError(f"station '{station.name}': emulated instruments need an [emulation] table")
    if emulation.cloud_cover > 0:
        raise ConfigError(
            f"station '{station.name}': emulation.cloud_cover: the plain world has no drifting clouds", "set it to 0"
        )
    return build_world(
        PlainOptions(
            latitude_deg=station.site.latitude_deg,
            longitude_deg=station.site.longitude_deg,
            elevation_m=station.site.elevation_m,
            extinction=EXTINCTION[emulation.sky],
            aperture_m2=APERTURE_M2[emulation.system],
            distance_m=station.goniometer.distance_m,
        )
    )
