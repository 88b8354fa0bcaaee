"""The report of a comparison: one self-contained HTML page, and all its files."""

from collections.abc import Sequence
from html import escape
from pathlib import Path
from typing import Any, Final

from analysis.compare.export import as_json, csv_files, json_text
from analysis.compare.metrics import Against, Comparison, Group, TestComparison
from analysis.compare.peaks import Peak
from analysis.compare.plots import against_gamma, by_test, channel_ratio, difference_maps, groups_against_gamma, polar
from analysis.compare.predicted import stems_of
from labdaq.errors import StorageError
from labdaq.whole_file import write_whole_bytes

_STYLE: Final = """
body { font: 16px/1.5 system-ui, sans-serif; max-width: 84rem; margin: 2rem auto; padding: 0 1rem; color: #222; }
h1 { font-size: 1.5rem; } h2 { font-size: 1.15rem; margin-top: 2.2rem; border-bottom: 1px solid #ddd; }
table { border-collapse: collapse; margin: .6rem 0; } th { border-bottom: 1px solid #999; }
td, th { padding: .15rem .9rem .15rem 0; text-align: left; vertical-align: top; font-weight: normal; }
th { color: #666; font-size: .85rem; } td.n, th.n { text-align: right; font-variant-numeric: tabular-nums; }
figure { margin: 1rem 0; overflow-x: auto; } svg { max-width: 100%; height: auto; }
details { border-top: 1px solid #ddd; padding: .5rem 0; } summary { cursor: pointer; font-weight: 600; }
p.note { color: #666; font-size: .9rem; max-width: 60rem; }
"""
_READ: Final = """
<p class=note>Flux is what passes through the solid angle that was measured, simulated over recorded. The shape
difference is the share of the light that goes elsewhere once both are scaled to the same flux; "noise" is what it
would be if the shapes were the same and only the recording's noise spoke. Rms is the root mean square difference over
the root mean square recording. Uncertainties are standard uncertainties from the recording's noise alone. In plots,
blue and below zero mean that the simulation is too low. Point at a mark to see its numbers.</p>
"""

Cells = Sequence[str | float | int | None]


def write_report(comparison: Comparison, folder: Path) -> list[Path]:
    """Write report.html, comparison.json, the tables and all plots to ``folder`` (made if need be); return the files.

    Everything is made before anything is written. Raises `StorageError` when the disk refuses.
    """
    drawn = drawings(comparison)
    content = as_json(comparison)
    texts = {
        "report.html": page(comparison, drawn),
        "comparison.json": json_text(content),
        **csv_files(comparison),
        **{f"{name}.svg": svg for name, svg in drawn.items()},
    }
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise StorageError(f"{folder}: cannot be made: {error.strerror}") from error
    for name, text in texts.items():
        write_whole_bytes(folder / name, text.encode())
    return [folder / name for name in texts]


def drawings(comparison: Comparison) -> dict[str, str]:
    """All plots: name (without .svg) to SVG text."""
    order = [s.name for s in comparison.simulations]
    drawn: dict[str, str] = {}
    if comparison.tests:
        drawn["campaign"] = by_test(comparison)
    labels = dict.fromkeys(g.label for g in comparison.groups)
    for label, stem in zip(labels, stems_of(labels).values(), strict=True):
        drawn[f"group-{stem}"] = groups_against_gamma(comparison.groups, order, label)
    stems = stems_of(t.test.id for t in comparison.tests)
    for t in comparison.tests:
        stem = stems[t.test.id]
        if t.against:
            drawn[f"{stem}-polar"] = polar(t, order)
            drawn[f"{stem}-difference"] = difference_maps(t)
            rings = {name: a.rings for name, a in t.against.items()}
            drawn[f"{stem}-gamma"] = against_gamma(rings, order, f"test {t.test.id}")
    channels = dict.fromkeys(c.channel for c in comparison.channels)
    for channel, stem in zip(channels, stems_of(channels).values(), strict=True):
        drawn[f"channel-{stem}"] = channel_ratio(comparison, channel)
    return drawn


def page(comparison: Comparison, drawn: dict[str, str]) -> str:
    """HTML text; ``drawn`` are the plots of `drawings`."""
    title = comparison.case.setup.title or "Recording against simulation"
    names = [s.name for s in comparison.simulations]
    parts = [f"<h1>{escape(title)}</h1>", f"<p>Recording against {escape(', '.join(names))}.</p>"]
    if comparison.tests:
        parts += [_READ, "<h2>The campaign</h2>", _campaign(comparison), _figure(drawn, "campaign")]
        parts += ["<h2>By system and by sky</h2>", _groups(comparison.groups), *_group_figures(comparison, drawn)]
        parts.append("<h2>Test by test</h2>")
        stems = stems_of(t.test.id for t in comparison.tests)
        parts += [_test(t, stems[t.test.id], drawn) for t in comparison.tests]
    if comparison.channels:
        parts.append("<h2>Other instruments</h2>")
        channels = dict.fromkeys(c.channel for c in comparison.channels)
        parts += [_figure(drawn, f"channel-{stem}") for stem in stems_of(channels).values()]
        parts.append(_channels(comparison))
    body = "\n".join(parts)
    return (
        f'<!doctype html><html lang="en"><head><meta charset="utf-8"><title>{escape(title)}</title>'
        f"<style>{_STYLE}</style></head><body>\n{body}\n</body></html>\n"
    )


