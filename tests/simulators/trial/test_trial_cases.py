"""Cases: every cause can be concealed, has the effect that was asked for, and leaves files after the contract."""

import csv
import io
import json
import math
import tomllib
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from simulators.trial import generate, sky, truth
from simulators.trial.kinds import STAGES, inside, outside
from simulators.trial.made import Made, Order
from simulators.trial.plan import CONTENTS, plan
from simulators.trial.shelf import Shelf

COLUMNS = ["test", "time", "channel", "gamma_deg", "c_deg", "measured", "uncertainty"]
COLUMNS += ["simulated", "simulated_sun", "simulated_sky"]

CONTRACT = """
sky-sun-ratio circumsolar-aureole cloud-drift lens-haze lens-anisotropy lens-orientation soiling wall-reflectance
bounce-truncation wall-scatter room-interreflection stray-light near-field gamma-offset c-offset c-handedness
channel-swap dark-offset nonlinearity saturation cosine-response channel-gain clock-offset meter-tilt meter-gain
meter-cosine meter-range-limit vignetting veiling-glare spectral-mismatch exposure-error projection-error
"""


@pytest.fixture(scope="module")
def shelf(tmp_path_factory: pytest.TempPathFactory) -> Shelf:
    # three hundred rays for each sun leave coarse skylights, but the same ones on both sides
    return Shelf(tmp_path_factory.mktemp("responses"), rays_per_node=300)


def _some_slow(causes: Iterable[str]) -> list[Any]:
    """Six of seven causes are left to the slow proofs."""
    return [pytest.param(cause, marks=pytest.mark.slow) if k % 7 else cause for k, cause in enumerate(causes)]


def _order(kind: str, *causes: str, seed: int = 1, wanted: float = 0.03, withhold: bool = False) -> Order:
    content = ("null", "single", "pair")[len(causes)]
    if causes and causes[0] in outside(kind):
        content = "open"
    return Order("case-0", kind, content, causes, (wanted,) * len(causes), seed, withhold, designs=("tube",))


def _rows(text: str) -> list[dict[str, str]]:
    return list(csv.DictReader(io.StringIO(text)))


def _check_files(made: Made) -> None:
    case = tomllib.loads(made.files["case.toml"])
    assert case["format"] == "labdaq-case/1"
    rows = _rows(made.files["records.csv"])
    assert list(rows[0]) == COLUMNS
    assert len(rows) == len(made.truth.clean) == len(made.truth.change)
    tests, channels = {t["id"] for t in case["test"]}, {c["id"] for c in case["channel"]}
    assert {r["test"] for r in rows} == tests
    assert {r["channel"] for r in rows} <= channels
    for row in rows:
        assert math.isfinite(float(row["simulated"])) and float(row["uncertainty"]) > 0.0
        if row["simulated_sun"]:
            assert float(row["simulated_sun"]) + float(row["simulated_sky"]) == pytest.approx(
                float(row["simulated"]), rel=1e-9
            )
        if row["gamma_deg"]:
            assert 0.0 <= float(row["gamma_deg"]) <= 180.0 and 0.0 <= float(row["c_deg"]) < 360.0
    for test in case["test"]:
        assert test["start"] < test["end"]
        for name in test.get("simulated", {}).values():
            assert name in made.files
        mine = [r for r in rows if r["test"] == test["id"]]
        assert f"{test['start']:%Y-%m-%dT%H:%M:%S}" <= mine[0]["time"][:19]
        assert mine[-1]["time"][:19] <= f"{test['end']:%Y-%m-%dT%H:%M:%S}"
    for variant in case.get("variant", []):
        assert variant["mechanism"] in STAGES["goniometer"] and variant["setting"]
        for table in variant["simulated"].values():
            assert {table["sun"], table["sky"]} <= set(made.files)


def _check_truth(made: Made, wanted: float) -> None:
    concealed = made.truth.concealed
    assert [c.id for c in concealed] == list(made.order.conceal) or made.order.content == "open"
    assert made.truth.clean and all(math.isfinite(x) for x in made.truth.clean)
    for c in concealed:
        assert c.parameters and all(math.isfinite(v) for v, _ in c.parameters.values())
        assert c.effect_percent > 0.04
    if len(concealed) == 1:
        rms = 100.0 * math.sqrt(np.mean(np.square(made.truth.change)))
        assert rms == pytest.approx(made.truth.effect_percent, rel=0.01)
        assert made.truth.effect_percent == pytest.approx(concealed[0].effect_percent, rel=0.25)
        assert wanted > 0.0


