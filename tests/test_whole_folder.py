"""Output folders are whole or not there."""

from pathlib import Path

import pytest

from labdaq.errors import DataError, StorageError
from labdaq.whole_folder import write_whole_folder


def _fill(folder: Path) -> str:
    (folder / "sub").mkdir()
    (folder / "sub" / "a.txt").write_text("new")
    return "made"


def test_a_new_folder_appears_with_those_above_it(tmp_path: Path) -> None:
    target = tmp_path / "x" / "y"
    assert write_whole_folder(target, _fill) == "made"
    assert (target / "sub" / "a.txt").read_text() == "new"
    assert [p.name for p in tmp_path.iterdir()] == ["x"]
    assert target.stat().st_mode & 0o700 == 0o700


def test_a_failure_leaves_no_trace(tmp_path: Path) -> None:
    def fail(folder: Path) -> None:
        _fill(folder)
        raise DataError("the third file is bad")

    with pytest.raises(DataError):
        write_whole_folder(tmp_path / "x" / "y", fail)
    assert list(tmp_path.iterdir()) == []


def test_an_empty_folder_is_taken_over_and_a_full_one_refused(tmp_path: Path) -> None:
    (tmp_path / "empty").mkdir()
    write_whole_folder(tmp_path / "empty", _fill)
    with pytest.raises(StorageError, match="not empty"):
        write_whole_folder(tmp_path / "empty", _fill)
    (tmp_path / "file").write_text("mine")
    with pytest.raises(StorageError, match="not empty"):
        write_whole_folder(tmp_path / "file", _fill)
    assert (tmp_path / "file").read_text() == "mine"


def test_replacing_removes_the_old_only_when_the_new_is_complete(tmp_path: Path) -> None:
    target = tmp_path / "t"
    target.mkdir()
    (target / "old.txt").write_text("old")

    def fail(folder: Path) -> None:
        raise OSError(28, "No space left on device")

    with pytest.raises(StorageError, match="No space left"):
        write_whole_folder(target, fail, replace=True)
    assert (target / "old.txt").read_text() == "old"
    write_whole_folder(target, _fill, replace=True)
    assert sorted(p.name for p in target.iterdir()) == ["sub"]
    assert [p.name for p in tmp_path.iterdir()] == ["t"]


def test_the_old_comes_back_when_the_rename_fails(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    target = tmp_path / "t"
    target.mkdir()
    (target / "old.txt").write_text("old")
    real = Path.rename

    def rename(self: Path, to: Path) -> Path:
        if self.name.startswith(".t-") and to == target:
            raise OSError(5, "Input/output error")
        return real(self, to)

    monkeypatch.setattr(Path, "rename", rename)
    with pytest.raises(StorageError, match="Input/output error"):
        write_whole_folder(target, _fill, replace=True)
    assert (target / "old.txt").read_text() == "old"
    assert [p.name for p in tmp_path.iterdir()] == ["t"]
