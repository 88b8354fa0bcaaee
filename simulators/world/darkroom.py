"""The dark room's own light at the goniophotometer's sensors: radiosity, worked out once for a set of places."""

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Final

import numpy as np
from numpy.typing import NDArray

from simulators.hidden.arm import ArmFaults, sensors
from simulators.hidden.maps import Field
from simulators.hidden.room import Room

Floats = NDArray[np.float64]

GAMMA_NODES: Final[Floats] = np.array([0.0, 5.0, 15.0, 25.0, 35.0, 45.0, 55.0, 65.0, 75.0, 85.0, 90.0])
C_NODES: Final[Floats] = np.linspace(0.0, 348.75, 32)


@dataclass
class DarkRoom:
    """A room that gives back some light, and the sensors on their half circle in it.

    Attributes
    ----------
    room
        Its surfaces.
    distance_m
        Radius of the half circle about the aperture's centre.
    """

    room: Room
    distance_m: float

    @cached_property
    def _transfer(self) -> Floats:
        """Illuminance at the nodes per first exitance of each patch, (C nodes * gamma nodes, patches)."""
        here = sensors(GAMMA_NODES, C_NODES, self.distance_m, ArmFaults())
        return self.room.transfer(self.room.seen(here.places, here.aims))

    def glow(self, field: Field) -> Floats:
        """Illuminance [lx] that the room adds at the nodes, (C nodes, gamma nodes), under a skylight's light."""
        if self.room.black():
            return np.zeros((len(C_NODES), len(GAMMA_NODES)))
        return (self._transfer @ self.room.first_exitance(field)).reshape(len(C_NODES), len(GAMMA_NODES))


def between_nodes(table: Floats, gamma_deg: Floats, c_deg: float) -> Floats:
    """A `DarkRoom.glow` at other angles, by linear interpolation; nominal directions are nodes themselves."""
    place = (c_deg % 360.0) / 11.25
    low = int(place) % len(C_NODES)
    u = place - math.floor(place)
    row = (1.0 - u) * table[low] + u * table[(low + 1) % len(C_NODES)]
    return np.asarray(np.interp(gamma_deg, GAMMA_NODES, row))
