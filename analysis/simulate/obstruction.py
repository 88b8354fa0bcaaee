"""What stands around a skylight and keeps sun and sky from it: black parallelograms in space.

A parapet, a plant room, a tree's outline or an overhang is a few of them. They take light away before it reaches the
cover and send none: what they would reflect is left out.
"""

import math
from collections.abc import Sequence
from typing import Final, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import ConfigDict, model_validator
from pydantic.dataclasses import dataclass

Floats = NDArray[np.float64]
Triple = tuple[float, float, float]

_STRICT: Final = ConfigDict(extra="forbid", allow_inf_nan=False)


@dataclass(frozen=True, config=_STRICT)
class Obstruction:
    """An opaque, black parallelogram, in the site's frame [m]: x east, y north, z up from the centre of the aperture.

    It stays where it is when ``rotation_deg`` turns the skylight.

    Attributes
    ----------
    corner_m
        One corner.
    along_m, across_m
        Its two edges from there.
    """

    corner_m: Triple
    along_m: Triple
    across_m: Triple

    @model_validator(mode="after")
    def _has_area(self) -> Self:
        normal = np.cross(self.along_m, self.across_m)
        if not np.linalg.norm(normal) > 1e-12 * np.linalg.norm(self.along_m) * np.linalg.norm(self.across_m):
            raise ValueError("along_m and across_m must span an area")
        return self

    @property
    def corners(self) -> list[Triple]:
        """Its four corners in order [m]."""
        steps = ((0, 0), (1, 0), (1, 1), (0, 1))
        return [self._at(a, b) for a, b in steps]

    def _at(self, a: float, b: float) -> Triple:
        x, y, z = (c + a * u + b * v for c, u, v in zip(self.corner_m, self.along_m, self.across_m, strict=True))
        return x, y, z


def rows(obstructions: Sequence[Obstruction], rotation_deg: float = 0.0) -> Floats:
    """Arrays for the kernels, in the frame of a skylight turned by ``rotation_deg``, shape (n, 12).

    Columns: corner, normal (any length), and the two vectors whose products with a step from the corner are its shares
    of either edge (the dual basis of the edges in their plane).
    """
    turn = math.radians(rotation_deg)
    to_own = np.array([[math.cos(turn), math.sin(turn), 0.0], [-math.sin(turn), math.cos(turn), 0.0], [0.0, 0.0, 1.0]])
    found = np.zeros((len(obstructions), 12))
    for row, it in zip(found, obstructions, strict=True):
        corner, along, across = (to_own @ np.array(edge) for edge in (it.corner_m, it.along_m, it.across_m))
        normal = np.cross(along, across)
        shares = [np.cross(across, normal) / (normal @ normal), np.cross(normal, along) / (normal @ normal)]
        row[:] = np.concatenate([corner, normal, *shares])
    return found


def between(obstructions: Sequence[Obstruction], first: Floats, second: Floats) -> NDArray[np.bool_]:
    """Whether something stands on the way from one place to another; places of shape (n, 3) [m], result (n,)."""
    found = np.zeros(len(first), dtype=bool)
    for row in rows(obstructions):
        corner, normal, along, across = row.reshape(4, 3)
        with np.errstate(divide="ignore", invalid="ignore"):
            share = ((corner - first) @ normal) / ((second - first) @ normal)
            step = first + share[:, None] * (second - first) - corner
        a, b = step @ along, step @ across
        found |= (share > 0.0) & (share < 1.0) & (a >= 0.0) & (a <= 1.0) & (b >= 0.0) & (b <= 1.0)
    return found
