"""Sealing a session and finding out whether it is still what was sealed."""

import contextlib
import hashlib
import stat
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final

import msgspec

from labdaq import journal
from labdaq.durable import Disk, storage_errors, write_file
from labdaq.errors import DataError
from labdaq.records import StoredPhoto
from labdaq.session import HEADER, RAW, Session

MANIFEST: Final = "manifest.json"


class ListedFile(msgspec.Struct, frozen=True):
    """One file of a sealed session: path below the session's folder, size in bytes, SHA-256."""

    path: str
    size: int
    sha256: str


class Manifest(msgspec.Struct, frozen=True, kw_only=True):
    """``manifest.json``: every file of the session, and where the journal's chain ends."""

    format: str = "labdaq-manifest/1"
    sealed_utc_ns: int
    last_seq: int
    head: str
    files: tuple[ListedFile, ...]


@dataclass(frozen=True, slots=True)
class Verification:
    """What was found in a session's folder.

    Attributes
    ----------
    sealed
        Whether there is a manifest.
    entries, photos
        Good journal entries, and pictures that are on disk as the journal describes them.
    torn_bytes
        Left behind the last good entry by a crash.
    orphans
        Pictures that no entry names: written, but not acknowledged before a crash.
    problems
        What is damaged, one sentence each; empty when all is well.
    """

    sealed: bool
    entries: int
    photos: int
    torn_bytes: int
    orphans: tuple[str, ...]
    problems: tuple[str, ...] = field(default=())


def boot_id() -> str:
    """Identifier of this boot of the computer; empty where the system has none."""
    with contextlib.suppress(OSError):
        return Path("/proc/sys/kernel/random/boot_id").read_text().strip()
    return ""


def orphans(path: Path, photos: Iterable[StoredPhoto]) -> list[str]:
    """Files in ``raw/`` that no entry names, relative to the session's folder."""
    named = {p.file for p in photos}
    return sorted(f for f in (f"{RAW}/{p.name}" for p in (path / RAW).glob("*")) if f not in named)


def write_manifest(disk: Disk, path: Path, known: Mapping[str, str], end: tuple[int, str], utc_ns: int) -> None:
    """Seal the session at ``path``: list every file, then make all of them read-only.

    ``known`` holds the SHA-256 of pictures already; ``end`` is the journal's last number and its `link`.
    """
    with storage_errors(path):
        files = []
        for file in _recorded(path):
            name = str(file.relative_to(path))
            files.append(ListedFile(name, file.stat().st_size, known.get(name) or _sha256(file)))
        manifest = Manifest(sealed_utc_ns=utc_ns, last_seq=end[0], head=end[1], files=tuple(files))
        write_file(disk, path / MANIFEST, msgspec.json.format(msgspec.json.encode(manifest), indent=2))
        disk.settle(path)
        for file in [*_recorded(path), path / MANIFEST]:
            file.chmod(file.stat().st_mode & ~(stat.S_IWUSR | stat.S_IWGRP | stat.S_IWOTH))


def verify(path: Path) -> Verification:
    """Read everything in a session's folder and compare it with journal and manifest.

    Raises `DataError` when it is no session at all.
    """
    session = Session.open(path)
    found = session.scan()
    problems = [f"{journal.FILE}: {found.damage}"] if found.damage else []
    torn = (path / journal.FILE).stat().st_size - found.good_bytes
    photos = [] if found.damage else session.photos()
    good = 0
    for photo in photos:
        file = path / photo.file
        if not file.is_file():
            problems.append(f"{photo.file}: missing")
        elif _sha256(file) != photo.sha256:
            problems.append(f"{photo.file}: is not what was recorded")
        else:
            good += 1
    manifest = _read_manifest(path)
    if manifest is not None:
        problems += _against(path, manifest)
        if (manifest.last_seq, manifest.head) != (len(found.entries) - 1, found.head):
            problems.append(f"{journal.FILE}: does not end where it was sealed")
    lost = () if found.damage else tuple(orphans(path, photos))
    return Verification(manifest is not None, len(found.entries), good, torn, lost, tuple(dict.fromkeys(problems)))


def _against(path: Path, manifest: Manifest) -> list[str]:
    problems = []
    listed = {f.path: f for f in manifest.files}
    present = {str(f.relative_to(path)): f for f in _recorded(path)}
    problems += [f"{name}: missing" for name in listed if name not in present]
    problems += [f"{name}: was not there when the session was sealed" for name in present if name not in listed]
    for name in listed.keys() & present.keys():
        file = present[name]
        if file.stat().st_size != listed[name].size or _sha256(file) != listed[name].sha256:
            what = "is not what was recorded" if name.startswith(RAW) else "was changed after the session was sealed"
            problems.append(f"{name}: {what}")
    return sorted(problems)


def _read_manifest(path: Path) -> Manifest | None:
    file = path / MANIFEST
    if not file.exists():
        return None
    try:
        return msgspec.json.decode(file.read_bytes(), type=Manifest)
    except (OSError, msgspec.MsgspecError) as error:
        raise DataError(f"{file}: cannot be read as a manifest: {error}", "restore the session from a copy") from error


def _recorded(path: Path) -> list[Path]:
    """The files that belong to the record; what is derived from it lives in other folders."""
    fixed = [path / HEADER, path / journal.FILE, *sorted(path.glob("journal.torn-*"))]
    return [f for f in fixed if f.is_file()] + sorted(f for f in (path / RAW).glob("*") if f.is_file())


def _sha256(file: Path) -> str:
    with file.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()
