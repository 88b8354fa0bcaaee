"""The demo: whose folder it takes, that it judges fairly, that failures name their step; and all of it (slow)."""

import json
import os
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner
from rich.console import Console

from labdaq.cli import cli
from labdaq.clock import SystemClock
from labdaq.demo.answering import explain
from labdaq.demo.crew import Crew
from labdaq.demo.folder import MARK, claim
from labdaq.demo.reveal import Outcome, reveal
from labdaq.demo.telling import Teller
from labdaq.errors import DataError, SimulationError, StorageError
from labdaq.session import list_sessions


def teller(path: Path) -> Teller:
    return Teller(SystemClock(), Console(file=path.open("w"), width=100))


def test_the_folder_is_new_or_empty_or_a_former_demos(tmp_path: Path) -> None:
    first = claim(tmp_path / "a" / "demo")
    assert (first.home / MARK).is_file()
    (first.sessions / "old").mkdir(parents=True)
    (first.home / "old.txt").write_text("old")
    again = claim(first.home)
    assert sorted(p.name for p in again.home.iterdir()) == ["concealed", MARK]
    (tmp_path / "empty").mkdir()
    claim(tmp_path / "empty")


def test_other_folders_are_left_alone(tmp_path: Path) -> None:
    (tmp_path / "thesis").mkdir()
    (tmp_path / "thesis" / "chapter.tex").write_text("a year's work")
    with pytest.raises(StorageError, match="not empty"):
        claim(tmp_path / "thesis")
    assert (tmp_path / "thesis" / "chapter.tex").read_text() == "a year's work"
    assert list((tmp_path / "thesis").iterdir()) == [tmp_path / "thesis" / "chapter.tex"]
    with pytest.raises(StorageError, match="is a file"):
        claim(tmp_path / "thesis" / "chapter.tex")
    done = CliRunner().invoke(cli, ["demo", "--out", str(tmp_path / "thesis")], standalone_mode=False)
    assert isinstance(done.exception, StorageError)


def outcome(named: list[str], alike: list[list[str]] | None = None, verdict: str = "explained") -> Outcome:
    truth = {"mechanism": "gamma-offset", "sentence": "The arm was off.", "parameters": {}}
    answer: dict[str, Any] = {
        "verdict": verdict,
        "mechanisms": [{"id": name, "probability": 0.5, "statement": "So.", "parameters": {}} for name in named],
        "indistinguishable": alike or [],
    }
    return Outcome(truth, answer, Path("/report.html"))


@pytest.mark.parametrize(
    ("named", "alike", "judgement"),
    [
        (["gamma-offset"], [], "named first"),
        (["near-field", "gamma-offset"], [], "named"),
        (["near-field"], [["near-field", "gamma-offset"]], "named as indistinguishable"),
        (["near-field"], [["c-offset", "gamma-offset"]], "not named"),
        ([], [], "not named"),
    ],
)
def test_the_answer_is_judged(named: list[str], alike: list[list[str]], judgement: str) -> None:
    told = outcome(named, alike)
    assert told.judgement == judgement
    assert told.lines()[-1].endswith(judgement)


def test_what_is_told_as_either_of_two_is_named_so() -> None:
    told = outcome([], [["gamma-offset", "near-field"]])
    either = {"ids": ["near-field", "gamma-offset"], "probability": 0.9, "statement": "So.", "parameters": {}}
    with_it = replace(told, answer={**told.answer, "either": [either]})
    assert with_it.judgement == "named as indistinguishable"
    assert any("near-field or gamma-offset (90 %)" in line for line in with_it.lines())


def test_truth_and_answer_stand_side_by_side(tmp_path: Path) -> None:
    folder = claim(tmp_path / "demo")
    truth = {
        "mechanism": "channel-gain",
        "sentence": "The sensor at 65 degrees read 0.84 times what was there.",
        "parameters": {"gain": {"value": 0.84, "unit": "1"}, "gamma_deg": {"value": 65.0, "unit": "deg"}},
    }
    answer = {
        "verdict": "explained",
        "mechanisms": [
            {
                "id": "channel-gain",
                "probability": 0.98,
                "statement": "It reads less.",
                "parameters": {"error": {"value": -0.155, "uncertainty": 0.013, "unit": "1"}},
            }
        ],
        "fit": {
            "before": {"rms_percent": 6.7},
            "after": {"rms_percent": 2.0},
            "held_out": {"before": {"rms_percent": 6.7}, "after": {"rms_percent": None}},
        },
    }
    with pytest.raises(DataError, match="cannot be read"):
        reveal(folder, answer)
    folder.truth.write_text(json.dumps(truth))
    text = "\n".join(reveal(folder, answer).lines())
    for part in ("0.84 times", "gamma_deg = 65 deg", "error = -0.155 +- 0.013", "6.70 % rms before, 2.00 % rms after"):
        assert part in text
    assert "6.70 % rms before, unknown after" in text


def test_a_failing_step_is_named(tmp_path: Path) -> None:
    quiet = teller(tmp_path / "told")
    with pytest.raises(DataError, match="stopped in step 'simulate': no light"), quiet.step("simulate", "..."):
        raise DataError("no light")
    with pytest.raises(ZeroDivisionError) as told, quiet.step("compare", "..."):
        raise ZeroDivisionError
    assert told.value.__notes__ == ["the demo stopped in step 'compare'"]
    assert quiet.took_s == {}
    quiet.console.file.close()


def test_an_explanation_that_fails_says_why(tmp_path: Path) -> None:
    said: list[str] = []
    with pytest.raises(SimulationError, match=r"ended with 65(.|\n)*case.toml"):
        explain(tmp_path / "none", tmp_path / "answer", said.append)
    assert any("case.toml" in line for line in said)


def _gone(_: Path) -> None:
    os._exit(9)


def _broken(path: Path) -> None:
    raise DataError(f"{path}: not a session")


def test_a_process_that_fails_is_told(tmp_path: Path) -> None:
    with Crew(1) as crew:
        crew.do("T01", _broken, tmp_path)
        with pytest.raises(DataError, match="not a session"):
            crew.results(lambda *_: None)
    with Crew(1) as crew:
        crew.do("T01", _gone, tmp_path)
        with pytest.raises(SimulationError, match="ended from outside"):
            crew.results(lambda *_: None)


@pytest.mark.slow
@pytest.mark.timeout(900)
def test_all_of_it(tmp_path: Path) -> None:
    """Three tests with seed 3, a sensor that reads 16 % too little: enough to run through, and to find that sensor."""
    home = tmp_path / "demo"
    words = ["demo", "--seed", "3", "--out", str(home), "--tests", "3", "--json"]
    done = CliRunner().invoke(cli, words, standalone_mode=False)
    assert done.exit_code == 0, (done.output, done.exception)
    told = json.loads(done.stdout.splitlines()[-1])
    assert told["seed"] == 3
    assert told["verdict"] in {"explained", "partly-explained", "unexplained", "no-mismatch"}
    assert Path(told["report"]).is_file()
    truth = (home / "concealed" / "truth.json").read_text()
    sessions = list_sessions(home / "sessions")
    assert [session.header.test for session in sessions] == ["T01", "T02", "T03"]
    assert len({session.header.system for session in sessions}) == 2
    assert json.loads((home / MARK).read_text())["state"] == "finished"
    # nothing that the explanation could see tells what is concealed
    sentence = json.loads(truth)["sentence"].encode()
    for path in (p for folder in ("sessions", "case") for p in (home / folder).rglob("*") if p.is_file()):
        content = path.read_bytes()
        assert sentence not in content
        assert b"labdaq-concealed" not in content
