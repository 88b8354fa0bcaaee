"""Tables become cases by a recipe; every mistake of recipe or table is told with its place."""

import csv
from pathlib import Path

import numpy as np
import pytest

from analysis.cases import Case, read_case
from analysis.compare.from_tables import case_from_tables
from analysis.compare.recipe import Recipe, find_recipe
from labdaq.config import parse
from labdaq.errors import ConfigError, DataError
from labdaq.units import LUX_PER_FOOTCANDLE
from tests.analysis.recordings import recording

RECIPE = """
format = "labdaq-recipe/1"
title = "two meters"
[site]
latitude_deg = 34.2
longitude_deg = -82.1
[[channel]]
id = "roof"
kind = "illuminance-meter"
quantity = "illuminance"
unit = "lx"
[[table]]
name = "readings"
columns = ["no", "meter fc"]
missing = ["-"]
skip = [{ column = "no", is = ["mean"] }]
time = { format = "%d.%m.%Y %H:%M", zone = "America/New_York" }
[table.test]
id = "T{no}"
start = "{day} {from}"
sky = { text = "{sky}", words = { "sunny" = "clear", "grey" = "overcast" } }
sun_altitude_deg = "90 - zenith"
global_illuminance = [{ value = "`meter fc`", unit = "fc" }, "model"]
[[table.record]]
channel = "roof"
time = "{day} {from}"
measured = { value = "`meter fc`", unit = "fc" }
uncertainty = [{ value = "0.003 * `meter fc`", unit = "fc" }, 4]
simulated = "model"
simulated_sun = "model - shaded"
simulated_sky = "shaded"
"""
TABLE = """\
no,day,from,sky,zenith,meter fc,model,shaded
1,22.07.2010,09:12,sunny,60,1000,11000,4000
2,22.07.2010,13:05,grey,20.5,-,9000,9000
mean,,,,,1000,10000,
"""


def _recipe(text: str = RECIPE) -> Recipe:
    return parse(text, Recipe, "my-recipe.toml")


def _table(folder: Path, text: str = TABLE) -> Path:
    path = folder / "readings.csv"
    path.write_text(text, encoding="utf-8")
    return path


def test_a_table_becomes_a_case(tmp_path: Path) -> None:
    case = case_from_tables(_recipe(), [_table(tmp_path)]).write(tmp_path / "case")
    first, second = case.tests
    assert (first.id, second.id) == ("T1", "T2")
    assert first.start is not None
    assert first.start.isoformat() == "2010-07-22T13:12:00+00:00"  # 09:12 in summer time
    assert (first.sky, second.sky) == ("clear", "overcast")
    assert (first.sun_altitude_deg, second.sun_altitude_deg) == (30.0, 69.5)
    assert first.global_illuminance_lx == pytest.approx(1000 * LUX_PER_FOOTCANDLE, rel=1e-12)
    assert second.global_illuminance_lx == 9000  # the first that is known
    r = case.records
    assert r.measured[0] == pytest.approx(10763.910, abs=1e-3)
    assert np.isnan(r.measured[1])
    assert np.isnan(r.uncertainty[1])
    assert r.uncertainty[0] == pytest.approx(np.hypot(0.003 * 10763.910, 4))
    assert r.sun.tolist() == [7000.0, 0.0]
    assert r.utc_ns[0] == int(first.start.timestamp()) * 10**9
    assert np.isnan(r.gamma_deg).all()


RECIPE_MISTAKES = {
    "a format of tomorrow": ("labdaq-recipe/1", "labdaq-recipe/2", ["format", "labdaq-recipe/1"]),
    "an unknown key": ("missing =", "misssing =", ["table[readings].misssing", "did you mean 'missing'"]),
    "a broken expression": ('"90 - zenith"', '"90 - "', ["sun_altitude_deg", "is expected at the end"]),
    "a broken template": ('"T{no}"', '"T{no"', ["table[readings].test.id", "braces"]),
    "no such zone": ("America/New_York", "Greenwood", ["table[readings].time", "no time zone 'Greenwood'"]),
    "a wrong unit": ('"`meter fc`", unit = "fc" }\nunc', '"`meter fc`", unit = "cd" }\nunc', ["'cd'", "into lx"]),
    "no such unit": ('[{ value = "0.003 * `meter fc`", unit = "fc" }', '[{ value = "1", unit = "%" }', ["'%'"]),
    "no such channel": ('channel = "roof"', 'channel = "root"', ["'readings', record of 'root'", "there are roof"]),
    "a sky we have no word for": ('"overcast"', '"grey"', ["'grey' is not one of clear"]),
    "half a pair of parts": ('simulated_sky = "shaded"', "", ["simulated_sun and simulated_sky go together"]),
    "a reading without uncertainty": ("uncertainty =", "#", ["measured and uncertainty go together"]),
    "a unit that the quantity has not": ('unit = "lx"', 'unit = "cd"', ["channel[roof]", "'cd' does not fit"]),
    "both ways to skip": ('is = ["mean"]', 'is = ["mean"], empty = true', ["skip", "either empty"]),
    "nothing to know it by": ('columns = ["no", "meter fc"]', "", ["recognised"]),
    "not TOML": ("[site]", "[site", ["not valid TOML"]),
}


