"""For all tests of the analysis: the command line, as a user runs it, in this process; and a core for each worker."""

import os
import sys
from collections.abc import Iterator

import pytest

from labdaq.cli import main
from tests.analysis.commands import Run


@pytest.fixture(scope="module", autouse=True)
def core_of_its_own() -> Iterator[None]:
    """Beside other workers the analysis finds one core: threads and forks for a second would only take turns."""
    worker, cores = os.environ.get("PYTEST_XDIST_WORKER", ""), sorted(os.sched_getaffinity(0))
    if worker:
        os.sched_setaffinity(0, {cores[int(worker.removeprefix("gw")) % len(cores)]})
    yield
    os.sched_setaffinity(0, cores)


@pytest.fixture
def labdaq(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Run:
    """Run the command line; returns exit code, standard output and standard error."""

    def run(*words: object) -> tuple[int, str, str]:
        monkeypatch.setattr(sys, "argv", ["labdaq", *map(str, words)])
        with pytest.raises(SystemExit) as ended:
            main()
        told = capsys.readouterr()
        code = ended.value.code
        return (code if isinstance(code, int) else 0), told.out, told.err

    return run
