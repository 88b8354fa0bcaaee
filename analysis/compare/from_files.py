"""A case from photometric files: simulated .ies against a measured .ies or a table of a goniometer's readings."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import ValidationError

from analysis.cases.model import FORMAT, CaseFile, Records
from analysis.compare.draft import Draft
from analysis.compare.listing import Files, ListedTest, Listing
from analysis.compare.measured import Measured, read_measured
from analysis.compare.predicted import Predicted, stems_of
from labdaq.errors import DataError, Problems


def case_from_files(listing: Listing, folder: str | Path = ".") -> Draft:
    """Compare measured and simulated files.

    Parameters
    ----------
    listing
        The tests, their files and facts; facts that a measured .ies carries in its keywords are taken where the list
        gives none.
    folder
        What the names of files are relative to.

    Raises
    ------
    DataError
        Files that cannot be read, or do not cover the measured directions; one line for each test that has a mistake.
    """
    folder = Path(folder)
    mistakes: list[str] = []
    done: list[tuple[ListedTest, Measured, Predicted]] = []
    for test in listing.test:
        try:
            measured = read_measured(folder / test.measured, listing.goniometer, listing.noise)
            predicted = Predicted.read(test.simulated.paths(folder))
            predicted.at(measured.gamma_deg, measured.c_deg)
            done.append((test, measured, predicted))
        except DataError as error:
            mistakes.append(f"test '{test.id}': {error.message}")
    others: dict[tuple[str, int, str], Predicted] = {}
    for kind, k, simulated in _others(listing):
        for test_id, files in simulated.items():
            try:
                others[kind, k, test_id] = Predicted.read(files.paths(folder))
            except DataError as error:
                mistakes.append(f"{kind} {k + 1}, test '{test_id}': {error.message}")
    if mistakes:
        raise DataError("\n".join(mistakes), f"files are looked for from {folder.absolute()}")
    return _draft(listing, done, others)


def _others(listing: Listing) -> list[tuple[str, int, Mapping[str, Files]]]:
    found: list[tuple[str, int, Mapping[str, Files]]] = []
    found += [("variant", k, variant.simulated) for k, variant in enumerate(listing.variant)]
    found += [("rival", k, rival.simulated) for k, rival in enumerate(listing.rival)]
    return found


def _draft(
    listing: Listing,
    done: list[tuple[ListedTest, Measured, Predicted]],
    others: Mapping[tuple[str, int, str], Predicted],
) -> Draft:
    stems = stems_of(test.id for test, _, _ in done)
    files: dict[str, bytes] = {}
    tests = []
    for test, measured, predicted in done:
        files |= predicted.files(stems[test.id], test.id)
        tests.append({**measured.facts, **test.facts(), "simulated": predicted.names(stems[test.id])})
    extra: dict[str, list[dict[str, Any]]] = {
        "variant": [{"mechanism": v.mechanism, "setting": v.setting, "simulated": {}} for v in listing.variant],
        "rival": [{"name": r.name, "simulated": {}} for r in listing.rival],
    }
    for (kind, k, test_id), predicted in others.items():
        group = f"{kind}-{k + 1}"
        files |= predicted.files(stems[test_id], test_id, group=group)
        extra[kind][k]["simulated"][test_id] = predicted.names(stems[test_id], group)
    channels = list(dict.fromkeys(name for _, measured, _ in done for name in measured.channel))
    given = listing.model_dump(
        include={"title", "site", "room", "goniometer", "simulation"}, exclude_unset=True, exclude_none=True
    )
    table = {
        "format": FORMAT,
        **given,
        "system": listing.systems(),
        "channel": [{"id": c, "kind": "goniometer", "quantity": "luminous_intensity", "unit": "cd"} for c in channels],
        "test": tests,
        **{name: tables for name, tables in extra.items() if tables},
    }
    return Draft(_checked(table), _records(done, channels), files)


def _checked(table: Mapping[str, Any]) -> CaseFile:
    try:
        return CaseFile.model_validate(table)
    except ValidationError as error:
        problems = Problems("the case")
        for one in error.errors():
            problems.add(".".join(map(str, one["loc"])), one["msg"])
        problems.raise_if_any(DataError, "correct the keywords of the measured .ies, or say it in the list")
        raise


def _records(done: list[tuple[ListedTest, Measured, Predicted]], channels: list[str]) -> Records:
    pieces = []
    for k, (_, m, predicted) in enumerate(done):
        total, sun, sky = predicted.at(m.gamma_deg, m.c_deg)
        n = len(m.channel)
        channel = np.array([channels.index(name) for name in m.channel], dtype=np.int64)
        test = np.full(n, k, dtype=np.int64)
        pieces.append((test, channel, m.utc_ns, m.gamma_deg, m.c_deg, m.candela, m.uncertainty, total, sun, sky))
    return Records(*(np.concatenate(column) for column in zip(*pieces, strict=True)))
