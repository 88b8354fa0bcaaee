"""Small turns of a lens that a case brings, and what lies between: a mixture of a turned pattern and one that is not.

Images that move by less than they are wide are nearly such a mixture; those that move by more are not at all.
"""

from typing import Final

import numpy as np

from analysis.cases.model import Floats
from analysis.explain.retrace import Path

SMALL_TURN_DEG: Final = 25.0
"""A larger turn moves images by more than they are wide, as a rule."""


def turns_little(way: object) -> bool:
    """Whether a way is small turns of a pattern that the case brings, and mixtures of them and of none."""
    if not (isinstance(way, Path) and way.of_case and way.parameter.name == "rotation_deg"):
        return False
    return bool(np.abs(way.positions).max() <= SMALL_TURN_DEG)


def mixture(way: object, theta: Floats) -> float:
    """How much of a mixture a small turn of the pattern is with none: 1 half-way, 0 where it was simulated.

    ``theta`` begins with the way's own parameters. So errs a straight line between two points of a curve.
    """
    if not (isinstance(way, Path) and turns_little(way)):
        return 0.0
    x = min(abs(float(theta[0])) / float(np.abs(way.positions[way.positions != 0.0]).min()), 1.0)
    return 4.0 * x * (1.0 - x)
