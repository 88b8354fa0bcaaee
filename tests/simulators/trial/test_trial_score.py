"""The scorer, on answers written by hand: each line counts what it says, and nothing else."""

import json
import math
import os
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from labdaq.cli.blind_trial import command
from labdaq.errors import DataError
from simulators.trial import trial
from simulators.trial.answer import Answer, Either, Named, Place, read_answer
from simulators.trial.made import Made, Order
from simulators.trial.outcome import Outcome, inside_place, judge, read_records, withheld_errors
from simulators.trial.report import as_json, confusion, story, table
from simulators.trial.runner import Program, run
from simulators.trial.score import Rate, calibration_error, failures, score
from simulators.trial.truth import Concealed, Truth

HEADER = "test,time,channel,gamma_deg,c_deg,measured,uncertainty,simulated,simulated_sun,simulated_sky\n"
RECORDS = HEADER + "".join(
    f"T{t},2010-07-22T13:1{t}:00.000Z,gonio.g{g:02d},{g},{c},100,1,100,60,40\n"
    for t in (1, 2)
    for c in (0, 90, 180, 270)
    for g in (5, 45, 85)
)
COORDINATES = read_records(RECORDS)


def _cause(id_: str, effect: float = 5.0, inside: bool = True, **more: object) -> Concealed:
    parameters = more.pop("parameters", {"strength": (0.04, "1")})
    return Concealed(id_, "stage", inside, effect, effect, parameters, **more)  # type: ignore[arg-type]


def _truth(content: str, *causes: Concealed, change: np.ndarray | None = None, **more: object) -> Truth:
    values = change if change is not None else np.where(COORDINATES.gamma_deg > 80.0, 0.3, -0.01)
    return Truth(
        case="case-0", kind="goniometer", seed=7, content=content, concealed=causes,
        effect_percent=max((c.effect_percent for c in causes), default=0.0), mismatch_percent=5.0, nuisance_percent=2.0,
        free_gain=True, floor=0.0, clean=(100.0,) * 24, change=tuple(values) if causes else (0.0,) * 24, **more,  # type: ignore[arg-type]
    )  # fmt: skip


def _answer(
    verdict: str, *named: str | Named, groups: tuple[set[str], ...] = (), places: tuple[Place, ...] = ()
) -> Answer:
    mechanisms = tuple(n if isinstance(n, Named) else Named(n, 0.9) for n in named)
    return Answer(verdict, mechanisms, (), tuple(frozenset(g) for g in groups), places)


def _judged(truth: Truth, answer: Answer, **more: object) -> Outcome:
    return judge(truth, answer, COORDINATES, 3.0, **more)  # type: ignore[arg-type]


def _line(outcomes: list[Outcome], start: str) -> tuple[int, int]:
    line = next(x for x in score(outcomes) if x.name.strip().startswith(start))
    assert line.rate is not None
    return line.rate.hits, line.rate.of


ROOM = _cause("room-interreflection")
DARK = _cause("dark-offset", equivalents=("stray-light",))


def test_wilson_is_wilsons() -> None:
    # 0 of 60: upper limit 6.0 % (inference.md); 14 of 14: lower limit 78.5 %
    assert Rate(0, 60).interval == pytest.approx((0.0, 0.060), abs=1e-3)
    assert Rate(14, 14).interval == pytest.approx((0.785, 1.0), abs=1e-3)
    low, high = Rate(5, 20).interval
    assert low < 0.25 < high
    assert Rate(0, 0).interval == (0.0, 1.0) and math.isnan(Rate(0, 0).value)


def test_a_first_name_is_right_equivalent_composite_wrong_or_none() -> None:
    def first(truth: Truth, answer: Answer) -> str:
        return _judged(truth, answer).first

    assert first(_truth("single", ROOM), _answer("explained", "room-interreflection", "saturation")) == "right"
    assert first(_truth("single", DARK), _answer("explained", "stray-light")) == "equivalent"
    group = ({"room-interreflection", "stray-light"},)
    assert first(_truth("single", ROOM), _answer("explained", "stray-light", groups=group)) == "composite"
    assert first(_truth("single", ROOM), _answer("explained", "saturation", "room-interreflection")) == "wrong"
    assert first(_truth("single", ROOM), _answer("unexplained")) == "none"
    assert first(_truth("null"), _answer("explained", "saturation")) == "wrong"


