"""Write a case, whole or not at all."""

import csv
import io
from collections.abc import Mapping
from datetime import UTC, datetime, timedelta
from pathlib import Path, PurePosixPath
from typing import Any

import numpy as np

from analysis.cases.model import Case, CaseFile, Floats, Records
from analysis.cases.read import COLUMNS, read_case
from analysis.cases.toml_text import toml_text
from labdaq.errors import DataError, Problems
from labdaq.whole_folder import write_whole_folder


def write_case(
    folder: str | Path,
    setup: CaseFile,
    records: Records,
    *,
    files: Mapping[str, bytes] | None = None,
    replace: bool = False,
) -> Case:
    """Write ``folder/case.toml``, ``folder/records.csv`` and ``files``, and return the case as it reads back.

    Numbers read back to the last bit; times to the microsecond (times before 1970 count as unknown); C angles are
    brought to [0, 360).

    Parameters
    ----------
    files
        Content by name relative to the folder, e.g. ``simulated/T18-sun.ies``; every file that the set-up names.
    replace
        Whether a case that is there already may be replaced.

    Raises
    ------
    DataError
        The case would not read back; the mistakes are those `read_case` finds. Nothing is written.
    StorageError
        The folder holds something already, or the disk refused.
    """
    folder = Path(folder)
    problems = Problems(str(folder))
    for name in files or {}:
        pure = PurePosixPath(name)
        if pure.is_absolute() or ".." in pure.parts or name in ("", ".", "case.toml", "records.csv"):
            problems.add("files", f"{name!r} is no name for a file of a case")
    problems.raise_if_any(DataError)
    text, table = toml_text(as_table(setup)), records_csv(setup, records)
    measured = bool(np.isfinite(records.measured).any())

    def fill(beside: Path) -> Case:
        for name, content in (files or {}).items():
            path = beside / name
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(content)
        (beside / "case.toml").write_text(text, encoding="utf-8")
        (beside / "records.csv").write_text(table, encoding="utf-8", newline="")
        try:
            return read_case(beside, need_measured=measured)
        except DataError as error:
            raise DataError(error.message.replace(str(beside), str(folder)), "nothing was written") from None

    case = write_whole_folder(folder, fill, replace=replace)
    return Case(folder, case.setup, case.records)


def as_table(setup: CaseFile) -> dict[str, Any]:
    """The set-up as plain values for TOML: what was given, without what is unknown."""
    table: dict[str, Any] = setup.model_dump(exclude_none=True, exclude_unset=True)
    return {"format": setup.format, **table}


def records_csv(setup: CaseFile, records: Records) -> str:
    """Text of records.csv; empty fields stand for NaN and for unknown times. Raises `DataError` for unequal columns."""
    sizes = {name: len(getattr(records, name)) for name in Records.__dataclass_fields__}
    if len(set(sizes.values())) > 1:
        raise DataError(f"the columns of the records differ in length: {sizes}")
    tests, channels = [t.id for t in setup.test], [c.id for c in setup.channel]
    columns = [
        [tests[k] for k in records.test],
        [_time(int(t)) for t in records.utc_ns],
        [channels[k] for k in records.channel],
        *(
            _numbers(getattr(records, name))
            for name in ("gamma_deg", "c_deg", "measured", "uncertainty", "simulated", "sun", "sky")
        ),
    ]
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow(COLUMNS)
    writer.writerows(zip(*columns, strict=True))
    return out.getvalue()


def _numbers(values: Floats) -> list[str]:
    return ["" if np.isnan(v) else repr(v) for v in values.astype(np.float64).tolist()]


def _time(utc_ns: int) -> str:
    if utc_ns < 0:
        return ""
    moment = datetime(1970, 1, 1, tzinfo=UTC) + timedelta(microseconds=(utc_ns + 500) // 1000)
    return moment.replace(tzinfo=None).isoformat() + "Z"
