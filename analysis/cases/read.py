"""Read a case, or refuse it with every mistake named by file, row and column."""

import csv
import tomllib
from collections.abc import Iterator
from datetime import datetime
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import ValidationError

from analysis.cases.model import Case, CaseFile, Parts, Records, distribution
from labdaq.clock import utc_ns_of
from labdaq.config import mistakes_of
from labdaq.errors import DataError, Problems

COLUMNS = (
    "test",
    "time",
    "channel",
    "gamma_deg",
    "c_deg",
    "measured",
    "uncertainty",
    "simulated",
    "simulated_sun",
    "simulated_sky",
)
_MAY_BE_EMPTY = {"time", "gamma_deg", "c_deg", "measured", "uncertainty", "simulated_sun", "simulated_sky"}
_PARTS_TOLERANCE = 2e-3  # the parts are written rounded; a larger gap is a mistake
_HINT = "docs/cases.md describes the format of a case"
_SHOWN = 12  # a broken column would otherwise print thousands of lines


def read_case(folder: str | Path, *, need_measured: bool = True) -> Case:
    """Read ``folder/case.toml`` and ``folder/records.csv``.

    With ``need_measured`` false (for predictions) the column ``measured`` may be absent or empty throughout.
    Raises `DataError` listing all mistakes of the set-up, else all mistakes of the records.
    """
    folder = Path(folder)
    setup = _read_setup(folder)
    records = _read_records(folder / "records.csv", setup, need_measured)
    return Case(folder, setup, records)


def _read_setup(folder: Path) -> CaseFile:
    path = folder / "case.toml"
    try:
        table = tomllib.loads(path.read_text(encoding="utf-8-sig"))
    except OSError as error:
        raise _unreadable(path, error) from None
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise DataError(f"{path}: not valid TOML: {error}", _HINT) from None
    problems = Problems(str(path))
    try:
        setup = CaseFile.model_validate(table)
    except ValidationError as error:
        for one in mistakes_of(error):
            problems.add(_place(one["loc"], table), one["msg"].removeprefix("Value error, "))
        problems.raise_if_any(DataError, _HINT)
        raise
    for what, ids in (
        ("channel", [c.id for c in setup.channel]),
        ("test", [t.id for t in setup.test]),
        ("system", [s.id for s in setup.system]),
    ):
        for twice in sorted({i for i in ids if ids.count(i) > 1}):
            problems.add(what, f"id '{twice}' is given twice")
    tests = {t.id for t in setup.test}
    for parts, where in _files_of(setup):
        for name in parts.names:
            if not (folder / name).is_file():
                problems.add(where, f"there is no file {name}")
                continue
            try:
                distribution(folder / name)
            except DataError as error:
                problems.add(where, error.message)
    for k, variant in enumerate(setup.variant):
        for unknown in sorted(set(variant.simulated) - tests):
            problems.add(f"variant.{k}.simulated", f"there is no test '{unknown}'")
    problems.raise_if_any(DataError, _HINT)
    return setup


def _place(loc: tuple[int | str, ...], table: dict[str, Any]) -> str:
    """Where in case.toml a mistake is, with the id of the table that it is in, if it has one."""
    if len(loc) > 1 and isinstance(loc[1], int):
        items = table.get(str(loc[0]))
        item = items[loc[1]] if isinstance(items, list) and loc[1] < len(items) else None
        if isinstance(item, dict) and isinstance(item.get("id"), str):
            return ".".join([f"{loc[0]} '{item['id']}'", *(str(part) for part in loc[2:])])
    return ".".join(str(part) for part in loc) or "file"


def _unreadable(path: Path, error: OSError) -> DataError:
    why = "there is no such file" if isinstance(error, FileNotFoundError | NotADirectoryError) else error.strerror
    return DataError(f"{path}: {why}", "a case is a folder with case.toml and records.csv")


def _files_of(setup: CaseFile) -> Iterator[tuple[Parts, str]]:
    for test in setup.test:
        if test.simulated is not None:
            yield test.simulated, f"test '{test.id}' simulated"
    for k, variant in enumerate(setup.variant):
        for test_id, parts in variant.simulated.items():
            yield parts, f"variant.{k}.simulated.{test_id}"


def _read_records(path: Path, setup: CaseFile, need_measured: bool) -> Records:
    try:
        with path.open(newline="", encoding="utf-8-sig") as file:
            rows = list(csv.reader(file))
    except OSError as error:
        raise _unreadable(path, error) from None
    except (UnicodeDecodeError, csv.Error) as error:
        raise DataError(f"{path}: not a CSV file: {error}", _HINT) from None
    if not rows:
        raise DataError(f"{path}: the file is empty", _HINT)
    problems = Problems(str(path))
    header = [name.strip() for name in rows[0]]
    for name in header:
        if name not in COLUMNS:
            problems.add("header", f"unknown column '{name}'; the columns are {','.join(COLUMNS)}")
        elif header.count(name) > 1:
            problems.add("header", f"column '{name}' is given twice")
    for name in ("test", "channel", "simulated", *(("measured", "uncertainty") if need_measured else ())):
        if name not in header:
            problems.add("header", f"column '{name}' is missing")
    problems.raise_if_any(DataError, _HINT)
    reader = _RowReader(problems, setup, header)
    for number, row in enumerate(rows[1:], start=2):
        if row and any(field.strip() for field in row):
            reader.take(number, row)
    if not reader.rows:
        problems.add("file", "there are no records")
    reader.check_whole(need_measured)
    if len(problems.found) > _SHOWN:
        problems.found[_SHOWN:] = [f"... and {len(problems.found) - _SHOWN} more"]
    problems.raise_if_any(DataError, _HINT)
    return reader.records()


