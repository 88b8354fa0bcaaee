"""From goniophotometer readings [lx] at a finite distance to a luminous intensity distribution [cd].

Each reading is freed of its dark reading, calibrated, normalised to the daylight at one moment by the synchronous
reading on the roof, multiplied by the squared distance, and averaged with its repeats. What comes out is the near-field
intensity at that distance: it says so in its keywords and file name, and is never called far-field (at 2.6 m a 0.61 m
aperture is not a point; the report's "5:1 rule" leaves -1 % at nadir and +1 % at 85 degrees for a Lambertian one).
"""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from analysis.photometry.closing import Row90, closed_at_90
from analysis.photometry.distribution import Distribution
from analysis.photometry.lm63_model import FileGeneration
from analysis.photometry.readings import Calibration, DarkReadings, Floats, GonioReadings, Ints, RoofReadings
from analysis.photometry.reduction import Reduction, ReductionOptions
from analysis.photometry.repeats import Cells, fill_gaps
from labdaq.errors import DataError, Problems


@dataclass
class _Work:
    """Values on their way: candela per reading with the parts of its uncertainty [cd]."""

    candela: Floats
    parts: dict[str, Floats] = field(default_factory=dict)
    decisions: list[str] = field(default_factory=list)

    def scale(self, factor: Floats | float) -> None:
        self.candela = self.candela * factor
        self.parts = {name: part * np.abs(factor) for name, part in self.parts.items()}


def reduce_readings(
    readings: GonioReadings,
    roof: RoofReadings,
    *,
    options: ReductionOptions | None = None,
    dark: DarkReadings | None = None,
    calibration: Calibration | None = None,
    keywords: Mapping[str, str] | None = None,
) -> Reduction:
    """Reduce one scan.

    Parameters
    ----------
    readings
        Illuminances of the arm's sensors.
    roof
        Global illuminance on the roof during the scan, on the same time scale.
    dark, calibration
        Dark readings and factors by channel; without them none are applied, and the decisions say so.
    keywords
        Go into the distribution, with ``_DISTANCE``, ``_FIELD``, ``NEARFIELD`` and ``_EREF`` added.

    Raises
    ------
    DataError
        A direction has no usable reading, a reading lies off its plane, the roof was not read close enough in time,
        or a channel has no dark reading or factor; all mistakes of one kind at once.
    """
    options = options or ReductionOptions()
    gammas, planes, cell = _grid(readings, options)
    work = _Work(readings.lux.copy(), {"readings": np.nan_to_num(readings.uncertainty_lux)})
    _take_off_dark(work, readings, dark)
    _calibrate(work, readings, calibration)
    normalisation, reference = _normalise(work, readings, roof, options)
    work.scale(options.distance_m**2)
    work.decisions.append(f"intensity = illuminance x ({options.distance_m:g} m)^2: near-field, holds at that distance")
    cells = Cells(cell, len(planes) * len(gammas), reject_outliers=options.reject_outliers)
    mean, parts, count = cells.average(work.candela, work.parts, systematic=("dark", "calibration", "daylight"))
    work.decisions += cells.decisions(gammas, planes)
    shape = (len(planes), len(gammas))
    table, count = mean.reshape(shape), count.reshape(shape)
    budget = {name: part.reshape(shape) for name, part in parts.items()}
    _one_nadir(gammas, table, count, budget)
    table, filled = fill_gaps(gammas, planes, table, count, budget, allowed=options.fill_missing)
    work.decisions += filled
    if (table < 0).any():
        work.decisions.append(
            f"{int((table < 0).sum())} negative intensities set to 0, the lowest {table.min():.3g} cd"
        )
        table = np.maximum(table, 0.0)
    budget["distance"] = 2.0 * options.distance_uncertainty_m / options.distance_m * np.abs(table)
    budget["angle"] = _angle_part(gammas, planes, table, options.angle_uncertainty_deg)
    return _finish(options, gammas, planes, table, count, budget, normalisation, reference, work, keywords or {})


def _grid(readings: GonioReadings, options: ReductionOptions) -> tuple[Floats, Floats, Ints]:
    """Gammas, planes, and for each reading the index of its direction (-1 for one without a value)."""
    planes = np.array(options.planes_deg)
    off = (readings.c_deg[:, None] - planes + 180.0) % 360.0 - 180.0
    nearest = np.abs(off).argmin(axis=1)
    miss = np.abs(off[np.arange(len(off)), nearest])
    problems = Problems("goniometer readings")
    for i in np.flatnonzero(miss > options.plane_tolerance_deg):
        problems.add(f"reading {i}", f"C = {readings.c_deg[i]:g} is {miss[i]:.2f} degrees off the nearest plane")
    problems.raise_if_any(DataError, "give the planes of the scan as planes_deg")
    gammas, row = np.unique(np.round(readings.gamma_deg, 6), return_inverse=True)
    if len(gammas) < 2 or gammas[0] < 0 or gammas[-1] > 180:
        raise DataError("goniometer readings: at least two gammas within 0..180 are needed")
    # the nadir is one direction, whatever the plane
    column = np.where(gammas[row] == 0.0, 0, nearest)
    return gammas, planes, np.where(readings.usable, column * len(gammas) + row, -1)


