"""Limiting how long a block may take, also in a task that was told to stop and is cleaning up.

Before Python 3.11.3 (Debian 12 has 3.11.2) `asyncio.timeout` does not raise `TimeoutError` in a task that was cancelled
before: the arm of a cancelled move would not be stopped, because the wait for a silent line looks like another
cancellation (https://github.com/python/cpython/issues/102780).
"""

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager


@asynccontextmanager
async def limited(seconds: float) -> AsyncIterator[None]:
    """Limit an ``async with`` block to ``seconds`` of the event loop's time; raises builtin `TimeoutError` beyond."""
    task = asyncio.current_task()
    assert task is not None
    cancelled_before = task.cancelling()
    limit = asyncio.timeout(seconds)
    try:
        async with limit:
            yield
    except asyncio.CancelledError:
        if limit.expired() and task.cancelling() <= cancelled_before:
            raise TimeoutError from None
        raise
