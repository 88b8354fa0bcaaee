"""The skylights that trials are made with, and what differs between each and its simulation.

The simulation's lens is the nominal one. The lens that really hangs there was moulded a little differently: facets
steeper by 0.4 degrees, normals 0.5 degrees more uneven with heavier tails, ridges rounded on one part in fifty. A
trial takes a share of it (a zone of the sheet), from a tenth to all.
"""

from dataclasses import dataclass, replace
from typing import Final

from simulators.hidden.lens import Lens
from simulators.hidden.skylight import Skylight, box, top, tube

CLEAR: Final = Lens(kind="clear", absorption_per_mm=0.0)
NONE: Final = Lens(kind="none")


def _sheet(slope_deg: float) -> Lens:
    return Lens(slopes_deg=(slope_deg,) * 4)


DESIGNS: Final[dict[str, Skylight]] = {
    "top": top(),
    "box": box(),
    "tube": tube(),
    "deep-top": top(depth_m=0.9, wall_reflectance=0.8, entry=_sheet(22.0), rise_m=0.1),
    "shallow-box": box(depth_m=0.4, wall_reflectance=0.92, entry=_sheet(32.0), exit=_sheet(32.0)),
    "wide-tube": tube(depth_m=1.2, width_m=0.56, length_m=0.56, rise_m=0.16, exit=_sheet(23.0), boot_m=0.1),
    "ridged-top": top(
        depth_m=0.5, wall_reflectance=0.88, entry=Lens(slopes_deg=(33.0, 33.0, 13.0, 13.0), blur_deg=3.0)
    ),
    "crossed-box": box(
        entry=Lens(slopes_deg=(36.0,) * 4, blur_deg=2.5), exit=Lens(slopes_deg=(20.0,) * 4, orientation_deg=24.0)
    ),
    "soft-tube": tube(depth_m=1.5, wall_reflectance=0.97, exit=Lens(slopes_deg=(25.0,) * 4, blur_deg=9.0, haze=0.08)),
}
"""Name to skylight with the simulation's lens; the last three have prisms that nobody would suppose."""


def as_moulded(lens: Lens) -> Lens:
    """The sheet as it left the mould, where the simulation has the drawing's."""
    if lens.kind != "prismatic":
        return lens
    east, west, north, south = (slope + 0.4 for slope in lens.slopes_deg)
    return replace(
        lens, slopes_deg=(east, west, north, south), blur_deg=lens.blur_deg + 0.5, blur_power=0.62, rounded=0.02
    )


def moulded(skylight: Skylight) -> Skylight:
    """The same skylight with sheets as they left the mould."""
    return replace(skylight, entry=as_moulded(skylight.entry), exit=as_moulded(skylight.exit))


def isotropic(skylight: Skylight) -> Skylight:
    """The same skylight as a simulation sees it that knows no directions within a sheet."""
    return replace(skylight, entry=replace(skylight.entry, isotropic=1.0), exit=replace(skylight.exit, isotropic=1.0))


@dataclass(frozen=True)
class Wanted:
    """One response that trials need: which design, with which lens."""

    design: str
    moulded: bool = False
    isotropic: bool = False
    turned_deg: float = 0.0

    def skylight(self) -> Skylight:
        """What has to be traced."""
        skylight = DESIGNS[self.design]
        if self.moulded:
            skylight = moulded(skylight)
        if self.isotropic:
            skylight = isotropic(skylight)
        return skylight.turned(self.turned_deg) if self.turned_deg else skylight


TURNED: Final[dict[str, tuple[float, ...]]] = {"crossed-box": (-27.0, 27.0)}
"""Designs that are not round, of which responses with a turned lens exist, and the turns [deg]."""
