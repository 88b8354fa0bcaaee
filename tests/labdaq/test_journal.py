"""The journal as a sceptic sees it: torn anywhere, damaged anywhere, refused by the disk, opened twice."""

import asyncio
import contextlib
import errno
import itertools
import os
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import hypothesis.strategies as st
import msgspec
import pytest
from hypothesis import given, settings
from hypothesis.stateful import RuleBasedStateMachine, initialize, invariant, rule
from session_helpers import START, FailingDisk, reading

from labdaq.clock import SystemClock, VirtualClock
from labdaq.durable import Disk
from labdaq.errors import DataError, StorageError
from labdaq.journal import Journal, Scan, frame, link, read, scan, unframe
from labdaq.records import Fault, Opened
from labdaq.virtual_time import run_virtual

ROOT = link(b"header")
_numbers = itertools.count()


def lines(messages: list[str]) -> list[bytes]:
    """A good journal of faults with these messages, line by line."""
    head, made = ROOT, []
    for seq, message in enumerate(messages):
        body = Fault(instrument="x", step="y", error="z", message=message)
        entry = {"seq": seq, "prev": head, "t_utc_ns": START, "t_mono_ns": 0, "kind": "fault", "body": body}
        content = msgspec.json.encode(entry)
        made.append(frame(content))
        head = link(content)
    return made


def told(found: Scan) -> list[str]:
    return [msgspec.json.decode(e.body, type=Fault).message for e in found.entries]


messages = st.lists(st.text(max_size=40), min_size=1, max_size=8)


@given(messages)
def test_what_is_written_is_read(texts: list[str]) -> None:
    data = b"".join(lines(texts))
    found = scan(data, ROOT)
    assert told(found) == texts
    assert (found.good_bytes, found.damage) == (len(data), "")


@given(messages, st.data())
def test_a_cut_anywhere_leaves_all_whole_lines(texts: list[str], data: st.DataObject) -> None:
    good = lines(texts)
    whole = b"".join(good)
    cut = data.draw(st.integers(0, len(whole)))
    found = scan(whole[:cut], ROOT)
    kept = [n for n in range(len(good) + 1) if len(b"".join(good[:n])) <= cut][-1]
    assert told(found) == texts[:kept]
    assert found.damage == ""
    assert found.good_bytes == len(b"".join(good[:kept]))


@given(messages, st.binary(max_size=60))
def test_rubbish_behind_the_last_line_is_a_torn_tail(texts: list[str], rubbish: bytes) -> None:
    found = scan(b"".join(lines(texts)) + rubbish, ROOT)
    assert told(found) == texts
    assert found.damage == ""


@given(messages, st.data())
def test_a_changed_byte_is_never_taken_for_good(texts: list[str], data: st.DataObject) -> None:
    good = lines(texts)
    whole = bytearray(b"".join(good))
    at = data.draw(st.integers(0, len(whole) - 1))
    whole[at] ^= data.draw(st.integers(1, 255))
    hit = next(n for n in range(len(good)) if len(b"".join(good[: n + 1])) > at)
    found = scan(bytes(whole), ROOT)
    assert told(found) == texts[:hit]
    assert bool(found.damage) == (hit < len(good) - 1)


@given(st.text(max_size=10), st.text(max_size=10), st.integers(1, 255))
def test_a_changed_newline_before_the_last_line_is_damage_and_no_torn_tail(one: str, two: str, change: int) -> None:
    first, last = lines([one, two])
    found = scan(first[:-1] + bytes([first[-1] ^ change]) + last, ROOT)
    assert (found.entries, found.good_bytes) == ((), 0)
    assert "1 good lines follow" in found.damage


@given(st.lists(st.text(max_size=10), min_size=3, max_size=6), st.data())
def test_lines_cannot_be_taken_out_doubled_or_swapped(texts: list[str], data: st.DataObject) -> None:
    good = lines(texts)
    at = data.draw(st.integers(0, len(good) - 2))
    for changed in (
        good[:at] + good[at + 1 :],
        [*good[: at + 1], good[at], *good[at + 1 :]],
        [*good[:at], good[at + 1], good[at], *good[at + 2 :]],
    ):
        found = scan(b"".join(changed), ROOT)
        assert found.damage
        assert told(found) == texts[: len(found.entries)]


def test_a_journal_belongs_to_its_header() -> None:
    assert "does not follow" in scan(b"".join(lines(["a"])), link(b"another header")).damage


@given(st.binary(max_size=200))
def test_any_bytes_can_be_scanned(data: bytes) -> None:
    assert scan(data, ROOT).entries == ()
    assert unframe(data) is None or data[:8].isalnum()


