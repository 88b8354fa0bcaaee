"""Sessions on disk: written, read back, sealed, tampered with, left open by a crash."""

import asyncio
import json
import stat
from pathlib import Path

import numpy as np
import pytest
from session_helpers import START, FailingDisk, header, photo, reading

from labdaq.clock import SystemClock, VirtualClock
from labdaq.durable import Disk, write_file
from labdaq.errors import DataError, LabdaqError, StorageError
from labdaq.recorder import Recorder
from labdaq.records import Ended
from labdaq.seal import verify
from labdaq.session import Session, list_sessions
from labdaq.virtual_time import run_virtual


async def write(folder: Path, *, seal: bool = True, disk: Disk | None = None) -> Path:
    clock = VirtualClock(START)
    recorder = Recorder.create(folder, header(), clock, inline=True, disk=disk)
    try:
        for k in range(3):
            recorder.post(reading(clock, 1000.0 + k, step=f"zenith-{k:02d}"))
            await recorder.photo(photo(clock, b"\xff\xd8" + bytes([k]) * 1000), f"exposure-{k:02d}")
            await clock.sleep(1.0)
        recorder.post(reading(clock, None, channel="sky.global", step="illuminance-000"))
        await recorder.synced()
        if seal:
            await recorder.seal(Ended(outcome="finished", arm="parked"), clock.utc_ns())
    finally:
        await recorder.close()
    return recorder.path


def session(folder: Path, *, seal: bool = True) -> Session:
    return Session.open(run_virtual(write(folder, seal=seal)))


def test_what_was_recorded_is_read_as_arrays_and_tables(tmp_path: Path) -> None:
    found = session(tmp_path)
    zenith = found.readings("sky.zenith")
    assert list(zenith.value) == [1000.0, 1001.0, 1002.0]
    assert list(np.diff(zenith.utc_ns)) == [1_000_000_000] * 2
    assert zenith.step == ("zenith-00", "zenith-01", "zenith-02")
    assert list(zenith.at("gamma_deg")) == [180.0] * 3
    assert np.isnan(zenith.at("c_deg")).all()
    assert np.isnan(found.readings("sky.global").value).all()
    assert found.channels == ["sky.zenith", "sky.global"]
    assert [r.value for r in zenith[1:]] == [1001.0, 1002.0]

    table = found.readings().frame()
    assert len(table) == 4
    assert table["utc"].iloc[0].isoformat() == "2010-07-22T13:12:00+00:00"
    assert list(table["usable"]) == [True, True, True, False]

    first = found.photos()[0]
    assert (found.path / first.file).read_bytes() == b"\xff\xd8" + bytes(1000)
    assert first.exposure_s == 0.25
    assert found.header.test == "T18"
    assert found.station.goniometer.distance_m == 2.6
    assert found.script.exposures.times_s[0] == 8.0
    assert found.outcome == "finished"
    assert [s.header.name for s in list_sessions(tmp_path)] == ["a-session"]


def test_a_journal_line_can_be_read_with_nothing_but_the_documentation(tmp_path: Path) -> None:
    """docs/formats.md says: check sum, space, JSON; here it is done with zlib and json alone."""
    import hashlib
    import zlib

    found = session(tmp_path)
    head = hashlib.sha256((found.path / "session.json").read_bytes()).hexdigest()[:16]
    for number, line in enumerate((found.path / "journal.jnl").read_bytes().splitlines()):
        check, content = line.split(b" ", 1)
        assert int(check, 16) == zlib.crc32(content)
        entry = json.loads(content)
        assert (entry["seq"], entry["prev"]) == (number, head)
        head = hashlib.sha256(content).hexdigest()[:16]
    assert json.loads((found.path / "manifest.json").read_text())["head"] == head


def test_a_sealed_session_is_verified_and_read_only(tmp_path: Path) -> None:
    found = session(tmp_path)
    result = verify(found.path)
    assert (result.sealed, result.photos, result.problems, result.orphans, result.torn_bytes) == (True, 3, (), (), 0)
    writable = stat.S_IWUSR | stat.S_IWGRP | stat.S_IWOTH
    files = [f for f in found.path.rglob("*") if f.is_file()]
    assert len(files) == 6
    assert not any(f.stat().st_mode & writable for f in files)
    (found.path / "derived").mkdir()
    (found.path / "derived" / "map.hdr").write_text("what analysis makes is no part of the record")
    assert verify(found.path).problems == ()
    with pytest.raises(StorageError, match="sealed"):
        Recorder.reopen(found.path, SystemClock(), inline=True)


def spoil_photo(path: Path) -> None:
    file = sorted((path / "raw").iterdir())[0]
    file.chmod(0o644)
    file.write_bytes(file.read_bytes().replace(b"\xff\xd8", b"\xff\xd9"))


def lose_photo(path: Path) -> None:
    sorted((path / "raw").iterdir())[1].unlink()


def add_photo(path: Path) -> None:
    (path / "raw" / "00000009-00000000.jpg").write_bytes(b"x")


def edit_header(path: Path) -> None:
    file = path / "session.json"
    file.chmod(0o644)
    file.write_text(file.read_text().replace('"box"', '"top"'))


def cut_journal(path: Path) -> None:
    file = path / "journal.jnl"
    file.chmod(0o644)
    file.write_bytes(b"".join(file.read_bytes().splitlines(keepends=True)[:-1]))


