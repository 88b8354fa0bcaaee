"""Independent pieces of work in two processes, which share what is in memory already.

Weighing a mechanism is thousands of small steps: threads would wait for the interpreter. A forked process sees all that
was read, traced and factored before, at no cost, and only what it found is sent back.
"""

import io
import os
import pickle
import signal
import sys
import warnings
from collections.abc import Callable, Iterable, Sequence
from typing import Any, BinaryIO, TypeVar

X = TypeVar("X")
Y = TypeVar("Y")

_MOST = 256  # pieces of work; a byte names each


def abreast(
    work: Callable[[X], Y],
    items: Iterable[X],
    shared: Iterable[object] = (),
    size: Callable[[X], int] | None = None,
) -> list[Y]:
    """``work`` of each item, in order, by two processes where there are two cores.

    Each takes the next item when it is done with one, the largest first by ``size``, lest one process wait at the end
    for the other's last. Of what ``work`` returns, objects that are among ``shared`` stay those objects; all else is
    copied. An item whose process was killed is done again here.

    Raises
    ------
    Exception
        Whatever ``work`` raises.
    """
    todo = list(items)
    if not _two_cores() or not 2 <= len(todo) <= _MOST:
        return [work(item) for item in todo]
    held = list(shared)
    waiting, found = os.pipe(), os.pipe()
    order = sorted(range(len(todo)), key=lambda k: 0 if size is None else -size(todo[k]))
    os.write(waiting[1], bytes(order))
    os.close(waiting[1])
    with warnings.catch_warnings():  # other threads only wait for numba's or BLAS's next piece, and the child uses none
        warnings.simplefilter("ignore", DeprecationWarning)
        child = os.fork()
    if child == 0:
        os.close(found[0])
        _work_and_exit(work, todo, waiting[0], found[1], held)
    os.close(found[1])
    try:
        with os.fdopen(found[0], "rb") as answer:
            mine = {k: work(todo[k]) for k in _taken(waiting[0])}
            mine |= _received(answer, held)
    finally:
        os.close(waiting[0])
        os.kill(child, signal.SIGKILL)  # it has sent all, or nobody wants it any more
        os.waitpid(child, 0)
    return [mine[k] if k in mine else work(todo[k]) for k in range(len(todo))]


def _two_cores() -> bool:
    """Whether there are, and a process may be forked safely (macOS's own libraries forbid it)."""
    return sys.platform == "linux" and len(os.sched_getaffinity(0)) > 1


def _taken(waiting: int) -> Iterable[int]:
    """Numbers of items as they are taken, until none is left."""
    while number := os.read(waiting, 1):
        yield number[0]


def _work_and_exit(
    work: Callable[[X], Y], todo: Sequence[X], waiting: int, found: int, shared: Sequence[object]
) -> None:
    """The forked process: its share of the work, sent when all is done; it leaves no other trace."""
    status = 1
    try:
        answer: dict[int, Y] | Exception
        try:
            answer = {k: work(todo[k]) for k in _taken(waiting)}
        except Exception as error:  # raised where the work was asked for
            answer = error
        sent = io.BytesIO()
        _Sender(sent, shared).dump(answer)
        with os.fdopen(found, "wb") as out:
            out.write(sent.getbuffer())
        status = 0
    finally:
        os._exit(status)


def _received(answer: BinaryIO, shared: Sequence[object]) -> dict[int, Any]:
    """What the other process found; nothing if it was killed.

    Raises
    ------
    Exception
        Whatever its work raised.
    """
    sent = answer.read()
    if not sent:
        return {}
    what = _Receiver(io.BytesIO(sent), shared).load()
    if isinstance(what, Exception):
        raise what
    return dict(what)


class _Sender(pickle.Pickler):
    """Sends objects that both processes hold by their number."""

    def __init__(self, out: BinaryIO, shared: Sequence[object]) -> None:
        super().__init__(out, pickle.HIGHEST_PROTOCOL)
        self._number = {id(thing): k for k, thing in enumerate(shared)}

    def persistent_id(self, thing: object) -> int | None:
        return self._number.get(id(thing))


class _Receiver(pickle.Unpickler):
    """Puts this process's own objects for their numbers."""

    def __init__(self, answer: BinaryIO, shared: Sequence[object]) -> None:
        super().__init__(answer)
        self._shared = shared

    def persistent_load(self, number: int) -> object:
        return self._shared[number]
