"""The writer of cases: what is written reads back the same, or nothing is written."""

import tomllib
from datetime import UTC, date, datetime, timedelta, timezone
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from analysis.cases import Records, read_case, write_case
from analysis.cases.model import UNITS, CaseFile
from analysis.cases.toml_text import toml_text
from analysis.cases.write import as_table
from labdaq.errors import DataError, StorageError
from tests.analysis.cases.small_case import ies, small_case

numbers = st.floats(allow_nan=False, allow_infinity=False)
texts = st.text(st.characters(exclude_categories=["Cs"]), max_size=20)
names = st.text(st.characters(min_codepoint=33, max_codepoint=0x2FF, exclude_categories=["Cs", "Cc", "Z"]), min_size=1)
moments = st.datetimes(datetime(1971, 1, 1), datetime(2200, 1, 1)).map(lambda d: d.replace(tzinfo=UTC))  # noqa: DTZ001

values = st.recursive(
    st.none() | st.booleans() | st.integers(-(2**63), 2**63 - 1) | numbers | texts | moments | st.dates(),
    lambda inner: (
        st.lists(inner.filter(lambda v: v is not None), max_size=3) | st.dictionaries(texts, inner, max_size=3)
    ),
    max_leaves=8,
)


def _without_none(value: Any) -> Any:
    if isinstance(value, dict):
        return {k: _without_none(v) for k, v in value.items() if v is not None}
    return [_without_none(v) for v in value] if isinstance(value, list) else value


@given(st.dictionaries(texts, values, max_size=5))
def test_toml_reads_back_what_was_written(table: dict[str, Any]) -> None:
    assert tomllib.loads(toml_text(table)) == _without_none(table)


def test_toml_looks_as_a_person_would_write_it() -> None:
    table = {
        "a": 1.0,
        "site": {"x": True, "deep": {"y": [1, 2]}},
        "test": [{"id": 'T"1', "day": date(2010, 7, 22)}, {"id": "T2"}],
        "when": datetime(2010, 7, 22, 9, 12, tzinfo=timezone(timedelta(hours=-4))),
        "n": np.float64(0.1),
    }
    assert toml_text(table) == (
        "a = 1.0\nwhen = 2010-07-22T13:12:00Z\nn = 0.1\n\n[site]\nx = true\ndeep = { y = [1, 2] }\n\n"
        '[[test]]\nid = "T\\"1"\nday = 2010-07-22\n\n[[test]]\nid = "T2"\n'
    )
    with pytest.raises(DataError, match=r"a\.b: a complex"):
        toml_text({"a": {"b": 1j}})


@st.composite
def cases(draw: st.DrawFn) -> tuple[CaseFile, Records]:
    quantities = draw(st.lists(st.sampled_from(sorted(UNITS)), min_size=1, max_size=3))
    kinds = {"luminous_intensity": "goniometer", "illuminance": "illuminance-meter", "luminance": "camera"}
    channel_ids = draw(st.lists(names, min_size=len(quantities), max_size=len(quantities), unique=True))
    channels = [
        {"id": i, "kind": kinds[q], "quantity": q, "unit": draw(st.sampled_from(UNITS[q]))}
        for i, q in zip(channel_ids, quantities, strict=True)
    ]
    tests = [
        {"id": i, "title": draw(texts), "start": draw(moments), "sun_altitude_deg": draw(st.floats(-90, 90))}
        for i in draw(st.lists(names, min_size=1, max_size=3, unique=True))
    ]
    setup = CaseFile.model_validate(
        {
            "format": "labdaq-case/1",
            "title": draw(texts),
            "site": {"latitude_deg": draw(st.floats(-90, 90)), "longitude_deg": 0.0},
            "channel": channels,
            "test": tests,
            "remark": draw(texts),
        }
    )
    n = len(tests) + draw(st.integers(0, 5))
    parts = draw(st.booleans())
    total = np.array(draw(st.lists(numbers, min_size=n, max_size=n)))
    measured = np.array(draw(st.lists(numbers, min_size=n, max_size=n)))
    measured[1:][draw(st.lists(st.booleans(), min_size=n - 1, max_size=n - 1))] = np.nan
    angles = st.lists(st.floats(0, 180), min_size=n, max_size=n)
    times = st.lists(
        st.just(-1) | st.integers(0, 4_000_000_000_000_000).map(lambda t: t * 1000), min_size=n, max_size=n
    )
    records = Records(
        test=np.arange(n) % len(tests),
        channel=np.array(draw(st.lists(st.integers(0, len(channels) - 1), min_size=n, max_size=n))),
        utc_ns=np.array(draw(times)),
        gamma_deg=np.array(draw(angles)),
        c_deg=np.array(draw(angles)),
        measured=measured,
        uncertainty=np.array(draw(st.lists(st.floats(0, 1e300), min_size=n, max_size=n))),
        simulated=total,
        sun=total / 2 if parts else np.full(n, np.nan),
        sky=total - total / 2 if parts else np.full(n, np.nan),
    )
    return setup, records


@settings(max_examples=60, suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None)
@given(made=cases())
def test_a_case_reads_back_to_the_last_bit(made: tuple[CaseFile, Records], tmp_path: Path) -> None:
    setup, records = made
    written = write_case(tmp_path / "case", setup, records, replace=True)
    read = read_case(tmp_path / "case")
    assert read.setup == setup
    assert as_table(read.setup) == as_table(setup)
    assert written.folder == tmp_path / "case"
    for name in Records.__dataclass_fields__:
        np.testing.assert_array_equal(getattr(read.records, name), getattr(records, name), err_msg=name)


def test_a_case_with_its_files_survives_a_second_writing(tmp_path: Path) -> None:
    case = read_case(small_case(tmp_path / "a"))
    files = {name: (case.folder / name).read_bytes() for name in ("simulated/sun.ies", "simulated/sky.ies")}
    again = write_case(tmp_path / "b" / "c", case.setup, case.records, files=files)
    assert again.setup == case.setup
    assert again.distribution("simulated/sky.ies").candela.max() == 100.0
    assert (tmp_path / "b" / "c" / "simulated" / "sun.ies").read_bytes() == ies()


@pytest.mark.parametrize("spoil", ["no files", "nan", "no row", "outside", "lengths"])
def test_a_case_that_would_not_read_back_is_not_written(spoil: str, tmp_path: Path) -> None:
    case = read_case(small_case(tmp_path / "good"))
    files = {name: (case.folder / name).read_bytes() for name in ("simulated/sun.ies", "simulated/sky.ies")}
    records = case.records
    if spoil == "no files":
        files, words = {}, "bad/case.toml: test 'T1' simulated: there is no file"
    elif spoil == "nan":
        records, words = _with(records, simulated=records.simulated * np.nan), r"bad/records.csv: row 2"
    elif spoil == "no row":
        records, words = records.where(records.test == 0), "no row belongs to test 'T2'"
    elif spoil == "outside":
        files, words = {**files, "../evil.ies": b""}, "is no name for a file of a case"
    else:
        records, words = _with(records, sun=records.sun[:1]), "differ in length"
    with pytest.raises(DataError, match=words):
        write_case(tmp_path / "bad", case.setup, records, files=files)
    assert [p.name for p in tmp_path.iterdir()] == ["good"]


def test_a_full_folder_is_not_overwritten(tmp_path: Path) -> None:
    case = read_case(small_case(tmp_path / "a"))
    with pytest.raises(StorageError, match="not empty"):
        write_case(tmp_path / "a", case.setup, case.records)


def _with(records: Records, **changes: Any) -> Records:
    return Records(**{name: getattr(records, name) for name in Records.__dataclass_fields__} | changes)
