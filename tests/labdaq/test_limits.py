"""A limit ends a block with `TimeoutError`, also where a cancelled task cleans up; it swallows no cancellation."""

import asyncio
from collections.abc import Callable
from functools import partial
from types import TracebackType

import pytest

from labdaq.limits import limited
from labdaq.virtual_time import run_virtual


async def cleaning_up(seen: list[str]) -> None:
    """Wait for long; when cancelled, wait a little for something that does not come."""
    try:
        await asyncio.sleep(100.0)
    except asyncio.CancelledError:
        try:
            async with limited(1.0):
                await asyncio.sleep(100.0)
        except TimeoutError:
            seen.append("timed out")
        async with limited(1.0):
            seen.append("in time")
        raise


@pytest.mark.parametrize("seconds", [0.0, 1.0])
def test_a_block_that_takes_too_long_times_out(seconds: float) -> None:
    async def main() -> None:
        with pytest.raises(TimeoutError):
            async with limited(seconds):
                await asyncio.sleep(2.0)
        await asyncio.sleep(10.0)  # nothing is cancelled later on

    run_virtual(main())


def test_a_cancelled_task_may_still_time_out() -> None:
    async def main() -> None:
        seen: list[str] = []
        task = asyncio.create_task(cleaning_up(seen))
        await asyncio.sleep(1.0)
        task.cancel()
        with pytest.raises(asyncio.CancelledError):
            await task
        assert seen == ["timed out", "in time"]

    run_virtual(main())


class OldTimeout:
    """As before Python 3.11.3: in a task that was cancelled once, nothing times out."""

    def __init__(self, seconds: float, timeout: Callable[[float], asyncio.Timeout]) -> None:
        self._limit = timeout(seconds)
        self.expired = self._limit.expired

    async def __aenter__(self) -> asyncio.Timeout:
        return await self._limit.__aenter__()

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> bool | None:
        try:
            return await self._limit.__aexit__(kind, error, trace)
        except TimeoutError:
            task = asyncio.current_task()
            if task is not None and task.cancelling() > 0:
                raise asyncio.CancelledError from None
            raise


def test_it_does_so_where_the_standard_library_does_not(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(asyncio, "timeout", partial(OldTimeout, timeout=asyncio.timeout))
    test_a_cancelled_task_may_still_time_out()


@pytest.mark.parametrize("when_s", [0.5, 1.0])
def test_a_cancellation_inside_a_limit_stays_one(when_s: float) -> None:
    """Also one that comes in the very moment in which the limit is reached."""

    async def block() -> None:
        async with limited(1.0):
            await asyncio.sleep(100.0)

    async def main() -> None:
        task = asyncio.create_task(block())
        await asyncio.sleep(when_s)
        task.cancel()
        with pytest.raises(asyncio.CancelledError):
            await task

    run_virtual(main())


def test_of_two_limits_the_tighter_one_counts() -> None:
    async def main() -> None:
        with pytest.raises(TimeoutError):
            async with limited(1.0):
                try:
                    async with limited(5.0):
                        await asyncio.sleep(100.0)
                except TimeoutError:
                    pytest.fail("the wider limit took it for its own")

    run_virtual(main())
