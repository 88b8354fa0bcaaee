"""Plots of a comparison, as SVG text."""

import math
from collections.abc import Sequence
from typing import Final

import numpy as np

from analysis.cases.model import Floats
from analysis.compare.metrics import Comparison, Group, TestComparison
from analysis.compare.scan import Scan
from analysis.compare.shape import Rings
from analysis.compare.svg import (
    FAINT,
    GREY,
    INK,
    Drawing,
    Frame,
    Point,
    cold_to_warm,
    colour,
    dash,
    legend,
    shortened,
    ticks,
)

PLANES_DEG: Final = (0.0, 45.0, 90.0, 135.0)
"""The report's four planes (figures 78 to 89); each is drawn with its opposite half."""
_DIM: Final = 0.02
"""Differences are relative to the recording, or to this share of its peak where it is darker."""
_COMPASS: Final = {0.0: "N", 45.0: "NW", 90.0: "W", 135.0: "SW", 180.0: "S", 225.0: "SE", 270.0: "E", 315.0: "NE"}


def polar(test: TestComparison, order: Sequence[str]) -> str:
    """Candela against gamma in four vertical planes, the recording and its simulations; nadir is down.

    ``order`` are the names of all simulations of the comparison, which fixes their colours.
    """
    scan, names = test.scan, [n for n in order if n in test.against]
    everything = [scan.measured, *(scan.simulated[n] for n in names)]
    top = max(float(np.nanmax(values)) for values in everything)
    rounds = ticks(0.0, top if top > 0 else 1.0, 4)
    reach = max(top, rounds[-1]) or 1.0
    radius, gap = 150.0, 46.0
    drawing = Drawing(4 * (2 * radius + gap), radius + 92)
    for k, plane in enumerate(PLANES_DEG):
        centre = (gap / 2 + radius + k * (2 * radius + gap), 34.0)
        _polar_grid(drawing, centre, radius, rounds, reach, plane)
        scale = radius / reach
        for name in reversed(names):
            j = list(order).index(name)
            outline = _outline(scan, scan.simulated[name], plane, centre, scale)
            drawing.curve([p for p, _ in outline], colour(j), dashes=dash(j), tip=name)
        outline = _outline(scan, scan.measured, plane, centre, scale)
        drawing.curve([p for p, _ in outline], INK, 1.8)
        for point, tip in outline:
            drawing.dot(point, INK, 2.2, tip)
    legend(drawing, (gap / 2, radius + 80), order, names)
    return drawing.render(f"Luminous intensity of test {test.test.id} in four planes")


def _outline(scan: Scan, values: Floats, plane: float, centre: Point, scale: float) -> list[tuple[Point, str]]:
    """Points from the opposite half-plane's horizon through the nadir to the plane's horizon, with their numbers."""
    found: list[tuple[Point, str]] = []
    sides = ((plane + 180.0, -1.0, scan.gamma_deg[::-1]), (plane, 1.0, scan.gamma_deg))
    for c, side, gammas in sides:
        along = dict(zip(scan.gamma_deg.tolist(), scan.along(values, c).tolist(), strict=True))
        for gamma in gammas.tolist():
            if gamma == 0.0 and side > 0:
                continue
            candela = along[gamma]
            x = centre[0] + side * math.sin(math.radians(gamma)) * candela * scale
            y = centre[1] + math.cos(math.radians(gamma)) * candela * scale
            found.append(((x, y), f"{candela:.4g} cd at gamma {gamma:g}°, C {c % 360:g}°"))
    return found


def _polar_grid(
    drawing: Drawing, centre: Point, radius: float, rounds: Sequence[float], reach: float, plane: float
) -> None:
    x, y = centre
    for value in rounds[1:]:
        drawing.half_ring(centre, radius * value / reach)
        drawing.text((x + 3, y + radius * value / reach - 2), f"{value:g}", size=9, fill=GREY)
    for angle in range(-90, 91, 30):
        far = (x + radius * math.sin(math.radians(angle)), y + radius * math.cos(math.radians(angle)))
        drawing.line(centre, far, FAINT)
        if angle:
            label = (x + (radius + 9) * math.sin(math.radians(angle)), y + (radius + 9) * math.cos(math.radians(angle)))
            if abs(angle) < 90:
                drawing.text((label[0], label[1] + 3), f"{abs(angle)}°", size=9, anchor="middle", fill=GREY)
    drawing.text((x, y - 16), f"C {plane + 180:g}° – {plane:g}°  [cd]", anchor="middle", bold=True)
    drawing.text((x - radius, y - 4), _COMPASS.get(plane + 180.0, ""), size=9, fill=GREY)
    drawing.text((x + radius, y - 4), _COMPASS.get(plane, ""), size=9, fill=GREY, anchor="end")


def relative_difference(scan: Scan, values: Floats) -> Floats:
    """(simulated - measured) / measured [%] by direction (D,); where it is dark, over 2 % of the recording's peak."""
    floor = _DIM * float(np.nanmax(scan.measured))
    return np.asarray(100.0 * (values - scan.measured) / np.maximum(scan.measured, max(floor, 1e-12)))


