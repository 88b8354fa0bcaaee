"""A prismatic sheet, ray by ray: flat on one side, pyramids on the other.

Each facet is met where it is. Its normal errs a little (moulding), light splits by Fresnel's law, is absorbed on
its way, is totally reflected, and may pass a neighbouring pyramid before it gets away.

Local frame of a sheet: lengths in millimetres, z towards the prisms; the flat lies at z = -slab, the valleys at z =
0, the peaks at z = peak; x and y along the edges of the pyramids, periodic with the pitch.
"""

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from simulators.hidden.compiled import compiled
from simulators.hidden.draws import State, lobe, lobe_scale, uniform
from simulators.hidden.surfaces import clear_slab, fresnel, matt, mirrored, refracted, tangents, tilted

PRISMATIC, CLEAR, DIFFUSING, NO_LENS = 1, 2, 3, 0
LOST, FLAT_SIDE, PRISM_SIDE = 0, -1, 1

Table = tuple[tuple[float, ...], ...]
"""A small matrix by rows."""

Pass = tuple[int, float, float, float, float]
"""Side on which the light leaves (0: nowhere), direction (3), weight that is left."""


def rows(matrix: NDArray[np.float64]) -> Table:
    """Turn a matrix into a tuple of tuples."""
    return tuple(tuple(float(x) for x in row) for row in matrix)


@dataclass(frozen=True)
class Lens:
    """What a sheet is made of.

    Attributes
    ----------
    kind
        ``prismatic``, ``clear``, ``diffusing`` or ``none``.
    slopes_deg
        Slope of the facets facing +x, -x, +y, -y [deg].
    blur_deg
        Root-mean-square error of the facets' normals [deg].
    blur_power
        0.5 for Gaussian errors, larger for heavier tails (see `draws.lobe`).
    rounded
        Share of facet hits that meet a rounded ridge: there the slope is anything between 0 and the facet's.
    absorption_per_mm
        Absorption in the material [1/mm].
    thickness_mm, pitch_mm, index
        Flat to peak, width of a pyramid, refractive index.
    orientation_deg
        Turn of the pattern, counter-clockwise seen from above [deg].
    isotropic
        Share of passes for which the pattern is turned at random: 1 is a lens without directions in its plane.
    haze, haze_deg
        Share of passes that are scattered on their way out, and the rms width of that scattering [deg].
    transmittance
        Of a diffusing sheet; the rest is reflected, less 10 %.
    """

    kind: str = "prismatic"
    slopes_deg: tuple[float, float, float, float] = (27.0, 27.0, 27.0, 27.0)
    blur_deg: float = 4.0
    blur_power: float = 0.5
    rounded: float = 0.0
    absorption_per_mm: float = 0.03
    thickness_mm: float = 3.0
    pitch_mm: float = 5.0
    index: float = 1.491
    orientation_deg: float = 0.0
    isotropic: float = 0.0
    haze: float = 0.0
    haze_deg: float = 35.0
    transmittance: float = 0.6

    def numbers(self) -> "LensNumbers":
        """Return the same as the tracer takes it."""
        slopes = np.radians(np.array(self.slopes_deg))
        half = self.pitch_mm / 2.0
        towards = np.array([[1.0, 0.0], [-1.0, 0.0], [0.0, 1.0], [0.0, -1.0]])
        facets = np.column_stack([towards * np.sin(slopes)[:, None], np.cos(slopes), np.sin(slopes) * half])
        rise = np.tan(slopes)
        peaks = [self.pitch_mm * rise[i] * rise[i + 1] / (rise[i] + rise[i + 1]) for i in (0, 2)]
        peak = float(min(peaks))
        kind = {"prismatic": PRISMATIC, "clear": CLEAR, "diffusing": DIFFUSING, "none": NO_LENS}[self.kind]
        return LensNumbers(
            kind=kind,
            facets=rows(facets),
            peak=peak,
            slab=self.thickness_mm - peak,
            pitch=self.pitch_mm,
            refractive=self.index,
            absorption=self.absorption_per_mm,
            blur=lobe_scale(math.radians(self.blur_deg), self.blur_power),
            blur_power=self.blur_power,
            rounded=self.rounded,
            isotropic=self.isotropic,
            haze=self.haze,
            haze_spread=math.radians(self.haze_deg),
            transmittance=self.transmittance,
        )


class LensNumbers(NamedTuple):
    """A lens as the tracer takes it; ``facets`` holds the normal (3) and offset [mm] of each of the four planes.

    Tuples instead of arrays: an array inside a tuple has its references counted at every call.
    """

    kind: int
    facets: Table
    peak: float
    slab: float
    pitch: float
    refractive: float
    absorption: float
    blur: float
    blur_power: float
    rounded: float
    isotropic: float
    haze: float
    haze_spread: float
    transmittance: float


@compiled
def _wrapped(x: float, pitch: float) -> float:
    """Place in the cell [-pitch/2, pitch/2) that repeats."""
    return x - pitch * math.floor(x / pitch + 0.5)


