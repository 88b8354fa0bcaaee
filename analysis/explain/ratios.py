"""Ratios of traced fields: of a setting to the skylight as described, where rays may be few."""

from typing import Final

import numpy as np

from analysis.cases.model import Floats

Field = tuple[Floats, Floats]
"""Sun part and sky part, (T, P, G) [cd] each."""

_DARK: Final = 0.01
"""Share of the brightest direction below which a ratio is drawn towards the usual one."""
_FEW: Final = 0.05
"""The same share of a gamma's mean over C: there the rays are few."""
_HARDLY_ANY: Final = 1e-4
"""Share of the brightest direction below which even what is usual at a gamma is drawn towards the part's ratio."""
_NO_LIGHT: Final = 1e-6
"""Share of the brightest direction that is none."""
_AT_MOST: Final = (0.02, 50.0)
"""Beyond these a ratio is noise of the rays, not physics."""


def over(new: Field, old: Field) -> Field:
    """Ratio of both parts; see `ratio`."""
    return ratio(new[0], old[0]), ratio(new[1], old[1])


def ratio(new: Floats, old: Floats) -> Floats:
    """Ratio of fields (T, P, G); where rays are few, drawn towards the ratio that is usual at its gamma.

    Never towards 1: far from the sun's image all directions are dark beside it, and yet each of them changes. Nor
    towards the ratio of means over C: an image that moves or blurs changes those, and not the other directions.
    """
    rings = old.mean(axis=-2, keepdims=True)
    brightest = _brightest(old)
    whole = _drawn(new.mean(axis=(-2, -1), keepdims=True), old.mean(axis=(-2, -1), keepdims=True), 1e-9 * brightest)
    usual = np.median(_drawn(new, old, _FEW * rings + _HARDLY_ANY * brightest, whole), axis=-2, keepdims=True)
    few = np.maximum(_FEW * rings, _DARK * brightest)
    return np.asarray(np.clip(_drawn(new, old, few, usual), *_AT_MOST))


def blurred_ratio(new: Floats, old: Floats) -> Floats:
    """Ratio of fields (T, P, G) whose images blur where they are, and that stay what they were elsewhere."""
    return np.asarray(np.clip(_drawn(new, old, _DARK * _brightest(old)), *_AT_MOST))


def plain_ratio(new: Floats, old: Floats) -> Floats:
    """Ratio of fields (T, P, G) or (P, G) that share their rays or their lens; 1 where there was no light."""
    lit = old > _NO_LIGHT * _brightest(old)
    return np.asarray(np.clip(np.divide(new, old, out=np.ones_like(new), where=lit), *_AT_MOST))


def _brightest(field: Floats) -> Floats:
    """The brightest direction of each test (T, 1, 1), or of the only one (1, 1), never quite dark [cd]."""
    return np.asarray(np.maximum(field.max(axis=(-2, -1), keepdims=True), 1e-12))


def _drawn(new: Floats, old: Floats, floor: Floats, towards: Floats | float = 1.0) -> Floats:
    """``new / old``, drawn ``towards`` another ratio where ``old`` is not above ``floor``."""
    return np.asarray((new + floor * towards) / (old + floor))
