"""Where a fisheye camera that looks at the zenith sees what, and how much its rim darkens.

A lens maps the angle theta from its axis to a distance r from the picture's centre. Known shapes are equidistant (r ~
theta), equisolid (r ~ 2 sin(theta / 2)) and, for measured lenses, an odd polynomial of theta. Taking one for the other
moves directions by up to 3.8°. OpenCV's fisheye model folds back beyond 90°, where such lenses still see, so it is not
used.
"""

from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from labdaq.directions import sky_vector

Floats = NDArray[np.float64]

PROJECTIONS: Final = ("equidistant", "equisolid", "polynomial")


@dataclass(frozen=True)
class Lens:
    """A fisheye lens and how its camera stood.

    Attributes
    ----------
    centre_row, centre_column
        Where the axis meets the picture [pixel; the first pixel's middle is 0.5].
    radius_px
        Distance from the centre at which ``edge_deg`` is seen [pixel].
    edge_deg
        Angle from the axis at that distance [deg]: half the lens's field of view, e.g. 90 or 93.
    projection
        One of `PROJECTIONS`.
    coefficients
        For ``polynomial``: r / radius = c1 u + c3 u³ + c5 u⁵ ... with u = theta / edge; they sum to 1.
    up_azimuth_deg
        Azimuth towards which the picture's top points [deg]; 0 for a camera set up with north at the top.
    east_at_right
        The picture is mirrored (east at its right when north is at the top): a camera below a mirror.
    vignetting
        Light at angle theta over that on the axis is 1 + v1 u² + v2 u⁴ + ..., for the aperture used.
    """

    centre_row: float
    centre_column: float
    radius_px: float
    edge_deg: float = 90.0
    projection: str = "equidistant"
    coefficients: tuple[float, ...] = (1.0,)
    up_azimuth_deg: float = 0.0
    east_at_right: bool = False
    vignetting: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        if self.projection not in PROJECTIONS:
            raise ValueError(f"a lens is one of {', '.join(PROJECTIONS)}, not {self.projection!r}")
        if not (self.radius_px > 0.0 and 0.0 < self.edge_deg <= 180.0):
            raise ValueError(f"a lens with a circle of {self.radius_px:g} pixels at {self.edge_deg:g}° cannot be")
        steps = np.diff(self.radius(np.linspace(0.0, self.edge_deg, 500)))
        if np.any(steps <= 0.0):
            raise ValueError("the lens's coefficients do not make r grow with the angle up to its edge")
        if np.any(self.falloff(np.linspace(0.0, self.edge_deg, 500)) <= 0.05):
            raise ValueError("the vignetting coefficients leave less than 5 % of the light inside the circle")

    def radius(self, theta_deg: ArrayLike) -> Floats:
        """Distance from the centre [pixel] of what is seen at an angle from the axis [deg]."""
        theta = np.asarray(theta_deg, dtype=np.float64)
        if self.projection == "equisolid":
            share = np.sin(np.radians(theta) / 2.0) / np.sin(np.radians(self.edge_deg) / 2.0)
        else:
            u = theta / self.edge_deg
            powers = self.coefficients if self.projection == "polynomial" else (1.0,)
            share = sum((c * u ** (2 * k + 1) for k, c in enumerate(powers)), np.zeros_like(u))
        return np.asarray(self.radius_px * share)

    def theta(self, radius_px: ArrayLike) -> Floats:
        """Angle from the axis [deg] seen at a distance from the centre [pixel]; continued straight beyond the edge."""
        r = np.asarray(radius_px, dtype=np.float64)
        angles = np.linspace(0.0, self.edge_deg, 4001)
        radii = self.radius(angles)
        inside = np.interp(r, radii, angles)
        slope = (angles[-1] - angles[-2]) / (radii[-1] - radii[-2])
        return np.where(r > self.radius_px, self.edge_deg + (r - self.radius_px) * slope, inside)

    def falloff(self, theta_deg: ArrayLike) -> Floats:
        """Share of the light that arrives from an angle [deg], 1 on the axis; held constant beyond the edge."""
        u2 = np.minimum(np.asarray(theta_deg, dtype=np.float64) / self.edge_deg, 1.0) ** 2
        return np.asarray(1.0 + sum((v * u2 ** (k + 1) for k, v in enumerate(self.vignetting)), np.zeros_like(u2)))

    def place(self, directions: ArrayLike) -> tuple[Floats, Floats]:
        """Row and column [pixel] at which unit vectors (..., 3) are seen, the camera looking at the zenith."""
        d = np.asarray(directions, dtype=np.float64)
        across = np.hypot(d[..., 0], d[..., 1])
        r = self.radius(np.degrees(np.arctan2(across, d[..., 2])))
        per = np.where(across > 0.0, r / np.maximum(across, 1e-300), 0.0)
        up = sky_vector(0.0, self.up_azimuth_deg)
        along_up = d[..., 0] * up[0] + d[..., 1] * up[1]
        # 90° clockwise from up (seen on a ground map) lies at the left of a picture taken looking up
        clockwise = d[..., 0] * up[1] - d[..., 1] * up[0]
        side = 1.0 if self.east_at_right else -1.0
        return self.centre_row - along_up * per, self.centre_column + side * clockwise * per

    def direction(self, rows: ArrayLike, columns: ArrayLike) -> Floats:
        """Unit vectors (..., 3) seen at rows and columns [pixel]; the inverse of `place`."""
        side = 1.0 if self.east_at_right else -1.0
        up_part = self.centre_row - np.asarray(rows, dtype=np.float64)
        clockwise = side * (np.asarray(columns, dtype=np.float64) - self.centre_column)
        r = np.hypot(up_part, clockwise)
        theta = np.radians(self.theta(r))
        per = np.where(r > 0.0, np.sin(theta) / np.maximum(r, 1e-300), 0.0)
        up = sky_vector(0.0, self.up_azimuth_deg)
        x = (up_part * up[0] + clockwise * up[1]) * per
        y = (up_part * up[1] - clockwise * up[0]) * per
        return np.stack(np.broadcast_arrays(x, y, np.cos(theta)), axis=-1)

    def in_merged_pixels(self, step: int) -> "Lens":
        """The lens for a picture in which ``step`` x ``step`` pixels were merged into one."""
        return replace(
            self,
            centre_row=self.centre_row / step,
            centre_column=self.centre_column / step,
            radius_px=self.radius_px / step,
        )


