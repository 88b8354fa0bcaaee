"""The report: whole, self-contained, well-formed whatever the names are, and true to the numbers."""

import csv
import json
import math
import re
import xml.etree.ElementTree as ET
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from analysis.cases import Case, Records, write_case
from analysis.cases.model import CaseFile, Simulation
from analysis.compare.metrics import Comparison, compare
from analysis.compare.page import drawings, write_report
from analysis.compare.svg import COLOURS, cold_to_warm, ticks
from labdaq.errors import StorageError
from tests.analysis.compare.light import GAMMAS, PLANES, lobe, sky_part

NASTY = '<script>alert("1 & 2")</script> ]]> é'
SVG = "{http://www.w3.org/2000/svg}"


def _comparison(folder: Path, name: str = NASTY) -> Comparison:
    """Two tests of the arm, one of them with a gap, and a roof meter; two simulations, the second of one test only."""
    gamma, c = (a.ravel() for a in np.meshgrid(GAMMAS, PLANES))
    beam = lobe(35.0, 90.0, 4000.0)
    recorded = np.concatenate([beam(gamma, c), sky_part(gamma, c), [8000.0, 8100.0]])
    predicted = np.concatenate([lobe(40, 90, 4000)(gamma, c), 0.9 * sky_part(gamma, c), [7900.0, 8100.0]])
    recorded[23] = np.nan
    n = len(gamma)
    setup = CaseFile.model_validate(
        {
            "format": "labdaq-case/1",
            "title": name,
            "channel": [
                {"id": "arm", "kind": "goniometer", "quantity": "luminous_intensity", "unit": "cd"},
                {"id": name, "kind": "illuminance-meter", "quantity": "illuminance", "unit": "fc"},
            ],
            "test": [{"id": name, "system": name, "sun_altitude_deg": 30.0, "sun_azimuth_deg": 90.0}, {"id": "T2"}],
            "simulation": {"engine": name},
        }
    )
    unknown = np.full(2 * n + 2, np.nan)
    records = Records(
        test=np.repeat([0, 1, 1], [n, n, 2]),
        channel=np.repeat([0, 0, 1], [n, n, 2]),
        utc_ns=np.full(2 * n + 2, -1),
        gamma_deg=np.concatenate([gamma, gamma, [np.nan] * 2]),
        c_deg=np.concatenate([c, c, [np.nan] * 2]),
        measured=recorded,
        uncertainty=0.01 * recorded,
        simulated=predicted,
        sun=unknown,
        sky=unknown,
    )
    case = write_case(folder, setup, records)
    second = replace(case.records, simulated=1.2 * case.records.simulated).where(case.records.test == 1)
    other = Case(folder, setup.model_copy(update={"simulation": Simulation(engine="second")}), second)
    return compare(case, [other])


class _Balanced(HTMLParser):
    """Notes unbalanced and executable elements, and anything fetched from elsewhere."""

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.bad: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        if tag not in ("meta", "line", "circle", "rect", "path", "polygon") or tag == "script":
            self.open.append(tag)
        if tag in ("script", "link", "iframe", "img"):
            self.bad.append(tag)
        self.bad += [f"{k}={v}" for k, v in attrs if k in ("src", "href") or k.startswith("on")]

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        pass

    def handle_endtag(self, tag: str) -> None:
        if tag in ("line", "circle", "rect", "path", "polygon"):
            return
        if not self.open or self.open.pop() != tag:
            self.bad.append(f"</{tag}>")


def test_the_report_is_whole_and_asks_for_nothing_from_elsewhere(tmp_path: Path) -> None:
    files = write_report(_comparison(tmp_path / "case"), tmp_path / "a" / "report")
    names = {f.name for f in files}
    assert {"report.html", "comparison.json", "campaign.csv", "groups.csv", "rings.csv"} <= names
    assert {"peaks.csv", "differences.csv", "channels.csv", "campaign.svg", "T2-polar.svg"} <= names
    assert {f.name for f in (tmp_path / "a" / "report").iterdir()} == names
    html = (tmp_path / "a" / "report" / "report.html").read_text(encoding="utf-8")
    parser = _Balanced()
    parser.feed(html)
    parser.close()
    assert parser.bad == []
    assert parser.open == []
    assert "<script" not in html
    assert "http" not in html.replace("http://www.w3.org/2000/svg", "")
    for file in files:
        if file.suffix == ".svg":
            root = ET.fromstring(file.read_text(encoding="utf-8"))
            assert root.tag == f"{SVG}svg"
            assert "nan" not in file.read_text(encoding="utf-8").replace(NASTY, "").lower().split("title")[0]


