"""The pages of docs/findings and what computes their numbers."""

import sys
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from tests.analysis.recordings import recording

HOME = Path(__file__).parents[2]
PAGES = ("roof-meters", "zenith", "figure-90")


@pytest.fixture(autouse=True)
def benchmarks() -> Iterator[None]:
    sys.path.insert(0, str(HOME / "benchmarks"))
    yield
    sys.path.remove(str(HOME / "benchmarks"))


@pytest.mark.parametrize("page", PAGES)
def test_a_page_has_a_computed_part_and_its_command(page: str) -> None:
    import explain_findings

    text = (HOME / "docs" / "findings" / f"{page}.md").read_text(encoding="utf-8")
    assert f"python3 dev.py findings {page} DATA_DIR" in text
    changed = explain_findings.with_part(text, page, "NEW")
    head, tail = changed.split("\n\nNEW\n\n")
    assert text.startswith(head)
    assert text.endswith(tail)
    assert explain_findings.with_part(changed, page, "NEW") == changed


def test_a_page_without_marks_is_not_overwritten() -> None:
    import explain_findings

    with pytest.raises(ValueError, match="marks"):
        explain_findings.with_part("nothing here", "zenith", "NEW")


def invented_zenith(seed: int) -> dict[str, Any]:
    """Sixteen clear and sixteen cloudy tests over two days, the camera 30 % too bright on clear sky."""
    rng = np.random.default_rng(seed)
    cloudy, camera = np.arange(32) % 2 == 1, rng.uniform(2000.0, 30000.0, 32)
    meter = camera * np.where(cloudy, 1.0, 1.0 / 1.3) * np.exp(0.01 * rng.standard_normal(32))
    return {
        "test": [f"T{k}" for k in range(32)],
        "day": np.where(np.arange(32) < 16, "21", "22"),
        "sky": np.where(cloudy, "partly cloudy", "clear"),
        "meter": meter,
        "camera": camera,
        "cloud": np.where(cloudy, 0.3, 0.02),
        "altitude": rng.uniform(20.0, 75.0, 32),
        "mean": rng.uniform(4000.0, 12000.0, 32),
    }


def test_the_law_that_holds_is_the_best_on_left_out_tests() -> None:
    import explain_greenwood as greenwood

    table = invented_zenith(1)
    error = {}
    for name, law in greenwood.LAWS.items():
        left = greenwood.held_out(law, table, np.array(table["test"]))
        assert left is not None
        error[name] = float(np.sqrt(np.mean(left**2)))
    true = "a factor for clear, one for partly cloudy skies"
    # noise of 1 %, and two fitted factors
    assert error[true] == pytest.approx(0.01, rel=0.4)
    assert error["one factor"] > 0.1
    assert error["no law: the camera is right"] > 0.15


def test_what_the_other_skies_cannot_tell_is_not_made_up() -> None:
    import explain_greenwood as greenwood

    table = invented_zenith(2)
    law = greenwood.LAWS["a factor for clear, one for partly cloudy skies"]
    assert greenwood.held_out(law, table, table["sky"]) is None
    assert greenwood.held_out(law, table, table["day"]) is not None


def test_the_twelve_tests_and_the_room_are_the_reports() -> None:
    import explain_figure90_station as figure

    data = recording("greenwood-tests.csv").parent
    tests = {t.number: t for t in figure.planned(data)}
    assert len(tests) == 12
    # table 5: test 18 has 4247.2 fc global and 1611.2 fc diffuse; test 9, above the range, 10944 and 3128 fc
    assert tests[18].global_lx == pytest.approx(45717.0, rel=1e-4)
    assert tests[18].diffuse_lx == pytest.approx(17343.0, rel=1e-4)
    assert tests[9].global_lx == figure.METER_ENDS_LX
    assert tests[9].diffuse_lx / tests[9].global_lx == pytest.approx(3128.0 / 10944.0, rel=1e-6)
    # table 6: averages 1.76 over 37.73 and 0.55 over 36.78
    assert figure.room_of_table_6(data) == pytest.approx((0.0466, 0.0150), abs=1e-4)


def test_the_world_has_the_tables_illuminances() -> None:
    import explain_figure90_station as figure

    from labdaq.clock import NS, utc_ns_of

    data = recording("greenwood-tests.csv").parent
    (test,) = (t for t in figure.planned(data) if t.number == 18)
    world = figure.world(test, (0.0, 0.0))
    seen = world.roof_illuminance(np.array([0.0, 0.0, 1.0]), utc_ns_of(test.start) + 90 * NS)
    # the sky is worked out at whole minutes and interpolated
    assert seen == pytest.approx(test.global_lx, rel=0.002)


def test_causes_add_up_to_the_whole_difference() -> None:
    import explain_figure90 as figure

    rng = np.random.default_rng(3)
    gamma, test = np.tile([0.0, 45.0, 85.0], 8), np.repeat([0, 1], 12)

    def case() -> Any:
        columns = {"test": test, "gamma_deg": gamma, "measured": rng.uniform(1.0, 2.0, 24)}
        records = SimpleNamespace(**columns, simulated=rng.uniform(1.0, 2.0, 24))
        return SimpleNamespace(records=records, tests=[SimpleNamespace(id="T1"), SimpleNamespace(id="T2")])

    one, exact, unlimited = case(), case(), case()
    rooms = {"T1": rng.uniform(0.0, 0.3, 12), "T2": rng.uniform(0.0, 0.3, 12)}
    told = figure.shares(one, exact, unlimited, rooms)
    rows = np.flatnonzero((test == 1) & (gamma == 85.0))
    seen = one.records.measured[rows].mean()
    assert told["T2"]["total"][2] == pytest.approx(100.0 * (one.records.simulated[rows].mean() / seen - 1.0))
    assert told["T2"]["room"][2] == pytest.approx(-100.0 * rooms["T2"][rows - 12].mean() / seen)
    for parts in told.values():
        added = np.sum([parts[name] for name in ("room", "limit", "field", "rest")], axis=0)
        assert added == pytest.approx(parts["total"])


def test_limits_leave_to_the_walls_what_lenses_do_not_take() -> None:
    import explain_figure90 as figure

    radiance = figure.ENGINES[0]
    assert [radiance.wall_bounces(s) for s in ("top", "box", "tube")] == [11, 10, 10]
