"""Peaks of a distribution: where and how high, which are real, and which of two distributions belong together."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from analysis.cases.model import Floats, Ints
from analysis.compare.scan import Scan
from labdaq import directions

PROMINENCE: Final = 0.05
"""A peak stands out by this share of the highest intensity, or it is none."""
SIGNIFICANT: Final = 4.0
"""... and by this many times its noise."""
TOGETHER_DEG: Final = 30.0
"""Peaks farther apart than this do not belong together."""


@dataclass(frozen=True)
class Peak:
    """One peak.

    Attributes
    ----------
    gamma_deg, c_deg
        Direction [deg], between the directions that were read where they show its shape.
    candela
        Height there [cd].
    prominence_candela
        How far one must descend before a higher peak can be climbed; for the highest, its height [cd].
    """

    gamma_deg: float
    c_deg: float
    candela: float
    prominence_candela: float


@dataclass(frozen=True)
class PeakPair:
    """A peak of the recording, one of the simulation, or both where they belong together, ``apart_deg`` [deg]."""

    measured: Peak | None
    simulated: Peak | None
    apart_deg: float | None


def find_peaks(scan: Scan, values: Floats, noise: Floats) -> list[Peak]:
    """Peaks of intensities (D,) [cd] with their noise [cd] on the directions of a scan, the highest first.

    Directions are taken from high to low; each joins the peak of its neighbours, and where two peaks meet the lower
    one ends with its prominence (0-dimensional persistence). A Gaussian is then fitted through each peak and its
    neighbours.
    """
    neighbours = _neighbours(scan)
    order = np.argsort(-np.where(np.isfinite(values), values, -np.inf), kind="stable")
    order = order[np.isfinite(values[order])]
    if not len(order) or values[order[0]] <= 0:
        return []
    root: dict[int, int] = {}
    prominence: dict[int, float] = {}
    for k in order.tolist():
        tops = sorted({_top(root, n) for n in neighbours[k] if n in root}, key=lambda t: (-values[t], t))
        root[k] = tops[0] if tops else k
        for lower in tops[1:]:
            prominence[lower] = float(values[lower] - values[k])
            root[lower] = tops[0]
    highest = int(order[0])
    found = []
    for top in (k for k in root if root[k] == k or k in prominence):
        stands_out = prominence.get(top, float(values[top]))
        needed = max(PROMINENCE * float(values[highest]), SIGNIFICANT * float(noise[top]))
        if stands_out >= needed:
            found.append(_refined(scan, values, top, neighbours[top], stands_out))
    return sorted(found, key=lambda p: -p.candela)


def match_peaks(measured: Sequence[Peak], simulated: Sequence[Peak]) -> list[PeakPair]:
    """Pair peaks, the nearest first, as long as they are within `TOGETHER_DEG`; the others stand alone."""
    apart = sorted(
        (_apart(a, b), i, j)
        for i, a in enumerate(measured)
        for j, b in enumerate(simulated)
        if _apart(a, b) <= TOGETHER_DEG
    )
    partner: dict[int, tuple[int, float]] = {}
    taken: set[int] = set()
    for angle, i, j in apart:
        if i not in partner and j not in taken:
            partner[i] = (j, angle)
            taken.add(j)
    pairs = []
    for i, peak in enumerate(measured):
        if i in partner:
            j, angle = partner[i]
            pairs.append(PeakPair(peak, simulated[j], angle))
        else:
            pairs.append(PeakPair(peak, None, None))
    pairs += [PeakPair(None, peak, None) for j, peak in enumerate(simulated) if j not in taken]
    return pairs


def _apart(a: Peak, b: Peak) -> float:
    va, vb = directions.vector(a.gamma_deg, a.c_deg), directions.vector(b.gamma_deg, b.c_deg)
    return float(directions.angle_between(va, vb))


def _top(root: dict[int, int], k: int) -> int:
    while root[k] != k:
        k = root[k]
    return k


def _neighbours(scan: Scan) -> list[set[int]]:
    """For each direction the up to eight around it on the grid; the nadir touches the whole first ring."""
    cell: Ints = scan.cell
    found: list[set[int]] = [set() for _ in range(len(scan.gamma))]
    planes, gammas = cell.shape
    for j in range(planes):
        for i in range(gammas):
            here = int(cell[j, i])
            if here < 0:
                continue
            for dj in (-1, 0, 1):
                for di in (-1, 0, 1):
                    if 0 <= i + di < gammas:
                        there = int(cell[(j + dj) % planes, i + di])
                        if there >= 0 and there != here:
                            found[here].add(there)
                            found[there].add(here)
    return found


def _refined(scan: Scan, values: Floats, top: int, around: set[int], prominence: float) -> Peak:
    """Fit ln I = a + b·x + xᵀQx in the plane that touches the sphere at the peak; keep the grid's where that fails."""
    rows = np.array([top, *sorted(around)])
    plain = Peak(float(scan.gamma[top]), float(scan.c[top]), float(values[top]), prominence)
    on_edge = scan.gamma[top] in (scan.gamma_deg[0], scan.gamma_deg[-1]) and scan.gamma[top] != 0.0
    if len(rows) < 7 or on_edge or np.any(~(values[rows] > 0)):
        return plain
    middle = directions.vector(scan.gamma[top], scan.c[top])
    first = np.cross(np.eye(3)[int(np.abs(middle).argmin())], middle)  # any two axes across the direction do
    first /= np.linalg.norm(first)
    frame = np.stack([first, np.cross(middle, first)])
    seen = directions.vector(scan.gamma[rows], scan.c[rows])
    angle = np.radians(directions.angle_between(seen, middle))
    across = seen @ frame.T
    length = np.linalg.norm(across, axis=1)
    xy = across * np.divide(angle, length, out=np.ones_like(angle), where=length > 0)[:, None]
    x, y = xy.T
    basis = np.column_stack([np.ones_like(x), x, y, x * x, x * y, y * y])
    # the nearer directions tell more about the peak
    weight = np.exp(-0.5 * (angle / max(float(np.median(angle[1:])), 1e-9)) ** 2)
    fit, *_ = np.linalg.lstsq(basis * weight[:, None], np.log(values[rows]) * weight, rcond=None)
    curve = np.array([[2 * fit[3], fit[4]], [fit[4], 2 * fit[5]]])
    if np.any(np.linalg.eigvalsh(curve) >= 0):
        return plain
    offset = -np.linalg.solve(curve, fit[1:3])
    if float(np.linalg.norm(offset)) > 0.6 * float(angle[1:].max()):
        return plain
    distance = float(np.linalg.norm(offset))
    away = (offset / distance) @ frame if distance > 0 else np.zeros(3)
    gamma, c = directions.gamma_c(np.cos(distance) * middle + np.sin(distance) * away)
    height = float(np.exp(fit[0] + 0.5 * fit[1:3] @ offset))
    return Peak(float(gamma), float(c), height, prominence)