def test_a_torn_tail_goes_to_a_side_file_and_the_chain_goes_on(tmp_path: Path) -> None:
    path = tmp_path / "journal.jnl"

    async def write() -> None:
        clock = VirtualClock(START)
        journal = Journal.create(path, ROOT, clock, Disk(), None)
        await journal.append(Opened(boot_id="1"))
        await journal.append(reading(clock, 1.0))
        await journal.close()
        for tail in (b'0123abcd {"seq":2,', b"\x00\x00\x00"):
            with path.open("ab") as file:
                file.write(tail)
            journal, torn = Journal.reopen(path, ROOT, clock, Disk(), None)
            assert torn == len(tail)
            await journal.append(reading(clock, 2.0))
            await journal.close()

    run_virtual(write())
    found = read(path, ROOT)
    assert [e.seq for e in found.entries] == [0, 1, 2, 3]
    sides = sorted(tmp_path.glob("journal.torn-*"))
    assert [side.read_bytes() for side in sides] == [b'0123abcd {"seq":2,', b"\x00\x00\x00"]


def test_damage_before_the_tail_is_refused_and_left_alone(tmp_path: Path) -> None:
    path = tmp_path / "journal.jnl"
    good = lines(["a", "b", "c"])
    path.write_bytes(good[0] + b"x" + good[1] + good[2])
    before = path.read_bytes()
    with pytest.raises(DataError, match=r"line 2 .*2 good lines follow"):
        Journal.reopen(path, ROOT, SystemClock(), Disk(), None)
    assert path.read_bytes() == before


def test_there_is_one_writer(tmp_path: Path) -> None:
    async def twice() -> None:
        journal = Journal.create(tmp_path / "j", ROOT, SystemClock(), Disk(), None)
        with pytest.raises(StorageError, match="another program is writing"):
            Journal.reopen(tmp_path / "j", ROOT, SystemClock(), Disk(), None)
        await journal.close()

    asyncio.run(twice())


def test_many_producers_share_syncs_and_all_are_acknowledged(tmp_path: Path) -> None:
    class Counting(Disk):
        syncs = 0

        def sync(self, fd: int) -> None:
            self.syncs += 1
            super().sync(fd)

    disk, clock = Counting(), SystemClock()

    async def produce(journal: Journal, producer: int) -> None:
        for k in range(25):
            await journal.append(reading(clock, k, channel=f"c{producer}"))
            on_disk = scan((tmp_path / "j").read_bytes(), ROOT)
            mine = [e for e in on_disk.entries if f'"c{producer}"'.encode() in bytes(e.body)]
            assert len(mine) == k + 1

    async def run() -> None:
        with ThreadPoolExecutor(1) as executor:
            journal = Journal.create(tmp_path / "j", ROOT, clock, disk, executor)
            async with asyncio.TaskGroup() as group:
                for producer in range(8):
                    group.create_task(produce(journal, producer))
            await journal.close()

    asyncio.run(run())
    assert len(read(tmp_path / "j", ROOT).entries) == 200
    assert disk.syncs < 200


def test_nobody_s_cancellation_spoils_the_others_acknowledgement(tmp_path: Path) -> None:
    class Slow(Disk):
        def sync(self, fd: int) -> None:
            for _ in range(20):
                super().sync(fd)

    async def run() -> int:
        clock = SystemClock()
        with ThreadPoolExecutor(1) as executor:
            journal = Journal.create(tmp_path / "j", ROOT, clock, Slow(), executor)
            tasks = [asyncio.create_task(journal.append(reading(clock, k))) for k in range(10)]
            await asyncio.sleep(0)
            for task in tasks[::2]:
                task.cancel()
            results = await asyncio.gather(*tasks, return_exceptions=True)
            await journal.close()
        return sum(isinstance(r, int) for r in results)

    assert asyncio.run(run()) == 5
    assert len(read(tmp_path / "j", ROOT).entries) == 10


@pytest.mark.parametrize("threads", [0, 1])
def test_a_failed_sync_ends_it_for_everybody_and_is_never_repeated(tmp_path: Path, threads: int) -> None:
    disk = FailingDisk(fail_at=3)  # write, sync, write, then the sync fails

    async def run() -> None:
        clock = SystemClock()
        executor = ThreadPoolExecutor(1) if threads else None
        journal = Journal.create(tmp_path / "j", ROOT, clock, disk, executor)
        await journal.append(reading(clock, 1.0))
        first = await asyncio.gather(*(journal.append(reading(clock, k)) for k in range(3)), return_exceptions=True)
        assert all(isinstance(r, StorageError) for r in first)
        with pytest.raises(StorageError, match="Input/output error"):
            journal.post(reading(clock, 9.0))
        with pytest.raises(StorageError):
            await journal.close()
        if executor:
            executor.shutdown()

    asyncio.run(run())
    assert disk.done == ["write", "sync", "write", "sync"]
    assert len(read(tmp_path / "j", ROOT).entries) >= 1


