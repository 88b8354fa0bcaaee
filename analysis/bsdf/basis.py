"""Klems bases: the hemisphere cut into rings of theta and each ring into equal patches of phi.

Bounds and counts are those of Radiance 6 (``bsdf_m.c``): 145, 77 and 41 patches. Older files use "Half" (73 patches)
and "Quarter" with other bounds under the same names; Radiance then takes its own, so read the bounds in the file.
Patch 0 surrounds the normal; the first patch of a ring is centred on phi = 0. Finer bases split every ring of the full
basis into k rings with k times the patches; the central patch becomes 1 + 4 (2x, 581 patches) or 1 + 4 + 4 + 8 (4x,
2321 patches), the counts of the Greenwood report, chosen here so that every patch has an opposite one.
"""

from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Final

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Ints = NDArray[np.intp]


@dataclass(frozen=True)
class AngleBasis:
    """Patches of the hemisphere.

    Attributes
    ----------
    name
        As LBNL files write it.
    theta_bounds_deg
        From 0 to 90, one more than rings [deg].
    n_phi
        Patches of each ring.
    """

    name: str
    theta_bounds_deg: tuple[float, ...]
    n_phi: tuple[int, ...]

    def __post_init__(self) -> None:
        bounds = self.theta_bounds_deg
        if len(bounds) != len(self.n_phi) + 1 or any(b <= a for a, b in pairwise(bounds)):
            raise ValueError(f"basis {self.name}: theta bounds must increase, one more than rings")
        if bounds[0] != 0 or bounds[-1] != 90 or min(self.n_phi) < 1:
            raise ValueError(f"basis {self.name}: rings must cover 0 to 90 degrees and hold a patch each")

    @property
    def size(self) -> int:
        """Number of patches."""
        return sum(self.n_phi)

    @cached_property
    def ring(self) -> Ints:
        """Ring of each patch, shape (n,)."""
        return np.repeat(np.arange(len(self.n_phi)), self.n_phi)

    @cached_property
    def first(self) -> Ints:
        """First patch of each ring."""
        return np.concatenate([[0], np.cumsum(self.n_phi)[:-1]]).astype(np.intp)

    @cached_property
    def projected(self) -> Floats:
        """Projected solid angle of each patch, shape (n,) [sr]; their sum is pi."""
        sine2 = np.sin(np.radians(self.theta_bounds_deg)) ** 2
        ring: Floats = np.pi * np.diff(sine2) / np.array(self.n_phi)
        return ring[self.ring]

    @cached_property
    def centre_xy(self) -> Floats:
        """x and y of each patch's centre, shape (n, 2): theta midway (0 for a round first patch)."""
        bounds = np.radians(self.theta_bounds_deg)
        middle = 0.5 * (bounds[1:] + bounds[:-1])
        if self.n_phi[0] == 1:
            middle[0] = 0.0
        phi = 2.0 * np.pi * (np.arange(self.size) - self.first[self.ring]) / np.array(self.n_phi)[self.ring]
        sine = np.sin(middle)[self.ring]
        return np.stack([sine * np.cos(phi), sine * np.sin(phi)], axis=1)

    @cached_property
    def opposite(self) -> Ints:
        """Patch turned by 180 degrees, shape (n,): the way a ray walked backwards arrives from.

        For rings with an odd number of patches (other than one) the nearest.
        """
        n = np.array(self.n_phi)[self.ring]
        k = np.arange(self.size) - self.first[self.ring]
        turned: Ints = self.first[self.ring] + (k + n // 2) % n
        return turned

    def patch_of(self, xy: Floats) -> Ints:
        """Patch each direction (..., 2) falls in."""
        sine2 = np.sum(xy**2, axis=-1)
        edges = np.sin(np.radians(self.theta_bounds_deg[1:-1])) ** 2
        ring = np.searchsorted(edges, sine2, side="right")
        n = np.array(self.n_phi)[ring]
        turn = np.arctan2(xy[..., 1], xy[..., 0]) / (2.0 * np.pi)
        k = np.floor(turn * n + 0.5).astype(np.intp) % n
        patch: Ints = self.first[ring] + k
        return patch

    def sample(self, patches: Ints, u: Floats, v: Floats) -> Floats:
        """Directions (..., 2) spread evenly in projected solid angle over patches; u and v in [0, 1)."""
        ring = self.ring[patches]
        sine2 = np.sin(np.radians(self.theta_bounds_deg)) ** 2
        sine = np.sqrt(sine2[ring] + u * (sine2[ring + 1] - sine2[ring]))
        phi = 2.0 * np.pi * (patches - self.first[ring] + v - 0.5) / np.array(self.n_phi)[ring]
        return np.stack([sine * np.cos(phi), sine * np.sin(phi)], axis=-1)


KLEMS_FULL: Final = AngleBasis(
    "LBNL/Klems Full", (0, 5, 15, 25, 35, 45, 55, 65, 75, 90), (1, 8, 16, 20, 24, 24, 24, 16, 12)
)
KLEMS_HALF: Final = AngleBasis("LBNL/Klems Half", (0, 6.5, 19.5, 32.5, 45.5, 58.5, 71.5, 90), (1, 8, 12, 16, 20, 12, 8))
KLEMS_QUARTER: Final = AngleBasis("LBNL/Klems Quarter", (0, 9, 27, 45, 63, 90), (1, 8, 12, 12, 8))


def _refined(k: int, centre: tuple[int, ...]) -> AngleBasis:
    bounds: list[float] = []
    n_phi: list[int] = list(centre)
    for i, (low, high) in enumerate(pairwise(KLEMS_FULL.theta_bounds_deg)):
        bounds += [low + (high - low) * j / k for j in range(k)]
        if i > 0:
            n_phi += [k * KLEMS_FULL.n_phi[i]] * k
    return AngleBasis(f"LBNL/Klems Full {k}x", (*bounds, 90.0), tuple(n_phi))


KLEMS_2X: Final = _refined(2, (1, 4))
KLEMS_4X: Final = _refined(4, (1, 4, 4, 8))

OLD_HALF: Final = AngleBasis("LBNL/Klems Half", (0, 6.5, 19.5, 32.5, 46.5, 61.5, 76.5, 90), (1, 8, 12, 16, 20, 12, 4))
OLD_QUARTER: Final = AngleBasis("LBNL/Klems Quarter", (0, 9, 27, 46, 66, 90), (1, 8, 12, 12, 8))

KNOWN: Final = {basis.name: basis for basis in (KLEMS_FULL, KLEMS_HALF, KLEMS_QUARTER, KLEMS_2X, KLEMS_4X)}
"""Bases by name, as Radiance 6 and this program write them."""
