"""For all tests: their order; nobody leaves asyncio tasks running, or ports, sockets and files of the test open."""

import asyncio
import asyncio.runners
import gc
import threading
from collections import Counter
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """What simulates comes last: the kernels and tables that it needs are made meanwhile (dev.py)."""
    items.sort(key=lambda item: item.nodeid.startswith(("tests/analysis/", "tests/benchmarks/", "tests/bsdf/")))


def _open(folders: str) -> Counter[str]:
    """What this process has open of the kinds that tests open; libraries may keep files and pipes of their own."""
    kinds = ("socket:", "/dev/pts/", "/dev/ptmx", "anon_inode:[eventpoll]", folders)
    found: Counter[str] = Counter()
    for link in Path("/proc/self/fd").iterdir():
        try:
            target = str(link.readlink())
        except OSError:  # the descriptor of this very listing
            continue
        if target.startswith(kinds):
            found[target] += 1
    return found


@pytest.fixture(autouse=True)
def nothing_is_left_behind(monkeypatch: pytest.MonkeyPatch, tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """Fail a test that leaves tasks or descriptors.

    ``asyncio.run`` cancels what is left without a word; here it is written down first, after a few turns of the loop in
    which what was about to end may end.
    """
    left: list[str] = []
    cancel_all: Callable[[asyncio.AbstractEventLoop], None] = asyncio.runners._cancel_all_tasks  # type: ignore[attr-defined]

    def tell_and_cancel_all(loop: asyncio.AbstractEventLoop) -> None:
        async def turns() -> None:
            for _ in range(10):
                await asyncio.sleep(0)

        loop.run_until_complete(turns())
        left.extend(repr(task) for task in asyncio.all_tasks(loop))
        cancel_all(loop)

    monkeypatch.setattr(asyncio.runners, "_cancel_all_tasks", tell_and_cancel_all)
    folders = str(tmp_path_factory.getbasetemp())
    before, threads = _open(folders), set(threading.enumerate())
    yield
    assert not left, "the test left asyncio tasks behind:\n" + "\n".join(left)
    if _open(folders) - before:
        gc.collect()  # what only a reference cycle holds is not a leak of the code under test
    assert Path("/proc/self/fd/0").exists(), "the test closed standard input: programs that it starts may not run"
    new = _open(folders) - before
    if set(threading.enumerate()) - threads:  # a library's own background thread may keep its event loop
        new -= Counter({"anon_inode:[eventpoll]": 1})
        new -= Counter(sorted(name for name in new if name.startswith("socket:"))[:2])
    assert not new, f"the test left open: {', '.join(sorted(new))}"
