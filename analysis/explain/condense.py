"""Long series of roof meters, averaged over moments: thousands of neighbours tell no more than their means do.

Evidence is worked out with covariances of whole days; a meter that is read each second would fill any memory.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from analysis.cases import Case
from analysis.cases.model import Floats, Ints, Records
from analysis.explain.readings import GONIOMETER, Readings

MOST = 6000
"""So many readings are weighed one by one."""


def condensed(case: Case) -> tuple[Case, Ints]:
    """``case`` with runs of neighbours averaged where it has more than `MOST` readings, and where its rows went.

    Averaged are readings of one test, channel and direction, in the order of time, the same number each time; never
    those of the arm. The second array (N,) gives each record's place among the new ones, -1 for records without a
    reading. What a case of fewer readings holds stays as it is.
    """
    whole = np.arange(len(case.records))
    r = Readings.of(case)
    series = (r.kind != GONIOMETER) & (r.utc_ns >= 0)
    count, alone = int(np.count_nonzero(series)), int(np.count_nonzero(~series))
    if count + alone <= MOST or count == 0:
        return case, whole
    together = int(np.ceil(count / max(MOST - alone, MOST // 4)))
    group = np.full(len(r), -1)
    group[~series] = np.arange(alone)
    for rows in _runs(r, np.flatnonzero(series)):
        group[rows] = group.max() + 1 + np.arange(len(rows)) // together
    if group.max() + 1 == len(r):  # all look in directions of their own
        return case, whole
    place = np.full(len(whole), -1)
    place[r.row] = group
    return replace(case, records=_averaged(case, r.row, group)), place


def _runs(r: Readings, rows: Ints) -> list[Ints]:
    """Rows of one test, channel and direction, each in the order of time."""
    keys = [np.nan_to_num(r.c_deg[rows], nan=-1.0), np.nan_to_num(r.gamma_deg[rows], nan=-1.0)]
    keys += [r.channel[rows].astype(float), r.test[rows].astype(float)]
    order = rows[np.lexsort((r.utc_ns[rows], *keys))]
    facts = np.stack([r.test, r.channel, np.nan_to_num(r.gamma_deg, nan=-1.0), np.nan_to_num(r.c_deg, nan=-1.0)])
    new = np.flatnonzero(np.any(np.diff(facts[:, order], axis=1) != 0, axis=0)) + 1
    return np.split(order, new)


def _averaged(case: Case, rows: Ints, group: NDArray[np.int64]) -> Records:
    """The means of all groups, as records."""
    records = case.records
    first = rows[np.unique(group, return_index=True)[1]]
    count = np.bincount(group)

    def mean(values: Floats) -> Floats:
        return np.asarray(np.bincount(group, weights=values[rows]) / count)

    start = records.utc_ns[first]
    since = np.bincount(group, weights=(records.utc_ns[rows] - start[group]).astype(float)) / count
    return Records(
        test=records.test[first],
        channel=records.channel[first],
        utc_ns=start + since.round().astype(np.int64),
        gamma_deg=records.gamma_deg[first],
        c_deg=records.c_deg[first],
        measured=mean(records.measured),
        uncertainty=np.sqrt(mean(np.square(records.uncertainty)) / count),
        simulated=mean(records.simulated),
        sun=mean(records.sun),
        sky=mean(records.sky),
    )