@compiled
def _facet_normal(
    state: State, lens: LensNumbers, i: int, dx: float, dy: float, dz: float
) -> tuple[float, float, float]:
    """Outward normal as this ray meets it: slopes are seen in proportion to the area they show to the ray.

    (Distribution of visible normals: Heitz and d'Eon 2014, doi:10.1111/cgf.12417.)
    """
    nx, ny, nz = lens.facets[i][0], lens.facets[i][1], lens.facets[i][2]
    before = dx * nx + dy * ny + dz * nz
    if lens.rounded > 0.0:
        chance = uniform(state)
        if chance < lens.rounded:
            f = chance / lens.rounded
            nx, ny = f * nx, f * ny
            nz = math.sqrt(1.0 - nx * nx - ny * ny)
    a, b = lobe(state, lens.blur, lens.blur_power)
    ux, uy, uz, vx, vy, vz = tangents(nx, ny, nz)
    # a slope towards the ray shows it more area: of (a, b) and (-a, -b) take one by the area each shows
    lean = (a * (dx * ux + dy * uy + dz * uz) + b * (dx * vx + dy * vy + dz * vz)) / (dx * nx + dy * ny + dz * nz)
    if uniform(state) > 0.5 * (1.0 + lean):
        a, b = -a, -b
    mx, my, mz = nx + a * ux + b * vx, ny + a * uy + b * vy, nz + a * uz + b * vz
    f = 1.0 / math.sqrt(mx * mx + my * my + mz * mz)
    mx, my, mz = f * mx, f * my, f * mz
    if (dx * mx + dy * my + dz * mz) * before > 0.0:
        return mx, my, mz
    return lens.facets[i][0], lens.facets[i][1], lens.facets[i][2]


@compiled
def _meet_facet(
    state: State, lens: LensNumbers, i: int, inside: bool, dx: float, dy: float, dz: float
) -> tuple[bool, float, float, float]:
    """Split at facet ``i``; return whether the light is inside afterwards, and its direction."""
    nx, ny, nz = lens.facets[i][0], lens.facets[i][1], lens.facets[i][2]
    mx, my, mz = _facet_normal(state, lens, i, dx, dy, dz)
    ratio = lens.refractive if inside else 1.0 / lens.refractive
    if inside:  # the normal must face the ray
        mx, my, mz = -mx, -my, -mz
    cosine = min(1.0, -(dx * mx + dy * my + dz * mz))
    if uniform(state) < fresnel(cosine, ratio):
        dx, dy, dz = mirrored(dx, dy, dz, mx, my, mz)
        after = inside
    else:
        dx, dy, dz = refracted(dx, dy, dz, mx, my, mz, ratio)
        after = not inside
    side = dx * nx + dy * ny + dz * nz
    if (side < 0.0) != after:  # a tilted normal must not send light through the facet it should leave
        dx, dy, dz = mirrored(dx, dy, dz, nx, ny, nz)
    return after, dx, dy, dz


@compiled
def _way_to_surface(
    lens: LensNumbers, x: float, y: float, z: float, dx: float, dy: float, dz: float
) -> tuple[float, int]:
    """Distance inside a pyramid to where the ray leaves it: facet 0..3, or 4 for its base."""
    way, hit = 1e30, 4
    if dz < 0.0:
        way = -z / dz
    for i in range(4):
        speed = lens.facets[i][0] * dx + lens.facets[i][1] * dy + lens.facets[i][2] * dz
        if speed > 1e-12:
            gap = lens.facets[i][3] - (lens.facets[i][0] * x + lens.facets[i][1] * y + lens.facets[i][2] * z)
            if gap / speed < way:
                way, hit = max(0.0, gap / speed), i
    return way, hit


@compiled
def _way_through_air(
    lens: LensNumbers, x: float, y: float, z: float, dx: float, dy: float, dz: float
) -> tuple[float, int]:
    """Distance from outside to this cell's pyramid: facet 0..3; or to the cell's edge: 4; or above the peaks: 5."""
    half = 0.5 * lens.pitch
    way, hit = 1e30, 5
    if dz > 0.0:
        way = max(0.0, (lens.peak - z) / dz)
    edge = 1e30
    if dx != 0.0:
        edge = (math.copysign(half, dx) - x) / dx
    if dy != 0.0:
        edge = min(edge, (math.copysign(half, dy) - y) / dy)
    if edge < way:
        way, hit = max(0.0, edge), 4
    entry, exit_, facet = -1e30, 1e30, -1
    for i in range(4):
        speed = lens.facets[i][0] * dx + lens.facets[i][1] * dy + lens.facets[i][2] * dz
        gap = lens.facets[i][3] - (lens.facets[i][0] * x + lens.facets[i][1] * y + lens.facets[i][2] * z)
        if speed < -1e-12:
            if gap / speed > entry:
                entry, facet = gap / speed, i
        elif speed > 1e-12:
            exit_ = min(exit_, gap / speed)
        elif gap < 0.0:
            exit_ = -1e30
    if facet >= 0 and -1e-9 <= entry < exit_ and entry <= way:
        return max(0.0, entry), facet
    return way, hit


