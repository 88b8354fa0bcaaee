"""A fisheye lens looking straight up: which way each pixel looks, and how much light it loses on the way.

The picture's top is north and its right west, as one sees the sky lying on the back with the head to the north; so the
angle from the top, clockwise, is C of the type C photometry. Radiance's angular fisheye with ``-vd 0 0 1 -vu 0 1 0``
has the same orientation.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

NOMINAL_VIGNETTING: Final = (-0.05, -0.02, -0.16)
"""Coefficients of (r/R)², (r/R)⁴, (r/R)⁶: 23 % loss at the rim, what is remembered of this lens at f/4."""


@dataclass(frozen=True, slots=True)
class FisheyeLens:
    """The lens and how it is mounted.

    Attributes
    ----------
    field_deg
        Full field of view, from rim to rim [deg].
    vignetting
        Coefficients of even powers of the relative radius, from the second on; transmission is 1 in the centre.
    veil
        Light scattered evenly over the picture, as a share of the mean luminance inside the circle.
    projection
        Angle from the axis over half the field, as a function of relative radius in [0, 1]; ``None`` is equidistant.
        The hook for projection errors.
    rotation_deg
        Azimuth that the picture's top points to [deg].
    circle
        Diameter of the picture circle over the picture's shorter side.
    """

    field_deg: float = 183.0
    vignetting: tuple[float, ...] = NOMINAL_VIGNETTING
    veil: float = 0.0
    projection: Callable[[Floats], Floats] | None = None
    rotation_deg: float = 0.0
    circle: float = 0.96


@dataclass(frozen=True, slots=True)
class View:
    """Where the pixels inside the picture circle look.

    Attributes
    ----------
    inside
        Which pixels lie in the circle, bool (H, W).
    towards
        Unit vectors of those pixels' centres, (n, 3), in the order of ``inside``'s true values.
    transmission
        Vignetting factor of each, (n,).
    solid_angle
        What each covers of the sky [sr], (n,).
    pixel_deg
        Angle a pixel covers in the centre of an equidistant picture [deg].
    """

    inside: NDArray[np.bool_]
    towards: Floats
    transmission: Floats
    solid_angle: Floats
    pixel_deg: float


def view(lens: FisheyeLens, width: int, height: int) -> View:
    """Directions of all pixels of a ``width`` × ``height`` picture; the circle is centred between the middle pixels."""
    radius = lens.circle * min(width, height) / 2.0
    right = np.arange(width) - (width - 1) / 2.0
    up = (height - 1) / 2.0 - np.arange(height)
    x, y = np.meshgrid(right, up)
    relative = np.hypot(x, y) / radius
    inside = relative <= 1.0
    r = np.maximum(relative[inside], 1e-9)
    half_field = np.radians(lens.field_deg / 2.0)
    theta = half_field * _share(lens, r)
    turn = np.arctan2(x[inside], y[inside]) - np.radians(lens.rotation_deg)  # clockwise from north as seen: C
    sine = np.sin(theta)
    towards = np.stack([-sine * np.sin(turn), sine * np.cos(turn), np.cos(theta)]).T  # each coordinate contiguous
    transmission = np.ones_like(r)
    for k, coefficient in enumerate(lens.vignetting):
        transmission += coefficient * r ** (2 * k + 2)
    slope = half_field * (_share(lens, r + 1e-6) - _share(lens, r - 1e-6)) / 2e-6
    solid_angle = sine * slope / r / radius**2
    return View(inside, towards, np.clip(transmission, 0.0, None), solid_angle, lens.field_deg / 2.0 / radius)


def along(towards: Floats, axis: Floats) -> Floats:
    """Scalar product of each direction (n, 3) with an axis (3,): faster here than through a threaded BLAS."""
    product: Floats = towards[:, 0] * axis[0]
    product += towards[:, 1] * axis[1]
    product += towards[:, 2] * axis[2]
    return product


def _share(lens: FisheyeLens, relative_radius: Floats) -> Floats:
    return relative_radius if lens.projection is None else lens.projection(relative_radius)
