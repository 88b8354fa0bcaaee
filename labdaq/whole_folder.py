"""Output folders are whole or not there: filled beside their name, then renamed."""

import contextlib
import os
import shutil
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

from labdaq.errors import StorageError

T = TypeVar("T")


def write_whole_folder(folder: Path, fill: Callable[[Path], T], *, replace: bool = False) -> T:
    """Let ``fill`` write into a temporary folder beside ``folder``, sync it, and rename it to ``folder``.

    What ``fill`` returns is returned. Folders above are made if need be. When ``fill`` fails, nothing is left and what
    was at ``folder`` stays. An empty folder is taken over; one that holds something is refused unless ``replace`` is
    true, and then goes away only after the new one is complete. Raises `StorageError` for that, and when the disk or
    its permissions refuse.
    """
    folder = Path(folder).absolute()
    check_free(folder, replace=replace)
    ground = next(p for p in folder.parents if p.is_dir())
    try:
        beside = Path(tempfile.mkdtemp(prefix=f".{folder.name}-", dir=ground))
    except OSError as error:
        raise StorageError(f"{folder}: cannot be made: {error.strerror}", "check the folder above") from error
    try:
        result = fill(beside)
        for file in sorted(p for p in beside.rglob("*") if p.is_file()):
            with file.open("rb") as opened:
                os.fsync(opened.fileno())
        umask = os.umask(0)
        os.umask(umask)
        beside.chmod(0o777 & ~umask)
        folder.parent.mkdir(parents=True, exist_ok=True)
        _put(beside, folder)
    except OSError as error:
        raise StorageError(f"{folder}: cannot be written: {error.strerror}", "check free space and rights") from error
    finally:
        shutil.rmtree(beside, ignore_errors=True)
    return result


def check_free(folder: Path, *, replace: bool = False) -> None:
    """Refuse what `write_whole_folder` would refuse, before the work is done: a folder that holds something."""
    if not replace and _holds_something(folder):
        raise StorageError(
            f"{folder.absolute()}: exists and is not empty", "give another folder, or remove this one first"
        )


def _holds_something(folder: Path) -> bool:
    try:
        return folder.is_file() or (folder.is_dir() and any(folder.iterdir()))
    except OSError:
        return True


def _put(new: Path, folder: Path) -> None:
    """Rename ``new`` to ``folder``; what was there is moved aside first, and back again if that fails."""
    if not _holds_something(folder):
        new.rename(folder)  # onto nothing, or onto an empty folder, which POSIX allows
        return
    aside = Path(tempfile.mkdtemp(prefix=f".{folder.name}-old-", dir=folder.parent)) / "old"
    try:
        folder.rename(aside)
        try:
            new.rename(folder)
        except OSError:
            with contextlib.suppress(OSError):
                aside.rename(folder)
            raise
    finally:
        shutil.rmtree(aside.parent, ignore_errors=True)