@compiled
def _prismatic(state: State, lens: LensNumbers, dx: float, dy: float, dz: float, x: float, y: float) -> Pass:
    """Follow a ray through a prismatic sheet, from whichever side it comes, in the sheet's frame."""
    weight = 1.0
    inside = dz > 0.0
    z = lens.peak
    if inside:
        if uniform(state) < fresnel(dz, 1.0 / lens.refractive):
            return FLAT_SIDE, dx, dy, -dz, weight
        dx, dy, dz = refracted(dx, dy, dz, 0.0, 0.0, -1.0, 1.0 / lens.refractive)
        z = -lens.slab
    for _ in range(400):
        if not inside:
            way, hit = _way_through_air(lens, x, y, z, dx, dy, dz)
            x, y, z = x + way * dx, y + way * dy, z + way * dz
            if hit == 5:
                return PRISM_SIDE, dx, dy, dz, weight
            if hit == 4:
                x = _wrapped(x + math.copysign(1e-9, dx), lens.pitch)
                y = _wrapped(y + math.copysign(1e-9, dy), lens.pitch)
                z = max(z, 1e-9)
            else:
                inside, dx, dy, dz = _meet_facet(state, lens, hit, False, dx, dy, dz)
        elif z > 0.0 or (z == 0.0 and dz > 0.0):
            way, hit = _way_to_surface(lens, x, y, z, dx, dy, dz)
            x, y, z = x + way * dx, y + way * dy, z + way * dz
            weight *= math.exp(-lens.absorption * way)
            if hit == 4:
                z = 0.0
            else:
                z = max(z, 1e-12)
                inside, dx, dy, dz = _meet_facet(state, lens, hit, True, dx, dy, dz)
        elif dz > 0.0:
            way = -z / dz
            weight *= math.exp(-lens.absorption * way)
            x, y, z = _wrapped(x + way * dx, lens.pitch), _wrapped(y + way * dy, lens.pitch), 0.0
        else:
            way = (z + lens.slab) / max(1e-12, -dz)
            weight *= math.exp(-lens.absorption * way)
            if weight < 1e-4:
                return LOST, dx, dy, dz, 0.0
            x, y, z = x + way * dx, y + way * dy, -lens.slab
            if uniform(state) < fresnel(-dz, lens.refractive):
                dz = -dz
            else:
                dx, dy, dz = refracted(dx, dy, dz, 0.0, 0.0, 1.0, lens.refractive)
                return FLAT_SIDE, dx, dy, dz, weight
    return LOST, dx, dy, dz, 0.0


@compiled
def through(state: State, lens: LensNumbers, dx: float, dy: float, dz: float, u: float, v: float) -> Pass:
    """Send a ray through any sheet, in the sheet's frame; ``u, v`` in [0, 1) place it within a cell."""
    if lens.kind == PRISMATIC:
        c, s = 1.0, 0.0
        if lens.isotropic > 0.0 and uniform(state) < lens.isotropic:
            angle = 2.0 * math.pi * uniform(state)
            c, s = math.cos(angle), math.sin(angle)
        px, py = c * dx + s * dy, c * dy - s * dx
        side, px, py, dz, weight = _prismatic(state, lens, px, py, dz, (u - 0.5) * lens.pitch, (v - 0.5) * lens.pitch)
        return side, c * px - s * py, s * px + c * py, dz, weight
    ahead = PRISM_SIDE if dz > 0.0 else FLAT_SIDE
    if lens.kind == CLEAR:
        inner = math.sqrt(1.0 - (1.0 - dz * dz) / (lens.refractive * lens.refractive))
        weight = math.exp(-lens.absorption * (lens.slab + lens.peak) / inner)
        if uniform(state) < clear_slab(abs(dz), lens.refractive):
            return ahead, dx, dy, dz, weight
        return -ahead, dx, dy, -dz, 1.0
    if lens.kind == DIFFUSING:
        chance = uniform(state)
        if chance < lens.transmittance:
            dx, dy, dz = matt(state, 0.0, 0.0, float(ahead))
            return ahead, dx, dy, dz, 1.0
        if chance < 0.9:
            dx, dy, dz = matt(state, 0.0, 0.0, float(-ahead))
            return -ahead, dx, dy, dz, 1.0
        return LOST, dx, dy, dz, 0.0
    return ahead, dx, dy, dz, 1.0


@compiled
def hazed(state: State, lens: LensNumbers, side: int, dx: float, dy: float, dz: float) -> tuple[float, float, float]:
    """Scatter light that has left a sheet on ``side`` by the lens's haze; it stays on that side."""
    for _ in range(8):
        a, b = lobe(state, lens.haze_spread, 0.7)
        x, y, z = tilted(dx, dy, dz, a, b)
        if z * side > 0.0:
            return x, y, z
    return dx, dy, dz
