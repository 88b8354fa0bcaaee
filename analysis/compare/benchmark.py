"""Pack sessions and cases as an open benchmark: plain files, units, licence and check sums, readable without labdaq."""

import csv
import io
import shutil
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

import numpy as np

from analysis.cases import Case, read_case
from analysis.cases.model import Parts, Test
from analysis.cases.toml_text import toml_text
from analysis.compare.benchmark_columns import COLUMNS, columns_csv
from analysis.compare.benchmark_texts import Licence, readme
from analysis.compare.manifest import MANIFEST, write_manifest
from analysis.compare.predicted import safe_name, stems_of
from analysis.compare.scan import Scan, scan_of
from analysis.compare.session_tables import session_files
from analysis.compare.simulations import rival_files
from analysis.photometry import Distribution
from analysis.photometry.closing import closed_at_90
from analysis.photometry.lm63 import FileGeneration, render_lm63
from analysis.photometry.testdata import TestData
from labdaq.clock import utc_ns_of, utc_text
from labdaq.errors import DataError
from labdaq.session import Session
from labdaq.whole_folder import write_whole_folder

FORMAT: Final = "labdaq-benchmark/1"
TEST_COLUMNS: Final = tuple(name for name, _, _ in COLUMNS["tests.csv"])


@dataclass
class Pack:
    """A benchmark while it is put together: content by name, files to copy by name, and the table of tests."""

    content: dict[str, bytes] = field(default_factory=dict)
    copies: dict[str, Path] = field(default_factory=dict)
    tests: list[dict[str, object]] = field(default_factory=list)
    systems: dict[str, bytes] = field(default_factory=dict)

    def system_file(self, name: str, text: str) -> str:
        """Note a system; the same description stands once, another one of the same name gets a number."""
        stem, k = safe_name(name), 2
        while self.systems.get(f"systems/{stem}.toml", text.encode()) != text.encode():
            stem, k = f"{safe_name(name)}-{k}", k + 1
        self.systems[f"systems/{stem}.toml"] = text.encode()
        return f"systems/{stem}.toml"


def export_benchmark(
    inputs: Sequence[str | Path],
    out: str | Path,
    *,
    licence: Licence,
    title: str = "Daylight photometry benchmark",
    raw: bool = False,
    replace: bool = False,
) -> Pack:
    """Pack ``inputs`` into the folder ``out``, whole or not at all.

    The same input gives the same bytes: nothing depends on when and where it is packed.

    Parameters
    ----------
    inputs
        Folders of cases and sessions, or folders that hold such folders.
    raw
        Whether sessions are also copied as they were recorded, with all pictures.

    Raises
    ------
    DataError
        An input is neither, or cannot be read; all of them are named.
    StorageError
        The folder holds something already, or the disk refused.
    """
    cases, sessions = find_inputs(inputs)
    pack = Pack()
    _pack_cases(pack, cases)
    _pack_sessions(pack, sessions, raw=raw)
    pack.content |= pack.systems
    pack.content["tests.csv"] = _csv(TEST_COLUMNS, pack.tests)
    pack.content["LICENCE.txt"] = licence.text().encode()
    about: dict[str, Any] = {"format": FORMAT, "title": title, "licence": licence.spdx, "holder": licence.holder}
    about |= {"cases": len(cases), "sessions": len(sessions), "tests": len(pack.tests)}
    pack.content["benchmark.toml"] = toml_text(about).encode()
    pack.content["columns.csv"] = columns_csv([*pack.content, *pack.copies])
    pack.content["README.txt"] = readme(title, licence, [*pack.content, *pack.copies]).encode()

    def fill(folder: Path) -> None:
        for name, data in pack.content.items():
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
            (folder / name).write_bytes(data)
        for name, source in pack.copies.items():
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(source, folder / name)
        write_manifest(folder)

    assert MANIFEST not in pack.content
    write_whole_folder(Path(out), fill, replace=replace)
    return pack


def find_inputs(inputs: Sequence[str | Path]) -> tuple[list[Case], list[Session]]:
    """Open cases and sessions; raises one `DataError` for all that are neither, or are given twice."""
    cases: list[Case] = []
    sessions: list[Session] = []
    mistakes: list[str] = []
    seen: set[Path] = set()
    for given in map(Path, inputs):
        found = [given] if _is_input(given) else sorted(p for p in _inside(given) if _is_input(p))
        if not found:
            mistakes.append(f"{given}: is neither a case (case.toml) nor a session (session.json), and holds none")
        for path in found:
            if path.resolve() in seen:
                mistakes.append(f"{path}: is given twice")
                continue
            seen.add(path.resolve())
            try:
                if (path / "case.toml").is_file():
                    cases.append(read_case(path, need_measured=False))
                else:
                    sessions.append(Session.open(path))
            except DataError as error:
                mistakes.append(error.message)
    if not inputs:
        mistakes.append("there is nothing to pack")
    if mistakes:
        raise DataError("\n".join(mistakes), "give folders of cases and sessions")
    return cases, sessions


def _is_input(path: Path) -> bool:
    return (path / "case.toml").is_file() or (path / "session.json").is_file()


def _inside(path: Path) -> Iterable[Path]:
    return [p for p in path.iterdir() if not p.name.startswith(".")] if path.is_dir() else []


