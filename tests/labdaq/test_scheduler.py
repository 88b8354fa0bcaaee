"""One test taken with fake instruments in virtual time: what it records, when, and what it leaves behind."""

import asyncio
from collections import Counter
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path

import msgspec
import numpy as np
import pytest
from fake_bench import FakeArm, FakeCamera, Points, fake_bench

from labdaq.acquisition import acquire
from labdaq.bench import Bench
from labdaq.clock import NS, ClockState, VirtualClock
from labdaq.config import parse
from labdaq.errors import ClockError, ConnectError, DeviceTimeout, LabdaqError, RefusedError, RunError, StorageError
from labdaq.headers import Order
from labdaq.reading import Flag
from labdaq.recorder import check_room
from labdaq.records import StepDone
from labdaq.script import Script
from labdaq.seal import verify
from labdaq.session import Session, list_sessions
from labdaq.station import Station
from labdaq.stopping import Stop
from labdaq.virtual_time import run_virtual

START = 1_279_804_320 * NS


def order(folder: Path, script: str = "") -> Order:
    return Order(Station.built_in(), parse(f'test = "T18"\nsystem = "box"\n{script}', Script, "script"), folder)


class Lab:
    """A bench of fakes, and what became of it."""

    def __init__(self, points: Points | None = None) -> None:
        self.points = points or Points()
        self.bench: Bench | None = None
        self.shown: list[msgspec.Struct] = []
        self.stop: Stop | None = None

    async def take(self, wanted: Order) -> list[Path]:
        clock = VirtualClock(START)
        self.stop = Stop()
        self.bench = fake_bench(clock, self.points)

        @asynccontextmanager
        async def mount() -> AsyncIterator[Bench]:
            assert self.bench
            yield self.bench

        return await acquire(wanted, mount, clock, self.stop, self.shown.append, inline=True)


def test_one_test_is_what_the_report_describes(tmp_path: Path) -> None:
    lab = Lab()
    (path,) = run_virtual(lab.take(order(tmp_path)))
    session = Session.open(path)
    assert session.outcome == "finished"
    assert session.sealed
    assert verify(path).problems == ()

    assert len(session.photos()) == 16
    assert [p.nominal_exposure_s for p in session.photos()] == [2.0 ** (3 - k) for k in range(16)]
    assert len(session.readings("sky.zenith")) == 16
    planes = session.readings("gonio.g45")
    assert list(planes.at("c_deg")) == [22.5 * k for k in range(16)]
    assert sum(len(session.readings(c)) for c in session.channels if c.startswith("gonio.")) == 160
    assert session.readings().step[-1].startswith("illuminance-")
    everything = session.readings()
    scans = [t for t, s in zip(everything.utc_ns, everything.step, strict=True) if not s.startswith("illuminance")]
    for channel in ("sky.global", "sky.diffuse"):
        times = session.readings(channel).utc_ns
        assert times[0] < min(scans)
        assert times[-1] > max(scans)
        assert np.max(np.diff(times)) < 2.01 * NS
    assert everything.utc_ns[-1] - START < 150 * NS


def test_the_grid_does_not_drift(tmp_path: Path) -> None:
    (path,) = run_virtual(Lab().take(order(tmp_path)))
    zenith = Session.open(path).readings("sky.zenith").mono_ns
    assert (
        np.max(np.abs(np.diff(zenith) - 9 * NS)) <= 2
    )  # virtual time is a float of seconds: rounded to the nanosecond


def test_what_is_shown_is_on_disk(tmp_path: Path) -> None:
    lab = Lab()
    (path,) = run_virtual(lab.take(order(tmp_path)))
    shown = Counter(type(body).__name__ for body in lab.shown)
    assert shown["TakenReading"] == len(Session.open(path).readings())
    assert shown["StoredPhoto"] == 16
    assert shown["Header"] == 1


def test_repeats_are_sessions_of_their_own(tmp_path: Path) -> None:
    paths = run_virtual(Lab().take(order(tmp_path, "repeats = 3\npause_s = 60")))
    sessions = list_sessions(tmp_path)
    assert [s.path for s in sessions] == sorted(paths)
    assert len({s.header.name for s in sessions}) == 3
    starts = [s.header.started_utc_ns for s in sessions]
    assert min(np.diff(starts)) > (15 * 9 + 60) * NS  # the last exposure starts after 15 periods


