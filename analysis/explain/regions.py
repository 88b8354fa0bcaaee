"""The parts of the coordinates in which a recording may depart from its prediction as a whole."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from analysis.explain.readings import GONIOMETER, Readings
from labdaq import directions

_UNBENT_DEG = 12.0


@dataclass(frozen=True)
class Region:
    """A part of the coordinates in which the residual may be raised or lowered as a whole.

    Attributes
    ----------
    name
        In words, for sentences.
    rows : shape (N,)
        Membership of each row.
    where
        The answer's description (keys channels, gamma_deg, c_deg, tests, when).
    """

    name: str
    rows: NDArray[np.bool_]
    where: dict[str, object]


def regions_of(readings: Readings) -> list[Region]:
    """All regions to look at."""
    found: list[Region] = []
    for kind in np.unique(readings.kind):
        rows = readings.kind == kind
        if kind == GONIOMETER:
            found += _rings_and_sectors(readings, rows)
            found += _beside_the_sun(readings, rows)
        else:
            found += _instruments(readings, rows, str(kind))
        found += _tests(readings, rows)
        found += _levels(readings, rows)
    smallest = 3 if len(readings) >= 30 else 1
    return [r for r in found if smallest <= np.count_nonzero(r.rows) < len(readings)]


def _where(readings: Readings, rows: NDArray[np.bool_], **given: object) -> dict[str, object]:
    channels = [readings.case.channels[k].id for k in np.unique(readings.channel[rows])]
    tests = [readings.case.tests[k].id for k in np.unique(readings.test[rows])]
    gamma, c = readings.gamma_deg[rows], readings.c_deg[rows]
    where: dict[str, object] = {
        "channels": channels,
        "gamma_deg": None if np.all(np.isnan(gamma)) else [float(np.nanmin(gamma)), float(np.nanmax(gamma))],
        "c_deg": None if np.all(np.isnan(c)) else [0.0, 360.0],
        "tests": tests,
        "when": None,
    }
    where.update(given)
    return where


def _rings_and_sectors(r: Readings, rows: NDArray[np.bool_]) -> list[Region]:
    found = []
    rings = np.unique(np.round(r.gamma_deg[rows], 2))
    for i in range(len(rings)):
        for j in range(i, min(i + 4, len(rings))):
            inside = rows & (r.gamma_deg >= rings[i] - 0.01) & (r.gamma_deg <= rings[j] + 0.01)
            name = f"at gamma {rings[i]:g}°" if i == j else f"from gamma {rings[i]:g}° to {rings[j]:g}°"
            found.append(Region(f"{name}, in all planes", inside, _where(r, inside)))
    for centre in np.arange(0.0, 360.0, 22.5):
        for half in (12.0, 34.0, 90.0):
            near = rows & (np.abs((r.c_deg - centre + 180.0) % 360.0 - 180.0) <= half) & (r.gamma_deg > 2.0)
            sector = [float((centre - half) % 360.0), float((centre + half) % 360.0)]
            found.append(Region(f"within {half:g}° of the plane C = {centre:g}°", near, _where(r, near, c_deg=sector)))
            if half > 50:
                continue
            for low, high in ((3, 30), (30, 60), (60, 90), (15, 40), (40, 70)):
                spot = near & (r.gamma_deg > low) & (r.gamma_deg < high)
                name = f"at gamma {low}° to {high}° within {half:g}° of the plane C = {centre:g}°"
                found.append(Region(name, spot, _where(r, spot, c_deg=sector)))
    return found


def _beside_the_sun(r: Readings, rows: NDArray[np.bool_]) -> list[Region]:
    """Sides of the sun's image (a turned arm raises one and lowers the other), and where light goes on unbent."""
    image = 180.0 - r.azimuth_deg[r.test]  # light goes on away from the sun
    if np.any(np.isnan(image[rows])):
        return []
    turn = (r.c_deg - image + 180.0) % 360.0 - 180.0
    found = []
    for name, low, high in (
        ("counter-clockwise of the sun's image, seen from above", 10.0, 100.0),
        ("clockwise of the sun's image, seen from above", -100.0, -10.0),
        ("on the side of the sun's image", -35.0, 35.0),
    ):
        inside = rows & (turn >= low) & (turn <= high) & (r.gamma_deg > 2.0)
        found.append(Region(name, inside, _where(r, inside)))
    look = directions.vector(np.nan_to_num(r.gamma_deg), np.nan_to_num(r.c_deg))
    travel = -directions.sky_vector(r.altitude_deg, r.azimuth_deg)[r.test]
    unbent = rows & (directions.angle_between(look, travel) <= _UNBENT_DEG)
    found.append(Region("where the sun's light would go on unbent", unbent, _where(r, unbent)))
    return found


def _instruments(r: Readings, rows: NDArray[np.bool_], kind: str) -> list[Region]:
    found = []
    for k in np.unique(r.channel[rows]):
        here = rows & (r.channel == k)
        found.append(Region(f"on {r.case.channels[k].id}", here, _where(r, here)))
    gamma = r.gamma_deg[rows]
    if kind == "sky" and not np.all(np.isnan(gamma)):
        found += _in_the_picture(r, rows)
    return found


