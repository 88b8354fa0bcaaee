"""Fill the gamma row that a goniophotometer in a roof cannot measure, and say so.

The laboratory's arm ends at gamma 85, but an LM-63 file of type C must end at 90 (or 180).
"""

from enum import StrEnum

import numpy as np

from analysis.photometry.distribution import Distribution


class Row90(StrEnum):
    """What to put at gamma 90."""

    ZERO = "zero"  # a flat opening in the ceiling has no projected area at 90
    EXTRAPOLATED = "extrapolated"  # the line through the last two gammas, not below zero


def closed_at_90(distribution: Distribution, row: Row90 = Row90.ZERO) -> Distribution:
    """Append a gamma 90 row to a distribution that ends before 90.

    The keyword ``[_ROW90]`` tells how; a file made of it must say that angles were interpolated
    (`FileGeneration.measured(interpolated=True)`). Distributions that reach 90 are returned unchanged.
    """
    gamma, planes = distribution.gamma_deg, distribution.candela
    if gamma[-1] >= 90.0:
        return distribution
    if row is Row90.ZERO:
        last = np.zeros(len(planes))
    else:
        slope = (planes[:, -1] - planes[:, -2]) / (gamma[-1] - gamma[-2])
        last = np.maximum(0.0, planes[:, -1] + slope * (90.0 - gamma[-1]))
    keywords = distribution.keywords | {"_ROW90": f"{row.value}, not measured"}
    return Distribution(np.append(gamma, 90.0), distribution.c_deg, np.column_stack([planes, last]), keywords)
