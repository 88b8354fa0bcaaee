"""Sun and sky part of a roof meter's prediction, where a case gives only their sum.

A test's global and diffuse illuminance say how much of the light is the sky's while the sun stands where the test says;
through a whole day that share grows towards the horizon and under cloud as the clearness index falls (a logistic law:
Boland, Ridley and Brown 2008, Renewable Energy 33:575, as pvlib has it, of whose correlations it is the nearest to a
recorded clear day).
"""

import numpy as np
from scipy.special import expit, logit

from analysis.cases.model import Floats, Ints

_EFFICACY = 110.0
"""Luminous efficacy of daylight [lm/W], to ask a correlation of irradiances about illuminances: measured means are 107
(clear) to 109 (average skies; Littlefair 1988, Lighting Research & Technology 20:177)."""
_NEAR_DEG = 3.0
"""Readings with the sun so near to the test's height count as at the test's moment."""

_SHARES = (0.01, 0.99)
"""The sky's share is never beyond these."""


def sun_part(
    predicted: Floats, series: Ints, altitude_deg: Floats, day_of_year: Ints, test: tuple[Floats, ...]
) -> Floats:
    """The sun's part (N,) of predictions (N,) [lx]; NaN where the test's illuminances are not known.

    Parameters
    ----------
    series : shape (N,)
        Number of the series, of one meter in one test, that a row belongs to.
    altitude_deg, day_of_year : shape (N,)
        The sun's altitude, NaN where it is not known, and the day.
    test
        Global and diffuse illuminance [lx] and the sun's altitude [deg] of each row's test, (N,) each.
    """
    usual = _logit_of_sky(predicted, altitude_deg, day_of_year)
    sun = np.full(len(predicted), np.nan)
    for k in np.unique(series):
        rows = np.flatnonzero(series == k)
        total, diffuse, height = (float(column[rows[0]]) for column in test)
        away = np.abs(altitude_deg[rows] - height)
        at_the_time = rows[away <= max(_NEAR_DEG, float(away.min()))] if np.all(np.isfinite(away)) else rows
        seen = float(np.median(predicted[at_the_time]))
        if abs(seen - diffuse) < abs(seen - total):  # a shaded meter
            sun[rows] = 0.0
        elif np.isfinite(total + diffuse):
            more = logit(np.clip(diffuse / total, *_SHARES)) - np.median(usual[at_the_time])
            sun[rows] = predicted[rows] * (1.0 - expit(usual[rows] + more))
    return sun


def _logit_of_sky(predicted: Floats, altitude_deg: Floats, day_of_year: Ints) -> Floats:
    """Logit of the sky's usual share in global illuminances (N,); even where the sun's altitude is not known."""
    if not np.all(np.isfinite(altitude_deg)):
        return np.zeros(len(predicted))
    from pvlib.irradiance import boland

    irradiance = np.maximum(predicted, 1.0) / _EFFICACY
    share = boland(irradiance, 90.0 - altitude_deg, day_of_year)["dhi"] / irradiance
    return np.asarray(logit(np.clip(share, *_SHARES)))