def test_several_names_told_as_one_are_one_claim() -> None:
    group = frozenset({"dark-offset", "stray-light"})
    told = replace(_answer("explained", groups=({*group},)), either=(Either(group, 0.9),))
    for cause in (DARK, _cause("stray-light")):
        outcome = _judged(_truth("single", cause), told)
        assert outcome.first == "composite"
        assert outcome.claims == (("dark-offset or stray-light", 0.9, True),)
        assert (outcome.inside_pair, outcome.extra) == (0, ())
    wrong = _judged(_truth("single", ROOM), told)
    assert wrong.first == "wrong" and wrong.extra == ("dark-offset or stray-light",)
    assert _judged(_truth("null"), told).named
    pair = _judged(_truth("pair", DARK, ROOM), replace(_answer("explained", ROOM.id), either=(Either(group, 0.9),)))
    assert pair.both


def test_names_are_counted_by_the_size_of_the_effect() -> None:
    right, none = _answer("explained", "room-interreflection"), _answer("no-mismatch")
    outcomes = [
        _judged(_truth("single", _cause("room-interreflection", effect)), answer)
        for effect, answer in ((8.0, right), (2.6, none), (2.0, right), (1.0, none), (0.5, none), (0.2, right))
    ]
    assert _line(outcomes, "named first, effect >= 2.5") == (1, 2)
    assert _line(outcomes, "named first, effect 1.5 to 2.5") == (1, 1)
    assert _line(outcomes, "named first, effect 0.8 to 1.5") == (0, 1)
    assert _line(outcomes, "named first, effect 0 to 0.4") == (1, 1)


def test_wrong_names_nulls_and_false_seconds() -> None:
    outcomes = [
        _judged(_truth("null"), _answer("no-mismatch")),
        _judged(_truth("null"), _answer("explained", "soiling")),
        _judged(_truth("single", ROOM), _answer("explained", "room-interreflection", "soiling")),
        _judged(_truth("single", ROOM), _answer("explained", "room-interreflection")),
        _judged(_truth("single", ROOM), _answer("explained", "soiling")),
        _judged(_truth("open", _cause("cable-shadow", inside=False)), _answer("partly-explained", "soiling")),
    ]
    assert _line(outcomes, "something named when there is nothing") == (1, 2)
    assert _line(outcomes, "wrong names among all claims") == (4, 6)
    assert _line(outcomes, "without the open cases") == (3, 5)
    assert _line(outcomes, "false second beside a single") == (1, 3)


def test_pairs_need_both_names() -> None:
    pair = _truth("pair", ROOM, DARK)
    outcomes = [
        _judged(pair, _answer("explained", "room-interreflection", "stray-light")),
        _judged(pair, _answer("partly-explained", "room-interreflection")),
        _judged(_truth("pair", ROOM, _cause("soiling", 1.0)), _answer("explained", "room-interreflection", "soiling")),
    ]
    assert _line(outcomes, "pairs, both named (each") == (1, 2)
    assert _line(outcomes, "all pairs") == (2, 3)
    assert _line(outcomes, "at least one named") == (3, 3)


def test_open_cases_must_be_flagged_and_located() -> None:
    shadow = _truth("open", _cause("cable-shadow", inside=False))
    high, low = Place(gamma_deg=(80.0, 90.0)), Place(gamma_deg=(0.0, 10.0))
    outcomes = [
        _judged(shadow, _answer("unexplained", places=(low, high))),
        _judged(shadow, _answer("partly-explained", "soiling", places=(high,))),
        _judged(shadow, _answer("unexplained", places=(low,))),
        _judged(shadow, _answer("explained", "soiling", places=(high,))),
        _judged(_truth("single", ROOM), _answer("partly-explained", "room-interreflection")),
        _judged(_truth("single", ROOM), _answer("explained", "room-interreflection")),
        _judged(_truth("single", ROOM), _answer("partly-explained", "soiling")),
    ]
    assert _line(outcomes, "open set flagged and located") == (2, 4)
    assert _line(outcomes, "flagged without any name") == (2, 4)
    assert _line(outcomes, "right explanation flagged") == (1, 2)