@pytest.mark.parametrize("cause", _some_slow(inside("goniometer")))
def test_a_goniometer_can_conceal(cause: str, shelf: Shelf) -> None:
    made = generate.make(_order("goniometer", cause), shelf)
    _check_files(made)
    _check_truth(made, 0.03)
    fixed = {"near-field", "c-handedness", "channel-swap", "bounce-truncation", "clock-offset", "lens-orientation"}
    if cause not in fixed:  # these come in steps, or as they are
        assert made.truth.concealed[0].effect_percent == pytest.approx(3.0, rel=0.2)


@pytest.mark.parametrize("cause", _some_slow(outside("goniometer")))
def test_a_goniometer_can_conceal_what_no_catalogue_has(cause: str, shelf: Shelf) -> None:
    made = generate.make(_order("goniometer", cause), shelf)
    _check_files(made)
    _check_truth(made, 0.03)
    assert not made.truth.concealed[0].inside


@pytest.mark.parametrize("cause", [*_some_slow(inside("roof")), *_some_slow(outside("roof"))])
def test_a_roof_meter_can_conceal(cause: str, shelf: Shelf) -> None:
    made = generate.make(_order("roof", cause, seed=4), shelf)
    _check_files(made)
    _check_truth(made, 0.03)
    assert made.truth.concealed[0].inside == (cause in inside("roof"))


@pytest.mark.parametrize("cause", [*_some_slow(inside("camera")), *_some_slow(outside("camera"))])
def test_a_camera_can_conceal(cause: str, shelf: Shelf) -> None:
    made = generate.make(_order("camera", cause, seed=7), shelf)
    _check_files(made)
    _check_truth(made, 0.03)


def test_the_catalogue_is_complete() -> None:
    contract = set(CONTRACT.split())
    assert len(contract) == 32
    assert {name for kind in STAGES.values() for name in kind} == contract


def test_no_picture_is_without_a_reading_where_the_sun_is_in_the_zenith() -> None:
    """A campaign of the blind trial, one of whose suns stood within 8 degrees of the only direction: no answer.

    So it was with one of 300 seeds.
    """
    for seed in (142, *range(20)):
        campaign = sky.draw(np.random.default_rng(seed))
        assert campaign.tests and all(len(test.directions) for test in campaign.tests), seed


@pytest.mark.parametrize("kind", ["goniometer", "roof", "camera"])
def test_nothing_concealed_leaves_only_what_is_always_there(kind: str, shelf: Shelf) -> None:
    made = generate.make(_order(kind, seed=11), shelf)
    _check_files(made)
    assert made.truth.concealed == () and made.truth.effect_percent == 0.0
    assert not any(made.truth.change)
    assert made.truth.mismatch_percent == pytest.approx(made.truth.nuisance_percent)
    rows = [r for r in _rows(made.files["records.csv"]) if r["measured"]]
    measured = np.array([float(r["measured"]) for r in rows])
    sigma = np.array([float(r["uncertainty"]) for r in rows])
    if kind == "goniometer":
        clean = np.array(made.truth.clean)[[bool(r["measured"]) for r in _rows(made.files["records.csv"])]]
        tests = np.array([r["test"] for r in rows])
        pulls = []
        for test in np.unique(tests):  # the test's gain is taken off, the sensors' 1 % stay
            mine = tests == test
            gain = np.median(measured[mine] / clean[mine])
            pulls.append((measured[mine] - gain * clean[mine]) / np.hypot(sigma[mine], 0.012 * clean[mine]))
        assert 0.6 < np.std(np.concatenate(pulls)) < 1.4


def test_a_pair_conceals_both(shelf: Shelf) -> None:
    made = generate.make(_order("goniometer", "gamma-offset", "dark-offset", wanted=0.05), shelf)
    _check_files(made)
    assert {c.id for c in made.truth.concealed} == {"gamma-offset", "dark-offset"}
    single = max(c.effect_percent for c in made.truth.concealed)
    assert made.truth.effect_percent > 0.8 * single


def test_an_order_gives_one_case_and_another_seed_another(shelf: Shelf) -> None:
    for kind in ("goniometer", "roof", "camera"):
        first, again = (generate.make(_order(kind, seed=5), shelf) for _ in range(2))
        assert first.files == again.files and first.truth == again.truth
        assert generate.make(_order(kind, seed=6), shelf).files["records.csv"] != first.files["records.csv"]


