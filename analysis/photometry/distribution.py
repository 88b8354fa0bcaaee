"""The luminous intensity distribution of a luminaire, type C."""

from dataclasses import dataclass, field
from typing import Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from labdaq.errors import DataError

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Distribution:
    """Luminous intensity over gamma and C.

    Attributes
    ----------
    gamma_deg : shape (G,) [deg]
        Increasing; 0 is nadir.
    c_deg : shape (P,) [deg]
        Increasing from 0 to 360, both included: the last plane repeats the first. (Symmetric files are unfolded
        when they are read.) C = 0 is north, 90 west, 180 south, 270 east.
    candela : shape (P, G) [cd]
    keywords
        Free text that belongs to the distribution, e.g. LM-63 keywords.
    """

    gamma_deg: Floats
    c_deg: Floats
    candela: Floats
    keywords: dict[str, str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if self.candela.shape != (len(self.c_deg), len(self.gamma_deg)):
            raise DataError(
                f"candela has shape {self.candela.shape}, but there are {len(self.c_deg)} C-planes "
                f"and {len(self.gamma_deg)} gamma angles"
            )
        if len(self.gamma_deg) < 2:
            raise DataError("a distribution needs at least two gamma angles")
        if np.any(np.diff(self.gamma_deg) <= 0) or np.any(np.diff(self.c_deg) <= 0):
            raise DataError("gamma and C angles must increase")
        if self.c_deg[0] != 0.0 or self.c_deg[-1] != 360.0:
            raise DataError(f"C-planes must run from 0 to 360, not {self.c_deg[0]:g} to {self.c_deg[-1]:g}")
        if not np.all(np.isfinite(self.candela)):
            raise DataError("a candela value is not a finite number")

    @classmethod
    def closed(cls, gamma_deg: ArrayLike, c_deg: ArrayLike, candela: ArrayLike) -> Self:
        """Make a distribution of planes 0 <= C < 360 by repeating the first plane at 360."""
        c = np.append(np.asarray(c_deg, dtype=np.float64), 360.0)
        values = np.asarray(candela, dtype=np.float64)
        return cls(np.asarray(gamma_deg, dtype=np.float64), c, np.concatenate([values, values[:1]]))

    def at(self, gamma_deg: ArrayLike, c_deg: ArrayLike) -> Floats:
        """Intensity [cd] at directions, bilinear in gamma and C; 0 beyond the gammas the file covers."""
        c = np.mod(np.asarray(c_deg, dtype=np.float64), 360.0)
        return interpolate(self.gamma_deg, self.c_deg, self.candela, gamma_deg, c)

    def flux(self) -> float:
        """Luminous flux [lm]: the bilinear surface integrated exactly over the solid angle it covers."""
        g = np.radians(self.gamma_deg)
        # ∫ of the hat functions against sin γ: exact for intensity linear in gamma between the angles given
        d = np.diff(g)
        moment = (np.sin(g[1:]) - np.sin(g[:-1])) / d
        left = np.cos(g[:-1]) - moment
        right = moment - np.cos(g[1:])
        ring = np.zeros(len(g))
        ring[:-1] += left
        ring[1:] += right
        width = np.radians(np.diff(self.c_deg))
        plane = np.zeros(len(self.c_deg))
        plane[:-1] += width / 2
        plane[1:] += width / 2
        return float(plane @ self.candela @ ring)

    def scaled(self, factor: float) -> Self:
        """The same distribution times ``factor``."""
        return type(self)(self.gamma_deg, self.c_deg, self.candela * factor, self.keywords)

    def resampled(self, gamma_deg: ArrayLike, c_deg: ArrayLike) -> Self:
        """The same distribution on other angles (``c_deg`` from 0 to 360, both included)."""
        gamma = np.asarray(gamma_deg, dtype=np.float64)
        c = np.asarray(c_deg, dtype=np.float64)
        return type(self)(gamma, c, self.at(gamma[None, :], c[:, None]), self.keywords)


def interpolate(vertical: Floats, horizontal: Floats, table: Floats, v: ArrayLike, h: ArrayLike) -> Floats:
    """Bilinear value of ``table`` (H, V) at angles (v, h), which broadcast; 0 outside the table."""
    x, y = np.broadcast_arrays(np.asarray(v, dtype=np.float64), np.asarray(h, dtype=np.float64))
    # a grazing rounding error must not push a direction over the table's edge
    inside = (x >= vertical[0] - 1e-9) & (x <= vertical[-1] + 1e-9)
    inside &= (y >= horizontal[0] - 1e-9) & (y <= horizontal[-1] + 1e-9)
    i, s = _cell(vertical, x)
    j, t = _cell(horizontal, y)
    low = (1 - s) * table[j, i] + s * table[j, i + 1]
    high = (1 - s) * table[j + 1, i] + s * table[j + 1, i + 1]
    return np.where(inside, (1 - t) * low + t * high, 0.0)


def _cell(edges: Floats, x: Floats) -> tuple[NDArray[np.intp], Floats]:
    """Index of the interval each x lies in, and how far along it [0..1], clamped to the ends."""
    i = np.clip(np.searchsorted(edges, x, side="right") - 1, 0, len(edges) - 2)
    return i, np.clip((x - edges[i]) / (edges[i + 1] - edges[i]), 0.0, 1.0)