def test_tables_and_json_say_the_same_and_hold_no_nan(tmp_path: Path) -> None:
    comparison = _comparison(tmp_path / "case", "one")
    write_report(comparison, tmp_path)

    def refuse(word: str) -> float:
        raise AssertionError(word)

    told = json.loads((tmp_path / "comparison.json").read_text(encoding="utf-8"), parse_constant=refuse)
    assert told["simulations"] == ["one", "second"]
    with (tmp_path / "campaign.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    against = [(t["id"], a) for t in told["tests"] for a in t["against"]]
    assert [(r["test"], r["simulation"]) for r in rows] == [(i, a["simulation"]) for i, a in against]
    assert [r["test"] for r in rows] == ["one", "T2", "T2"]
    for row, (_, a) in zip(rows, against, strict=True):
        assert float(row["flux_ratio"]) == pytest.approx(a["flux_ratio"], rel=1e-6)
    assert float(rows[2]["flux_ratio"]) == pytest.approx(1.2 * float(rows[1]["flux_ratio"]), rel=1e-6)
    with (tmp_path / "rings.csv").open(newline="") as file:
        ring = [r for r in csv.DictReader(file) if r["test"] == "T2" and r["simulation"] == "one"]
    assert [float(r["difference_percent"]) for r in ring] == pytest.approx([-10.0] * 10)
    with (tmp_path / "differences.csv").open(newline="") as file:
        assert sum(1 for _ in csv.DictReader(file)) == 144 + 2 * 145  # one reading is missing
    assert told["channels"][0]["ratio"] == pytest.approx((7900 / 8000 + 1) / 2)
    (pair,) = next(t for t in told["tests"] if t["id"] == "one")["against"][0]["peaks"]
    assert pair["apart_deg"] == pytest.approx(5.0, abs=1.5)


def test_the_polar_plot_shows_the_readings_where_they_belong(tmp_path: Path) -> None:
    comparison = _comparison(tmp_path / "case", "one")
    root = ET.fromstring(drawings(comparison)["one-polar"])
    dots = {c.findtext(f"{SVG}title"): c for c in root.iter(f"{SVG}circle") if c.find(f"{SVG}title") is not None}
    beam = lobe(35.0, 90.0, 4000.0)
    at35 = f"{float(beam(np.array(35.0), np.array(90.0))):.4g} cd at gamma 35°, C 90°"
    at45 = f"{float(beam(np.array(45.0), np.array(90.0))):.4g} cd at gamma 45°, C 90°"
    nadir = next(d for t, d in dots.items() if t and t.endswith("gamma 0°, C 270°"))
    centre_x = float(nadir.get("cx", "nan"))  # straight below the plot's centre
    a, b = ((float(dots[t].get("cx", "nan")) - centre_x, float(dots[t].get("cy", "nan"))) for t in (at35, at45))
    centre_y = a[1] - a[0] / math.tan(math.radians(35.0))
    assert b[0] / (b[1] - centre_y) == pytest.approx(math.tan(math.radians(45.0)), rel=1e-3)
    lengths = [math.hypot(x, y - centre_y) for x, y in (a, b)]
    expected = [float(t.split()[0]) for t in (at35, at45)]
    assert lengths[0] / lengths[1] == pytest.approx(expected[0] / expected[1], rel=2e-3)  # two decimals of a pixel
    assert a[0] > 0  # C 90 is on the right


def test_a_simulation_keeps_its_colour_in_all_plots(tmp_path: Path) -> None:
    drawn = drawings(_comparison(tmp_path / "case", "one"))
    for name in ("T2-polar", "T2-gamma", "group-all-tests", "campaign"):
        assert COLOURS[0] in drawn[name]
        assert COLOURS[1] in drawn[name]
    assert COLOURS[1] not in drawn["one-polar"]
    assert COLOURS[1] not in drawn["one-gamma"]


def test_names_that_make_no_files_or_the_same_ones_do_not_collide(tmp_path: Path) -> None:
    comparison = _comparison(tmp_path / "case", "T2.")
    names = list(drawings(comparison))
    assert len(set(names)) == len(names)
    assert {"T2-polar", "T2-2-polar"} <= set(names)
    assert all(re.fullmatch(r"[A-Za-z0-9._-]+", name) for name in names)


def test_a_case_without_a_goniometer_makes_a_report_too(tmp_path: Path) -> None:
    comparison = _comparison(tmp_path / "case", "one")
    rows = comparison.case.records.channel == 1
    roof = compare(Case(tmp_path, comparison.case.setup, comparison.case.records.where(rows)))
    files = {f.name for f in write_report(roof, tmp_path / "report")}
    assert files == {"report.html", "comparison.json", "channels.csv", "channel-one.svg"}


def test_the_disk_s_refusal_is_one_error(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("x")
    with pytest.raises(StorageError, match="cannot be made"):
        write_report(_comparison(tmp_path / "case"), tmp_path / "file" / "report")


@given(st.floats(-1e6, 1e6), st.floats(1e-6, 1e6), st.integers(2, 12))
@example(-548850.7751695638, 1e-06, 3)
def test_ticks_are_round_and_inside(low: float, span: float, about: int) -> None:
    high = low + span
    if not high > low:
        return
    found = ticks(low, high, about)
    assert len(found) <= 2.5 * about + 1
    slack = 1e-6 * max(abs(low), abs(high))
    assert all(low - slack <= t <= high + slack for t in found)
    steps = np.diff(found)
    if len(steps):
        mantissa = 10 ** (math.log10(steps[0]) % 1.0)
        rounding = 4.0 * mantissa * float(np.spacing(max(abs(low), abs(high)))) / steps[0]  # of far ticks' difference
        assert min(abs(mantissa - m) for m in (1.0, 2.0, 5.0, 10.0)) < 1e-3 + rounding


def test_colours_run_from_cold_to_warm() -> None:
    assert cold_to_warm(0.0) == "#f7f7f7"
    assert cold_to_warm(-1.0) == cold_to_warm(-7.0) == "#2166ac"
    assert cold_to_warm(1.0) == "#b2182b"
    assert cold_to_warm(math.nan) == "#bbbbbb"