def _take_off_dark(work: _Work, readings: GonioReadings, dark: DarkReadings | None) -> None:
    if dark is None:
        work.decisions.append("no dark readings: none subtracted")
        return
    offset, error = dark.offset(readings.sensor)
    work.candela = work.candela - offset
    work.parts["dark"] = error
    work.decisions.append(
        f"dark readings of {offset.min():.4g} to {offset.max():.4g} lx subtracted, by channel (mean of {dark.lux.size})"
    )


def _calibrate(work: _Work, readings: GonioReadings, calibration: Calibration | None) -> None:
    if calibration is None:
        work.decisions.append("no channel calibration: readings taken as lx")
        return
    if readings.sensor.max() >= len(calibration.factor):
        raise DataError(
            f"sensor {readings.sensor.max()} has no calibration factor; there are {len(calibration.factor)}"
        )
    work.scale(calibration.factor[readings.sensor])
    work.parts["calibration"] = np.abs(work.candela) * calibration.relative_uncertainty[readings.sensor]
    low, high = calibration.factor.min(), calibration.factor.max()
    source = f" ({calibration.certificate})" if calibration.certificate else ""
    work.decisions.append(f"channels multiplied with {low:.4g} to {high:.4g}{source}")


def _normalise(
    work: _Work, readings: GonioReadings, roof: RoofReadings, options: ReductionOptions
) -> tuple[Floats, float]:
    """Scale every reading to the daylight of one moment; return the factors and that daylight [lx]."""
    times = readings.time_s
    wait = np.maximum(roof.time_s[0] - times, times - roof.time_s[-1]).max()
    gaps = np.diff(roof.time_s)
    between = gaps[(roof.time_s[1:] > times.min()) & (roof.time_s[:-1] < times.max())]
    longest = max(float(wait), float(between.max()) if between.size else 0.0)
    if longest > options.roof_gap_s:
        raise DataError(
            f"roof readings: {longest:.1f} s without one during the scan, more than {options.roof_gap_s:g} s",
            "give readings from before the scan until after it, or allow a longer roof_gap_s",
        )
    daylight = roof.at(times)
    reference = options.reference_lx or float(daylight[readings.usable].mean())
    factor = reference / daylight
    work.scale(factor)
    work.parts["daylight"] = np.abs(work.candela) * float(np.hypot(roof.relative_repeatability, roof.bend()))
    work.decisions.append(
        f"normalised to {reference:.6g} lx global with factors {factor.min():.4f} to {factor.max():.4f}, roof readings "
        "interpolated in time; assumes that the light below follows the global illuminance"
    )
    return factor, reference


def _one_nadir(gammas: Floats, table: Floats, count: Ints, budget: dict[str, Floats]) -> None:
    """The nadir's single average stands in all planes."""
    if gammas[0] == 0.0:
        for array in (table, count, *budget.values()):
            array[:, 0] = array[0, 0]


def _angle_part(gammas: Floats, planes: Floats, table: Floats, uncertainty_deg: float) -> Floats:
    """Uncertainty from the sensors' position: the slopes over gamma and C times the angle."""
    along_gamma = np.gradient(table, gammas, axis=1)
    if len(planes) < 2:
        return np.abs(along_gamma) * uncertainty_deg
    steps = np.diff(np.append(planes, 360.0))
    forward = (np.roll(table, -1, axis=0) - table) / steps[:, None]
    along_c = 0.5 * (forward + np.roll(forward, 1, axis=0))
    # slopes are per degree of the scales the arm is set with, so no sine of gamma enters
    return np.hypot(along_gamma, along_c) * uncertainty_deg


def _finish(
    options: ReductionOptions,
    gammas: Floats,
    planes: Floats,
    table: Floats,
    count: Ints,
    budget: dict[str, Floats],
    normalisation: Floats,
    reference: float,
    work: _Work,
    keywords: Mapping[str, str],
) -> Reduction:
    """Close the distribution, its uncertainty and its record."""
    distance = f"{options.distance_m:.4g}"
    marks = {
        "NEARFIELD": f"{distance} {distance} {distance}",
        "_DISTANCE": f"{options.distance_m:.7g} m",
        "_FIELD": "near",
        "_EREF": f"{reference:.7g} lx global, intensities normalised to it",
    }
    closed = Distribution.closed(gammas, planes, table)
    distribution = Distribution(closed.gamma_deg, closed.c_deg, closed.candela, dict(keywords) | marks)
    parts = {name: np.concatenate([part, part[:1]]) for name, part in budget.items()}
    count = np.concatenate([count, count[:1]])
    if options.row_90 is not None and gammas[-1] < 90.0:
        distribution = closed_at_90(distribution, options.row_90)
        reach = (90.0 - gammas[-1]) / (gammas[-1] - gammas[-2])
        for name, part in parts.items():
            row = np.zeros(len(part))
            if options.row_90 is Row90.EXTRAPOLATED:
                row = np.hypot((1 + reach) * part[:, -1], reach * part[:, -2])
            parts[name] = np.column_stack([part, row])
        count = np.column_stack([count, np.zeros(len(count), dtype=np.intp)])
        work.decisions.append(f"gamma 90 is {options.row_90.value}, not measured")
    total = np.sqrt(np.sum([part**2 for part in parts.values()], axis=0))
    return Reduction(
        distribution=distribution,
        distance_m=options.distance_m,
        uncertainty_cd=total,
        budget=parts,
        count=count,
        reference_lx=reference,
        normalisation=normalisation,
        generation=FileGeneration.measured(interpolated=bool((count == 0).any())),
        decisions=tuple(work.decisions),
    )
