"""The lattice of lenses among which that of a prediction is looked for."""

import itertools
from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np

from analysis.simulate.components import Lens
from analysis.simulate.system import System

SIDES: Final = ("down", "up")
SLOPES_DEG: Final = (18.0, 20.25, 22.5, 24.75, 27.0, 29.25, 31.5, 33.75, 36.0, 39.0, 42.0)
BLURS_DEG: Final = (2.0, 4.0, 7.0, 11.0, 16.0)
TURNS_DEG: Final = tuple(7.5 * k for k in range(12))
"""Of the pattern, against how it is supposed to lie; a pattern of pyramids is itself after a quarter turn."""
_BEGIN: Final = 8, 3
"""Slope and tilt of a second beginning for each way that the prisms may look."""


class Prisms(NamedTuple):
    """Lenses that are tried: which side of each carries its prisms, and places on the lattice of the rest.

    A simulation that knows no directions in a lens's plane is ``isotropic``; one that is told no more than a case tells
    has a ``flat`` cover, and a well without a boot.
    """

    sides: tuple[str, ...]
    slope: int
    blur: int
    turn: int = 0
    isotropic: bool = False
    flat: bool = False

    @classmethod
    def of(cls, lenses: Sequence[Lens]) -> "Prisms":
        """Those nearest to the lenses of a system, of which the first tells all but the sides."""
        first = lenses[0]
        slope, blur = _nearest(SLOPES_DEG, first.slope_deg), _nearest(BLURS_DEG, first.blur_deg)
        return cls(tuple(lens.prisms for lens in lenses), slope, blur, isotropic=first.isotropic)

    def beginnings(self) -> "list[list[Prisms]]":
        """For each way that the prisms may look two places, here and elsewhere, below either cover."""
        places = itertools.product(((self.slope, self.blur), _BEGIN), (False, True))
        begun = [(*at, flat) for at, flat in places]
        sides = itertools.product(SIDES, repeat=len(self.sides))
        return [[Prisms(side, slope, blur, flat=flat) for slope, blur, flat in begun] for side in sides]

    def beside(self) -> "list[Prisms]":
        """Neighbours on the lattice of slopes and tilts, and of turns where it is turned; and the other cover."""
        slope, blur, turn = self.slope, self.blur, self.turn
        near = [self._replace(slope=k) for k in (slope - 1, slope + 1) if 0 <= k < len(SLOPES_DEG)]
        near += [self._replace(blur=k) for k in (blur - 1, blur + 1) if 0 <= k < len(BLURS_DEG)]
        near.append(self._replace(flat=not self.flat))
        return near + [self._replace(turn=k % len(TURNS_DEG)) for k in (turn - 1, turn + 1) if turn]

    def under(self, system: System, places: Sequence[str]) -> System:
        """The system with such prisms in its ``places``."""
        values: dict[str, float | str | bool] = {"rise_m": 0.0, "boot_height_m": 0.0} if self.flat else {}
        for place, side in zip(places, self.sides, strict=True):
            values |= {f"{place}.prisms": side, f"{place}.isotropic": self.isotropic}
            values |= {f"{place}.slope_deg": SLOPES_DEG[self.slope], f"{place}.blur_deg": BLURS_DEG[self.blur]}
            own = getattr(system, place).orientation_deg
            values[f"{place}.orientation_deg"] = own + TURNS_DEG[self.turn]
        return system.with_settings(values)


def _nearest(values: tuple[float, ...], wanted: float) -> int:
    return int(np.argmin(np.abs(np.array(values) - wanted)))