def _pack_cases(pack: Pack, cases: Sequence[Case]) -> None:
    stems = stems_of([str(case.folder.resolve()) for case in cases], lambda text: Path(text).name)
    for case in cases:
        home = f"cases/{stems[str(case.folder.resolve())]}"
        for name in ("case.toml", "records.csv", *_files_named(case)):
            pack.copies[f"{home}/{name}"] = case.folder / name
        systems = {}
        for system in case.setup.system:
            table = system.model_dump(exclude_none=True, exclude_unset=True)
            systems[system.id] = pack.system_file(system.id, toml_text(table))
        names = stems_of(t.id for t in case.tests)
        for k, test in enumerate(case.tests):
            photometry = _measured_ies(case, k)
            file = f"photometry/{home.removeprefix('cases/')}-{names[test.id]}-measured.ies"
            if photometry is not None:
                pack.content[file] = photometry
            pack.tests.append(
                {
                    **_facts(test),
                    "source": home,
                    "system_file": systems.get(test.system or "", ""),
                    "readings": int(np.count_nonzero((case.records.test == k) & np.isfinite(case.records.measured))),
                    "measured_ies": file if photometry is not None else "",
                    **_simulated(home, test.simulated),
                }
            )


def _files_named(case: Case) -> list[str]:
    """Every file that case.toml names: of tests, variants and rivals."""
    parts = [t.simulated for t in case.tests if t.simulated is not None]
    parts += [p for v in case.setup.variant for p in v.simulated.values()]
    names = [name for p in parts for name in p.names] + rival_files(case)
    folder = case.folder.resolve()
    for name in names:
        if not (folder / name).resolve().is_relative_to(folder):
            raise DataError(f"{case.folder / 'case.toml'}: the file {name} lies outside the case")
    return list(dict.fromkeys(names))


def _facts(test: Test) -> dict[str, object]:
    facts: dict[str, object] = {"test": test.id, "system": test.system, "sky": test.sky}
    for name, moment in (("start_utc", test.start), ("end_utc", test.end)):
        facts[name] = None if moment is None else utc_text(utc_ns_of(moment))
    names = ("sun_altitude_deg", "sun_azimuth_deg", "global_illuminance_lx", "diffuse_illuminance_lx")
    return facts | {name: getattr(test, name) for name in names}


def _simulated(home: str, parts: Parts | None) -> dict[str, object]:
    given: dict[str, Any] = parts.model_dump() if parts is not None else {}
    return {f"simulated_{p}_ies": f"{home}/{given[p]}" if given.get(p) else "" for p in ("sun", "sky", "total")}


def _measured_ies(case: Case, test: int) -> bytes | None:
    """The recorded intensities of a test as an LM-63 file; ``None`` where a direction of the grid was not read."""
    scan = scan_of(case, test, [])
    if scan is None or np.any(scan.cell < 0) or len(scan.gamma_deg) < 2 or scan.gamma_deg[0] != 0.0:
        return None
    if scan.plane_deg[0] != 0.0 or np.any(scan.measured < 0) or scan.gamma_deg[-1] > 90.0:
        return None
    about, goniometer = case.tests[test], case.setup.goniometer
    told = TestData(
        sun_altitude_deg=about.sun_altitude_deg,
        sun_azimuth_deg=about.sun_azimuth_deg,
        global_lx=about.global_illuminance_lx,
        diffuse_lx=about.diffuse_illuminance_lx,
        sky=about.sky or "",
        start_utc=utc_text(utc_ns_of(about.start)) if about.start else "",
        end_utc=utc_text(utc_ns_of(about.end)) if about.end else "",
        distance_m=goniometer.distance_m if goniometer else None,
        field="near" if goniometer else "",
    )
    return _render(scan, about, told)


def _render(scan: Scan, test: Test, told: TestData) -> bytes:
    name = test.id.encode("ascii", "replace").decode()
    keywords = {
        "TEST": name,
        "TESTLAB": "see README.txt",
        "ISSUEDATE": told.start_utc[:10] or "unknown",
        "MANUFAC": "see README.txt",
        "_READINGS": "as taken, not normalised to the daylight of one moment",
        **told.keywords(),
    }
    closed = Distribution.closed(scan.gamma_deg, scan.plane_deg, scan.table(scan.measured))
    whole = closed_at_90(Distribution(closed.gamma_deg, closed.c_deg, closed.candela, keywords))
    return render_lm63(whole, generation=FileGeneration.MEASURED_INTERPOLATED, digits=9, source=test.id)


def _pack_sessions(pack: Pack, sessions: Sequence[Session], *, raw: bool) -> None:
    stems = stems_of([str(s.path.resolve()) for s in sessions], lambda text: Path(text).name)
    for session in sessions:
        home = f"sessions/{stems[str(session.path.resolve())]}"
        packed = session_files(session, home, raw=raw)
        pack.content |= packed.content
        pack.copies |= packed.copies
        pack.tests.append({**packed.facts, "source": home})


def _csv(columns: Sequence[str], rows: Iterable[Mapping[str, object]]) -> bytes:
    out = io.StringIO()
    writer = csv.DictWriter(out, columns, lineterminator="\n", restval="")
    writer.writeheader()
    writer.writerows({k: "" if v is None else v for k, v in row.items()} for row in rows)
    return out.getvalue().encode()
