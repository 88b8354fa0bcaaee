"""The direction of which a BSDF sends on most light, and when users are told of it.

A lens sends on no more light than it receives. The BSDF of a whole skylight may (`analysis.simulate.whole`): its
incident light is counted by what falls on the hole in the roof, and a raised cover catches more at grazing incidence. A
half sphere catches (1 + cos) / (2 cos) of it, 4.4 times the light of the last ring of the full Klems basis, 15.8 times
that of the 4x basis.
"""

import math
from dataclasses import dataclass
from typing import Any, Final, cast

import numpy as np
from numpy.typing import NDArray

from analysis.bsdf.disk import disk_of_square
from analysis.bsdf.klems import KlemsBsdf
from analysis.bsdf.model import Incidence, component_of
from analysis.bsdf.tensor_tree import TensorTreeBsdf

Floats = NDArray[np.float64]

TOLD: Final = 1.02
"""Share from which on users are told: less is noise and rounding of measured files."""

_SIDES: Final[tuple[Incidence, Incidence]] = ("front", "back")


@dataclass(frozen=True, slots=True)
class Light:
    """Light of one direction.

    Attributes
    ----------
    side
        That it meets.
    theta_deg, phi_deg
        Direction of travel in the BSDF's frame, theta from the normal [deg].
    share
        Transmittance plus reflectance.
    """

    side: Incidence
    theta_deg: float
    phi_deg: float
    share: float

    def __str__(self) -> str:
        where = f"{self.theta_deg:.3g} degrees from the normal, phi {self.phi_deg:.3g}"
        return f"of light that meets the {self.side} travelling {where}, {self.share:.4g} times as much goes on"

    def row(self) -> Floats:
        """As numbers, to be kept."""
        return np.array([_SIDES.index(self.side), self.theta_deg, self.phi_deg, self.share])

    @classmethod
    def of(cls, row: NDArray[Any]) -> "Light":
        """From the numbers of `row`."""
        return cls(_SIDES[int(row[0])], *map(float, row[1:]))


def brightest(bsdf: KlemsBsdf | TensorTreeBsdf) -> Light:
    """The direction of which most light is sent on: of all patches, or of all cells of the finest level."""
    travel = _incident(bsdf)
    found = []
    for side in _SIDES:
        parts = (component_of(side, transmitted) for transmitted in (True, False))
        share = sum((bsdf.hemispherical(part, travel) for part in parts), start=np.zeros(len(travel)))
        k = int(share.argmax())
        x, y = travel[k]
        theta = math.degrees(math.asin(min(1.0, math.hypot(x, y))))
        found.append(Light(side, theta, math.degrees(math.atan2(y, x)) % 360.0, float(share[k])))
    return max(found, key=lambda light: light.share)


def _incident(bsdf: KlemsBsdf | TensorTreeBsdf) -> Floats:
    """One direction of travel (n, 2) of each incident patch or cell."""
    if isinstance(bsdf, KlemsBsdf):
        return bsdf.basis.centre_xy
    n = 1 << max(tree.depth for tree in bsdf.trees.values())
    axis = (np.arange(n) + 0.5) / n
    if bsdf.rank == 3:
        return np.stack([axis, np.zeros(n)], axis=-1)
    return cast(Floats, disk_of_square(np.stack(np.meshgrid(axis, axis, indexing="ij"), axis=-1)).reshape(-1, 2))
