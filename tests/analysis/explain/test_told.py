"""What is told of a mismatch: sizes that are shares, and nothing carried over that does not help elsewhere."""

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest

from analysis.explain.answer import _of_the_best
from analysis.explain.conclude import conclude
from analysis.explain.conclusion import Conclusion
from analysis.explain.fit import MIDDLE, Fitter
from analysis.explain.heldout import HeldOut
from analysis.explain.locate import Mismatch, Scan
from analysis.explain.mismatch import LOOKING, Explanation, _shared, explain
from analysis.explain.readings import Readings
from analysis.explain.regions import Region
from analysis.explain.scene import Scene
from analysis.explain.search import Search
from labdaq.errors import DataError
from tests.analysis.commands import Run
from tests.analysis.explain.campaign import TESTS, make_case
from tests.analysis.explain.roof import ROOF_TESTS, beam_and_sky, roof_case, sky_case, sun_of
from tests.analysis.explain.weighed import hypothesis


@pytest.mark.parametrize(("ratio", "says"), [(0.5, "50.0% below"), (2.0, "99.9% above"), (0.13, "87.0% below")])
def test_a_size_is_a_share_of_the_simulation(tmp_path: Path, ratio: float, says: str) -> None:
    readings = Readings.of(sky_case(tmp_path / "case"))
    dim = readings.test == 1
    model = readings.measured / np.where(dim, ratio, 1.0)
    residual = readings.stretched(readings.measured) - readings.stretched(model)
    first = Scan.of(readings, Fitter(Scene(readings)).whitener(LOOKING)).standing_out(residual)[0]
    assert first.region.name == "in test S2"
    assert first.share == pytest.approx(ratio - 1.0, abs=1e-3)
    assert says in first.statement


def test_a_sentence_says_what_the_number_says() -> None:
    nowhere = Region("somewhere", np.zeros(3, dtype=bool), {})
    assert "0.3% below the simulation somewhere" in Mismatch(nowhere, np.log(0.997), -9.0, 1e-9).statement


def test_the_level_of_roof_meters_alone_counts(tmp_path: Path) -> None:
    """A camera's pictures have gains of their own, a meter on the roof has not."""
    altitude, _ = sun_of(ROOF_TESTS, 60.0)
    bright = {name: 1.09 * sum(beam_and_sky(altitude)) for name in ("velux", "konica")}
    roof = conclude(Search(Fitter(Scene(Readings.of(roof_case(tmp_path / "roof", bright))))))
    assert roof.level == pytest.approx(np.log(1.09), abs=1e-4)
    sky = Readings.of(sky_case(tmp_path / "sky"))
    brighter = sky_case(tmp_path / "brighter", 1.09 * sky.measured)
    assert conclude(Search(Fitter(Scene(Readings.of(brighter))))).level == 0.0


@pytest.mark.parametrize(("with_it", "kept"), [(0.02, True), (0.04, False)])
def test_an_error_that_left_out_tests_do_not_share_is_not_carried_over(
    tmp_path: Path, with_it: float, kept: bool
) -> None:
    fitter = Fitter(Scene(Readings.of(make_case(tmp_path / "case", tests=TESTS[:2]))))
    fit = fitter.fit((), np.zeros(0), MIDDLE)
    learned = _shared(fitter, fit, (), HeldOut("leave-one-test-out", 0.03, 0.03, (), with_it))
    assert bool(learned.systems) == kept
    assert not _shared(fitter, fit, (), None).systems


def test_a_prediction_of_darkness_is_refused(tmp_path: Path) -> None:
    case = sky_case(tmp_path / "case")
    dark = replace(case, records=replace(case.records, simulated=0.0 * case.records.simulated))
    with pytest.raises(DataError, match="no prediction is above zero"):
        explain(dark)


def test_a_folder_that_is_a_file_is_refused_before_anything_is_worked_out(tmp_path: Path, labdaq: Run) -> None:
    (tmp_path / "out").write_text("mine")
    code, _, err = labdaq("explain", tmp_path / "nowhere", "--out", tmp_path / "out")
    assert code == 64 and "is a file" in err
    assert (tmp_path / "out").read_text() == "mine"


def test_the_first_name_is_told_first_however_sure_a_further_one_is(arm: Scene) -> None:
    both = hypothesis(arm, 100.0, "dark-offset", "gamma-offset")
    both.fit.theta, both.fit.covariance = np.array([5.0, 1.0]), np.eye(2)
    found = Conclusion(both, hypothesis(arm, 0.0), [], verdict="explained")
    found.probability = {"dark-offset": 0.88, "gamma-offset": 0.96}
    told = _of_the_best(cast(Explanation, SimpleNamespace(conclusion=found)))
    assert [row["id"] for row in told] == ["dark-offset", "gamma-offset"]
