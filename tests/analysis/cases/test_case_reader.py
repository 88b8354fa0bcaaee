"""The reader of cases: a good one is read as it stands, each documented mistake is one clear error."""

from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import pytest

from analysis.cases import read_case
from analysis.cases.suns import with_suns
from labdaq.clock import utc_ns_of
from labdaq.errors import DataError
from tests.analysis.cases.small_case import CASE, RECORDS, small_case


def _refused(folder: Path, **how: str) -> str:
    with pytest.raises(DataError) as caught:
        read_case(small_case(folder, **how))
    assert caught.value.exit_code == 65
    return caught.value.message


def test_a_good_case_is_read_as_it_stands(tmp_path: Path) -> None:
    case = read_case(small_case(tmp_path))
    assert [t.id for t in case.tests] == ["T1", "T2"]
    r = case.records
    assert r.test.tolist() == [0, 0, 1]
    assert r.channel.tolist() == [0, 0, 1]
    assert r.utc_ns[0] == utc_ns_of(datetime(2010, 7, 22, 13, 12, 10, 500_000, tzinfo=UTC))
    assert r.utc_ns[2] == -1
    assert np.isnan(r.measured[1])
    assert np.isnan(r.gamma_deg[2])
    assert r.has_parts.tolist() == [True, True, False]
    assert case.system_of(case.tests[0]) is case.setup.system[0]
    assert case.system_of(case.tests[1]) is None
    assert case.distribution("simulated/sun.ies").candela.max() == 100.0


OPTIONAL = [
    line
    for line in CASE.splitlines()
    if line.split(" = ")[0] in {"title", "distance_m", "kind", "aperture", "system", "start", "end", "simulated"}
    and not line.startswith(('kind = "goniometer"', 'kind = "illuminance-meter"'))
]


@pytest.mark.parametrize("line", OPTIONAL)
def test_what_only_helps_may_be_missing(tmp_path: Path, line: str) -> None:
    """Format, channels and tests are required (docs/cases.md); what needs another fact is not tried without it."""
    assert len(OPTIONAL) == 8
    assert len(read_case(small_case(tmp_path, case=CASE.replace(line + "\n", "", 1))).tests) == 2


@pytest.mark.parametrize("without", [(), ("start", "end")])
def test_the_sun_of_a_test_that_says_where_and_when_is_computed(tmp_path: Path, without: tuple[str, ...]) -> None:
    """Against the report's table 5: the sun of its test 18 stood at 31.2 and 85.6 degrees."""
    text = "\n".join(line for line in CASE.splitlines() if not line.startswith(without)) if without else CASE
    first, second = with_suns(read_case(small_case(tmp_path / "case", case=text))).tests
    close = 0.5 if without else 0.1  # its two records lie in the first 20 s
    assert first.sun_altitude_deg == pytest.approx(31.17, abs=close)
    assert first.sun_azimuth_deg == pytest.approx(85.57, abs=close)
    assert second.sun_altitude_deg is None and second.sun_azimuth_deg is None  # no time
    told = text.replace('id = "T1"', 'id = "T1"\nsun_altitude_deg = 20.0\nsun_azimuth_deg = 90.0')
    given = with_suns(read_case(small_case(tmp_path / "told", case=told))).tests[0]
    assert (given.sun_altitude_deg, given.sun_azimuth_deg) == (20.0, 90.0)


