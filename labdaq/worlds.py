"""The world that a station's emulators observe, from its ``[emulation]`` table."""

from labdaq.station import Station
from simulators.world.observed import World
from simulators.world.plain import PlainOptions, build_world


def world_of(station: Station) -> World:
    """Make the world of a station."""
    return build_world(
        PlainOptions(
            latitude_deg=station.site.latitude_deg,
            longitude_deg=station.site.longitude_deg,
            elevation_m=station.site.elevation_m,
            distance_m=station.goniometer.distance_m,
        )
    )
