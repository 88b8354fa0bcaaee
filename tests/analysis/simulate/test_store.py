"""Results that are made once and kept."""

import threading
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from analysis.simulate import store


@pytest.fixture
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    return tmp_path


def _never() -> dict[str, Any]:
    raise AssertionError("it was made once already")


def test_what_was_made_once_is_read(cache: Path) -> None:
    made = {"a": np.arange(6.0).reshape(2, 3), "b": np.array([1, 2], dtype=np.int16)}
    assert store.kept("tests", {"n": 1}, lambda: made) is made
    again = store.kept("tests", {"n": 1}, _never)
    assert again.keys() == made.keys() and all(np.array_equal(again[k], made[k]) for k in made)
    with pytest.raises(AssertionError, match="made once"):
        store.kept("tests", {"n": 2}, _never)


@pytest.mark.parametrize("content", [b"", b"PK", b"not an archive", b"PK\x03\x04, and no more"])
def test_a_damaged_file_is_made_again(cache: Path, content: bytes) -> None:
    made = {"a": np.ones(3)}
    store.kept("tests", {}, lambda: made)
    (path,) = (cache / "labdaq" / "tests").glob("*.npz")
    path.write_bytes(content)
    assert store.kept("tests", {}, lambda: made) is made
    assert np.array_equal(store.kept("tests", {}, _never)["a"], made["a"])


def test_one_thread_reads_at_a_time(cache: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Python before 3.11.8 cannot parse two arrays' headers at once."""
    store.kept("tests", {}, lambda: {"a": np.ones(3)})
    load, reading, most = np.load, 0, 0
    count, together = threading.Lock(), threading.Event()

    class Counted:
        """An opened file that stays open until another is, or for a while."""

        def __init__(self, file: Any) -> None:
            self.file = load(file)

        def __enter__(self) -> Any:
            nonlocal reading, most
            with count:
                reading += 1
                most = max(most, reading)
            if most > 1:
                together.set()
            together.wait(0.05)
            return self.file.__enter__()

        def __exit__(self, *error: Any) -> None:
            nonlocal reading
            with count:
                reading -= 1
            self.file.__exit__(*error)

    monkeypatch.setattr(np, "load", Counted)
    with ThreadPoolExecutor(4) as pool:
        read = list(pool.map(lambda _: store.kept("tests", {}, _never)["a"], range(8)))
    assert all(np.array_equal(a, np.ones(3)) for a in read)
    assert most == 1
