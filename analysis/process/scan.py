"""The measured photometry of a recorded session: the arm's readings as a luminous intensity distribution."""

from datetime import UTC, datetime

import numpy as np

from analysis.compare.session_facts import certified
from analysis.photometry.lm63 import Opening
from analysis.photometry.lm63_model import POINT
from analysis.photometry.readings import Calibration, GonioReadings, RoofReadings
from analysis.photometry.reduce import reduce_readings
from analysis.photometry.reduction import Reduction, ReductionOptions
from analysis.photometry.testdata import TestData
from analysis.process.roof import diffuse_channels, global_channels, meter, site_of, window_of, zenith_channels
from analysis.sky.process import Readings
from analysis.sky.sun import sun_position
from labdaq.clock import NS, utc_text
from labdaq.errors import DataError
from labdaq.records import Certificate
from labdaq.session import Session
from labdaq.station import Station


def scan_of(session: Session, station: Station, *, fill_missing: bool = False) -> tuple[Reduction | None, list[str]]:
    """Reduce the session's scan; ``None`` and what is missing for it, where something is.

    ``fill_missing`` interpolates a direction without a usable reading between its neighbours in C.
    """
    heads = [c for c in station.goniometer.channels if c in session.channels]
    total = meter(session, global_channels(station))
    missing = [] if heads else ["no reading of the goniophotometer"]
    missing += [] if total else ["no usable reading of the global illuminance"]
    if missing or total is None:
        return None, missing
    try:
        readings = _readings(session, station, heads)
        reduction = reduce_readings(
            readings,
            _roof(total),
            options=_options(session, station, fill_missing),
            calibration=_calibration(session, station, heads),
            keywords=_keywords(session, station),
        )
    except DataError as error:
        return None, [f"the scan cannot be reduced: {line}" for line in error.message.splitlines()]
    return reduction, []


def opening_of(system: str) -> Opening:
    """The luminous opening of a system by its name; a point for one that labdaq does not know."""
    from analysis.compare.named_systems import NAMED_SYSTEMS

    known = NAMED_SYSTEMS.get(system)
    if known is None or known.aperture is None:
        return POINT
    if known.aperture.diameter_m is not None:
        return Opening.disc(known.aperture.diameter_m)
    assert known.aperture.size_m is not None
    return Opening(*known.aperture.size_m, 0.0)


def _readings(session: Session, station: Station, heads: list[str]) -> GonioReadings:
    parts: list[list[float]] = [[], [], [], [], [], []]
    for channel in heads:
        taken = session.readings(channel)
        sensor = station.goniometer.channels.index(channel)
        columns = (
            taken.at("gamma_deg"),
            taken.at("c_deg"),
            taken.value,
            taken.utc_ns / NS,
            np.full(len(taken), sensor),
            taken.uncertainty,
        )
        for part, column in zip(parts, columns, strict=True):
            part.extend(column.tolist())
    gamma, c, lux, time_s, sensors, uncertainty = (np.array(part) for part in parts)
    return GonioReadings.of(gamma, c, lux, time_s, sensors, uncertainty)


def _roof(total: Readings) -> RoofReadings:
    """The global illuminance over the whole session, in the order of time."""
    times, first = np.unique(total.utc_ns, return_index=True)
    return RoofReadings(time_s=times / NS, lux=total.value[first])


def _options(session: Session, station: Station, fill_missing: bool) -> ReductionOptions:
    planes = session.script.scan.c_planes_deg
    return ReductionOptions(
        distance_m=station.goniometer.distance_m,
        planes_deg=tuple(sorted(set(planes))),
        fill_missing=fill_missing,
        roof_gap_s=max(30.0, 3.0 * session.script.illuminance.period_s),
    )


def _calibration(session: Session, station: Station, heads: list[str]) -> Calibration | None:
    """Factor and uncertainty of the arm's certificate, where one is in force; the same for all heads."""
    instrument = session.readings(heads[0])[0].instrument
    found = [c for c in session.header.certificates if instrument.calibration and c.id == instrument.calibration]
    if not found:
        return None
    count = len(station.goniometer.channels)
    certificate: Certificate = found[0]
    return Calibration(
        factor=np.full(count, certified(session, instrument)),
        relative_uncertainty=np.full(count, certificate.uncertainty / certificate.coverage_factor),
        certificate=certificate.id,
    )


def _keywords(session: Session, station: Station) -> dict[str, str]:
    """What LM-63 requires, and what belongs to a daylight test."""
    window = window_of(session, station)
    assert window is not None
    sun = sun_position(window.middle_ns, site_of(station))

    def mean(readings: Readings | None) -> float | None:
        return None if readings is None else readings.mean.value

    header = session.header
    arm = session.readings(next(c for c in station.goniometer.channels if c in session.channels))[0].instrument
    data = TestData(
        sun_altitude_deg=float(sun.altitude_deg),
        sun_azimuth_deg=float(sun.azimuth_deg),
        global_lx=mean(meter(session, global_channels(station), window)),
        diffuse_lx=mean(meter(session, diffuse_channels(station), window)),
        zenith_cd_m2=mean(meter(session, zenith_channels(station), window)),
        sky=header.sky.replace("-", " ") if header.sky != "unknown" else "",
        distance_m=station.goniometer.distance_m,
        start_utc=utc_text(window.start_ns),
        end_utc=utc_text(window.end_ns),
        field="near",
    )
    day = datetime.fromtimestamp(window.end_ns // NS, UTC).strftime("%Y-%m-%d")
    return {
        "TEST": header.test,
        "TESTLAB": station.name,
        "ISSUEDATE": day,
        "MANUFAC": "not stated",
        "LUMINAIRE": f"skylight {header.system}",
        "TESTDATE": day,
        "_SESSION": header.name,
        "_GONIOMETER": f"{arm.model} {arm.serial}".strip(),
        **data.keywords(),
    }


def summary(reduction: Reduction) -> dict[str, object]:
    """Decisions and figures of a reduction; JSON-able."""
    candela = reduction.distribution.candela
    bright = candela > 0.05 * candela.max()
    relative = reduction.uncertainty_cd[bright] / candela[bright] if bright.any() else np.zeros(1)
    budget = {
        name: float(np.sqrt(np.mean((part[bright] / candela[bright]) ** 2))) if bright.any() else 0.0
        for name, part in reduction.budget.items()
    }
    return {
        "distance_m": reduction.distance_m,
        "reference_lx": reduction.reference_lx,
        "flux_lm": reduction.distribution.flux(),
        "peak_cd": float(candela.max()),
        "normalisation": [float(reduction.normalisation.min()), float(reduction.normalisation.max())],
        "relative_uncertainty_rms": float(np.sqrt(np.mean(relative**2))),
        "budget_rms": budget,
        "generation": reduction.generation.name.lower(),
        "decisions": list(reduction.decisions),
    }
