"""Look at the record as a record, before any fit: digits, stamps, labels, limits, things that cannot be.

Each finding is a sentence. None of them is a verdict; they tell the reader what to check first.
"""

import math
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from analysis.cases import Case
from analysis.cases.model import Floats
from analysis.explain.mechanisms.catalogue import BY_ID
from analysis.explain.readings import GONIOMETER, ROOF, Readings, dropped, sun_at
from analysis.explain.scale_error import scale_of

_EXTRATERRESTRIAL_LX = 1.4e5  # horizontal daylight cannot exceed it by much; clear-sky beam efficacy included
_KNOWN_FACTORS = {
    10.764: "footcandles for lux",
    1 / 10.764: "lux for footcandles",
    3.4263: "footlamberts for cd/m²",
    1 / 3.4263: "cd/m² for footlamberts",
    np.pi: "a factor π",
    1 / np.pi: "a factor 1/π",
    1000.0: "a factor 1000",
    1e-3: "a factor 1/1000",
}

_FEW_LOST, _BY_CHANCE = 4, -6.0
"""Fewer missing readings among the brightest say nothing; nor do those that chance [log10] loses more often."""


def forensics(readings: Readings) -> list[str]:
    """All findings, as sentences."""
    case = readings.case
    found = [*_unknown(case), *_missing(case), *_stamps(readings), *_suns(readings), *_impossible(readings)]
    found += (scaled := list(_scale(readings)))
    for k, channel in enumerate(case.channels):
        rows = readings.channel == k
        if np.any(rows):
            found += _digits(channel.id, case, rows, readings)
            found += _limits(channel.id, channel.range_max, readings.measured[rows] / readings.unit_factor[rows])
            if not scaled or channel.kind != GONIOMETER:
                found += _factor(channel.id, readings, rows)
    found += _repeats(readings)
    found += _labels(readings)
    return found


def _unknown(case: Case) -> Iterator[str]:
    """Names in case.toml that the catalogue does not have: a variant of such a name says nothing to us."""
    for k, variant in enumerate(case.setup.variant, 1):
        if variant.mechanism not in BY_ID:
            yield f"Variant {k} is of '{variant.mechanism}', which is not in the catalogue: it is not used."
    for name in case.setup.simulation.includes:
        if name not in BY_ID:
            yield f"The prediction is said to include '{name}', which is not in the catalogue."


def _missing(case: Case) -> Iterator[str]:
    empty = int(np.count_nonzero(np.isnan(case.records.measured)))
    if empty:
        yield f"{empty} of {len(case.records)} readings are missing."
    if nothing := int(np.count_nonzero(dropped(case))):
        yield f"{nothing} readings are nothing in broad daylight, others of the same instrument are not: left out."
    kinds = np.array([c.kind for c in case.channels])[case.records.channel]
    for kind in dict.fromkeys(kinds.tolist()):
        yield from _brightest_missing(case, kinds == kind)


def _brightest_missing(case: Case, rows: NDArray[np.bool_]) -> Iterator[str]:
    """Of a kind of channel: are just those readings missing that should be the largest?"""
    order = np.argsort(-case.records.simulated[rows], kind="stable")
    there = np.isfinite(case.records.measured[rows])[order]
    lost, first = int(np.count_nonzero(~there)), int(np.argmax(there))
    if not np.any(there) or first < _FEW_LOST:
        return
    chances = (lost - np.arange(first)) / (len(there) - np.arange(first))  # each of the brightest lost by chance
    if float(np.sum(np.log10(chances))) < _BY_CHANCE:
        channels = [case.channels[k] for k in np.unique(case.records.channel[rows])]
        units = {c.unit for c in channels}
        level = float(case.records.simulated[rows][order[first]])
        if level > 0.8 * max(c.range_max or np.inf for c in channels):
            return  # beyond the stated range nothing can be there
        yield (
            f"None of the {first} readings predicted above {level:.4g} {'/'.join(sorted(units))} is there, though only "
            f"{lost} of {len(there)} are missing: does the range end there?"
        )


