"""Check sums of a folder, in the form that ``sha256sum -c`` reads."""

import hashlib
import re
from pathlib import Path, PurePosixPath
from typing import Final

from labdaq.errors import DataError

MANIFEST: Final = "MANIFEST.sha256"
_LINE: Final = re.compile(r"([0-9a-f]{64})  (.+)")


def sha256_of(path: Path) -> str:
    """SHA-256 of a file, hexadecimal."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def files_in(folder: Path) -> list[str]:
    """Every file below ``folder`` but the manifest, by POSIX name, sorted."""
    names = (p.relative_to(folder).as_posix() for p in folder.rglob("*") if p.is_symlink() or not p.is_dir())
    return sorted(name for name in names if name != MANIFEST)


def write_manifest(folder: Path) -> None:
    """Write the check sum of every file below ``folder`` into it."""
    names = files_in(folder)
    odd = [name for name in names if "\n" in name or "\\" in name]
    if odd:
        raise DataError(f"{odd[0]!r} is no name for a file of a benchmark")
    lines = [f"{sha256_of(folder / name)}  {name}\n" for name in names]
    (folder / MANIFEST).write_text("".join(lines), encoding="utf-8")


def check_manifest(folder: Path) -> list[str]:
    """What differs from the manifest: changed, missing and additional files, and lines that are none.

    Raises `DataError` when there is no manifest.
    """
    try:
        text = (folder / MANIFEST).read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError):
        raise DataError(f"{folder}: not a benchmark: it has no readable {MANIFEST}") from None
    wrong: list[str] = []
    listed: set[str] = set()
    for number, line in enumerate(text.splitlines(), start=1):
        found = _LINE.fullmatch(line)
        if found is None or found[2] in listed or not _is_inside(found[2]):
            wrong.append(f"{MANIFEST}, line {number}: is not a check sum and the name of a file, once")
            continue
        listed.add(found[2])
        path = folder / found[2]
        if path.is_symlink() or not path.is_file():
            wrong.append(f"{found[2]}: is missing")
        elif sha256_of(path) != found[1]:
            wrong.append(f"{found[2]}: was changed (its check sum differs)")
    wrong += [f"{name}: is not in the manifest" for name in files_in(folder) if name not in listed]
    return wrong


def _is_inside(name: str) -> bool:
    pure = PurePosixPath(name)
    return not pure.is_absolute() and ".." not in pure.parts