def _in_the_picture(r: Readings, rows: NDArray[np.bool_]) -> list[Region]:
    """Bands of a picture of the sky, sectors of its rim, and what lies round the sun or opposite to it."""
    found = []
    for low, high in ((90.0, 120.0), (120.0, 150.0), (150.0, 180.1), (90.0, 135.0), (135.0, 180.1)):
        band = rows & (r.gamma_deg >= low) & (r.gamma_deg < high)
        name = f"between {180 - min(high, 180):.0f}° and {180 - low:.0f}° from the zenith"
        found.append(Region(name, band, _where(r, band)))
    for azimuth in np.arange(0.0, 360.0, 30.0):
        turn = np.abs((360.0 - r.c_deg - azimuth + 180.0) % 360.0 - 180.0)
        sector = [float((360.0 - azimuth - 30.0) % 360.0), float((360.0 - azimuth + 30.0) % 360.0)]
        for name, low, high in (("", 90.0, 178.0), (" below 45°", 90.0, 135.0), (" above 45°", 135.0, 178.0)):
            spot = rows & (turn <= 30.0) & (r.gamma_deg > low) & (r.gamma_deg < high)
            where = _where(r, spot, c_deg=sector)
            found.append(Region(f"towards azimuth {azimuth:.0f}°{name}", spot, where))
    if not np.any(np.isnan(r.sun_altitude_at_deg[rows] + r.sun_azimuth_at_deg[rows])):
        found += _round_the_sun(r, rows)
    return found


def _round_the_sun(r: Readings, rows: NDArray[np.bool_]) -> list[Region]:
    look = directions.vector(np.nan_to_num(r.gamma_deg, nan=180.0), np.nan_to_num(r.c_deg))
    away = directions.angle_between(look, directions.sky_vector(r.sun_altitude_at_deg, r.sun_azimuth_at_deg))
    found = []
    for name, low, high in (
        ("within 25° of the sun", 0.0, 25.0),
        ("25° to 60° from the sun", 25.0, 60.0),
        ("60° to 110° from the sun", 60.0, 110.0),
        ("more than 110° from the sun", 110.0, 181.0),
    ):
        ring = rows & (away >= low) & (away < high)
        found.append(Region(name, ring, _where(r, ring)))
    return found


def _tests(r: Readings, rows: NDArray[np.bool_]) -> list[Region]:
    found = []
    present = np.unique(r.test[rows])
    for t in present:
        here = rows & (r.test == t)
        found.append(Region(f"in test {r.case.tests[t].id}", here, _where(r, here)))
    for label, values in (
        ("sun height", r.altitude_deg),
        ("the ratio of diffuse to global", r.diffuse_lx / r.global_lx),
    ):
        known = present[np.isfinite(values[present])]
        if len(known) < 4:
            continue
        order = known[np.argsort(values[known])]
        for name, part in (("low", order[: len(order) // 3 or 1]), ("high", order[-(len(order) // 3 or 1) :])):
            here = rows & np.isin(r.test, part)
            found.append(Region(f"in the tests with {name} {label}", here, _where(r, here)))
    for s in np.unique(r.system[present]):
        here = rows & (r.system[r.test] == s)
        names = {r.case.tests[t].system for t in present if r.system[t] == s}
        found.append(Region(f"under the system {next(iter(names)) or '?'}", here, _where(r, here)))
    for skies in {r.case.tests[t].sky for t in present} - {None}:
        here = rows & np.array([t.sky == skies for t in r.case.tests])[r.test]
        found.append(Region(f"under {skies} skies", here, _where(r, here)))
    if r.has_times and len(present) > 0:
        found += _stretches(r, rows, present)
    return found


def _stretches(r: Readings, rows: NDArray[np.bool_], present: NDArray[np.int64]) -> list[Region]:
    """Quarters of the scans, and of the campaign."""
    found = []
    share = np.zeros(len(r))
    for t in present:
        mine = rows & (r.test == t)
        span = max(int(np.ptp(r.utc_ns[mine])), 1)
        share[mine] = (r.utc_ns[mine] - r.utc_ns[mine].min()) / span
    if np.max(np.bincount(r.test[rows])) >= 8:
        for q in range(4):
            here = rows & (share >= q / 4) & (share <= (q + 1) / 4)
            found.append(
                Region(f"in quarter {q + 1} of the scans", here, _where(r, here, when=f"quarter {q + 1} of each scan"))
            )
    middles = np.array([r.utc_ns[rows & (r.test == t)].mean() for t in present])
    order = present[np.argsort(middles)]
    for cut in range(1, len(order)):
        here = rows & np.isin(r.test, order[cut:])
        began = r.case.tests[order[cut]].id
        found.append(Region(f"from test {began} on", here, _where(r, here, when=f"from test {began} on")))
    return found


def _levels(r: Readings, rows: NDArray[np.bool_]) -> list[Region]:
    """Brightest and dimmest readings, by the prediction."""
    found = []
    level = r.simulated
    for name, low, high in (
        ("dimmest quarter", 0.0, 0.25),
        ("brightest quarter", 0.75, 1.0),
        ("brightest twentieth", 0.95, 1.0),
    ):
        edge = np.quantile(level[rows], [low, high])
        here = rows & (level >= edge[0]) & (level <= edge[1])
        found.append(Region(f"among the {name} of the predictions", here, _where(r, here)))
    return found
