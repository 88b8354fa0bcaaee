"""The shading disc in the picture: found, and taken out.

A disc on an arm keeps the sun off the camera. It shows as a patch well below the sky around the sun, with a straight
rod attached; a straight rod is seen along a great circle. So: what is dark against its ring of equal distance from the
sun, within reach of the sun, is the disc; the direction around the disc in which darkness goes on is the arm's; a disc
and a strip, each a little wider than seen (both are out of focus), are masked, and nothing else, lest dark clouds and
trees go with them.
"""

from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from analysis.sky.map import SkyMap
from labdaq.directions import angle_between

Floats = NDArray[np.float64]
Mask = NDArray[np.bool_]

DARK: Final = 0.5
"""Darker than this share of the sky at the same distance from the sun is not sky."""

REACH_DEG: Final = 12.0
"""How far from the sun's place the disc is looked for."""

MARGIN_DEG: Final = 1.0
"""How much wider than seen the disc and its arm are masked."""


@dataclass(frozen=True, eq=False)
class ShadingDisc:
    """What hides the sun in a sky map.

    Attributes
    ----------
    mask : shape (n, n)
        Pixels that do not show sky.
    centre : shape (3,)
        Unit vector to the disc's middle.
    radius_deg
        Angular radius of the masked disc [deg], margin included.
    arm_deg
        Direction in which the arm leaves the disc [deg from the upward side, clockwise as seen]; ``None`` without one.
    arm_half_width_deg
        Half the masked strip's width [deg].
    off_sun_deg
        Between the disc's middle and the sun [deg].
    contrast
        Median luminance inside the disc over that of the ring around it; ``None`` without a disc.
    flags
        ``no-disc-found`` (a cone round the sun was taken), ``disc-off-sun`` (by more than half its radius).
    """

    mask: Mask
    centre: Floats
    radius_deg: float
    arm_deg: float | None
    arm_half_width_deg: float
    off_sun_deg: float
    contrast: float | None
    flags: tuple[str, ...]

    def record(self) -> dict[str, Any]:
        """JSON-able account of what was found."""
        return {
            "radius_deg": round(self.radius_deg, 3),
            "off_sun_deg": round(self.off_sun_deg, 3),
            "arm_deg": None if self.arm_deg is None else round(self.arm_deg, 1),
            "arm_half_width_deg": round(self.arm_half_width_deg, 2),
            "contrast": None if self.contrast is None else round(self.contrast, 4),
            "pixels": int(np.count_nonzero(self.mask)),
            "flags": list(self.flags),
        }


def find_disc(sky: SkyMap, sun: Floats, assumed_half_angle_deg: float = 5.0) -> ShadingDisc:
    """Find the shading disc near the sun's direction (3,).

    Where no patch is dark enough, a cone of ``assumed_half_angle_deg`` round the sun is taken, and flagged.
    """
    off = angle_between(sky.directions, sun)
    dark = _dark(sky, off)
    patch = _patch(dark & (off < REACH_DEG), off)
    least = np.radians(0.7) ** 2 * np.pi  # a disc of 0.7° hides the sun with little to spare
    if patch is None or float(np.sum(sky.solid_angle_sr[patch])) < least:
        cone = sky.near(sun, assumed_half_angle_deg)
        return ShadingDisc(cone, sun, assumed_half_angle_deg, None, 0.0, 0.0, None, ("no-disc-found",))
    centre, radius = _disc_of(sky, patch)
    from_centre = angle_between(sky.directions, centre)
    arm, half_width = _arm(sky, dark, centre, radius)
    masked_radius = radius + MARGIN_DEG
    mask = (from_centre <= masked_radius) & sky.known
    if arm is not None:
        mask |= _strip(sky, centre, arm, half_width + MARGIN_DEG) & sky.known
    ring = sky.known & (from_centre > masked_radius) & (from_centre < masked_radius + 4.0) & ~mask
    inside = sky.known & (from_centre < 0.7 * radius)
    contrast = float(np.median(sky.luminance[inside]) / max(float(np.median(sky.luminance[ring])), 1e-30))
    off_sun = float(angle_between(centre, sun))
    flags = ("disc-off-sun",) if off_sun > radius / 2.0 else ()
    width = half_width + MARGIN_DEG if arm is not None else 0.0
    return ShadingDisc(mask, centre, masked_radius, arm, width, off_sun, contrast, flags)


def _dark(sky: SkyMap, off: Floats) -> Mask:
    """Pixels well below the usual luminance at their distance from the sun, taken in rings of half a degree."""
    rings = np.minimum((off * 2.0).astype(np.int64), 359)
    level = np.full(360, np.nan)
    for ring in np.unique(rings[sky.known]):
        here = sky.luminance[sky.known & (rings == ring)]
        # upper middle: within reach of the sun a ring may lie half in the disc, and low down half in the trees
        level[ring] = np.quantile(here, 0.6)
    # the aureole only grows towards the sun: going inwards a level may not fall below the outer ones
    near = int(REACH_DEG * 2) + 4
    running = -np.inf
    for ring in range(near, -1, -1):
        running = max(running, level[ring]) if np.isfinite(level[ring]) else running
        level[ring] = running
    return np.asarray(sky.known & (sky.luminance < DARK * np.nan_to_num(level, nan=0.0)[rings]))


