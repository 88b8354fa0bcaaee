"""Two processes that take and process tests in virtual time, while other things go on."""

import multiprocessing
from collections.abc import Callable
from concurrent.futures import Future, ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from pathlib import Path
from types import TracebackType
from typing import Any, Final, Self

from labdaq.demo.tests import Task, take_and_process
from labdaq.errors import SimulationError
from labdaq.processes import end_with_parent

PROCESSES: Final = 2


class Crew:
    """A pool of processes, each with an interpreter of its own: what is compiled for threads must not be forked."""

    def __init__(self, processes: int = PROCESSES) -> None:
        context = multiprocessing.get_context("spawn")
        self._pool = ProcessPoolExecutor(processes, context, initializer=end_with_parent)
        self._work: dict[Future[Any], str] = {}

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._pool.shutdown(cancel_futures=True)

    def take(self, task: Task) -> None:
        """Let a test be taken and processed."""
        self._work[self._pool.submit(take_and_process, task)] = task.planned.name

    def do(self, name: str, work: Callable[[Path], object], path: Path) -> None:
        """Let something be done with a session."""
        self._work[self._pool.submit(work, path)] = name

    def results(self, done: Callable[[str, Any], None]) -> dict[str, Any]:
        """Wait for everything; tell ``done`` of each as it comes. Raises what a process raised, the first of it."""
        found: dict[str, Any] = {}
        try:
            for future in as_completed(self._work):
                name = self._work[future]
                found[name] = future.result()
                done(name, found[name])
        except BrokenProcessPool as error:
            raise SimulationError(
                "a process that takes tests was ended from outside", "perhaps the memory ran out"
            ) from error
        return found