def _stamps(r: Readings) -> Iterator[str]:
    without = int(np.count_nonzero(r.utc_ns < 0))
    if without:
        yield f"{without} of {len(r)} records carry no time."
    for k, test in enumerate(r.case.tests):
        times = r.utc_ns[(r.test == k) & (r.utc_ns >= 0)]
        if len(times) == 0 or test.start is None or test.end is None:
            continue
        start, end = test.start.timestamp() * 1e9, test.end.timestamp() * 1e9
        outside = int(np.count_nonzero((times < start - 2e9) | (times > end + 2e9)))
        if outside:
            yield f"{outside} records of test {test.id} lie outside its start and end."
        if end < start:
            yield f"Test {test.id} ends before it starts."


def _suns(r: Readings) -> Iterator[str]:
    """The stated sun angles against those that follow from site and time."""
    if r.case.setup.site is None:
        return
    for test in r.case.tests:
        if test.middle is None or test.sun_altitude_deg is None or test.sun_azimuth_deg is None:
            continue
        altitude, azimuth = sun_at(r.case, np.array([round(test.middle.timestamp() * 1e9)]))[:, 0]
        off = float(
            np.hypot(
                altitude - test.sun_altitude_deg, _turn(azimuth, test.sun_azimuth_deg) * np.cos(np.radians(altitude))
            )
        )
        if off > 0.7:
            minutes = off / 0.25
            yield (
                f"Test {test.id} states the sun at {test.sun_altitude_deg:.1f}° / "
                f"{test.sun_azimuth_deg:.1f}°, but site and time give "
                f"{altitude:.1f}° / {azimuth:.1f}° ({off:.1f}° away, as much as {minutes:.0f} minutes)."
            )


def _turn(a: float, b: float) -> float:
    return float((a - b + 180.0) % 360.0 - 180.0)


def _impossible(r: Readings) -> Iterator[str]:
    deep = r.measured < -4.0 * r.noise - 1e-9
    if np.any(deep):
        yield f"{int(np.count_nonzero(deep))} readings are negative beyond their noise."
    for k, test in enumerate(r.case.tests):
        total, diffuse = r.global_lx[k], r.diffuse_lx[k]
        if np.isfinite(total) and np.isfinite(diffuse) and diffuse > 1.02 * total:
            yield f"Test {test.id}: the diffuse illuminance ({diffuse:.0f} lx) exceeds the global one ({total:.0f} lx)."
        altitude = r.altitude_deg[k]
        if (
            np.isfinite(total)
            and np.isfinite(altitude)
            and total > _EXTRATERRESTRIAL_LX * max(np.sin(np.radians(altitude)), 0) + 3e4
        ):
            yield (
                f"Test {test.id}: a global illuminance of {total:.0f} lx is more than a sun at "
                f"{altitude:.0f}° can give."
            )
    roof = r.kind == ROOF
    if np.any(r.measured[roof] > 1.6e5):
        yield "Readings of a roof illuminance meter exceed 160 000 lx, more than daylight gives."


def _digits(name: str, case: Case, rows: NDArray[np.bool_], r: Readings) -> Iterator[str]:
    """Coarse steps, and averages of a few coarse steps."""
    values = r.measured[rows] / r.unit_factor[rows]
    values = values[values != 0]
    if len(values) < 5:
        return
    for step in (1000.0, 500.0, 200.0, 100.0, 50.0, 20.0, 10.0, 5.0, 2.0, 1.0, 0.5, 0.2):
        if step * 200 > 10 * np.median(np.abs(values)) * 2 and step > 1:
            continue
        if np.all(np.abs(values / step - np.round(values / step)) < 1e-6):
            relative = step / float(np.median(np.abs(values)))
            if relative > 2e-4:
                yield f"All readings of {name} are multiples of {step:g}: {_meaning(step)}"
            return


def _meaning(step: float) -> str:
    lead = float(f"{step:.0e}"[0])
    if lead == 2:
        return f"they are rounded, or means of five readings with a resolution of {5 * step:g}."
    return "they are rounded, or the instrument's resolution is that coarse."


