"""The far end of a line, for tests: it expects certain bytes, answers others, and reports what did not fit.

It knows no protocol. What it says stands in the test, byte by byte, as the makers' documents have it.
"""

import asyncio
from collections.abc import AsyncIterator, Sequence
from contextlib import asynccontextmanager
from dataclasses import dataclass, field

from labdaq.pipe import PipeEnd, pipe
from labdaq.virtual_time import VirtualTimeLoop


@dataclass(frozen=True)
class Step:
    """Expect ``hears``, then say each piece of ``says`` after its delay [s]; ``hang_up`` closes the line at the end."""

    hears: bytes
    says: Sequence[tuple[float, bytes]] = ()
    hang_up: bool = False


def on(hears: bytes, *says: bytes, after: float = 0.02) -> Step:
    """Shorthand: expect ``hears`` and answer each of ``says``, ``after`` seconds apart."""
    return Step(hears, [(after, piece) for piece in says])


@dataclass
class FarEnd:
    """Plays steps on its end of a pipe and writes down when it heard what."""

    end: PipeEnd
    steps: Sequence[Step]
    heard: list[tuple[float, bytes]] = field(default_factory=list)
    wrong: list[str] = field(default_factory=list)
    played: int = 0

    async def play(self) -> None:
        loop = asyncio.get_running_loop()
        for step in self.steps:
            try:
                got = await self.end.reader.readexactly(len(step.hears))
            except asyncio.IncompleteReadError as error:
                if error.partial:
                    self.wrong.append(f"step {self.played}: only {error.partial!r} of {step.hears!r}")
                return
            self.heard.append((loop.time(), got))
            if got != step.hears:
                self.wrong.append(f"step {self.played}: expected {step.hears!r}, heard {got!r}")
                return
            self.played += 1
            for delay, piece in step.says:
                await asyncio.sleep(delay)
                self.end.write(piece)
            if step.hang_up:
                self.end.close()
                return
        extra = await self.end.reader.read(256)
        if extra:
            self.wrong.append(f"after the last step: heard {extra!r}")


@asynccontextmanager
async def far_end(*steps: Step) -> AsyncIterator[tuple[PipeEnd, FarEnd]]:
    """Give the near end of a line whose far end plays ``steps``; afterwards all must have been played, nothing more."""
    near, far = pipe()
    player = FarEnd(far, steps)
    task = asyncio.create_task(player.play())
    try:
        yield near, player
        await asyncio.sleep(0.001)  # let the player hear what was sent last
    finally:
        near.close()
        if not task.done():
            task.cancel()
        await asyncio.gather(task, return_exceptions=True)
    if not task.cancelled() and (error := task.exception()):
        raise error
    assert not player.wrong, "\n".join(player.wrong)
    assert player.played == len(steps), f"only {player.played} of {len(steps)} steps were played"


def now() -> float:
    """Virtual seconds."""
    loop = asyncio.get_running_loop()
    assert isinstance(loop, VirtualTimeLoop)
    return loop.time()