def test_slow_meters_miss_ticks_and_say_so(tmp_path: Path) -> None:
    (path,) = run_virtual(Lab().take(order(tmp_path, "[illuminance]\nperiod_s = 0.5")))
    session = Session.open(path)
    missed = sum(e.body["count"] for e in session.events("step.miss"))
    taken = len(session.readings("sky.global")) + len(session.readings("sky.diffuse"))
    assert missed > 0
    on_grid = session.readings("sky.global").mono_ns - np.int64(0.6 * NS)
    late = (on_grid - on_grid[0]) % (NS // 2)
    assert np.all(np.minimum(late, NS // 2 - late) < 1000)  # every reading starts on a tick
    assert taken + missed == 2 * (round((on_grid[-1] - on_grid[0]) / (NS / 2)) + 1)


def test_late_steps_are_flagged(tmp_path: Path) -> None:
    (path,) = run_virtual(Lab().take(order(tmp_path, "[scan]\nperiod_s = 1.0\n")))
    planes = Session.open(path).readings("gonio.g0")
    assert Flag.LATE not in planes[0].flags
    assert Flag.LATE in planes[15].flags  # a plane takes 1.7 s
    lateness = [e.body["lateness_s"] for e in Session.open(path).events("step.start") if e.body["step"] == "plane-15"]
    assert lateness == [pytest.approx(15 * 0.7, abs=1e-6)]


def test_an_unsynchronised_clock_flags_or_refuses(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (path,) = run_virtual(Lab().take(order(tmp_path)))
    assert all(Flag.UNSYNCHRONISED in r.flags for r in Session.open(path).readings())

    monkeypatch.setattr(VirtualClock, "state", lambda self: ClockState(source="system", synchronised=False))
    with pytest.raises(ClockError, match="not synchronised"):
        run_virtual(Lab().take(order(tmp_path / "none", "[clock]\nrequire = 'refuse'")))
    assert not (tmp_path / "none").exists()

    bounds = iter([0.1] * 8)  # good at first, then the bound grows
    monkeypatch.setattr(
        VirtualClock,
        "state",
        lambda self: ClockState(source="system", synchronised=True, max_error_s=next(bounds, 9.0)),
    )
    lab = Lab()
    with pytest.raises(ClockError, match="may be off by 9"):
        run_virtual(lab.take(order(tmp_path / "lost", "[clock]\nrequire = 'refuse'")))
    assert Session.open(next((tmp_path / "lost").iterdir())).outcome == "failed"
    assert lab.bench
    assert lab.bench.goniophotometer.parked  # type: ignore[attr-defined]


def test_all_missing_instruments_are_told_at_once(tmp_path: Path) -> None:
    class Deaf(Points):
        def at(self, place, what):  # type: ignore[no-untyped-def]
            if what == "connect-begin" and place.instrument in {"roof-luminance", "roof-global"}:
                return (
                    ConnectError("nobody answers", place=place, hint="switch it on")
                    if "g" in place.port
                    else OSError(5)
                )
            return None

    with pytest.raises(ConnectError) as caught:
        run_virtual(Lab(Deaf()).take(order(tmp_path)))
    assert "roof-luminance on fake:roof-luminance" in str(caught.value)
    assert "roof-global on fake:roof-global" in str(caught.value)
    assert not list(tmp_path.iterdir())


def test_a_camera_without_the_shutter_times_is_refused_before_anything_moves(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with pytest.raises(RefusedError, match=r"no shutter times of its own for 0\.011"):
        run_virtual(Lab().take(order(tmp_path, '[exposures]\ntimes_s = ["1/90", 1]\n')))
    with pytest.raises(RefusedError, match=r"0\.0166"):  # 1/60 and 1/64 are the same shutter time
        run_virtual(Lab().take(order(tmp_path, '[exposures]\ntimes_s = ["1/64", "1/60"]\n')))
    monkeypatch.setattr(FakeCamera, "exposures_s", ())
    with pytest.raises(RefusedError, match="mode dial"):
        run_virtual(Lab().take(order(tmp_path)))
    assert not list(tmp_path.iterdir())


def test_nominal_shutter_times_find_the_camera_s_own(tmp_path: Path) -> None:
    (path,) = run_virtual(Lab().take(order(tmp_path, '[exposures]\ntimes_s = ["1/60", "1/125"]\n')))
    assert [p.nominal_exposure_s for p in Session.open(path).photos()] == [1 / 64, 1 / 128]


def test_a_step_without_end_is_ended(tmp_path: Path) -> None:
    points = Points(fail_at=40, fail_with=lambda place: TimeoutError(), hang=True)
    lab = Lab(points)
    with pytest.raises(DeviceTimeout, match="did not finish within 45 s; in step"):
        run_virtual(lab.take(order(tmp_path)))


def test_a_test_without_end_is_ended(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    async def crawl(self: FakeArm, c_deg: float) -> float:
        await self.clock.sleep(40.0)
        return c_deg

    monkeypatch.setattr(FakeArm, "move_to", crawl)
    with pytest.raises(RunError, match=r"longer than 300 s; last finished step: illuminance-"):
        run_virtual(Lab().take(order(tmp_path)))
    (session,) = list_sessions(tmp_path)
    assert session.outcome == "failed"
    assert session.sealed


@pytest.mark.parametrize("times", [1, 2])
def test_the_operator_may_stop_it(tmp_path: Path, times: int) -> None:
    async def stopped() -> float:
        clock = VirtualClock(START)
        task = asyncio.ensure_future(lab.take(order(tmp_path)))
        await clock.sleep(7.0)  # in the middle of the first exposure of 8 s
        assert lab.stop
        asked_ns = clock.mono_ns()
        for _ in range(times):
            lab.stop.request("SIGTERM")
            await clock.sleep(0.5)
        with pytest.raises(RunError, match="stopped by SIGTERM"):
            await task
        return (clock.mono_ns() - asked_ns) / NS

    lab = Lab()
    took_s = run_virtual(stopped())
    assert took_s == pytest.approx({1: 5.5, 2: 2.5}[times], abs=1.5)  # the exposure may end; or not, asked twice
    (session,) = list_sessions(tmp_path)
    assert session.outcome == "interrupted"
    assert session.sealed
    assert len(session.photos()) == {1: 1, 2: 0}[times]
    assert lab.bench
    assert lab.bench.goniophotometer.parked  # type: ignore[attr-defined]
    assert all(device.open == 0 for device in lab.bench.devices)  # type: ignore[attr-defined]


def test_stopped_while_connecting_or_between_tests(tmp_path: Path) -> None:
    async def stopped(after_s: float) -> str:
        clock = VirtualClock(START)
        task = asyncio.ensure_future(lab.take(order(tmp_path, "repeats = 2\npause_s = 1000")))
        await clock.sleep(after_s)
        assert lab.stop
        lab.stop.request("SIGINT")
        with pytest.raises(RunError) as caught:
            await task
        assert clock.mono_ns() / NS < after_s + 0.1
        assert lab.bench
        assert all(device.open == 0 for device in lab.bench.devices)  # type: ignore[attr-defined]
        return str(caught.value)

    lab = Lab()
    assert "while connecting; nothing was recorded" in run_virtual(stopped(0.1))
    assert not list(tmp_path.iterdir())
    lab = Lab()
    assert "between two tests of T18" in run_virtual(stopped(500.0))
    assert [s.outcome for s in list_sessions(tmp_path)] == ["finished"]


def test_stopped_while_homing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    async def slow(self: FakeArm) -> None:
        self.parked = False
        await self.clock.sleep(100.0)

    async def stopped() -> float:
        clock = VirtualClock(START)
        task = asyncio.ensure_future(lab.take(order(tmp_path)))
        await clock.sleep(5.0)
        assert lab.stop
        lab.stop.request("SIGINT")
        with pytest.raises(RunError, match="stopped by SIGINT; last finished step: none"):
            await task
        return clock.mono_ns() / NS

    monkeypatch.setattr(FakeArm, "home", slow)
    lab = Lab()
    assert run_virtual(stopped()) < 5 + 10 + 3
    assert list_sessions(tmp_path)[0].outcome == "interrupted"
    assert lab.bench
    assert lab.bench.goniophotometer.parked  # type: ignore[attr-defined]


def test_a_full_disk_is_found_before_the_test(tmp_path: Path) -> None:
    with pytest.raises(StorageError, match="MB are free, but a test may need"):
        check_room(tmp_path, 10_000_000, "raw")


def test_an_unexpected_error_is_a_fault_with_its_trace(tmp_path: Path) -> None:
    lab = Lab(Points(fail_at=60, fail_with=lambda place: ZeroDivisionError("oops")))
    with pytest.raises(RunError, match="unexpected ZeroDivisionError: oops; in step"):
        run_virtual(lab.take(order(tmp_path)))
    (fault,) = list_sessions(tmp_path)[0].events("fault")
    assert "Traceback" in fault.body["trace"]


def test_an_arm_that_cannot_be_parked_is_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    async def stuck(self: FakeArm) -> None:
        await self.clock.sleep(1.0)
        raise RefusedError("the drive reports alarm 0x180", place=self.place)

    monkeypatch.setattr(FakeArm, "park", stuck)
    with pytest.raises(LabdaqError, match=r"in step park; the arm is NOT parked: .*alarm 0x180"):
        run_virtual(Lab().take(order(tmp_path)))
    (end,) = list_sessions(tmp_path)[0].events("session.end")
    assert "alarm 0x180" in end.body["arm"]


def test_steps_are_whole_or_unfinished(tmp_path: Path) -> None:
    """A done step has all its readings before it in the journal."""
    lab = Lab()
    (path,) = run_virtual(lab.take(order(tmp_path)))
    seen: Counter[str] = Counter()
    for event in Session.open(path).events():
        if event.kind == "reading":
            seen[event.body["step"]] += 1
        if event.kind == "step.done" and event.body["step"].startswith("plane"):
            assert seen[event.body["step"]] == 10
    assert any(isinstance(body, StepDone) and body.step == "park" for body in lab.shown)
