"""From counted lumens to candela: local regression on the sphere, as narrow as the statistics allow.

In the neighbourhood of a wanted direction the intensity of an aperture is written as cos γ times a quadratic in the two
tangent coordinates (the luminance varies smoothly; the cosine brings the intensity to 0 at the horizon), and
fitted to the counts per cell by weighted least squares (Fan & Gijbels 1996, Local Polynomial Modelling, ch. 3). That
leaves no bias of second order at peaks, and none at the horizon's edge, unlike a plain running mean.

Each direction gets the widest neighbourhood that still agrees with all narrower ones within their noise (Goldenshluger
& Nemirovski 1997, intersection of confidence intervals): peaks, where counts are plenty, stay sharp.

What this bends is estimated where it is asked for: by how much the value departs from the narrowest neighbourhood's,
and that one from the plain mean of its inner half, each beyond the noise.
"""

import functools
import math
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from analysis.simulate.source import cell_directions
from labdaq.directions import vector

Floats = NDArray[np.float64]

SHARP_DEG: Final = (2.9, 4.0, 5.6, 8.0)
SOFT_DEG: Final = (5.8, 8.5, 12.5)
"""Radii of the neighbourhoods for light of specular paths, and for light that a diffuse wall sent."""

AGREE: Final = 1.0
"""Two neighbourhoods agree when they differ by less than this many standard uncertainties of the narrower."""

ZONES_DEG: Final = (20.0, 40.0, 52.0, 62.0, 72.0, 80.0)
"""Edges of the zones of gamma in which the noise per lumen is found."""

LEAST_PROBES: Final = 4
"""Fewer directions of a zone tell too little of its noise; then it has the mean of all."""


@dataclass(frozen=True, eq=False)
class Operator:
    """Sparse matrices (directions x cells): lumens to candela, its squares, and some of its rows.

    ``inner`` is the plain mean over half the radius, also lumens to candela.
    ``zone`` holds the zone of gamma of each direction, ``probe_zone`` that of each row of ``probe``.
    """

    weights: Any
    squares: Any
    inner: Any
    probe: Any
    zone: NDArray[np.int64]
    probe_zone: NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Smoother:
    """Operators for sharp and soft light, narrow first, and the shape of the directions."""

    sharp: tuple[Operator, ...]
    soft: tuple[Operator, ...]
    shape: tuple[int, ...]


def smoother(
    gamma_deg: ArrayLike,
    c_deg: ArrayLike,
    sides: tuple[int, int],
    sharp_deg: tuple[float, ...] = SHARP_DEG,
    soft_deg: tuple[float, ...] = SOFT_DEG,
) -> Smoother:
    """Operators for directions (gamma and C [deg] broadcast); remembered for the last few grids.

    Radii below 2.6 cells are left out: a fit needs some cells.
    """
    gamma, c = np.broadcast_arrays(np.asarray(gamma_deg, dtype=np.float64), np.asarray(c_deg, dtype=np.float64))
    where = (tuple(np.ravel(gamma)), tuple(np.ravel(c)))

    def operators(side: int, radii: tuple[float, ...]) -> tuple[Operator, ...]:
        least = 2.6 * math.degrees(math.sqrt(2.0 * math.pi)) / side
        wide = [radius for radius in radii if radius >= least] or [least]
        return tuple(_operator(*where, side, radius) for radius in wide)

    return Smoother(operators(sides[0], sharp_deg), operators(sides[1], soft_deg), gamma.shape)


