"""The journal: an append-only file in which a line that was acknowledged is never lost.

One line is ``crc32(8 hex digits) SP json LF``. The JSON object holds ``seq`` (from 0), ``prev`` (first 16 hex digits of
the SHA-256 of the JSON before it; of ``session.json`` for the first), the two times, ``kind`` and ``body``. A line is
acknowledged once fdatasync has returned. A crash can only tear the tail: the writer that opens the journal next cuts it
into a side file; readers pass over it.
"""

import asyncio
import fcntl
import hashlib
import os
import re
from collections.abc import Callable
from concurrent.futures import Executor
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final, Self
from zlib import crc32

import msgspec

from labdaq.clock import Clock
from labdaq.durable import Disk, storage_errors, write_file
from labdaq.errors import DataError, StorageError
from labdaq.records import KINDS

FILE: Final = "journal.jnl"
_FRAMES: Final = re.compile(rb"(?=[0-9a-f]{8} )")


class Entry(msgspec.Struct, frozen=True):
    """One line as it is read; ``body`` is still JSON."""

    seq: int
    prev: str
    t_utc_ns: int
    t_mono_ns: int
    kind: str
    body: msgspec.Raw


class _Line(msgspec.Struct, frozen=True):
    """One line as it is written."""

    seq: int
    prev: str
    t_utc_ns: int
    t_mono_ns: int
    kind: str
    body: Any


_encoder: Final = msgspec.json.Encoder()
_decoder: Final = msgspec.json.Decoder(Entry)


def link(content: bytes) -> str:
    """What the next line says about this content: 16 hex digits of its SHA-256."""
    return hashlib.sha256(content).hexdigest()[:16]


def frame(content: bytes) -> bytes:
    """Put the check sum before a line's JSON and the line's end behind it."""
    return b"%08x %s\n" % (crc32(content), content)


def unframe(line: bytes) -> bytes | None:
    """The JSON of a line without its LF, or ``None`` when the check sum does not fit."""
    if len(line) < 10 or line[8:9] != b" ":
        return None
    content = line[9:]
    return content if line[:8] == b"%08x" % crc32(content) else None


@dataclass(frozen=True, slots=True)
class Scan:
    """What a journal's bytes hold.

    Attributes
    ----------
    entries
        The good lines, in order.
    good_bytes
        How many bytes they fill; what follows is torn.
    head
        `link` of the last good line (of ``session.json`` when there is none).
    damage
        Why the journal cannot be trusted: a bad line that good ones follow, or a break in the chain; empty when it can.
    """

    entries: tuple[Entry, ...]
    good_bytes: int
    head: str
    damage: str = ""


def scan(data: bytes, root: str) -> Scan:
    """Read a journal's bytes; ``root`` is the `link` of its ``session.json``."""
    entries: list[Entry] = []
    start, head = 0, root
    while (end := data.find(b"\n", start)) >= 0:
        content = unframe(data[start:end])
        if content is None:
            break
        where = f"line {len(entries) + 1} (byte {start})"
        try:
            entry = _decoder.decode(content)
        except msgspec.DecodeError as error:
            return Scan(tuple(entries), start, head, f"{where}: not a journal entry: {error}")
        if entry.seq != len(entries) or entry.prev != head:
            return Scan(tuple(entries), start, head, f"{where}: does not follow from the line before it")
        entries.append(entry)
        start, head = end + 1, link(content)
    rest = data[start:].split(b"\n")
    follow = [line for line in (*_joined_on(rest[0]), *rest[1:]) if unframe(line) is not None]
    damage = f"line {len(entries) + 1} (byte {start}): damaged, and {len(follow)} good lines follow" if follow else ""
    return Scan(tuple(entries), start, head, damage)


def _joined_on(line: bytes) -> list[bytes]:
    """What may be the line behind a bad one, where it was the newline between them that was damaged."""
    return [line[found.start() :] for found in _FRAMES.finditer(line, 1)]


def read(path: Path, root: str) -> Scan:
    """Read a journal file; raises `DataError` when it is damaged before its tail."""
    found = scan(path.read_bytes(), root)
    if found.damage:
        raise DataError(
            f"{path}: {found.damage}", "restore the session from a copy; `labdaq session verify` tells good from bad"
        )
    return found