def test_a_full_disk_says_so(tmp_path: Path) -> None:
    class Full(Disk):
        def write(self, fd: int, data: bytes) -> None:
            os.write(fd, data[: len(data) // 2])
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    async def run() -> None:
        journal = Journal.create(tmp_path / "j", ROOT, SystemClock(), Full(), None)
        with pytest.raises(StorageError, match=r"No space left[\s\S]*free some space"):
            await journal.append(Opened(boot_id=""))
        with pytest.raises(StorageError):
            await journal.close()

    asyncio.run(run())
    assert read(tmp_path / "j", ROOT).entries == ()


class MediumDisk(Disk):
    """Knows how much of each file a power cut would leave: what was there at the last sync."""

    def __init__(self) -> None:
        self.safe: dict[int, int] = {}
        self.cut = False

    def sync(self, fd: int) -> None:
        if self.cut:
            raise OSError(errno.EIO, "the power is cut")
        self.safe[fd] = os.fstat(fd).st_size


class JournalMachine(RuleBasedStateMachine):
    """Write, acknowledge, cut the power, open again: what was acknowledged is always there, in order."""

    def __init__(self) -> None:
        super().__init__()
        self.loop = asyncio.new_event_loop()
        self.folder = Path(os.environ["LABDAQ_TEST_FOLDER"]) / f"m{next(_numbers)}"
        self.folder.mkdir()
        self.path = self.folder / "journal.jnl"
        self.clock = SystemClock()
        self.disk = MediumDisk()
        self.posted: list[float] = []
        self.acknowledged = 0
        self.number = 0

    def _in_loop(self, work):  # type: ignore[no-untyped-def]
        async def call():  # type: ignore[no-untyped-def]
            return work()

        return self.loop.run_until_complete(call())

    @initialize()
    def start(self) -> None:
        self.journal = self._in_loop(lambda: Journal.create(self.path, ROOT, self.clock, self.disk, None))

    @rule(count=st.integers(1, 5))
    def post(self, count: int) -> None:
        for _ in range(count):
            self.number += 1
            self.posted.append(float(self.number))
            self._in_loop(lambda: self.journal.post(reading(self.clock, float(self.number))))

    @rule()
    def acknowledge(self) -> None:
        self.loop.run_until_complete(self.journal.synced())
        self.acknowledged = len(self.posted)

    @rule(data=st.data())
    def power_cut(self, data: st.DataObject) -> None:
        safe = self.disk.safe.get(self.journal._fd, 0)
        self.disk.cut = True
        with contextlib.suppress(StorageError):  # there may be nothing to write
            self.loop.run_until_complete(self.journal.synced())
        with contextlib.suppress(StorageError):
            self.loop.run_until_complete(self.journal.close())
        self.disk.cut = False
        written = self.path.stat().st_size
        left = data.draw(st.integers(safe, written), label="bytes left by the power cut")
        content = bytearray(self.path.read_bytes()[:left])
        if data.draw(st.booleans(), label="torn block"):
            content[safe:] = bytes(len(content) - safe)
        self.path.write_bytes(content)
        self.journal, _ = self._in_loop(lambda: Journal.reopen(self.path, ROOT, self.clock, self.disk, None))
        self.disk.safe[self.journal._fd] = self.path.stat().st_size  # what is left after a power cut is on the medium
        self.posted = self._values()
        assert len(self.posted) >= self.acknowledged
        self.acknowledged = len(self.posted)

    @invariant()
    def acknowledged_is_there(self) -> None:
        if hasattr(self, "journal"):
            assert self._values()[: self.acknowledged] == self.posted[: self.acknowledged]

    def _values(self) -> list[float]:
        return [msgspec.json.decode(e.body)["reading"]["value"] for e in read(self.path, ROOT).entries]

    def teardown(self) -> None:
        if hasattr(self, "journal"):
            self.loop.run_until_complete(self.journal.close())
        self.loop.close()


def test_journal_state_machine(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from hypothesis.stateful import run_state_machine_as_test

    monkeypatch.setenv("LABDAQ_TEST_FOLDER", str(tmp_path))
    run_state_machine_as_test(JournalMachine, settings=settings(max_examples=60, deadline=None))  # type: ignore[no-untyped-call]
