"""A fault at every step of a run: the arm is parked, the journal synced and sealed, one clear error, nothing left open.

Every await of every fake instrument fails in turn, in each way an instrument can fail; at every await of every task the
run is cancelled; every operation of the disk fails in turn.
"""

import asyncio
from collections.abc import Callable, Coroutine, Generator
from pathlib import Path
from typing import Any

import pytest
from fake_bench import Points
from session_helpers import FailingDisk
from test_scheduler import Lab, order

from labdaq import recorder as recorders
from labdaq.clock import NS, VirtualClock
from labdaq.errors import (
    DeviceError,
    DeviceTimeout,
    LabdaqError,
    Place,
    ProtocolError,
    RefusedError,
    StorageError,
)
from labdaq.headers import Order
from labdaq.seal import verify
from labdaq.session import Session, list_sessions
from labdaq.virtual_time import VirtualTimeLoop, run_virtual

SHORT = """
[exposures]
times_s = [1, "1/4", "1/1000"]
period_s = 3
[scan]
c_planes_deg = [0, 90, 180]
period_s = 3
[limits]
test_s = 120
"""
LONGEST_S = 120 + 150 + 3 * 60 + 30 + 5
"""Test limit, homing, three attempts to park, connecting, closing: no run may take longer, whatever goes wrong."""


def short(folder: Path) -> Order:
    return order(folder, SHORT)


def faults() -> dict[str, Callable[[Place], BaseException]]:
    return {
        "timeout": lambda place: DeviceTimeout("no answer", place=place),
        "protocol": lambda place: ProtocolError("bad check sum", place=place),
        "refused": lambda place: RefusedError("battery exhausted", place=place),
    }


def points_of_a_good_run(folder: Path) -> list[str]:
    lab = Lab()
    run_virtual(lab.take(short(folder)))
    return lab.points.passed


def assert_in_good_order(lab: Lab, folder: Path, took_s: float) -> Session | None:
    assert lab.bench
    arm = lab.bench.goniophotometer
    assert arm.parked, "the arm is not parked"  # type: ignore[attr-defined]
    assert not arm.moving  # type: ignore[attr-defined]
    assert [d.identity().name for d in lab.bench.devices if d.open] == []  # type: ignore[attr-defined]
    assert took_s < LONGEST_S
    sessions = list_sessions(folder) if folder.exists() else []
    for found in sessions:
        result = verify(found.path)
        assert result.problems == ()
        assert result.sealed
        assert result.torn_bytes == 0
    return sessions[0] if sessions else None


@pytest.mark.parametrize("how", list(faults()))
def test_an_instrument_fails_at_every_await(tmp_path: Path, how: str) -> None:
    points = points_of_a_good_run(tmp_path / "good")
    assert len(points) > 60
    for number, point in enumerate(points):
        lab = Lab(Points(fail_at=number, fail_with=faults()[how]))
        folder = tmp_path / str(number)

        async def take(lab: Lab = lab, folder: Path = folder) -> tuple[DeviceError, float]:
            clock = VirtualClock(0)
            with pytest.raises(DeviceError) as caught:
                await lab.take(short(folder))
            return caught.value, clock.mono_ns() / NS

        error, took_s = run_virtual(take())
        instrument, what = point.split(".")
        found = assert_in_good_order(lab, folder, took_s)
        assert isinstance(error, type(faults()[how](Place("", ""))))
        assert instrument in str(error), (point, str(error))
        if what.startswith("connect"):
            assert found is None
        else:
            assert "in step" in str(error)
            assert found
            assert found.outcome == "failed"
            (fault,) = found.events("fault")
            assert fault.body["instrument"] == instrument
            assert fault.body["step"] in str(error)
            (end,) = found.events("session.end")
            assert end.body["arm"] == "parked"


def test_an_instrument_hangs_at_every_await(tmp_path: Path) -> None:
    for number, point in enumerate(points_of_a_good_run(tmp_path / "good")):
        lab = Lab(Points(fail_at=number, fail_with=faults()["timeout"], hang=True))
        folder = tmp_path / str(number)

        async def take(lab: Lab = lab, folder: Path = folder) -> tuple[str, float]:
            clock = VirtualClock(0)
            with pytest.raises(DeviceError) as caught:
                await lab.take(short(folder))
            return str(caught.value), clock.mono_ns() / NS

        text, took_s = run_virtual(take())
        assert point.split(".")[0] in text
        assert_in_good_order(lab, folder, took_s)


class Counting:
    """Lets every task of a loop tell when it goes on after an await, and cancels one task at a chosen count."""

    def __init__(self, cancel_at: int = -1) -> None:
        self.count = 0
        self.cancel_at = cancel_at
        self.victim: asyncio.Task[Any] | None = None

    def factory(
        self, loop: asyncio.AbstractEventLoop, coro: Coroutine[Any, Any, Any], **more: Any
    ) -> asyncio.Task[Any]:
        return asyncio.Task(self._wrapped(coro), loop=loop, **more)

    async def _wrapped(self, coro: Coroutine[Any, Any, Any]) -> Any:
        return await _Steps(coro, self)

    def step(self) -> None:
        if self.count == self.cancel_at and self.victim is not None:
            asyncio.get_running_loop().call_soon(self.victim.cancel)
        self.count += 1