def test_places_are_read_on_every_coordinate() -> None:
    def count(**where: object) -> int:
        return int(inside_place(Place(**where), COORDINATES).sum())  # type: ignore[arg-type]

    assert count() == 24
    assert count(channels=("gonio.g85",)) == 8
    assert count(tests=("T1",)) == 12
    assert count(gamma_deg=(40.0, 90.0)) == 16
    assert count(c_deg=(0.0, 360.0)) == 24
    assert count(c_deg=(60.0, 200.0)) == 12
    assert count(c_deg=(260.0, 370.0)) == 12  # through north
    assert count(c_deg=(260.0, 10.0)) == 12
    assert count(when=("2010-07-22T13:12:00Z", "2010-07-22T13:12:30Z")) == 12


def test_intervals_are_checked_by_name_and_alias() -> None:
    cause = _cause("gamma-offset", parameters={"offset_deg": (1.0, "deg")})

    def held(value: float, uncertainty: float, name: str = "offset_deg") -> list[bool]:
        named = Named("gamma-offset", 0.9, {name: (value, uncertainty)})
        return [i[5] for i in _judged(_truth("single", cause), _answer("explained", named)).intervals]

    assert held(1.19, 0.1) == [True]
    assert held(1.2, 0.1) == [False]
    assert held(0.81, 0.1, "gamma_offset_deg") == [True]
    assert held(1.0, 0.1, "something_else") == []
    outcome = _judged(
        _truth("single", cause), _answer("explained", Named("gamma-offset", 0.9, {"offset_deg": (2.0, 0.1)}))
    )
    assert _line([outcome], "gamma-offset") == (0, 1)


def test_withheld_errors_ignore_a_gain_where_it_is_free() -> None:
    truth = _truth("single", ROOM, withheld_clean=(100.0, 200.0, 50.0))
    case = HEADER + "".join(f"T3,x,g,5,0,,1,{s},,\n" for s in (80, 200, 60))
    good = "test,corrected\n" + "".join(f"T3,{v}\n" for v in (110.0, 220.0, 55.0))
    before, after = withheld_errors(truth, case, good)
    assert after == pytest.approx(0.0, abs=1e-9)
    assert before > 10.0
    with pytest.raises(ValueError, match="withheld readings"):
        withheld_errors(truth, case, "test,corrected\nT3,1\n")
    outcomes = [_judged(truth, _answer("explained", "room-interreflection"), withheld=(before, after))]
    change = next(x for x in score(outcomes) if x.name.startswith("withheld error, change"))
    assert change.value == pytest.approx(-1.0) and change.met


def test_claims_within_pairs_are_counted() -> None:
    group = ({"room-interreflection", "stray-light"},)
    inside = _judged(_truth("single", ROOM), _answer("explained", "room-interreflection", groups=group))
    both = _judged(_truth("single", ROOM), _answer("explained", "room-interreflection", "stray-light", groups=group))
    assert (inside.inside_pair, both.inside_pair) == (1, 2)
    silent = _judged(_truth("single", DARK), _answer("explained", "dark-offset"))
    said = _judged(
        _truth("single", DARK), _answer("explained", "dark-offset", groups=({"dark-offset", "stray-light"},))
    )
    assert (silent.silent_pair, said.silent_pair) == (1, 0)


def test_calibration_compares_what_was_stated_with_what_was_right() -> None:
    sure_right = _judged(_truth("single", ROOM), _answer("explained", Named("room-interreflection", 1.0)))
    sure_wrong = _judged(_truth("single", ROOM), _answer("explained", Named("soiling", 1.0)))
    half = [sure_right, sure_wrong]
    assert calibration_error(half) == pytest.approx(0.5)
    assert calibration_error([sure_right]) == pytest.approx(0.0)
    assert math.isnan(calibration_error([]))


def test_every_failure_is_listed_with_its_seed() -> None:
    outcomes = [
        _judged(_truth("single", ROOM), _answer("explained", "room-interreflection")),
        _judged(_truth("single", ROOM), _answer("explained", "soiling")),
        Outcome(_truth("null"), "failed", error="exit code 70: a bug"),
    ]
    found = failures(outcomes)
    assert [f["seed"] for f in found] == [7, 7]
    assert "not named first" in found[0]["wrong"]
    assert any("exit code 70" in reason for reason in found[1]["wrong"])  # type: ignore[attr-defined]
    assert confusion(outcomes[:2]) == {"room-interreflection": {"room-interreflection": 1, "soiling": 1}}
    text = story(outcomes)
    assert "seed 7" in text and "MISSED" in table(score(outcomes))
    document = json.loads(as_json(outcomes, {"n": 3}))
    assert document["format"] == "labdaq-trial/1" and len(document["cases"]) == 3


