"""Output files are whole or not there: written beside their name, then renamed."""

import contextlib
import os
import tempfile
from collections.abc import Callable
from pathlib import Path

from labdaq.errors import StorageError


def write_whole(path: Path, write: Callable[[Path], object]) -> None:
    """Let ``write`` fill a temporary file beside ``path`` (same suffix), sync it, and rename it to ``path``.

    A failure leaves what was at ``path`` before. Raises `StorageError` when the disk or its permissions refuse.
    """
    try:
        handle, name = tempfile.mkstemp(prefix=f".{path.stem}-", suffix=path.suffix, dir=path.parent)
    except OSError as error:
        raise StorageError(f"{path}: cannot be written: {error.strerror}", "check the folder and its rights") from error
    os.close(handle)
    beside = Path(name)
    try:
        write(beside)
        with beside.open("rb") as file:
            os.fsync(file.fileno())
        umask = os.umask(0)
        os.umask(umask)
        beside.chmod(0o666 & ~umask)
        beside.replace(path)
    except OSError as error:
        raise StorageError(f"{path}: cannot be written: {error.strerror}", "check free space and rights") from error
    finally:
        with contextlib.suppress(FileNotFoundError):
            beside.unlink()


def write_whole_bytes(path: Path, data: bytes) -> None:
    """Write ``data`` to ``path``, whole or not at all; raises `StorageError`."""
    write_whole(path, lambda beside: beside.write_bytes(data))
