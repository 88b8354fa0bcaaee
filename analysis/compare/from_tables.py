"""A case from anybody's tables, by a recipe."""

import math
from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Any
from zoneinfo import ZoneInfo

import numpy as np
from pydantic import ValidationError

from analysis.cases.model import FORMAT, CaseFile, Records
from analysis.cases.units import conversion
from analysis.compare.draft import Draft
from analysis.compare.recipe import SKIES, Amount, Label, Recipe, Record, TableOf, Times
from analysis.compare.tables import Row, Sheet, read_sheets
from analysis.compare.template import Template
from labdaq.clock import utc_ns_of
from labdaq.errors import DataError, Problems

_SHOWN = 12
_NUMBERS = ("gamma_deg", "c_deg", "measured", "uncertainty", "simulated", "simulated_sun", "simulated_sky")


def case_from_tables(recipe: Recipe, paths: Sequence[str | Path]) -> Draft:
    """Turn tables into a case.

    Parameters
    ----------
    recipe
        See `analysis.compare.recipe.find_recipe`.
    paths
        CSV files in any order; each must fit one table of the recipe.

    Raises
    ------
    DataError
        All mistakes of the files, with file, row and column.
    """
    maker = _Maker(recipe)
    sheets = read_sheets(recipe, [Path(p) for p in paths])
    for sheet in sheets:
        maker.take(sheet)
    return maker.finish(sheets)


class _Maker:
    """Collects tests, records and mistakes over all sheets."""

    def __init__(self, recipe: Recipe) -> None:
        self.recipe = recipe
        self.units = {c.id: c.unit for c in recipe.channel}
        self.channels = {c.id: k for k, c in enumerate(recipe.channel)}
        self.tests: dict[str, dict[str, Any]] = {}
        self.rows: list[tuple[int, int, int, dict[str, float]]] = []
        self.mistakes: list[str] = []

    def take(self, sheet: Sheet) -> None:
        """Turn the rows of one sheet into tests and records."""
        for row in sheet.rows:
            cells = _Cells(sheet, row)
            test = self._test(cells, sheet.table)
            for record in sheet.table.record:
                self._record(cells, sheet.table, record, test)
            self.mistakes += cells.problems.found

    def _test(self, cells: "_Cells", table: TableOf) -> int:
        name = cells.text(table.test.id)
        if not name:
            cells.wrong(f"the test has no name ('{table.test.id.text}' is empty)")
        facts = _facts(cells, table)
        known = self.tests.setdefault(name, facts)
        for key in sorted(k for k in known.keys() | facts.keys() if known.get(k) != facts.get(k)):
            cells.wrong(f"test '{name}' has {key} = {facts.get(key)} here and {known.get(key)} in an earlier row")
        return list(self.tests).index(name)

    def _record(self, cells: "_Cells", table: TableOf, record: Record, test: int) -> None:
        unit = self.units[record.channel]
        given = record.unit or unit
        numbers = dict.fromkeys(_NUMBERS, math.nan)
        for name, amounts in record.amounts().items():
            numbers[name] = cells.amount(amounts, *(("deg", "deg") if name.endswith("_deg") else (given, unit)))
        parts = [cells.amount((part,), given, unit) for part in record.uncertainty or ()]
        if parts and not math.isnan(numbers["measured"]):
            numbers["uncertainty"] = math.hypot(*parts)
        if math.isnan(numbers["simulated"]) and not cells.problems.found:
            wanted = record.simulated[0].value.text
            cells.wrong(f"the prediction ({wanted}) is missing; leave such rows out with skip = [...]")
        time = cells.time(record.time, table.time)
        self.rows.append((test, self.channels[record.channel], -1 if time is None else utc_ns_of(time), numbers))

    def finish(self, sheets: Sequence[Sheet]) -> Draft:
        """The case, or one error with all mistakes."""
        found = list(dict.fromkeys(self.mistakes))
        if not self.rows and not found:
            found = [f"{sheets[0].path}: no row is left after skipping"]
        if len(found) > _SHOWN:
            found[_SHOWN:] = [f"... and {len(found) - _SHOWN} more"]
        if found:
            raise DataError("\n".join(found), "correct the table, or the recipe that reads it")
        tests = [{"id": name, **facts} for name, facts in self.tests.items()]
        try:
            setup = CaseFile.model_validate({"format": FORMAT, **self.recipe.facts(), "test": tests})
        except ValidationError as error:
            problems = Problems(", ".join(str(s.path) for s in sheets))
            for one in error.errors():
                problems.add(_where(one["loc"], tests), one["msg"])
            problems.raise_if_any(DataError, "correct the table, or the recipe that reads it")
            raise
        given = [s.table for s in sheets]
        absent = [t.name for t in self.recipe.table if not any(t is g for g in given)]
        notes = [f"no file was given for table '{name}'" for name in absent]
        return Draft(setup, self._records(), notes=tuple(notes))

    def _records(self) -> Records:
        """All records, those of a test together, else in the order of files and rows."""
        self.rows.sort(key=lambda row: row[0])
        numbers = {name: np.array([row[3][name] for row in self.rows], dtype=np.float64) for name in _NUMBERS}
        test, channel, utc_ns = (np.array([row[k] for row in self.rows], dtype=np.int64) for k in range(3))
        return Records(test, channel, utc_ns, *numbers.values())