CASE_MISTAKES = {
    "no format": ('format = "labdaq-case/1"', "", ["format"]),
    "another format": ("labdaq-case/1", "labdaq-case/9", ["format", "labdaq-case/1"]),
    "unit mismatch": ('unit = "fc"', 'unit = "cd"', ["channel 'roof'", "'cd' does not fit illuminance"]),
    "unknown unit": (
        'unit = "cd"',
        'unit = "lumen"',
        ["channel 'gonio.g45'", "'lumen' does not fit"],
    ),
    "channel twice": ('id = "roof"', 'id = "gonio.g45"', ["channel", "'gonio.g45' is given twice"]),
    "test twice": ('id = "T2"', 'id = "T1"', ["test", "'T1' is given twice"]),
    "no .ies": ("simulated/sky.ies", "simulated/sly.ies", ["test 'T1'", "there is no file simulated/sly.ies"]),
    "a time without zone": ("13:12:00Z", "13:12:00", ["test 'T1'.start", "timezone"]),
    "no time at all": ("2010-07-22T13:12:00Z", '"noon"', ["test 'T1'.start"]),
    "latitude beyond the pole": ("34.2176", "134.2", ["site.latitude_deg"]),
    "aperture without size": (", size_m = [0.6096, 0.6096]", "", ["aperture", "needs size_m"]),
    "unknown sky": ('id = "T2"', 'id = "T2"\nsky = "grey"', ["test 'T2'.sky"]),
    "a variant for no test": (
        'id = "T2"',
        'id = "T2"\n[[variant]]\nmechanism = "x"\nsimulated = { T9 = { total = "simulated/sun.ies" } }',
        ["variant.0", "'T9'"],
    ),
    "not TOML": ("[site]", "[site", ["not valid TOML", "line"]),
}


@pytest.mark.parametrize("name", CASE_MISTAKES)
def test_a_mistake_in_the_set_up_is_named(name: str, tmp_path: Path) -> None:
    old, new, words = CASE_MISTAKES[name]
    assert old in CASE
    message = _refused(tmp_path, case=CASE.replace(old, new, 1))
    assert "case.toml" in message
    for word in words:
        assert word in message


ROW = "T1,2010-07-22T13:12:10.5Z,gonio.g45,45,22.5,1000,3,990,600,390"
RECORD_MISTAKES = {
    "unknown column": ("measured,", "measurd,", ["header", "unknown column 'measurd'"]),
    "column twice": ("c_deg,measured", "c_deg,c_deg", ["header", "'c_deg' is given twice"]),
    "NaN in simulated": (ROW, ROW.replace("990", "nan"), ["row 2, column simulated", "'nan' is not a finite number"]),
    "infinite reading": (ROW, ROW.replace("1000", "inf"), ["row 2, column measured", "'inf'"]),
    "empty prediction": (ROW, ROW.replace("990", ""), ["row 2, column simulated"]),
    "words for numbers": (ROW, ROW.replace("1000", "1_000"), ["row 2, column measured", "'1_000'"]),
    "parts that do not add up": (ROW, ROW.replace("600,390", "600,300"), ["row 2", "900", "is not simulated = 990"]),
    "half a pair of parts": (ROW, ROW.replace("600,390", "600,"), ["row 2", "both or not at all"]),
    "unknown test": (ROW, ROW.replace("T1", "T7"), ["row 2, column test", "'T7' is not in case.toml"]),
    "unknown channel": (ROW, ROW.replace("g45", "g46"), ["row 2, column channel", "'gonio.g46'"]),
    "test without rows": ("T2,,roof,,,8000,20,7900,,\n", "", ["no row belongs to test 'T2'"]),
    "bad time": (ROW, ROW.replace("2010-07-22T13:12:10.5Z", "13:12"), ["row 2, column time", "'13:12'"]),
    "time without zone": (ROW, ROW.replace("10.5Z", "10.5"), ["row 2, column time", "time zone"]),
    "negative uncertainty": (ROW, ROW.replace(",3,", ",-3,"), ["row 2, column uncertainty", "negative"]),
    "a reading without uncertainty": (ROW, ROW.replace(",3,", ",,"), ["row 2, column uncertainty"]),
    "gamma beyond the zenith": (ROW, ROW.replace(",45,22.5", ",181,22.5"), ["row 2, column gamma_deg", "181"]),
    "a sensor without a direction": (ROW, ROW.replace(",45,22.5", ",,22.5"), ["row 2, column gamma_deg", "is empty"]),
    "a field too many": (ROW, ROW + ",1", ["row 2", "11 fields"]),
    "no records": (RECORDS.split("\n", 1)[1], "", ["there are no records"]),
    "an empty file": (RECORDS, "", ["the file is empty"]),
}


