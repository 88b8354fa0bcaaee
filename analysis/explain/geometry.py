"""Geometry that mechanisms share: blurring on the sphere, the aperture seen from near, the lit room."""

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from analysis.cases.model import Aperture, Floats
from analysis.explain.fields import C_DEG, GAMMA_DEG, solid_angle
from analysis.explain.sampler import Sampler
from labdaq import directions

CELLS = len(C_DEG) * len(GAMMA_DEG)
_FAINT = 1e-3
"""Share of its middle below which a Gaussian's tail is left out."""
_ROUNDING = 1e-13
"""Share of the brightest below which harmonics of C leave nothing but rounding, where a sum of light has none."""


@lru_cache(maxsize=1)
def grid_vectors() -> Floats:
    """Unit vectors of the field grid; shape (P*G, 3)."""
    return directions.vector(GAMMA_DEG[None, :], C_DEG[:, None]).reshape(-1, 3)


@lru_cache(maxsize=24)
def _spread_of_rings(sigma_deg: float) -> NDArray[np.complex128]:
    """Spread each cell's light over a Gaussian of ``sigma_deg``, keeping what stays below the horizon.

    It is the same for all planes, so harmonics of C do not mix: (harmonics, G, G), from the last gamma to the other.
    """
    v, weight = grid_vectors().reshape(len(C_DEG), len(GAMMA_DEG), 3), solid_angle()[0]
    kappa = 1.0 / np.radians(sigma_deg) ** 2
    kernel = np.exp(kappa * (v @ v[0].T - 1.0))
    kernel = np.where(kernel > _FAINT, kernel, 0.0) * weight[:, None]
    kernel /= kernel.sum(axis=(0, 1))  # what each cell sends out sums to one in flux (weight on the receiving side)
    return np.asarray(np.fft.rfft(kernel * weight / weight[:, None], axis=0))


def blurred(field: Floats, sigma_deg: float) -> Floats:
    """The field (T, P, G) [cd] with its light spread by a Gaussian of ``sigma_deg`` rms [deg]; flux is kept."""
    at = np.array([2.0, 3.0, 4.5, 6.5, 9.0, 12.0, 16.0])
    x = float(np.clip(sigma_deg, at[0], at[-1]))
    k = min(int(np.searchsorted(at, x, side="right")) - 1, len(at) - 2)
    w = (x - at[k]) / (at[k + 1] - at[k])
    spread = sum(share * _spread_of_rings(float(at[n])) for n, share in ((k, 1 - w), (k + 1, w)) if share)
    rings = np.moveaxis(np.fft.rfft(field, axis=1), 0, -1)
    made = np.fft.irfft(np.moveaxis(spread @ rings, -1, 0), len(C_DEG), axis=1)
    return np.where(np.abs(made) > _ROUNDING * np.max(np.abs(field), initial=0.0), made, 0.0)


def turned(field: Floats, axes: Floats, degrees: Floats) -> Floats:
    """Each test's field (T, P, G) turned as a whole about an axis (T, 3) through the aperture by an angle (T,) [deg].

    Light that would come from above the horizon is read at the horizon.
    """
    v = grid_vectors()
    made = np.empty_like(field)
    turns = directions.rotated(np.eye(3), axes[:, None, :], -degrees[:, None])
    for t, turn in enumerate(turns):
        gamma, c = directions.gamma_c(v @ turn)  # where the light now seen at v came out
        made[t] = Sampler(np.full(len(v), t), np.minimum(gamma, 90.0), c)(field).reshape(field.shape[1:])
    return made


def bilinear(gamma_deg: Floats, c_deg: Floats) -> sparse.csr_matrix:
    """Matrix (M, cells) that reads a flattened field at M directions; zero at and beyond the horizon."""
    x = np.clip(gamma_deg / GAMMA_DEG[1], 0.0, len(GAMMA_DEG) - 1.000001)
    y = np.mod(c_deg, 360.0) / C_DEG[1]
    i, j = x.astype(np.intp), y.astype(np.intp) % len(C_DEG)
    u, v = x - i, y - np.floor(y)
    inside = gamma_deg < 90.0
    rows = np.arange(len(x))
    entries: list[tuple[Floats, np.ndarray]] = []
    for dj, wj in ((0, 1 - v), (1, v)):
        for di, wi in ((0, 1 - u), (1, u)):
            column = (j + dj) % len(C_DEG) * len(GAMMA_DEG) + i + di
            entries.append((wi * wj * inside, column))
    data = np.concatenate([e[0] for e in entries])
    columns = np.concatenate([e[1] for e in entries])
    return sparse.csr_matrix((data, (np.tile(rows, 4), columns)), shape=(len(x), CELLS))


def aperture_points(aperture: Aperture, across: int = 7) -> Floats:
    """Points spread evenly over the opening, equal area each; shape (K, 2) [m]."""
    u = (np.arange(across) + 0.5) / across
    if aperture.shape == "rectangle":
        assert aperture.size_m is not None
        x, y = np.meshgrid((u - 0.5) * aperture.size_m[0], (u - 0.5) * aperture.size_m[1])
        return np.stack([x.ravel(), y.ravel()], axis=1)
    assert aperture.diameter_m is not None
    radius, turn = np.meshgrid(np.sqrt(u) * aperture.diameter_m / 2, 2 * np.pi * (np.arange(12) + 0.5) / 12)
    return np.stack([(radius * np.cos(turn)).ravel(), (radius * np.sin(turn)).ravel()], axis=1)


def near_field_matrix(aperture: Aperture, distance_m: float) -> sparse.csr_matrix:
    """From far-field intensity to d²E at sensors ``distance_m`` from the aperture's centre; (cells, cells).

    E = (1/A) ∫ I(direction from the point) cos(angle at the sensor) / l² dA: each part of the opening sends out the
    same distribution (inverse-square law, e.g. Simons and Bean, Lighting Engineering, chapter 3). Sensors face
    the centre of the aperture.
    """
    points = aperture_points(aperture)
    sensors = distance_m * grid_vectors()
    total: sparse.csr_matrix | None = None
    for x, y in points:
        ray = sensors - np.array([x, y, 0.0])
        length2 = np.sum(ray**2, axis=1)
        cosine = np.sum(ray * sensors, axis=1) / (np.sqrt(length2) * distance_m)
        gamma, c = directions.gamma_c(ray)
        weight = distance_m**2 * np.maximum(cosine, 0.0) / length2 / len(points)
        part = sparse.diags(weight) @ bilinear(gamma, c)
        total = part if total is None else total + part
    return sparse.csr_matrix(total)


def apply_operator(matrix: sparse.csr_matrix, field: Floats) -> Floats:
    """Apply a (cells, cells) matrix to each test's field (T, P, G)."""
    return np.asarray((matrix @ field.reshape(len(field), -1).T).T.reshape(field.shape))