class Journal:
    """Appends to a journal; the only writer of its file while it is open.

    With an executor, lines go to disk at once in its thread; those posted while a sync is under way go together in the
    next one (group commit). Without one, as virtual time needs it, they go to disk inline when somebody waits for them.
    After a failure nothing more is written, and everything raises the `StorageError` that ended it.
    """

    def __init__(self, path: Path, fd: int, clock: Clock, disk: Disk, executor: Executor | None) -> None:
        self.path = path
        self.failure: StorageError | None = None
        self.seq = 0
        self.head = ""
        self._fd = fd
        self._clock = clock
        self._disk = disk
        self._executor = executor
        self._pending: list[bytes] = []
        self._collecting: asyncio.Future[None] | None = None
        self._in_flight: asyncio.Future[None] | None = None

    @classmethod
    def create(cls, path: Path, root: str, clock: Clock, disk: Disk, executor: Executor | None) -> Self:
        """Start a new journal below a header whose `link` is ``root``."""
        journal = cls(path, _open_locked(path, os.O_CREAT | os.O_EXCL), clock, disk, executor)
        journal.head = root
        return journal

    @classmethod
    def reopen(cls, path: Path, root: str, clock: Clock, disk: Disk, executor: Executor | None) -> tuple[Self, int]:
        """Open a journal after a crash; return it and how many torn bytes were cut into ``journal.torn-<n>``."""
        fd = _open_locked(path, 0)
        try:
            found = read(path, root)
            torn = path.read_bytes()[found.good_bytes :]
            if torn:
                number = len(list(path.parent.glob("journal.torn-*")))
                write_file(disk, path.with_name(f"journal.torn-{number}"), torn)
                with storage_errors(path):
                    os.ftruncate(fd, found.good_bytes)
                    disk.sync(fd)
        except BaseException:
            os.close(fd)
            raise
        journal = cls(path, fd, clock, disk, executor)
        journal.seq, journal.head = len(found.entries), found.head
        return journal, len(torn)

    def post(self, body: msgspec.Struct) -> int:
        """Put an entry in line without waiting for the disk; return its number. `synced` waits for it."""
        if self.failure is not None:
            raise self.failure
        line = _Line(self.seq, self.head, self._clock.utc_ns(), self._clock.mono_ns(), KINDS[type(body)], body)
        content = _encoder.encode(line)
        self._pending.append(frame(content))
        self.seq, self.head = self.seq + 1, link(content)
        if self._collecting is None:
            loop = asyncio.get_running_loop()
            self._collecting = loop.create_future()
            if self._executor is not None and self._in_flight is None:
                loop.call_soon(self._commit)
        return line.seq

    async def synced(self) -> None:
        """Return when everything posted so far is on disk: this is the acknowledgement. Raises `StorageError`."""
        if self._executor is None and self._collecting is not None:
            self._commit()
        waiting = self._collecting or self._in_flight
        if waiting is not None:
            await asyncio.shield(waiting)  # one waiter's cancellation is not the others'
        if self.failure is not None:
            raise self.failure

    async def append(self, body: msgspec.Struct) -> int:
        """Post an entry and wait for its acknowledgement; return its number."""
        seq = self.post(body)
        await self.synced()
        return seq

    async def close(self) -> None:
        """Wait for the disk and give the file back; raises `StorageError` if the last lines did not get there."""
        try:
            await self.synced()
        finally:
            if self._fd >= 0 and self._in_flight is None:  # never close under a writing thread
                os.close(self._fd)
                self._fd = -1

    def abandon(self) -> None:
        """Let go of a file that nothing was posted to."""
        os.close(self._fd)
        self._fd = -1

    def _commit(self) -> None:
        data, self._pending = b"".join(self._pending), []
        self._in_flight, self._collecting = self._collecting, None
        if self._executor is None:
            self._committed(_outcome(self._write, data))
        else:
            done = asyncio.get_running_loop().run_in_executor(self._executor, _outcome, self._write, data)
            done.add_done_callback(lambda future: self._committed(future.result()))

    def _write(self, data: bytes) -> None:
        with storage_errors(self.path):
            self._disk.write(self._fd, data)
            self._disk.sync(self._fd)

    def _committed(self, failure: StorageError | None) -> None:
        self.failure = self.failure or failure
        done, self._in_flight = self._in_flight, None
        if done is not None and not done.done():
            done.set_result(None)
        if self._collecting is None:
            return
        if self.failure is None:
            self._commit()
        else:  # never a second sync on the same file: what waits is lost, and says so
            self._collecting.set_result(None)
            self._collecting = None


def _outcome(write: Callable[[bytes], None], data: bytes) -> StorageError | None:
    try:
        write(data)
    except StorageError as error:
        return error
    return None


def _open_locked(path: Path, flags: int) -> int:
    with storage_errors(path):
        fd = os.open(path, os.O_WRONLY | os.O_APPEND | os.O_CLOEXEC | flags, 0o644)
        try:
            fcntl.flock(fd, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            os.close(fd)
            raise StorageError(f"{path}: another program is writing this session", "wait until it has ended") from None
        except BaseException:
            os.close(fd)
            raise
    return fd
