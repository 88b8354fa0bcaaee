"""The recordings of 2010, from the report's tables to a verdict.

What the verdict ought to be is not fixed here: the tables are thin (one reading a test in the zenith, few times on the
roof). It is recorded beside the test (`record_property`), and what any honest answer must say is asserted.
"""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner

from labdaq.cli import cli
from tests.analysis.recordings import recording

Record = Callable[[str, object], None]
VERDICTS = {"no-mismatch", "explained", "partly-explained", "unexplained"}


def _explained(folder: Path, recipe: str, *tables: str) -> dict[str, Any]:
    run = CliRunner()
    given = [word for name in tables for word in ("--table", str(recording(name)))]
    case, out = str(folder / "case"), str(folder / "out")
    made = run.invoke(cli, ["compare", "--recipe", recipe, *given, "--out", case])
    assert made.exit_code == 0, made.output
    done = run.invoke(cli, ["explain", case, "--out", out])
    assert done.exit_code == 0, done.output
    content: dict[str, Any] = json.loads((folder / "out" / "explanation.json").read_text(encoding="utf-8"))
    assert content["verdict"] in VERDICTS
    assert (folder / "out" / "report.html").stat().st_size > 10_000
    return content


def test_the_roof_meters_of_greenwood(tmp_path: Path, record_property: Record) -> None:
    content = _explained(
        tmp_path,
        "greenwood-roof-meters",
        "greenwood-tests.csv",
        "greenwood-meter-comparison-before-levelling.csv",
        "greenwood-meter-comparison-after-levelling.csv",
    )
    record_property("verdict", content["verdict"])
    record_property("mechanisms", [m["id"] for m in content["mechanisms"]])
    assert content["verdict"] != "no-mismatch", "the meters differ by 7 % before levelling (report, appendix C)"
    assert {"Set 1", "Set 2"} & {t for m in content["mismatch"] for t in m["where"]["tests"]}
    assert any("means of five readings" in finding for finding in content["findings"])
    assert "meter-tilt" in {n["id"] for n in content["not_tried"]}, "no sun part and few times: a tilt cannot be tried"


@pytest.fixture(scope="module")
def zenith(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    return _explained(tmp_path_factory.mktemp("zenith"), "greenwood-zenith", "greenwood-tests.csv")


def test_the_zenith_of_greenwood_differs_under_clear_skies(zenith: dict[str, Any], record_property: Record) -> None:
    record_property("verdict", zenith["verdict"])
    record_property("mechanisms", [m["id"] for m in zenith["mechanisms"]])
    clear = [m for m in zenith["mismatch"] if "clear skies" in m["statement"]]
    assert clear, "the picture is brighter than the meter under clear skies"
    assert clear[0]["size_percent"] < -10.0
    assert zenith["fit"]["before"]["rms_percent"] > 20.0


def test_a_verdict_does_not_deny_what_was_located(zenith: dict[str, Any]) -> None:
    assert zenith["mismatch"][0]["p_value"] < 1e-6
    assert zenith["verdict"] != "no-mismatch"