def smooth(lumens: Floats, operators: tuple[Operator, ...], bias: bool = False) -> tuple[Floats, Floats]:
    """Candela and standard uncertainty (directions, T) from lumens (batches, cells, T), with ``bias`` if asked for."""
    mean = lumens.mean(axis=0)
    best: tuple[Any, Any] | None = None
    low: Any = None
    high: Any = None
    agreed: Any = None
    for operator in operators:
        value = operator.weights @ mean
        error = np.sqrt(np.maximum(operator.squares @ mean, 0.0) * _size(lumens, operator))
        if best is None:
            best, low, high = (value, error), value - AGREE * error, value + AGREE * error
            agreed = np.ones(value.shape, dtype=bool)
            continue
        low, high = np.maximum(low, value - AGREE * error), np.minimum(high, value + AGREE * error)
        agreed = agreed & (low <= high)
        best = np.where(agreed, value, best[0]), np.where(agreed, error, best[1])
    assert best is not None
    if bias:
        best = best[0], np.hypot(best[1], _bent(lumens, operators[0], best[0]))
    return best


def _bent(lumens: Floats, narrow: Operator, value: Floats) -> Floats:
    """What the smoothing may have bent [cd], shape (directions, T)."""
    by_batch = np.stack([narrow.weights @ batch for batch in lumens])
    inner = np.stack([narrow.inner @ batch for batch in lumens])
    first, second = value - by_batch.mean(axis=0), (by_batch - inner).mean(axis=0)
    noise = by_batch.var(axis=0, ddof=1) / len(lumens), (by_batch - inner).var(axis=0, ddof=1) / len(lumens)
    result: Floats = np.sqrt(np.maximum(first**2 - noise[0], 0.0) + np.maximum(second**2 - noise[1], 0.0))
    return result


def _size(lumens: Floats, operator: Operator) -> Floats:
    """Variance per counted lumen, shape (directions, T).

    Eight batches give but a rough variance for one direction; the counts give its shape, some directions of a zone
    together its size. Zones, because rays of unlike worth end up at unlike gamma: through a clear dome and a mirror
    tube a lumen at 80 degrees is noisier than one near the nadir by a factor of six.
    """
    by_batch = np.stack([operator.probe @ batch for batch in lumens])
    scatter = by_batch.var(axis=0, ddof=1) / len(lumens)
    shape = np.maximum(operator.probe.power(2) @ lumens.mean(axis=0), 0.0)
    overall = scatter.sum(axis=0) / np.maximum(shape.sum(axis=0), 1e-300)
    size = np.empty((len(ZONES_DEG) + 1, lumens.shape[2]))
    for zone in range(len(size)):
        here = operator.probe_zone == zone
        enough = here.sum() >= LEAST_PROBES
        size[zone] = scatter[here].sum(axis=0) / np.maximum(shape[here].sum(axis=0), 1e-300) if enough else overall
    result: Floats = size[operator.zone]
    return result


