"""Several readings of one direction become one, and directions without a reading are noticed."""

from collections.abc import Iterable, Mapping

import numpy as np

from analysis.photometry.readings import Floats, Ints
from labdaq.errors import DataError, Problems

ENOUGH = 5
"""Readings of one direction from which on one of them can be told from the others."""
FAR = 3.5
"""Modified z-score beyond which a reading is an outlier (Iglewicz and Hoaglin 1993, ASQC volume 16)."""


class Cells:
    """Readings sorted by direction.

    Parameters
    ----------
    cell : shape (n,)
        Direction each reading belongs to; -1 for none.
    size
        Number of directions.
    reject_outliers
        Leave out readings whose modified z-score, 0.6745 times the distance from the median over the median absolute
        deviation, exceeds 3.5 among at least five of the same direction.
    """

    def __init__(self, cell: Ints, size: int, *, reject_outliers: bool) -> None:
        self.cell = cell
        self.size = size
        self.reject_outliers = reject_outliers
        self.rejected: list[tuple[int, float, float]] = []

    def average(
        self, values: Floats, parts: Mapping[str, Floats], systematic: Iterable[str]
    ) -> tuple[Floats, dict[str, Floats], Ints]:
        """Mean, standard uncertainty by cause and count of each direction, shape (size,); NaN without a reading.

        What the repeats of a direction have in common (``systematic``) is averaged; reading noise falls with the root
        of their number, and is taken from their spread where there are at least two and it is larger than stated.
        """
        mean = np.full(self.size, np.nan)
        count = np.zeros(self.size, dtype=np.intp)
        result = {name: np.zeros(self.size) for name in parts}
        common = set(systematic)
        order = np.argsort(self.cell, kind="stable")
        edges = np.searchsorted(self.cell[order], np.arange(self.size + 1))
        for k in range(self.size):
            rows = self._kept(k, order[edges[k] : edges[k + 1]], values)
            n = len(rows)
            if n == 0:
                continue
            mean[k], count[k] = values[rows].mean(), n
            for name, part in parts.items():
                if name in common:
                    result[name][k] = part[rows].mean()
                else:
                    stated = np.sqrt(np.sum(part[rows] ** 2)) / n
                    spread = values[rows].std(ddof=1) / np.sqrt(n) if n > 1 else 0.0
                    result[name][k] = max(stated, spread)
        return mean, result, count

    def _kept(self, k: int, rows: Ints, values: Floats) -> Ints:
        if not self.reject_outliers or len(rows) < ENOUGH:
            return rows
        median = np.median(values[rows])
        deviation = np.abs(values[rows] - median)
        spread = np.median(deviation)
        if spread <= 0.0:
            return rows
        far = 0.6745 * deviation / spread > FAR
        self.rejected += [(k, float(values[row]), float(median)) for row in rows[far]]
        kept: Ints = rows[~far]
        return kept

    def decisions(self, gammas: Floats, planes: Floats) -> list[str]:
        """A sentence for the repeats and one for each rejected reading."""
        sizes = np.bincount(self.cell[self.cell >= 0], minlength=self.size)
        said = []
        if gammas[0] == 0.0 and sizes[0] > 1:
            said.append(f"{sizes[0]} nadir readings averaged to one intensity for all planes")
        rest = np.delete(sizes, 0)
        if rest.size and rest.max() > 1:
            said.append(f"up to {rest.max()} readings of one direction averaged")
        for k, value, median in self.rejected:
            plane, gamma = planes[k // len(gammas)], gammas[k % len(gammas)]
            said.append(
                f"outlier left out at gamma {gamma:g}, C {plane:g}: {value:.5g} cd beside a median of {median:.5g}"
            )
        return said


def fill_gaps(
    gammas: Floats, planes: Floats, table: Floats, count: Ints, budget: dict[str, Floats], *, allowed: bool
) -> tuple[Floats, list[str]]:
    """Fill directions without a reading, linearly in C between the nearest planes that have one.

    The uncertainty of a filled value is half the difference of the two it comes from, with theirs. ``budget`` is
    changed in place. Returns the table and a sentence for each filled direction.

    Raises
    ------
    DataError
        Directions are missing and filling is not allowed, or a gamma has no reading at all; all are named.
    """
    missing = np.argwhere(count == 0)
    if not missing.size:
        return table, []
    problems = Problems("goniometer readings")
    table, said = table.copy(), []
    for j, i in missing:
        have = np.flatnonzero(count[:, i] > 0)
        if not allowed or len(have) < 2:
            problems.add(f"gamma {gammas[i]:g}, C {planes[j]:g}", "no usable reading")
            continue
        before, after = have[(have < j).sum() - 1], have[(have < j).sum() % len(have)]
        width = (planes[after] - planes[before]) % 360.0
        t = ((planes[j] - planes[before]) % 360.0) / width
        low, high = table[before, i], table[after, i]
        table[j, i] = (1 - t) * low + t * high
        for name, part in budget.items():
            part[j, i] = max(part[before, i], part[after, i])
            if name == "readings":
                part[j, i] = np.hypot(part[j, i], 0.5 * abs(high - low))
        said.append(f"gamma {gammas[i]:g}, C {planes[j]:g} filled from C {planes[before]:g} and {planes[after]:g}")
    problems.raise_if_any(DataError, "measure again, or allow fill_missing")
    return table, said
