"""The contract's files, and one clear error for what cannot be explained."""

import csv
import json
import re
from html.parser import HTMLParser
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest

from tests.analysis.commands import Run
from tests.analysis.explain import effects
from tests.analysis.explain.campaign import TESTS, WITHHELD, make_case


@pytest.fixture(scope="module")
def explained(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """A case and the folder of its answer, made by the command."""
    from click.testing import CliRunner

    from labdaq.cli import cli

    folder = tmp_path_factory.mktemp("explained")
    case = make_case(folder / "case", effects.offset(30.0), tests=TESTS[:6])
    gap = (folder / "case" / "records.csv").read_text().splitlines()
    fields = gap[40].split(",")
    fields[5] = ""  # one reading is missing
    gap[40] = ",".join(fields)
    (folder / "case" / "records.csv").write_text("\n".join(gap) + "\n")
    done = CliRunner().invoke(cli, ["explain", str(case.folder), "--out", str(folder / "out"), "--no-simulation"])
    assert done.exit_code == 0, done.output
    assert "verdict: explained" in done.stdout
    return case.folder, folder / "out"


@pytest.fixture(scope="module")
def content(explained: tuple[Path, Path]) -> dict[str, Any]:
    told: dict[str, Any] = json.loads((explained[1] / "explanation.json").read_text(encoding="utf-8"))
    return told


SHAPES: dict[str, Any] = {
    "format": str,
    "verdict": str,
    "mismatch": [{
        "where": {"channels": [str], "gamma_deg": [float], "c_deg": [float], "tests": [str], "when": object},
        "size_percent": float, "p_value": float, "statement": str,
    }],
    "mechanisms": [{"id": str, "probability": float, "parameters": dict, "statement": str}],
    "either": [{"ids": [str], "probability": float, "parameters": dict, "statement": str}],
    "alternatives": [{"ids": [str], "probability": float}],
    "indistinguishable": [[str]],
    "not_tried": [{"id": str, "because": str}],
    "fit": {
        "records": int,
        "before": {"rms_percent": float, "chi2_per_dof": float},
        "after": {"rms_percent": float, "chi2_per_dof": float},
        "held_out": {"scheme": str, "before": {"rms_percent": float}, "after": {"rms_percent": float}},
    },
    "next_measurement": {"statement": str, "would_separate": [[str]]},
}  # fmt: skip


def _conforms(value: Any, shape: Any, place: str) -> None:
    if isinstance(shape, dict):
        assert isinstance(value, dict), place
        for key, inner in shape.items():
            assert key in value, f"{place}.{key} is missing"
            _conforms(value[key], inner, f"{place}.{key}")
    elif isinstance(shape, list):
        assert isinstance(value, list), place
        assert value or place.count(".") > 1 or "p_value" not in place, place
        for k, item in enumerate(value):
            _conforms(item, shape[0], f"{place}[{k}]")
    elif shape is float:
        assert isinstance(value, int | float), place
        assert not isinstance(value, bool), place
        assert np.isfinite(value), place
    elif shape is not object:
        assert isinstance(value, shape), f"{place} is {value!r}"


def test_the_answer_keeps_the_contract(content: dict[str, Any]) -> None:
    _conforms(content, SHAPES, "explanation")
    assert content["format"] == "labdaq-explanation/1"
    assert content["verdict"] == "explained"
    for name in ("mismatch", "either", "alternatives", "indistinguishable", "not_tried"):
        assert content[name], f"{name} is empty in a case where it should not be"
    assert content["fit"]["records"] == 6 * 160 - 1
    for m in [*content["mechanisms"], *content["either"]]:
        assert 0.0 <= m["probability"] <= 1.0
        for p in m["parameters"].values():
            _conforms(p, {"value": float, "uncertainty": float, "unit": str}, str(m))
    assert content["mechanisms"] == [], "an offset in the dark is also a constant stray light: neither is claimed"
    assert sum(a["probability"] for a in content["alternatives"]) <= 1.0
    for m in content["mismatch"]:
        assert 0.0 <= m["p_value"] <= 0.01
        assert m["statement"].endswith(".")
    assert any("1 of 960 readings are missing" in finding for finding in content["findings"])


def test_predictions_are_the_records_with_two_columns_more(
    explained: tuple[Path, Path], content: dict[str, Any]
) -> None:
    case, out = explained
    records = list(csv.reader((case / "records.csv").read_text().splitlines()))
    made = list(csv.reader((out / "predictions.csv").read_text().splitlines()))
    assert made[0] == [*records[0], "corrected", "corrected_uncertainty"]
    assert len(made) == len(records)
    before, after = [], []
    for old, new in zip(records[1:], made[1:], strict=True):
        assert new[0] == old[0]
        assert new[2] == old[2]
        assert [float(x or "nan") for x in new[3:10]] == pytest.approx(
            [float(x or "nan") for x in old[3:10]], rel=1e-7, abs=1e-9, nan_ok=True
        )
        if old[5]:
            measured, simulated, corrected = float(new[5]), float(new[7]), float(new[10])
            before.append(np.arcsinh(measured) - np.arcsinh(simulated))
            after.append(np.arcsinh(measured) - np.arcsinh(corrected))
            assert float(new[11]) > 0.0
        else:
            assert new[10:] == ["", ""]
    assert np.sqrt(np.mean(np.square(after))) < 0.3 * np.sqrt(np.mean(np.square(before)))


class _Page(HTMLParser):
    """Checks that tags are closed in order, and collects what a page refers to."""

    VOID = frozenset({"meta", "br", "hr", "img", "link", "input", "col"})

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.refers: list[str] = []
        self.tags: set[str] = set()
        self.text: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.add(tag)
        self.refers += [v for k, v in attrs if v and (k in {"src", "href", "xlink:href", "action", "data"})]
        if tag not in self.VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.handle_starttag(tag, attrs)
        if tag not in self.VOID:
            self.open.pop()

    def handle_endtag(self, tag: str) -> None:
        assert self.open, f"</{tag}> closes nothing"
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        self.text.append(data)


def test_the_report_stands_alone_and_tells_all(explained: tuple[Path, Path], content: dict[str, Any]) -> None:
    text = (explained[1] / "report.html").read_text(encoding="utf-8")
    page = _Page()
    page.feed(text)
    page.close()
    assert page.open == []
    assert all(ref.startswith(("#", "data:")) for ref in page.refers), page.refers
    assert not {"script", "link", "iframe"} & page.tags
    assert not re.search(r"url\((?!#)|@import", text)
    said = " ".join(page.text)
    for m in content["mechanisms"]:
        assert m["id"] in said
        assert m["statement"] in said
    for place in content["mismatch"]:
        assert place["statement"] in said
    for untried in content["not_tried"]:
        assert untried["id"] in said
    assert "invented <campaign> & more" in said, "a title is text, not HTML"
    assert text.count("<svg") >= 5


def test_the_plots_are_svg(explained: tuple[Path, Path]) -> None:
    names = {p.stem for p in explained[1].glob("*.svg")}
    assert {"map", "by-test", "by-time", "measured-predicted", "evidence", "held-out"} <= names
    for path in explained[1].glob("*.svg"):
        assert ElementTree.fromstring(path.read_text(encoding="utf-8")).tag.endswith("svg")


def test_predict_writes_a_csv_and_fits_nothing(labdaq: Run, explained: tuple[Path, Path], tmp_path: Path) -> None:
    make_case(tmp_path / "other", tests=WITHHELD, measured=False)
    answer = json.loads((explained[1] / "explanation.json").read_text())
    found, shared = answer["model"][0]["theta"][0], answer["shared_error"]
    assert shared.pop("lens"), "what the lens has wrong in the sun's frame needs the fields: left out here"
    (tmp_path / "answer").mkdir()
    (tmp_path / "answer" / "explanation.json").write_text(json.dumps(answer | {"shared_error": shared | {"lens": {}}}))
    told = {}
    for words in (["--mechanisms-only"], []):
        code, _, err = labdaq("predict", tmp_path / "answer", tmp_path / "other", "--out", tmp_path / "p.csv", *words)
        assert (code, err) == (0, "")
        told[bool(words)] = list(csv.DictReader((tmp_path / "p.csv").read_text().splitlines()))
    assert len(told[True]) == len(told[False]) == 2 * 160
    systems = {sky.id: sky.system for sky in WITHHELD}
    nodes = 0
    for alone, row in zip(told[True], told[False], strict=True):
        assert alone["measured"] == row["measured"] == ""
        assert float(alone["corrected"]) == pytest.approx(float(row["simulated"]) + found, rel=1e-6)
        c, gamma = float(row["c_deg"]) / 10.0, float(row["gamma_deg"]) / 5.0
        if c.is_integer():  # a node of the table of the shared error
            table = shared["systems"][systems[row["test"]]]
            shift = table[int(c)][int(gamma)] + shared["sensors"][row["channel"]]
            assert float(row["corrected"]) == pytest.approx(float(alone["corrected"]) * np.exp(shift), rel=1e-6)
            nodes += 1
    assert nodes == 2 * 40
    assert max(abs(x) for table in shared["systems"].values() for row in table for x in row) > 0.003


# what cannot be explained


def _refused(labdaq: Run, out: Path, *words: object) -> str:
    code, said, err = labdaq(*words)
    assert code == 65
    assert said == ""
    assert err.count("labdaq: ") == 1
    assert "Traceback" not in err
    assert not out.exists(), "nothing is written"
    return err


def test_a_nan_is_refused_by_row_and_column(labdaq: Run, tmp_path: Path) -> None:
    make_case(tmp_path / "case", tests=TESTS[:2])
    path = tmp_path / "case" / "records.csv"
    lines = path.read_text().splitlines()
    fields = lines[7].split(",")
    fields[7] = "nan"
    lines[7] = ",".join(fields)
    path.write_text("\n".join(lines))
    err = _refused(labdaq, tmp_path / "out", "explain", tmp_path / "case", "--out", tmp_path / "out")
    assert "records.csv" in err
    assert "row 8, column simulated" in err


def test_a_missing_file_is_named(labdaq: Run, tmp_path: Path) -> None:
    out = tmp_path / "out"
    assert "case.toml" in _refused(labdaq, out, "explain", tmp_path / "nowhere", "--out", out)
    make_case(tmp_path / "case", tests=TESTS[:2])
    (tmp_path / "case" / "simulated" / "T2-sky.ies").unlink()
    assert "T2-sky.ies" in _refused(labdaq, out, "explain", tmp_path / "case", "--out", out)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        (None, "there is no such file"),
        ("{", "not valid JSON"),
        ("[]", "not an explanation"),
        ('{"format": "labdaq-explanation/9", "model": []}', "not an explanation"),
        ('{"format": "labdaq-explanation/1", "model": [], "mechanisms": []}', "not an explanation"),
        ('{"format": "labdaq-explanation/1", "verdict": "explained", "model": [{"id": "x"}]}', "not an explanation"),
        (
            '{"format": "labdaq-explanation/1", "verdict": "explained", "model": [], "lenses": {"box": {}},'
            ' "shared_error": {"systems": {}, "sensors": {}, "lens": {}}}',
            "not an explanation",
        ),
    ],
)
def test_a_folder_that_is_no_explanation_is_refused(labdaq: Run, tmp_path: Path, text: str | None, says: str) -> None:
    make_case(tmp_path / "case", tests=WITHHELD, measured=False)
    (tmp_path / "answer").mkdir()
    if text is not None:
        (tmp_path / "answer" / "explanation.json").write_text(text)
    out = tmp_path / "p.csv"
    assert says in _refused(labdaq, out, "predict", tmp_path / "answer", tmp_path / "case", "--out", out)


def test_a_case_without_readings_cannot_be_explained(labdaq: Run, tmp_path: Path) -> None:
    make_case(tmp_path / "case", tests=TESTS[:2], measured=False)
    out = tmp_path / "out"
    assert "every reading is missing" in _refused(labdaq, out, "explain", tmp_path / "case", "--out", out)


def test_a_case_that_lacks_what_the_model_needs_is_told_so(
    labdaq: Run, explained: tuple[Path, Path], tmp_path: Path
) -> None:
    from tests.analysis.explain.roof import roof_case

    roof_case(tmp_path / "roof", {})
    out = tmp_path / "p.csv"
    err = _refused(labdaq, out, "predict", explained[1], tmp_path / "roof", "--out", out)
    assert "dark-offset (the goniometer's sensors) cannot be applied to this case" in err


def test_out_is_needed(labdaq: Run, tmp_path: Path) -> None:
    assert labdaq("explain", tmp_path)[0] == 64
    assert labdaq("predict", tmp_path)[0] == 64
