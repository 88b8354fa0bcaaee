"""Everything a comparison says in numbers: by test, by system, by sky, and for the whole campaign."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from analysis.cases import Case, Test
from analysis.cases.model import Floats, Ints
from analysis.compare.peaks import Peak, PeakPair, find_peaks, match_peaks
from analysis.compare.scan import Scan, scan_of
from analysis.compare.shape import Agreement, Rings, agreement, rings
from analysis.compare.simulations import Simulated, simulations


@dataclass(frozen=True)
class Against:
    """One simulation against one test's recording."""

    agreement: Agreement
    rings: Rings
    peaks: tuple[PeakPair, ...]


@dataclass(frozen=True)
class TestComparison:
    """One test of the goniophotometer with each simulation that predicts it, by name."""

    __test__ = False  # not a test for pytest

    test: Test
    scan: Scan
    peaks: tuple[Peak, ...]
    against: Mapping[str, Against]


@dataclass(frozen=True)
class ChannelComparison:
    """Readings of another channel (a roof meter, the zenith) in one test against one simulation.

    Attributes
    ----------
    readings
        How many are compared.
    measured, simulated
        Their means [unit].
    ratio, ratio_scatter
        Mean and standard deviation of simulated over measured; the deviation is NaN for a single reading.
    """

    test: Test
    channel: str
    unit: str
    simulation: str
    readings: int
    measured: float
    simulated: float
    ratio: float
    ratio_scatter: float


@dataclass(frozen=True)
class Group:
    """Tests that have something in common, for one simulation.

    Attributes
    ----------
    label
        ``all tests``, ``system box``, ``sky clear`` ...
    tests
        Ids.
    flux_ratio, flux_ratio_scatter
        Mean and standard deviation over the tests (NaN for one test).
    shape_difference, shape_difference_worst
        Mean and largest over the tests.
    rms_percent
        Root mean square over the tests [%].
    rings
        Mean over the tests; ``uncertainty`` is the standard error of that mean from the scatter of the tests (NaN for
        one test), ``lowest`` and ``highest`` are the tests' extremes.
    """

    label: str
    simulation: str
    tests: tuple[str, ...]
    flux_ratio: float
    flux_ratio_scatter: float
    shape_difference: float
    shape_difference_worst: float
    rms_percent: float
    rings: Rings


@dataclass(frozen=True)
class Comparison:
    """A recording and its simulations.

    Attributes
    ----------
    simulations
        The case's own first.
    tests
        Those with readings of the goniophotometer.
    channels
        The other channels, by test and simulation.
    """

    case: Case
    simulations: tuple[Simulated, ...]
    tests: tuple[TestComparison, ...]
    channels: tuple[ChannelComparison, ...]

    @cached_property
    def groups(self) -> tuple[Group, ...]:
        """All tests, each system, each sky; for each simulation."""
        sorts: list[tuple[str, list[TestComparison]]] = [("all tests", list(self.tests))]
        for word in ("system", "sky"):
            for value in dict.fromkeys(getattr(t.test, word) for t in self.tests):
                if value is not None:
                    alike = [t for t in self.tests if getattr(t.test, word) == value]
                    sorts.append((f"{word} {value}", alike))
        made = (_group(label, s.name, tests) for label, tests in sorts for s in self.simulations)
        return tuple(g for g in made if g is not None)


def compare(case: Case, others: Sequence[Case] = (), *, variants: bool = False) -> Comparison:
    """Compare a recording with its simulations; see `simulations` for the parameters and errors."""
    found = simulations(case, others, variants=variants)
    tests = []
    for k, test in enumerate(case.tests):
        scan = scan_of(case, k, found)
        if scan is not None:
            peaks = find_peaks(scan, scan.measured, scan.uncertainty)
            against = {name: _against(scan, peaks, values) for name, values in scan.simulated.items()}
            tests.append(TestComparison(test, scan, tuple(peaks), {n: a for n, a in against.items() if a is not None}))
    channels = [c for k in range(len(case.tests)) for c in _channels(case, k, found)]
    return Comparison(case, tuple(found), tuple(tests), tuple(channels))


def _against(scan: Scan, peaks: Sequence[Peak], values: Floats) -> Against | None:
    agrees = agreement(scan.measured, scan.uncertainty, values, scan.solid_angle)
    if agrees is None:
        return None
    simulated = find_peaks(scan, values, np.zeros_like(values))
    return Against(
        agrees, rings(scan.gamma, scan.measured, scan.uncertainty, values), tuple(match_peaks(peaks, simulated))
    )


def _channels(case: Case, test: int, found: Sequence[Simulated]) -> list[ChannelComparison]:
    r = case.records
    made = []
    for k, channel in enumerate(case.channels):
        rows: Ints = np.flatnonzero((r.test == test) & (r.channel == k) & np.isfinite(r.measured))
        if channel.kind == "goniometer" or not len(rows):
            continue
        for one in found:
            values, measured = one.values[rows], r.measured[rows]
            good = np.isfinite(values) & (measured != 0)
            if not np.any(good):
                continue
            ratio = values[good] / measured[good]
            scatter = float(ratio.std(ddof=1)) if len(ratio) > 1 else float("nan")
            means = (float(measured[good].mean()), float(values[good].mean()), float(ratio.mean()), scatter)
            made.append(ChannelComparison(case.tests[test], channel.id, channel.unit, one.name, len(ratio), *means))
    return made


def _group(label: str, name: str, tests: Sequence[TestComparison]) -> Group | None:
    done = [(t.test.id, t.against[name]) for t in tests if name in t.against]
    if not done:
        return None
    ratio = np.array([a.agreement.flux_ratio for _, a in done])
    shape = np.array([a.agreement.shape_difference for _, a in done])
    rms = np.array([a.agreement.rms_percent for _, a in done])
    return Group(
        label=label,
        simulation=name,
        tests=tuple(i for i, _ in done),
        flux_ratio=float(ratio.mean()),
        flux_ratio_scatter=_scatter(ratio),
        shape_difference=float(shape.mean()),
        shape_difference_worst=float(shape.max()),
        rms_percent=float(np.sqrt(np.mean(rms**2))),
        rings=_mean_rings([a.rings for _, a in done]),
    )


def _scatter(values: Floats) -> float:
    return float(values.std(ddof=1)) if len(values) > 1 else float("nan")


def _mean_rings(several: Sequence[Rings]) -> Rings:
    """Mean of the tests at each gamma that any of them has."""
    gammas = np.unique(np.concatenate([r.gamma_deg for r in several]))
    rows = []
    for g in gammas:
        values = np.array([v for r in several for v in r.percent[r.gamma_deg == g] if np.isfinite(v)])
        if not len(values):
            rows.append((g, *[float("nan")] * 4))
            continue
        error = _scatter(values) / np.sqrt(len(values))
        rows.append((g, float(values.mean()), error, float(values.min()), float(values.max())))
    return Rings(*np.array(rows, dtype=np.float64).reshape(-1, 5).T)