def find_circle(luminance: NDArray[np.float32]) -> tuple[float, float, float]:
    """Row and column of the centre and radius [pixel] of the lit circle of a fisheye picture (H, W).

    The edge is looked for along 720 rays as the outermost place where luminance falls through a fifth of the picture's
    brighter median; the circle is the one most of these places lie on, so that trees, masts and the arm of a shading
    disc do not matter while half the rim shows sky. A circle measured once is better still.

    Raises `ValueError` when no circle can be seen.
    """
    height, width = luminance.shape
    coarse = max(1, max(height, width) // 500)
    lit = luminance[::coarse, ::coarse]
    bright = lit[lit > 0.02 * np.quantile(lit, 0.9)]
    level = 0.2 * float(np.median(bright)) if bright.size else 0.0
    rows, columns = np.nonzero(lit > level)
    if len(rows) == 0:
        raise ValueError("the picture is black: there is no circle")
    centre = (np.array([np.median(rows), np.median(columns)]) + 0.5) * coarse
    radius = float(np.hypot(height, width)) / 2.0
    for reach, step in ((2.0, coarse), (1.2, coarse), (1.1, coarse), (1.05, 0.5)):
        start = 4.0 if step == coarse else 0.5 * radius
        y, x = _rim(luminance, level, centre, np.arange(start, reach * radius, step))
        centre, radius = _fit_circle(y, x)
    if not 0.1 * min(height, width) < radius < 1.2 * max(height, width):
        raise ValueError(f"the circle found has a radius of {radius:.0f} pixels, which cannot be in this picture")
    return float(centre[0]), float(centre[1]), float(radius)


def _rim(luminance: NDArray[np.float32], level: float, centre: Floats, reach: Floats) -> tuple[Floats, Floats]:
    """Rows and columns of the outermost places brighter than ``level``, seen from the centre in 720 directions.

    Raises `ValueError` when too few lie inside the picture.
    """
    height, width = luminance.shape
    angles = np.radians(np.arange(0.0, 360.0, 0.5))
    r = centre[0] + np.sin(angles)[:, None] * reach
    c = centre[1] + np.cos(angles)[:, None] * reach
    within = (r >= 0) & (r < height) & (c >= 0) & (c < width)
    i, j = np.clip(r.astype(np.int64), 0, height - 1), np.clip(c.astype(np.int64), 0, width - 1)
    hit = within & (luminance[i, j] > level)
    last = hit.shape[1] - 1 - np.argmax(hit[:, ::-1], axis=1)
    # an edge on the picture's own border is none
    beyond = np.minimum(last + 2, hit.shape[1] - 1)[:, None]
    free = hit.any(axis=1) & np.take_along_axis(within, beyond, 1)[:, 0] & (last < hit.shape[1] - 1)
    if np.count_nonzero(free) < 60:
        raise ValueError("no circle can be seen in the picture: too little of its rim is inside")
    return r[free, last[free]], c[free, last[free]]


def _fit_circle(y: Floats, x: Floats) -> tuple[Floats, float]:
    """Centre and radius of the circle that most of the points lie on, whatever the others do.

    The circle through three points that has most others within two pixels (1000 tries, always the same ones), then
    fitted to those.
    """
    three = np.random.default_rng(0).integers(0, len(y), (1000, 3))
    (y1, y2, y3), (x1, x2, x3) = y[three].T, x[three].T
    # where the perpendicular bisectors of two chords meet
    a, b, e = y2 - y1, x2 - x1, (y2**2 - y1**2 + x2**2 - x1**2) / 2.0
    c, d, f = y3 - y1, x3 - x1, (y3**2 - y1**2 + x3**2 - x1**2) / 2.0
    area = a * d - b * c
    area[np.abs(area) < 1e-6] = np.nan
    middle_y, middle_x = (e * d - b * f) / area, (a * f - e * c) / area
    off = np.abs(
        np.hypot(y - middle_y[:, None], x - middle_x[:, None]) - np.hypot(y1 - middle_y, x1 - middle_x)[:, None]
    )
    best = off[int(np.argmax(np.count_nonzero(off < 2.0, axis=1)))] < 2.0
    for _ in range(3):
        centre, radius = _circle_of(y[best], x[best])
        best = np.abs(np.hypot(y - centre[0], x - centre[1]) - radius) < 1.5
    return _circle_of(y[best], x[best])


def _circle_of(y: Floats, x: Floats) -> tuple[Floats, float]:
    """Least squares circle through points (Kåsa 1976)."""
    design = np.stack([2 * y, 2 * x, np.ones(len(y))], axis=1)
    solved = np.linalg.lstsq(design, y**2 + x**2, rcond=None)[0]
    centre = np.asarray(solved[:2], dtype=np.float64)
    return centre, float(np.sqrt(max(float(solved[2] + centre @ centre), 0.0)))
