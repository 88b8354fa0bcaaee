"""Read CSV files as rows of text, as a recipe says: which table it is, rows skipped, side-by-side columns unfolded."""

import csv
import difflib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from analysis.compare.recipe import Recipe, TableOf, Unpivot
from labdaq.errors import DataError, Problems


@dataclass(frozen=True)
class Row:
    """One row: its number in the file (the first line is 1) and the text in each column, stripped."""

    number: int
    cells: dict[str, str]


@dataclass(frozen=True)
class Sheet:
    """A file, the recipe's table that it is, and its rows."""

    path: Path
    table: TableOf
    rows: tuple[Row, ...]


def read_sheets(recipe: Recipe, paths: Sequence[Path]) -> list[Sheet]:
    """Read each file as the table of the recipe that it fits.

    Raises
    ------
    DataError
        A file cannot be read, fits no table or several, lacks a column that the recipe uses, or no file is there for
        a table that is not optional; one line for each mistake.
    """
    found: list[Sheet] = []
    mistakes: list[str] = []
    for path in paths:
        try:
            found.append(_read(recipe, path))
        except DataError as error:
            mistakes.append(error.message)
    missing = [t for t in recipe.table if not t.optional and all(s.table is not t for s in found)]
    if not mistakes:
        for table in missing:
            told = ", ".join(table.columns) or (table.unpivot.columns.text if table.unpivot else "")
            mistakes.append(f"no file for table '{table.name}' (recognised by {told}) was given")
    if mistakes:
        raise DataError("\n".join(mistakes), "give the files with --table, and the recipe that is made for them")
    return found


def _read(recipe: Recipe, path: Path) -> Sheet:
    fitting = []
    headers: list[list[str]] = []
    for table in recipe.table:
        lines = _lines(path, table)
        header = [name.strip() for name in lines[0][1]] if lines else []
        headers.append(header)
        if _fits(table, header):
            fitting.append((table, header, lines[1:]))
    if not fitting:
        raise DataError(f"{path}: fits no table of the recipe: {_why(recipe, headers)}")
    if len(fitting) > 1:
        names = ", ".join(f"'{table.name}'" for table, _, _ in fitting)
        raise DataError(f"{path}: fits several tables of the recipe: {names}")
    table, header, lines = fitting[0]
    twice = sorted({name for name in header if name and header.count(name) > 1})
    if twice:
        raise DataError(f"{path}: header: column '{twice[0]}' is given twice")
    return Sheet(path, table, tuple(_kept(path, table, _rows(path, table, header, lines))))


def _lines(path: Path, table: TableOf) -> list[tuple[int, list[str]]]:
    """Header and rows with their line numbers, empty rows left out."""
    try:
        with path.open(newline="", encoding="utf-8-sig") as file:
            reader = csv.reader(file, delimiter=table.delimiter)
            lines = [(reader.line_num, row) for row in reader]
    except OSError as error:
        raise DataError(f"{path}: cannot be read: {error.strerror}") from None
    except (UnicodeDecodeError, csv.Error) as error:
        raise DataError(f"{path}: not a CSV file: {error}") from None
    lines = [(n, row) for n, row in lines if n > table.lines_before_header]
    return [(n, row) for n, row in lines if any(cell.strip() for cell in row)]


def _fits(table: TableOf, header: list[str]) -> bool:
    if not set(table.columns) <= set(header):
        return False
    return table.unpivot is None or any(table.unpivot.columns.pattern().fullmatch(name) for name in header)


def _why(recipe: Recipe, headers: list[list[str]]) -> str:
    """For each table the first column that is not there."""
    said = []
    for table, header in zip(recipe.table, headers, strict=True):
        if not header:
            return "it is empty"
        missing = next((name for name in table.columns if name not in header), None)
        if missing is None and table.unpivot is not None:
            missing = table.unpivot.columns.text
        near = difflib.get_close_matches(str(missing), header, n=1, cutoff=0.7)
        said.append(f"'{table.name}' needs column '{missing}'" + (f" (there is '{near[0]}')" if near else ""))
    return "; ".join(said)


def _rows(path: Path, table: TableOf, header: list[str], lines: list[tuple[int, list[str]]]) -> Iterator[Row]:
    problems = Problems(str(path))
    for number, fields in lines:
        if len(fields) != len(header):
            problems.add(f"row {number}", f"has {len(fields)} fields, the header has {len(header)}")
    problems.raise_if_any(DataError)
    for number, fields in lines:
        cells = {name: text.strip() for name, text in zip(header, fields, strict=True)}
        cells = {name: "" if text in table.missing else text for name, text in cells.items()}
        yield from (Row(number, c) for c in ([cells] if table.unpivot is None else _unfolded(cells, table.unpivot)))


def _unfolded(cells: dict[str, str], unpivot: Unpivot) -> list[dict[str, str]]:
    """One row for each different filling of the pattern, apart from the name that spreads to columns."""
    pattern, names = unpivot.columns.pattern(), unpivot.columns.columns
    plain = {name: text for name, text in cells.items() if not pattern.fullmatch(name)}
    made: dict[tuple[str, ...], dict[str, str]] = {}
    for name, text in cells.items():
        found = pattern.fullmatch(name)
        if found is None:
            continue
        filling = {word: found[f"p{k}"] for k, word in enumerate(names)}
        column = filling.pop(unpivot.spread)
        made.setdefault(tuple(filling.values()), plain | filling)[column] = text
    return list(made.values())


def _kept(path: Path, table: TableOf, rows: Iterator[Row]) -> Iterator[Row]:
    """Rows that are not skipped; a column that the recipe names must be there."""
    checked: set[str] = set()
    for row in rows:
        absent = [name for name in table.columns_used() if name not in row.cells] if not checked else []
        checked |= set(row.cells)
        if absent:
            raise DataError(f"{path}: there is no column '{absent[0]}', which the recipe's table '{table.name}' uses")
        if not any(_skipped(row, s.column, s.empty, s.words) for s in table.skip):
            yield row


def _skipped(row: Row, column: str, empty: bool, words: tuple[str, ...]) -> bool:
    text = row.cells[column]
    return not text if empty else text in words