def edit_journal(path: Path) -> None:
    file = path / "journal.jnl"
    file.chmod(0o644)
    file.write_bytes(file.read_bytes().replace(b"1001.0", b"1001.5"))


@pytest.mark.parametrize(
    ("tamper", "told"),
    [
        (spoil_photo, "is not what was recorded"),
        (lose_photo, "missing"),
        (add_photo, "was not there when the session was sealed"),
        (edit_header, "session.json: was changed after the session was sealed"),
        (cut_journal, "journal.jnl: does not end where it was sealed"),
        (edit_journal, "good lines follow"),
    ],
)
def test_what_is_changed_after_sealing_is_found(tmp_path: Path, tamper, told: str) -> None:  # type: ignore[no-untyped-def]
    path = session(tmp_path).path
    tamper(path)
    assert any(told in problem for problem in verify(path).problems)


def test_an_open_session_can_be_read_recovered_and_sealed(tmp_path: Path) -> None:
    path = session(tmp_path, seal=False).path
    (path / "raw" / "00000003-deadbeef.jpg").write_bytes(b"written, but not acknowledged")
    with (path / "journal.jnl").open("ab") as file:
        file.write(b'0011aabb {"seq":8,"prev"')
    before = verify(path)
    assert (before.sealed, before.problems, before.torn_bytes) == (False, (), 24)
    assert before.orphans == ("raw/00000003-deadbeef.jpg",)
    assert Session.open(path).outcome == "open"
    assert len(Session.open(path).readings()) == 4

    async def recover() -> None:
        clock = VirtualClock(START)
        recorder = Recorder.reopen(path, clock, inline=True)
        stored = await recorder.photo(photo(clock, b"later"), "exposure-03")
        assert stored.file.startswith("raw/00000003-")
        await recorder.seal(Ended(outcome="crashed"), clock.utc_ns())
        await recorder.close()

    run_virtual(recover())
    after = verify(path)
    assert (after.sealed, after.problems, after.torn_bytes, after.photos) == (True, (), 0, 4)
    (resumed,) = Session.open(path).events("session.resume")
    assert resumed.body["torn_bytes"] == 24
    assert resumed.body["orphans"] == ["raw/00000003-deadbeef.jpg"]
    assert Session.open(path).outcome == "crashed"


def test_a_session_can_be_read_while_it_is_written(tmp_path: Path) -> None:
    async def run() -> list[int]:
        clock = SystemClock()
        recorder = Recorder.create(tmp_path, header(), clock, inline=False)
        counts = []
        for k in range(5):
            recorder.post(reading(clock, k))
            await recorder.synced()
            counts.append(len(Session.open(recorder.path).readings()))
        await recorder.close()
        return counts

    assert asyncio.run(run()) == [1, 2, 3, 4, 5]


def test_every_refusal_of_the_disk_is_a_storage_error_and_loses_nothing_acknowledged(tmp_path: Path) -> None:
    probe = FailingDisk(fail_at=10**9)
    run_virtual(write(tmp_path / "whole", disk=probe))
    assert len(probe.done) > 30
    for fail_at in range(len(probe.done)):
        folder = tmp_path / str(fail_at)
        with pytest.raises(StorageError):
            run_virtual(write(folder, disk=FailingDisk(fail_at)))
        for found in list_sessions(folder):
            assert [p for p in verify(found.path).problems if "manifest" not in p] == []
            synced = probe.done[:fail_at].count("sync")  # the header, then each picture and its line
            assert len(found.photos()) >= min(3, (synced - 1) // 2)
        assert list(folder.rglob("*.part")) == []


@pytest.mark.parametrize(
    ("make", "told"),
    [
        (lambda p: None, "there is no such folder"),
        (lambda p: p.mkdir(), "no readable session.json"),
        (lambda p: (p.mkdir(), (p / "session.json").write_text("{}")), "missing required field"),
        (lambda p: (p.mkdir(), (p / "session.json").write_text("nonsense")), "not a session's header"),
    ],
)
def test_what_is_no_session_is_refused(tmp_path: Path, make, told: str) -> None:  # type: ignore[no-untyped-def]
    make(tmp_path / "x")
    with pytest.raises(DataError, match=told):
        Session.open(tmp_path / "x")


def test_a_newer_format_and_a_missing_journal_are_refused(tmp_path: Path) -> None:
    path = session(tmp_path, seal=False).path
    (path / "journal.jnl").unlink()
    with pytest.raises(DataError, match="journal cannot be read"):
        Session.open(path).readings()
    file = path / "session.json"
    file.write_text(file.read_text().replace("labdaq-session/1", "labdaq-session/2"))
    with pytest.raises(DataError, match="labdaq-session/2"):
        Session.open(path)


def test_a_file_is_whole_or_not_there(tmp_path: Path) -> None:
    (tmp_path / "old").write_bytes(b"old")
    for fail_at in range(3):  # write, sync, rename
        with pytest.raises(StorageError):
            write_file(FailingDisk(fail_at), tmp_path / "old", b"new")
        assert (tmp_path / "old").read_bytes() == b"old"
        assert [f.name for f in tmp_path.iterdir()] == ["old"]
    write_file(Disk(), tmp_path / "old", b"new")
    assert (tmp_path / "old").read_bytes() == b"new"


def test_a_folder_that_cannot_be_made_is_a_storage_error(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("not a folder")
    with pytest.raises(LabdaqError, match="the disk refused"):
        run_virtual(write(tmp_path / "file" / "sessions"))
