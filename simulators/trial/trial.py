"""A whole trial: many cases, a few at a time, each made, answered and judged in turn."""

import os
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass, field
from multiprocessing import get_context
from multiprocessing.queues import SimpleQueue
from pathlib import Path
from typing import TypeVar

from labdaq.processes import end_with_parent
from simulators.trial import truth as truths
from simulators.trial.files import write_text
from simulators.trial.generate import make, write_case
from simulators.trial.made import Order
from simulators.trial.outcome import Outcome
from simulators.trial.report import as_json, story
from simulators.trial.runner import EXPLANATION, FAILED, Program, judged, run
from simulators.trial.shelf import Shelf


@dataclass(frozen=True)
class Workshop:
    """How cases are made and answered.

    Attributes
    ----------
    out
        Folder for cases, answers, truths and the score.
    program
        What is on trial.
    workers
        How many cases at a time.
    rays_per_node
        Quality of skylight responses that have to be traced; ``None`` for the usual.
    responses
        Folder of responses on disk; ``None`` for the user's cache.
    """

    out: Path
    program: Program = field(default_factory=Program)
    workers: int = 1
    rays_per_node: int | None = None
    responses: Path | None = None


T = TypeVar("T")

_shelf: Shelf | None = None


def _mine(workshop: Workshop) -> Shelf:
    """The shelf of this process."""
    global _shelf  # noqa: PLW0603 - one per worker process, for all its cases
    if _shelf is None:
        _shelf = Shelf(workshop.responses, workshop.rays_per_node)
    return _shelf


def _answered(order: Order, workshop: Workshop) -> Outcome:
    return run(make(order, _mine(workshop)), workshop.program, workshop.out)


def _only_made(order: Order, workshop: Workshop) -> str:
    made = make(order, _mine(workshop))
    write_case(made, workshop.out / "cases")
    truths.write(made.truth, workshop.out / "truth" / f"{order.name}.json")
    return order.name


def outcomes(orders: list[Order], workshop: Workshop) -> Iterator[Outcome]:
    """Run a trial; yields outcomes as they come."""
    yield from _each(_answered, orders, workshop)


def only_cases(orders: list[Order], workshop: Workshop) -> Iterator[str]:
    """Write cases and truths only; yields names as they are done."""
    yield from _each(_only_made, orders, workshop)


def _each(work: Callable[[Order, Workshop], T], orders: list[Order], workshop: Workshop) -> Iterator[T]:
    if workshop.workers <= 1:
        for order in orders:
            yield work(order, workshop)
        return
    for name in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS"):
        os.environ.setdefault(name, "1")
    context = get_context("spawn")
    shares = context.SimpleQueue()
    for share in shares_of(sorted(os.sched_getaffinity(0)), workshop.workers):
        shares.put(share)
    with ProcessPoolExecutor(workshop.workers, context, _take, (shares,)) as pool:
        for done in as_completed([pool.submit(work, order, workshop) for order in orders]):
            yield done.result()


def shares_of(cores: list[int], workers: int) -> list[set[int]]:
    """Which cores each of several workers may use: all are shared out, and one belongs to several if they are fewer."""
    return [set(cores[k::workers]) or {cores[k % len(cores)]} for k in range(workers)]


def _take(shares: "SimpleQueue[set[int]]") -> None:
    """Keep this worker, and the programs it runs, to cores of their own; and to its owner's life.

    Threads that take turns empty each other's caches (two answers at once on two cores took 85 s free, and 60 s so).
    """
    end_with_parent()
    os.sched_setaffinity(0, shares.get())


def unanswered(orders: list[Order], out: Path) -> list[Order]:
    """Orders of which no answer, good or failed, lies under ``out`` beside the truth, which is written last."""

    def done(name: str) -> bool:
        answer = out / "answers" / name
        return (out / "truth" / f"{name}.json").is_file() and any((answer / f).is_file() for f in (EXPLANATION, FAILED))

    return [order for order in orders if not done(order.name)]


def existing(out: Path, names: Iterable[str] | None = None) -> list[Outcome]:
    """Judge every answer that lies under ``out``, or those to the cases of these names."""
    every = (path.stem for path in sorted((out / "truth").glob("*.json")))
    return [judged(out, name) for name in (every if names is None else names)]


def write_score(found: list[Outcome], out: Path, about: dict[str, object]) -> str:
    """Write ``trial.json`` and ``trial.txt`` under ``out``; return the text."""
    ordered = sorted(found, key=lambda o: o.truth.case)
    text = story(ordered)
    write_text(out / "trial.json", as_json(ordered, about))
    write_text(out / "trial.txt", text)
    return text
