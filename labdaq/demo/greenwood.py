"""The report's 32 tests on the emulated station, taken in virtual time, simulated and packed as a benchmark."""

import multiprocessing
import tempfile
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from pathlib import Path
from typing import TYPE_CHECKING, Final

from labdaq.build import mount
from labdaq.demo.tests import order_of, station_at
from labdaq.errors import SimulationError
from labdaq.processes import end_with_parent
from labdaq.runs import run
from simulators.world.campaign import PlannedTest
from simulators.world.greenwood import greenwood_tests

if TYPE_CHECKING:
    from analysis.compare.benchmark import Pack
    from analysis.compare.benchmark_texts import Licence

PRECISION: Final = 0.005
TITLE: Final = "The Greenwood report's 32 tests on an emulated station"


def take(planned: PlannedTest, sessions: Path) -> Path:
    """Take one test on the built-in station in virtual time and process it; returns the session's folder."""
    from analysis.process.session import process_session

    (path,) = run(order_of(planned, station_at(planned), sessions), mount, virtual=True)
    process_session(path)
    return path


def export(
    out: Path,
    licence: "Licence",
    *,
    tests: int | None = None,
    processes: int = 2,
    raw: bool = False,
    replace: bool = False,
    say: Callable[[str], None] = lambda _: None,
) -> "Pack":
    """Take the first ``tests`` of the report's tests (all by default) and pack them into ``out``.

    Whatever is made on the way lies in a temporary folder. Raises a `LabdaqError` where a test or the pack fails.
    """
    from analysis.compare.benchmark import export_benchmark
    from labdaq.whole_folder import check_free

    check_free(out, replace=replace)
    planned = greenwood_tests()[:tests]
    with tempfile.TemporaryDirectory(prefix="labdaq-greenwood-") as name:
        work = Path(name)
        paths = _taken(planned, work / "sessions", processes, say)
        _simulated(paths, say)
        _compared(paths, work / "greenwood")
        inputs = [work / "greenwood", *paths]
        return export_benchmark(inputs, out, licence=licence, title=TITLE, raw=raw, replace=replace)


def _taken(planned: Sequence[PlannedTest], sessions: Path, processes: int, say: Callable[[str], None]) -> list[Path]:
    """Tests in processes of their own: what is compiled for threads must not be forked."""
    paths = []
    try:
        with ProcessPoolExecutor(processes, multiprocessing.get_context("spawn"), end_with_parent) as pool:
            jobs = [pool.submit(take, test, sessions) for test in planned]
            for test, job in zip(planned, jobs, strict=True):
                paths.append(job.result())
                say(f"{test.name}: {test.system}, {test.sky}, {test.start:%Y-%m-%d %H:%M} UTC")
    except BrokenProcessPool as error:
        raise SimulationError(
            "a process that takes tests was ended from outside", "perhaps the memory ran out"
        ) from error
    return paths


def _simulated(paths: Sequence[Path], say: Callable[[str], None]) -> None:
    from analysis.process.prediction import Wish, simulate_sessions
    from labdaq.session import Session

    systems = {path: Session.open(path).header.system for path in paths}
    for system in dict.fromkeys(systems.values()):
        accounts = simulate_sessions([p for p in paths if systems[p] == system], Wish(precision=PRECISION))
        worst = max(account["uncertainty"] for account in accounts)
        say(f"simulated {system}: {len(accounts)} tests, statistical error {100 * worst:.1f} % or less")


def _compared(paths: Sequence[Path], case: Path) -> None:
    from analysis.compare.from_sessions import case_from_sessions
    from analysis.compare.simulated_session import told_simulation, with_predictions

    simulation, systems = told_simulation(paths)
    case_from_sessions(with_predictions(paths), title=TITLE, simulation=simulation, systems=systems).write(case)