@pytest.mark.parametrize("name", RECIPE_MISTAKES)
def test_a_mistake_in_a_recipe_is_named(name: str) -> None:
    old, new, words = RECIPE_MISTAKES[name]
    assert old in RECIPE
    with pytest.raises(ConfigError) as caught:
        _recipe(RECIPE.replace(old, new, 1))
    assert "my-recipe.toml" in caught.value.message
    for word in words:
        assert word in caught.value.message


def test_all_mistakes_of_a_recipe_come_at_once() -> None:
    spoilt = RECIPE.replace('"T{no}"', "7").replace('"90 - zenith"', '"90 ^ zenith"').replace("latitude_deg", "lat")
    with pytest.raises(ConfigError) as caught:
        _recipe(spoilt)
    assert len(caught.value.message.splitlines()) == 3


TABLE_MISTAKES = {
    "not a number": ("11000", "11,0e", ["row 2", "9 fields"]),
    "a word for a number": ("11000", "many", ["row 2, column 'model'", "'many' is not a number"]),
    "infinite": ("11000", "inf", ["row 2, column 'model'"]),
    "no prediction": ("11000", "", ["row 2", "the prediction (model) is missing", "skip"]),
    "a strange time": ("09:12", "9.12am", ["row 2, column 'day'", "'22.07.2010 9.12am'", "%d.%m.%Y %H:%M"]),
    "a strange sky": ("grey", "gray", ["row 3, column 'sky'", "'gray'", "sunny, grey"]),
    "a sun below the earth": (",60,", ",260,", ["test 'T1', sun_altitude_deg"]),
    "a test told twice": ("\n2,", "\n1,", ["row 3", "test 'T1' has"]),
    "a column that is gone": ("shaded\n", "shade\n", ["no column 'shaded'", "'readings'"]),
    "not recognised": ("meter fc", "meter fcd", ["fits no table", "needs column 'meter fc' (there is 'meter fcd')"]),
    "a column twice": ("zenith", "model", ["header", "'model' is given twice"]),
    "a test without a name": ("\n1,", "\n,", ["row 2", "no name"]),
    "empty": (TABLE, "", ["it is empty"]),
    "nothing but skipped rows": (TABLE[TABLE.index("1,22") : TABLE.index("mean")], "", ["no row is left"]),
}


@pytest.mark.parametrize("name", TABLE_MISTAKES)
def test_a_mistake_in_a_table_is_named_with_row_and_column(name: str, tmp_path: Path) -> None:
    old, new, words = TABLE_MISTAKES[name]
    assert old in TABLE
    with pytest.raises(DataError) as caught:
        case_from_tables(_recipe(), [_table(tmp_path, TABLE.replace(old, new, 1))])
    assert "readings.csv" in caught.value.message
    for word in words:
        assert word in caught.value.message


def test_a_division_by_zero_and_a_missing_zone_are_told(tmp_path: Path) -> None:
    recipe = RECIPE.replace('simulated_sky = "shaded"', 'simulated_sky = "shaded / (zenith - 60)"')
    with pytest.raises(DataError, match=r"row 2: 'shaded / .*' divides by zero"):
        case_from_tables(_recipe(recipe), [_table(tmp_path)])
    recipe = RECIPE.replace(', zone = "America/New_York"', "")
    with pytest.raises(DataError, match=r"row 2, column 'day': .* has no time zone"):
        case_from_tables(_recipe(recipe), [_table(tmp_path)])


def test_missing_and_superfluous_files_are_told(tmp_path: Path) -> None:
    with pytest.raises(DataError, match="no file for table 'readings'"):
        case_from_tables(_recipe(), [])
    with pytest.raises(DataError, match=r"nothing\.csv: cannot be read"):
        case_from_tables(_recipe(), [tmp_path / "nothing.csv"])
    (tmp_path / "picture.csv").write_bytes(b"\x89PNG\x00\xff")
    with pytest.raises(DataError, match=r"picture\.csv: not a CSV file"):
        case_from_tables(_recipe(), [_table(tmp_path), tmp_path / "picture.csv"])