class _Steps:
    def __init__(self, coro: Coroutine[Any, Any, Any], counting: Counting) -> None:
        self.coro = coro
        self.counting = counting

    def __await__(self) -> Generator[Any, Any, Any]:
        send: Callable[[], Any] = lambda: self.coro.send(None)  # noqa: E731
        while True:
            self.counting.step()
            try:
                waits_for = send()
            except StopIteration as stop:
                return stop.value
            try:
                got = yield waits_for
                send = lambda got=got: self.coro.send(got)  # noqa: E731
            except BaseException as error:
                send = lambda error=error: self.coro.throw(error)  # noqa: E731


def run_and_cancel(lab: Lab, wanted: Order, cancel_at: int) -> tuple[int, str, float]:
    """Run with one cancellation; return how many awaits there were, how it ended, and the virtual seconds."""
    counting = Counting(cancel_at)

    async def main() -> tuple[str, float]:
        asyncio.get_running_loop().set_task_factory(counting.factory)  # type: ignore[arg-type]
        clock = VirtualClock(0)
        counting.victim = asyncio.ensure_future(lab.take(wanted))
        try:
            await counting.victim
        except asyncio.CancelledError:
            return "cancelled", clock.mono_ns() / NS
        return "finished", clock.mono_ns() / NS

    with asyncio.Runner(loop_factory=VirtualTimeLoop) as runner:
        ended, took_s = runner.run(main())
    return counting.count, ended, took_s


def test_the_run_is_cancelled_at_every_await(tmp_path: Path) -> None:
    total, ended, _ = run_and_cancel(Lab(), short(tmp_path / "good"), -1)
    assert ended == "finished"
    assert total > 120
    outcomes: dict[str, int] = {}
    for number in range(total):
        lab = Lab()
        folder = tmp_path / str(number)
        _, ended, took_s = run_and_cancel(lab, short(folder), number)
        found = assert_in_good_order(lab, folder, took_s) if lab.bench else None
        outcome = found.outcome if found else "none"
        assert outcome in {"interrupted", "finished", "none"}
        if outcome == "interrupted":
            assert ended == "cancelled"
        outcomes[outcome] = outcomes.get(outcome, 0) + 1
    assert outcomes["interrupted"] > outcomes.get("finished", 0)


def test_the_disk_fails_at_every_operation(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The exit code says so, the arm is parked, and what was acknowledged is there."""
    disk = FailingDisk(10**9)
    monkeypatch.setattr(recorders, "DeferredDisk", lambda: disk)
    run_virtual(Lab().take(short(tmp_path / "good")))
    total = len(disk.done)
    assert total > 60
    for number in range(total):
        disk = FailingDisk(number)
        lab, folder = Lab(), tmp_path / str(number)
        with pytest.raises(StorageError) as caught:
            run_virtual(lab.take(short(folder)))
        assert caught.value.exit_code == 74
        assert lab.bench
        assert lab.bench.goniophotometer.parked  # type: ignore[attr-defined]
        assert not any(d.open for d in lab.bench.devices)  # type: ignore[attr-defined]
        for found in list_sessions(folder):
            assert [p for p in verify(found.path).problems if "manifest" not in p] == []
            acknowledged = [type(body).__name__ for body in lab.shown].count("TakenReading")
            assert len(found.readings()) >= acknowledged


def test_parking_fails_too(tmp_path: Path) -> None:
    """Even then the journal is synced and sealed, and the error says that the arm is not parked."""

    class Broken(Points):
        def at(self, place: Place, what: str) -> BaseException | None:
            if what == "move-end" or what.startswith(("stop", "park")):
                return ProtocolError(f"no sense in {what}", place=place)
            return super().at(place, what)

    lab = Lab(Broken())
    with pytest.raises(LabdaqError, match=r"move-end; in step plane-00; the arm is NOT parked: .*park-begin"):
        run_virtual(lab.take(short(tmp_path)))
    (found,) = list_sessions(tmp_path)
    assert verify(found.path).sealed
    assert lab.bench
    assert not any(d.open for d in lab.bench.devices)  # type: ignore[attr-defined]


def test_a_late_answer_may_spoil_the_first_attempt_to_park(tmp_path: Path) -> None:
    class Late(Points):
        parks = 0

        def at(self, place: Place, what: str) -> BaseException | None:
            if what == "park-begin":
                self.parks += 1
            if what == "move-end" or (what == "park-begin" and self.parks == 1):
                return ProtocolError(f"no sense in {what}", place=place)
            return super().at(place, what)

    lab = Lab(Late())
    with pytest.raises(ProtocolError, match=r"move-end; in step plane-00$"):
        run_virtual(lab.take(short(tmp_path)))
    assert_in_good_order(lab, tmp_path, 0)


@pytest.mark.parametrize("again_s", [0.004, 0.1, 1.0])
def test_cancelled_again_while_parking(tmp_path: Path, again_s: float) -> None:
    lab = Lab()

    async def take() -> None:
        clock = VirtualClock(0)
        task = asyncio.ensure_future(lab.take(short(tmp_path)))
        await clock.sleep(4.0)
        while not task.done():
            task.cancel()
            await clock.sleep(again_s)
        with pytest.raises(asyncio.CancelledError):
            await task

    run_virtual(take())
    found = assert_in_good_order(lab, tmp_path, 0)
    assert found
    assert found.outcome == "interrupted"
