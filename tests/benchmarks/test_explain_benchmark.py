"""The comparison of methods: its cases, how it counts errors, its peers on a case where their conditions hold."""

import json
import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from analysis.cases import Case
from simulators.trial import truth as truths
from simulators.trial.outcome import Outcome
from tests.analysis.explain import effects
from tests.analysis.explain.campaign import NONE, TESTS, light, make_case, rows_of

HOME = Path(__file__).parents[2]
PLAIN = replace(NONE, noise=0.01, gain_of_tests=0.02)
"""Independent noise and a gain per test: what the plain peers take for granted."""


@pytest.fixture
def bench() -> Iterator[ModuleType]:
    sys.path.insert(0, str(HOME / "benchmarks"))
    try:
        import explain

        yield explain
    finally:
        sys.path.remove(str(HOME / "benchmarks"))


def truth_file(path: Path, content: str, case: Case, *, hidden: tuple[str, ...] = (), own: bool = True) -> None:
    clean = light(rows_of(TESTS))
    told = [{"id": name, "in_catalogue": True, "effect_percent": 5.0} for name in hidden]
    plain = {"case": path.stem, "content": content, "clean": clean.tolist(), "change": [0.0] * len(clean)}
    if own:
        made = truths.Truth(
            path.stem, "goniometer", 1, content, (), 0.0, 0.0, 2.0, True, 1.0, tuple(clean), (0.0,) * len(clean)
        )
        truths.write(made, path)
        return
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps(plain | {"hidden": told}), encoding="utf-8")


def test_cases_are_taken_evenly_and_only_with_a_truth(tmp_path: Path, bench: ModuleType) -> None:
    for name, content in (("a", "null"), ("b", "null"), ("c", "null"), ("d", "single"), ("e", "")):
        case = make_case(tmp_path / "cases" / name, flaws=NONE, files=False)
        if content:
            truth_file(tmp_path / "truth" / f"{name}.json", content, case)
    truth_file(tmp_path / "truth" / "lonely.json", "null", case)
    names = [task.folder.name for task in bench.tasks([tmp_path], None, {"goniometer"})]
    assert names == ["a", "b", "c", "d"]
    assert [task.folder.name for task in bench.tasks([tmp_path], 2, {"goniometer"})] == ["a", "b", "d"]
    assert bench.tasks([tmp_path], None, {"roof"}) == []


def test_another_authors_truth_is_read(tmp_path: Path, bench: ModuleType) -> None:
    case = make_case(tmp_path / "cases" / "x", flaws=NONE, files=False)
    truth_file(tmp_path / "truth" / "x.json", "single", case, hidden=("c-offset",), own=False)
    (task,) = bench.tasks([tmp_path], None, {"goniometer"})
    assert task.truth.kind == "goniometer"
    assert [c.id for c in task.truth.concealed] == ["c-offset"]
    assert task.truth.free_gain


def test_a_wild_prediction_is_not_a_good_one(bench: ModuleType) -> None:
    clean, test = np.geomspace(10.0, 1000.0, 40), np.repeat([0, 1], 20)
    truth = truths.Truth("x", "goniometer", 1, "null", (), 0.0, 0.0, 0.0, True, 0.1, tuple(clean))
    assert bench.error(clean * np.where(test, 3.0, 0.5), clean, test, truth) == pytest.approx(0.0, abs=0.01)
    wild = clean * np.exp(np.random.default_rng(1).normal(0.0, 30.0, 40))
    assert bench.error(wild, clean, test, truth) > 500.0
    ripple = 0.02 * np.random.default_rng(2).standard_normal(40)
    ripple -= np.where(test, ripple[test == 1].mean(), ripple[test == 0].mean())
    expected = 100.0 * np.sqrt(np.mean(ripple**2))
    assert bench.error(clean * np.exp(ripple), clean, test, truth) == pytest.approx(expected, rel=1e-3)


@pytest.fixture(scope="module")
def turned(tmp_path_factory: pytest.TempPathFactory) -> Case:
    """An arm turned by six degrees, independent noise; no file from which anything could be simulated again."""
    folder = tmp_path_factory.mktemp("turned") / "case"
    return make_case(folder, effects.c_offset(6.0), flaws=PLAIN, without=("system",))


PEERS = [("explain_search", "Bic", ""), ("explain_gp", "Calibrated", "sklearn"), ("explain_sindy", "Sindy", "pysindy")]


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize(("module", "kind", "library"), PEERS)
def test_a_peer_names_a_strong_effect_where_its_assumptions_hold(
    bench: ModuleType, turned: Case, module: str, kind: str, library: str
) -> None:
    if library:
        pytest.importorskip(library)
    method = getattr(__import__(module), kind)(turned)
    said = method.find()
    assert said.mechanisms[0].id == "c-offset"
    if kind == "Bic":
        value, uncertainty = said.mechanisms[0].parameters["offset_deg"]
        assert value == pytest.approx(6.0, abs=max(4.0 * uncertainty, 0.1))
    rows = method.problem.readings.test == 2
    seen, before = (getattr(method.problem.readings, name)[rows] for name in ("measured", "simulated"))

    def shape(values: np.ndarray) -> float:
        ratio = np.log(values / seen)[seen > 0.05 * seen.max()]
        return float(np.std(ratio))

    assert shape(method.left_out(rows)) < 0.5 * shape(before)
    assert shape(method.elsewhere(turned)[rows]) < 0.5 * shape(before)


@pytest.mark.filterwarnings("ignore")
def test_labdaq_answers_as_its_peers_do(bench: ModuleType, turned: Case) -> None:
    import explain_labdaq

    method = explain_labdaq.Labdaq(turned)
    assert [m.id for m in method.find().mechanisms] == ["c-offset"]
    rows = method.readings.test == 2
    there = method.elsewhere(turned)
    away = [
        np.std(np.log(x / method.readings.measured)[method.readings.measured > 1.0])
        for x in (there, method.readings.simulated)
    ]
    assert away[0] < 0.7 * away[1]
    assert method.left_out(rows) == pytest.approx(there[rows], rel=0.2)


@pytest.mark.filterwarnings("ignore")
def test_a_discrepancy_corrects_and_names_nothing(bench: ModuleType, turned: Case) -> None:
    pytest.importorskip("sklearn")
    import explain_gp

    method = explain_gp.Discrepancy(turned)
    said = method.find()
    assert (said.verdict, said.mechanisms) == ("unexplained", ())
    assert said.places


def test_a_method_that_cannot_say_something_leaves_the_line_empty(bench: ModuleType) -> None:
    truth = truths.Truth("x", "goniometer", 1, "null", (), 0.0, 0.0, 2.0, True, 1.0, (1.0,))
    results = [bench.Result(Outcome(truth, "no-mismatch", seconds=3.0), 2.0, 1.0)]
    text = bench.table({"labdaq": results, "gp": results}, [5.0])
    line = next(row for row in text.splitlines() if row.startswith("something named when there is nothing"))
    assert line.split()[-1] == "-"
    assert "0/1" in line
    assert "2.00 -> 1.00 (-50 %)" in text
