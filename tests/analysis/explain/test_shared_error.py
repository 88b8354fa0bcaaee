"""What the tests of a system share is learned, and helps where it was not fitted."""

import json
from pathlib import Path

import numpy as np
import pytest

from analysis.explain.answer import answer, write_json
from analysis.explain.apply import apply_model, read_model
from analysis.explain.fit import Fitter
from analysis.explain.hypers import Hyper
from analysis.explain.mismatch import explain
from analysis.explain.readings import Readings
from analysis.explain.scene import Scene
from analysis.explain.shared_error import SharedError, shared_error
from tests.analysis.explain import effects
from tests.analysis.explain.campaign import TESTS, WITHHELD, Flaws, Floats, Rows, columns, light, make_case, rows_of


def _lens(rows: Rows) -> Floats:
    """A smooth error of the box's lens, four per cent at most, the same in all its tests."""
    box = np.array([t.system == "box" for t in rows.tests])[rows.test]
    shape = np.sin(np.radians(rows.gamma_deg)) * np.cos(np.radians(2.0 * rows.c_deg + 20.0))
    return np.where(box, 0.04 * shape, 0.0)


def test_a_lens_error_is_learned_for_its_own_system_only(tmp_path: Path) -> None:
    smooth = Flaws(ripple=0.0)
    scene = Scene(
        Readings.of(make_case(tmp_path / "case", lambda rows: light(rows) * np.exp(_lens(rows)), flaws=smooth))
    )
    fitter = Fitter(scene)
    fit = fitter.fit((), np.zeros(0), Hyper(1.0, 1.0, 0.4))
    learned = shared_error(fitter, fit.residual, Hyper(1.0, 1.0, 0.4))
    other = Readings.of(make_case(tmp_path / "other", tests=WITHHELD))
    rows = rows_of(WITHHELD)
    seen, true = learned.at(Scene(other)), _lens(rows)
    box = np.array([t.system == "box" for t in WITHHELD])[rows.test]
    apart = seen[box] - seen[box].mean() - true[box] + true[box].mean()
    assert np.std(apart) < 0.5 * np.std(true[box])
    assert np.corrcoef(seen[box], true[box])[0, 1] > 0.9
    assert np.std(seen[~box]) < 0.6 * np.std(true[box])


def test_the_weights_are_the_inverse_covariance(tmp_path: Path) -> None:
    scene = Scene(Readings.of(make_case(tmp_path / "case", tests=TESTS[:1])))
    whitener = Fitter(scene).whitener(Hyper(1.0, 1.0, 1.0))
    residual = np.random.default_rng(3).standard_normal(len(scene.readings))
    assert residual @ whitener.weights(residual) == pytest.approx(whitener.squares(residual[:, None])[0], rel=1e-9)


@pytest.mark.slow
def test_predictions_elsewhere_gain_by_it(tmp_path: Path) -> None:
    """Beside a named mechanism, what the lens has wrong is taken off as well; without a name nothing is."""

    def truth(rows: Rows) -> Floats:
        return np.asarray(effects.offset(40.0)(rows) * np.exp(_lens(rows)))

    content = answer(explain(make_case(tmp_path / "case", truth)))
    assert [set(m["ids"]) for m in content["either"]] == [{"dark-offset", "stray-light"}]
    held = content["fit"]["held_out"]
    assert held["after_with_shared_error"]["rms_percent"] < held["after"]["rms_percent"]
    (tmp_path / "answer").mkdir()
    write_json(tmp_path / "answer" / "explanation.json", content)
    model = read_model(tmp_path / "answer")
    withheld = make_case(tmp_path / "withheld", tests=WITHHELD[:1], measured=False)
    exact = truth(rows_of(WITHHELD[:1]))
    (with_it,) = columns(apply_model(model, withheld), "corrected")
    (without,) = columns(apply_model(model.without_shared_error(), withheld), "corrected")
    assert np.std(np.log(with_it / exact)) < 0.7 * np.std(np.log(without / exact))


def test_what_is_told_is_read_again() -> None:
    error = SharedError(
        {"box": np.arange(36 * 19).reshape(36, 19) / 1e4}, {"gonio.g45": 0.012}, {"box": {"blur": -0.4}}
    )
    again = SharedError.of(json.loads(json.dumps(error.told())))
    assert np.array_equal(again.systems["box"], error.systems["box"])
    assert (again.sensors, again.lens) == (error.sensors, error.lens)
    with pytest.raises(ValueError, match="another grid"):
        SharedError.of({"systems": {"box": [[0.0]]}, "sensors": {}, "lens": {}})
