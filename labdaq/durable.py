"""Writing that is a promise: when a function here returns, the bytes survive a power cut.

A file is written beside its name, synced, renamed, and its folder synced, so that a reader finds it whole or not at
all. Nothing is tried twice: after a failed sync the kernel may have thrown the pages away, and a second sync would say
that all is well (Rebello et al., "Can Applications Recover from fsync Failures?", USENIX ATC 2020).
"""

import contextlib
import os
from collections.abc import Iterator
from pathlib import Path

from labdaq.errors import StorageError


class Disk:
    """The system calls a session stands on; tests replace them by failing ones."""

    def write(self, fd: int, data: bytes) -> None:
        """Write all of ``data``."""
        rest = memoryview(data)
        while rest:
            rest = rest[os.write(fd, rest) :]

    def sync(self, fd: int) -> None:
        """Wait until what was written to ``fd`` is on the medium (data and size, not the times)."""
        os.fdatasync(fd)

    def sync_folder(self, folder: Path) -> None:
        """Wait until the names in ``folder`` are on the medium."""
        fd = os.open(folder, os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC)
        try:
            os.fsync(fd)
        finally:
            os.close(fd)

    def rename(self, old: Path, new: Path) -> None:
        """Give a file or folder its final name."""
        old.rename(new)

    def settle(self, folder: Path) -> None:
        """Make sure of a folder's whole content; here it is on the medium already."""


class DeferredDisk(Disk):
    """Writes at once, but waits for the medium only in `settle`: for what can be made again, as in virtual time.

    What was written survives the end of the program at any moment, though not that of the computer.
    """

    def sync(self, fd: int) -> None:
        """Leave it to `settle`."""

    def sync_folder(self, folder: Path) -> None:
        """Leave it to `settle`."""

    def settle(self, folder: Path) -> None:
        """Wait until every file and name in ``folder``, and its own name, are on the medium."""
        below = list(folder.rglob("*"))
        for file in (f for f in below if f.is_file()):
            fd = os.open(file, os.O_RDONLY | os.O_CLOEXEC)
            try:
                os.fsync(fd)
            finally:
                os.close(fd)
        for each in (*(f for f in below if f.is_dir()), folder, folder.absolute().parent):
            super().sync_folder(each)


@contextlib.contextmanager
def storage_errors(path: Path) -> Iterator[None]:
    """Turn an `OSError` about ``path`` into a `StorageError` that says what to try."""
    try:
        yield
    except OSError as error:
        hint = "free some space, or choose another sessions folder" if error.errno == 28 else "check the disk (dmesg)"
        if isinstance(error, PermissionError):
            hint = "check who may write there, or choose another sessions folder"
        raise StorageError(f"{path}: the disk refused: {error.strerror or error}", hint) from error


def write_file(disk: Disk, path: Path, data: bytes) -> None:
    """Write a new file durably under its final name; raises `StorageError` and leaves nothing half-written."""
    part = path.with_name(f".{path.name}.part")
    with storage_errors(path):
        try:
            fd = os.open(part, os.O_WRONLY | os.O_CREAT | os.O_TRUNC | os.O_CLOEXEC, 0o644)
            try:
                disk.write(fd, data)
                disk.sync(fd)
            finally:
                os.close(fd)
            disk.rename(part, path)
        except OSError:
            with contextlib.suppress(OSError):
                part.unlink()
            raise
        disk.sync_folder(path.parent)