def _figure(drawn: dict[str, str], name: str) -> str:
    return f"<figure>{drawn[name]}</figure>" if name in drawn else ""


def _group_figures(comparison: Comparison, drawn: dict[str, str]) -> list[str]:
    labels = dict.fromkeys(g.label for g in comparison.groups)
    return [_figure(drawn, f"group-{stem}") for stem in stems_of(labels).values()]


def _campaign(comparison: Comparison) -> str:
    head = (
        "test",
        "system",
        "sky",
        "sun altitude",
        "simulation",
        "flux",
        "±",
        "shape",
        "±",
        "noise",
        "rms",
        "rms scaled",
    )
    rows: list[Cells] = []
    for t in comparison.tests:
        altitude = None if t.test.sun_altitude_deg is None else f"{t.test.sun_altitude_deg:.1f}°"
        for name, a in t.against.items():
            g = a.agreement
            rows.append(
                (
                    t.test.id, t.test.system, t.test.sky, altitude, name, f"{g.flux_ratio:.3f}",
                    f"{g.flux_ratio_uncertainty:.3f}", f"{g.shape_difference:.3f}", f"{g.shape_uncertainty:.3f}",
                    f"{g.shape_noise:.3f}", f"{g.rms_percent:.1f} %", f"{g.rms_scaled_percent:.1f} %",
                )
            )  # fmt: skip
    return _table(head, rows, numbers_from=5)


def _groups(groups: Sequence[Group]) -> str:
    head = ("tests", "simulation", "number", "flux", "scatter", "shape", "worst", "rms")
    rows: list[Cells] = [
        (
            g.label, g.simulation, len(g.tests), f"{g.flux_ratio:.3f}", _or_dash(g.flux_ratio_scatter),
            f"{g.shape_difference:.3f}", f"{g.shape_difference_worst:.3f}", f"{g.rms_percent:.1f} %",
        )
        for g in groups
    ]  # fmt: skip
    return _table(head, rows, numbers_from=2)


def _or_dash(value: float) -> str:
    return "–" if value != value else f"{value:.3f}"


def _test(t: TestComparison, stem: str, drawn: dict[str, str]) -> str:
    facts = [t.test.system, t.test.sky]
    if t.test.sun_altitude_deg is not None and t.test.sun_azimuth_deg is not None:
        facts.append(f"sun at {t.test.sun_altitude_deg:.1f}° altitude, {t.test.sun_azimuth_deg:.1f}° azimuth")
    about = ", ".join(escape(f) for f in facts if f)
    figures = "".join(_figure(drawn, f"{stem}-{what}") for what in ("polar", "gamma", "difference"))
    peaks = "".join(_peaks(name, a) for name, a in t.against.items())
    opened = " open" if not about else ""
    return f"<details{opened}><summary>{escape(t.test.id)}</summary><p>{about}</p>{figures}{peaks}</details>"


def _peaks(name: str, against: Against) -> str:
    rows: list[Cells] = []
    for pair in against.peaks:
        ratio = f"{pair.simulated.candela / pair.measured.candela:.3f}" if pair.simulated and pair.measured else None
        apart = None if pair.apart_deg is None else f"{pair.apart_deg:.1f}°"
        rows.append((*_peak(pair.measured), *_peak(pair.simulated), apart, ratio))
    if not rows:
        return ""
    head = ("recorded at", "candela", "simulated at", "candela", "apart", "height ratio")
    return f"<p>Peaks, recorded and in {escape(name)}:</p>" + _table(head, rows, numbers_from=6)


def _peak(peak: Peak | None) -> tuple[str, str]:
    if peak is None:
        return "–", ""
    return f"gamma {peak.gamma_deg:.1f}°, C {peak.c_deg:.0f}°", f"{peak.candela:.4g}"


def _channels(comparison: Comparison) -> str:
    head = (
        "channel",
        "test",
        "simulation",
        "readings",
        "measured",
        "simulated",
        "unit",
        "simulated / measured",
        "scatter",
    )
    rows: list[Cells] = [
        (
            c.channel, c.test.id, c.simulation, c.readings, f"{c.measured:.5g}", f"{c.simulated:.5g}", c.unit,
            f"{c.ratio:.4f}", _or_dash(c.ratio_scatter),
        )
        for c in comparison.channels
    ]  # fmt: skip
    return _table(head, rows, numbers_from=3)


def _table(head: Sequence[str], rows: Sequence[Cells], *, numbers_from: int) -> str:
    def cell(tag: str, k: int, value: Any) -> str:
        kind = " class=n" if k >= numbers_from else ""
        return f"<{tag}{kind}>{escape('' if value is None else str(value))}</{tag}>"

    top = "".join(cell("th", k, word) for k, word in enumerate(head))
    lines = "".join("<tr>" + "".join(cell("td", k, v) for k, v in enumerate(row)) + "</tr>\n" for row in rows)
    return f"<table><tr>{top}</tr>\n{lines}</table>"
