"""Tests that a case's variant does not cover, below systems that it does cover in others: as ours changes them.

Left as they were predicted, such tests would speak against the very physics that the variant shows. So our own way and
setting is sought whose change is most like the variant's in the tests that both have, and as large a share of it as is
seen there (least squares) stands in the others. Where ours is unlike, the share is next to none.
"""

from collections.abc import Iterator, Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from analysis.cases.model import Floats
from analysis.explain.fields import Fields, solid_angle
from analysis.explain.ratios import plain_ratio
from analysis.explain.retrace import Path, Simulator


def without_gaps(
    path: Path, mechanism: str, simulator: Simulator | None, base: Fields, systems: Mapping[str, list[int]]
) -> Path:
    """A path of ratios with the tests that it leaves as predicted; ``systems`` are the tests (indices) of each.

    Nothing is simulated where no system is covered in part.
    """
    covered = np.any((path.sun != 1.0) | (path.sky != 1.0), axis=(0, 2, 3))
    partly = [np.array(rows) for rows in systems.values() if 0 < np.count_nonzero(covered[rows]) < len(rows)]
    if simulator is None or not partly:
        return path
    own = [_ratios(way, float(at), base) for way in simulator.paths(mechanism) for at in way.positions]
    sun, sky = path.sun.copy(), path.sky.copy()
    for rows in partly:
        there, here = rows[covered[rows]], rows[~covered[rows]]
        for k in range(len(path.positions)):
            shown = _seen(path.sun[k], path.sky[k], base, there)
            if np.any(shown) and (told := _most_like(shown, own, base, there)):
                share, (sun_ratio, sky_ratio) = told
                sun[k, here] = 1.0 + share * (sun_ratio[here] - 1.0)
                sky[k, here] = 1.0 + share * (sky_ratio[here] - 1.0)
    return replace(path, sun=sun, sky=sky)


def _ratios(way: Path, at: float, base: Fields) -> tuple[Floats, Floats]:
    """Both parts (T, P, G) over the prediction's at a setting of a way of ours."""
    sun, sky = way.change(at, base)
    return plain_ratio(sun, base.sun), plain_ratio(sky, base.sky)


def _seen(sun: Floats, sky: Floats, base: Fields, tests: NDArray[np.int64]) -> Floats:
    """Relative change of the light in some tests by ratios of its parts, a gain of each removed; flat.

    Each direction of the lower hemisphere counts as much as its solid angle.
    """
    weight = np.broadcast_to(solid_angle(), base.sun.shape)[tests]
    old = base.total[tests]
    new = base.sun[tests] * sun[tests] + base.sky[tests] * sky[tests]
    change = (new - old) / np.maximum(0.5 * (new + old), 1e-12)
    mean = np.sum(weight * change, axis=(1, 2), keepdims=True) / np.sum(weight, axis=(1, 2), keepdims=True)
    return np.asarray(np.sqrt(weight) * (change - mean)).ravel()


def _most_like(
    shown: Floats, own: list[tuple[Floats, Floats]], base: Fields, tests: NDArray[np.int64]
) -> tuple[float, tuple[Floats, Floats]] | None:
    """Of our own changes that which leaves least of what is shown, and the share of it; none if we have none."""

    def tried() -> Iterator[tuple[float, float, int]]:
        for n, (sun, sky) in enumerate(own):
            yield *seen_of(_seen(sun, sky, base, tests), shown), n

    best = min(tried(), default=None)
    return None if best is None else (best[1], own[best[2]])


def seen_of(made: Floats, shown: Floats) -> tuple[float, float]:
    """What is left of a shown change by the share (0 to 1) of one that we make that is seen in it, and that share.

    The sum of squares, which is least at that share; both changes are of shape (N,).
    """
    share = float(np.clip(made @ shown / max(float(made @ made), 1e-30), 0.0, 1.0))
    return float(np.sum((shown - share * made) ** 2)), share