def test_tables_with_other_habits_are_read(tmp_path: Path) -> None:
    recipe = RECIPE.replace(
        'missing = ["-"]', 'missing = ["-"]\ndelimiter = ";"\ndecimal = ","\nlines_before_header = 2'
    )
    text = "written by hand\n\n" + TABLE.replace(",", ";").replace("20.5", "20,5")
    case = case_from_tables(_recipe(recipe), [_table(tmp_path, text)]).write(tmp_path / "case")
    assert case.tests[1].sun_altitude_deg == 69.5


def test_a_recipe_is_found_by_its_name() -> None:
    assert find_recipe("greenwood-zenith").channel[0].id == "sky.zenith"
    with pytest.raises(ConfigError, match="greenwood-roof-meters, greenwood-zenith"):
        find_recipe("greenwood")
    with pytest.raises(ConfigError, match=r"nowhere/x\.toml: cannot be read"):
        find_recipe("nowhere/x.toml")


def _rows(name: str) -> list[dict[str, str]]:
    with recording(name).open(newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))


def test_the_zenith_at_greenwood(tmp_path: Path) -> None:
    rows = _rows("greenwood-tests.csv")
    draft = case_from_tables(find_recipe("greenwood-zenith"), [recording("greenwood-tests.csv")])
    case = draft.write(tmp_path / "case")
    assert [t.id for t in case.tests] == [f"T{k}" for k in range(1, 33)]
    # the report prints meter over picture in per cent, rounded
    printed = [float(row["pct_diff_raw"].rstrip("%")) for row in rows]
    ratio = 100 * case.records.measured / case.records.simulated
    np.testing.assert_allclose(ratio, printed, atol=0.51)
    assert [t.sky for t in case.tests].count("partly-cloudy") == 8
    assert {t.system for t in case.tests} == {"top", "box", "tube"}
    assert all(t.global_illuminance_lx and t.diffuse_illuminance_lx for t in case.tests)
    t3, t20 = case.tests[2], case.tests[19]
    assert t3.global_illuminance_lx == pytest.approx(9758 * LUX_PER_FOOTCANDLE)  # only the Velux meter read
    assert t20.global_illuminance_lx == pytest.approx(7193.8 * LUX_PER_FOOTCANDLE)  # both did
    assert case.records.gamma_deg.tolist() == [180.0] * 32
    assert 0.0019 < (case.records.uncertainty / case.records.measured).min() < 0.0021


def _roof_meters(tmp_path: Path, *names: str) -> Case:
    draft = case_from_tables(find_recipe("greenwood-roof-meters"), [recording(name) for name in names])
    return draft.write(tmp_path / "case")


def test_the_roof_meters_at_greenwood(tmp_path: Path) -> None:
    before, after = (f"greenwood-meter-comparison-{w}-levelling.csv" for w in ("before", "after"))
    case = _roof_meters(tmp_path, after, "greenwood-tests.csv", before)  # in any order
    ids = [t.id for t in case.tests]
    assert sorted(ids) == sorted([f"T{k}" for k in range(20, 27)] + [f"Set {k}" for k in range(1, 5)])
    r = case.records
    assert len(r) == 7 + 9 + 9 + 10 + 10
    # the means at the foot of tables 7 and 8 are printed in whole footcandles; the row "average" itself is left out
    printed = {"Set 1": (8141, 8729), "Set 2": (6244, 6006), "Set 3": (6661, 6706), "Set 4": (9111, 9399)}
    for name, (cltc, velux) in printed.items():
        rows = r.test == ids.index(name)
        assert r.simulated[rows].mean() == pytest.approx(cltc, abs=0.51)
        assert r.measured[rows].mean() == pytest.approx(velux, abs=0.51)
        assert (r.utc_ns[rows] == -1).all()
    tests = r.where(np.isin(r.test, [ids.index(f"T{k}") for k in range(20, 27)]))
    ratio = tests.measured / tests.simulated
    assert ratio[0] == pytest.approx(1.0200, abs=1e-4)
    assert ratio[-1] == pytest.approx(1.0285, abs=1e-4)
    assert tests.has_parts.all()
    assert (tests.utc_ns > 0).all()
    assert (np.diff(tests.utc_ns) > 0).all()
    # means of five readings are known better than single ones
    single = r.uncertainty[r.test == ids.index("Set 4")] / r.measured[r.test == ids.index("Set 4")]
    assert (tests.uncertainty / tests.measured).max() < single.min() / 2
    assert read_case(tmp_path / "case").channels[0].unit == "fc"


def test_the_tests_alone_make_a_case_too(tmp_path: Path) -> None:
    recipe = find_recipe("greenwood-roof-meters")
    draft = case_from_tables(recipe, [recording("greenwood-tests.csv")])
    assert len(draft.records) == 7
    assert draft.notes == ("no file was given for table 'calibration sets'",)