def test_withheld_tests_have_no_readings_and_are_nowhere_else(shelf: Shelf) -> None:
    made = next(
        m
        for m in (generate.make(_order("goniometer", "c-offset", seed=s, withhold=True), shelf) for s in range(9))
        if m.withheld
    )
    held, kept = (_rows(files["records.csv"]) for files in (made.withheld, made.files))
    assert not any(r["measured"] for r in held)
    assert not {r["test"] for r in held} & {r["test"] for r in kept}
    assert len(held) == len(made.truth.withheld_clean)
    names = {t["id"] for t in tomllib.loads(made.withheld["case.toml"])["test"]}
    assert names == {r["test"] for r in held}
    systems = {t["system"] for t in tomllib.loads(made.files["case.toml"])["test"]}
    assert {t["system"] for t in tomllib.loads(made.withheld["case.toml"])["test"]} <= systems


def test_simulated_files_can_be_read_by_others_and_agree_with_the_records(shelf: Shelf, tmp_path: Path) -> None:
    photompy = pytest.importorskip("photompy")
    made = next(
        m
        for m in (generate.make(_order("goniometer", seed=s), shelf) for s in range(20))
        if "variant" in m.files["case.toml"]
    )
    case = tomllib.loads(made.files["case.toml"])
    test = case["test"][0]
    rows = [r for r in _rows(made.files["records.csv"]) if r["test"] == test["id"] and r["simulated_sky"]]
    path = tmp_path / "sky.ies"
    path.write_text(made.files[test["simulated"]["sky"]], newline="")
    read = photompy.IESFile.read(path).photometry
    nadir = [read.get_intensity(0.0, c) for c in (0.0, 90.0, 200.0)]
    said = [float(r["simulated_sky"]) for r in rows if r["gamma_deg"] == "0"]
    if said:  # the grid is linear between 2.5 degrees and the sky drifts by some per mille in the scan
        assert float(np.mean(nadir)) == pytest.approx(float(np.mean(said)), rel=0.03)


def test_truths_survive_the_disk(shelf: Shelf, tmp_path: Path) -> None:
    made = generate.make(_order("goniometer", "stray-light", seed=3), shelf)
    truth.write(made.truth, tmp_path / "t.json")
    again = truth.read(tmp_path / "t.json")
    assert again.concealed[0].id == "stray-light"
    assert again.clean == pytest.approx(made.truth.clean, rel=1e-6)
    assert again.concealed[0].parameters == made.truth.concealed[0].parameters
    (tmp_path / "t.json").write_text(json.dumps({"format": "other"}))
    with pytest.raises(Exception, match="format"):
        truth.read(tmp_path / "t.json")


def test_cases_are_written_whole_with_names_that_tell_nothing(shelf: Shelf, tmp_path: Path) -> None:
    orders = plan(3, 5, ("roof",))
    generate.write_all(orders, shelf, tmp_path / "cases", tmp_path / "truth")
    assert {p.name for p in (tmp_path / "truth").iterdir()} == {f"{o.name}.json" for o in orders}
    for order in orders:
        text = (tmp_path / "cases" / order.name / "case.toml").read_text()
        assert str(order.seed) not in text
        assert not any(cause in text for cause in order.conceal)
    assert not [p for p in (tmp_path / "cases").iterdir() if p.name.startswith(".")]


def test_a_plan_is_fair_and_repeatable() -> None:
    orders = plan(400, 17)
    assert orders == plan(400, 17) and orders != plan(400, 18)
    assert len({o.name for o in orders}) == len({o.seed for o in orders}) == 400
    for content, share in CONTENTS.items():
        assert sum(o.content == content for o in orders) == pytest.approx(400 * share, abs=2)
    singles = {(o.kind, o.conceal[0]) for o in orders if o.content == "single"}
    assert singles == {(kind, name) for kind in STAGES for name in inside(kind)}
    opens = {(o.kind, o.conceal[0]) for o in orders if o.content == "open"}
    assert opens == {(kind, name) for kind in STAGES for name in outside(kind)}
    for order in orders:
        if order.content == "pair":
            a, b = (STAGES[order.kind][name] for name in order.conceal)
            assert a != b
    effects = np.array([e for o in orders if o.content == "single" for e in o.effects])
    assert effects.min() >= 0.003 and effects.max() <= 0.15
    assert np.mean(effects < math.sqrt(0.003 * 0.15)) == pytest.approx(0.5, abs=0.12)