def _where(loc: Sequence[int | str], tests: list[dict[str, Any]]) -> str:
    if len(loc) >= 2 and loc[0] == "test" and isinstance(loc[1], int):
        return f"test '{tests[loc[1]]['id']}', {'.'.join(map(str, loc[2:]))}"
    return ".".join(map(str, loc)) or "case"


def _facts(cells: "_Cells", table: TableOf) -> dict[str, Any]:
    """What a row says about its test, by the names of a case; what is missing is left out."""
    test = table.test
    facts: dict[str, Any] = {
        "system": cells.label(test.system),
        "start": cells.time(test.start, table.time),
        "end": cells.time(test.end, table.time),
        "sky": cells.label(test.sky),
    }
    if facts["sky"] and facts["sky"] not in SKIES and not cells.problems.found:
        cells.wrong(f"the sky '{facts['sky']}' is not one of {', '.join(SKIES)}; say which with words = {{...}}")
    for name, amounts in test.amounts().items():
        unit = "lx" if name.endswith("_lx") else "deg"
        value = cells.amount(amounts, unit, unit)
        facts[name] = None if math.isnan(value) else value
    return {key: value for key, value in facts.items() if value is not None and value != ""}


class _Cells:
    """One row's cells as text, numbers and times; notes what is wrong with them."""

    def __init__(self, sheet: Sheet, row: Row) -> None:
        self.cells = row.cells
        self.decimal = sheet.table.decimal
        self.row = f"row {row.number}"
        self.problems = Problems(str(sheet.path))
        self._numbers: dict[str, float] = {}

    def wrong(self, what: str, column: str = "") -> None:
        """Note a mistake in this row."""
        self.problems.add(f"{self.row}, column '{column}'" if column else self.row, what)

    def text(self, template: Template | None) -> str:
        """A filled template; empty when there is none."""
        return "" if template is None else template.fill(self.cells)

    def label(self, label: Label | None) -> str:
        """A word, translated; empty when there is none."""
        word = "" if label is None else self.text(label.text)
        if label is None or not word or not label.words:
            return word
        if word not in label.words:
            column = label.text.columns[0] if label.text.columns else ""
            self.wrong(f"'{word}' is not among the recipe's words: {', '.join(label.words)}", column)
            return ""
        return label.words[word]

    def time(self, template: Template | None, how: Times) -> datetime | None:
        """A moment in UTC."""
        text = self.text(template)
        if template is None or not text:
            return None
        column = template.columns[0] if template.columns else ""
        try:
            # a format without %z gives a naive time, which gets its zone below
            moment = datetime.strptime(text, how.format) if how.format else datetime.fromisoformat(text)  # noqa: DTZ007
        except ValueError:
            self.wrong(f"'{text}' is not a time" + (f" like '{how.format}'" if how.format else " (ISO 8601)"), column)
            return None
        if moment.tzinfo is None and how.zone is None:
            self.wrong(f"'{text}' has no time zone; say which with time.zone in the recipe", column)
            return None
        return (moment if moment.tzinfo else moment.replace(tzinfo=ZoneInfo(how.zone or "UTC"))).astimezone(UTC)

    def amount(self, amounts: Sequence[Amount], given: str, wanted: str) -> float:
        """The first amount that is known, in the unit that is wanted; NaN when none is."""
        for amount in amounts:
            value = self._evaluate(amount)
            if not math.isnan(value):
                factor = 1.0 if wanted == "deg" else conversion(amount.unit or given, wanted)
                return value * (factor or math.nan)
        return math.nan

    def _evaluate(self, amount: Amount) -> float:
        numbers: Mapping[str, float] = {name: self._number(name) for name in amount.value.columns}
        try:
            value = amount.value.value(numbers)
        except ZeroDivisionError:
            self.wrong(f"'{amount.value.text}' divides by zero")
            return math.nan
        if math.isinf(value):
            self.wrong(f"'{amount.value.text}' is too large")
            return math.nan
        return value

    def _number(self, column: str) -> float:
        if column not in self._numbers:
            self._numbers[column] = self._read_number(column)
        return self._numbers[column]

    def _read_number(self, column: str) -> float:
        text = self.cells[column]
        if not text:
            return math.nan
        plain = text.replace(",", ".") if self.decimal == "," else text
        try:
            value = float(plain) if plain.isascii() and "_" not in plain else math.nan
        except ValueError:
            value = math.nan
        if not math.isfinite(value):
            self.wrong(f"'{text}' is not a number", column)
            return math.nan
        return value