GOOD = {
    "format": "labdaq-explanation/1",
    "verdict": "explained",
    "mismatch": [{"where": {"channels": None, "gamma_deg": [65, 85], "c_deg": [0, 360], "tests": None, "when": None}}],
    "mechanisms": [
        {"id": "soiling", "probability": 0.97, "parameters": {"d": {"value": 0.1, "uncertainty": 0.02, "unit": "1"}}}
    ],
    "alternatives": [{"ids": ["lens-haze"], "probability": 0.02}],
    "indistinguishable": [["soiling", "lens-haze"]],
}


def test_an_explanation_is_read_and_a_broken_one_named(tmp_path: Path) -> None:
    path = tmp_path / "explanation.json"
    path.write_text(json.dumps(GOOD))
    answer = read_answer(path)
    assert answer.mechanisms[0].parameters == {"d": (0.1, 0.02)}
    assert answer.places[0].gamma_deg == (65.0, 85.0) and answer.places[0].channels is None
    assert answer.indistinguishable == (frozenset({"soiling", "lens-haze"}),)
    for broken in ("{", json.dumps({**GOOD, "verdict": "maybe"}), json.dumps({**GOOD, "mechanisms": [{"id": "x"}]})):
        path.write_text(broken)
        with pytest.raises(DataError, match=r"explanation\.json"):
            read_answer(path)


PROGRAM = """
import csv, json, os, pathlib, sys
verb, words = sys.argv[1], sys.argv[2:]
here = pathlib.Path.cwd()
if verb == "explain":
    mode = {mode!r}
    if mode == "fails":
        sys.exit("cannot")
    if mode == "sleeps":
        import time
        time.sleep(60)
    seen = sorted(p.name for p in here.rglob("*.json")) + sorted(p.name for p in here.rglob("*truth*"))
    assert not seen, seen
    assert not [k for k in os.environ if "SEED" in k.upper() or "TRUTH" in k.upper()]
    for name in ("simulators.trial.truth", "simulators.hidden.tracer"):
        try:
            __import__(name)
        except ImportError:
            pass
        else:
            raise AssertionError(name + " could be imported")
    import labdaq.clock, analysis.photometry
    out = pathlib.Path(words[2])
    out.mkdir()
    out.joinpath("explanation.json").write_text({good!r})
else:
    rows = list(csv.DictReader(open(pathlib.Path(words[1]) / "records.csv")))
    with open(words[3], "w") as file:
        file.write("test,corrected\\n")
        file.writelines(r["test"] + "," + r["simulated"] + "\\n" for r in rows)
"""


def _program(tmp_path: Path, mode: str) -> Program:
    script = tmp_path / "program.py"
    script.write_text(PROGRAM.format(mode=mode, good=json.dumps(GOOD)))
    return Program((sys.executable, str(script)), limit_s=3.0 if mode == "sleeps" else 60.0)


def _made(withheld: bool = True) -> Made:
    truth = _truth("single", _cause("soiling"), withheld_clean=(100.0,) * 24 if withheld else ())
    order = Order("case-0", "goniometer", "single", ("soiling",), (0.05,), 7)
    files = {"case.toml": 'format = "labdaq-case/1"\n', "records.csv": RECORDS}
    return Made(order, files, files if withheld else {}, truth)


def test_a_child_answers_without_a_way_to_the_truth(tmp_path: Path) -> None:
    out = tmp_path / "out"
    outcome = run(_made(), _program(tmp_path, "answers"), out)
    assert outcome.error == "" and outcome.verdict == "explained" and outcome.first == "right"
    assert outcome.withheld == pytest.approx((0.0, 0.0))
    assert outcome.seconds > 0.0
    assert sorted(p.name for p in out.iterdir()) == ["answers", "cases", "truth"]
    again = trial.existing(out)
    assert len(again) == 1 and again[0].first == "right"


