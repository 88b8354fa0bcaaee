"""Stopping early: asked politely first, then for good; and work that is carried through whatever happens."""

import asyncio
from collections.abc import Coroutine
from typing import Any, TypeVar

from labdaq.clock import NS, Clock

T = TypeVar("T")


class StopAsked(Exception):
    """Ends an instrument's task between two steps."""


class Stop:
    """The operator's wish to end a run, e.g. from a signal. Must be made inside the event loop it is used in."""

    def __init__(self) -> None:
        self.reason = ""
        self._asked = asyncio.Event()
        self._again = asyncio.Event()

    def request(self, reason: str) -> None:
        """Ask to stop: steps under way may end. Asked a second time, they may not."""
        if self._asked.is_set():
            self._again.set()
        self.reason = self.reason or reason
        self._asked.set()

    @property
    def requested(self) -> bool:
        """Whether somebody asked."""
        return self._asked.is_set()

    async def until(self, clock: Clock, due_ns: int) -> float:
        """Wait for an absolute monotonic time; return how late it is then [s]. Raises `StopAsked`."""
        if not self.requested:
            try:
                async with clock.timeout(max(0.0, (due_ns - clock.mono_ns()) / NS)):
                    await self._asked.wait()
            except TimeoutError:
                return (clock.mono_ns() - due_ns) / NS
        raise StopAsked

    async def or_else(self, work: Coroutine[Any, Any, T]) -> T:
        """Do ``work`` that may be broken off at any await; cancel it and raise `StopAsked` when somebody asks."""
        task = asyncio.ensure_future(work)
        asked = asyncio.ensure_future(self._asked.wait())
        try:
            await asyncio.wait((task, asked), return_when=asyncio.FIRST_COMPLETED)
        finally:
            asked.cancel()
            if not task.done():
                task.cancel()
                await asyncio.wait((task,))
        if task.cancelled():
            raise StopAsked
        return task.result()

    async def patience_is_over(self, clock: Clock, grace_s: float) -> None:
        """Return when steps under way have had their time: ``grace_s`` after the first wish [s], or at the second."""
        await self._asked.wait()
        try:
            async with clock.timeout(grace_s):
                await self._again.wait()
        except TimeoutError:
            return


async def carry_through(work: Coroutine[Any, Any, T]) -> T:
    """Run ``work`` to its end even when the caller is cancelled meanwhile; then raise the cancellation.

    ``work`` must limit its own time.
    """
    task = asyncio.ensure_future(work)
    cancelled: asyncio.CancelledError | None = None
    while not task.done():
        try:
            await asyncio.shield(task)
        except asyncio.CancelledError as error:
            cancelled = error
        except Exception:
            break  # the task's own; raised below
    if cancelled is not None and not task.cancelled() and task.exception() is None:
        raise cancelled
    return task.result()
