"""Verify a benchmark: check sums, and that every file can be read as what it claims to be."""

import csv
import tomllib
from collections.abc import Callable
from pathlib import Path

from analysis.cases import read_case
from analysis.compare.benchmark import FORMAT, TEST_COLUMNS
from analysis.compare.manifest import MANIFEST, check_manifest, files_in
from analysis.compare.session_tables import EXPOSURE_COLUMNS, READING_COLUMNS
from analysis.hdr.radiance_picture import read_picture
from analysis.photometry.lm63 import read_lm63
from labdaq.errors import DataError, LabdaqError


def check_benchmark(folder: str | Path) -> int:
    """Verify a benchmark and return how many files it holds.

    Raises
    ------
    DataError
        It is no benchmark, or a file was changed, is missing, is too many, or cannot be read; one line for each.
    """
    folder = Path(folder)
    found = check_manifest(folder)
    changed = {what.rsplit(": ", 1)[0] for what in found}
    wrong = [f"{folder}: {what}" for what in found]
    if not changed & {"benchmark.toml", "tests.csv"}:
        wrong += [f"{folder}: {what}" for what in _top(folder)]
    for name in files_in(folder):
        if name not in changed:
            wrong += [f"{folder}: {name}: {what}" for what in _content(folder, name)]
    if wrong:
        raise DataError("\n".join(wrong), "get the folder again from where it came from")
    return len(files_in(folder))


def _top(folder: Path) -> list[str]:
    for name in ("README.txt", "LICENCE.txt", "benchmark.toml", "tests.csv"):
        if not (folder / name).is_file():
            return [f"{name}: is missing"]
    try:
        about = tomllib.loads((folder / "benchmark.toml").read_text(encoding="utf-8"))
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        return [f"benchmark.toml: not valid TOML: {error}"]
    if about.get("format") != FORMAT:
        return [f"benchmark.toml: has format {about.get('format')!r}; this labdaq reads {FORMAT!r}"]
    return _tests(folder, about.get("tests"))


def _tests(folder: Path, number: object) -> list[str]:
    """The table of tests: its columns, and that the files it names are there."""
    try:
        with (folder / "tests.csv").open(newline="", encoding="utf-8") as file:
            reader = csv.DictReader(file, restval="")
            rows = list(reader)
    except (UnicodeDecodeError, csv.Error) as error:
        return [f"tests.csv: not a CSV file: {error}"]
    if tuple(reader.fieldnames or ()) != TEST_COLUMNS:
        return ["tests.csv: does not have the columns that README.txt tells"]
    wrong = [] if len(rows) == number else [f"tests.csv: has {len(rows)} tests, benchmark.toml tells {number}"]
    files = ("system_file", "measured_ies", "simulated_sun_ies", "simulated_sky_ies", "simulated_total_ies", "sky_hdr")
    for k, row in enumerate(rows, start=2):
        wrong += [
            f"tests.csv: row {k}, column {name}: there is no file {row[name]}"
            for name in files
            if row[name] and not (folder / row[name]).is_file()
        ]
        if not (folder / row["source"]).is_dir():
            wrong.append(f"tests.csv: row {k}, column source: there is no folder {row['source']}")
    return wrong


def _content(folder: Path, name: str) -> list[str]:
    """What is wrong with one file, read as its name says."""
    path = folder / name
    readers: dict[str, Callable[[], object]] = {
        ".ies": lambda: read_lm63(path),
        ".hdr": lambda: read_picture(path),
        ".toml": lambda: tomllib.loads(path.read_text(encoding="utf-8")),
    }
    if path.name == "case.toml":
        readers[".toml"] = lambda: read_case(path.parent, need_measured=False)
    if name.startswith("sessions/") and "/original/" not in name and "/derived/" not in name and path.suffix == ".csv":
        wanted = {"readings.csv": READING_COLUMNS, "exposures.csv": EXPOSURE_COLUMNS}.get(path.name)
        readers[".csv"] = lambda: _header_is(path, wanted)
    if "/original/" in name or path.suffix not in readers or name == MANIFEST:
        return []
    try:
        readers[path.suffix]()
    except LabdaqError as error:
        return error.message.splitlines()
    except (ValueError, OSError) as error:  # also undecodable text and TOML
        return [str(error)]
    return []


def _header_is(path: Path, wanted: tuple[str, ...] | None) -> None:
    with path.open(newline="", encoding="utf-8") as file:
        header = tuple(next(csv.reader(file), ()))
    if wanted is None or header != wanted:
        raise ValueError("does not have the columns that README.txt tells")
