"""Words all descriptions of scattering share.

Frame of a BSDF: z points from the front (outside) to the back (room), x to the right and y up for somebody in the
room who looks out; for a horizontal lens in a roof x is east, y south and z down. A direction of travel is given by
its x and y alone, (..., 2) within the unit disc; the component says which way z goes. Light that passes straight
through, or is reflected by a mirror, keeps x and y.

"Front" is the side the light comes from in WINDOW's and the LBNL files' sense (Transmission Front: from outside to
inside). Radiance calls the same component "back", because its normal points into the room (``bsdf_m.c``).
"""

from dataclasses import dataclass
from enum import StrEnum
from typing import Literal, Protocol

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Incidence = Literal["front", "back"]


class Component(StrEnum):
    """One of the four parts of a BSDF, as LBNL files name them."""

    TF = "Transmission Front"
    TB = "Transmission Back"
    RF = "Reflection Front"
    RB = "Reflection Back"

    @property
    def key(self) -> str:
        """Its name in tables and on the command line, e.g. ``transmission-front``."""
        return self.value.lower().replace(" ", "-")

    @property
    def incidence(self) -> Incidence:
        """The side the light arrives at."""
        return "front" if self in (Component.TF, Component.RF) else "back"

    @property
    def transmits(self) -> bool:
        """Whether light goes through."""
        return self in (Component.TF, Component.TB)

    @property
    def reciprocal(self) -> "Component":
        """The component that describes the same paths walked backwards."""
        return {Component.TF: Component.TB, Component.TB: Component.TF}.get(self, self)


@dataclass(frozen=True)
class Material:
    """What a BSDF file says about its sample.

    Attributes
    ----------
    name, manufacturer
        Free text.
    thickness_m, width_m, height_m
        Size [m]; ``None`` when the file does not tell.
    device
        LBNL's device type, e.g. ``Other``.
    """

    name: str = ""
    manufacturer: str = ""
    thickness_m: float | None = None
    width_m: float | None = None
    height_m: float | None = None
    device: str = "Other"


class Bsdf(Protocol):
    """A description of scattering that can be asked for values."""

    def components(self) -> tuple[Component, ...]:
        """The parts it describes."""
        ...

    def evaluate(self, component: Component, incident_xy: Floats, outgoing_xy: Floats) -> Floats:
        """BSDF [1/sr] for directions of travel (..., 2), which broadcast; 0 for a part it does not describe."""
        ...

    def hemispherical(self, component: Component, incident_xy: Floats) -> Floats:
        """Part of the light from each direction (..., 2) that this component sends on, 0 to 1."""
        ...


class Tracer(Protocol):
    """Something light can be sent at: a geometry that is ray traced, a whole skylight, or a BSDF."""

    def __call__(
        self, incidence: Incidence, travel: Floats, per_direction: int, rng: Generator
    ) -> tuple[Floats, Floats]:
        """Follow m samples of each direction of travel (n, 3) in the BSDF's frame: (n, m, 3) and weights (n, m)."""
        ...


def with_z(xy: Floats, sign: float) -> Floats:
    """Unit vectors (..., 3) of given x and y, with z of the given sign."""
    z = np.sqrt(np.maximum(0.0, 1.0 - np.sum(xy**2, axis=-1)))
    return np.concatenate([xy, (sign * z)[..., None]], axis=-1)


def travel_sign(incidence: Incidence) -> float:
    """Sign of z of light that arrives at a side."""
    return 1.0 if incidence == "front" else -1.0


def component_of(incidence: Incidence, transmitted: bool) -> Component:
    """The component of light that arrives at a side and goes through, or not."""
    if incidence == "front":
        return Component.TF if transmitted else Component.RF
    return Component.TB if transmitted else Component.RB
