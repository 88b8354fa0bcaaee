"""The folder ``derived`` of a session: what analysis made of the record, beside it, and never a part of it.

Each step leaves its account in a JSON file that lists the files it made. A step that is done again takes away what it
made before, and what later steps made of that; files that somebody else put there stay.
"""

import shutil
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, Final, TypeVar

import msgspec

from labdaq.errors import DataError
from labdaq.whole_folder import write_whole_folder

T = TypeVar("T")

FOLDER: Final = "derived"
PROCESS: Final = "process.json"
SIMULATE: Final = "simulate.json"


def derived(session: Path) -> Path:
    """Where a session's derived files are."""
    return session / FOLDER


def read_account(session: Path, name: str) -> dict[str, Any] | None:
    """A step's account, or ``None`` when the step was not done. Raises `DataError` for one that cannot be read."""
    path = derived(session) / name
    try:
        content = path.read_bytes()
    except FileNotFoundError:
        return None
    except OSError as error:
        raise DataError(f"{path}: cannot be read: {error.strerror}") from error
    try:
        account = msgspec.json.decode(content, type=dict[str, Any])
    except msgspec.MsgspecError as error:
        raise DataError(f"{path}: cannot be understood: {error}", "make it again") from error
    return account


def write_account(path: Path, account: dict[str, Any]) -> None:
    """Write a step's account as indented JSON (a number that is not finite becomes null)."""
    path.write_bytes(msgspec.json.format(msgspec.json.encode(account), indent=2) + b"\n")


def rewrite(session: Path, accounts: Sequence[str], fill: Callable[[Path], T]) -> T:
    """Make the folder anew, whole or not at all: without the files of ``accounts``, with what ``fill`` puts in.

    ``fill`` gets the folder in the making. Raises `StorageError`, and what ``fill`` raises; the old folder stays then.
    """
    folder = derived(session)
    stale = set(accounts)
    for name in accounts:
        account = read_account(session, name) or {}
        stale |= {str(file) for file in account.get("files", ())}

    def make(beside: Path) -> T:
        kept = sorted(p for p in folder.rglob("*") if p.is_file()) if folder.is_dir() else []
        for path in kept:
            name = path.relative_to(folder)
            if name.as_posix() not in stale:
                (beside / name).parent.mkdir(parents=True, exist_ok=True)
                shutil.copy2(path, beside / name)
        return fill(beside)

    return write_whole_folder(folder, make, replace=True)
