"""A reader never meets half a file."""

from pathlib import Path

import pytest

from labdaq.errors import StorageError
from labdaq.whole_file import write_whole, write_whole_bytes


def test_a_failing_writer_leaves_the_old_file_and_nothing_else(tmp_path: Path) -> None:
    target = tmp_path / "map.npz"
    write_whole_bytes(target, b"old")

    def fail(beside: Path) -> None:
        beside.write_bytes(b"half of the n")
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        write_whole(target, fail)
    assert target.read_bytes() == b"old"
    assert list(tmp_path.iterdir()) == [target]


def test_a_missing_folder_is_a_storage_error_that_names_the_file(tmp_path: Path) -> None:
    with pytest.raises(StorageError, match=r"map\.hdr"):
        write_whole_bytes(tmp_path / "nowhere" / "map.hdr", b"")