@pytest.mark.parametrize(("mode", "why"), [("fails", "exit code 1: cannot"), ("sleeps", "no answer within 3 s")])
def test_a_child_that_does_not_answer_has_failed(tmp_path: Path, mode: str, why: str) -> None:
    outcome = run(_made(withheld=False), _program(tmp_path, mode), tmp_path / "out")
    assert outcome.verdict == "failed" and why in outcome.error
    assert _line([outcome], "no answer") == (1, 1)


def test_the_command_writes_cases_and_scores_answers(tmp_path: Path) -> None:
    runner, out = CliRunner(), tmp_path / "out"
    words = ["--n", "2", "--seed", "3", "--kinds", "roof", "--out", str(out)]
    made = runner.invoke(command, [*words, "--only-cases"], catch_exceptions=False)
    assert made.exit_code == 0 and not (out / "answers").exists()
    names = [p.stem for p in (out / "truth").iterdir()]
    assert len(names) == 2
    for name in names:
        (out / "answers" / name).mkdir(parents=True)
        (out / "answers" / name / "explanation.json").write_text(json.dumps(GOOD))
    scored = runner.invoke(command, ["--score", "--out", str(out), "--json"], catch_exceptions=False)
    assert scored.exit_code == 0
    assert len(json.loads((out / "trial.json").read_text())["cases"]) == 2
    assert "named first" in (out / "trial.txt").read_text()


def test_an_interrupted_trial_goes_on_where_it_was(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    runner, out = CliRunner(), tmp_path / "out"
    words = ["--n", "3", "--seed", "3", "--kinds", "roof", "--out", str(out)]
    runner.invoke(command, [*words, "--only-cases"], catch_exceptions=False)
    answered, failed, left = sorted(p.stem for p in (out / "truth").iterdir())
    for name, file, text in ((answered, "explanation.json", json.dumps(GOOD)), (failed, "failed.txt", "cannot")):
        (out / "answers" / name).mkdir(parents=True)
        (out / "answers" / name / file).write_text(text)
    asked: list[str] = []

    def outcomes(orders: list[Order], workshop: trial.Workshop) -> list[Outcome]:
        asked.extend(order.name for order in orders)
        for name in asked:
            (workshop.out / "answers" / name).mkdir()
            (workshop.out / "answers" / name / "explanation.json").write_text(json.dumps(GOOD))
        return trial.existing(workshop.out, asked)

    monkeypatch.setattr(trial, "outcomes", outcomes)
    done = runner.invoke(command, [*words, "--resume"], catch_exceptions=False)
    assert done.exit_code == 0 and asked == [left]
    assert [case["case"] for case in json.loads((out / "trial.json").read_text())["cases"]] == [answered, failed, left]


def test_cores_are_shared_out_among_workers() -> None:
    assert trial.shares_of([0, 1, 2, 3, 4], 2) == [{0, 2, 4}, {1, 3}]
    assert trial.shares_of([0, 1], 3) == [{0}, {1}, {0}]
    assert trial.shares_of([7], 1) == [{7}]


def _cores_of(order: Order, workshop: trial.Workshop) -> set[int]:
    return os.sched_getaffinity(0)


def test_a_worker_keeps_to_its_cores(tmp_path: Path) -> None:
    mine = sorted(os.sched_getaffinity(0))
    orders = [Order("case-0", "roof", "null", (), (), 1), Order("case-1", "roof", "null", (), (), 2)]
    found = list(trial._each(_cores_of, orders, trial.Workshop(tmp_path, workers=2)))
    assert all(cores in trial.shares_of(mine, 2) for cores in found)
    assert len(found) == 2


@pytest.mark.parametrize(
    "words",
    [["--kinds", "roof,moon"], ["--contents", "null"], ["--only-cases"], ["--resume"], ["--contents", "other=1"]],
)
def test_the_command_refuses_what_makes_no_sense(words: list[str]) -> None:
    result = CliRunner().invoke(command, ["--n", "1", *words])
    assert result.exit_code == 2


def test_scoring_nothing_says_so(tmp_path: Path) -> None:
    with pytest.raises(DataError, match="truth"):
        CliRunner().invoke(command, ["--score", "--out", str(tmp_path)], catch_exceptions=False)
