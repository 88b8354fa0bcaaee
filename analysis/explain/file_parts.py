"""Sun and sky parts of an arm's records that only the case's .ies files give apart."""

from dataclasses import replace

import numpy as np

from analysis.cases import Case
from analysis.explain.fields import fields_of
from analysis.explain.readings import GONIOMETER, Readings
from analysis.explain.sampler import Sampler


def readings_of(case: Case, *, measured_only: bool = True) -> Readings:
    """`Readings.of`, where the arm's rows without parts get the shares of their test's .ies files in their directions.

    Their sum stays what the records predict. Tests that bring no such files stay as they are.
    """
    r = Readings.of(case, measured_only=measured_only)
    apart = np.array([t.simulated is not None and bool(t.simulated.sun and t.simulated.sky) for t in case.tests])
    rows = (r.kind == GONIOMETER) & np.isnan(r.sun) & apart[r.test]
    if not np.any(rows):
        return r
    given = fields_of(r)
    at = Sampler(r.test, np.nan_to_num(r.gamma_deg), np.nan_to_num(r.c_deg))
    sun, sky = np.maximum(at(given.sun), 0.0), np.maximum(at(given.sky), 0.0)
    total = sun + sky
    share = np.divide(sky, total, out=np.ones_like(sky), where=total > 0.0)
    return replace(
        r,
        sun=np.where(rows, (1.0 - share) * r.simulated, r.sun),
        sky=np.where(rows, share * r.simulated, r.sky),
    )
