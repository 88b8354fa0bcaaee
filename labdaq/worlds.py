"""The world that a station's emulators observe, from its ``[emulation]`` table."""

from typing import TYPE_CHECKING

from labdaq.errors import ConfigError
from labdaq.station import Station

if TYPE_CHECKING:
    from simulators.world.concealed import Concealed
    from simulators.world.emulated import EmulatedWorld


def world_of(station: Station, concealed: "Concealed | None" = None) -> "EmulatedWorld":
    """Make the world of a station with emulated instruments, with something concealed in it if that is given.

    Whoever conceals something gives ``concealed.alter`` to the emulators as well. Raises `ConfigError` for a station
    that has no ``[emulation]``.
    """
    from simulators.hidden.light import Site
    from simulators.hidden.room import Room
    from simulators.world.emulated import EmulatedWorld, WorldOptions

    emulation, room = station.emulation, station.room
    if emulation is None:
        raise ConfigError(f"station '{station.name}': emulated instruments need an [emulation] table")
    options = WorldOptions(
        site=Site(station.site.latitude_deg, station.site.longitude_deg, station.site.elevation_m),
        system=emulation.system,
        sky=emulation.sky,
        cloud_cover=emulation.cloud_cover,
        seed=emulation.seed,
        distance_m=station.goniometer.distance_m,
        room=Room(
            size_m=room.size_m,
            walls=room.wall_reflectance,
            floor=room.floor_reflectance,
            ceiling=room.wall_reflectance,
            half_angle_deg=station.goniometer.sensor_half_angle_deg,
        ),
    )
    return EmulatedWorld(options, concealed.hidden if concealed else None)