@functools.lru_cache(maxsize=16)
def _operator(gammas: tuple[float, ...], cs: tuple[float, ...], side: int, radius_deg: float) -> Operator:
    from scipy import sparse
    from scipy.spatial import cKDTree

    here = vector(np.array(gammas), np.array(cs)) * np.array([1.0, 1.0, -1.0])
    middle, moments = _cells(side)
    reach = 2.0 * math.sin(math.radians(radius_deg) / 2.0)
    near = cKDTree(middle).query_ball_point(here, reach)
    counts = np.array([len(found) for found in near])
    first = np.concatenate([[0], np.cumsum(counts)])
    columns = np.concatenate([np.asarray(found, dtype=np.int64) for found in near])
    values = _weights(here, middle, moments, counts, columns, reach) * side**2 / (2.0 * math.pi)
    weights = sparse.csr_matrix((values, columns, first), shape=(len(here), side**2))
    inner = sparse.csr_matrix((_inner(here, middle, counts, columns, reach), columns, first), shape=weights.shape)
    zone = np.searchsorted(np.array(ZONES_DEG), np.array(gammas))
    some = np.s_[:: max(1, len(here) // 200)]
    return Operator(weights, weights.power(2), inner, weights[some], zone, zone[some])


@functools.lru_cache(maxsize=4)
def _cells(side: int) -> tuple[Floats, Floats]:
    """Middles (cells, 3), and means over each cell of z, z·(x, y, z) and z·(xx, xy, xz, yy, yz, zz), (cells, 10)."""
    x, y, z = cell_directions(side, 4)
    parts = (np.ones_like(x), x, y, z, x * x, x * y, x * z, y * y, y * z, z * z)
    moments = np.stack([(z * part).mean(axis=1) for part in parts], axis=1)
    middle = np.stack([x.mean(axis=1), y.mean(axis=1), z.mean(axis=1)], axis=1)
    return middle / np.linalg.norm(middle, axis=1, keepdims=True), moments


def _weights(here: Floats, middle: Floats, moments: Floats, counts: Any, columns: Any, reach: float) -> Floats:
    """Weight of each (direction, cell) pair in the local fit's value at the direction, per unit density."""
    sine = np.hypot(here[:, 0], here[:, 1])
    flat = sine <= 1e-9
    safe = np.where(flat, 1.0, sine)
    east = np.stack([np.where(flat, 1.0, -here[:, 1] / safe), here[:, 0] / safe, np.zeros(len(here))], axis=1)
    north = np.cross(here, east)
    basis = _basis(np.repeat(east / reach, counts, axis=0), np.repeat(north / reach, counts, axis=0), moments[columns])
    gap = np.linalg.norm(middle[columns] - np.repeat(here, counts, axis=0), axis=1) / reach
    kernel = np.clip(1.0 - gap**2, 0.0, None) ** 2
    pairs = (kernel[:, None, None] * basis[:, :, None] * basis[:, None, :]).reshape(-1, 36)
    starts = np.concatenate([[0], np.cumsum(counts)[:-1]])
    normal = np.add.reduceat(pairs, starts, axis=0).reshape(-1, 6, 6)
    scale = np.trace(normal, axis1=1, axis2=2)[:, None, None]
    normal += np.diag([0.0, 0.0, 0.0, 1e-5, 1e-5, 1e-5]) * scale + 1e-12 * scale * np.eye(6)
    value = np.broadcast_to(np.eye(6)[0], (len(here), 6))[..., None]
    solved = np.repeat(np.linalg.solve(normal, value)[..., 0], counts, axis=0)
    result: Floats = np.sum(solved * basis, axis=1) * kernel * np.repeat(here[:, 2], counts)
    return result


def _inner(here: Floats, middle: Floats, counts: Any, columns: Any, reach: float) -> Floats:
    """Weight of each pair in the plain mean over half the reach (at least the nearest cell), in candela."""
    gap = np.linalg.norm(middle[columns] - np.repeat(here, counts, axis=0), axis=1)
    starts = np.concatenate([[0], np.cumsum(counts)[:-1]])
    nearest = np.repeat(np.minimum.reduceat(gap, starts), counts)
    inside = gap <= np.maximum(0.5 * reach, 1.000001 * nearest)
    cosines = np.add.reduceat(np.where(inside, middle[columns, 2], 0.0), starts)
    scale: Floats = np.repeat(here[:, 2] / np.maximum(cosines, 1e-12), counts) * len(middle) / (2.0 * math.pi)
    return np.where(inside, scale, 0.0)


def _basis(e: Floats, n: Floats, m: Floats) -> Floats:
    """Means over the cells of cos γ · (1, u, v, u², uv, v²), with u and v the components along e and n."""
    one = m[:, 1:4]
    second = np.stack([m[:, 4:7].T, m[:, (5, 7, 8)].T, m[:, (6, 8, 9)].T])  # (3, 3, pairs), symmetric
    me = np.einsum("ijp,pj->pi", second, e)
    mn = np.einsum("ijp,pj->pi", second, n)
    columns = (
        m[:, 0],
        np.sum(one * e, axis=1),
        np.sum(one * n, axis=1),
        np.sum(me * e, axis=1),
        np.sum(me * n, axis=1),
        np.sum(mn * n, axis=1),
    )
    return np.stack(columns, axis=1)