class _RowReader:
    """Turns rows of text into records and notes what is wrong with them."""

    def __init__(self, problems: Problems, setup: CaseFile, header: list[str]) -> None:
        self.problems = problems
        self.tests = {t.id: k for k, t in enumerate(setup.test)}
        self.channels = {c.id: k for k, c in enumerate(setup.channel)}
        self.header = header
        self.rows: list[tuple[int, int, int, int, dict[str, float]]] = []
        self.setup = setup

    def take(self, number: int, row: list[str]) -> None:
        """Check and keep one row of the file; ``number`` counts from 1 with the header."""
        if len(row) != len(self.header):
            self.problems.add(f"row {number}", f"has {len(row)} fields, the header has {len(self.header)}")
            return
        text = {name: field.strip() for name, field in zip(self.header, row, strict=True)}
        test = self._index(number, "test", text["test"], self.tests)
        channel = self._index(number, "channel", text["channel"], self.channels)
        utc_ns = self._time(number, text.get("time", ""))
        values = {name: self._number(number, name, text.get(name, "")) for name in COLUMNS[3:]}
        self._check(number, values)
        self._check_angles(number, channel, text)
        self.rows.append((number, test, channel, utc_ns, values))

    def _index(self, number: int, column: str, name: str, known: dict[str, int]) -> int:
        if name not in known:
            self.problems.add(f"row {number}, column {column}", f"'{name}' is not in case.toml")
            return -1
        return known[name]

    def _time(self, number: int, text: str) -> int:
        if not text:
            return -1
        try:
            return utc_ns_of(datetime.fromisoformat(text))
        except ValueError as error:
            self.problems.add(f"row {number}, column time", f"'{text}' is not a UTC time: {error}")
            return -1

    def _number(self, number: int, column: str, text: str) -> float:
        if not text and column in _MAY_BE_EMPTY:
            return float("nan")
        try:
            value = float(text) if text.isascii() and "_" not in text else float("nan")
        except ValueError:
            value = float("nan")
        if not np.isfinite(value):
            self.problems.add(f"row {number}, column {column}", f"'{text}' is not a finite number")
        return value

    def _check(self, number: int, values: dict[str, float]) -> None:
        if values["uncertainty"] < 0:
            self.problems.add(f"row {number}, column uncertainty", f"{values['uncertainty']:g} is negative")
        if not -1e-9 <= np.nan_to_num(values["gamma_deg"]) <= 180 + 1e-9:
            self.problems.add(f"row {number}, column gamma_deg", f"{values['gamma_deg']:g} is outside 0 to 180")
        sun, sky, total = values["simulated_sun"], values["simulated_sky"], values["simulated"]
        if np.isfinite(sun) != np.isfinite(sky):
            self.problems.add(f"row {number}", "simulated_sun and simulated_sky must be given both or not at all")
        elif np.isfinite(sun) and abs(sun + sky - total) > _PARTS_TOLERANCE * max(abs(total), abs(sun), abs(sky), 1e-9):
            self.problems.add(
                f"row {number}", f"simulated_sun + simulated_sky = {sun + sky:g} is not simulated = {total:g}"
            )

    def _check_angles(self, number: int, channel: int, text: dict[str, str]) -> None:
        if channel < 0 or self.setup.channel[channel].kind != "goniometer":
            return
        for name in ("gamma_deg", "c_deg"):
            if not text.get(name):
                self.problems.add(f"row {number}, column {name}", "is empty, but a goniometer's sensor has a direction")

    def check_whole(self, need_measured: bool) -> None:
        """Mistakes that only the whole file shows."""
        seen = {row[1] for row in self.rows}
        for name, k in self.tests.items():
            if k not in seen and self.rows:
                self.problems.add("file", f"no row belongs to test '{name}' of case.toml")
        if need_measured and self.rows and not any(np.isfinite(row[4]["measured"]) for row in self.rows):
            self.problems.add("column measured", "every reading is missing")
        for number, _, _, _, values in self.rows:
            if np.isfinite(values["measured"]) and not np.isfinite(values["uncertainty"]):
                self.problems.add(f"row {number}, column uncertainty", "a reading needs the uncertainty of its noise")

    def records(self) -> Records:
        """The rows as arrays."""
        column = {name: np.array([row[4][name] for row in self.rows]) for name in COLUMNS[3:]}
        return Records(
            test=np.array([row[1] for row in self.rows], dtype=np.int64),
            channel=np.array([row[2] for row in self.rows], dtype=np.int64),
            utc_ns=np.array([row[3] for row in self.rows], dtype=np.int64),
            gamma_deg=column["gamma_deg"],
            c_deg=np.mod(column["c_deg"], 360.0),
            measured=column["measured"],
            uncertainty=column["uncertainty"],
            simulated=column["simulated"],
            sun=column["simulated_sun"],
            sky=column["simulated_sky"],
        )
