"""What a skylight is made of: sheets that light passes, walls, and the outline of well and cover."""

import math
from typing import Annotated, Final, Literal, Self

from pydantic import ConfigDict, Field, model_validator
from pydantic.dataclasses import dataclass

STRICT: Final = ConfigDict(extra="forbid", allow_inf_nan=False)

Share = Annotated[float, Field(ge=0.0, le=1.0)]
Positive = Annotated[float, Field(gt=0.0)]
NotNegative = Annotated[float, Field(ge=0.0)]


@dataclass(frozen=True, config=STRICT)
class Lens:
    """A sheet that light passes: nothing, a clear slab, a prismatic sheet, a diffuser, what a file or a density says.

    Attributes
    ----------
    kind
        ``none``, ``clear`` (thin slab, straight through), ``prismatic`` (square pyramids on one side), ``diffusing``,
        ``bsdf`` (a file), ``shift`` (differences of direction cosines).
    refractive_index, thickness_mm, absorption_per_mm
        Of the solid; absorption is the natural-logarithm coefficient [1/mm].
    pitch_mm, slope_deg, blur_deg
        Of the pyramids: width of a base, angle of a facet to the sheet, and the standard deviation of its slope in each
        of two directions (moulding tilts facets at random).
    prisms
        Which side carries the pyramids; of a file, which way its back looks (``down``: its front is outside).
    orientation_deg
        The pattern is turned by this about the sheet's normal, counter-clockwise seen from above; 0 has the edges of
        the pyramids parallel to x and y.
    mirrored
        The (turned) pattern is mirrored: east and west exchanged.
    isotropic
        The pattern is turned at random at every hit: the lens as a simulation with an isotropic BSDF sees it.
    haze
        Share [0..1] of the transmitted light that leaves as a cosine lobe instead.
    soiling
        Optical depth of dirt on the outside at normal incidence: transmittance exp(-soiling / cos θ).
    transmittance, reflectance
        Of a diffusing sheet only [0..1]; both lobes are cosine lobes.
    bsdf
        LBNL BSDF file (Klems matrix or tensor tree); a relative name counts from the folder of the system's file, else
        from where the program runs. With orientation 0 and the front up, the file's x is east and its y south; with the
        front down y is north. What the file does not describe is black.
    shifts
        Of kind ``shift``: shares of the light whose tangential direction cosines change by so much, on the cells of
        `analysis.simulate.lens_shift`, x outermost; on any scale.
    kept
        Of kind ``shift``: the share of its tangential direction cosines to which the light's change is added [0..1]. A
        sheet that draws light towards its normal keeps less than all.
    stretch, stretch_axis_deg
        Of kind ``shift``: changes are longer by this share along an axis, counter-clockwise from x seen from above,
        and shorter by as much across it.
    """

    kind: Literal["none", "clear", "prismatic", "diffusing", "bsdf", "shift"] = "prismatic"
    refractive_index: Annotated[float, Field(ge=1.0, le=3.0)] = 1.491
    thickness_mm: Positive = 3.0
    absorption_per_mm: NotNegative = 0.03
    pitch_mm: Positive = 5.0
    slope_deg: Annotated[float, Field(ge=0.0, le=60.0)] = 27.0
    blur_deg: Annotated[float, Field(ge=0.0, le=20.0)] = 4.0
    prisms: Literal["down", "up"] = "down"
    orientation_deg: float = 0.0
    mirrored: bool = False
    isotropic: bool = False
    haze: Share = 0.0
    soiling: NotNegative = 0.0
    transmittance: Share = 0.6
    reflectance: Share = 0.3
    bsdf: str = ""
    shifts: tuple[float, ...] = ()
    kept: Share = 1.0
    stretch: Annotated[float, Field(gt=-1.0, le=4.0)] = 0.0
    stretch_axis_deg: float = 0.0

    @model_validator(mode="after")
    def _has_what_it_needs(self) -> Self:
        if (self.kind == "bsdf") != bool(self.bsdf):
            raise ValueError("a lens of kind bsdf names its file in bsdf, and no other kind does")
        if (self.kind == "shift") != _is_density(self.shifts):
            raise ValueError("a lens of kind shift, and no other kind, has shares of a square of cells in shifts")
        if self.kind == "diffusing" and self.transmittance + self.reflectance > 1.0:
            raise ValueError("transmittance and reflectance of a diffusing sheet add to more than 1")
        return self


def _is_density(shifts: tuple[float, ...]) -> bool:
    """Whether numbers can be shares of the cells of a square."""
    return math.isqrt(len(shifts)) ** 2 == len(shifts) and min(shifts, default=-1.0) >= 0.0 and sum(shifts) > 0.0


@dataclass(frozen=True, config=STRICT)
class Wall:
    """Reflection at the well's (or boot's) wall.

    Attributes
    ----------
    reflectance
        Hemispherical [0..1], the same at all angles.
    finish
        ``specular`` or ``diffuse`` (Lambert).
    scatter_deg
        Gaussian spread of the mirror direction, rms of each of two perpendicular angles [deg].
    diffuse_fraction
        Share of the reflected light that is Lambertian on a specular wall [0..1].
    """

    reflectance: Share = 0.95
    finish: Literal["specular", "diffuse"] = "specular"
    scatter_deg: Annotated[float, Field(ge=0.0, le=30.0)] = 0.0
    diffuse_fraction: Share = 0.0

    @property
    def lambertian(self) -> float:
        """Share of the reflected light that follows Lambert's law."""
        return 1.0 if self.finish == "diffuse" else self.diffuse_fraction


@dataclass(frozen=True, config=STRICT)
class Aperture:
    """Outline of well and cover: a rectangle (x by y) or a disc [m]."""

    shape: Literal["rectangle", "disc"] = "rectangle"
    size_m: tuple[float, float] = (0.6096, 0.6096)
    diameter_m: Positive = 0.3556

    @model_validator(mode="after")
    def _has_area(self) -> Self:
        if min(self.size_m) <= 0.0:
            raise ValueError("size_m must be positive")
        return self