def difference_maps(test: TestComparison) -> str:
    """The difference of each simulation on gamma and C: blue where it is too low, red where it is too high."""
    scan, names = test.scan, list(test.against)
    maps = [scan.table(relative_difference(scan, scan.simulated[n])) for n in names]
    planes, gammas = scan.cell.shape
    cell_w, cell_h = 24.0, 16.0
    wide, high = planes * cell_w + 96, gammas * cell_h + 72
    columns = max(1, min(2, len(names)))
    rows = -(-len(names) // columns) if names else 1
    drawing = Drawing(columns * wide, rows * high + 8)
    most = _limit(np.concatenate([m.ravel() for m in maps]) if maps else np.zeros(1))
    for k, (name, values) in enumerate(zip(names, maps, strict=True)):
        corner = ((k % columns) * wide + 48, (k // columns) * high + 24)
        drawing.text((corner[0], corner[1] - 8), f"{shortened(name, 60)}: simulated − recorded [%]", bold=True)
        for j in range(planes):
            for i in range(gammas):
                tip = f"gamma {scan.gamma_deg[i]:g}°, C {scan.plane_deg[j]:g}°: {values[j, i]:+.1f} %"
                at = (corner[0] + j * cell_w, corner[1] + (gammas - 1 - i) * cell_h)
                drawing.box(at, cell_w - 0.5, cell_h - 0.5, cold_to_warm(values[j, i] / most), tip)
        _map_labels(drawing, corner, scan, cell_w, cell_h)
        _colour_bar(drawing, (corner[0] + planes * cell_w + 8, corner[1]), gammas * cell_h, most)
    return drawing.render(f"Difference of simulated and recorded intensity in test {test.test.id}")


def _map_labels(drawing: Drawing, corner: Point, scan: Scan, cell_w: float, cell_h: float) -> None:
    planes, gammas = scan.cell.shape
    bottom = corner[1] + gammas * cell_h
    for i, gamma in enumerate(scan.gamma_deg):
        drawing.text((corner[0] - 5, bottom - (i + 0.5) * cell_h + 4), f"{gamma:g}", anchor="end", size=10)
    step = max(1, planes // 8)
    for j in range(0, planes, step):
        drawing.text((corner[0] + (j + 0.5) * cell_w, bottom + 13), f"{scan.plane_deg[j]:g}", anchor="middle", size=10)
    middle = corner[0] + planes * cell_w / 2
    drawing.text((middle, bottom + 28), "C [°] (0 north, 90 west)", anchor="middle", fill=GREY)
    drawing.text((corner[0] - 32, bottom - gammas * cell_h / 2), "gamma [°]", anchor="middle", fill=GREY, turned=True)


def _colour_bar(drawing: Drawing, corner: Point, height: float, most: float) -> None:
    steps = 20
    for k in range(steps):
        t = 1.0 - 2.0 * (k + 0.5) / steps
        drawing.box((corner[0], corner[1] + k * height / steps), 10, height / steps + 0.5, cold_to_warm(t))
    for t in (1.0, 0.0, -1.0):
        drawing.text((corner[0] + 13, corner[1] + (1 - t) / 2 * height + 4), f"{t * most:+g}" if t else "0", size=9)


def _limit(values: Floats) -> float:
    """A round limit of a colour scale that holds 95 % of the values."""
    finite = np.abs(values[np.isfinite(values)])
    needed = float(np.quantile(finite, 0.95)) if len(finite) else 1.0
    return next((limit for limit in (1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0) if limit >= needed), 200.0)


def against_gamma(found: dict[str, Rings], order: Sequence[str], title: str) -> str:
    """Difference against gamma (report, figure 90), with the standard uncertainty as a band."""
    drawing = Drawing(640, 300)
    values = np.concatenate(
        [np.concatenate([r.percent - _known(r), r.percent + _known(r), [0.0]]) for r in found.values()]
    )
    values = values[np.isfinite(values)]
    low, high = float(max(values.min(), -100.0)), float(min(values.max(), 200.0))
    pad = 0.08 * max(high - low, 2.0)
    frame = Frame(drawing, 62, 28, 560, 196, (0.0, 90.0), (low - pad, high + pad))
    frame.axes("gamma [°]", "simulated − recorded [%]", x_ticks=[(g, f"{g}") for g in range(0, 91, 10)])
    frame.level(0.0)
    for name, r in found.items():
        k = list(order).index(name)
        band = [frame.at(g, _clip(v, frame.y)) for g, v in zip(r.gamma_deg, r.percent + _known(r), strict=True)]
        under = [frame.at(g, _clip(v, frame.y)) for g, v in zip(r.gamma_deg, r.percent - _known(r), strict=True)]
        drawing.area([*band, *under[::-1]], colour(k))
        points = [frame.at(g, _clip(v, frame.y)) for g, v in zip(r.gamma_deg, r.percent, strict=True)]
        drawing.curve(points, colour(k), dashes=dash(k))
        for point, g, v, a, b in zip(points, r.gamma_deg, r.percent, r.lowest, r.highest, strict=True):
            drawing.dot(point, colour(k), tip=f"{name}: {v:+.1f} % at gamma {g:g}° ({a:+.0f} to {b:+.0f} %)")
    drawing.text((62, 18), title, bold=True)
    legend(drawing, (62, 290), order, found, recording=False)
    return drawing.render(f"{title}: difference against gamma")


def _known(r: Rings) -> Floats:
    return np.nan_to_num(r.uncertainty)


def _clip(value: float, to: tuple[float, float]) -> float:
    return min(max(value, to[0]), to[1]) if math.isfinite(value) else math.nan


def groups_against_gamma(groups: Sequence[Group], order: Sequence[str], label: str) -> str:
    """The same for the tests of a group."""
    return against_gamma({g.simulation: g.rings for g in groups if g.label == label}, order, label)


def by_test(comparison: Comparison) -> str:
    """Flux ratio and shape difference of every test and simulation."""
    tests, names = comparison.tests, [s.name for s in comparison.simulations]
    drawing = Drawing(max(420.0, 140 + 26.0 * len(tests)), 520)
    places = [(k + 0.5, t.test.id) for k, t in enumerate(tests)]
    wide = drawing.width - 90
    ratios = [a.agreement.flux_ratio for t in tests for a in t.against.values()] + [1.0]
    low, high = min(ratios), max(ratios)
    pad = 0.1 * max(high - low, 0.05)
    upper = Frame(drawing, 62, 16, wide, 160, (0.0, len(tests)), (low - pad, high + pad))
    most = max([a.agreement.shape_difference for t in tests for a in t.against.values()], default=0.1)
    lower = Frame(drawing, 62, 258, wide, 160, (0.0, len(tests)), (0.0, 1.1 * max(most, 0.01)))
    upper.axes("", "flux, simulated / recorded", x_ticks=places, slanted=True)
    lower.axes("", "shape difference", x_ticks=places, slanted=True)
    upper.level(1.0)
    for j, test in enumerate(tests):
        for k, name in enumerate(names):
            if name not in test.against:
                continue
            a = test.against[name].agreement
            x = j + (k + 1.0) / (len(names) + 1.0)
            top, bottom = (a.flux_ratio + s * a.flux_ratio_uncertainty for s in (1, -1))
            drawing.line(upper.at(x, top), upper.at(x, bottom), colour(k))
            drawing.dot(upper.at(x, a.flux_ratio), colour(k), 3, f"{name}, {test.test.id}: {a.flux_ratio:.3f}")
            drawing.line(lower.at(x, 0.0), lower.at(x, a.shape_noise), FAINT, 4)
            tip = f"{name}, {test.test.id}: {a.shape_difference:.3f} ± {a.shape_uncertainty:.3f}"
            drawing.dot(lower.at(x, a.shape_difference), colour(k), 3, f"{tip}; noise alone {a.shape_noise:.3f}")
    legend(drawing, (62, 508), names, names, recording=False)
    return drawing.render("Flux ratio and shape difference by test")


def channel_ratio(comparison: Comparison, channel: str) -> str:
    """Simulated over measured for each reading of a roof or sky channel, against the reading and in order."""
    case = comparison.case
    k = next(i for i, c in enumerate(case.channels) if c.id == channel)
    rows = np.flatnonzero(
        (case.records.channel == k) & np.isfinite(case.records.measured) & (case.records.measured != 0)
    )
    measured, test = case.records.measured[rows], case.records.test[rows]
    ratios = [s.values[rows] / measured for s in comparison.simulations]
    finite = np.concatenate([r[np.isfinite(r)] for r in ratios] + [np.ones(1)])
    low, high = float(finite.min()), float(finite.max())
    span = (low - 0.08 * (high - low + 0.01), high + 0.08 * (high - low + 0.01))
    drawing = Drawing(980, 300)
    least, most = float(measured.min()), float(measured.max())
    reach = (0.0 if least < most / 2 else 0.97 * least, 1.03 * most)
    left = Frame(drawing, 62, 24, 400, 196, reach, span)
    right = Frame(drawing, 540, 24, 420, 196, (-0.5, len(rows) - 0.5), span)
    ids = [case.tests[t].id for t in test]
    starts = [(i, name) for i, name in enumerate(ids) if i == 0 or ids[i - 1] != name]
    left.axes(f"measured [{case.channels[k].unit}]", "simulated / measured")
    right.axes("", "simulated / measured", x_ticks=starts, slanted=True)
    for frame in (left, right):
        frame.level(1.0)
    for j, ratio in enumerate(ratios):
        for i, (m, value) in enumerate(zip(measured, ratio, strict=True)):
            tip = f"{ids[i]}: {m:.5g} measured, ratio {value:.3f}"
            drawing.dot(left.at(float(m), float(value)), colour(j), 3, tip)
            drawing.dot(right.at(i, float(value)), colour(j), 3, tip)
    drawing.text((62, 14), channel, bold=True)
    names = [s.name for s in comparison.simulations]
    legend(drawing, (62, 292), names, names, recording=False)
    return drawing.render(f"{channel}: simulated over measured")
