"""The writer of a session's folder.

``session.json`` first, then the journal, then pictures: each is on disk before the journal names it, and the journal's
line is on disk before anyone is told. The folder gets its name only when header and journal are in it.
"""

import asyncio
import hashlib
import shutil
from collections.abc import Callable
from concurrent.futures import Executor, ThreadPoolExecutor
from pathlib import Path
from typing import Final, Self, TypeVar

import msgspec

from labdaq import journal as journals
from labdaq.clock import Clock
from labdaq.durable import DeferredDisk, Disk, storage_errors, write_file
from labdaq.errors import StorageError
from labdaq.instruments import Photo
from labdaq.journal import Journal
from labdaq.records import Ended, Header, Opened, Resumed, StoredPhoto
from labdaq.seal import boot_id, orphans, write_manifest
from labdaq.session import HEADER, RAW, Session

T = TypeVar("T")

PHOTO_BYTES: Final = {"jpeg": 8_000_000, "raw": 30_000_000}
"""Room kept for one picture; JPEGs of a 5 MP camera take 2 to 5 MB, RAWs of a 24 MP camera up to 30 MB."""


def check_room(folder: Path, photos: int, photo_format: str) -> int:
    """Return the free bytes where ``folder`` is (or will be); raises `StorageError` when a test would not fit."""
    parent = folder.absolute()
    while not parent.exists():
        parent = parent.parent
    with storage_errors(folder):
        free = shutil.disk_usage(parent).free
    needed = int(1.2 * photos * PHOTO_BYTES[photo_format]) + 10_000_000
    if free < needed:
        raise StorageError(
            f"{folder}: {free / 1e6:.0f} MB are free, but a test may need {needed / 1e6:.0f} MB",
            "free some space, or choose another sessions folder",
        )
    return free


class Recorder:
    """Writes one session.

    ``inline`` writes without threads, as virtual time needs it, and waits for the medium once, when the session is
    sealed: what happened in virtual time can be made to happen again.
    """

    def __init__(self, path: Path, header: Header, journal: Journal, disk: Disk, executor: Executor | None) -> None:
        self.path = path
        self.header = header
        self.journal = journal
        self._disk = disk
        self._executor = executor
        self._photos = 0
        self._hashes: dict[str, str] = {}

    @classmethod
    def create(cls, sessions: Path, header: Header, clock: Clock, *, inline: bool, disk: Disk | None = None) -> Self:
        """Make the session's folder ``sessions/header.name``; must be called inside a running event loop.

        Raises `StorageError` when the disk refuses; no folder is left then.
        """
        disk = disk or (DeferredDisk() if inline else Disk())
        path, part = sessions / header.name, sessions / f".{header.name}.part"
        content = msgspec.json.format(msgspec.json.encode(header), indent=2)
        executor = None if inline else ThreadPoolExecutor(2, thread_name_prefix="labdaq-disk")
        log: Journal | None = None
        try:
            with storage_errors(path):
                if path.exists():
                    raise StorageError(f"{path}: there is such a session already")
                (part / RAW).mkdir(parents=True)
                write_file(disk, part / HEADER, content)
                log = Journal.create(part / journals.FILE, journals.link(content), clock, disk, executor)
                disk.sync_folder(part)
                disk.rename(part, path)
                disk.sync_folder(sessions)
                disk.sync_folder(sessions.absolute().parent)
            log.path = path / journals.FILE
            log.post(Opened(boot_id=boot_id()))
        except BaseException:
            if log is not None:
                log.abandon()
            if executor is not None:
                executor.shutdown()
            shutil.rmtree(part, ignore_errors=True)
            raise
        return cls(path, header, log, disk, executor)

    @classmethod
    def reopen(cls, path: Path, clock: Clock, *, inline: bool, disk: Disk | None = None) -> Self:
        """Open a session that a crash left open: cut the torn tail into a side file and say so in the journal.

        Raises `DataError` when the journal is damaged before its tail, `StorageError` when somebody is writing it.
        """
        disk = disk or (DeferredDisk() if inline else Disk())
        session = Session.open(path)
        if session.sealed:
            raise StorageError(f"{path}: the session is sealed; nothing can be added to it")
        executor = None if inline else ThreadPoolExecutor(2, thread_name_prefix="labdaq-disk")
        try:
            log, torn = Journal.reopen(path / journals.FILE, session.root, clock, disk, executor)
        except BaseException:
            if executor is not None:
                executor.shutdown()
            raise
        recorder = cls(path, session.header, log, disk, executor)
        photos = Session.open(path).photos()
        recorder._photos = 1 + max((int(Path(p.file).name.split("-")[0]) for p in photos), default=-1)
        recorder._hashes = {p.file: p.sha256 for p in photos}
        lost = tuple(orphans(path, photos))
        log.post(Resumed(boot_id=boot_id(), last_seq=log.seq - 1, torn_bytes=torn, orphans=lost))
        return recorder

    def post(self, body: msgspec.Struct) -> int:
        """Put an entry in line; `synced` waits for it."""
        return self.journal.post(body)

    async def synced(self) -> None:
        """Return when everything posted so far is on disk."""
        await self.journal.synced()

    async def photo(self, photo: Photo, step: str) -> StoredPhoto:
        """Store a picture and its entry; both are on disk on return. Raises `StorageError`."""
        number, self._photos = self._photos, self._photos + 1
        digest = await self._do(lambda: hashlib.sha256(photo.data).hexdigest())
        ending = Path(photo.name).suffix.lower() or ".bin"
        file = f"{RAW}/{number:08d}-{digest[:8]}{ending}"
        await self._do(lambda: write_file(self._disk, self.path / file, photo.data))
        stored = StoredPhoto(
            step=step,
            file=file,
            sha256=digest,
            size=len(photo.data),
            camera_name=photo.name,
            exposure_s=photo.exposure_s,
            nominal_exposure_s=photo.nominal_exposure_s,
            f_number=photo.f_number,
            iso=photo.iso,
            utc_ns=photo.utc_ns,
            mono_ns=photo.mono_ns,
            clock=photo.clock,
            instrument=photo.instrument,
            flags=photo.flags,
        )
        await self.journal.append(stored)
        self._hashes[file] = digest
        return stored

    async def seal(self, end: Ended, utc_ns: int) -> None:
        """Write the last entry and the manifest, and take away the right to write; raises `StorageError`."""
        await self.journal.append(end)
        seq, head = self.journal.seq - 1, self.journal.head
        await self._do(lambda: write_manifest(self._disk, self.path, self._hashes, (seq, head), utc_ns))

    async def close(self) -> None:
        """Wait for the disk and let go of the session, sealed or not."""
        try:
            await self.journal.close()
        finally:
            if self._executor is not None:
                self._executor.shutdown()

    async def _do(self, work: Callable[[], T]) -> T:
        if self._executor is None:
            return work()
        return await asyncio.get_running_loop().run_in_executor(self._executor, work)
