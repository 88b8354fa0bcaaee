"""A program for test_kill.py: writes readings and pictures as fast as it can, and tells what is acknowledged."""

import asyncio
import sys
from pathlib import Path

from session_helpers import header, photo, reading

from labdaq.clock import SystemClock
from labdaq.recorder import Recorder


def tell(text: str) -> None:
    sys.stdout.write(text + "\n")
    sys.stdout.flush()


async def write(folder: Path) -> None:
    clock = SystemClock()
    recorder = Recorder.create(folder, header(), clock, inline=False)

    async def readings(channel: str) -> None:
        number = 0
        while True:
            for _ in range(10):  # as the ten heads of one plane
                number += 1
                recorder.post(reading(clock, float(number), channel=channel))
            await recorder.synced()
            tell(f"reading {channel} {number}")

    async def photos() -> None:
        number = 0
        while True:
            number += 1
            stored = await recorder.photo(photo(clock, number.to_bytes(4, "big") * 50_000), f"exposure-{number}")
            tell(f"photo {stored.file} {stored.sha256}")

    tell("started")
    async with asyncio.TaskGroup() as group:
        for channel in ("sky.zenith", "sky.global", "sky.diffuse"):
            group.create_task(readings(channel))
        group.create_task(photos())


asyncio.run(write(Path(sys.argv[1])))