def test_a_bad_channel_is_told_once(tmp_path: Path) -> None:
    only = CASE.replace(CASE[CASE.index('[[channel]]\nid = "gonio') : CASE.index('[[channel]]\nid = "roof')], "")
    message = _refused(tmp_path, case=only.replace('unit = "fc"', 'unit = "cd"'))
    assert len(message.splitlines()) == 1, "that no channel is left follows from the first mistake"


def test_a_mark_in_front_of_the_file_is_no_mistake(tmp_path: Path) -> None:
    case = small_case(tmp_path)
    (case / "case.toml").write_text(CASE, encoding="utf-8-sig")
    assert read_case(case).setup.title == "small"


@pytest.mark.parametrize("name", RECORD_MISTAKES)
def test_a_mistake_in_the_records_is_named_with_row_and_column(name: str, tmp_path: Path) -> None:
    old, new, words = RECORD_MISTAKES[name]
    assert old in RECORDS
    message = _refused(tmp_path, records=RECORDS.replace(old, new, 1))
    assert "records.csv" in message
    for word in words:
        assert word in message


def test_all_mistakes_come_at_once_but_not_by_the_thousand(tmp_path: Path) -> None:
    message = _refused(tmp_path, records=RECORDS.replace("990", "nan").replace("T2", "T7").replace("8000", "x"))
    assert message.count("records.csv") == 4  # nan, two for the last row, and T2 without a row
    spoilt = RECORDS + (ROW.replace("990", "nan") + "\n") * 500
    message = _refused(tmp_path, records=spoilt)
    assert len(message.splitlines()) < 20
    assert "more" in message


@pytest.mark.parametrize("missing", ["case.toml", "records.csv"])
def test_a_missing_file_is_named(missing: str, tmp_path: Path) -> None:
    (small_case(tmp_path) / missing).unlink()
    with pytest.raises(DataError, match=f"{missing}: there is no such file"):
        read_case(tmp_path)


def test_what_is_no_folder_or_no_text_is_refused(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("x")
    with pytest.raises(DataError, match=r"case\.toml: there is no such file"):
        read_case(tmp_path / "file")
    case = small_case(tmp_path / "case")
    (case / "records.csv").write_bytes(b"test,\xff\xfe\n")
    with pytest.raises(DataError, match="not a CSV file"):
        read_case(case)
    (case / "records.csv").unlink()
    (case / "records.csv").mkdir()
    with pytest.raises(DataError, match=r"records\.csv: Is a directory"):
        read_case(case)


def test_an_ies_that_does_not_parse_is_named_with_its_line(tmp_path: Path) -> None:
    case = small_case(tmp_path)
    text = (case / "simulated" / "sun.ies").read_text()
    (case / "simulated" / "sun.ies").write_text(text.replace("100 100 100", "100 1oo 100", 1))
    with pytest.raises(DataError) as caught:
        read_case(case)
    assert "sun.ies" in caught.value.message
    assert "line" in caught.value.message


def test_a_prediction_needs_no_readings(tmp_path: Path) -> None:
    lines = [line.split(",") for line in RECORDS.splitlines()]
    text = "\n".join(",".join(f for i, f in enumerate(fields) if i not in (5, 6)) for fields in lines)
    small_case(tmp_path, records=text)
    case = read_case(tmp_path, need_measured=False)
    assert np.isnan(case.records.measured).all()
    with pytest.raises(DataError, match="'measured' is missing"):
        read_case(tmp_path)


def test_keys_the_format_does_not_know_are_kept_aside(tmp_path: Path) -> None:
    case = read_case(small_case(tmp_path, case=CASE + 'remark = "windy"\n'))
    assert (case.tests[1].model_extra or {})["remark"] == "windy"