def _patch(dark: Mask, off: Floats) -> Mask | None:
    """The connected dark patch nearest to the sun's place; ``None`` when none is within 6°."""
    import cv2

    count, labels = cv2.connectedComponents(dark.astype(np.uint8), connectivity=4)
    if count < 2:
        return None
    nearest = np.where(dark, off, np.inf)
    place = int(np.argmin(nearest))
    if nearest.ravel()[place] > 6.0:
        return None
    return np.asarray(labels == labels.ravel()[place])


def _disc_of(sky: SkyMap, patch: Mask) -> tuple[Floats, float]:
    """Middle (3,) and radius [deg] of the round part of a patch: the largest circle inside it, on the picture."""
    import cv2

    depth = cv2.distanceTransform(patch.astype(np.uint8), cv2.DIST_L2, 5)
    deep = depth > 0.9 * float(depth.max())
    weight = deep * sky.solid_angle_sr
    centre = np.sum(weight[..., None] * sky.directions, axis=(0, 1))
    centre /= np.linalg.norm(centre)
    # radius from the area: of patch pixels within half again of the inscribed circle, without the arm's quarter
    inscribed = float(depth.max()) * 180.0 / sky.n
    off = angle_between(sky.directions, centre)
    angle = _around(sky.directions, centre)
    radii = []
    for sector in range(16):
        here = (np.floor(angle / 22.5) == sector) & (off < 1.6 * inscribed + 1.0)
        if np.any(here):
            share = float(np.sum((patch & here) * sky.solid_angle_sr)) / (2.0 * np.pi / 16.0)
            radii.append(np.degrees(np.arccos(np.clip(1.0 - share, -1.0, 1.0))))
    return centre, float(np.median(radii))


def _around(directions: Floats, centre: Floats) -> Floats:
    """Angle [deg, 0 to 360) around ``centre`` of each direction, from the upward side, clockwise as seen."""
    side = np.cross([0.0, 0.0, 1.0], centre)
    if np.linalg.norm(side) < 1e-9:
        side = np.array([1.0, 0.0, 0.0])
    side = side / np.linalg.norm(side)  # to the left as seen, when up is up
    up = np.cross(centre, side)
    return np.asarray(np.degrees(np.arctan2(-(directions @ side), directions @ up)) % 360.0)


def _arm(sky: SkyMap, dark: Mask, centre: Floats, radius: float) -> tuple[float | None, float]:
    """Direction [deg] in which a dark rod leaves the disc, and half its width [deg]; ``None`` without one."""
    off = angle_between(sky.directions, centre)
    angle = _around(sky.directions, centre)
    near = sky.known & (off > radius + 1.5) & (off < radius + 15.0)
    bins = (angle / 2.0).astype(np.int64) % 180
    area = np.bincount(bins[near], sky.solid_angle_sr[near], 180)
    shade = np.bincount(bins[near], (sky.solid_angle_sr * dark)[near], 180)
    share = np.where(area > 0.0, shade / np.where(area > 0.0, area, 1.0), 0.0)
    best = int(np.argmax(share))
    if share[best] < 0.5:
        return None, 0.0
    # middle of the dark sector, seen from its darkest direction
    window = np.arange(best - 8, best + 9)
    weight = share[window % 180] * (share[window % 180] > 0.25)
    direction = float(np.sum(weight * (2.0 * window + 1.0)) / np.sum(weight))
    within = near & (np.abs((angle - direction + 180.0) % 360.0 - 180.0) < 30.0)
    length = 13.5  # degrees of arm looked at
    width = np.degrees(float(np.sum((sky.solid_angle_sr * dark)[within]))) / np.radians(length)
    return direction % 360.0, float(np.clip(width / 2.0, 0.25, 10.0))


def _strip(sky: SkyMap, centre: Floats, direction_deg: float, half_width_deg: float) -> Mask:
    """Pixels within ``half_width_deg`` of the great circle that leaves ``centre`` in a direction, on that side."""
    side = np.cross([0.0, 0.0, 1.0], centre)
    if np.linalg.norm(side) < 1e-9:
        side = np.array([1.0, 0.0, 0.0])
    side = side / np.linalg.norm(side)
    up = np.cross(centre, side)
    turn = np.radians(direction_deg)
    along = np.cos(turn) * up - np.sin(turn) * side
    normal = np.cross(centre, along)
    across = np.degrees(np.arcsin(np.clip(np.abs(sky.directions @ normal), 0.0, 1.0)))
    return np.asarray((across <= half_width_deg) & (sky.directions @ along > 0.0))