def _limits(name: str, range_max: float | None, values: Floats) -> Iterator[str]:
    if range_max is not None and np.any(values > range_max * (1 + 1e-9)):
        yield f"{int(np.count_nonzero(values > range_max))} readings of {name} lie above its range of {range_max:g}."
    if len(values) >= 8:
        top = values.max()
        piled = int(np.count_nonzero(values >= top * (1 - 1e-6)))
        if piled >= max(4, 0.02 * len(values)):
            yield f"{piled} readings of {name} sit exactly at its largest value {top:g}: the end of a range?"


def _factor(name: str, r: Readings, rows: NDArray[np.bool_]) -> Iterator[str]:
    good = rows & (r.simulated > 0) & (r.measured > 5 * r.noise)
    if np.count_nonzero(good) < 5:
        return
    ratio = float(np.median(r.measured[good] / r.simulated[good]))
    if meaning := _known_factor(ratio):
        yield f"{name} reads about {ratio:.3g} times its prediction; that looks like {meaning}."


def _known_factor(ratio: float) -> str:
    """What a ratio looks like, if it is one that units and conventions are confused by."""
    return next((m for factor, m in _KNOWN_FACTORS.items() if abs(np.log(ratio / factor)) < 0.06), "")


def _scale(r: Readings) -> Iterator[str]:
    """One factor between all that an arm read and its prediction."""
    ratio = math.exp(scale_of(r))
    if ratio == 1.0:
        return
    like = f", like {meaning}" if (meaning := _known_factor(ratio)) else ""
    yield (
        f"All sensors of the goniometer read about {ratio:.3g} times their prediction{like}: taken for a matter of "
        "units or calibration, so that only what differs beside it is explained."
    )


def _repeats(r: Readings) -> Iterator[str]:
    """Whole tests whose readings repeat to the last digit; channels that never change."""
    seen: dict[bytes, str] = {}
    for k, test in enumerate(r.case.tests):
        rows = r.test == k
        if np.count_nonzero(rows) < 8:
            continue
        key = r.measured[rows].tobytes()
        if key in seen:
            yield f"Tests {seen[key]} and {test.id} hold the same readings to the last digit."
        seen[key] = test.id
    for k in np.unique(r.channel):
        values, counts = np.unique(r.measured[r.channel == k], return_counts=True)
        longest = int(counts.max())
        if counts.sum() >= 16 and longest > 0.5 * counts.sum():
            name, at = r.case.channels[k].id, values[np.argmax(counts)]
            yield f"{name} shows {at:g} in {longest} of {int(counts.sum())} readings: is it stuck?"


def _labels(r: Readings) -> Iterator[str]:
    """Tests that fit the prediction of another test much better than their own (swapped labels)."""
    shapes: dict[int, tuple[Floats, Floats]] = {}
    for k in range(len(r.case.tests)):
        rows = np.flatnonzero((r.test == k) & (r.kind == GONIOMETER))
        if len(rows) >= 40:
            order = rows[np.lexsort((r.c_deg[rows], r.gamma_deg[rows]))]
            shapes[k] = (r.measured[order], r.simulated[order])
    for k, (measured, own) in shapes.items():
        best, name = _misfit(measured, own), None
        for j, (_, other) in shapes.items():
            if j != k and len(other) == len(own) and _misfit(measured, other) < 0.4 * best and best > 0.15:
                best, name = _misfit(measured, other), r.case.tests[j].id
        if name is not None:
            yield (
                f"The readings of test {r.case.tests[k].id} fit the prediction of test {name} far "
                "better than their own: swapped labels?"
            )


def _misfit(measured: Floats, simulated: Floats) -> float:
    """Relative rms difference after a free gain."""
    gain = float(measured @ simulated) / max(float(simulated @ simulated), 1e-30)
    left, all_of_it = float(np.mean((measured - gain * simulated) ** 2)), float(np.mean(measured**2))
    return math.sqrt(left / max(all_of_it, 1e-30))
