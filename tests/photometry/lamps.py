"""What files are written of: a distribution that shows every turn and mirror image, and its keywords."""

import numpy as np

from analysis.photometry import Distribution
from analysis.photometry.closing import Row90, closed_at_90

KEYWORDS = {"TEST": "27", "TESTLAB": "Greenwood", "ISSUEDATE": "2010-07-22", "MANUFAC": "none", "LUMCAT": "box"}


def lopsided(row: Row90 | None = Row90.ZERO) -> Distribution:
    """On the goniophotometer's grid; every direction differs from its mirror images, and every plane from the others.

    Its readings end at 85 degrees; ``row`` tells what follows at 90, if anything.
    """
    gamma = np.array([0, 5, 15, 25, 35, 45, 55, 65, 75, 85.0])
    c = np.arange(16) * 22.5
    tilt = 1 + 0.5 * np.cos(np.radians(c - 70))[:, None] * np.sin(np.radians(gamma))
    d = Distribution.closed(gamma, c, 1000 * np.cos(np.radians(gamma)) * tilt)
    d = Distribution(d.gamma_deg, d.c_deg, d.candela, dict(KEYWORDS))
    return d if row is None else closed_at_90(d, row)
