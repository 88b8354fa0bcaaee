"""How a goniophotometer scan is reduced, and what comes out."""

from dataclasses import dataclass

import numpy as np

from analysis.photometry.closing import Row90
from analysis.photometry.distribution import Distribution
from analysis.photometry.lm63_model import FileGeneration
from analysis.photometry.readings import Floats, Ints
from labdaq.errors import DataError, Problems

PLANES_DEG = tuple(22.5 * i for i in range(16))


@dataclass(frozen=True, kw_only=True)
class ReductionOptions:
    """How to reduce a scan.

    Attributes
    ----------
    distance_m, distance_uncertainty_m
        From the aperture's centre to the sensors, and its standard uncertainty [m].
    planes_deg
        Nominal C-planes [deg]; a reading belongs to the nearest.
    plane_tolerance_deg
        How far the arm may have been from its plane [deg].
    angle_uncertainty_deg
        Standard uncertainty of the sensors' position in gamma and C [deg].
    reference_lx
        Global illuminance the result is normalised to [lx]; by default the mean over the readings.
    roof_gap_s
        Longest time between two roof readings, and from a reading to the nearest one [s].
    row_90
        What to put at gamma 90, or ``None`` to leave it out.
    reject_outliers
        Whether a repeat that lies far from at least four others is left out (see `repeats.Cells`).
    fill_missing
        Whether a direction without a usable reading is interpolated between its neighbours in C.
    """

    distance_m: float = 2.6
    distance_uncertainty_m: float = 0.002
    planes_deg: tuple[float, ...] = PLANES_DEG
    plane_tolerance_deg: float = 1.0
    angle_uncertainty_deg: float = 0.1
    reference_lx: float | None = None
    roof_gap_s: float = 30.0
    row_90: Row90 | None = Row90.ZERO
    reject_outliers: bool = True
    fill_missing: bool = False

    def __post_init__(self) -> None:
        problems = Problems("reduction")
        if not self.distance_m > 0:
            problems.add("distance_m", f"must be positive, not {self.distance_m:g}")
        if self.reference_lx is not None and not self.reference_lx > 0:
            problems.add("reference_lx", f"must be positive, not {self.reference_lx:g}")
        if not all(0 <= c < 360 for c in self.planes_deg) or np.any(np.diff(self.planes_deg) <= 0):
            problems.add("planes_deg", "must increase within 0 <= C < 360")
        elif not self.planes_deg or self.planes_deg[0] != 0:
            problems.add("planes_deg", "must start at 0")
        problems.raise_if_any(DataError)


@dataclass(frozen=True, kw_only=True)
class Reduction:
    """A reduced scan.

    Attributes
    ----------
    distribution
        Near-field intensity [cd] at ``distance_m``, closed at C 360 and gamma 90.
    uncertainty_cd : shape (P, G)
        Standard uncertainty of each intensity [cd].
    budget
        The same by cause: ``readings``, ``dark``, ``calibration``, ``daylight``, ``distance``, ``angle``.
    count : shape (P, G)
        Readings behind each intensity; 0 where it was filled in.
    reference_lx
        Global illuminance the intensities belong to [lx].
    normalisation : shape (n,)
        Factor each reading was multiplied with for the daylight's change.
    generation
        File generation type an LM-63 file of it must carry.
    decisions
        What was done, one sentence each, in order.
    """

    distribution: Distribution
    distance_m: float
    uncertainty_cd: Floats
    budget: dict[str, Floats]
    count: Ints
    reference_lx: float
    normalisation: Floats
    generation: FileGeneration
    decisions: tuple[str, ...] = ()

    def file_name(self, stem: str) -> str:
        """Name for an LM-63 file that says near-field and at which distance."""
        return f"{stem}-near-{self.distance_m:.2f}m.ies"
